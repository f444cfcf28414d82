// SPDX-License-Identifier: MIT
#include <filesystem>
#include <vector>

#include <nlohmann/json.hpp>

#include "commands.hpp"
#include "console.hpp"
#include "report/check.hpp"
#include "report/metrics_keys.hpp"
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
  stemvo check result/metrics.json --against thresholds.yaml)";

struct CheckArguments {
  std::filesystem::path metrics;
  std::filesystem::path thresholds;
};

nlohmann::ordered_json document(const std::vector<ThresholdResult>& results) {
  auto bounds = nlohmann::ordered_json::array();
  for (const ThresholdResult& result : results) {
    bounds.push_back({{"key", result.key},
                      {"value", result.number},
                      {result.is_max ? "max" : "min", result.limit},
                      {"passed", result.passed}});
  }
  return {{"passed", all_passed(results)}, {"bounds", bounds}};
}

Expected<int> check(CheckArguments& arguments) {
  STEMVO_TRY_GET(const std::vector<ThresholdResult> results,
                 check_metrics(arguments.metrics, arguments.thresholds));
  print(format_check_table(results));
  print_json(document(results));
  return all_passed(results) ? kExitDone : kExitFailed;
}

void add_options(CLI::App& command, CheckArguments& arguments) {
  command.add_option("METRICS.json", arguments.metrics, "metrics.json of a run")
      ->required()
      ->type_name("");
  command.add_option("--against", arguments.thresholds, "Thresholds to hold it against")
      ->required()
      ->type_name("THRESHOLDS.yaml");
}

}  // namespace

CLI::App* add_check(CLI::App& app, Action& action) {
  return add_command<CheckArguments>(
      app, action, {"check", "Hold the numbers of a run against thresholds", kCheckFooter},
      add_options, check);
}

}  // namespace stemvo::apps
