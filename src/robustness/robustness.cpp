// SPDX-License-Identifier: MIT
#include "robustness/robustness.hpp"

#include <algorithm>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "evaluation/metrics.hpp"
#include "geometry/degrees.hpp"
#include "pipeline/frame_pipeline.hpp"
#include "pipeline/out_folder.hpp"
#include "pipeline/thread_scope.hpp"
#include "report/frame_image.hpp"
#include "robustness/disturbance.hpp"
#include "text/text_file.hpp"

namespace stemvo::robustness {
namespace {

constexpr double kDenseShare = 1.0 / 8.0;  // of the path
constexpr double kJump_deg = 1.0;

struct Contender {
  std::string name;
  Config config;
};

/// MODEL:K.
bool is_filter_name(const std::string& name) {
  constexpr std::size_t kMaxFilter = 1000000;  // as stem.filter
  const std::size_t colon = name.rfind(':');
  return colon != std::string::npos && colon > 0 &&
         parse_index(name.substr(colon + 1)).value_or(kMaxFilter + 1) <= kMaxFilter;
}

/// The judged channel's configuration with another channel, or the paper's matching.
Contender make_control(const std::string& name, Config config) {
  const StemOptions none;
  const std::size_t colon = name.rfind(':');
  const bool is_filter = is_filter_name(name);
  config.stem.model = is_filter ? name.substr(0, colon) : name;
  config.stem.layer = none.layer;
  config.stem.filter =
      is_filter ? static_cast<int>(*parse_index(name.substr(colon + 1))) : none.filter;
  config.stem.sampling_px = none.sampling_px;
  for (const auto& [color, filter] : {std::pair("red", 0), {"green", 1}, {"blue", 2}}) {
    if (name == color) {
      config.stem.model = "input_layer";
      config.stem.filter = filter;
    }
  }
  if (name == "orb" || name == "sift") {
    config.stem.model = "gray";
    config.features.method = name == "orb" ? FeatureMethod::kOrb : FeatureMethod::kSift;
    config.odometry.mode = OdometryMode::kTwoFrame;
  }
  return {name, config};
}

bool is_color(const std::string& control) {
  return control == "red" || control == "green" || control == "blue";
}

/// What is found out while a drive runs.
struct Run {
  Trajectory trajectory;
  std::vector<FrameState> states;
};

/// Share, recovery and jumps from the states.
void add_states(const Run& run,
                const Trajectory& truth,
                const std::function<bool(std::size_t)>& disturbs,
                Outcome& outcome) {
  std::size_t num_tracked = 0;
  std::size_t num_lost = 0;
  bool was_disturbed = false;
  for (std::size_t i = 0; i < run.states.size(); ++i) {
    const bool measured = is_measured(run.states[i]);
    num_tracked += measured ? 1 : 0;
    if (i > 0 && measured && run.states[i] != FrameState::kInitializing) {
      const Rigid3 step = run.trajectory[i - 1].inverse() * run.trajectory[i];
      const Rigid3 true_step = truth[i - 1].inverse() * truth[i];
      outcome.jumps += kDegPerRad * (step.inverse() * true_step).angle_rad() > kJump_deg ? 1 : 0;
    }
    if (disturbs(i)) {
      was_disturbed = true;
      num_lost = 0;
    } else if (was_disturbed) {
      num_lost = measured ? 0 : num_lost + 1;
      outcome.recovery_frames = std::max(outcome.recovery_frames.value_or(0), num_lost);
      was_disturbed = !measured;
    }
  }
  outcome.tracked = static_cast<double>(num_tracked) / static_cast<double>(run.states.size());
}

void add_errors(const Trajectory& trajectory,
                const Trajectory& truth,
                const EvaluationOptions& options,
                Outcome& outcome) {
  const Metrics metrics = evaluate(trajectory, truth, options);
  outcome.t_rel_percent = metrics.t_rel_percent;
  outcome.r_rel_deg_per_100m = metrics.r_rel_deg_per_100m;
  const double length_m = kDenseShare * metrics.path_length_m;
  for (const SegmentError& segment : segment_errors(trajectory, truth, {&length_m, 1}, 1)) {
    outcome.dense_t_percent.push_back(segment.t_percent);
    outcome.dense_r_deg_per_100m.push_back(segment.r_deg_per_100m);
  }
  outcome.block = truth.size() - std::min(truth.size(), outcome.dense_t_percent.size());
}

class Robustness {
 public:
  explicit Robustness(const RobustnessRequest& request) : request_(request) {}

