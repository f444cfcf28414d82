// SPDX-License-Identifier: MIT
#pragma once

#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include <nlohmann/json_fwd.hpp>

#include "stemvo/error.hpp"

namespace stemvo::html {

/// An image under its text.
struct CaptionedImage {
  std::string caption;
  std::string jpeg;  ///< the file's bytes
};

/// A figure of plotly.js: the lists `traces` and the object `layout` are those of its reference
/// (without colours and fonts, which are the page's, for light and dark), and of the page: `large`,
/// or `small`, several of which stand beside each other, or a `plot_height`: pixels without what
/// the legend and the texts take.
struct Figure {
  std::string heading;
  std::string note;  ///< a sentence under the heading; may be empty
  const nlohmann::json& traces;
  const nlohmann::json& layout;
  /// The trace whose k-th point is frame k, for the page's slider; -1: none.
  int frame_trace = -1;
};

/// One HTML file that holds all it needs: opened without a network, it shows the sections in the
/// order they were added. Texts are UTF-8 and never taken for HTML, those of figures neither.
class Page {
 public:
  explicit Page(const std::string& title, const std::string& subtitle = "");
  Page(Page&&) noexcept;
  Page& operator=(Page&&) noexcept;
  ~Page();

  /// Below the title a slider over the frames, with a line of text each; the figures with a
  /// `frame_trace` mark the frame chosen.
  void set_frames(const std::vector<std::string>& descriptions);
  void add_figure(const Figure& figure);
  void add_images(const std::string& heading, const std::vector<CaptionedImage>& images);
  /// As it is, in letters of one width.
  void add_text(const std::string& heading, const std::string& text);
  /// The same, folded away behind the heading.
  void add_folded_text(const std::string& heading, const std::string& text);

  /// Error: the file cannot be written.
  [[nodiscard]] Status write(const std::filesystem::path& file) const;

 private:
  std::unique_ptr<nlohmann::json> content_;
};

}  // namespace stemvo::html
