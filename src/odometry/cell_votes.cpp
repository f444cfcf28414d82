// SPDX-License-Identifier: MIT
#include "odometry/cell_votes.hpp"

#include <algorithm>
#include <cstddef>
#include <map>
#include <utility>

namespace stemvo {
namespace {

constexpr double kCellsInRow = 12.0;

class CellCount {
 public:
  CellCount(std::span<const Eigen::Vector2d> uv, const std::vector<char>& agrees) {
    double least = 0.0;
    double most = 0.0;
    for (std::size_t i = 0; i < uv.size(); ++i) {
      least = i == 0 ? uv[i].x() : std::min(least, uv[i].x());
      most = i == 0 ? uv[i].x() : std::max(most, uv[i].x());
    }
    cell_px_ = std::max(1.0, (most - least) / kCellsInRow);
    for (std::size_t i = 0; i < uv.size(); ++i) {
      Cell& cell = cells_[place_of(uv[i])];
      ++cell.num_points;
      cell.num_agreeing += agrees[i] != 0 ? 1 : 0;
    }
  }

  [[nodiscard]] double share_at(const Eigen::Vector2d& uv) const {
    return share(cells_.at(place_of(uv)));
  }
  [[nodiscard]] double votes() const {
    double sum = 0.0;
    for (const auto& [place, cell] : cells_) {
      sum += share(cell);
    }
    return sum;
  }

 private:
  struct Cell {
    int num_points = 0;
    int num_agreeing = 0;
  };
  using Place = std::pair<int, int>;

  static double share(const Cell& cell) {
    return static_cast<double>(cell.num_agreeing) / cell.num_points;
  }
  [[nodiscard]] Place place_of(const Eigen::Vector2d& uv) const {
    return {static_cast<int>(uv.x() / cell_px_), static_cast<int>(uv.y() / cell_px_)};
  }

  double cell_px_ = 1.0;
  std::map<Place, Cell> cells_;
};

}  // namespace

double cell_votes(std::span<const Eigen::Vector2d> uv, const std::vector<char>& agrees) {
  return CellCount(uv, agrees).votes();
}

std::vector<double> cell_shares(std::span<const Eigen::Vector2d> uv,
                                const std::vector<char>& agrees) {
  const CellCount count(uv, agrees);
  std::vector<double> shares;
  shares.reserve(uv.size());
  for (const Eigen::Vector2d& point : uv) {
    shares.push_back(count.share_at(point));
  }
  return shares;
}

}  // namespace stemvo
