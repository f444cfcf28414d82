// SPDX-License-Identifier: MIT
#include "mapping/map_file.hpp"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <fstream>
#include <type_traits>
#include <utility>

#include <fmt/format.h>

#include "odometry/check_frame.hpp"
#include "text/text_file.hpp"
#include "try.hpp"

namespace stemvo {
namespace {

static_assert(std::endian::native == std::endian::little, "numbers are written as they lie");

constexpr std::string_view kMagic = "stemvo map\r\n\x1a\n";  // a transfer as text damages it
constexpr std::uint32_t kVersion = 2;
constexpr int kMaxMap_MB = 4000;

template <typename T>
concept Number = std::is_arithmetic_v<T>;

/// Appends what it is given.
class MapWriter {
 public:
  template <Number T>
  void operator()(const T& value) {
    bytes_.append(reinterpret_cast<const char*>(&value), sizeof value);
  }
  void count(const auto& list) { (*this)(static_cast<std::uint64_t>(list.size())); }
  [[nodiscard]] const std::string& bytes() const { return bytes_; }

 private:
  std::string bytes_;
};

/// Fills what it is given, with zeros behind the end.
class MapReader {
 public:
  explicit MapReader(std::string_view bytes) : bytes_(bytes) {}

  template <Number T>
  void operator()(T& value) {
    is_cut_ = is_cut_ || bytes_.size() < sizeof value;
    if (is_cut_) {
      value = {};
      return;
    }
    std::memcpy(&value, bytes_.data(), sizeof value);  // NOLINT: no string
    bytes_.remove_prefix(sizeof value);
  }
  template <typename List>
  void count(List& list);
  [[nodiscard]] bool has_read_all() const { return !is_cut_ && bytes_.empty(); }

