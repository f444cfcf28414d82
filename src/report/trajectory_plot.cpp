// SPDX-License-Identifier: MIT
#include "report/trajectory_plot.hpp"

#include <algorithm>
#include <memory>
#include <numbers>
#include <vector>

#include <cairo.h>
#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "internal_check.hpp"
#include "report/plot_layout.hpp"
#include "text/text_file.hpp"

namespace stemvo {

namespace {

struct Color {
  double red = 0.0;
  double green = 0.0;
  double blue = 0.0;
};

// Okabe and Ito's colours (safe for the colour-blind) on neutral grays.
constexpr Color kWhite{1.0, 1.0, 1.0};
constexpr Color kInk{0.13, 0.13, 0.13};
constexpr Color kSoftInk{0.35, 0.35, 0.35};
constexpr Color kGrid{0.90, 0.90, 0.90};
constexpr Color kFrame{0.45, 0.45, 0.45};
constexpr Color kTruth{0.62, 0.62, 0.62};
constexpr Color kEstimate{0.0, 114.0 / 255.0, 178.0 / 255.0};
constexpr Color kStart{0.0, 158.0 / 255.0, 115.0 / 255.0};
constexpr Color kEnd{213.0 / 255.0, 94.0 / 255.0, 0.0};

// The truth is a broad gray road under the thin estimate: both stay visible where they agree.
constexpr double kTruthWidth_px = 9.0;
constexpr double kEstimateWidth_px = 3.5;
constexpr double kStart_px = 9.5;
constexpr double kEnd_px = 12.0;
constexpr double kRim_px = 3.0;

constexpr double kTitle_px = 36.0;
constexpr double kSubtitle_px = 25.0;
constexpr double kLabel_px = 27.0;
constexpr double kTick_px = 24.0;

constexpr double kSwatch_px = 76.0;  // legend: room of a path's sample
constexpr double kAfterText_px = 48.0;
constexpr double kAfterMarker_px = 14.0;

struct CairoDelete {
  void operator()(cairo_t* context) const { cairo_destroy(context); }
  void operator()(cairo_surface_t* surface) const { cairo_surface_destroy(surface); }
  void operator()(cairo_font_options_t* options) const { cairo_font_options_destroy(options); }
};
using CairoSurface = std::unique_ptr<cairo_surface_t, CairoDelete>;

/// One bad byte in a folder's name would otherwise cost the whole figure: cairo stops at it.
std::string printable(std::string text) {
  using Json = nlohmann::json;
  std::replace_if(text.begin(), text.end(), [](unsigned char c) { return c < 0x20; }, ' ');
  return Json::parse(Json(text).dump(-1, ' ', false, Json::error_handler_t::replace));
}

struct Path {
  const Trajectory* trajectory;
  std::string name;  ///< in the legend
  Color color;
  double width_px;
};

/// In the legend's order.
std::vector<Path> paths_of(const TrajectoryPlot& plot) {
  STEMVO_CHECK(!plot.estimate.empty(), "at least one pose to draw");
  std::vector<Path> paths;
  if (plot.ground_truth) {
    paths.push_back({&*plot.ground_truth, "ground truth", kTruth, kTruthWidth_px});
  }
  paths.push_back({&plot.estimate, "estimate", kEstimate, kEstimateWidth_px});
  return paths;
}

PlotLayout layout_of(const std::vector<Path>& paths) {
  std::vector<const Trajectory*> trajectories;
  for (const Path& path : paths) {
    trajectories.push_back(path.trajectory);
  }
  return make_plot_layout(trajectories);
}

class Drawing {
 public:
  explicit Drawing(const TrajectoryPlot& plot)
      : plot_(plot), paths_(paths_of(plot)), layout_(layout_of(paths_)) {}

  [[nodiscard]] const PlotLayout& layout() const { return layout_; }

  [[nodiscard]] cairo_status_t draw(cairo_surface_t* surface) {
    cairo_.reset(cairo_create(surface));
    const std::unique_ptr<cairo_font_options_t, CairoDelete> options(cairo_font_options_create());
    cairo_font_options_set_antialias(options.get(), CAIRO_ANTIALIAS_GRAY);
    cairo_font_options_set_hint_style(options.get(), CAIRO_HINT_STYLE_NONE);
    cairo_font_options_set_hint_metrics(options.get(), CAIRO_HINT_METRICS_OFF);
    cairo_set_font_options(cairo_.get(), options.get());
    cairo_set_line_cap(cairo_.get(), CAIRO_LINE_CAP_ROUND);
    cairo_set_line_join(cairo_.get(), CAIRO_LINE_JOIN_ROUND);
    set_color(kWhite);
    cairo_paint(cairo_.get());
    draw_titles();
    draw_legend();
    draw_grid();
    std::ranges::for_each(paths_, [&](const Path& path) { draw_path(path); });
    draw_markers();
    return cairo_status(cairo_.get());
  }

