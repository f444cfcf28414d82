// SPDX-License-Identifier: MIT
#include "mapping/mapper.hpp"

#include <cmath>
#include <iterator>

#include "geometry/median.hpp"
#include "mapping/descriptors.hpp"
#include "mapping/pose_graph.hpp"
#include "odometry/tracks.hpp"
#include "timing/stage_timer.hpp"

namespace stemvo {
namespace {

/// A graph of so many edges is solved in the time of one keyframe.
constexpr std::size_t kEdgesPerKeyframe = 128;
/// For so many times that time the next one waits: a room brings new loops with every keyframe.
constexpr int kPause = 8;
/// Places are looked through for merging so often.
constexpr int kKeyframesPerMerge = 16;
/// Standard deviations of where a lost frame was found, one place alone: rotation, share of the
/// depth, scale.
constexpr double kSigmaFound_rad = 0.005;
constexpr double kSigmaFound = 0.01;

/// A loop that is off by more changes the graph, all seven errors together: of a true one, whose
/// sigmas hold, the square is 7 on average.
constexpr double kMaxAgreeingSigmas = 3.0;

/// Bounds of a loop's scale: fewer pairs of landmarks do not tell it, errors of landmarks are
/// alike, and it is never known better.
constexpr std::size_t kMinPairs = 10;
constexpr double kAlikeErrors = 2.0;
constexpr double kMinLogScale = 0.005;

std::vector<KeptCorner> corners_of(const Matches& matches) {
  std::vector<KeptCorner> corners;
  for (const Observation& point :
       current_points(matches, std::vector<char>(matches.cur_uv.size(), 1))) {
    corners.push_back({point.track_id, point.uv.cast<float>()});
  }
  return corners;
}

/// The scale by the landmarks that both have: where the two stood at one spot, how the one's look
/// to the other says nothing of it.
void measure_scale(const KeptKeyframe& old, const KeptKeyframe& recent, Loop& loop) {
  const Similarity3 turned(1.0, loop.from_to.rotation, loop.from_to.translation);
  std::vector<double> logs;
  for (const auto& [of_old, of_recent] : loop.corners) {
    const KeptCorner& from = old.corners[static_cast<std::size_t>(of_old)];
    const KeptCorner& to = recent.corners[static_cast<std::size_t>(of_recent)];
    if (from.has_landmark() && to.has_landmark()) {
      const Eigen::Vector3d point =
          turned.inverse() * Eigen::Vector3d(from.in_camera.cast<double>());
      logs.push_back(std::log(point.norm() / to.in_camera.cast<double>().norm()));
    }
  }
  if (logs.size() < kMinPairs) {
    return;
  }
  const auto num_pairs = static_cast<double>(logs.size());
  const double middle = median(logs);
  for (double& value : logs) {
    value = std::abs(value - middle);
  }
  // 1.4826: of a normal distribution's median deviation.
  const double sigma = std::hypot(
      kMinLogScale, kAlikeErrors * 1.4826 * median(std::move(logs)) / std::sqrt(num_pairs));
  if (sigma < loop.sigma_log_scale) {
    loop.from_to.scale = std::exp(middle);
    loop.sigma_log_scale = sigma;
  }
}

}  // namespace

/// Work beside the frames. Where no thread can begin, it is done when its result is asked for.
template <typename Task>
auto Mapper::begin(Task task) const {
  const auto where =
      may_begin_threads_ ? std::launch::async | std::launch::deferred : std::launch::deferred;
  return std::async(where, std::move(task)).share();
}

Recognition Mapper::observe(const WindowView& view, std::shared_ptr<const ImagePyramid> image) {
  Recognition recognition;
  if (!is_on_) {
    return recognition;
  }
  finish_lookup();
  keeper_.add_nodes(view);
  if (const auto found = std::exchange(found_, {})) {
    recognition = take_in(view, *found);
  }
  solve_graph(view);  // before anybody reads it beside the frames
  begin_lookup(view);
  newest_ = {view.window.keyframes.back().frame, std::move(image)};
  return recognition;
}

/// The newest keyframe but one is complete.
void Mapper::begin_lookup(const WindowView& view) {
  const Keyframe& complete = *std::prev(view.window.keyframes.end(), 2);
  if (complete.frame != newest_.frame || newest_.image == nullptr) {
    return;
  }
  LookedUp work{.node = keeper_.node_of(complete.frame), .keyframe = {}, .loop = {}};
  work.keyframe = keeper_.keyframe(work.node);
  work.keyframe.corners = corners_of(view, complete);
  if (!keeper_.may_soon_be_joined() && !recognizer_.asks(work.keyframe)) {
    return;
  }
  const double roll = image_roll_rad(keeper_.map().pose(work.node).rotation);
  looked_up_ = begin([this, roll, work = std::move(work), image = newest_.image]() mutable {
    const StageTimer timer(Stage::kPlaces);
    KeptKeyframe& keyframe = work.keyframe;
    keyframe.descriptors = describe(image->channel, keyframe.corners, roll);
    work.loop = recognizer_.recognize(
        {keeper_.map(), keeper_.components(), work.node, keyframe}, [&](const OtherLook& look) {
          return describe(image->channel, keyframe.corners, roll + look.roll_rad, look.scale);
        });
    if (work.loop.has_value()) {
      measure_scale(keeper_.keyframe(work.loop->from), keyframe, *work.loop);
    }
    work.is_place = !recognizer_.shows_kept_place();
    if (work.is_place) {
      recognizer_.add(work.node, keyframe);
    }
    return work;
  });
}

/// Its newer keyframe is in the window still.
Recognition Mapper::take_in(const WindowView& view, const LookedUp& found) {
  Recognition recognition;
  const Loop& loop = *found.loop;
  // A graph that says the same already needs no solving, and no drift explains it.
  const bool is_known = sigmas_off(keeper_.map(), loop) <= kMaxAgreeingSigmas;
  if (!is_known && !is_within_drift(keeper_.graph(view), loop)) {
    if (!found.is_place) {  // nor does it show that one
      add_place(found.node, found.keyframe.descriptors);
    }
    return recognition;
  }
  recognition.frame = keeper_.keyframe(loop.from).frame;
  recognition.moved = keeper_.add_loop(loop);
  has_new_loops_ = has_new_loops_ || !is_known || recognition.moved.has_value();
  if (recognition.moved.has_value()) {
    solved_ = {};  // of the graph before
    keyframes_until_next_ = 0;
  }
  const Similarity3 world_from_old =
      keeper_.map_from_world().inverse() * keeper_.map().pose(loop.from);
  for (const auto& [of_old, of_new] : loop.corners) {
    const KeptCorner& old = keeper_.keyframe(loop.from).corners[static_cast<std::size_t>(of_old)];
    const KeptCorner& corner = keeper_.keyframe(loop.to).corners[static_cast<std::size_t>(of_new)];
    if (old.has_landmark()) {
      recognition.landmarks.emplace(corner.track_id,
                                    world_from_old * Eigen::Vector3d(old.in_camera.cast<double>()));
    }
  }
  return recognition;
}

/// Begins where loops have come, and takes the result in a number of keyframes later that the
/// graph's size alone decides. A map that was moved does not wait.
void Mapper::solve_graph(const WindowView& view) {
  if (solved_.valid() && --keyframes_until_solved_ <= 0) {
    const auto solved = std::exchange(solved_, {});
    if (solved.get().has_value()) {
      keeper_.apply(*solved.get());
    }
  }
  merge();
  if (has_new_loops_ && !solved_.valid() && --keyframes_until_next_ <= 0) {
    has_new_loops_ = false;
    const std::size_t num_edges = keeper_.map().motions.size() + keeper_.map().loops.size();
    keyframes_until_solved_ = 1 + static_cast<int>(num_edges / kEdgesPerKeyframe);
    keyframes_until_next_ = kPause * keyframes_until_solved_;
    solved_ = begin([graph = keeper_.graph(view)]() mutable {
      const StageTimer timer(Stage::kPoseGraph);
      return solve_pose_graph(graph) ? std::optional(graph.map_from_keyframe) : std::nullopt;
    });
  }
}

/// While nobody reads the graph; now and then: all loops are looked through.
void Mapper::merge() {
  if (++keyframes_since_merge_ < kKeyframesPerMerge || solved_.valid() || looked_up_.valid()) {
    return;
  }
  keyframes_since_merge_ = 0;
  const std::vector<int> numbers = keeper_.merge();
  if (!numbers.empty()) {
    recognizer_.renumber(numbers);
    if (located_.has_value()) {
      located_->from = numbers[static_cast<std::size_t>(located_->from)];
    }
  }
}

void Mapper::close(const WindowView& view) {
  if (is_on_) {
    finish_lookup();
    keeper_.close(view);
    if (const auto found = std::exchange(found_, {})) {
      (void)take_in(view, *found);
    }
    newest_ = {};
  }
}

/// The window's newest keyframe is the likeliest to be seen again. Places come in their order.
void Mapper::keep_last_view(const WindowView& view) {
  const auto image = std::exchange(newest_.image, {});
  if (image == nullptr || found_.has_value() || view.window.keyframes.empty()) {
    return;
  }
  const Keyframe& last = view.window.keyframes.back();
  keeper_.add_nodes(view);
  const int node = keeper_.node_of(last.frame);
  if (last.frame == newest_.frame && node >= 0) {
    KeptKeyframe& kept = keeper_.keyframe(node);
    kept.corners = corners_of(view, last);
    const double roll = image_roll_rad(keeper_.map().pose(node).rotation);
    add_place(node, describe(image->channel, kept.corners, roll));
  }
}

std::optional<Relocation> Mapper::locate(const WindowView& view,
                                         const Matches& matches,
                                         const ImagePyramid& image,
                                         const Rigid3& predicted,
                                         const PoseByLandmarks& pose_of) {
  finish_lookup();
  if (!is_on_) {
    return std::nullopt;
  }
  keep_last_view(view);
  if (keeper_.map().keyframes.empty()) {
    return std::nullopt;
  }
  const StageTimer timer(Stage::kPlaces);
  const std::vector<KeptCorner> corners = corners_of(matches);
  const double roll = image_roll_rad(keeper_.map_from_world().rotation * predicted.rotation);
  const auto found = recognizer_.locate(
      keeper_.map(), view.camera, corners, describe(image.channel, corners, roll),
      [&](const OtherLook& look) {
        return describe(image.channel, corners, roll + look.roll_rad, look.scale);
      });
  if (!found.has_value()) {
    return std::nullopt;
  }
  const Similarity3& map_from_old = keeper_.map().pose(found->keyframe);
  if (!keeper_.has_own(keeper_.component_of(found->keyframe))) {
    // In the map's unit: that of a single keyframe, above all of the first ones, may be off.
    const Rigid3 map_from_camera = map_from_old * found->keyframe_from_camera;
    std::map<int, Eigen::Vector3d> in_camera;
    for (const auto& [track_id, in_old] : found->landmarks) {
      in_camera.emplace(track_id, map_from_camera.inverse() * (map_from_old * in_old));
    }
    keeper_.correct(Similarity3(map_from_camera * pose_of(in_camera).inverse()));
  }
  const Similarity3 world_from_old = keeper_.map_from_world().inverse() * map_from_old;
  Relocation relocation{
      keeper_.keyframe(found->keyframe).frame, world_from_old * found->keyframe_from_camera, {}};
  std::vector<double> depths;
  for (const auto& [track_id, in_old] : found->landmarks) {
    relocation.landmarks.emplace(track_id, world_from_old * in_old);
    depths.push_back(in_old.z());
  }
  Loop loop;
  loop.from = found->keyframe;
  loop.from_to = Similarity3(found->keyframe_from_camera);
  loop.from_to.scale = 1.0 / world_from_old.scale;
  loop.sigma_rad = kSigmaFound_rad;
  loop.sigma_translation = kSigmaFound * median(std::move(depths));
  loop.sigma_log_scale = kSigmaFound;
  located_ = loop;
  return relocation;
}

KeptMap Mapper::map(const WindowView& view) const {
  MapKeeper keeper = keeper_;
  if (!is_on_) {
    return {};
  }
  if (looked_up_.valid()) {
    const std::optional<Loop>& loop = looked_up_.get().loop;
    keep(looked_up_.get(), keeper);
    if (loop.has_value() && is_within_drift(keeper.graph(view), *loop)) {
      (void)keeper.add_loop(*loop);
    }
  }
  keeper.close(view);
  KeptMap graph = keeper.graph(view);
  if (!graph.loops.empty() && solve_pose_graph(graph)) {
    keeper.apply(graph.map_from_keyframe);
  }
  return keeper.take_map();
}

}  // namespace stemvo