  /// Everything that can be refused before work starts.
  Status plan() {
    bool has_color = false;
    for (const auto& folder : request_.sequence_dirs) {
      auto source = KittiSequence::open(
          folder, {.camera = request_.config.input.camera, .frames = request_.frames});
      if (!source) {
        return source.error();
      }
      if (!source->ground_truth()) {
        return fail(fmt::format("{}: expected ground truth (../../poses/NN.txt), found none",
                                folder.string()));
      }
      const auto first = source->read(0);
      has_color = has_color || (first && first->channels() == 3);
      report_.drives.push_back(source->name());
      sources_.push_back(*std::move(source));
    }
    if (const Status status = plan_kinds(); !status) {
      return status;
    }
    return plan_contenders(has_color);
  }

  Expected<RobustnessReport> run() {
    for (const auto& [disturbance, index] : planned_) {
      Row row{disturbance == nullptr ? kUndisturbed : std::string(disturbance->name),
              disturbance == nullptr ? 0.0 : disturbance->strengths[index],
              {contenders_.size(), std::vector<Outcome>(sources_.size())}};
      for (std::size_t drive = 0; drive < sources_.size(); ++drive) {
        const FrameSource source = disturbance == nullptr ? sources_[drive]
                                                          : disturb(sources_[drive], *disturbance,
                                                                    index, request_.config.seed);
        for (std::size_t i = 0; i < contenders_.size(); ++i) {
          const Status done = run_one(row, source, disturbance, i, row.outcomes[i][drive]);
          if (!done) {
            return done.error();
          }
          if (report_.interrupted) {
            return report_;
          }
        }
      }
      report_.rows.push_back(std::move(row));
    }
    return report_;
  }

 private:
  Status plan_kinds() {
    std::vector<std::string> known = {kUndisturbed};
    for (const Disturbance& one : disturbances()) {
      known.emplace_back(one.name);
    }
    for (const std::string& kind : request_.kinds) {
      if (std::ranges::find(known, kind) == known.end()) {
        return fail(
            fmt::format("--kinds: expected some of {}, found '{}'", fmt::join(known, ", "), kind));
      }
    }
    const auto is_asked = [&](std::string_view kind) {
      return request_.kinds.empty() ||
             std::ranges::find(request_.kinds, kind) != request_.kinds.end();
    };
    if (is_asked(kUndisturbed)) {
      planned_.emplace_back(nullptr, 0);
    }
    for (const Disturbance& one : disturbances()) {
      for (std::size_t i = 0; i < one.strengths.size() && is_asked(one.name); ++i) {
        planned_.emplace_back(&one, i);
      }
    }
    return {};
  }

