// SPDX-License-Identifier: MIT
// Files as large as each reader takes, of what costs the most: read or refused in seconds.
#include <algorithm>
#include <chrono>
#include <csignal>
#include <fstream>
#include <functional>
#include <sstream>
#include <string>
#include <thread>
#include <vector>

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <nlohmann/json.hpp>

#include "search/records.hpp"
#include "stem/model_file.hpp"
#include "support/program_test.hpp"
#include "text/text_file.hpp"

namespace stemvo {
namespace {

using Words = std::vector<std::string>;
using Json = nlohmann::ordered_json;

/// Of a size, made when it is written: what this process holds counts as the program's.
using Text = std::function<std::string(std::size_t)>;

/// Again and again, behind a head.
Text again(const std::string& head, const std::string& piece) {
  return [=](std::size_t size) {
    std::string text = head;
    text.reserve(size + piece.size());
    while (text.size() < size) {
      text += piece;
    }
    text.resize(size);
    return text;
  };
}

/// What `piece` makes of 0, 1, ..
Text numbered(const std::string& head, const std::function<std::string(std::size_t)>& piece) {
  return [=](std::size_t size) {
    std::string text = head;
    for (std::size_t i = 0; text.size() < size; ++i) {
      text += piece(i);
    }
    text.resize(size);
    return text;
  };
}

struct Content {
  std::string name;
  Text text;
};

class LargeFiles : public ::testing::Test {
 protected:
  [[nodiscard]] Words run(const std::string& sequence, const Words& more = {}) const {
    Words words = {"run", sequence, "--out", folder_ / "out", "--quiet", "--frames", "0:1"};
    words.insert(words.end(), more.begin(), more.end());
    return words;
  }
  /// The program takes less than 5 s of the processor and 500 MB, and does not crash; an error is
  /// one line, not a long one, that names the file.
  static void expect_bounded(const fs::path& file,
                             int size_MB,
                             const Content& content,
                             const Words& arguments) {
    write_file(file, content.text(static_cast<std::size_t>(size_MB) * 1000000));
    expect_bounded(file, content.name, arguments);
  }
  static void expect_bounded(const fs::path& file,
                             const std::string& name,
                             const Words& arguments) {
    const ProgramResult result = run_stemvo(arguments);
    const std::string what =
        fmt::format("{}, {}: {}", file.filename().string(), name, result.err.substr(0, 1000));
    EXPECT_LT(result.cpu_s, 5.0) << what;
    EXPECT_LT(result.peak_mib, 477.0) << what;
    EXPECT_LE(result.exit_code, 1) << what;
    EXPECT_LT(result.err.size(), 700U) << what;
    EXPECT_THAT(result.err, Not(HasSubstr("internal"))) << what;
    if (result.exit_code == 1) {
      EXPECT_THAT(what, AllOf(HasSubstr(": error: "),
                              HasSubstr(fmt::format("/{}", file.filename().string()))));
      EXPECT_EQ(std::ranges::count(result.err, '\n'), 1) << what;
    }
  }