 private:
  void set_color(const Color& color) const {
    cairo_set_source_rgb(cairo_.get(), color.red, color.green, color.blue);
  }

  void stroke(double width_px) const {
    cairo_set_line_width(cairo_.get(), width_px);
    cairo_stroke(cairo_.get());
  }

  void line(double x0, double y0, double x1, double y1, double width_px) const {
    cairo_move_to(cairo_.get(), x0, y0);
    cairo_line_to(cairo_.get(), x1, y1);
    stroke(width_px);
  }

  /// Fills the current path and gives it a white rim, so that it stands out on any line.
  void fill_marker(const Color& color) const {
    set_color(color);
    cairo_fill_preserve(cairo_.get());
    set_color(kWhite);
    stroke(kRim_px);
  }

  void start_marker(double x, double y) const {
    cairo_new_path(cairo_.get());
    cairo_arc(cairo_.get(), x, y, kStart_px, 0.0, 2.0 * std::numbers::pi);
    fill_marker(kStart);
  }

  void end_marker(double x, double y) const {
    cairo_rectangle(cairo_.get(), x - kEnd_px, y - kEnd_px, 2.0 * kEnd_px, 2.0 * kEnd_px);
    fill_marker(kEnd);
  }

  void set_font(double size_px, bool is_bold = false) const {
    // Every Debian and Ubuntu with cairo has DejaVu (fontconfig depends on it); elsewhere
    // fontconfig finds the nearest face.
    cairo_select_font_face(cairo_.get(), "DejaVu Sans", CAIRO_FONT_SLANT_NORMAL,
                           is_bold ? CAIRO_FONT_WEIGHT_BOLD : CAIRO_FONT_WEIGHT_NORMAL);
    cairo_set_font_size(cairo_.get(), size_px);
  }

  [[nodiscard]] double text_width(const std::string& text) const {
    cairo_text_extents_t extents;
    cairo_text_extents(cairo_.get(), printable(text).c_str(), &extents);
    return extents.x_advance;
  }

  /// Baseline at y; the text starts at x - share * its width.
  void text(double x, double y, const std::string& text, double share) const {
    cairo_move_to(cairo_.get(), x - share * text_width(text), y);
    cairo_show_text(cairo_.get(), printable(text).c_str());
    cairo_new_path(cairo_.get());
  }

  [[nodiscard]] double room_px() const { return layout_.width_px() - PlotLayout::kLeft_px - 20.0; }

  /// Left-aligned with the plot; shrinks until it fits the figure.
  void fitting_text(double y, const std::string& text_to_fit, double size_px, bool is_bold) const {
    set_font(size_px, is_bold);
    const double width_px = text_width(text_to_fit);
    if (width_px > room_px()) {
      set_font(size_px * room_px() / width_px, is_bold);
    }
    text(PlotLayout::kLeft_px, y, text_to_fit, 0.0);
  }

  void draw_titles() const {
    set_color(kInk);
    fitting_text(plot_.subtitle.empty() ? 108.0 : 62.0, plot_.title, kTitle_px, true);
    set_color(kSoftInk);
    fitting_text(108.0, plot_.subtitle, kSubtitle_px, false);
  }

  /// One line above the plot, where it can hide no data.
  void draw_legend() const {
    set_font(kTick_px);
    const double y = PlotLayout::kTop_px - 30.0;
    double x = PlotLayout::kLeft_px;
    const auto label = [&](const std::string& name) {
      set_color(kInk);
      text(x, y + 0.36 * kTick_px, name, 0.0);
      x += text_width(name) + kAfterText_px;
    };
    for (const Path& path : paths_) {
      set_color(path.color);
      line(x + 5.0, y, x + 59.0, y, path.width_px);
      x += kSwatch_px;
      label(path.name);
    }
    start_marker(x + kStart_px, y);
    x += 2.0 * kStart_px + kAfterMarker_px;
    label("start");
    end_marker(x + kEnd_px, y);
    x += 2.0 * kEnd_px + kAfterMarker_px;
    label("end");
  }

