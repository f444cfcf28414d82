// SPDX-License-Identifier: MIT
// PatchTracker: the odometry's own channel, detector and aligner, one image pair at a time.
#include <cstdint>
#include <memory>
#include <utility>
#include <vector>

#include <nanobind/stl/pair.h>
#include <nanobind/stl/shared_ptr.h>

#include "arrays.hpp"
#include "features/front_end.hpp"
#include "features/patch_pyramid.hpp"
#include "features/point_front_end.hpp"
#include "options.hpp"
#include "stem/stem.hpp"

namespace stemvo::python {
namespace {

using namespace nb::literals;
using Image = std::shared_ptr<const ImagePyramid>;
using Points = nb::ndarray<const double, nb::shape<-1, 2>, nb::c_contig, nb::device::cpu>;

DoubleArray rows(const std::vector<double>& numbers, std::size_t columns) {
  auto data = std::make_unique<double[]>(numbers.size());
  std::ranges::copy(numbers, data.get());
  double* const values = data.get();
  nb::capsule owner(values, [](void* p) noexcept { delete[] static_cast<double*>(p); });
  data.release();
  return {values, {numbers.size() / columns, columns}, owner};
}

class PatchTracker {
 public:
  explicit PatchTracker(const Config& config)
      : features_(config.features),
        resolution_(config.stem.tracking_resolution),
        stem_(value_or_raise(Stem::load(config.stem))),
        contrast_(config.stem),
        front_end_(create_patch_front_end(config.features)) {
    if (resolution_ == TrackingResolution::kAuto) {
      throw nb::value_error("stem.tracking_resolution: expected no auto (no camera is known)");
    }
  }

  Image see(const GivenArray& array) {
    const ImageView view = value_or_raise(view_of(array, "image"));
    const Channel channel = value_or_raise(stem_.apply(view.pixels, stem_.frame_zoom(resolution_)));
    return front_end_->prepare(contrast_.apply(channel), {});
  }

  [[nodiscard]] DoubleArray corners(const ImagePyramid& image) const {
    GridQuota quota(features_, image.channel.pixels.size());
    std::vector<double> found;
    for (const cv::Point2f& corner : PointFrontEnd::corners(image, {}, features_)) {
      if (quota.take(corner)) {
        const Eigen::Vector2d uv = image.channel.map.to_input({corner.x, corner.y});
        found.insert(found.end(), {uv.x(), uv.y()});
      }
    }
    return rows(found, 2);
  }

  [[nodiscard]] static DoubleArray align(const ImagePyramid& from,
                                         const ImagePyramid& to,
                                         const Points& points,
                                         const Points& starts,
                                         int level) {
    if (points.shape(0) != starts.shape(0)) {
      throw nb::value_error("starts: expected one for each point");
    }
    const Pyramid old_levels = static_cast<const PatchPyramid&>(from).bordered;
    const Pyramid new_levels = static_cast<const PatchPyramid&>(to).bordered;
    std::vector<double> found;
    for (std::size_t i = 0; i < points.shape(0); ++i) {
      const Eigen::Vector2f at =
          from.channel.map.from_input({points(i, 0), points(i, 1)}).cast<float>();
      const Eigen::Vector2f start =
          to.channel.map.from_input({starts(i, 0), starts(i, 1)}).cast<float>();
      Patch patch;
      PatchMatch match;
      if (cut_patch(old_levels, at.x(), at.y(), patch)) {
        match = align_patch(patch, new_levels, {start.x(), start.y()}, level);
      }
      const Eigen::Vector2d uv = to.channel.map.to_input({match.warp.x, match.warp.y});
      found.insert(found.end(), {uv.x(), uv.y(), match.correlation});
    }
    return rows(found, 3);
  }

 private:
  FeatureOptions features_;
  TrackingResolution resolution_;
  Stem stem_;
  ContrastNormalization contrast_;
  std::unique_ptr<FrontEnd> front_end_;
};

}  // namespace

void bind_tracking(nb::module_& module) {
  nb::class_<ImagePyramid>(module, "SeenImage", "An image as the tracker sees it")
      .def_prop_ro("num_levels", [](const ImagePyramid& image) { return image.levels.size(); });
  nb::class_<PatchTracker>(
      module, "PatchTracker",
      "The odometry's own channel, detector and aligner; pixels are the input's")
      .def(
          "__init__",
          [](PatchTracker* self, const nb::object& options) {
            new (self) PatchTracker(config_of(options));
          },
          "options"_a = nb::none(), "stem.tracking_resolution must be given: no camera is known")
      .def("see", &PatchTracker::see, "image"_a,
           "The channel's pyramid; its contrast limits are those of the images before")
      .def("corners", &PatchTracker::corners, "image"_a, "Nx2, strongest first, quota per cell")
      .def_static("align", &PatchTracker::align, "from_image"_a, "to_image"_a, "points"_a,
                  "starts"_a, "level"_a = 1,
                  "Nx3: place, correlation (0: not found) of patches cut out at Nx2 points, each "
                  "from its start (Nx2), at pyramid levels from this one down");
}

}  // namespace stemvo::python