  TempFolder folder_;
  fs::path sequence_ = test::copy_drive(folder_.path(), 3);
};

TEST_F(LargeFiles, Yaml) {
  write_file(folder_ / "metrics.json", "{}");
  write_file(folder_ / "some.onnx", "");
  for (const Content& content : {
           Content{"keys", numbered("", [](auto i) { return fmt::format("k{}: 1\n", i); })},
           {"as many keys as there may be",
            numbered("", [](auto i) { return fmt::format("k{}: {:{}}\n", i, 1, 193); })},
           {"a list", again("a: [", "1,")},
           {"lists in lists", again("", "[")},
           {"maps in maps", again("", "{a: ")},
           {"rows in rows", again("", "- ")},
           {"indented", numbered("", [](auto i) { return std::string(i, ' ') + "a:\n"; })},
           {"a word", again("", "x")},
           {"a text", again("a: ", "x\n  ")},
           {"aliases", again("a: &a 1\nb: [", "*a,")},
           {"documents", again("", "---\n")},
           {"tags", again("", "! ")},
           {"empty lines", again("", "\n")},
       }) {
    for (const auto& [name, arguments] :
         {std::pair("config.yaml", run(sequence_, {"--config", folder_ / "config.yaml"})),
          std::pair("camera.yaml",
                    run(sequence_ / "image_2", {"--camera", folder_ / "camera.yaml"})),
          std::pair("limits.yaml",
                    Words{"check", folder_ / "metrics.json", "--against", folder_ / "limits.yaml"}),
          std::pair("manifest.yaml", Words{"models", folder_ / "some.onnx"})}) {
      expect_bounded(folder_ / name, kMaxSettings_MB, content, arguments);
    }
  }
}

TEST_F(LargeFiles, Json) {
  const fs::path metrics = folder_ / "metrics.json";
  write_file(folder_ / "limits.yaml", "frames: {min: 1}\n");
  std::string object = "{\"k\":1";  // with as many keys as there may be
  for (int i = 1; i < 1000; ++i) {
    object += fmt::format(",\"{}\":1", i);
  }
  for (const Content& content : {
           Content{"keys", numbered("{", [](auto i) { return fmt::format("\"k{}\":1,", i); })},
           {"large objects", again("{\"a\":[", object + "},")},
           {"one key", again("{", "\"a\":1,")},
           {"a list", again("{\"a\":[", "1,")},
           {"objects", again("{\"a\":[", "{},")},
           {"lists in lists", again("", "[")},
           {"objects in objects", again("", "{\"a\":")},
           {"a text", again("{\"", "x")},
           {"empty lines", again("", "\n")},
       }) {
    expect_bounded(metrics, kMaxSettings_MB, content,
                   {"check", metrics, "--against", folder_ / "limits.yaml"});
  }
}

/// Of holes, which take no room on a disk.
TEST_F(LargeFiles, BeyondWhatIsRead) {
  const fs::path poses = folder_ / "poses.txt";
  const fs::path settings = folder_ / "config.yaml";
  const fs::path metrics = folder_ / "metrics.json";
  write_file(settings, "frames: {min: 1}\n");
  for (const auto& [file, arguments] :
       {std::pair(poses, Words{"evaluate", "--gt", poses, poses}),
        std::pair(metrics, Words{"check", metrics, "--against", settings}),
        std::pair(settings, run(sequence_, {"--config", settings})),
        std::pair(sequence_ / "times.txt", run(sequence_)),
        std::pair(sequence_ / "calib.txt", run(sequence_))}) {
    std::ofstream(file, std::ios::app).flush();
    fs::resize_file(file, 1000000000);
    expect_bounded(file, "holes", arguments);
  }
}

/// `row`: of a number; as many as there may be, as long as then fits.
std::vector<Content> rows(const std::function<std::string(std::size_t)>& row) {
  constexpr std::size_t kLength = std::size_t{kMaxRows_MB} * 1000000 / kMaxLines;
  return {
      {"rows", numbered("", [=](auto i) { return fmt::format("{:{}}\n", row(i), kLength - 1); })},
      {"empty lines", again("", "\n")},
      {"a row", again("", "1 ")},
      {"long rows", again("", again("", "1,")(kMaxLineBytes) + "\n")}};
}

TEST_F(LargeFiles, Poses) {
  const fs::path poses = folder_ / "poses.txt";
  write_file(folder_ / "truth.txt", "1 0 0 0 0 1 0 0 0 0 1 0\n1 0 0 0 0 1 0 0 0 0 1 1\n");
  const auto kitti = [](std::size_t i) { return fmt::format("1 0 0 {} 0 1 0 0 0 0 1 0", i); };
  const auto tum = [](std::size_t i) { return fmt::format("{} 0 0 0 0 0 0 1", i); };
  const auto euroc = [](std::size_t i) { return fmt::format("{}0,0,0,0,1,0,0,0", i); };
  std::vector<Content> contents = rows(kitti);
  contents.push_back({"TUM's", rows(tum)[0].text});
  contents.push_back({"EuRoC's", rows(euroc)[0].text});
  for (const Content& content : contents) {
    expect_bounded(poses, kMaxRows_MB, content, {"evaluate", "--gt", folder_ / "truth.txt", poses});
  }
  expect_bounded(poses, kMaxRows_MB, contents[0],
                 {"evaluate", "--gt", poses, poses, "--align", "sim3"});
}

TEST_F(LargeFiles, TimesAndLists) {
  const std::string camera =
      "image_width: 620\nimage_height: 188\nintrinsics: [360.5, 360, 310, 94]\n"
      "distortion_model: none\nrate_hz: 10\n";
  fs::create_directories(folder_ / "tum");
  write_file(folder_ / "tum/camera.yaml", camera);
  fs::create_directories(folder_ / "euroc/mav0/cam0");
  write_file(folder_ / "euroc/mav0/cam0/sensor.yaml", camera);
  for (const Content& content : rows([](std::size_t i) { return std::to_string(i); })) {
    expect_bounded(sequence_ / "times.txt", kMaxRows_MB, content, run(sequence_));
  }
  for (const Content& content : rows([](std::size_t i) { return fmt::format("{0} {0}.png", i); })) {
    expect_bounded(folder_ / "tum/rgb.txt", kMaxRows_MB, content, run(folder_ / "tum"));
    expect_bounded(folder_ / "euroc/mav0/cam0/data.csv", kMaxRows_MB, content,
                   run(folder_ / "euroc"));
  }
}

/// What a search wrote, of more filters than it has.
class LargeRecords : public LargeFiles {
 protected:
  void SetUp() override {
    const fs::path drive = test::rendered_drive({.frames = 30, .width_px = 310, .height_px = 94});
    const ProgramResult searched = run_stemvo(
        {"search", drive / "sequences/00", "--out", part_, "--exhaustive", "--filters", "0:1",
         "--no-baselines", "--quiet", "--set", "evaluation.segment_lengths_m=[2]"});
    ASSERT_EQ(searched.exit_code, 0) << searched.err;
    std::istringstream lines(read_file(part_ / search::kRecordsFile));
    std::string line;
    std::getline(lines, line);
    identity_ = Json::parse(line)["of"];
    identity_["layers"][0]["last"] = 1000000;
    std::getline(lines, line);
    record_ = Json::parse(line)["of"];
  }
  [[nodiscard]] static std::string sealed(const std::string& text, const internal::Sha256& seal) {
    return fmt::format("{{\"sha256\":\"{}\",\"of\":{}}}\n", seal.hex(text), text);
  }
  [[nodiscard]] internal::Sha256 seal() const { return internal::Sha256(identity_.dump()); }
  /// The first line.
  [[nodiscard]] std::string head() const { return sealed(identity_.dump(), internal::Sha256({})); }
  void expect_merged(const std::string& name, const Text& text) const {
    expect_bounded(part_ / search::kRecordsFile, kSize_MB, {name, text},
                   {"search", "--merge", part_, "--out", folder_ / "merged"});
  }
  /// The record as those of all filters.
  void expect_merged(const std::string& name) {
    expect_merged(name, numbered(head(), [this, seal = seal()](std::size_t i) {
                    record_["filter"] = i;
                    return sealed(record_.dump(), seal);
                  }));
  }

