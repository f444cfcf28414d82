// SPDX-License-Identifier: MIT
#include <algorithm>
#include <exception>
#include <memory>
#include <new>
#include <sstream>
#include <string>
#include <vector>

#include <CLI/CLI.hpp>
#include <fmt/format.h>
#include <fmt/ranges.h>
#include <opencv2/core/utils/logger.hpp>

#include "commands.hpp"
#include "config/config.hpp"
#include "console.hpp"
#include "stemvo/version.hpp"
#include "text/text_file.hpp"

namespace stemvo::apps {
namespace {

constexpr const char* kFooter = R"(A first drive, without any data:
  stemvo synth drive                             render a street
  stemvo run drive/sequences/00 --out result     then see result/report.html
With KITTI:
  stemvo run kitti/sequences/00 --out result --set scale.source=ground_truth
With your own camera (see 'stemvo run --help'):
  stemvo run drive/images --camera camera.yaml --out result

'stemvo COMMAND --help' explains a command; with --json it prints its result for
a program. Every configuration key is explained by
  stemvo --dump-config > my.yaml
edit it, then: stemvo run ... --config my.yaml

Exit codes: 0 done, 1 something is wrong with a file, model or key (one line
says what), 2 wrong usage, 130 interrupted (what was computed is written).)";

/// CLI11's help, with the options' texts in lines that end before column 80.
class HelpFormat : public CLI::Formatter {
 public:
  std::string make_option_desc(const CLI::Option* option) const override {
    const std::size_t width = 80 - get_column_width();
    std::string text = Formatter::make_option_desc(option);
    for (std::size_t begin = 0; text.size() - begin > width;) {
      const std::size_t blank = text.rfind(' ', begin + width);
      text[blank] = '\n';
      begin = blank + 1;
    }
    return text;
  }
};

/// "expected a command: run, evaluate, .., found 'runn'"
std::string expected_command(const CLI::App& app, const std::string& found) {
  std::vector<std::string> names;
  for (const CLI::App* command : app.get_subcommands([](const CLI::App*) { return true; })) {
    names.push_back(command->get_name());
  }
  return fmt::format("expected a command: {}, found {}", fmt::join(names, ", "), found);
}

bool is_image(const std::string& word) {
  return word.ends_with(".png") || word.ends_with(".jpg") || word.ends_with(".jpeg");
}

/// Wrong usage on one line, as every other error. --help and --version are no errors.
int report_usage(const CLI::App& app, const CLI::ParseError& error) {
  if (error.get_exit_code() == 0) {
    std::ostringstream help;
    app.exit(error, help, help);
    print_help(help.str());
    return kExitDone;
  }
  std::string command = "stemvo";
  for (const CLI::App* sub : app.get_subcommands()) {
    command += " " + sub->get_name();
  }
  std::string message = error.what();
  if (app.get_subcommands().empty()) {
    const std::vector<std::string> words = app.remaining();
    const auto word =
        std::ranges::find_if(words, [](const std::string& one) { return !one.starts_with('-'); });
    if (word != words.end()) {
      message = expected_command(app, "'" + *word + "'");
    }
  }
  message = one_line(message);  // the shell may have made a thousand names of a pattern
  if (dynamic_cast<const CLI::ExtrasError*>(&error) != nullptr &&
      std::ranges::any_of(app.remaining(true), is_image)) {
    message += "; a pattern of files must be quoted";
  }
  print_error(message + " (see '" + command + " --help')");
  return kExitUsage;
}

int run_program(int argc, char** argv) {
  CLI::App app("stemvo: camera frames in, a trajectory out, seen through one learned filter.",
               "stemvo");
  app.set_version_flag("--version", "stemvo " + std::string(version()));
  app.formatter(std::make_shared<HelpFormat>());
  app.footer(kFooter);
  Action action;
  app.add_flag_callback(
      "--dump-config",
      [&action] {
        action = [] {
          print(dump_config({}));
          return kExitDone;
        };
      },
      "Print the default configuration, every key explained");
  for (const auto add :
       {add_run, add_evaluate, add_channel, add_synth, add_calibrate, add_check, add_models}) {
    CLI::App* command = add(app, action);
    command->set_version_flag("--version", "stemvo " + std::string(version()));
    CLI::Option* const json = command->add_flag_callback(
        "--json", choose_json, "The result as one JSON document on standard output");
    if (CLI::Option* const rows = command->get_option_no_throw("--stream")) {
      json->excludes(rows);
    }
  }
  app.require_subcommand(0, 1);
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return report_usage(app, error);
  }
  if (!action) {
    print_error(expected_command(app, "none") + " (see 'stemvo --help')");
    return kExitUsage;
  }
  const Expected<int> exit_code = action();
  if (!exit_code) {
    print_error(exit_code.error().message);
  }
  return exit_code.value_or(kExitFailed);
}

}  // namespace
}  // namespace stemvo::apps

int main(int argc, char** argv) {
  stemvo::apps::process_start();
  stemvo::apps::catch_interrupts();
  cv::utils::logging::setLogLevel(cv::utils::logging::LOG_LEVEL_SILENT);  // errors are ours to tell
  try {
    return stemvo::apps::flush_console(stemvo::apps::run_program(argc, argv));
  } catch (const std::bad_alloc&) {
    stemvo::apps::print_error("out of memory");
  } catch (const std::exception& error) {
    stemvo::apps::print_error(std::string("internal: ") + error.what());
  }
  return stemvo::apps::kExitFailed;
}
