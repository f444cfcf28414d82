// SPDX-License-Identifier: MIT

#include <numeric>

#include <fmt/format.h>

#include "dataset/camera_file.hpp"
#include "dataset/frame_files.hpp"
#include "try.hpp"

namespace stemvo::dataset {

namespace fs = std::filesystem;

Expected<PoseFile> read_truth(const fs::path& file, const std::optional<fs::path>& camera_file) {
  Expected<PoseFile> result = read_pose_file(file);
  if (!result || !result->is_of_body) {
    return result;
  }
  const fs::path folder = absolute_folder(file.parent_path().empty() ? "." : file.parent_path());
  const auto camera =
      read_camera_file(camera_file.value_or(folder.parent_path() / "cam0/sensor.yaml"));
  if (!camera || !camera->body_from_camera) {
    return fail(fmt::format(
        "{}: expected a camera file with T_BS, for these are poses of the body: --camera FILE, or "
        "../cam0/sensor.yaml from there; found {}",
        file.string(), camera ? "one without T_BS" : camera.error().message));
  }
  for (Rigid3& pose : result->poses) {
    pose = pose * *camera->body_from_camera;
  }
  result->is_of_body = false;
  return result;
}

Status check_pairs(const PoseFile& truth,
                   const std::string& owner,
                   std::span<const double> times_s,
                   const TimePairs& pairs,
                   double tolerance_s) {
  constexpr std::size_t kMinPairs = 2;
  if (pairs.first.size() >= kMinPairs) {
    return {};
  }
  return fail(fmt::format(
      "{}: expected at least {} poses within {} s of times in {}, found {}; poses are of {:.3f} to "
      "{:.3f} s, the others of {:.3f} to {:.3f} s (see --gt-tolerance)",
      truth.file.string(), kMinPairs, tolerance_s, owner, pairs.first.size(),
      truth.timestamps_s.front(), truth.timestamps_s.back(), times_s.front(), times_s.back()));
}

Expected<GroundTruth> match_frames(const PoseFile& truth,
                                   std::size_t begin,
                                   const std::vector<double>& times_s,
                                   double tolerance_s) {
  if (!truth.timestamps_s.empty()) {
    const TimePairs pairs = pair_by_time(times_s, truth.timestamps_s, tolerance_s);
    STEMVO_TRY(check_pairs(truth, "the frames", times_s, pairs, tolerance_s));
    return GroundTruth{relative_to_first(take_poses(truth.poses, pairs.second)), pairs.first};
  }
  if (truth.poses.size() < begin + times_s.size()) {
    return fail(fmt::format("{}: expected a pose for each of {} frames, found {} poses",
                            truth.file.string(), begin + times_s.size(), truth.poses.size()));
  }
  GroundTruth result{relative_to_first(std::span(truth.poses).subspan(begin, times_s.size())),
                     std::vector<std::size_t>(times_s.size())};
  std::iota(result.frames.begin(), result.frames.end(), std::size_t{0});
  return result;
}

}  // namespace stemvo::dataset
