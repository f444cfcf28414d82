// SPDX-License-Identifier: MIT
#include <string>
#include <vector>

#include <gmock/gmock.h>

#include "support/program_test.hpp"

namespace stemvo {
namespace {

/// A copy of ten rendered frames, which no command may write over.
class Overwrite : public ::testing::Test {
 protected:
  [[nodiscard]] ProgramResult run(std::vector<std::string> more) const {
    more.insert(more.begin(), {"run", sequence_.string(), "--quiet"});
    return run_stemvo(more);
  }
  [[nodiscard]] std::string copy_of_poses(const std::string& name) const {
    fs::create_directories((folder_ / name).parent_path());
    fs::copy_file(folder_ / "poses/00.txt", folder_ / name);
    return folder_ / name;
  }

  TempFolder folder_;
  fs::path sequence_ = test::copy_drive(folder_.path(), 10);
  std::string out_ = folder_ / "out";
};

TEST_F(Overwrite, SynthSparesWhatItDidNotRender) {
  const std::string image = read_file(sequence_ / "image_2/000003.png");
  const std::string poses = read_file(folder_ / "poses/00.txt");
  expect_error(run_stemvo({"synth", folder_.path().string(), "--frames", "2"}), 1,
               {"sequences/00", "expected a drive that stemvo rendered"});
  EXPECT_EQ(read_file(sequence_ / "image_2/000003.png"), image);
  EXPECT_EQ(read_file(folder_ / "poses/00.txt"), poses);
}

TEST_F(Overwrite, CalibrateSparesWhatItReads) {
  write_file(folder_ / "my.yaml", "seed: 1\n");
  fs::create_symlink(sequence_ / "times.txt", folder_ / "link.txt");
  for (const fs::path& file :
       {sequence_ / "calib.txt", sequence_ / "times.txt", folder_ / "link.txt", folder_ / "my.yaml",
        sequence_ / "image_2/000003.png", folder_ / "poses/00.txt"}) {
    const std::string before = read_file(file);
    expect_error(run_stemvo({"calibrate", sequence_.string(), "--config", folder_ / "my.yaml",
                             "--out", file.string()}),
                 1, {file.string(), "expected a file to write that is no input"});
    EXPECT_EQ(read_file(file), before);
  }
}

TEST_F(Overwrite, ResultsOfARunSpareWhatItReads) {
  const std::string truth = copy_of_poses("out/trajectory_kitti.txt");
  const std::string poses = read_file(truth);
  expect_error(run({"--out", out_, "--gt", truth}), 1, {truth, "no input"});
  EXPECT_EQ(read_file(truth), poses);
  write_file(out_ + "/config.yaml", "# mine\nseed: 3\n");
  expect_error(run({"--out", out_, "--config", out_ + "/config.yaml"}), 1,
               {"config.yaml", "no input"});
  fs::remove(out_ + "/config.yaml");
  EXPECT_EQ(run({"--out", out_}).exit_code, 0);
  EXPECT_EQ(run({"--out", out_, "--config", out_ + "/config.yaml"}).exit_code, 0)
      << "a run is repeated with its own configuration";
}

/// Each output of each command, where it is a link to each kind of input.
TEST_F(Overwrite, NoResultIsAnInput) {
  write_file(folder_ / "my.yaml", "stem: {model: gray}\n");
  const std::string config = folder_ / "my.yaml";
  const std::string truth = folder_ / "poses/00.txt";
  const fs::path frame = sequence_ / "image_2/000003.png";
  struct Row {
    std::vector<std::string> command;
    std::vector<std::string> names;
    std::vector<fs::path> inputs;
  };
  const std::vector<fs::path> all = {config, frame, sequence_ / "calib.txt",
                                     sequence_ / "times.txt", truth};
  const std::vector<Row> rows = {
      {{"run", sequence_, "--config", config, "--gt", truth},
       {"metrics.json", "trajectory_kitti.txt", "trajectory_tum.txt", "report.html",
        "trajectory.png", "frames.csv", "config.yaml", "map.ply", "trajectory_refined_kitti.txt",
        "trajectory_refined_tum.txt", "metrics.json.unfinished"},
       all},
      {{"search", sequence_, "--config", config, "--model", "gray", "--resume"},
       {"records.jsonl", "filters.csv", "filters.json", "config.yaml", "best.yaml", "report.html",
        "sheet.png"},
       all},
      {{"robustness", sequence_, "--config", config},
       {"robustness.csv", "robustness.json", "robustness.txt", "report.html"},
       all},
      {{"benchmark", folder_.path()},
       {"benchmark.md", "benchmark.json", "speed.json", "report.html"},
       {frame, sequence_ / "calib.txt", sequence_ / "times.txt", truth}},
      {{"channel", sequence_, "--config", config},
       {"000000_input.png"},
       {sequence_ / "image_2/000000.png", config}}};
  const auto expect_spared = [&](const Row& row, const std::string& name, const fs::path& input) {
    const std::string bytes = read_file(input);
    const fs::path output = fs::path(out_) / name;
    fs::create_directories(out_);
    fs::create_symlink(input, output);
    std::vector<std::string> words = row.command;
    words.insert(words.end(), {"--out", out_});
    expect_error(run_stemvo(words), 1, {output, "no input, found " + input.string()});
    EXPECT_TRUE(read_file(input) == bytes) << name;
    fs::remove_all(out_);
  };
  for (const Row& row : rows) {
    for (const std::string& name : row.names) {
      expect_spared(row, name, row.inputs.front());
    }
    for (const fs::path& input : row.inputs) {
      expect_spared(row, row.names.front(), input);
    }
  }
}

TEST_F(Overwrite, ASearchSparesItsConfiguration) {
  const std::string config = out_ + "/config.yaml";
  fs::create_directories(out_);
  write_file(config, "# mine\nseed: 3\n");
  expect_error(run_stemvo({"search", sequence_, "--config", config, "--out", out_}), 1,
               {config, "no input"});
  EXPECT_EQ(read_file(config), "# mine\nseed: 3\n");
}

TEST_F(Overwrite, ChannelsAreNotWrittenAmongTheFrames) {
  const std::string folder = sequence_ / "image_2";
  expect_error(run_stemvo({"channel", sequence_, "--set", "stem.model=gray", "--out", folder}), 1,
               {folder, "no input"});
  EXPECT_FALSE(fs::exists(folder + "/000000_input.png"));
}

TEST_F(Overwrite, ResultsAreNotWrittenAmongTheFrames) {
  const std::string folder = sequence_ / "image_2";
  expect_error(run({"--out", folder}), 1, {folder, "without the recording's images, found 0000"});
  EXPECT_FALSE(fs::exists(folder + "/trajectory.png"));
}

TEST_F(Overwrite, PicturesRemoveTheirOwnOnly) {
  fs::create_directories(out_);
  fs::copy(sequence_ / "image_2", folder_ / "mine");
  write_file(out_ + "/frames.csv", "");
  fs::create_directory_symlink(folder_ / "mine", out_ + "/pictures");
  expect_error(run({"--out", out_, "--pictures", "1"}), 1, {"pictures", "found a link"});
  EXPECT_TRUE(fs::exists(folder_ / "mine/000007.png"));
  fs::remove(out_ + "/pictures");
  fs::remove(out_ + "/frames.csv");
  fs::copy(sequence_ / "image_2", out_ + "/pictures");
  expect_error(run({"--out", out_, "--pictures", "1"}), 1, {"pictures", "earlier run"});
  EXPECT_EQ(read_file(out_ + "/pictures/000007.png"), read_file(sequence_ / "image_2/000007.png"));
  fs::remove_all(out_ + "/pictures");
  EXPECT_EQ(run({"--out", out_, "--pictures", "1"}).exit_code, 0);
  EXPECT_EQ(run({"--out", out_, "--pictures", "5"}).exit_code, 0);
  EXPECT_TRUE(fs::exists(out_ + "/pictures/000005.png"));
  EXPECT_FALSE(fs::exists(out_ + "/pictures/000004.png"));
}

TEST_F(Overwrite, PicturesInTheFolderOfTheFrames) {
  const fs::path drive = folder_ / "drive";
  fs::create_directories(drive);
  fs::copy(sequence_ / "image_2", drive / "pictures");
  write_file(drive / "frames.csv", "");
  write_file(folder_ / "camera.yaml",
             "image_width: 620\nimage_height: 188\nintrinsics: [360, 360, 310, 94]\n"
             "distortion_model: none\nrate_hz: 10\n");
  expect_error(run_stemvo({"run", drive / "pictures", "--camera", folder_ / "camera.yaml", "--out",
                           drive.string(), "--pictures", "2"}),
               1, {"pictures", "no input"});
  EXPECT_TRUE(fs::exists(drive / "pictures/000000.png"));
}

}  // namespace
}  // namespace stemvo
