// SPDX-License-Identifier: MIT
#include "html/page.hpp"

#include <nlohmann/json.hpp>

#include "robustness/robustness.hpp"

namespace stemvo::robustness {

Status write_page(const std::filesystem::path& file,
                  const RobustnessReport& report,
                  const RobustnessRequest& request) {
  return html::write_page(file, {{"page", "robustness"},
                                 {"report", document(report)},
                                 {"contenders", report.contenders},
                                 {"table", format_table(report)},
                                 {"command", request.command},
                                 {"configuration", dump_config(request.config)}});
}

}  // namespace stemvo::robustness
