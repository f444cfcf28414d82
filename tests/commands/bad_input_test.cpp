// SPDX-License-Identifier: MIT
#include <filesystem>
#include <fstream>
#include <functional>
#include <sstream>
#include <string>
#include <vector>

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <opencv2/imgcodecs.hpp>

#include "support/program_test.hpp"

namespace stemvo {
namespace {

/// Line `number` (from 1) of a file replaced.
void replace_line(const fs::path& file, int number, const std::string& text) {
  std::istringstream in(read_file(file));
  std::string result;
  std::string line;
  for (int i = 1; std::getline(in, line); ++i) {
    result += (i == number ? text : line) + "\n";
  }
  write_file(file, result);
}

/// A copy of ten rendered frames that each test breaks in its own way.
class BadInput : public ::testing::Test {
 protected:
  ProgramResult run(std::vector<std::string> more = {}) const {
    more.insert(more.begin(), {"run", sequence_.string(), "--out", out_});
    return run_stemvo(more);
  }
  /// The configuration as a file, line 1 first.
  ProgramResult run_with_config(const std::string& text) const {
    write_file(folder_ / "my.yaml", text);
    return run({"--config", folder_ / "my.yaml"});
  }

  test::TempFolder folder_;
  fs::path sequence_ = test::copy_drive(folder_.path(), 10);
  std::string out_ = folder_ / "out";
};

TEST_F(BadInput, WhatIsBrokenRunsUnbroken) { EXPECT_EQ(run().exit_code, 0); }

TEST_F(BadInput, MissingSequence) {
  const std::string none = folder_ / "none";
  expect_error(run_stemvo({"run", none, "--out", out_}), 1,
               {none, "expected", "found nothing of that name"});
  EXPECT_FALSE(fs::exists(out_));
}

/// yaml-cpp's LoadAll never ends here.
TEST_F(BadInput, MoreBehindTheDocument) {
  for (const char* text : {"seed: 1\n---\nseed: 2\n", "seed: 1\n...\nseed: 2\n",
                           "{seed: 1}\nstem: {filter: 3}\n", "{stem: {filter: 3}},\n"}) {
    expect_error(run_with_config(text), 1, {"my.yaml:", "not YAML", "more behind it"});
  }
}

TEST_F(BadInput, WhatIsNoModelIsNamed) {
  for (const std::string& path : {std::string("/dev/zero"), (folder_ / "none.h5").string()}) {
    const std::string found = "path of an .onnx, found '" + path;
    expect_error(run({"--set", "stem.model=" + path}), 1, {"stem.model: expected default", found});
    expect_error(run_stemvo({"models", path}), 1, {"stem.model: expected default", found});
  }
}

TEST_F(BadInput, NoImages) {
  fs::remove_all(sequence_ / "image_2");
  expect_error(run(), 1, {sequence_.string(), "image_2"});
  fs::create_directories(sequence_ / "image_2");
  expect_error(run(), 1, {"image_2", "000000.png", "found none"});
}

TEST_F(BadInput, EveryImageBroken) {
  for (const auto& entry : fs::directory_iterator(sequence_ / "image_2")) {
    fs::resize_file(entry.path(), 50);
  }
  expect_error(run(), 1, {"000000.png"});
}

/// Decoders print lines of their own, which name no file.
TEST_F(BadInput, BrokenImagesAreOneWarningEach) {
  const fs::path images = sequence_ / "image_2";
  for (const char* name : {"000003.png", "000004.png", "000005.png", "000006.png"}) {
    std::string bytes = read_file(images / name);
    bytes.replace(bytes.size() / 2, 4, "xxxx");
    write_file(images / name, bytes);
  }
  std::string twice = read_file(images / "000008.png");
  write_file(images / "000008.png", twice.insert(33, twice.substr(8, 25)));  // two headers
  const ProgramResult result = run({"--quiet", "--set", "scale.source=none"});
  EXPECT_EQ(result.exit_code, 0);
  EXPECT_EQ(std::count(result.err.begin(), result.err.end(), '\n'), 5) << result.err;
  EXPECT_THAT(result.err,
              AllOf(HasSubstr("warning: " + images.string() + "/000003.png"),
                    HasSubstr("000008.png: expected a sound PNG image, found one damaged"),
                    Not(HasSubstr("libpng"))));
}

TEST_F(BadInput, BrokenJpegsAreOneWarningEach) {
  const fs::path images = folder_ / "jpeg";
  fs::create_directories(images);
  for (int i = 0; i < 10; ++i) {
    const std::string number = fmt::format("{:06}", i);
    cv::imwrite(images / (number + ".jpg"), cv::imread(sequence_ / "image_2" / (number + ".png")));
  }
  std::string bytes = read_file(images / "000004.jpg");
  write_file(images / "000004.jpg", bytes.erase(bytes.size() / 2, 400));
  bytes = read_file(images / "000006.jpg");
  const std::size_t frame_header = bytes.find("\xff\xc0");
  bytes[frame_header + 4] = 77;  // bits of a sample
  write_file(images / "000006.jpg", bytes);
  write_file(folder_ / "camera.yaml",
             "image_width: 620\nimage_height: 188\nintrinsics: [360, 360, 310, 94]\n"
             "distortion_model: none\nrate_hz: 10\n");
  const ProgramResult result = run_stemvo(
      {"run", images.string(), "--camera", folder_ / "camera.yaml", "--out", out_, "--quiet"});
  EXPECT_EQ(result.exit_code, 0);
  EXPECT_THAT(result.err, AllOf(StartsWith("warning: "), HasSubstr("000006.jpg")));
  EXPECT_LE(std::count(result.err.begin(), result.err.end(), '\n'), 2) << result.err;
}

TEST_F(BadInput, CameraThatIsNotThere) {
  expect_error(run({"--set", "input.camera=image_0"}), 1, {"image_0"});
  expect_error(run({"--set", "input.camera=left"}), 1, {"input.camera", "image_0", "'left'"});
}

TEST_F(BadInput, Poses) {
  const fs::path poses = folder_.path() / "poses/00.txt";
  replace_line(poses, 4, "1 0 0 0 0 1 0 0 0 0 1");
  expect_error(run(), 1, {"00.txt:4:", "12", "11"});
  replace_line(poses, 4, "1 0 0 x 0 1 0 0 0 0 1 0");
  expect_error(run(), 1, {"00.txt:4:", "x"});
  write_file(poses, "1 0 0 0 0 1 0 0 0 0 1 0\n1 0 0 0 0 1 0 0 0 0 1 1\n");
  expect_error(run(), 1, {"00.txt", "each of 10 frames", "found 2"});
  expect_error(run({"--gt", folder_ / "none.txt"}), 1, {"none.txt"});
  fs::remove(poses);
  expect_error(run({"--set", "scale.source=ground_truth"}), 1,
               {"poses/00.txt", "scale.source=ground_truth", "found none"});
  EXPECT_FALSE(fs::exists(out_ + "/trajectory_kitti.txt"));
}

/// Poses that cannot be read are not poses that are not there.
TEST_F(BadInput, PosesBehindALinkToNowhere) {
  const fs::path poses = folder_.path() / "poses/00.txt";
  fs::remove(poses);
  fs::create_symlink("00.txt", poses);
  expect_error(run(), 1, {"poses/00.txt", "symbolic links"});
}

TEST_F(BadInput, OutputFolderThatCannotBeWritten) {
  write_file(folder_ / "file", "");
  out_ = folder_ / "file";
  expect_error(run(), 1, {out_, "expected an output folder that can be written"});
}

TEST_F(BadInput, Model) {
  expect_error(run({"--set", "stem.model=resnet"}), 1, {"resnet", "default"});
  expect_error(run({"--set", "stem.model=" + (folder_ / "no.onnx").string()}), 1, {"no.onnx"});
  expect_error(run({"--set", "stem.filter=500"}), 1, {"stem.filter", "500"});
  expect_error(run({"--set", "stem.sampling_px=3"}), 1, {"stem.sampling_px", "3", "1, 2"});
  write_file(folder_ / "text.onnx", "this is not a model\n");
  expect_error(run({"--set", "stem.model=" + (folder_ / "text.onnx").string()}), 1, {"text.onnx"});
}

TEST_F(BadInput, Configuration) {
  expect_error(run_with_config("stem:\n  filtre: 3\n"), 1,
               {"my.yaml:2: stem.filtre: unknown key; known keys of stem: model, filter"});
  expect_error(run_with_config("stem:\n  filter: 3\n  filter: 4\n"), 1,
               {"my.yaml:3: stem.filter: duplicated key", "line 2"});
  expect_error(run_with_config("stem:\n  filter: three\n"), 1,
               {"my.yaml:2: stem.filter: expected a whole number, found 'three'"});
  expect_error(run_with_config("stem: [\n"), 1, {"my.yaml:2: not YAML"});
  expect_error(run({"--config", folder_ / "none.yaml"}), 1, {"none.yaml"});
  expect_error(run({"--config", "nope"}), 1, {"nope: expected", "default, fast, paper", "neither"});
  expect_error(run({"--config", folder_.path().string()}), 1, {"found a folder"});
  expect_error(run({"--set", "stem.filter=3", "--set", "seed=2", "--set", "stem.filter=4"}), 1,
               {"--set stem.filter: expected once", "'stem.filter=3'", "'stem.filter=4'"});
  expect_error(run({"--set", "stem.filtre=3"}), 1, {"--set stem.filtre: unknown key"});
  expect_error(run({"--set", "scale.source=gps"}), 1,
               {"auto, none, constant_speed, camera_height, ground_truth, found 'gps'"});
  expect_error(run({"--set", "scale.step_m=nan"}), 1, {"scale.step_m", "nan"});
  expect_error(run({"--save-map", folder_ / "place.map", "--set", "odometry.mode=two_frame",
                    "--set", "scale.source=constant_speed"}),
               1, {"--save-map", "odometry.mode map", "found mode two_frame"});
  expect_error(run({"--map", folder_ / "poses/00.txt"}), 1,
               {"00.txt: expected a map of stemvo, found another kind of file"});
}

TEST_F(BadInput, Evaluate) {
  const std::string poses = folder_ / "poses/00.txt";
  const std::string bad = folder_ / "bad.txt";
  const auto evaluate = [&](const std::string& truth, const std::string& estimate) {
    return run_stemvo({"evaluate", "--gt", truth, estimate});
  };
  EXPECT_EQ(evaluate(poses, poses).exit_code, 0);
  expect_error(evaluate(poses, bad), 1, {"bad.txt"});
  write_file(bad, "1 0 0 0 0 1 0 0 0 0 1 0\n");
  expect_error(evaluate(poses, bad), 1, {"bad.txt", "1"});
  write_file(bad, "1 2 3\n");
  expect_error(evaluate(poses, bad), 1, {"bad.txt:1:"});
  expect_error(evaluate(folder_ / "none.txt", poses), 1, {"none.txt"});
}

TEST_F(BadInput, Channel) {
  const auto channel = [&](std::vector<std::string> more) {
    more.insert(more.begin(), {"channel", sequence_.string(), "--out", out_});
    return run_stemvo(more);
  };
  expect_error(channel({"--filters", "0:500"}), 1, {"default", "--filters 0:500"});
  expect_error(channel({"--frames", "3:99"}), 1, {"0:10"});
  const ProgramResult good = channel({"--frames", "2:4", "--filters", "1:3"});
  EXPECT_EQ(good.exit_code, 0) << good.err;
  for (const char* name :
       {"000002_input", "000003_filter_001", "000003_filter_002", "000002_sheet"}) {
    EXPECT_TRUE(fs::exists(out_ + "/" + name + ".png")) << name;
  }
  EXPECT_FALSE(fs::exists(out_ + "/000003_filter_003.png"));
}

TEST_F(BadInput, Synth) {
  write_file(folder_ / "file", "");
  expect_error(run_stemvo({"synth", folder_ / "file", "--frames", "2"}), 1, {"file"});
  expect_error(run_stemvo({"synth", folder_ / "o", "--trajectory", folder_ / "none.txt"}), 1,
               {"none.txt"});
}

TEST_F(BadInput, Check) {
  const std::string metrics = folder_ / "metrics.json";
  const std::string limits = folder_ / "limits.yaml";
  const auto check = [&] { return run_stemvo({"check", metrics, "--against", limits}); };
  write_file(metrics, R"({"t_rel_percent": 0.9, "segments": null})");
  write_file(limits, "t_rel_percent: {max: 1.0}\n");
  EXPECT_EQ(check().exit_code, 0);
  write_file(limits, "t_rel_percent: {max: 0.8}\n");
  const ProgramResult passed = check();
  EXPECT_EQ(passed.exit_code, 1);
  EXPECT_THAT(passed.out, HasSubstr("t_rel_percent"));
  EXPECT_THAT(passed.err, IsEmpty());
  write_file(limits, "segments: {min: 1}\n");
  EXPECT_EQ(check().exit_code, 1) << "a number that is null holds no bound";
  write_file(limits, "t_rel: {max: 0.8}\n");
  expect_error(check(), 1, {"limits.yaml:1", "t_rel"});
  write_file(metrics, "{");
  expect_error(check(), 1, {"metrics.json"});
  fs::remove(metrics);
  expect_error(check(), 1, {"metrics.json"});
}

}  // namespace
}  // namespace stemvo
