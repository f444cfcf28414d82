// SPDX-License-Identifier: MIT
#include <algorithm>
#include <map>
#include <system_error>
#include <tuple>
#include <utility>

#include <fmt/format.h>

#include "pipeline/out_folder.hpp"
#include "search/results.hpp"

namespace stemvo {
namespace search {
namespace {

namespace fs = std::filesystem;

Expected<SearchRecords> read_part(const fs::path& folder) {
  const std::string file = (folder / kRecordsFile).string();
  auto part = read_records(file);
  if (!part) {
    return part;
  }
  if (part->num_good_bytes == 0) {
    return fail(fmt::format("{}: expected the records of a search, found none", file));
  }
  if (part->identity.rungs.size() != 1) {
    return fail(
        fmt::format("{}: expected a search with --exhaustive, found one that halves: its parts "
                    "cannot be joined",
                    file));
  }
  if (part->records.size() != part->identity.num_filters()) {
    return fail(fmt::format("{}: expected {} filters, found {}: finish it with --resume", file,
                            part->identity.num_filters(), part->records.size()));
  }
  return part;
}

/// The identity of all parts takes in another one's.
Status add_identity(const SearchIdentity& part, SearchIdentity& joined) {
  if (joined.layers.empty()) {  // the first
    joined = part;
    return {};
  }
  if (const std::string change = describe_change(joined, part, true); !change.empty()) {
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

/// Ranges of a layer that meet or overlap become one.
std::vector<LayerIdentity> join_layers(std::vector<LayerIdentity> layers) {
  std::ranges::sort(layers, {}, [](const LayerIdentity& layer) {
    return std::tie(layer.model, layer.layer, layer.features, layer.first);
  });
  std::vector<LayerIdentity> joined;
  for (const LayerIdentity& layer : layers) {
    if (!joined.empty() && joined.back().is_layer_of(layer.key(0)) &&
        layer.first <= joined.back().last) {
      joined.back().last = std::max(joined.back().last, layer.last);
    } else {
      joined.push_back(layer);
    }
  }
  return joined;
}

/// What all parts found: of each filter, by sequence of the identity.
using Scores = std::map<FilterKey, std::vector<std::optional<DriveScore>>>;

/// What two parts hold is no trouble where they agree; else an error.
Status add_record(const std::vector<SequenceIdentity>& sequences,
                  const FilterRecord& record,
                  Scores& scores) {
  auto& known = scores[record.key];
  known.resize(sequences.size());
  for (std::size_t i = 0; i < sequences.size(); ++i) {
    std::optional<DriveScore> found = sequences[i].held_out ? record.held_out : std::nullopt;
    for (const DriveScore& drive : record.drives) {
      found = !sequences[i].held_out && drive.sequence == sequences[i].name ? drive : found;
    }
    if (found && known[i] && found != known[i]) {
      return fail(fmt::format("expected the result of another part for {} on {}, found another one",
                              to_string(record.key), sequences[i].name));
    }
    known[i] = found ? found : known[i];
  }
  return {};
}

/// A record per filter, as a search over all sequences writes it. Error: a filter that no part ran
/// on one of the sequences.
Expected<std::vector<FilterRecord>> join_records(const std::vector<SequenceIdentity>& sequences,
                                                 const Scores& scores) {
  std::vector<FilterRecord> records;
  for (const auto& [key, found] : scores) {
    FilterRecord& record = records.emplace_back();
    record.key = key;
    for (std::size_t i = 0; i < sequences.size(); ++i) {
      if (!found[i]) {
        return fail(fmt::format("--merge: expected a part with {} on {}{}, found none",
                                to_string(key), sequences[i].name,
                                sequences[i].held_out ? " (held out)" : ""));
      }
      // An exhaustive search runs each frame once, or none where the layer cannot be run.
      if (sequences[i].held_out) {
        record.held_out = found[i];
        record.held_out_filter_frames = found[i]->num_frames;
      } else {
        record.drives.push_back(*found[i]);
        record.filter_frames += found[i]->num_frames;
      }
    }
  }
  return records;
}

}  // namespace
}  // namespace search

Expected<SearchReport> merge_searches(const std::vector<std::filesystem::path>& parts,
                                      const std::filesystem::path& out_dir,
                                      const std::filesystem::path& models_dir) {
  search::SearchIdentity identity;
  search::Scores scores;
  for (const std::filesystem::path& folder : parts) {
    const auto part = search::read_part(folder);
    if (!part) {
      return part.error();
    }
    if (const Status fits = search::add_identity(part->identity, identity); !fits) {
      return fail(fmt::format("{}: expected a part of the same search as {}, found that {}",
                              folder.string(), parts.front().string(), fits.error().message));
    }
    for (const FilterRecord& record : part->records) {
      const Status agrees = search::add_record(identity.sequences, record, scores);
      if (!agrees) {
        return fail(fmt::format("{}: {}", folder.string(), agrees.error().message));
      }
    }
  }
  const auto records = search::join_records(identity.sequences, scores);
  if (!records) {
    return records.error();
  }
  identity.layers = search::join_layers(std::move(identity.layers));
  identity.rungs = {{1.0, identity.num_filters() - identity.num_baselines()}};
  identity.only_sequence.reset();
  if (const Status status = pipeline::create_out_folder(out_dir); !status) {
    return status.error();
  }
  const std::filesystem::path file = out_dir / search::kRecordsFile;
  std::error_code code;
  if (std::filesystem::exists(file, code)) {
    return fail(fmt::format("{}: expected a folder without a search, found one", file.string()));
  }
  auto writer = search::RecordWriter::open(file, identity);
  const Status written = writer ? writer->append(*records) : writer.error();
  return written ? search::write_results({out_dir, models_dir}, identity, *records)
                 : written.error();
}

}  // namespace stemvo
