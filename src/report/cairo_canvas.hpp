// SPDX-License-Identifier: MIT
#pragma once

#include <memory>
#include <string>

#include <cairo.h>

namespace stemvo {

struct CairoDelete {
  void operator()(cairo_t* context) const { cairo_destroy(context); }
  void operator()(cairo_surface_t* surface) const { cairo_surface_destroy(surface); }
  void operator()(cairo_font_options_t* options) const { cairo_font_options_destroy(options); }
};
using CairoSurface = std::unique_ptr<cairo_surface_t, CairoDelete>;

struct Color {
  double red = 0.0;
  double green = 0.0;
  double blue = 0.0;
};

enum class TextAnchor { kLeft, kCenter, kRight };

/// The few drawing operations a figure needs. Pixels, y down.
class CairoCanvas {
 public:
  explicit CairoCanvas(cairo_surface_t* surface);

  [[nodiscard]] cairo_t* context() const { return context_.get(); }
  void set_color(const Color& color) const;
  void fill_background(const Color& color) const;
  void stroke(double width_px) const;
  void line(double x0, double y0, double x1, double y1, double width_px) const;
  /// A disk or a square of that radius with a white rim, so that it stands out on any line.
  void disk(double x, double y, double radius_px, const Color& color) const;
  void square(double x, double y, double radius_px, const Color& color) const;

  void set_font(double size_px, bool is_bold = false) const;
  [[nodiscard]] double text_width(const std::string& text) const;
  /// Baseline at y. Bytes that are not UTF-8 are shown as '?'.
  void text(double x, double y, const std::string& text, TextAnchor anchor) const;
  /// Upwards, centred on (x, y).
  void vertical_text(double x, double y, const std::string& text) const;

 private:
  std::unique_ptr<cairo_t, CairoDelete> context_;
};

}  // namespace stemvo