 private:
  std::string_view bytes_;
  bool is_cut_ = false;
};

// The fields that are read and written are listed once: `Archive` is one of the two above.

void pass_all(auto& archive, auto&... values) { (archive(values), ...); }

void pass_each(auto& archive, auto&& numbers) {
  for (auto& number : numbers) {
    archive(number);
  }
}

void pass(auto& archive, char& letter) { archive(letter); }

void pass(auto& archive, Camera& camera) {
  pass_all(archive, camera.fx_px, camera.fy_px, camera.cx_px, camera.cy_px, camera.width_px,
           camera.height_px);
}

void pass(auto& archive, Rigid3& pose) {
  pass_each(archive, pose.rotation.coeffs());
  pass_each(archive, pose.translation);
}

void pass(auto& archive, Similarity3& similarity) {
  archive(similarity.scale);
  pass_each(archive, similarity.rotation.coeffs());
  pass_each(archive, similarity.translation);
}

void pass(auto& archive, KeptCorner& corner) {
  archive(corner.track_id);
  pass_each(archive, corner.uv);
  pass_each(archive, corner.in_camera);
}

void pass(auto& archive, Descriptor& descriptor) { pass_each(archive, descriptor); }

void pass(auto& archive, std::pair<int, int>& pair) { pass_all(archive, pair.first, pair.second); }

void pass(auto& archive, MapLength& length) {
  pass_all(archive, length.keyframe, length.log_metres_per_unit, length.sigma);
}

void pass_list(auto& archive, auto& list) {
  archive.count(list);
  for (auto& element : list) {
    pass(archive, element);
  }
}

void pass(auto& archive, KeptKeyframe& keyframe) {
  pass_all(archive, keyframe.frame, keyframe.time_s);
  pass(archive, keyframe.camera);
  pass_each(archive, keyframe.radial);
  pass(archive, keyframe.world_from_camera);
  pass_list(archive, keyframe.corners);
  pass_list(archive, keyframe.descriptors);
}

void pass(auto& archive, MapEdge& edge) {
  pass_all(archive, edge.from, edge.to);
  pass(archive, edge.from_to);
  pass_all(archive, edge.sigma_rad, edge.sigma_translation, edge.sigma_log_scale);
}

void pass(auto& archive, Loop& loop) {
  pass(archive, static_cast<MapEdge&>(loop));
  pass_list(archive, loop.corners);
}

void pass(auto& archive, MapFile& file) {
  pass_list(archive, file.channel);
  pass_list(archive, file.map.keyframes);
  pass_list(archive, file.map.map_from_keyframe);
  pass_list(archive, file.map.motions);
  pass_list(archive, file.map.loops);
  pass_list(archive, file.map.lengths);
}

/// FNV-1a.
std::uint64_t checksum(std::string_view bytes) {
  std::uint64_t sum = 0xcbf29ce484222325U;
  for (const char byte : bytes) {
    sum = (sum ^ static_cast<unsigned char>(byte)) * 0x100000001b3U;
  }
  return sum;
}

/// Lists are made no longer than what is left can fill: nobody's word is taken for it.
template <typename List>
void MapReader::count(List& list) {
  static const std::size_t least_bytes = [] {
    MapWriter writer;
    typename List::value_type element = {};
    pass(writer, element);
    return writer.bytes().size();
  }();
  std::uint64_t size = 0;
  (*this)(size);
  is_cut_ = is_cut_ || size > bytes_.size() / least_bytes;
  list.resize(is_cut_ ? 0 : size);
}

// Conditions of a map that is read. Each gives what was expected where it does not, else "".

bool is_motion(const Eigen::Quaterniond& rotation, const Eigen::Vector3d& translation) {
  constexpr double kRounding = 1e-9;
  return translation.allFinite() && std::abs(rotation.norm() - 1.0) < kRounding;
}

bool is_similarity(const Similarity3& a) {
  return a.scale > 0.0 && std::isfinite(a.scale) && is_motion(a.rotation, a.translation);
}

/// Whether the list has an element of this number.
bool holds(const auto& list, int i) { return i >= 0 && std::cmp_less(i, list.size()); }

bool is_number(std::int64_t frame_or_track) {
  constexpr std::int64_t kMax = 1'000'000'000;  // they are moved by as many
  return std::abs(frame_or_track) <= kMax;
}

bool is_corner(const KeptCorner& corner) {
  return is_number(corner.track_id) && corner.uv.allFinite() &&
         (!corner.has_landmark() || corner.in_camera.allFinite());
}

std::string_view flaw_of(const KeptKeyframe& keyframe) {
  return !is_number(keyframe.frame)        ? "a frame's number"
         : !std::isfinite(keyframe.time_s) ? "a finite time"
         : !check_camera(keyframe.camera) || !(keyframe.radial.lpNorm<Eigen::Infinity>() < 0.5)
             ? "a camera"
         : !is_motion(keyframe.world_from_camera.rotation, keyframe.world_from_camera.translation)
             ? "a pose"
         : !std::ranges::all_of(keyframe.corners, is_corner) ? "finite corners"
         : !std::ranges::is_sorted(keyframe.corners, {}, &KeptCorner::track_id)
             ? "corners in the order of their tracks"
         : !keyframe.descriptors.empty() && keyframe.descriptors.size() != keyframe.corners.size()
             ? "no descriptors or one per corner"
             : "";
}

std::string_view flaw_of(const MapEdge& edge, const KeptMap& map) {
  const auto is_sigma = [](double sigma) { return sigma > 0.0; };
  return !holds(map.keyframes, edge.from) || !holds(map.keyframes, edge.to) || edge.from == edge.to
             ? "two keyframes"
         : !is_similarity(edge.from_to) ? "a similarity"
         : !is_sigma(edge.sigma_rad) || !is_sigma(edge.sigma_translation) ||
                 !is_sigma(edge.sigma_log_scale)
             ? "standard deviations"
             : "";
}

std::string_view flaw_of(const Loop& loop, const KeptMap& map) {
  const std::string_view flaw = flaw_of(static_cast<const MapEdge&>(loop), map);
  if (!flaw.empty()) {
    return flaw;
  }
  const auto are_corners = [&](const auto& pair) {
    return holds(map.keyframes[slot(loop.from)].corners, pair.first) &&
           holds(map.keyframes[slot(loop.to)].corners, pair.second);
  };
  return std::ranges::all_of(loop.corners, are_corners) ? "" : "corners of its keyframes";
}

std::string_view flaw_of(const MapLength& length, const KeptMap& map) {
  return !holds(map.keyframes, length.keyframe) ? "a keyframe"
         : !std::isfinite(length.log_metres_per_unit) || !(length.sigma > 0.0)
             ? "a length and its sigma"
             : "";
}

/// The first of the list's that has a flaw.
Status check_each(const char* name, const auto& list, const auto& flaw_of_one) {
  for (std::size_t i = 0; i < list.size(); ++i) {
    if (const std::string_view flaw = flaw_of_one(list[i]); !flaw.empty()) {
      return fail(fmt::format("{} {}: expected {}, found something else", name, i, flaw));
    }
  }
  return {};
}

Status check_map(const KeptMap& map) {
  const auto& keyframes = map.keyframes;
  if (map.map_from_keyframe.size() != keyframes.size()) {
    return fail(fmt::format("expected a place for each of {} keyframes, found {}", keyframes.size(),
                            map.map_from_keyframe.size()));
  }
  const auto is_not_after = [](const auto& a, const auto& b) { return a.frame >= b.frame; };
  if (std::ranges::adjacent_find(keyframes, is_not_after) != keyframes.end()) {
    return fail("expected keyframes in the order of their frames, found others");
  }
  const auto in_map = [&](const auto& one) { return flaw_of(one, map); };
  return check_each("keyframe", keyframes, [](const auto& one) { return flaw_of(one); })
      .and_then([&] {
        return check_each("place of keyframe", map.map_from_keyframe,
                          [](const auto& one) { return is_similarity(one) ? "" : "a similarity"; });
      })
      .and_then([&] { return check_each("motion", map.motions, in_map); })
      .and_then([&] { return check_each("loop", map.loops, in_map); })
      .and_then([&] { return check_each("length", map.lengths, in_map); });
}

/// The head of a file, behind its magic.
struct Header {
  std::uint32_t version = kVersion;
  std::uint64_t num_bytes = 0;  ///< of the contents
  std::uint64_t sum = 0;
};

void pass(auto& archive, Header& header) {
  pass_all(archive, header.version, header.num_bytes, header.sum);
}

/// The contents, proved.
Expected<std::string_view> unseal(std::string_view bytes) {
  constexpr std::size_t kHeaderBytes = sizeof(std::uint32_t) + 2 * sizeof(std::uint64_t);
  if (!bytes.starts_with(kMagic)) {
    return fail("expected a map of stemvo, found another kind of file");
  }
  bytes.remove_prefix(kMagic.size());
  MapReader reader(bytes);
  Header header;
  pass(reader, header);
  if (header.version != kVersion) {
    return fail(
        fmt::format("expected a map of version {}, found version {}", kVersion, header.version));
  }
  bytes.remove_prefix(std::min(kHeaderBytes, bytes.size()));
  if (header.num_bytes != bytes.size()) {
    return fail(fmt::format("expected {} bytes behind the header, found {}: the map is cut",
                            header.num_bytes, bytes.size()));
  }
  if (const std::uint64_t sum = checksum(bytes); header.sum != sum) {
    return fail(fmt::format("expected checksum {:016x}, found {:016x}: the map is damaged",
                            header.sum, sum));
  }
  return bytes;
}

Expected<MapFile> parse(std::string_view contents) {
  MapReader reader(contents);
  MapFile file;
  pass(reader, file);
  if (!reader.has_read_all()) {
    return fail("expected lists as long as they say, found an end before or behind theirs");
  }
  return check_map(file.map).map([&] { return std::move(file); });
}

}  // namespace

Status check_place_of_map(const std::filesystem::path& file) {
  std::string begin(kMagic.size(), '\0');
  std::ifstream stream(file, std::ios::binary);
  stream.read(begin.data(), std::ssize(begin));
  return stream.gcount() == 0 || begin == kMagic
             ? Status()
             : fail(fmt::format("{}: expected a new file or a map of stemvo to replace, found "
                                "another kind of file",
                                file.string()));
}

Status write_map_file(const std::filesystem::path& file, MapFile map) {
  STEMVO_TRY(check_place_of_map(file));
  MapWriter writer;
  pass(writer, map);
  return write_text_file(file, sealed_map(writer.bytes()));
}

Expected<MapFile> read_map_file(const std::filesystem::path& file) {
  const Expected<std::string> bytes = read_text_file(file, kMaxMap_MB);
  if (!bytes) {
    return bytes.error();
  }
  Expected<MapFile> map = unseal(*bytes).and_then(parse);
  return map ? std::move(map) : fail(fmt::format("{}: {}", file.string(), map.error().message));
}

std::string sealed_map(std::string_view contents) {
  Header header{.num_bytes = contents.size(), .sum = checksum(contents)};
  MapWriter writer;
  pass(writer, header);
  return std::string(kMagic).append(writer.bytes()).append(contents);
}

}  // namespace stemvo
