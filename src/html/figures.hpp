// SPDX-License-Identifier: MIT
#pragma once

#include <array>
#include <string>
#include <vector>

#include <nlohmann/json_fwd.hpp>

#include "html/page.hpp"

/// What several pages draw.
namespace stemvo::html {

/// An axis with this title.
[[nodiscard]] nlohmann::json titled(const std::string& title);
[[nodiscard]] nlohmann::json logarithmic(const std::string& title);

/// A way seen from above, metres.
struct PathFromAbove {
  std::string name;
  std::vector<std::array<double, 2>> xz_m;
  bool is_ground_truth = false;
  bool is_dotted = false;  ///< told from another of its colour
};
/// Their top views in one figure; hover says which point it is.
void add_paths_from_above(Page& page,
                          const std::string& heading,
                          const std::string& note,
                          const std::vector<PathFromAbove>& paths);

/// At the end of a page: the command (where there is one), and the configuration folded away.
void add_how_to_repeat(Page& page,
                       const std::string& command,
                       const std::string& heading,
                       const std::string& configuration);

}  // namespace stemvo::html
