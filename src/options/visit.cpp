// SPDX-License-Identifier: MIT
#include "options/visit.hpp"

#include <cmath>

#include <fmt/ranges.h>

#include "text/text_file.hpp"

namespace stemvo::options {
namespace {

/// Written so that NaN fails.
bool is_inside(const Rule& rule, double value) {
  const bool is_odd = !rule.odd || std::fmod(std::abs(value), 2.0) == 1.0;
  return std::isfinite(value) && value >= rule.min && value <= rule.max && is_odd;
}

}  // namespace

std::string number_violation(std::string_view kind, double value, const Rule& rule) {
  if (is_inside(rule, value)) {
    return {};
  }
  const std::string range =
      std::isfinite(rule.min) && std::isfinite(rule.max)
          ? fmt::format(" {}from {} to {}", rule.odd ? "odd, " : "", rule.min, rule.max)
          : "";
  return fmt::format("expected {}{}, found {}", kind, range, value);
}

std::string full_name(std::string_view section, std::string_view key) {
  return section.empty() ? std::string(key) : fmt::format("{}.{}", section, key);
}

std::string violation_of(const std::vector<double>& values, const Rule& rule) {
  const auto wrong = std::ranges::find_if_not(values, [&](double v) { return is_inside(rule, v); });
  return wrong == values.end() ? std::string() : violation_of(*wrong, rule);
}

std::string violation_of(const std::string& value, const Rule& rule) {
  if (rule.choices.empty()) {
    return value.empty() ? "expected a text, found nothing" : std::string();
  }
  const bool is_known = std::ranges::find(rule.choices, value) != rule.choices.end();
  return is_known ? std::string()
                  : fmt::format("expected one of {}, found '{}'", fmt::join(rule.choices, ", "),
                                one_line(value));
}

}  // namespace stemvo::options

namespace stemvo {

Options Options::driving(double height_m) {
  Options options;
  options.scale.source = ScaleSource::kCameraHeight;
  options.scale.camera_height_m = height_m;
  return options;
}

Status validate(const Options& options) {
  options::Checker checker;
  options::visit(options, checker);
  const double low = options.stem.contrast_low_percent;
  const double high = options.stem.contrast_high_percent;
  if (checker.status && low >= high) {
    return fail(
        fmt::format("stem.contrast_low_percent: expected less than stem.contrast_high_percent "
                    "({}), found {}",
                    high, low));
  }
  return checker.status;
}

}  // namespace stemvo
