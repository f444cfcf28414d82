// SPDX-License-Identifier: MIT
#include "report/cairo_canvas.hpp"

#include <numbers>

namespace stemvo {

namespace {

constexpr Color kWhite{1.0, 1.0, 1.0};
constexpr double kRim_px = 3.0;

/// Length of the UTF-8 character at `i`, 0 when there is none.
std::size_t utf8_length(const std::string& text, std::size_t i) {
  const auto byte = [&](std::size_t k) { return static_cast<unsigned char>(text[k]); };
  const unsigned char lead = byte(i);
  const std::size_t length = lead < 0x80                    ? 1
                             : lead >= 0xC2 && lead <= 0xDF ? 2
                             : lead >= 0xE0 && lead <= 0xEF ? 3
                             : lead >= 0xF0 && lead <= 0xF4 ? 4
                                                            : 0;
  if (length == 0 || i + length > text.size()) {
    return 0;
  }
  for (std::size_t k = i + 1; k < i + length; ++k) {
    if ((byte(k) & 0xC0) != 0x80) {
      return 0;
    }
  }
  const bool is_overlong =
      (lead == 0xE0 && byte(i + 1) < 0xA0) || (lead == 0xF0 && byte(i + 1) < 0x90);
  const bool is_beyond =
      (lead == 0xED && byte(i + 1) > 0x9F) || (lead == 0xF4 && byte(i + 1) > 0x8F);
  return is_overlong || is_beyond ? 0 : length;
}

/// One bad byte in a folder's name would otherwise cost the whole figure: cairo stops at it.
std::string printable(const std::string& text) {
  std::string result;
  for (std::size_t i = 0; i < text.size();) {
    const std::size_t length = utf8_length(text, i);
    const bool is_control = length == 1 && static_cast<unsigned char>(text[i]) < 0x20;
    result += length == 0 ? "?" : is_control ? " " : text.substr(i, length);
    i += length == 0 ? 1 : length;
  }
  return result;
}

}  // namespace

CairoCanvas::CairoCanvas(cairo_surface_t* surface) : context_(cairo_create(surface)) {
  // Without hinting text has the same shape and width on both kinds of surface.
  const std::unique_ptr<cairo_font_options_t, CairoDelete> options(cairo_font_options_create());
  cairo_font_options_set_antialias(options.get(), CAIRO_ANTIALIAS_GRAY);
  cairo_font_options_set_hint_style(options.get(), CAIRO_HINT_STYLE_NONE);
  cairo_font_options_set_hint_metrics(options.get(), CAIRO_HINT_METRICS_OFF);
  cairo_set_font_options(context_.get(), options.get());
  cairo_set_line_cap(context_.get(), CAIRO_LINE_CAP_ROUND);
  cairo_set_line_join(context_.get(), CAIRO_LINE_JOIN_ROUND);
}

void CairoCanvas::set_color(const Color& color) const {
  cairo_set_source_rgb(context_.get(), color.red, color.green, color.blue);
}

void CairoCanvas::fill_background(const Color& color) const {
  set_color(color);
  cairo_paint(context_.get());
}

void CairoCanvas::stroke(double width_px) const {
  cairo_set_line_width(context_.get(), width_px);
  cairo_stroke(context_.get());
}

void CairoCanvas::line(double x0, double y0, double x1, double y1, double width_px) const {
  cairo_move_to(context_.get(), x0, y0);
  cairo_line_to(context_.get(), x1, y1);
  stroke(width_px);
}

void CairoCanvas::disk(double x, double y, double radius_px, const Color& color) const {
  cairo_new_path(context_.get());
  cairo_arc(context_.get(), x, y, radius_px, 0.0, 2.0 * std::numbers::pi);
  set_color(color);
  cairo_fill_preserve(context_.get());
  set_color(kWhite);
  stroke(kRim_px);
}

void CairoCanvas::square(double x, double y, double radius_px, const Color& color) const {
  cairo_rectangle(context_.get(), x - radius_px, y - radius_px, 2.0 * radius_px, 2.0 * radius_px);
  set_color(color);
  cairo_fill_preserve(context_.get());
  set_color(kWhite);
  stroke(kRim_px);
}

void CairoCanvas::set_font(double size_px, bool is_bold) const {
  // Every Debian and Ubuntu with cairo has DejaVu (fontconfig depends on it); elsewhere fontconfig
  // finds the nearest face.
  cairo_select_font_face(context_.get(), "DejaVu Sans", CAIRO_FONT_SLANT_NORMAL,
                         is_bold ? CAIRO_FONT_WEIGHT_BOLD : CAIRO_FONT_WEIGHT_NORMAL);
  cairo_set_font_size(context_.get(), size_px);
}

double CairoCanvas::text_width(const std::string& text) const {
  cairo_text_extents_t extents;
  cairo_text_extents(context_.get(), printable(text).c_str(), &extents);
  return extents.x_advance;
}

void CairoCanvas::text(double x, double y, const std::string& text, TextAnchor anchor) const {
  const double share = anchor == TextAnchor::kLeft     ? 0.0
                       : anchor == TextAnchor::kCenter ? 0.5
                                                       : 1.0;
  cairo_move_to(context_.get(), x - share * text_width(text), y);
  cairo_show_text(context_.get(), printable(text).c_str());
  cairo_new_path(context_.get());
}

void CairoCanvas::vertical_text(double x, double y, const std::string& text_to_show) const {
  cairo_save(context_.get());
  cairo_translate(context_.get(), x, y);
  cairo_rotate(context_.get(), -0.5 * std::numbers::pi);
  text(0.0, 0.0, text_to_show, TextAnchor::kCenter);
  cairo_restore(context_.get());
}

}  // namespace stemvo
