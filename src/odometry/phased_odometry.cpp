// SPDX-License-Identifier: MIT
#include "odometry/phased_odometry.hpp"

#include <opencv2/core/utility.hpp>

#include "internal_check.hpp"
#include "odometry/check_frame.hpp"
#include "odometry/frame_clock.hpp"
#include "text/text_file.hpp"
#include "timing/stage_timer.hpp"
#include "try.hpp"

namespace stemvo {

Expected<PhasedOdometry> PhasedOdometry::create(const Camera& camera,
                                                const Options& given,
                                                const cv::Mat& mask) {
  STEMVO_TRY(check_camera(camera));
  STEMVO_TRY(validate(given));
  STEMVO_TRY(check_mask(mask, camera));
  Options options = given;
  options.threads = options.threads > 0 ? options.threads : cv::getNumberOfCPUs();
  STEMVO_TRY_GET(const FrameView view, named("camera", FrameView::create(camera)));
  STEMVO_TRY_GET(Stem stem, Stem::load(options.stem, options.threads));
  // A network that cannot take this camera's images is found before work starts.
  const Camera& seen = view.camera();
  const cv::Mat blank(seen.height_px, seen.width_px, CV_8UC1, cv::Scalar(0));
  const int zoom = stem.frame_zoom(
      choose_tracking_resolution(options.stem.tracking_resolution, options.features.method, seen));
  STEMVO_TRY(stem.apply(blank, zoom));
  return PhasedOdometry(options, view, mask, std::move(stem), zoom);
}

PhasedOdometry::PhasedOdometry(
    const Options& options, const FrameView& view, const cv::Mat& mask, Stem stem, int zoom)
    : options_(options),
      view_(view),
      mask_(view.apply_to_mask(mask)),
      stem_(std::move(stem)),
      zoom_(zoom),
      channel_odometry_(options_, view_.camera(), mask_) {}

Frame PhasedOdometry::prepare(const cv::Mat& given, double time_s, const FrameHints& hints) {
  STEMVO_CHECK(given.size() == view_.full_size(), "the image has the camera's size");
  Stopwatch watch;
  const cv::Mat image = view_.apply(given);
  const Expected<Channel> channel = timed(Stage::kStem, [&] { return stem_.apply(image, zoom_); });
  const double stem_ms = watch.lap_ms();
  Frame frame;
  if (!channel) {
    frame.time_s = time_s;
    frame.problem = channel.error().message;
    return frame;
  }
  frame = channel_odometry_.prepare(*channel, image, time_s,
                                    {view_.apply_to_mask(hints.mask), hints.prev_from_cur});
  frame.times.stem_ms += stem_ms;
  return frame;
}

Status PhasedOdometry::check_remembers(const std::string& asked) const {
  const bool is_map = options_.odometry.mode == OdometryMode::kMap;
  return is_map && options_.odometry.loops
             ? Status()
             : fail(fmt::format("{}: expected odometry.mode map with odometry.loops true, found {}",
                                asked, is_map ? "loops false" : "mode two_frame"));
}

Status PhasedOdometry::load_map(const std::filesystem::path& file) {
  STEMVO_TRY(check_remembers(file.string()));
  STEMVO_TRY_GET(MapFile map, read_map_file(file));
  if (map.channel != channel_name()) {
    return fail(fmt::format("{}: expected a map of channel '{}', found one of '{}'", file.string(),
                            channel_name(), one_line(map.channel)));
  }
  channel_odometry_.load_map(std::move(map.map));
  return {};
}

}  // namespace stemvo
