// SPDX-License-Identifier: MIT
#pragma once

#include <cstddef>
#include <functional>
#include <future>
#include <map>
#include <memory>
#include <optional>
#include <utility>
#include <vector>

#include <Eigen/Core>

#include "features/front_end.hpp"
#include "mapping/kept_map.hpp"
#include "mapping/map_keeper.hpp"
#include "mapping/place_recognizer.hpp"
#include "stemvo/options.hpp"

namespace stemvo {

/// An old place, and what it says of the window.
struct Recognition {
  int frame = -1;  ///< of the old keyframe
  /// The window belongs to another map, which is moved to that of the place: new world from old.
  std::optional<Similarity3> moved;
  /// Where the map has the landmarks of tracks, by id, in the (new) world.
  std::map<int, Eigen::Vector3d> landmarks;
};

/// The same for a frame without a pose.
struct Relocation {
  int frame = -1;
  Rigid3 world_from_camera;
  std::map<int, Eigen::Vector3d> landmarks;
};

/// The map that remembers (`odometry.loops`; off: it does nothing). Places are looked up, and the
/// graph is solved, beside the frames where threads may begin; what comes of it is taken in at
/// fixed keyframes: the same on any number of threads. One call at a time.
class Mapper {
 public:
  explicit Mapper(const Options& options)
      : is_on_(options.odometry.loops), may_begin_threads_(options.threads != 1) {}

  /// Before the first keyframe: what another recording left.
  void load(KeptMap map) {
    keeper_.load(std::move(map));
    recognizer_.load(keeper_.map());
  }
  /// The window has a new keyframe, which came with this image; those before it have all their
  /// corners now.
  [[nodiscard]] Recognition observe(const WindowView& view,
                                    std::shared_ptr<const ImagePyramid> image);
  /// A keyframe is about to leave the window.
  void leave(const WindowView& view, std::size_t leaving) {
    if (is_on_) {
      finish_lookup();
      keeper_.leave(view, leaving);
    }
  }
  /// The whole window is about to be dropped. The next one is a new map, unless it begins at a
  /// relocation.
  void close(const WindowView& view);

  /// A frame's world_from_camera, by landmarks in its camera.
  using PoseByLandmarks = std::function<Rigid3(const std::map<int, Eigen::Vector3d>&)>;
  /// A frame without a pose, or in no map yet; nullopt: it shows no kept place. `predicted` is what
  /// it has, `pose_of` tells where it is in a map that is all of another recording: that one comes
  /// to this world.
  [[nodiscard]] std::optional<Relocation> locate(const WindowView& view,
                                                 const Matches& matches,
                                                 const ImagePyramid& image,
                                                 const Rigid3& predicted,
                                                 const PoseByLandmarks& pose_of);
  /// The next frame tells whether the one that locate() was asked for shows a place.
  [[nodiscard]] bool may_be_locating() const { return recognizer_.may_be_locating(); }
  /// The next window begins with the frame that was located last.
  void begin_at_relocation() {
    if (located_.has_value()) {
      keeper_.begin_at(*std::exchange(located_, {}));
      has_new_loops_ = true;
      keyframes_until_next_ = 0;
    }
  }

  /// The correction so far.
  [[nodiscard]] const Similarity3& map_from_world() const { return keeper_.map_from_world(); }
  /// With the keyframes that are still in the window, and all that was begun.
  [[nodiscard]] KeptMap map(const WindowView& view) const;

 private:
  /// A keyframe that was looked up.
  struct LookedUp {
    int node = 0;
    KeptKeyframe keyframe;  ///< with descriptors
    std::optional<Loop> loop;
    bool is_place = false;  ///< now
  };
  /// The last image of a keyframe.
  struct Seen {
    int frame = -1;
    std::shared_ptr<const ImagePyramid> image;
  };

  template <typename Task>
  [[nodiscard]] auto begin(Task task) const;
  void begin_lookup(const WindowView& view);
  /// Waits for the lookup that was begun.
  void finish_lookup() {
    const auto done = std::exchange(looked_up_, {});
    if (done.valid()) {
      keep(done.get(), keeper_);
      found_ = done.get().loop ? std::optional(done.get()) : std::nullopt;
    }
  }
  static void keep(const LookedUp& found, MapKeeper& keeper) {
    KeptKeyframe& kept = keeper.keyframe(found.node);
    kept.corners = found.keyframe.corners;
    if (found.is_place) {
      kept.descriptors = found.keyframe.descriptors;
    }
  }
  [[nodiscard]] Recognition take_in(const WindowView& view, const LookedUp& found);
  /// The newest one.
  void add_place(int node, std::vector<Descriptor> descriptors) {
    KeptKeyframe& keyframe = keeper_.keyframe(node);
    keyframe.descriptors = std::move(descriptors);
    recognizer_.add(node, keyframe);
  }
  void keep_last_view(const WindowView& view);
  void solve_graph(const WindowView& view);
  void merge();

  bool is_on_;
  bool may_begin_threads_;
  MapKeeper keeper_;
  PlaceRecognizer recognizer_;  ///< the lookup's while there is one
  Seen newest_;
  std::optional<LookedUp> found_;  ///< a loop, by the last lookup
  std::optional<Loop> located_;    ///< to the last frame that was, which is no node yet
  bool has_new_loops_ = false;
  int keyframes_until_solved_ = 0;
  int keyframes_until_next_ = 0;  ///< once there are new loops
  int keyframes_since_merge_ = 0;
  std::shared_future<std::optional<std::vector<Similarity3>>> solved_;
  std::shared_future<LookedUp> looked_up_;  ///< last: it ends before what it works on
};

}  // namespace stemvo
