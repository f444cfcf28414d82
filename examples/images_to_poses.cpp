// SPDX-License-Identifier: MIT
#include <iostream>

#include <opencv2/imgcodecs.hpp>
#include <stemvo/odometry.hpp>

int main(int argc, char** argv) {
  const stemvo::Camera camera{718.86, 718.86, 607.19, 185.22, 1241, 376};  // fx fy cx cy, size
  auto odometry = stemvo::Odometry::create(camera, stemvo::Options::driving(1.65)).value();
  for (int i = 1; i < argc; ++i) {  // 1.65 m above the road, ten frames per second
    const auto frame = odometry.process(cv::imread(argv[i]), stemvo::PixelOrder::kBgr, 0.1 * i);
    if (!frame) return std::cerr << frame.error().message << "\n", 1;
    std::cout << frame->world_from_camera.translation.transpose() << "\n";  // metres
  }
}
