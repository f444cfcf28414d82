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

void pass(auto& archive, Number auto& number) { archive(number); }

void pass_all(auto& archive, auto&... values) { (pass(archive, values), ...); }

/// Elements of a list behind their number; of an array or a vector of Eigen alone.
template <typename List>
void pass(auto& archive, List& list)
  requires requires { list.begin(); }
{
  if constexpr (requires { list.push_back(list.front()); }) {
    archive.count(list);
  }
  for (auto& element : list) {
    pass(archive, element);
  }
}

void pass(auto& archive, Camera& camera) {
  pass_all(archive, camera.fx_px, camera.fy_px, camera.cx_px, camera.cy_px, camera.width_px,
           camera.height_px);
}

void pass(auto& archive, Rigid3& pose) {
  pass_all(archive, pose.rotation.coeffs(), pose.translation);
}

void pass(auto& archive, Similarity3& similarity) {
  pass_all(archive, similarity.scale, similarity.rotation.coeffs(), similarity.translation);
}

void pass(auto& archive, KeptCorner& corner) {
  pass_all(archive, corner.track_id, corner.uv, corner.in_camera);
}

void pass(auto& archive, std::pair<int, int>& pair) { pass_all(archive, pair.first, pair.second); }

void pass(auto& archive, MapLength& length) {
  pass_all(archive, length.keyframe, length.log_metres_per_unit, length.sigma);
}

void pass(auto& archive, KeptKeyframe& keyframe) {
  pass_all(archive, keyframe.frame, keyframe.time_s, keyframe.camera, keyframe.radial,
           keyframe.world_from_camera, keyframe.corners, keyframe.descriptors);
}

void pass(auto& archive, MapEdge& edge) {
  pass_all(archive, edge.from, edge.to, edge.from_to, edge.sigma_rad, edge.sigma_translation,
           edge.sigma_log_scale);
}

void pass(auto& archive, Loop& loop) {
  pass_all(archive, static_cast<MapEdge&>(loop), loop.corners);
}

void pass(auto& archive, MapFile& file) {
  KeptMap& map = file.map;
  pass_all(archive, file.channel, map.keyframes, map.map_from_keyframe, map.motions, map.loops,
           map.lengths);
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

// Conditions of a map that is read: what is used as an index is inside, what is computed with is
// finite.

bool is_sound(const Eigen::Quaterniond& rotation, const Eigen::Vector3d& translation) {
  constexpr double kRounding = 1e-9;
  return translation.allFinite() && std::abs(rotation.norm() - 1.0) < kRounding;
}

bool is_sound(const Similarity3& a) {
  return a.scale > 0.0 && std::isfinite(a.scale) && is_sound(a.rotation, a.translation);
}

/// Whether the list has an element of this number.
bool holds(const auto& list, int i) { return i >= 0 && std::cmp_less(i, list.size()); }

bool is_number(std::int64_t frame_or_track) {
  constexpr std::int64_t kMax = 1'000'000'000;  // they are moved by as many
  return std::abs(frame_or_track) <= kMax;
}

bool is_sound(const KeptCorner& corner) {
  return is_number(corner.track_id) && corner.uv.allFinite() &&
         (!corner.has_landmark() || corner.in_camera.allFinite());
}

bool is_sound(const KeptKeyframe& keyframe) {
  const auto& [rotation, translation] = keyframe.world_from_camera;
  const auto& corners = keyframe.corners;
  return is_number(keyframe.frame) && std::isfinite(keyframe.time_s) &&
         check_camera(keyframe.camera) && keyframe.radial.lpNorm<Eigen::Infinity>() < 0.5 &&
         is_sound(rotation, translation) &&
         std::ranges::all_of(
             corners, [](const auto& one) { return is_sound(one); }) &&
         std::ranges::is_sorted(corners, {}, &KeptCorner::track_id) &&
         (keyframe.descriptors.empty() || keyframe.descriptors.size() == corners.size());
}

bool is_sound(const MapEdge& edge, const KeptMap& map) {
  return holds(map.keyframes, edge.from) && holds(map.keyframes, edge.to) && edge.from != edge.to &&
         is_sound(edge.from_to) && edge.sigma_rad > 0.0 && edge.sigma_translation > 0.0 &&
         edge.sigma_log_scale > 0.0;
}

bool is_sound(const Loop& loop, const KeptMap& map) {
  return is_sound(static_cast<const MapEdge&>(loop), map) &&
         std::ranges::all_of(loop.corners, [&](const auto& pair) {
           return holds(map.keyframes[slot(loop.from)].corners, pair.first) &&
                  holds(map.keyframes[slot(loop.to)].corners, pair.second);
         });
}

bool is_sound(const MapLength& length, const KeptMap& map) {
  return holds(map.keyframes, length.keyframe) && std::isfinite(length.log_metres_per_unit) &&
         length.sigma > 0.0;
}

bool is_sound(const KeptMap& map) {
  const auto is_one_sound = [](const auto& one) { return is_sound(one); };
  const auto is_sound_in_map = [&](const auto& one) { return is_sound(one, map); };
  return map.map_from_keyframe.size() == map.keyframes.size() &&
         std::ranges::adjacent_find(map.keyframes, std::ranges::greater_equal(),
                                    &KeptKeyframe::frame) == map.keyframes.end() &&
         std::ranges::all_of(map.keyframes, is_one_sound) &&
         std::ranges::all_of(map.map_from_keyframe, is_one_sound) &&
         std::ranges::all_of(map.motions, is_sound_in_map) &&
         std::ranges::all_of(map.loops, is_sound_in_map) &&
         std::ranges::all_of(map.lengths, is_sound_in_map);
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
  if (const std::uint64_t sum = checksum(bytes);
      header.num_bytes != bytes.size() || header.sum != sum) {
    return fail(
        fmt::format("expected {} bytes of checksum {:016x}, found {} of {:016x}: the map "
                    "is cut or damaged",
                    header.num_bytes, header.sum, bytes.size(), sum));
  }
  return bytes;
}

Expected<MapFile> parse(std::string_view contents) {
  MapReader reader(contents);
  MapFile file;
  pass(reader, file);
  return reader.has_read_all() && is_sound(file.map)
             ? Expected<MapFile>(std::move(file))
             : fail(
                   "expected keyframes and what links them, found numbers that contradict each "
                   "other: the map is damaged");
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
  STEMVO_TRY_GET(const std::string bytes, read_text_file(file, kMaxMap_MB));
  return named(file.string(), unseal(bytes).and_then(parse));
}

std::string sealed_map(std::string_view contents) {
  Header header{.num_bytes = contents.size(), .sum = checksum(contents)};
  MapWriter writer;
  pass(writer, header);
  return std::string(kMagic).append(writer.bytes()).append(contents);
}

}  // namespace stemvo