  static constexpr int kSize_MB = search::kMaxRecords_MB / 4;  // time and memory grow with it
  fs::path part_ = folder_ / "part";
  Json identity_;
  Json record_;
};

TEST_F(LargeRecords, ManyFilters) {
  Json& layers = identity_["layers"];
  for (int i = 1; i < 300; ++i) {  // the last is the one that is looked for
    Json layer = layers.back();
    layer["layer"] = fmt::format("{:04}", i);
    layers.insert(layers.begin(), layer);
  }
  for (auto& [key, value] : record_["drives"][0].items()) {
    value = value.is_number_float() ? Json() : value.is_array() ? Json::array() : value;
  }
  record_["drives"][0].update({{"frames", 0}, {"detected", false}, {"reason", "x"}});
  record_["filter_frames"] = 0;
  expect_merged("filters");
}

TEST_F(LargeRecords, LongPaths) {
  Json path;
  for (int i = 0; i < 1000; ++i) {
    path.push_back({123.4567890123 + i, 987.65432109876 - i});
  }
  record_["drives"][0]["path_xz_m"] = path;
  expect_merged("paths");
}

TEST_F(LargeRecords, AnInterruptIsHeard) {
  write_file(part_ / search::kRecordsFile, numbered(head(), [this, seal = seal()](std::size_t i) {
               record_["filter"] = i;
               return sealed(record_.dump(), seal);
             })(kSize_MB * 1000000U));
  test::RunningProgram program(STEMVO_PROGRAM,
                               {"search", "--merge", part_, "--out", folder_ / "merged"});
  std::this_thread::sleep_for(std::chrono::milliseconds(500));
  program.send(SIGTERM);
  const ProgramResult result = program.wait();
  EXPECT_EQ(result.exit_code, 130) << result.err;
  EXPECT_THAT(result.err, HasSubstr("records.jsonl: interrupted while it was read"));
}

TEST_F(LargeRecords, WhatIsNone) {
  constexpr std::size_t kInside = search::kMaxRecordBytes - 200;
  const auto inside = [&](const std::string& text) { return again(head(), sealed(text, seal())); };
  expect_merged("empty lines", again(head(), "\n"));
  expect_merged("a line", again(head(), "x"));
  expect_merged("wrong seals", again(head(), sealed(std::string(300, ' '), internal::Sha256({}))));
  expect_merged("lists", inside(again("[", "[],")(kInside - kInside % 3) + "[]]"));
  expect_merged("lists in lists", inside(std::string(kInside, '[')));
  expect_merged("a text", inside(fmt::format("\"{}\"", std::string(kInside, 'x'))));
}

}  // namespace
}  // namespace stemvo
