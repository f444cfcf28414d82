// SPDX-License-Identifier: MIT
// Two-view geometry alone: matches of any source, one per line (u v in the first image, u v in the
// second), to the motion between the images.
//   two_view 640 480 520.9 521.0 325.1 249.7 <matches.txt
#include <cstdlib>
#include <iostream>
#include <vector>

#include <stemvo/two_view.hpp>

int main(int argc, char** argv) {
  if (argc != 7) {
    std::cerr << "usage: two_view WIDTH HEIGHT FX FY CX CY <MATCHES\n";
    return 2;
  }
  const stemvo::Camera camera{std::atof(argv[3]), std::atof(argv[4]), std::atof(argv[5]),
                              std::atof(argv[6]), std::atoi(argv[1]), std::atoi(argv[2])};
  std::vector<Eigen::Vector2d> first;
  std::vector<Eigen::Vector2d> second;
  for (Eigen::Vector2d a, b; std::cin >> a.x() >> a.y() >> b.x() >> b.y();) {
    first.push_back(a);
    second.push_back(b);
  }
  const auto motion = stemvo::estimate_two_view(first, second, camera);
  if (!motion) {
    std::cerr << motion.error().message << "\n";
    return 1;
  }
  std::cout << stemvo::to_string(motion->state) << "\n"
            << motion->cur_from_prev.matrix() << "\n";  // [R | t], |t| is 1
}
