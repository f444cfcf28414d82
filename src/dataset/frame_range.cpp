// SPDX-License-Identifier: MIT
#include <charconv>
#include <string_view>

#include <fmt/format.h>

#include "stemvo/dataset/frame_source.hpp"

namespace stemvo {
namespace {

std::optional<std::size_t> parse_index(std::string_view text) {
  std::size_t value = 0;
  const auto [end, code] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (code != std::errc() || end != text.data() + text.size()) {
    return std::nullopt;
  }
  return value;
}

}  // namespace

Expected<FrameRangeRequest> parse_frame_range(const std::string& text) {
  const auto malformed = [&] {
    return fail(fmt::format("frames: expected A:B, A: or :B with whole numbers, found '{}'", text));
  };
  const std::size_t colon = text.find(':');
  if (colon == std::string::npos || text.size() == 1) {
    return malformed();
  }
  const std::string_view first = std::string_view(text).substr(0, colon);
  const std::string_view last = std::string_view(text).substr(colon + 1);
  FrameRangeRequest request;
  if (!first.empty()) {
    const auto begin = parse_index(first);
    if (!begin) {
      return malformed();
    }
    request.begin = *begin;
  }
  if (!last.empty()) {
    request.end = parse_index(last);
    if (!request.end) {
      return malformed();
    }
  }
  if (request.end && *request.end <= request.begin) {
    return fail(fmt::format("frames: expected A < B in the half-open A:B, found '{}'", text));
  }
  return request;
}

}  // namespace stemvo
