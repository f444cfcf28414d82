// SPDX-License-Identifier: MIT
// `run --resume` ends with the bytes of a run that was not interrupted.
#include <chrono>
#include <csignal>
#include <cstdint>
#include <cstdio>
#include <cstring>
#include <fstream>
#include <random>
#include <string>
#include <thread>
#include <vector>

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <libdeflate.h>

#include "support/program_test.hpp"
#include "support/write_video.hpp"

namespace stemvo {
namespace {

class Resume : public ::testing::Test {
 protected:
  static constexpr int kNumFrames = 240;

  /// One frame is no image.
  Resume() {
    test::link_long_drive(test::rendered_drive() / "sequences/00", sequence_, kNumFrames);
    fs::remove(sequence_ / frame_name(33));
    write_file(sequence_ / frame_name(33), "no image");
  }

  static std::string frame_name(int i) {
    char name[32];
    std::snprintf(name, sizeof(name), "image_2/%06d.png", i);
    return name;
  }
  [[nodiscard]] std::vector<std::string> run(const std::string& out,
                                             std::vector<std::string> more = {}) const {
    std::vector<std::string> arguments = {"run", sequence_.string(), "--out", folder_ / out,
                                          "--map"};
    arguments.insert(arguments.end(), more.begin(), more.end());
    return arguments;
  }
  /// What must not depend on the interrupt: of frames.csv all columns but the times.
  [[nodiscard]] std::string results(const std::string& out) const {
    std::string bytes;
    for (const char* name :
         {"trajectory_kitti.txt", "trajectory_tum.txt", "trajectory_refined_kitti.txt",
          "trajectory_refined_tum.txt", "map.ply"}) {
      bytes += read_file(folder_ / out / name);
    }
    std::ifstream rows(folder_ / out / "frames.csv");
    for (std::string row; std::getline(rows, row);) {
      std::vector<std::string> fields;
      std::stringstream line(row);
      for (std::string field; std::getline(line, field, ',');) {
        fields.push_back(field);
      }
      fields.erase(fields.begin() + 9, fields.begin() + 12);
      for (const std::string& field : fields) {
        bytes += field + ",";
      }
    }
    return bytes;
  }
  /// Runs the program, sends the signal `after` its first result is there. False: it ended before.
  [[nodiscard]] bool is_stopped(const std::string& out,
                                const std::vector<std::string>& arguments,
                                int signal,
                                std::chrono::milliseconds after) const {
    fs::remove(folder_ / out / "frames.csv");
    test::RunningProgram program(STEMVO_PROGRAM, arguments);
    for (int i = 0; i < 2000 && !fs::exists(folder_ / out / "frames.csv"); ++i) {
      std::this_thread::sleep_for(std::chrono::milliseconds(5));
    }
    std::this_thread::sleep_for(after);
    program.send(signal);
    const ProgramResult result = program.wait();
    EXPECT_THAT(result.exit_code, ::testing::AnyOf(0, 130, 128 + SIGKILL)) << result.err;
    return result.exit_code != 0;
  }

