// SPDX-License-Identifier: MIT
// Metres from the wheels: wheel_speed SPEEDS IMAGE.., with a row of time and m/s per image.
#include <fstream>
#include <iostream>

#include <opencv2/imgcodecs.hpp>
#include <stemvo/odometry.hpp>

int main(int argc, char** argv) {
  const stemvo::Camera camera{718.86, 718.86, 607.19, 185.22, 1241, 376};
  auto odometry = stemvo::Odometry::create(camera).value();  // by itself: up to scale
  std::ifstream speeds(argc > 1 ? argv[1] : "");
  double time_s = 0.0;
  double metres_per_s = 0.0;
  for (int i = 2; i < argc && speeds >> time_s >> metres_per_s; ++i) {
    const double sigma = 0.05 + 0.02 * metres_per_s;
    if (const auto added = odometry.add_speed(time_s, metres_per_s, sigma); !added) {
      return std::cerr << added.error().message << "\n", 1;
    }
    const auto image = cv::imread(argv[i]);
    const auto frame = odometry.process(image, stemvo::PixelOrder::kBgr, time_s).value();
    std::cout << to_string(frame.scale_state) << " +- " << 100.0 * frame.scale_sigma.value_or(1.0)
              << " %: " << frame.world_from_camera.translation.transpose() << "\n";
  }
}
