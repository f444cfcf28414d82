// SPDX-License-Identifier: MIT
#include <string>
#include <vector>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "commands.hpp"
#include "console.hpp"
#include "stem/model.hpp"
#include "try.hpp"

namespace stemvo::apps {
namespace {

constexpr const char* kModelsFooter =
    R"(A model is chosen by its name or by the path of its .onnx file (--set
stem.model=MODEL), which says its kernel, stride and padding in its metadata:
`stemvo-lab export` writes such files. Four need no file, to compare with: gray,
input_layer (filters 0, 1, 2 = R, G, B), log (Laplacian of Gaussian) and census
(gray levels against their surroundings').)";

std::string describe(const std::string& model, const ModelInfo& info, const Status& status) {
  const std::string alone =
      info.only_filter ? fmt::format("filter {} of ", *info.only_filter) : std::string();
  return fmt::format(
      "{}: {}\n"
      "  network   {}, layer {}\n"
      "  filters   {}{} of {}x{} pixels, stride {}, default: {}\n"
      "  licence   {}\n"
      "  made by   {}\n",
      model, status ? "sound" : "NOT SOUND", info.network, info.layer, alone, info.num_filters,
      info.kernel_px[1], info.kernel_px[0], info.stride_px, info.default_filter, info.licence,
      info.command);
}

nlohmann::ordered_json document(const std::string& model,
                                const ModelInfo& info,
                                const Status& status) {
  return {{"name", model},
          {"sound", status.has_value()},
          {"problem",
           status ? nlohmann::ordered_json() : nlohmann::ordered_json(status.error().message)},
          {"network", info.network},
          {"layer", info.layer},
          {"filters", info.num_filters},
          {"default_filter", info.default_filter},
          {"kernel_px", {info.kernel_px[1], info.kernel_px[0]}},
          {"stride_px", info.stride_px},
          {"licence", info.licence},
          {"made_by", info.command}};
}

struct ModelsArguments {
  std::vector<std::string> models = built_in_models();
};

Expected<int> list_models(ModelsArguments& arguments) {
  int exit_code = kExitDone;
  auto json = nlohmann::ordered_json::array();
  for (const std::string& model : arguments.models) {
    STEMVO_TRY_GET(const ModelInfo info, read_model_info(model));
    const auto opened = internal::open_model(model);
    const Status status = opened ? Status() : opened.error();
    print(describe(model, info, status));
    json.push_back(document(model, info, status));
    if (!status) {
      print_error(status.error().message);
      exit_code = kExitFailed;
    }
  }
  print_json({{"models", json}});
  return exit_code;
}

void add_options(CLI::App& command, ModelsArguments& arguments) {
  command.add_option("MODEL", arguments.models,
                     "Names or paths of .onnx files; default: those built in");
}

}  // namespace

CLI::App* add_models(CLI::App& app, Action& action) {
  return add_command<ModelsArguments>(
      app, action, {"models", "Show what models say of themselves, and check it", kModelsFooter},
      add_options, list_models);
}

}  // namespace stemvo::apps