  Status plan_contenders(bool has_color) {
    contenders_.push_back({"judged", request_.config});
    const bool asks_all = request_.controls.empty();
    for (const std::string& name : asks_all ? all_controls() : request_.controls) {
      if (!is_filter_name(name) &&
          std::ranges::find(all_controls(), name) == all_controls().end()) {
        return fail(fmt::format("--controls: expected some of {} or MODEL:FILTER, found '{}'",
                                fmt::join(all_controls(), ", "), name));
      }
      if (has_color || !is_color(name) || !asks_all) {
        contenders_.push_back(make_control(name, request_.config));
      }
    }
    for (const Contender& one : contenders_) {
      const auto odometry =
          pipeline::create_odometry(one.config, sources_.front().camera(), request_.models_dir);
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

  Status run_one(const Row& row,
                 const FrameSource& source,
                 const Disturbance* disturbance,
                 std::size_t contender,
                 Outcome& outcome) {
    const Config& config = contenders_[contender].config;
    ++num_begun_;
    if (request_.on_run &&
        !request_.on_run(fmt::format("{}/{} {}, {} {}, {}", num_begun_,
                                     planned_.size() * sources_.size() * contenders_.size(),
                                     source.name(), row.disturbance, row.strength,
                                     report_.contenders[contender]))) {
      report_.interrupted = true;
      return {};
    }
    auto odometry = pipeline::create_odometry(config, source.camera(), request_.models_dir);
    if (!odometry) {
      return odometry.error();
    }
    Run run;
    const auto visit = [&](std::size_t i, const Expected<cv::Mat>& frame, const FrameResult& pose) {
      if (!frame) {
        report_.warnings.push_back(frame.error().message);
      }
      run.trajectory.push_back(pose.world_from_camera);
      run.states.push_back(pose.state);
      report_.interrupted = request_.on_frame && !request_.on_frame(i + 1, source.size());
      return !report_.interrupted;
    };
    pipeline::run_frames(source, *odometry, visit);
    if (report_.interrupted) {
      return {};
    }
    const Trajectory& truth = *source.ground_truth();
    add_states(
        run, truth,
        [&](std::size_t frame) {
          return disturbance != nullptr &&
                 disturbance->disturbs(frame, source.size(), row.strength);
        },
        outcome);
    const bool has_true_steps = config.scale.source == ScaleSource::kGroundTruth;
    add_errors(has_true_steps ? rescale_steps(run.trajectory, truth) : run.trajectory, truth,
               config.evaluation, outcome);
    return {};
  }

  const RobustnessRequest& request_;
  std::vector<FrameSource> sources_;
  std::vector<Contender> contenders_;
  std::vector<std::pair<const Disturbance*, std::size_t>> planned_;
  std::size_t num_begun_ = 0;
  RobustnessReport report_;
};

}  // namespace

const std::vector<std::string>& all_controls() {
  static const std::vector<std::string> kAll = {"gray", "red",    "green", "blue",
                                                "log",  "census", "orb",   "sift"};
  return kAll;
}

std::vector<Verdict> verdicts(const RobustnessReport& report, const std::vector<const Row*>& rows) {
  std::vector<Verdict> result;
  for (std::size_t control = 1; control < report.contenders.size(); ++control) {
    std::vector<PairedErrors> rotation;
    std::vector<PairedErrors> translation;
    for (const Row* row : rows) {
      for (std::size_t drive = 0; drive < report.drives.size(); ++drive) {
        const Outcome& ours = row->outcomes[0][drive];
        const Outcome& theirs = row->outcomes[control][drive];
        rotation.push_back({ours.dense_r_deg_per_100m, theirs.dense_r_deg_per_100m, ours.block});
        translation.push_back({ours.dense_t_percent, theirs.dense_t_percent, ours.block});
      }
    }
    result.push_back({paired_ratio(rotation, 1), paired_ratio(translation, 1)});
  }
  return result;
}

Expected<RobustnessReport> run_robustness(const RobustnessRequest& request) {
  if (const Status status = validate(request.config); !status) {
    return status.error();
  }
  const pipeline::ThreadScope threads(request.num_threads);
  Robustness robustness(request);
  if (const Status status = robustness.plan(); !status) {
    return status.error();
  }
  if (const Status made = pipeline::create_out_folder(request.out_dir); !made) {
    return made.error();
  }
  auto report = robustness.run();
  if (!report) {
    return report;
  }
  for (const auto& [name, text] : {std::pair("robustness.csv", format_csv(*report)),
                                   std::pair("robustness.json", format_json(*report)),
                                   std::pair("robustness.txt", format_table(*report))}) {
    if (const Status written = write_text_file(request.out_dir / name, text); !written) {
      return written.error();
    }
  }
  const Status drawn = write_image(request.out_dir / "robustness.png", draw_figure(*report));
  return drawn ? report : drawn.error();
}

}  // namespace stemvo::robustness
