// SPDX-License-Identifier: MIT
#pragma once

#include <cstddef>
#include <filesystem>
#include <span>
#include <string>
#include <vector>

#include <nlohmann/json_fwd.hpp>

#include "stemvo/error.hpp"
#include "stemvo/rigid3.hpp"

/// Pages for a browser. The program puts numbers and texts into them as JSON; the scripts beside
/// page.html, which every page holds, make figures of them.
namespace stemvo::html {

struct CaptionedImage {
  std::string caption;
  std::string jpeg;     ///< the file's bytes
  std::size_t row = 0;  ///< of frames.csv
};
/// [{row, caption, jpeg}], the bytes as base64.
[[nodiscard]] nlohmann::ordered_json images_json(const std::vector<CaptionedImage>& images);

/// {x, y, z}: lists of metres to the fifth decimal, null where a position is not finite.
[[nodiscard]] nlohmann::ordered_json path_json(std::span<const Rigid3> poses);

/// Writes one HTML file that holds all it needs. `content` is what the script of its key `page`
/// says. Texts are never taken for HTML. Error: the file cannot be written.
[[nodiscard]] Status write_page(const std::filesystem::path& file,
                                const nlohmann::ordered_json& content);

}  // namespace stemvo::html
