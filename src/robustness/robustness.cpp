// SPDX-License-Identifier: MIT
#include "robustness/robustness.hpp"

#include <algorithm>
#include <new>
#include <system_error>

#include <fmt/format.h>

#include "pipeline/frame_pipeline.hpp"
#include "pipeline/out_folder.hpp"
#include "pipeline/thread_scope.hpp"
#include "report/metrics_keys.hpp"
#include "robustness/contenders.hpp"
#include "robustness/disturbance.hpp"
#include "text/text_file.hpp"

namespace stemvo::robustness {
namespace {

bool is_among(std::string_view name, const auto& names) {
  return std::ranges::find(names, name) != names.end();
}

/// A disturbance at one of its strengths; null: the frames as they are.
struct PlannedRow {
  const Disturbance* disturbance = nullptr;
  std::size_t index = 0;
};

Expected<std::vector<PlannedRow>> plan_rows(const std::vector<std::string>& kinds) {
  for (const std::string& kind : kinds) {
    if (kind != kUndisturbed && find_disturbance(kind) == nullptr) {
      return fail(fmt::format("--kinds: expected some of {}, {}, found '{}'", kUndisturbed,
                              names_of_disturbances(), kind));
    }
  }
  std::vector<PlannedRow> rows;
  if (kinds.empty() || is_among(kUndisturbed, kinds)) {
    rows.emplace_back();
  }
  for (const Disturbance& one : disturbances()) {
    for (std::size_t i = 0; i < one.strengths.size(); ++i) {
      if (kinds.empty() || is_among(one.name, kinds)) {
        rows.push_back({&one, i});
      }
    }
  }
  return rows;
}

std::vector<Verdict> verdicts_of(const Row& row) {
  std::vector<Verdict> result;
  for (std::size_t control = 1; control < row.outcomes.size(); ++control) {
    std::vector<PairedErrors> rotation;
    std::vector<PairedErrors> translation;
    for (std::size_t drive = 0; drive < row.outcomes[0].size(); ++drive) {
      const Outcome& ours = row.outcomes[0][drive];
      const Outcome& theirs = row.outcomes[control][drive];
      if (ours.is_refused || theirs.is_refused) {  // drives that are left would be another row
        rotation.clear();
        translation.clear();
        break;
      }
      const std::size_t block = ours.dense.block;
      rotation.push_back({ours.dense.r_deg_per_100m, theirs.dense.r_deg_per_100m, block});
      translation.push_back({ours.dense.t_percent, theirs.dense.t_percent, block});
    }
    result.push_back({paired_ratio(rotation, 1), paired_ratio(translation, 1)});
  }
  return result;
}

Status write_report(const RobustnessReport& report, const RobustnessRequest& request) {
  const std::filesystem::path& folder = request.out_dir;
  for (const auto& [name, text] : {std::pair("robustness.csv", format_csv(report)),
                                   std::pair("robustness.json", to_text(document(report))),
                                   std::pair("robustness.txt", format_table(report))}) {
    if (const Status written = write_text_file(folder / name, text); !written) {
      return written;
    }
  }
  return write_page(folder / "report.html", report, request);
}

class Robustness {
 public:
  explicit Robustness(const RobustnessRequest& request) : request_(request) {}

  /// Everything that can be refused before work starts.
  Status plan() {
    bool has_color = false;
    for (const auto& folder : request_.sequence_dirs) {
      if (const Status opened = open(folder, has_color); !opened) {
        return opened;
      }
    }
    auto rows = plan_rows(request_.kinds);
    if (!rows) {
      return rows.error();
    }
    planned_ = *std::move(rows);
    auto contenders = make_contenders(request_.config, request_.controls, has_color);
    if (!contenders) {
      return contenders.error();
    }
    contenders_ = *std::move(contenders);
    return create_each();
  }

  [[nodiscard]] std::vector<std::filesystem::path> inputs() const {
    std::vector<std::filesystem::path> inputs;
    for (const FrameSource& source : sources_) {
      const auto files = pipeline::input_files(source, request_.config);
      inputs.insert(inputs.end(), files.begin(), files.end());
    }
    return inputs;
  }

  Expected<RobustnessReport> run() {
    for (const PlannedRow& planned : planned_) {
      std::optional<Row> row = run_row(planned);
      report_.interrupted = !row;
      if (row) {
        row->verdicts = verdicts_of(*row);
        report_.rows.push_back(*std::move(row));
      }
      if (const Status written = write_report(report_, request_); !written) {
        return written.error();
      }
      if (report_.interrupted) {
        break;
      }
    }
    return report_;
  }

