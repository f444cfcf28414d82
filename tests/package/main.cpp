// SPDX-License-Identifier: MIT
#include <iostream>

#include <stemvo/odometry/odometry.hpp>
#include <stemvo/version.hpp>

int main(int argc, char** argv) {
  const stemvo::Camera camera{200, 200, 159.5, 47.5, 320, 96};
  auto odometry = stemvo::Odometry::create({}, camera, argc > 1 ? argv[1] : "models");
  if (!odometry) return std::cerr << odometry.error().message << "\n", 1;
  const auto result = odometry->process(cv::Mat(96, 320, CV_8UC1, cv::Scalar(127)));
  std::cout << stemvo::version() << ": " << to_string(result.state) << "\n";
}
