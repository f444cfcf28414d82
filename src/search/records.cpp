// SPDX-License-Identifier: MIT
#include "search/records.hpp"

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <functional>
#include <numeric>

#include <fmt/format.h>
#include <nlohmann/json.hpp>
#include <sys/file.h>
#include <unistd.h>

#include "internal_check.hpp"
#include "report/metrics_keys.hpp"
#include "text/text_file.hpp"

using Json = nlohmann::ordered_json;

/// The library's NLOHMANN_DEFINE_TYPE_NON_INTRUSIVE, for objects whose keys keep their order.
#define STEMVO_JSON_MEMBERS(Type, ...)                                         \
  void to_json(Json& nlohmann_json_j, const Type& nlohmann_json_t) {           \
    NLOHMANN_JSON_EXPAND(NLOHMANN_JSON_PASTE(NLOHMANN_JSON_TO, __VA_ARGS__))   \
  }                                                                            \
  static void from_json(const Json& nlohmann_json_j, Type& nlohmann_json_t) {  \
    NLOHMANN_JSON_EXPAND(NLOHMANN_JSON_PASTE(NLOHMANN_JSON_FROM, __VA_ARGS__)) \
  }

namespace stemvo {

STEMVO_JSON_MEMBERS(FilterKey, model, layer, filter, features)

void to_json(Json& json, const DriveScore& score) {
  json = {{"sequence", score.sequence},
          {"frames", score.num_frames},
          {"detected", score.is_detected},
          {"reason", score.reason}};
  for (const search::ScoreNumber& number : search::kScoreNumbers) {
    json[number.key] = score.*number.value;
  }
  json["path_xz_m"] = score.path;
}

static void from_json(const Json& json, DriveScore& score) {
  json.at("sequence").get_to(score.sequence);
  json.at("frames").get_to(score.num_frames);
  json.at("detected").get_to(score.is_detected);
  json.at("reason").get_to(score.reason);
  for (const search::ScoreNumber& number : search::kScoreNumbers) {
    json.at(number.key).get_to(score.*number.value);
  }
  json.at("path_xz_m").get_to(score.path);
}

/// Beside those of its key.
STEMVO_JSON_MEMBERS(FilterRecord, rung, filter_frames, held_out_filter_frames, drives, held_out)

}  // namespace stemvo

namespace stemvo::search {

STEMVO_JSON_MEMBERS(Rung, frame_share, filters)
STEMVO_JSON_MEMBERS(
    LayerIdentity, model, layer, features, first, last, hash, sampling_px, stem_model, baseline)
STEMVO_JSON_MEMBERS(SequenceIdentity,
                    name,
                    held_out,
                    first_frame,
                    num_frames,
                    frames,
                    calibration,
                    ground_truth,
                    directory)
STEMVO_JSON_MEMBERS(
    SearchIdentity, stemvo_search, program, configuration, rungs, layers, sequences, only_sequence)

namespace {

/// One line; bytes of a file name that are not UTF-8 become the replacement character.
std::string line_of(const Json& json) {
  return json.dump(-1, ' ', false, Json::error_handler_t::replace) + '\n';
}

/// The first line is the identity. Error without the file: not JSON, a key missing or of another
/// type, another format.
Status parse_line(const std::string& line, bool is_first, SearchRecords& records) {
  try {
    const Json json = Json::parse(line);
    if (!is_first) {
      records.records.push_back(json.get<FilterRecord>());
      json.get_to(records.records.back().key);
      return {};
    }
    const int format = json.at("stemvo_search").get<int>();
    const int expected = records.identity.stemvo_search;
    if (format != expected) {
      return fail(fmt::format("expected records of format {}, found {}", expected, format));
    }
    json.get_to(records.identity);
    return {};
  } catch (const Json::exception& error) {
    return fail(fmt::format("expected {}, found: {}",
                            is_first ? "the identity of a search" : "the record of a filter",
                            error.what()));
  }
}

}  // namespace

std::size_t SearchIdentity::num_filters() const {
  return std::transform_reduce(layers.begin(), layers.end(), std::size_t{0}, std::plus<>(),
                               [](const LayerIdentity& layer) { return layer.size(); });
}

std::size_t SearchIdentity::num_baselines() const {
  return std::transform_reduce(
      layers.begin(), layers.end(), std::size_t{0}, std::plus<>(),
      [](const LayerIdentity& layer) { return layer.baseline ? layer.size() : 0; });
}

const LayerIdentity& SearchIdentity::layer_of(const FilterKey& key) const {
  const auto layer = std::ranges::find_if(layers, [&key](const LayerIdentity& one) {
    return one.is_layer_of(key) && one.first <= key.filter && key.filter < one.last;
  });
  STEMVO_CHECK(layer != layers.end(), "each row has a layer");
  return *layer;
}

Expected<SearchRecords> read_records(const std::filesystem::path& file) {
  const Expected<std::string> text = read_text_file(file);
  if (!text) {
    return text.error();
  }
  SearchRecords records;
  std::size_t& begin = records.num_good_bytes;
  std::size_t line_number = 0;
  for (std::size_t end = 0; (end = text->find('\n', begin)) != text->npos; begin = end + 1) {
    ++line_number;
    const Status parsed = parse_line(text->substr(begin, end - begin), line_number == 1, records);
    if (!parsed) {
      return fail(fmt::format("{}: {}", at_line(file, line_number), parsed.error().message));
    }
  }
  return records;
}

Expected<RecordWriter> RecordWriter::open(const std::filesystem::path& file,
                                          const SearchIdentity& identity,
                                          std::size_t num_good_bytes) {
  const bool is_new = num_good_bytes == 0;
  std::FILE* stream = std::fopen(file.c_str(), is_new ? "axe" : "ae");
  if (stream == nullptr) {
    return fail(fmt::format("{}: cannot be {}: {}", file.string(), is_new ? "created" : "written",
                            std::strerror(errno)));
  }
  RecordWriter writer;
  writer.file_ = file;
  writer.stream_.reset(stream, &std::fclose);
  if (::flock(::fileno(stream), LOCK_EX | LOCK_NB) != 0) {  // as long as the stream is open
    return fail(fmt::format("{}: another search is writing it", file.string()));
  }
  if (::ftruncate(::fileno(stream), static_cast<off_t>(num_good_bytes)) != 0) {
    return fail(fmt::format("{}: cannot be written: {}", file.string(), std::strerror(errno)));
  }
  const Status written = writer.write(is_new ? line_of(identity) : std::string());
  return written ? Expected<RecordWriter>(writer) : written.error();
}

Status RecordWriter::append(const std::vector<FilterRecord>& records) {
  std::string text;
  for (const FilterRecord& record : records) {
    Json json = record.key;
    to_json(json, record);
    text += line_of(json);
  }
  return write(text);
}

Status RecordWriter::write(const std::string& text) {
  if (std::fwrite(text.data(), 1, text.size(), stream_.get()) != text.size() ||
      std::fflush(stream_.get()) != 0 || ::fsync(::fileno(stream_.get())) != 0) {
    return fail(fmt::format("{}: cannot be written: {}", file_.string(), std::strerror(errno)));
  }
  return {};
}

}  // namespace stemvo::search
