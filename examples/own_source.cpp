// SPDX-License-Identifier: MIT
// A source of frames of one's own: raw gray pixels from standard input, as any program can send.
//   ffmpeg -i drive.mp4 -f rawvideo -pix_fmt gray - | own_source 640 480 520.9 521.0 325.1 249.7 30
#include <cstdlib>
#include <iostream>
#include <optional>

#include <stemvo/odometry.hpp>

namespace {

/// Pixels of the camera's size and when they were taken: all that the library wants.
struct TimedImage {
  cv::Mat pixels;
  double time_s = 0.0;
};

/// Put a camera's driver, a network or a simulator in its place. What comes at an even rate can be
/// counted; else take the time of each exposure, and leave out what never came.
class RawFrames {
 public:
  RawFrames(std::istream& in, int width_px, int height_px, double rate_hz)
      : in_(in), rate_hz_(rate_hz), pixels_(height_px, width_px, CV_8UC1) {}

  /// nullopt at the end. The pixels are the next frame's after the next call.
  std::optional<TimedImage> next() {
    const auto size = static_cast<std::streamsize>(pixels_.total());
    in_.read(reinterpret_cast<char*>(pixels_.data), size);
    return in_.gcount() == size ? std::optional(TimedImage{pixels_, count_++ / rate_hz_})
                                : std::nullopt;
  }

 private:
  std::istream& in_;
  double rate_hz_;
  cv::Mat pixels_;
  int count_ = 0;
};

}  // namespace

int main(int argc, char** argv) {
  if (argc != 8) return std::cerr << "usage: own_source WIDTH HEIGHT FX FY CX CY RATE <FRAMES\n", 2;
  const stemvo::Camera camera{std::atof(argv[3]), std::atof(argv[4]), std::atof(argv[5]),
                              std::atof(argv[6]), std::atoi(argv[1]), std::atoi(argv[2])};
  auto odometry = stemvo::Odometry::create(camera);  // refuses a wrong size
  if (!odometry) return std::cerr << odometry.error().message << "\n", 1;
  RawFrames frames(std::cin, camera.width_px, camera.height_px, std::atof(argv[7]));
  while (const std::optional<TimedImage> image = frames.next()) {
    const auto frame = odometry->process(image->pixels, stemvo::PixelOrder::kGray, image->time_s);
    if (!frame) return std::cerr << frame.error().message << "\n", 1;
    std::cout << frame->time_s << " " << stemvo::to_string(frame->state) << " "
              << frame->world_from_camera.translation.transpose() << "\n";  // up to scale
  }
}
