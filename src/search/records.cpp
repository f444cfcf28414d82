// SPDX-License-Identifier: MIT
#include "search/records.hpp"

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstdint>
#include <string_view>
#include <system_error>

#include <fmt/format.h>
#include <nlohmann/json.hpp>
#include <sys/file.h>
#include <unistd.h>

#include "io/sha256.hpp"
#include "report/metrics_keys.hpp"
#include "search/record_check.hpp"
#include "text/text_file.hpp"

using Json = nlohmann::ordered_json;
using ReadJson = nlohmann::json;  // does not look at each key of an object for one

/// The library's NLOHMANN_DEFINE_TYPE_NON_INTRUSIVE, for objects whose keys keep their order.
#define STEMVO_JSON_MEMBERS(Type, ...)                                            \
  void to_json(Json& nlohmann_json_j, const Type& nlohmann_json_t) {              \
    NLOHMANN_JSON_EXPAND(NLOHMANN_JSON_PASTE(NLOHMANN_JSON_TO, __VA_ARGS__))      \
  }                                                                               \
  static void from_json(const ReadJson& nlohmann_json_j, Type& nlohmann_json_t) { \
    NLOHMANN_JSON_EXPAND(NLOHMANN_JSON_PASTE(NLOHMANN_JSON_FROM, __VA_ARGS__))    \
  }

namespace stemvo::search {

STEMVO_JSON_MEMBERS(FilterKey, model, layer, filter, features)
STEMVO_JSON_MEMBERS(DriveScore,
                    sequence,
                    frames,
                    detected,
                    reason,
                    t_rel_percent,
                    r_rel_deg_per_100m,
                    average_offset_m,
                    E_t_m,
                    E_r_deg,
                    inliers,
                    tracked,
                    early_error_percent,
                    dense_t_percent,
                    block,
                    path_xz_m)
/// Beside those of its key.
STEMVO_JSON_MEMBERS(FilterRecord, rung, filter_frames, held_out_filter_frames, drives, held_out)
STEMVO_JSON_MEMBERS(Rung, frame_share, filters)
STEMVO_JSON_MEMBERS(
    LayerIdentity, model, layer, features, first, last, hash, sampling_px, stem_model, baseline)
STEMVO_JSON_MEMBERS(SequenceIdentity,
                    name,
                    held_out,
                    disturbance,
                    first_frame,
                    num_frames,
                    frames,
                    calibration,
                    ground_truth,
                    directory)
STEMVO_JSON_MEMBERS(SearchIdentity, program, configuration, rungs, layers, sequences, only_sequence)

namespace {

/// One line: bytes of a file name that are not UTF-8 become the replacement character.
std::string text_of(const Json& json) {
  return json.dump(-1, ' ', false, Json::error_handler_t::replace);
}

// A line of the file, around its hash and what is in it.
constexpr std::string_view kBeforeHash = R"({"sha256":")";
constexpr std::string_view kBeforeText = R"(","of":)";
constexpr std::string_view kBehind = "}";

/// `seal`: begun with what is in the first line, for the others.
std::string sealed(const std::string& text, const internal::Sha256& seal) {
  return fmt::format("{}{}{}{}{}", kBeforeHash, seal.hex(text), kBeforeText, text, kBehind);
}

/// Content of a sealed line. Error, without file and line: no search wrote it.
Expected<std::string> unsealed(std::string_view line, const internal::Sha256& seal) {
  constexpr std::size_t kHashSize = 64;
  constexpr std::size_t kTextAt = kBeforeHash.size() + kHashSize + kBeforeText.size();
  if (line.size() > kMaxRecordBytes) {
    return fail(fmt::format("expected a line of at most {} bytes, found one of {}", kMaxRecordBytes,
                            line.size()));
  }
  const bool is_formed = line.size() > kTextAt && line.starts_with(kBeforeHash) &&
                         line.substr(0, kTextAt).ends_with(kBeforeText) && line.ends_with(kBehind);
  if (is_formed) {
    const std::string_view text = line.substr(kTextAt, line.size() - kTextAt - kBehind.size());
    if (line.substr(kBeforeHash.size(), kHashSize) == seal.hex(text)) {
      return std::string(text);
    }
  }
  return fail("expected a line as this version of stemvo wrote it, found another one");
}