  TempFolder folder_;
  fs::path sequence_ = folder_.path() / "sequences/00";
};

TEST_F(Resume, InterruptedAtAnyMomentEndsWithTheSameBytes) {
  ASSERT_EQ(test::run_program(STEMVO_PROGRAM, run("whole")).exit_code, 0);
  const std::string whole = results("whole");
  std::mt19937 random(7);
  int num_stops = 0;
  for (const char* threads : {"1", "4"}) {
    const std::string out = std::string("stopped_") + threads;
    const auto arguments = run(out, {"--resume", "--threads", threads});
    for (int i = 0; i < 4; ++i) {
      const std::chrono::milliseconds after(random() % 300);
      num_stops += is_stopped(out, arguments, i % 2 == 0 ? SIGINT : SIGTERM, after) ? 1 : 0;
    }
    const ProgramResult last = test::run_program(STEMVO_PROGRAM, arguments);
    ASSERT_EQ(last.exit_code, 0) << last.err;
    EXPECT_TRUE(results(out) == whole) << out;
    EXPECT_FALSE(fs::exists(folder_ / out / "checkpoint"));
    EXPECT_THAT(last.err, HasSubstr("goes on at frame "));
  }
  EXPECT_GT(num_stops, 4);
}

TEST_F(Resume, KilledGoesOnFromTheLastCheckpoint) {
  ASSERT_EQ(test::run_program(STEMVO_PROGRAM, run("whole")).exit_code, 0);
  // Pictures take time: the run lasts beyond its first checkpoint.
  const auto arguments = run("killed", {"--resume", "--threads", "1", "--pictures", "4"});
  ASSERT_TRUE(is_stopped("killed", arguments, SIGKILL, std::chrono::milliseconds(2500)));
  EXPECT_TRUE(fs::exists(folder_ / "killed/checkpoint"));
  const ProgramResult last = test::run_program(STEMVO_PROGRAM, arguments);
  ASSERT_EQ(last.exit_code, 0) << last.err;
  EXPECT_THAT(last.err, HasSubstr("goes on at frame "));
  EXPECT_TRUE(results("killed") == results("whole"));
  for (int i = 0; i < kNumFrames; i += 4) {
    char name[32];
    std::snprintf(name, sizeof(name), "pictures/%06d.png", i);
    EXPECT_TRUE(fs::exists(folder_ / "killed" / name)) << i;
  }
}

TEST_F(Resume, AVideoGoesOnToo) {
  const std::string file = folder_ / "drive.avi";
  const std::string camera = folder_ / "camera.yaml";
  std::vector<fs::path> images;
  for (int i = 0; i < kNumFrames; ++i) {
    images.push_back(sequence_ / frame_name(i == 33 ? 32 : i));
  }
  test::write_video(file, 10.0, images);
  std::ofstream(camera) << "image_width: 620\nimage_height: 188\ndistortion_model: none\n"
                           "intrinsics: [360, 360, 305, 92]\n";
  const auto arguments = [&](const std::string& out) {
    return std::vector<std::string>{"run",   file,          "--camera", camera,
                                    "--out", folder_ / out, "--resume", "--map"};
  };
  ASSERT_EQ(test::run_program(STEMVO_PROGRAM, arguments("whole")).exit_code, 0);
  // At 0 ms while the video is wound forward to where it goes on.
  for (const int after : {150, 0, 20, 0}) {
    ASSERT_TRUE(
        is_stopped("stopped", arguments("stopped"), SIGINT, std::chrono::milliseconds(after)));
    EXPECT_TRUE(fs::exists(folder_ / "stopped/checkpoint"));
  }
  const ProgramResult last = test::run_program(STEMVO_PROGRAM, arguments("stopped"));
  ASSERT_EQ(last.exit_code, 0) << last.err;
  EXPECT_THAT(last.err, HasSubstr("goes on at frame "));
  EXPECT_TRUE(results("stopped") == results("whole"));
}

TEST_F(Resume, WhatCannotBeGoneOnFromIsNamed) {
  ASSERT_TRUE(is_stopped("out", run("out"), SIGINT, std::chrono::milliseconds(100)));
  const fs::path file = folder_.path() / "out/checkpoint";
  const std::string sound = read_file(file);
  ASSERT_FALSE(sound.empty());
  const auto expect_refused = [&](const std::vector<std::string>& more, const std::string& what) {
    const ProgramResult result = test::run_program(STEMVO_PROGRAM, run("out", more));
    EXPECT_EQ(result.exit_code, 1) << what;
    EXPECT_THAT(result.err, HasSubstr("--resume: " + file.string() + ": expected "));
    EXPECT_THAT(result.err, HasSubstr(what));
    EXPECT_TRUE(fs::exists(file));
  };
  expect_refused({"--resume", "--set", "features.max_features=300"}, "found another one's");
  expect_refused({"--resume", "--frames", "0:200"}, "found another one's");
  for (const std::size_t size : {std::size_t{0}, std::size_t{5}, sound.size() / 2}) {
    std::ofstream(file, std::ios::binary) << sound.substr(0, size);
    expect_refused({"--resume"}, "found damaged data");
  }
  std::string damaged = sound;
  damaged[sound.size() / 2] ^= 1;
  std::ofstream(file, std::ios::binary) << damaged;
  expect_refused({"--resume"}, "found damaged data");
  // Under the sum of what is there: cut behind the identity, bytes of the state, a huge count.
  const std::string content = sound.substr(sound.find('\n') + 1);
  const auto write_summed = [&](const std::string& bytes) {
    write_file(file, fmt::format("stemvo checkpoint {:08x}\n{}",
                                 libdeflate_crc32(0, bytes.data(), bytes.size()), bytes));
  };
  for (const std::size_t size : {std::size_t{0}, std::size_t{5}, content.size() / 2}) {
    write_summed(content.substr(0, size));
    expect_refused({"--resume"}, "found damaged data");
  }
  std::uint64_t identity_size = 0;
  std::memcpy(&identity_size, content.data(), sizeof(identity_size));
  for (const std::size_t at :
       {0UL, sizeof(identity_size) + identity_size, 2 * sizeof(identity_size) + identity_size}) {
    std::string other = content;
    other.replace(at, 8, "\xff\xff\xff\xff\xff\xff\xff\x7f");
    write_summed(other);
    expect_refused({"--resume"}, "found damaged data");
  }
  // Ids of tracks and sizes, forged: refused, or gone on from; never a bug of ours.
  std::vector<std::size_t> places;
  for (std::size_t at = 0; at + sizeof(std::int32_t) <= content.size(); ++at) {
    std::int32_t number = 0;
    std::memcpy(&number, content.data() + at, sizeof(number));
    if (number > 255 && number < 2000) {
      places.push_back(at);
    }
  }
  std::mt19937 random(3);
  const std::string rows = read_file(folder_.path() / "out/frames.csv");
  for (int i = 0; i < 6; ++i) {
    std::string other = content;
    for (int k = 0; k < 1 << i; ++k) {
      other.replace(places[random() % places.size()], 4, std::string("\xff\xff\xff\xff"));
    }
    write_summed(other);
    write_file(folder_.path() / "out/frames.csv", rows);
    const ProgramResult result = test::run_program(STEMVO_PROGRAM, run("out", {"--resume"}));
    EXPECT_THAT(result.exit_code, ::testing::AnyOf(0, 1)) << result.err;
    EXPECT_THAT(result.err, Not(HasSubstr("internal: "))) << i;
    if (result.exit_code == 1) {
      EXPECT_THAT(result.err, HasSubstr("found damaged data"));
    }
  }

  write_file(file, sound);
  const ProgramResult anew = test::run_program(STEMVO_PROGRAM, run("out"));
  EXPECT_EQ(anew.exit_code, 0) << anew.err;
  EXPECT_FALSE(fs::exists(file));
  EXPECT_THAT(anew.err, Not(HasSubstr("goes on")));
}

}  // namespace
}  // namespace stemvo
