// SPDX-License-Identifier: MIT
// A source of frames of one's own: raw gray pixels from standard input, as any program can send.
//   ffmpeg -i drive.mp4 -f rawvideo -pix_fmt gray - | own_source 640 480 520.9 521.0 325.1 249.7
#include <cstdlib>
#include <iostream>
#include <optional>

#include <stemvo/odometry.hpp>

namespace {

/// Put a camera's driver, a network or a simulator in its place: the library wants a cv::Mat per
/// frame, of the camera's size and without distortion.
class RawFrames {
 public:
  RawFrames(std::istream& in, int width_px, int height_px)
      : in_(in), image_(height_px, width_px, CV_8UC1) {}

  /// nullopt at the end. The pixels are the next frame's after the next call.
  std::optional<cv::Mat> next() {
    const auto size = static_cast<std::streamsize>(image_.total());
    in_.read(reinterpret_cast<char*>(image_.data), size);
    return in_.gcount() == size ? std::optional(image_) : std::nullopt;
  }

 private:
  std::istream& in_;
  cv::Mat image_;
};

}  // namespace

int main(int argc, char** argv) {
  if (argc != 7) return std::cerr << "usage: own_source WIDTH HEIGHT FX FY CX CY <FRAMES\n", 2;
  const stemvo::Camera camera{.fx_px = std::atof(argv[3]),
                              .fy_px = std::atof(argv[4]),
                              .cx_px = std::atof(argv[5]),
                              .cy_px = std::atof(argv[6]),
                              .width_px = std::atoi(argv[1]),
                              .height_px = std::atoi(argv[2])};
  stemvo::Options options;
  options.scale.source = stemvo::ScaleSource::kNone;  // no road in sight: the path is up to scale
  auto odometry = stemvo::Odometry::create(camera, options);  // refuses a wrong size
  if (!odometry) return std::cerr << odometry.error().message << "\n", 1;
  RawFrames frames(std::cin, camera.width_px, camera.height_px);
  double time_s = 0.0;
  while (const std::optional<cv::Mat> image = frames.next()) {
    const auto frame = odometry->process(*image, stemvo::PixelOrder::kGray, time_s += 1.0 / 30.0);
    if (!frame) return std::cerr << frame.error().message << "\n", 1;
    std::cout << stemvo::to_string(frame->state) << " "
              << frame->world_from_camera.translation.transpose() << "\n";
  }
}