/// How many lists and objects stand in each other at most, if it is JSON.
int depth_of(std::string_view text) {
  int depth = 0;
  int deepest = 0;
  bool is_string = false;
  for (std::size_t i = 0; i < text.size(); ++i) {
    const char c = text[i];
    if (is_string && c == '\\') {
      ++i;
    } else if (c == '"') {
      is_string = !is_string;
    } else if (!is_string && (c == '[' || c == '{')) {
      deepest = std::max(deepest, ++depth);
    } else if (!is_string && (c == ']' || c == '}')) {
      --depth;
    }
  }
  return deepest;
}

/// Checks the lines' members. A cast of a number that is none may be undefined, or give another
/// one.
bool has_whole_numbers(const ReadJson& json) {
  static constexpr std::array kWhole = {
      "rung",         "filter",      "filter_frames", "held_out_filter_frames",
      "frames",       "block",       "last",          "filters",
      "sampling_px",  "first_frame", "num_frames",    "first",
      "only_sequence"};
  constexpr std::uint64_t kMax = 1000000000;
  const auto is_sound = [&](const auto& member) {
    const ReadJson& value = member.value();
    const bool is_whole =
        !json.is_object() || !value.is_number() ||
        std::ranges::find(kWhole, member.key()) == kWhole.end() ||
        (value.is_number_unsigned() && value.template get<std::uint64_t>() <= kMax);
    return is_whole && (!value.is_structured() || has_whole_numbers(value));
  };
  const auto members = json.items();
  return std::all_of(members.begin(), members.end(), is_sound);
}

/// Error, without file and line: sealed or not, it is input, and no search wrote it.
Status add_line(const std::string& text, SearchRecords& records) try {
  constexpr int kMaxDepth = 8;  // of the deepest, path_xz_m, 5
  if (depth_of(text) > kMaxDepth) {
    return fail("expected a line of a search, found lists in lists");
  }
  const ReadJson json = ReadJson::parse(text);
  if (!has_whole_numbers(json)) {
    return fail("expected whole numbers of up to 1e9 where a search counts, found others");
  }
  if (records.first_line.empty()) {
    json.get_to(records.identity);
    records.first_line = text;
    return check_identity(records.identity);
  }
  FilterRecord record = json.get<FilterRecord>();
  json.get_to(record.key);
  if (Status status = check_record(record, records.identity); !status) {
    return status;
  }
  return records.records.insert(record).second
             ? Status()
             : Status(fail(fmt::format("expected {} once on rung {}, found it again",
                                       to_string(record.key), record.rung)));
} catch (const ReadJson::exception& problem) {
  return fail(fmt::format("expected a line of a search, found another one ({})", problem.what()));
}

}  // namespace

void FilterRecord::add(const DriveScore& score, bool is_held_out, std::size_t num_frames) {
  if (is_held_out) {
    held_out = score;
  } else {
    drives.push_back(score);
  }
  (is_held_out ? held_out_filter_frames : filter_frames) += num_frames;
}

Expected<SearchRecords> read_records(const std::filesystem::path& file,
                                     const IsStopped& is_stopped) {
  const Expected<std::string> text = read_text_file(file, kMaxRecords_MB);
  if (!text) {
    return text.error();
  }
  constexpr std::size_t kMaxWarnings = 5;
  constexpr std::size_t kMaxLeftOut = 1000;
  std::size_t num_left_out = 0;
  SearchRecords records;
  std::size_t& begin = records.num_good_bytes;
  std::size_t line_number = 0;
  internal::Sha256 seal({});
  for (std::size_t end = 0; (end = text->find('\n', begin)) != text->npos; begin = end + 1) {
    if (is_stopped && is_stopped()) {
      return fail(fmt::format("{}: interrupted while it was read", file.string()));
    }
    const auto line = unsealed(std::string_view(*text).substr(begin, end - begin), seal);
    const Status status = line ? add_line(*line, records) : Status(line.error());
    if (++line_number == 1) {
      seal = internal::Sha256(records.first_line);
    }
    if (status) {
      continue;
    }
    const std::string problem =
        fmt::format("{}: {}", at_line(file, line_number), one_line(status.error().message));
    if (line_number == 1) {
      return fail(problem);
    }
    if (++num_left_out > kMaxLeftOut) {
      return fail(
          fmt::format("{}; expected at most {} such lines, found more", problem, kMaxLeftOut));
    }
    if (num_left_out <= kMaxWarnings) {
      records.warnings.push_back(problem + "; left out");
    }
  }
  if (num_left_out > kMaxWarnings) {
    records.warnings.push_back(
        fmt::format("{}: {} more lines left out", file.string(), num_left_out - kMaxWarnings));
  }
  return records;
}