 private:
  Status open(const std::filesystem::path& folder, bool& has_color) {
    auto source =
        open_kitti(folder, {.camera = request_.config.input.camera, .frames = request_.frames});
    if (!source) {
      return source.error();
    }
    if (!source->ground_truth) {
      return fail(fmt::format("{}: expected ground truth (../../poses/NN.txt), found none",
                              folder.string()));
    }
    std::error_code code;
    for (const auto& other : opened_) {
      if (std::filesystem::equivalent(other, folder, code)) {
        return fail(
            fmt::format("{}: expected each sequence once, found it twice", folder.string()));
      }
    }
    opened_.push_back(folder);
    // Drives of one number in two data sets are told apart by their folders.
    const bool is_new = !is_among(source->name, report_.drives);
    report_.drives.push_back(is_new ? source->name : folder.string());
    const auto first = source->read(0);
    has_color = has_color || (first && first->channels() == 3);
    sources_.push_back(*std::move(source));
    return {};
  }

  /// A model or filter that is not there is refused now, not in the middle.
  Status create_each() {
    for (const Contender& one : contenders_) {
      const auto odometry = PhasedOdometry::create(sources_.front().camera, one.config);
      if (!odometry) {
        return odometry.error();
      }
      report_.contenders.push_back(
          report_.contenders.empty()
              ? fmt::format("{} {}", odometry->stem_info().model, odometry->stem_info().filter)
              : one.name);
    }
    return {};
  }

  /// nullopt: stopped.
  std::optional<Row> run_row(const PlannedRow& planned) {
    const Disturbance* const disturbance = planned.disturbance;
    Row row;
    row.disturbance = disturbance == nullptr ? kUndisturbed : disturbance->name;
    row.group = disturbance == nullptr ? kUndisturbed : disturbance->group;
    row.strength = disturbance == nullptr ? 0.0 : disturbance->strengths[planned.index];
    row.outcomes.assign(contenders_.size(), std::vector<Outcome>(sources_.size()));
    for (std::size_t drive = 0; drive < sources_.size(); ++drive) {
      const FrameSource source =
          disturbance == nullptr
              ? sources_[drive]
              : disturb(sources_[drive], *disturbance, planned.index, request_.config.seed);
      for (std::size_t i = 0; i < contenders_.size(); ++i) {
        const std::string what = fmt::format("{}, {} {}, {}", report_.drives[drive],
                                             row.disturbance, row.strength, report_.contenders[i]);
        if (!run_one(contenders_[i].config, source, planned, what, row.outcomes[i][drive])) {
          return std::nullopt;
        }
      }
    }
    return row;
  }

  /// false: stopped.
  bool run_one(const Config& config,
               const FrameSource& source,
               const PlannedRow& planned,
               const std::string& what,
               Outcome& outcome) {
    Options options = config;
    options.threads = request_.num_threads > 0 ? request_.num_threads : options.threads;
    auto odometry = PhasedOdometry::create(source.camera, options);
    if (!odometry) {
      if (odometry.error().lacks_memory) {
        throw std::bad_alloc();  // of the contender it says nothing
      }
      warn(fmt::format("{}: {}", what, odometry.error().message));
      outcome.is_refused = true;
      ++num_done_;
      return goes_on();
    }
    Trajectory estimate;
    std::vector<FrameState> states;
    std::vector<bool> is_disturbed;
    bool is_stopped = false;
    const auto visit = [&](std::size_t i, const Expected<cv::Mat>& frame, const FrameResult& pose) {
      if (!frame) {
        warn(frame.error().message);
      }
      estimate.push_back(pose.world_from_camera);
      states.push_back(pose.state);
      is_disturbed.push_back(planned.disturbance != nullptr &&
                             planned.disturbance->disturbs(
                                 i, source.size(), planned.disturbance->strengths[planned.index]));
      is_stopped = !goes_on();
      return !is_stopped;
    };
    pipeline::run_frames(source, *odometry, visit);
    if (is_stopped) {
      return false;
    }
    const Trajectory& truth = *source.ground_truth;
    add_states(states, estimate, truth, is_disturbed, outcome);
    const bool has_true_steps = config.scale_choice == ScaleChoice::kGroundTruth;
    add_errors(has_true_steps ? rescale_steps(estimate, truth) : estimate, truth, config.evaluation,
               outcome);
    ++num_done_;
    return goes_on();
  }

  bool goes_on() const {
    return !request_.progress ||
           request_.progress(num_done_, planned_.size() * sources_.size() * contenders_.size());
  }

  void warn(const std::string& message) {
    if (!is_among(message, report_.warnings)) {
      report_.warnings.push_back(message);
    }
  }

  const RobustnessRequest& request_;
  std::vector<std::filesystem::path> opened_;
  std::vector<FrameSource> sources_;
  std::vector<Contender> contenders_;
  std::vector<PlannedRow> planned_;
  std::size_t num_done_ = 0;
  RobustnessReport report_;
};

}  // namespace

Expected<RobustnessReport> run_robustness(const RobustnessRequest& request) {
  if (const Status status = validate(request.config); !status) {
    return status.error();
  }
  const pipeline::ThreadScope threads(request.num_threads);
  Robustness robustness(request);
  if (const Status status = robustness.plan(); !status) {
    return status.error();
  }
  const auto lock = pipeline::open_out_folder(request.out_dir, "robustness", robustness.inputs());
  if (!lock) {
    return lock.error();
  }
  return robustness.run();
}

}  // namespace stemvo::robustness
