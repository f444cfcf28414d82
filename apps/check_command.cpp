// SPDX-License-Identifier: MIT
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>

#include "commands.hpp"
#include "console.hpp"
#include "options.hpp"
#include "report/check.hpp"
#include "report/metrics_json.hpp"
#include "text/text_file.hpp"
#include "try.hpp"

namespace stemvo::apps {
namespace {

constexpr const char* kCheckFooter =
    R"(THRESHOLDS.yaml holds one line per number of metrics.json that must stay inside
its bounds:
  t_rel_percent: {max: 1.0}
  tracked_fraction: {min: 0.99}
  ate_rmse_m.sim3: {max: 3}

Exit code 1 when a number is outside its bounds, so that it gates a script:
  stemvo check result/metrics.json --against thresholds.yaml
  stemvo check result/metrics.json --baseline before/metrics.json --tolerance 5%)";

struct CheckArguments {
  CheckRequest request;
  std::optional<std::filesystem::path> junit;
};

nlohmann::ordered_json document(const std::vector<ThresholdResult>& results) {
  auto bounds = nlohmann::ordered_json::array();
  for (const ThresholdResult& result : results) {
    bounds.push_back({{"key", result.key},
                      {"value", result.number},
                      {result.is_max ? "max" : "min", result.limit},
                      {"passed", result.passed}});
    if (!result.problem.empty()) {
      bounds.back()["problem"] = result.problem;
    }
  }
  return {{"passed", all_passed(results)}, {"bounds", bounds}};
}

Expected<int> check(CheckArguments& arguments) {
  const CheckRequest& request = arguments.request;
  if (arguments.junit) {
    STEMVO_TRY(check_can_write(*arguments.junit));
  }
  const auto checked = check_metrics(request);
  if (!checked && arguments.junit) {
    const ThresholdResult unread{.key = "metrics", .problem = checked.error().message};
    STEMVO_TRY(write_text_file(*arguments.junit, format_junit({unread}, request.metrics.string())));
  }
  STEMVO_TRY_GET(const std::vector<ThresholdResult> results, checked);
  print(format_check_table(results));
  print_json(document(results));
  if (arguments.junit) {
    STEMVO_TRY(write_text_file(*arguments.junit, format_junit(results, request.metrics.string())));
  }
  for (const ThresholdResult& result : results) {
    if (!result.problem.empty()) {
      return fail(result.problem);  // the table has the others
    }
  }
  return all_passed(results) ? kExitDone : kExitFailed;
}

void add_options(CLI::App& command, CheckArguments& arguments) {
  CheckRequest& request = arguments.request;
  command.add_option("METRICS.json", request.metrics, "metrics.json of a run, or its folder")
      ->required()
      ->type_name("");
  add_file_option(command, "--against", request.thresholds, "Thresholds to hold it against");
  add_file_option(command, "--baseline", request.baseline,
                  "That of an earlier run, none of whose errors may grow");
  command
      .add_option_function<std::string>(
          "--tolerance",
          [&request](const std::string& share) { request.tolerance = std::stod(share) / 100.0; },
          "With --baseline: by how much they may; default 5%")
      ->type_name("P%")
      ->check([](const std::string& text) {
        const auto share = parse_numbers(text.substr(0, text.size() - 1), 1);
        return text.ends_with('%') && share && share->front() >= 0.0 && share->front() <= 100.0
                   ? std::string()
                   : "expected a share from 0% to 100%, found " + text;
      })
      ->needs("--baseline");
  add_file_option(command, "--junit", arguments.junit, "Write the bounds as JUnit's XML, too");
  command.parse_complete_callback([&request] {
    if (!request.thresholds && !request.baseline) {
      throw CLI::RequiredError("--against or --baseline");
    }
  });
}

}  // namespace

CLI::App* add_check(CLI::App& app, Action& action) {
  return add_command<CheckArguments>(
      app, action, {"check", "Hold the numbers of a run against thresholds", kCheckFooter},
      add_options, check);
}

}  // namespace stemvo::apps
