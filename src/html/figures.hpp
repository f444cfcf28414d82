// SPDX-License-Identifier: MIT
#pragma once

#include <array>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include <nlohmann/json_fwd.hpp>

#include "html/page.hpp"
#include "stemvo/rigid3.hpp"

/// What several pages draw.
namespace stemvo::html {

/// To the fifth decimal, nobody needs a file of digits; null where it is not finite.
[[nodiscard]] nlohmann::json rounded(double value);
/// An axis with this title; what is under the mouse has so many decimals.
[[nodiscard]] nlohmann::json titled(const std::string& title,
                                    std::optional<int> hover_digits = std::nullopt);
[[nodiscard]] nlohmann::json logarithmic(const std::string& title);

/// A way seen from above.
struct PathFromAbove {
  std::string name;
  std::vector<std::array<double, 2>> xz;
  bool is_ground_truth = false;
  bool is_dotted = false;  ///< told from another of its colour
  /// A line for each point, which is frame k of the page's slider; empty: hover says where it is.
  std::vector<std::string> frames = {};
};
[[nodiscard]] std::vector<std::array<double, 2>> seen_from_above(std::span<const Rigid3> poses);
/// Their top views in one figure.
void add_paths_from_above(Page& page,
                          const std::string& heading,
                          const std::string& note,
                          const std::vector<PathFromAbove>& paths,
                          const std::string& unit = "m");

/// What a scene of these trajectories shows, in each axis a little more than they take, and how
/// long the axes are: true to scale, but none so short that its ticks run into each other.
[[nodiscard]] nlohmann::json scene_around(const std::vector<std::span<const Rigid3>>& trajectories);

/// At the end of a page: the command (where there is one), and the configuration folded away.
void add_how_to_repeat(Page& page,
                       const std::string& command,
                       const std::string& heading,
                       const std::string& configuration);

}  // namespace stemvo::html
