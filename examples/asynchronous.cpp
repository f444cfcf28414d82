// SPDX-License-Identifier: MIT
// All of the speed: images are read here while frames are worked on beside each other, and results
// come to a callback. Prints each frame's state and position.
//   asynchronous FX FY CX CY IMAGE...
#include <cstdlib>
#include <iostream>

#include <opencv2/imgcodecs.hpp>
#include <stemvo/async_odometry.hpp>

int main(int argc, char** argv) {
  if (argc < 6) return std::cerr << "usage: asynchronous FX FY CX CY IMAGE...\n", 2;
  const cv::Mat first = cv::imread(argv[5], cv::IMREAD_GRAYSCALE);
  const stemvo::Camera camera{std::atof(argv[1]), std::atof(argv[2]), std::atof(argv[3]),
                              std::atof(argv[4]), first.cols,         first.rows};
  auto odometry = stemvo::AsyncOdometry::create(
      camera, stemvo::Options::driving(1.65), {}, [](const stemvo::FrameResult& frame) {
        std::cout << to_string(frame.state) << " "
                  << frame.world_from_camera.translation.transpose() << "\n";
      });
  if (!odometry) return std::cerr << odometry.error().message << "\n", 1;
  for (int i = 5; i < argc; ++i) {
    const cv::Mat image = cv::imread(argv[i], cv::IMREAD_GRAYSCALE);
    const double time_s = 0.1 * (i - 5);
    // Waits while there is no room; a live camera's pixels are copied.
    const auto pushed = odometry->push(image, stemvo::PixelOrder::kGray, time_s);
    if (!pushed) return std::cerr << pushed.error().message << "\n", 1;
  }
  const auto finished = odometry->finish();  // all have come to the callback
  if (!finished) return std::cerr << finished.error().message << "\n", 1;
}
