// SPDX-License-Identifier: MIT
#include "search/search.hpp"

#include <algorithm>
#include <iterator>
#include <map>
#include <system_error>
#include <utility>

#include <fmt/format.h>

#include "pipeline/out_folder.hpp"
#include "pipeline/thread_scope.hpp"
#include "search/race.hpp"
#include "search/record_check.hpp"

namespace stemvo::search {
namespace {

namespace fs = std::filesystem;

Expected<SearchRecords> read_part(const fs::path& folder, const IsStopped& is_stopped) {
  const std::string file = (folder / kRecordsFile).string();
  auto part = read_records(file, is_stopped);
  if (!part) {
    return part;
  }
  const std::size_t num_rows = part->identity.num_rows();
  if (part->identity.rungs.size() != 1) {
    return fail(fmt::format(
        "{}: expected the records of a search with --exhaustive, found {}", file,
        part->num_good_bytes == 0 ? "none" : "one that halves: its parts cannot be joined"));
  }
  if (part->records.size() != num_rows) {
    return fail(fmt::format("{}: expected {} filters, found {}: finish it with --resume{}", file,
                            num_rows, part->records.size(),
                            part->warnings.empty() ? "" : " (" + part->warnings.front() + ")"));
  }
  return part;
}

/// The identity of all parts takes in another one's.
Status add_identity(const SearchIdentity& part, SearchIdentity& joined) {
  if (joined.layers.empty()) {  // the first
    joined = part;
    return {};
  }
  if (const std::string change = joined.change_to(part, true); !change.empty()) {
    return fail(change);
  }
  joined.layers.insert(joined.layers.end(), part.layers.begin(), part.layers.end());
  for (std::size_t i = 0; i < joined.sequences.size(); ++i) {
    if (joined.sequences[i].frames.empty()) {  // not run by the parts before
      joined.sequences[i].frames = part.sequences[i].frames;
    }
  }
  return {};
}

/// Scores of all parts: for each filter, by (is it held out, name of the sequence).
using Scores = std::map<FilterKey, std::map<std::pair<bool, std::string>, DriveScore>>;

/// Records that two parts hold must agree; else an error.
Status add_record(const FilterRecord& record, Scores& scores) {
  std::vector<DriveScore> found = record.drives;
  if (record.held_out) {
    found.push_back(*record.held_out);
  }
  for (std::size_t i = 0; i < found.size(); ++i) {
    const std::pair where(i == record.drives.size(), found[i].sequence);
    if (scores[record.key].try_emplace(where, found[i]).first->second != found[i]) {
      return fail(fmt::format("expected the result of another part for {} on {}, found another one",
                              to_string(record.key), found[i].sequence));
    }
  }
  return {};
}

/// A record per filter, as a search over all sequences writes it. Error: a filter that no part ran
/// on one of the sequences.
Expected<FilterRecords> join_records(const SearchIdentity& identity, const Scores& scores) {
  FilterRecords records;
  for (const auto& [key, found] : scores) {
    FilterRecord record = {0, key, {}, {}};
    for (const SequenceIdentity& sequence : identity.sequences) {
      const auto score = found.find({sequence.held_out, sequence.name});
      if (score == found.end()) {
        return fail(fmt::format("--merge: expected a part with {} on {}{}, found none",
                                to_string(key), sequence.name,
                                sequence.held_out ? " (held out)" : ""));
      }
      // An exhaustive search runs each frame once, or none where the layer cannot be run.
      record.add(score->second, sequence.held_out, score->second.frames);
    }
    records.insert(std::move(record));
  }
  return records;
}

/// Ranges of filters that meet or overlap become one.
std::vector<LayerIdentity> join_layers(const SearchIdentity& parts, const Scores& scores) {
  std::vector<LayerIdentity> joined;
  for (const auto& [key, found] : scores) {
    if (joined.empty() || !joined.back().is_layer_of(key) || joined.back().last < key.filter) {
      joined.push_back(parts.layer_of(key));
      joined.back().first = key.filter;
    }
    joined.back().last = key.filter + 1;
  }
  return joined;
}

std::vector<fs::path> inputs_of(const SearchRequest& request, const SearchPlan& plan) {
  std::vector<fs::path> inputs(request.models.begin(), request.models.end());
  for (const PlanSequence& one : plan.sequences) {
    const auto files = pipeline::input_files(one.sequence, request.config);
    inputs.insert(inputs.end(), files.begin(), files.end());
  }
  return inputs;
}

/// The parts joined so far grow to all. Error: the folder holds another search, or other results.
Status write_joined(const fs::path& file,
                    const SearchIdentity& identity,
                    const FilterRecords& records,
                    Scores scores,
                    const IsStopped& is_stopped) {
  auto joined = RecordFile::open(file, identity, /*resume=*/true, is_stopped);
  if (!joined) {
    return joined.error();
  }
  for (const FilterRecord& record : joined->records()) {
    if (const Status agrees = add_record(record, scores); !agrees) {
      return fail(fmt::format("{}: {}; give another --out", file.string(), agrees.error().message));
    }
  }
  std::vector<FilterRecord> missing;
  const FilterRecords& there = joined->records();
  std::set_difference(records.begin(), records.end(), there.begin(), there.end(),
                      std::back_inserter(missing));
  return joined->append(missing);
}

}  // namespace

Config search_defaults() {
  Config config;
  config.odometry.mode = OdometryMode::kTwoFrame;
  config.scale_choice = ScaleChoice::kGroundTruth;
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
  const Expected<SearchPlan> plan = make_plan(request);
  if (!plan) {
    return plan.error();
  }
  const auto lock = pipeline::open_out_folder(request.out_dir, "search", inputs_of(request, *plan));
  if (!lock) {
    return lock.error();
  }
  if (const Status status = check_identity(plan->identity); !status) {
    return status.error();  // its records could not be read again
  }
  auto records = RecordFile::open(request.out_dir / kRecordsFile, plan->identity, request.resume,
                                  request.is_stopped);
  if (!records) {
    return records.error();
  }
  const auto warnings = run_race(*plan, progress, *records);
  auto report =
      write_results(plan->identity, records->records(), {request.out_dir, request.command});
  if (!warnings) {
    return warnings.error();  // the tables hold what was done before
  }
  if (report) {
    report->warnings.insert(report->warnings.begin(), warnings->begin(), warnings->end());
    report->warnings.insert(report->warnings.begin(), records->warnings().begin(),
                            records->warnings().end());
  }
  return report;
}

Expected<SearchReport> merge_searches(const std::vector<std::filesystem::path>& parts,
                                      const std::filesystem::path& out_dir,
                                      const std::string& command,
                                      const IsStopped& is_stopped) {
  SearchIdentity identity;
  Scores scores;
  std::vector<std::string> warnings;
  std::vector<fs::path> inputs;
  for (const std::filesystem::path& folder : parts) {
    inputs.push_back(folder / kRecordsFile);
    const auto part = read_part(folder, is_stopped);
    if (!part) {
      return part.error();
    }
    if (const Status fits = add_identity(part->identity, identity); !fits) {
      return fail(fmt::format("{}: expected a part of the same search as {}, found that {}",
                              folder.string(), parts.front().string(), fits.error().message));
    }
    warnings.insert(warnings.end(), part->warnings.begin(), part->warnings.end());
    for (const FilterRecord& record : part->records) {
      if (const Status agrees = add_record(record, scores); !agrees) {
        return fail(fmt::format("{}: {}", folder.string(), agrees.error().message));
      }
    }
  }
  const auto records = join_records(identity, scores);
  if (!records) {
    return records.error();
  }
  identity.layers = join_layers(identity, scores);
  identity.rungs = {{1.0, identity.count(false)}};
  identity.only_sequence.reset();
  const auto lock = pipeline::open_out_folder(out_dir, "search", inputs);
  if (!lock) {
    return lock.error();
  }
  const Status written =
      write_joined(out_dir / kRecordsFile, identity, *records, scores, is_stopped);
  if (!written) {
    return written.error();
  }
  auto report = write_results(identity, *records, {out_dir, command});
  if (report) {
    report->warnings.insert(report->warnings.begin(), warnings.begin(), warnings.end());
  }
  return report;
}

}  // namespace stemvo::search
