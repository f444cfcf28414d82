// SPDX-License-Identifier: MIT
#include <regex>

#include "support/program_test.hpp"
#include "support/test.hpp"
#include "support/tiny_stem.hpp"

namespace stemvo {
namespace {

using Json = nlohmann::json;

/// The commands that the program's help lists.
std::set<std::string> commands() {
  const std::string help = succeeded(run_stemvo({"--help"})).out;
  EXPECT_THAT(help, HasSubstr("stemvo run drive/sequences/00 --out result"));
  const std::size_t begin = std::min(help.find("\nSubcommands:"), help.size());
  const std::string list = help.substr(begin, help.find("\n\n", begin) - begin);
  std::set<std::string> names;
  const std::regex line("\n  ([a-z]+) ");
  for (std::sregex_iterator at(list.begin(), list.end(), line), end; at != end; ++at) {
    names.insert((*at)[1]);
  }
  return names;
}

class JsonOutput : public ::testing::Test {
 protected:
  /// The document, which is all of standard output.
  static Json document(Words arguments, int exit_code = 0) {
    const ProgramResult result = run_stemvo(arguments);
    EXPECT_EQ(result.exit_code, exit_code) << arguments.front() << ": " << result.err;
    Json json = Json::parse(result.out, nullptr, /*allow_exceptions=*/false);
    EXPECT_TRUE(json.is_object()) << arguments.front() << ": " << result.out;
    return json;
  }

  TempFolder folder_;
  fs::path drive_ = rendered_drive({.frames = 30, .width_px = 310, .height_px = 94});
  std::string sequence_ = drive_ / "sequences/00";
};

// The arguments of each command, and a key that its document must have. A command that the help
// lists and this table does not is a failure.
TEST_F(JsonOutput, IsOneDocumentOfEveryCommand) {
  const std::string run = folder_ / "run";
  const std::string bounds = folder_ / "bounds.yaml";
  write_file(bounds, "tracked_fraction: {min: 0.1}\n");
  const std::string truth = drive_ / "poses/00.txt";
  struct Call {
    std::string command;
    Words arguments;
    std::string key;
    int exit_code = 0;
  };
  const std::vector<Call> calls = {
      {"run", {sequence_, "--out", run, "--timing", "--json"}, "out_dir"},
      {"evaluate", {"--gt", truth, run + "/trajectory_kitti.txt", "--json"}, "estimates"},
      {"check", {run + "/metrics.json", "--against", bounds, "--json"}, "passed"},
      {"channel", {sequence_, "--out", folder_ / "images", "--json"}, "images"},
      {"synth",
       {folder_ / "d", "--frames", "2", "--width", "64", "--height", "48", "--json"},
       "sequence"},
      // The drive does not tell of the camera: a result, and a failure.
      {"calibrate", {sequence_, "--out", folder_ / "calib.txt", "--json"}, "parameters", 1},
      {"models", {"--json"}, "models"},
  };
  std::set<std::string> called;
  for (const Call& call : calls) {
    const Words arguments = joined({call.command}, call.arguments);
    EXPECT_TRUE(document(arguments, call.exit_code).contains(call.key)) << call.command;
    called.insert(call.command);
  }
  EXPECT_EQ(called, commands());
}

// --quiet asks for less to read, not for no result.
TEST_F(JsonOutput, HoldsWhatTheFileHolds) {
  const std::string out = folder_ / "out";
  Json json = document({"run", sequence_, "--out", out, "--quiet", "--json"});
  EXPECT_EQ(json["out_dir"], out);
  EXPECT_EQ(json["interrupted"], false);
  json.erase("out_dir");
  json.erase("interrupted");
  EXPECT_EQ(json, metrics_of(out));
}

TEST_F(JsonOutput, BoundThatIsPassedIsInTheDocument) {
  write_file(folder_ / "metrics.json", R"({"t_rel_percent": 2.5, "r_rel_deg_per_100m": null})");
  write_file(folder_ / "bounds.yaml",
             "t_rel_percent: {max: 1, min: 0}\nr_rel_deg_per_100m: {max: 1}\n");
  const Json json = document(
      {"check", folder_ / "metrics.json", "--against", folder_ / "bounds.yaml", "--json"}, 1);
  EXPECT_EQ(json, Json::parse(R"({"passed": false, "bounds": [
    {"key": "t_rel_percent", "value": 2.5, "max": 1.0, "passed": false},
    {"key": "t_rel_percent", "value": 2.5, "min": 0.0, "passed": true},
    {"key": "r_rel_deg_per_100m", "value": null, "max": 1.0, "passed": false}]})"));
}

TEST_F(JsonOutput, SaysWhyAModelCannotBeUsed) {
  const std::string good = read_file(tiny_model("plain_k4s4"));
  write_file(folder_ / "default.onnx", with_metadata(good, "stride", "2"));
  const Json json = document({"models", folder_ / "default.onnx", "--json"}, 1);
  EXPECT_EQ(json["models"][0]["sound"], false);
  EXPECT_THAT(json["models"][0]["problem"].get<std::string>(), HasSubstr("default.onnx"));
  EXPECT_EQ(document({"models", "default", "--json"})["models"][0]["problem"], Json());
}

TEST_F(JsonOutput, IsNothingAfterAnError) {
  expect_error(run_stemvo({"run", folder_ / "none", "--out", folder_ / "o", "--json"}), 1,
               {"none"});
  expect_error(run_stemvo({"models", "none.onnx", "--json"}), 1, {"none.onnx"});
}

}  // namespace
}  // namespace stemvo
