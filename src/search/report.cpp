// SPDX-License-Identifier: MIT
#include "search/report.hpp"

#include <algorithm>
#include <utility>

#include "search/ranking.hpp"
#include "search/tables.hpp"

namespace stemvo::search {
namespace {

/// All records of the last rung are there.
bool is_complete(const SearchIdentity& identity, const std::vector<Record>& records) {
  const int last = static_cast<int>(identity.schedule.size()) - 1;
  const auto done = std::count_if(records.begin(), records.end(),
                                  [last](const Record& record) { return record.rung == last; });
  const std::size_t expected = last == 0
                                   ? num_filters(identity)
                                   : identity.schedule.back().num_filters + num_baselines(identity);
  return static_cast<std::size_t>(done) == expected;
}

/// A layer that cannot be run on a sequence: all its filters have no frames there.
bool cannot_run(const LayerIdentity& layer,
                const std::string& sequence,
                const std::vector<Record>& records) {
  return std::any_of(records.begin(), records.end(), [&](const Record& record) {
    return record.key.model == layer.model && record.key.layer == layer.layer &&
           record.key.features == layer.features &&
           std::any_of(record.drives.begin(), record.drives.end(), [&](const DriveScore& drive) {
             return drive.sequence == sequence && drive.num_frames == 0;
           });
  });
}

SearchWork work_of(const SearchIdentity& identity, const std::vector<Record>& records) {
  SearchWork work;
  for (const Record& record : records) {
    (layer_of(identity, record.key).is_baseline ? work.baseline_filter_frames
                                                : work.filter_frames) += record.filter_frames;
    work.held_out_filter_frames += record.held_out_filter_frames;
  }
  for (const SequenceIdentity& sequence : identity.sequences) {
    for (const LayerIdentity& layer : identity.layers) {
      if (!sequence.is_held_out && !layer.is_baseline &&
          !cannot_run(layer, sequence.name, records)) {
        work.exhaustive_filter_frames +=
            sequence.num_frames * static_cast<std::size_t>(layer.last - layer.first);
      }
    }
  }
  return work;
}

}  // namespace

Expected<SearchReport> finish(const Folders& folders,
                              const SearchIdentity& identity,
                              const std::vector<Record>& records,
                              std::vector<std::string> warnings) {
  SearchReport report;
  report.is_part = identity.only_sequence.has_value();
  report.num_filters = num_filters(identity);
  report.work = work_of(identity, records);
  report.warnings = std::move(warnings);
  report.interrupted = !is_complete(identity, records);
  if (report.is_part) {  // ranks nothing
    return report;
  }
  report.rows = rank_filters(records, identity.schedule.size());
  if (const Status status = write_tables(folders.out_dir, identity, report); !status) {
    return status.error();
  }
  if (const Status status = write_contact_sheet(folders, identity, report); !status) {
    report.warnings.push_back("no sheet.png: " + status.error().message);
  }
  return report;
}

}  // namespace stemvo::search
