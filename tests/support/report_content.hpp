// SPDX-License-Identifier: MIT
#pragma once

#include <nlohmann/json.hpp>

#include "support/test.hpp"

namespace stemvo::testing {

/// The JSON that the scripts of a report.html read.
inline nlohmann::json report_content(const std::string& page) {
  const std::string begin = "<script type=\"application/json\" id=\"content\">";
  const std::size_t at = page.find(begin) + begin.size();
  return nlohmann::json::parse(page.substr(at, page.find("</script>", at) - at));
}

}  // namespace stemvo::testing
