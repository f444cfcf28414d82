// SPDX-License-Identifier: MIT
#include "search/search.hpp"

#include <algorithm>
#include <system_error>
#include <utility>

#include <fmt/format.h>

#include "pipeline/out_folder.hpp"
#include "pipeline/thread_scope.hpp"
#include "search/halving.hpp"
#include "search/race.hpp"
#include "search/results.hpp"
#include "text/text_file.hpp"

namespace stemvo {
namespace search {
namespace {

namespace fs = std::filesystem;

/// What the folder holds of the same search; nothing, with no good bytes, where none was begun.
Expected<SearchRecords> records_before(const SearchRequest& request,
                                       const SearchIdentity& identity) {
  const fs::path file = request.out_dir / kRecordsFile;
  std::error_code code;
  if (!fs::exists(file, code)) {
    return SearchRecords();
  }
  if (!request.resume) {
    return fail(
        fmt::format("{}: expected a folder without a search, found one: --resume goes on with it",
                    file.string()));
  }
  auto records = read_records(file);
  if (!records) {
    return records;
  }
  if (records->num_good_bytes == 0) {  // killed before its first line was written
    fs::remove(file, code);
    return records;
  }
  if (const std::string change = describe_change(records->identity, identity, false);
      !change.empty()) {
    return fail(fmt::format("--resume: {}: {} since; give another --out, or what it was",
                            file.string(), change));
  }
  return records;
}

SearchWork work_of(const SearchIdentity& identity, const std::vector<FilterRecord>& records) {
  SearchWork work;
  for (const FilterRecord& record : records) {
    (identity.layer_of(record.key).baseline ? work.baseline_filter_frames : work.filter_frames) +=
        record.filter_frames;
    work.held_out_filter_frames += record.held_out_filter_frames;
  }
  for (const SequenceIdentity& sequence : identity.sequences) {
    for (const LayerIdentity& layer : identity.layers) {
      // Of a layer that cannot be run on a sequence all filters have no frames there.
      const bool cannot_run = std::ranges::any_of(records, [&](const FilterRecord& record) {
        return layer.is_layer_of(record.key) &&
               std::ranges::any_of(record.drives, [&](const DriveScore& drive) {
                 return drive.sequence == sequence.name && drive.num_frames == 0;
               });
      });
      if (!sequence.held_out && !layer.baseline && !cannot_run) {
        work.exhaustive_filter_frames += sequence.num_frames * layer.size();
      }
    }
  }
  return work;
}

}  // namespace

Expected<SearchReport> write_results(const Folders& folders,
                                     const SearchIdentity& identity,
                                     const std::vector<FilterRecord>& records) {
  SearchReport report;
  report.is_part = identity.only_sequence.has_value();
  report.num_filters = identity.num_filters();
  report.work = work_of(identity, records);
  const auto num_done = std::ranges::count(records, identity.rungs.size() - 1, &FilterRecord::rung);
  report.interrupted = static_cast<std::size_t>(num_done) !=
                       identity.rungs.back().filters + identity.num_baselines();
  if (report.is_part) {  // ranks nothing
    return report;
  }
  report.rows = rank_filters(records, identity.rungs.size());
  const fs::path file = folders.out_dir / "config.yaml";
  if (const Status status = write_text_file(file, identity.configuration); !status) {
    return status.error();
  }
  const Expected<Config> common = load_config(file);
  if (!common) {
    return common.error();
  }
  if (const Status status = write_tables(folders, identity, *common, report); !status) {
    return status.error();
  }
  if (const Status status = write_contact_sheet(folders, identity, *common, report.rows); !status) {
    report.warnings.push_back("no sheet.png: " + status.error().message);
  }
  return report;
}

}  // namespace search

Config search_defaults() {
  Config config;
  config.odometry.mode = OdometryMode::kTwoFrame;
  config.scale.source = ScaleSource::kGroundTruth;
  config.features.max_features = 400;
  config.features.klt_window = 23;
  // The refinement behind it forgets which estimator brought the first guess.
  config.two_view.estimator = RobustEstimator::kRansac;
  config.two_view.max_iterations = 200;
  config.two_view.confidence = 0.99;
  return config;
}

Expected<SearchReport> run_search(const SearchRequest& request, const SearchProgress& progress) {
  const pipeline::ThreadScope threads(request.num_threads);
  const Expected<search::SearchPlan> plan = search::make_plan(request);
  if (!plan) {
    return plan.error();
  }
  if (const Status status = pipeline::create_out_folder(request.out_dir); !status) {
    return status.error();
  }
  auto before = search::records_before(request, plan->identity);
  if (!before) {
    return before.error();
  }
  auto writer = search::RecordWriter::open(request.out_dir / search::kRecordsFile, plan->identity,
                                           before->num_good_bytes);
  if (!writer) {
    return writer.error();
  }
  const auto warnings = search::run_race(*plan, progress, *writer, before->records);
  if (!warnings) {
    return warnings.error();
  }
  auto report =
      search::write_results({request.out_dir, request.models_dir}, plan->identity, before->records);
  if (report) {
    report->warnings.insert(report->warnings.begin(), warnings->begin(), warnings->end());
  }
  return report;
}

}  // namespace stemvo
