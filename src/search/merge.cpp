// SPDX-License-Identifier: MIT
#include <algorithm>
#include <system_error>
#include <tuple>
#include <utility>

#include <fmt/format.h>

#include "pipeline/out_folder.hpp"
#include "search/identity.hpp"
#include "search/joined_records.hpp"
#include "search/record_file.hpp"
#include "search/report.hpp"
#include "stemvo/search/search.hpp"

namespace stemvo {
namespace {

namespace fs = std::filesystem;
using search::LayerIdentity;
using search::Record;
using search::RecordFileContent;
using search::SearchIdentity;

Expected<RecordFileContent> read_part(const fs::path& folder) {
  const fs::path file = folder / search::kRecordsFile;
  auto content = search::read_records(file);
  if (!content) {
    return content;
  }
  if (content->num_good_bytes == 0) {
    return fail(fmt::format("{}: expected the records of a search, found none", file.string()));
  }
  if (content->identity.schedule.size() != 1) {
    return fail(
        fmt::format("{}: expected a search with --exhaustive, found one that halves: its parts "
                    "cannot be joined",
                    file.string()));
  }
  const std::size_t expected = search::num_filters(content->identity);
  if (content->records.size() != expected) {
    return fail(fmt::format("{}: expected {} filters, found {}: finish it with --resume",
                            file.string(), expected, content->records.size()));
  }
  return content;
}

/// Ranges of a layer that meet or overlap become one.
std::vector<LayerIdentity> join_layers(std::vector<LayerIdentity> layers) {
  const auto key = [](const LayerIdentity& layer) {
    return std::tie(layer.model, layer.layer, layer.features, layer.first);
  };
  std::sort(layers.begin(), layers.end(),
            [&key](const LayerIdentity& a, const LayerIdentity& b) { return key(a) < key(b); });
  std::vector<LayerIdentity> joined;
  for (const LayerIdentity& layer : layers) {
    const bool goes_on = !joined.empty() && joined.back().model == layer.model &&
                         joined.back().layer == layer.layer &&
                         joined.back().features == layer.features &&
                         layer.first <= joined.back().last;
    if (goes_on) {
      joined.back().last = std::max(joined.back().last, layer.last);
    } else {
      joined.push_back(layer);
    }
  }
  return joined;
}

/// What the parts did not run another one knows.
void add_frames(const SearchIdentity& part, SearchIdentity& identity) {
  for (std::size_t i = 0; i < identity.sequences.size(); ++i) {
    if (identity.sequences[i].frames.empty()) {
      identity.sequences[i].frames = part.sequences[i].frames;
    }
  }
}

Status write_records(const fs::path& out_dir,
                     const SearchIdentity& identity,
                     const std::vector<Record>& records) {
  const fs::path file = out_dir / search::kRecordsFile;
  std::error_code code;
  if (fs::exists(file, code)) {
    return fail(fmt::format("{}: expected a folder without a search, found one", file.string()));
  }
  auto writer = search::RecordWriter::create(file, identity);
  return writer ? writer->append(records) : writer.error();
}

}  // namespace

Expected<SearchReport> merge_searches(const std::vector<fs::path>& parts,
                                      const fs::path& out_dir,
                                      const fs::path& models_dir) {
  SearchIdentity identity;
  std::vector<LayerIdentity> layers;
  search::JoinedRecords joined;
  for (const fs::path& part : parts) {
    auto content = read_part(part);
    if (!content) {
      return content.error();
    }
    if (identity.layers.empty()) {
      identity = content->identity;
    }
    identity.layers = layers.empty() ? identity.layers : layers;
    if (const std::string change = search::describe_change(identity, content->identity, true);
        !change.empty()) {
      return fail(fmt::format("{}: expected a part of the same search as {}, found that {}",
                              part.string(), parts.front().string(), change));
    }
    layers.insert(layers.end(), content->identity.layers.begin(), content->identity.layers.end());
    add_frames(content->identity, identity);
    if (const Status added = joined.add(part, content->records); !added) {
      return added.error();
    }
  }
  auto records = joined.all(identity);
  if (!records) {
    return records.error();
  }
  identity.layers = join_layers(std::move(layers));
  identity.schedule =
      search::exhaustive_schedule(search::num_filters(identity) - search::num_baselines(identity));
  identity.only_sequence.reset();
  Status status = pipeline::create_out_folder(out_dir);
  if (status) {
    status = write_records(out_dir, identity, *records);
  }
  if (!status) {
    return status.error();
  }
  return search::finish({out_dir, models_dir}, identity, *records, {});
}

}  // namespace stemvo
