// SPDX-License-Identifier: MIT
#include <string>
#include <vector>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "commands.hpp"
#include "console.hpp"
#include "models/manifest.hpp"
#include "options.hpp"

namespace stemvo::apps {
namespace {

constexpr const char* kModelsFooter =
    R"(A model is chosen by its name (--set stem.model=NAME) or by the path of an .onnx file with a
manifest.yaml beside it. Four need no file, to compare with: gray, input_layer (filters 0, 1, 2 =
R, G, B), log (Laplacian of Gaussian) and census (gray levels against their surroundings').)";

std::string describe(const ModelEntry& entry, const Status& status) {
  std::string text = fmt::format("{}: {}\n", entry.name, status ? "sound" : "NOT SOUND");
  text += fmt::format("  network   {}, layer {}\n", entry.network, entry.layer);
  text +=
      fmt::format("  filters   {} of {}x{} pixels, stride {}, the best: {}\n", entry.num_filters,
                  entry.kernel_px[1], entry.kernel_px[0], entry.stride_px, entry.default_filter);
  text += fmt::format("  file      {}\n  licence   {}\n  made by   {}\n", entry.file.string(),
                      entry.licence, entry.command);
  return text;
}

nlohmann::ordered_json document(const ModelEntry& entry, const Status& status) {
  return {{"name", entry.name},
          {"sound", status.has_value()},
          {"problem",
           status ? nlohmann::ordered_json() : nlohmann::ordered_json(status.error().message)},
          {"network", entry.network},
          {"layer", entry.layer},
          {"filters", entry.num_filters},
          {"default_filter", entry.default_filter},
          {"kernel_px", {entry.kernel_px[1], entry.kernel_px[0]}},
          {"stride_px", entry.stride_px},
          {"file", entry.file.string()},
          {"licence", entry.licence},
          {"made_by", entry.command}};
}

struct ModelsArguments {
  std::string model;  ///< empty: all
};

Expected<int> list_models(ModelsArguments& arguments) {
  const std::string& model = arguments.model;
  const auto folder = data_folder("models");
  const Expected<std::vector<ModelEntry>> entries =
      model.empty() ? load_manifest(folder / "manifest.yaml") : find_layers(model, folder);
  if (!entries) {
    return entries.error();
  }
  int exit_code = kExitDone;
  auto json = nlohmann::ordered_json::array();
  for (const ModelEntry& entry : *entries) {
    const Status status = check_model(entry);
    print(describe(entry, status));
    json.push_back(document(entry, status));
    if (!status) {
      print_error(status.error().message);
      exit_code = kExitFailed;
    }
  }
  print_json({{"models", json}});
  return exit_code;
}

void add_options(CLI::App& command, ModelsArguments& arguments) {
  command.add_option("MODEL", arguments.model,
                     "Only this one's layers: its name, or the path of an .onnx");
}

}  // namespace

CLI::App* add_models(CLI::App& app, Action& action) {
  return add_command<ModelsArguments>(
      app, action, {"models", "List the models and check that each file is sound", kModelsFooter},
      add_options, list_models);
}

}  // namespace stemvo::apps