Expected<RecordFile> RecordFile::open(const std::filesystem::path& file,
                                      const SearchIdentity& identity,
                                      bool resume,
                                      const IsStopped& is_stopped) {
  std::FILE* stream = std::fopen(file.c_str(), resume ? "ae" : "axe");
  if (stream == nullptr) {
    const bool is_there = errno == EEXIST;
    return fail(fmt::format(
        "{}: expected a {}, found: {}", file.string(),
        is_there ? "folder without a search" : "file that can be written",
        is_there ? "one; --resume goes on with it" : std::generic_category().message(errno)));
  }
  RecordFile opened;
  opened.file_ = file;
  opened.stream_.reset(stream, &std::fclose);
  if (::flock(::fileno(stream), LOCK_EX | LOCK_NB) != 0) {  // as long as it is open
    return fail(fmt::format("{}: another search is writing it", file.string()));
  }
  auto before = read_records(file, is_stopped);
  if (!before) {
    return before.error();
  }
  const bool is_new = before->num_good_bytes == 0;  // or killed before its first line was written
  const std::string change = is_new ? "" : before->identity.change_to(identity, false);
  if (!change.empty()) {
    return fail(
        fmt::format("{}: {} since; give another --out, or what it was", file.string(), change));
  }
  opened.records_ = std::move(before->records);
  opened.warnings_ = std::move(before->warnings);
  if (::ftruncate(::fileno(stream), static_cast<off_t>(before->num_good_bytes)) != 0) {
    return fail(fmt::format("{}: cannot be written: {}", file.string(),
                            std::generic_category().message(errno)));
  }
  opened.first_line_ = is_new ? text_of(identity) : before->first_line;
  const Status written = opened.write(
      is_new ? sealed(opened.first_line_, internal::Sha256({})) + '\n' : std::string());
  return written ? Expected<RecordFile>(opened) : written.error();
}

Status RecordFile::append(const std::vector<FilterRecord>& records) {
  std::string text;
  const internal::Sha256 seal(first_line_);
  for (const FilterRecord& record : records) {
    Json json = record.key;
    to_json(json, record);
    text += sealed(text_of(json), seal) + '\n';
  }
  std::error_code code;
  const std::uintmax_t size = std::filesystem::file_size(file_, code);
  if (code) {
    return fail(
        fmt::format("{}: expected the records written so far: {}", file_.string(), code.message()));
  }
  if (size + text.size() > std::uintmax_t{kMaxRecords_MB} * 1000000) {
    return fail(fmt::format(
        "{}: expected at most {} MB of records, which can be read again, found more to write; "
        "give the other filters (--filters), sequences or frames an --out of their own",
        file_.string(), kMaxRecords_MB));
  }
  Status written = write(text);
  if (written) {
    records_.insert(records.begin(), records.end());
  }
  return written;
}

Status RecordFile::write(const std::string& text) {
  if (std::fwrite(text.data(), 1, text.size(), stream_.get()) != text.size() ||
      std::fflush(stream_.get()) != 0 || ::fsync(::fileno(stream_.get())) != 0) {
    return fail(fmt::format("{}: cannot be written: {}", file_.string(),
                            std::generic_category().message(errno)));
  }
  return {};
}

}  // namespace stemvo::search