  void draw_grid() const {
    constexpr double kLeft = PlotLayout::kLeft_px;
    constexpr double kTop = PlotLayout::kTop_px;
    const double right = layout_.right_px();
    const double bottom = layout_.bottom_px();
    set_font(kTick_px);
    for (const double x : tick_positions(layout_.min_x_m, layout_.max_x_m(), layout_.tick_m)) {
      const double px = layout_.to_px_x(x);
      set_color(kGrid);
      line(px, kTop, px, bottom, 1.5);
      set_color(kInk);
      text(px, bottom + 38.0, tick_label(x, layout_.tick_m), 0.5);
    }
    for (const double z : tick_positions(layout_.min_z_m, layout_.max_z_m(), layout_.tick_m)) {
      const double py = layout_.to_px_y(z);
      set_color(kGrid);
      line(kLeft, py, right, py, 1.5);
      set_color(kInk);
      text(kLeft - 16.0, py + 0.36 * kTick_px, tick_label(z, layout_.tick_m), 1.0);
    }
    set_font(kLabel_px);
    text(0.5 * (kLeft + right), bottom + 92.0, fmt::format("x, to the right [{}]", plot_.unit),
         0.5);
    cairo_save(cairo_.get());
    cairo_translate(cairo_.get(), 44.0, kTop + 0.5 * layout_.plot_height_px);
    cairo_rotate(cairo_.get(), -0.5 * std::numbers::pi);
    text(0.0, 0.0, fmt::format("z, forward [{}]", plot_.unit), 0.5);
    cairo_restore(cairo_.get());
    set_color(kFrame);
    cairo_rectangle(cairo_.get(), kLeft, kTop, layout_.plot_width_px, layout_.plot_height_px);
    stroke(2.0);
  }

  void draw_path(const Path& path) const {
    bool is_open = false;
    for (const Rigid3& pose : *path.trajectory) {
      if (!pose.translation.allFinite()) {
        is_open = false;
        continue;
      }
      const double x = layout_.to_px_x(pose.translation.x());
      const double y = layout_.to_px_y(pose.translation.z());
      is_open ? cairo_line_to(cairo_.get(), x, y) : cairo_move_to(cairo_.get(), x, y);
      is_open = true;
    }
    set_color(path.color);
    stroke(path.width_px);
  }

  void draw_markers() const {
    const auto is_finite = [](const Rigid3& pose) { return pose.translation.allFinite(); };
    const Trajectory& path = plot_.estimate;
    const auto first = std::find_if(path.begin(), path.end(), is_finite);
    if (first == path.end()) {
      return;
    }
    const auto last = std::find_if(path.rbegin(), path.rend(), is_finite);
    // On a loop both fall together: the square's corners stay visible around the disk.
    end_marker(layout_.to_px_x(last->translation.x()), layout_.to_px_y(last->translation.z()));
    start_marker(layout_.to_px_x(first->translation.x()), layout_.to_px_y(first->translation.z()));
  }

  const TrajectoryPlot& plot_;
  std::vector<Path> paths_;
  PlotLayout layout_;
  std::unique_ptr<cairo_t, CairoDelete> cairo_;
};

cairo_status_t append_bytes(void* text, const unsigned char* data, unsigned int size) {
  static_cast<std::string*>(text)->append(reinterpret_cast<const char*>(data), size);
  return CAIRO_STATUS_SUCCESS;
}

}  // namespace

Status write_trajectory_png(const std::filesystem::path& file, const TrajectoryPlot& plot) {
  Drawing drawing(plot);
  const CairoSurface surface(
      cairo_image_surface_create(CAIRO_FORMAT_RGB24, static_cast<int>(drawing.layout().width_px()),
                                 static_cast<int>(drawing.layout().height_px())));
  std::string bytes;
  cairo_status_t status = drawing.draw(surface.get());
  if (status == CAIRO_STATUS_SUCCESS) {
    status = cairo_surface_write_to_png_stream(surface.get(), append_bytes, &bytes);
  }
  if (status != CAIRO_STATUS_SUCCESS) {
    return fail(fmt::format("{}: cannot draw: {}", file.string(), cairo_status_to_string(status)));
  }
  return write_text_file(file, bytes);
}

}  // namespace stemvo
