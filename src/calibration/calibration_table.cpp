// SPDX-License-Identifier: MIT
#include <cmath>

#include <fmt/format.h>

#include "report/text_table.hpp"
#include "stemvo/calibration/calibrate.hpp"

namespace stemvo {
namespace {

std::string deviation_text(const CalibratedParameter& parameter) {
  return std::isfinite(parameter.deviation_px) ? fmt::format("{:.2f}", parameter.deviation_px)
                                               : "unknown";
}

std::string change_text(const CalibratedParameter& parameter) {
  if (!parameter.is_determined) {
    return fmt::format("undetermined (deviation above {:.2f}): as given",
                       parameter.max_deviation_px);
  }
  return fmt::format("{:+.2f} ({:+.2f} %)", parameter.refined_px - parameter.given_px,
                     100.0 * (parameter.refined_px / parameter.given_px - 1.0));
}

}  // namespace

std::string format_calibration_table(const CalibrationReport& report) {
  TextTable table("lrrrl");
  table.add({"px", "given", "refined", "deviation", "change"});
  table.rule();
  for (const CalibratedParameter& parameter : report.parameters) {
    table.add({parameter.name, fmt::format("{:.2f}", parameter.given_px),
               fmt::format("{:.2f}", parameter.refined_px), deviation_text(parameter),
               change_text(parameter)});
  }
  table.rule();
  table.add({"reprojection error", fmt::format("{:.4f}", report.given_error_px),
             fmt::format("{:.4f}", report.refined_error_px)});
  std::string text = table.str();
  text += fmt::format(
      "from {} observations of {} landmarks in {} stretches that turn {:.0f} degrees in all\n",
      report.num_observations, report.num_landmarks, report.num_segments, report.turned_deg);
  text += fmt::format(
      "radial distortion left in the frames, which calib.txt cannot hold: k1 {:+.4f} +- {:.4f}, "
      "k2 {:+.4f} +- {:.4f}\n",
      report.distortion[0], report.distortion_deviation[0], report.distortion[1],
      report.distortion_deviation[1]);
  return text;
}

}  // namespace stemvo
