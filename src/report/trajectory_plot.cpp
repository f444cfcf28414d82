// SPDX-License-Identifier: MIT
#include "stemvo/report/trajectory_plot.hpp"

#include <algorithm>
#include <map>
#include <string_view>

#include <cairo-svg.h>
#include <fmt/core.h>

#include "report/cairo_canvas.hpp"
#include "report/plot_layout.hpp"
#include "stemvo/check.hpp"
#include "text/text_file.hpp"

namespace stemvo {

namespace {

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
constexpr Color kOthers[] = {{204.0 / 255.0, 121.0 / 255.0, 167.0 / 255.0},
                             {230.0 / 255.0, 159.0 / 255.0, 0.0},
                             {86.0 / 255.0, 180.0 / 255.0, 233.0 / 255.0}};

// The truth is a broad gray road under the thin estimate: both stay visible where they agree.
constexpr double kTruthWidth_px = 9.0;
constexpr double kEstimateWidth_px = 3.5;
constexpr double kStart_px = 9.5;
constexpr double kEnd_px = 12.0;

constexpr double kTitle_px = 36.0;
constexpr double kSubtitle_px = 25.0;
constexpr double kLabel_px = 27.0;
constexpr double kTick_px = 24.0;

void draw_grid(const CairoCanvas& canvas, const PlotLayout& layout, const std::string& unit) {
  const double right = layout.left_px + layout.plot_width_px;
  const double bottom = layout.top_px + layout.plot_height_px;
  canvas.set_font(kTick_px);
  for (const double x : tick_positions(layout.min_x_m, layout.max_x_m(), layout.tick_m)) {
    const double px = layout.to_px_x(x);
    canvas.set_color(kGrid);
    canvas.line(px, layout.top_px, px, bottom, 1.5);
    canvas.set_color(kInk);
    canvas.text(px, bottom + 38.0, tick_label(x, layout.tick_m), TextAnchor::kCenter);
  }
  for (const double z : tick_positions(layout.min_z_m, layout.max_z_m(), layout.tick_m)) {
    const double py = layout.to_px_y(z);
    canvas.set_color(kGrid);
    canvas.line(layout.left_px, py, right, py, 1.5);
    canvas.set_color(kInk);
    canvas.text(layout.left_px - 16.0, py + 0.36 * kTick_px, tick_label(z, layout.tick_m),
                TextAnchor::kRight);
  }
  canvas.set_font(kLabel_px);
  canvas.text(0.5 * (layout.left_px + right), bottom + 92.0,
              fmt::format("x, to the right [{}]", unit), TextAnchor::kCenter);
  canvas.vertical_text(44.0, layout.top_px + 0.5 * layout.plot_height_px,
                       fmt::format("z, forward [{}]", unit));
  canvas.set_color(kFrame);
  cairo_rectangle(canvas.context(), layout.left_px, layout.top_px, layout.plot_width_px,
                  layout.plot_height_px);
  canvas.stroke(2.0);
}

void draw_path(const CairoCanvas& canvas,
               const PlotLayout& layout,
               const Trajectory& trajectory,
               const Color& color,
               double width_px) {
  bool is_open = false;
  for (const Rigid3& pose : trajectory) {
    if (!pose.translation.allFinite()) {
      is_open = false;
      continue;
    }
    const double x = layout.to_px_x(pose.translation.x());
    const double y = layout.to_px_y(pose.translation.z());
    is_open ? cairo_line_to(canvas.context(), x, y) : cairo_move_to(canvas.context(), x, y);
    is_open = true;
  }
  canvas.set_color(color);
  canvas.stroke(width_px);
}

void draw_markers(const CairoCanvas& canvas,
                  const PlotLayout& layout,
                  const Trajectory& trajectory) {
  const auto is_finite = [](const Rigid3& pose) { return pose.translation.allFinite(); };
  const auto first = std::find_if(trajectory.begin(), trajectory.end(), is_finite);
  if (first == trajectory.end()) {
    return;
  }
  const auto last = std::find_if(trajectory.rbegin(), trajectory.rend(), is_finite);
  // On a loop both fall together: the square's corners stay visible around the disk.
  canvas.square(layout.to_px_x(last->translation.x()), layout.to_px_y(last->translation.z()),
                kEnd_px, kEnd);
  canvas.disk(layout.to_px_x(first->translation.x()), layout.to_px_y(first->translation.z()),
              kStart_px, kStart);
}

const Color& color_of_other(std::size_t index) { return kOthers[index % std::size(kOthers)]; }

/// Left-aligned with the plot; shrinks until it fits the figure.
void draw_fitting_text(const CairoCanvas& canvas,
                       const PlotLayout& layout,
                       double y,
                       const std::string& text,
                       double size_px,
                       bool is_bold) {
  const double room_px = layout.width_px - layout.left_px - 20.0;
  canvas.set_font(size_px, is_bold);
  const double width_px = canvas.text_width(text);
  if (width_px > room_px) {
    canvas.set_font(size_px * room_px / width_px, is_bold);
  }
  canvas.text(layout.left_px, y, text, TextAnchor::kLeft);
}

void draw_titles(const CairoCanvas& canvas, const PlotLayout& layout, const TrajectoryPlot& plot) {
  canvas.set_color(kInk);
  const double title_y = plot.subtitle.empty() ? 108.0 : 62.0;
  draw_fitting_text(canvas, layout, title_y, plot.title, kTitle_px, true);
  canvas.set_color(kSoftInk);
  draw_fitting_text(canvas, layout, 108.0, plot.subtitle, kSubtitle_px, false);
}

/// What a path is called, and how it is drawn.
struct LegendLine {
  Color color;
  double width_px;
  std::string text;
};

std::vector<LegendLine> legend_lines(const TrajectoryPlot& plot) {
  std::vector<LegendLine> lines;
  if (plot.ground_truth) {
    lines.push_back({kTruth, kTruthWidth_px, "ground truth"});
  }
  lines.push_back({kEstimate, kEstimateWidth_px, plot.estimate_name});
  for (std::size_t i = 0; i < plot.others.size(); ++i) {
    lines.push_back({color_of_other(i), kEstimateWidth_px, plot.others[i].name});
  }
  return lines;
}

constexpr double kSwatch_px = 76.0;  ///< room of a path's sample
constexpr double kAfterText_px = 48.0;
constexpr double kAfterMarker_px = 14.0;

double legend_width(const CairoCanvas& canvas, const std::vector<LegendLine>& lines) {
  double width_px = 2.0 * (kStart_px + kEnd_px + kAfterMarker_px) + kAfterText_px +
                    canvas.text_width("start") + canvas.text_width("end");
  for (const LegendLine& line : lines) {
    width_px += kSwatch_px + canvas.text_width(line.text) + kAfterText_px;
  }
  return width_px;
}

/// One line above the plot, where it can hide no data; shrinks until it fits the figure.
void draw_legend(const CairoCanvas& canvas, const PlotLayout& layout, const TrajectoryPlot& plot) {
  const std::vector<LegendLine> lines = legend_lines(plot);
  canvas.set_font(kTick_px);
  const double room_px = layout.width_px - layout.left_px - 20.0;
  const double zoom = std::min(1.0, room_px / legend_width(canvas, lines));
  canvas.set_font(kTick_px * zoom);
  const double y = layout.top_px - 30.0;
  double x = layout.left_px;
  const auto label = [&](const std::string& text) {
    canvas.set_color(kInk);
    canvas.text(x, y + 0.36 * kTick_px * zoom, text, TextAnchor::kLeft);
    x += canvas.text_width(text) + kAfterText_px * zoom;
  };
  for (const LegendLine& line : lines) {
    canvas.set_color(line.color);
    canvas.line(x + 5.0 * zoom, y, x + 59.0 * zoom, y, line.width_px);
    x += kSwatch_px * zoom;
    label(line.text);
  }
  canvas.disk(x + kStart_px * zoom, y, kStart_px * zoom, kStart);
  x += (2.0 * kStart_px + kAfterMarker_px) * zoom;
  label("start");
  canvas.square(x + kEnd_px * zoom, y, kEnd_px * zoom, kEnd);
  x += (2.0 * kEnd_px + kAfterMarker_px) * zoom;
  label("end");
}

PlotLayout layout_of(const TrajectoryPlot& plot) {
  STEMVO_CHECK(!plot.estimate.empty(), "at least one pose to draw");
  std::vector<const Trajectory*> trajectories{&plot.estimate};
  if (plot.ground_truth) {
    trajectories.push_back(&*plot.ground_truth);
  }
  for (const NamedTrajectory& other : plot.others) {
    trajectories.push_back(&other.trajectory);
  }
  return make_plot_layout(trajectories);
}

/// The one drawing for every kind of surface. Error: cairo's.
Status draw(cairo_surface_t* surface, const PlotLayout& layout, const TrajectoryPlot& plot) {
  const CairoCanvas canvas(surface);
  canvas.fill_background(kWhite);
  draw_titles(canvas, layout, plot);
  draw_legend(canvas, layout, plot);
  draw_grid(canvas, layout, plot.unit);
  if (plot.ground_truth) {
    draw_path(canvas, layout, *plot.ground_truth, kTruth, kTruthWidth_px);
  }
  for (std::size_t i = plot.others.size(); i-- > 0;) {
    draw_path(canvas, layout, plot.others[i].trajectory, color_of_other(i), kEstimateWidth_px);
  }
  draw_path(canvas, layout, plot.estimate, kEstimate, kEstimateWidth_px);
  draw_markers(canvas, layout, plot.estimate);
  const cairo_status_t status = cairo_status(canvas.context());
  if (status != CAIRO_STATUS_SUCCESS) {
    return fail(cairo_status_to_string(status));
  }
  return {};
}

cairo_status_t append_bytes(void* text, const unsigned char* data, unsigned int size) {
  static_cast<std::string*>(text)->append(reinterpret_cast<const char*>(data), size);
  return CAIRO_STATUS_SUCCESS;
}

Status write_bytes(const std::filesystem::path& file,
                   const Status& drawn,
                   cairo_status_t status,
                   const std::string& bytes) {
  if (!drawn) {
    return fail(fmt::format("{}: cannot draw: {}", file.string(), drawn.error().message));
  }
  if (status != CAIRO_STATUS_SUCCESS) {
    return fail(fmt::format("{}: cannot draw: {}", file.string(), cairo_status_to_string(status)));
  }
  return write_text_file(file, bytes);
}

/// cairo numbers its surfaces over the life of the process: numbers them anew in order of
/// appearance, so that the same plot gives the same bytes.
std::string with_own_surface_numbers(const std::string& svg) {
  constexpr std::string_view kName = "surface";
  std::string result;
  std::map<std::string, std::size_t> numbers;
  std::size_t copied = 0;
  for (std::size_t at = svg.find(kName); at != std::string::npos; at = svg.find(kName, copied)) {
    const std::size_t begin = at + kName.size();
    const std::size_t end = std::min(svg.find_first_not_of("0123456789", begin), svg.size());
    result += svg.substr(copied, begin - copied);
    if (end > begin) {
      const std::size_t number =
          numbers.try_emplace(svg.substr(begin, end - begin), numbers.size()).first->second;
      result += std::to_string(number);
    }
    copied = end;
  }
  return result + svg.substr(copied);
}

}  // namespace

Status write_trajectory_png(const std::filesystem::path& file, const TrajectoryPlot& plot) {
  const PlotLayout layout = layout_of(plot);
  const CairoSurface surface(cairo_image_surface_create(
      CAIRO_FORMAT_RGB24, static_cast<int>(layout.width_px), static_cast<int>(layout.height_px)));
  const Status drawn = draw(surface.get(), layout, plot);
  std::string bytes;
  const cairo_status_t status =
      cairo_surface_write_to_png_stream(surface.get(), append_bytes, &bytes);
  return write_bytes(file, drawn, status, bytes);
}

Status write_trajectory_svg(const std::filesystem::path& file, const TrajectoryPlot& plot) {
  const PlotLayout layout = layout_of(plot);
  std::string bytes;
  const CairoSurface surface(
      cairo_svg_surface_create_for_stream(append_bytes, &bytes, layout.width_px, layout.height_px));
  cairo_svg_surface_set_document_unit(surface.get(), CAIRO_SVG_UNIT_PX);
  const Status drawn = draw(surface.get(), layout, plot);
  cairo_surface_finish(surface.get());
  return write_bytes(file, drawn, cairo_surface_status(surface.get()),
                     with_own_surface_numbers(bytes));
}

}  // namespace stemvo
