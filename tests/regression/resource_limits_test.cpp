// SPDX-License-Identifier: MIT
#include <string>

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <nlohmann/json.hpp>
#include <sys/resource.h>
#include <unistd.h>

#include "support/program_test.hpp"

namespace stemvo {
namespace {

/// Runs the program where it may have so much of a resource only.
class ResourceLimits : public ::testing::Test {
 protected:
  [[nodiscard]] static ProgramResult under(const std::string& limit, const std::string& words) {
    // What the test was called with open counts against the limit.
    return test::run_program(
        "/bin/bash", {"-c", "for fd in {3..30}; do eval \"exec $fd>&-\"; done; ulimit -c 0; " +
                                limit + "; exec " + STEMVO_PROGRAM + " " + words});
  }
  [[nodiscard]] ProgramResult run_under(const std::string& limit) const {
    return under(limit, "run " + drive_.string() + " --quiet --out " + (folder_ / "out").string());
  }

  /// One line that is no bug's, or all frames were read.
  /// Whether it was refused; else it did its work.
  bool expect_said(const std::string& limit, const std::string& what) const {
    const ProgramResult result = run_under(limit);
    if (result.exit_code == 0) {
      EXPECT_THAT(result.err, IsEmpty()) << limit;
      const std::string rows = read_file(folder_ / "out/frames.csv");
      EXPECT_THAT(rows, Not(HasSubstr("no_image"))) << limit;
      return false;
    }
    EXPECT_EQ(result.exit_code, 1) << limit << ": " << result.err;
    EXPECT_THAT(result.err, ::testing::ContainsRegex(what)) << limit;
    EXPECT_THAT(result.err, Not(HasSubstr("internal"))) << limit;
    // ONNX Runtime may say on standard error too what it lacks.
    const std::size_t last = result.err.rfind('\n', result.err.size() - 2) + 1;
    EXPECT_THAT(result.err.substr(last), StartsWith("error: ")) << limit;
    return true;
  }

  TempFolder folder_;
  fs::path drive_ =
      test::rendered_drive({.frames = 30, .width_px = 310, .height_px = 94}) / "sequences/00";
};

TEST_F(ResourceLimits, TooFewOpenFiles) {
  EXPECT_TRUE(expect_said("ulimit -n 4", "open files"));
  // How many are open at once depends on the machine, and on what its threads do just then.
  for (int limit = 5; limit <= 12; ++limit) {
    expect_said("ulimit -n " + std::to_string(limit), "open files");
  }
}

TEST_F(ResourceLimits, TooFewOpenFilesToRender) {
  expect_error(under("ulimit -n 4", "synth " + (folder_ / "drive").string() + " --frames 2"), 1,
               {"drive", "open files"});
}

TEST_F(ResourceLimits, TooSmallAStack) {
  for (const int kib : {64, 512}) {
    expect_error(run_under("ulimit -s " + std::to_string(kib)), 1,
                 {"out of stack: expected at least 1024 kB, found " + std::to_string(kib)});
  }
  EXPECT_EQ(run_under("ulimit -s 1024").exit_code, 0);
}

/// The limit does not bind root, and counts all that a user has: asked as somebody who has nothing.
ProgramResult run_as(int user, int max_processes, const fs::path& drive, const fs::path& out) {
  fs::create_directories(out);
  fs::permissions(out.parent_path(), fs::perms::all);
  fs::permissions(out, fs::perms::all);
  return test::run_program(
      "/bin/bash",
      {"-c", fmt::format("exec setpriv --reuid {} --clear-groups /bin/bash -c 'ulimit -c 0; "
                         "ulimit -u {}; exec {} run {} --threads 2 --quiet --out {}'",
                         user, max_processes, STEMVO_PROGRAM, drive.string(), out.string())});
}

TEST_F(ResourceLimits, TooFewProcesses) {
  if (::geteuid() != 0) {
    GTEST_SKIP() << "expected root, who can be nobody";
  }
  expect_error(run_as(65534, 1, drive_, folder_ / "out"), 1,
               {"out of threads: expected more than 'ulimit -u' allows"});
}

/// Where no thread is left for the camera, which is measured beside the frames.
TEST_F(ResourceLimits, WithoutAThreadForTheCameraItIsMeasuredAllTheSame) {
  if (::geteuid() != 0) {
    GTEST_SKIP() << "expected root, who can be somebody else";
  }
  const auto camera_at = [&](int max_processes) {
    const fs::path out = folder_ / std::to_string(max_processes);
    return run_as(65533, max_processes, drive_, out).exit_code == 0
               ? nlohmann::json::parse(read_file(out / "metrics.json")).at("camera")
               : nlohmann::json();
  };
  const nlohmann::json expected = camera_at(100);
  ASSERT_LT(expected.at("cx_sigma_px"), 9.0) << "of 10 px that are assumed";
  int num_run = 0;
  for (int max_processes = 2; max_processes <= 8; ++max_processes) {
    const nlohmann::json camera = camera_at(max_processes);
    EXPECT_TRUE(camera.is_null() || camera == expected) << max_processes << ": " << camera;
    num_run += camera.is_null() ? 0 : 1;
  }
  EXPECT_GE(num_run, 3);
}

/// An error that says what ran out.
void expect_out_of_memory(const ProgramResult& result, int kib) {
  EXPECT_EQ(result.exit_code, 1) << kib << result.err;
  EXPECT_THAT(result.err, AnyOf(HasSubstr("out of"), HasSubstr("annot allocate"))) << kib;
}

/// From where the program's libraries are loaded on: the dynamic loader says what it lacks.
/// Of a filter it says nothing: it must not stand among those that detect nothing.
TEST_F(ResourceLimits, TooLittleMemoryToSearch) {
  // Their channels take 28 MB, so that memory ends there under some of the limits.
  const fs::path large =
      test::rendered_drive({.frames = 5, .width_px = 2480, .height_px = 752}) / "sequences/00";
  int num_refused = 0;
  for (int i = 0; i < 24; ++i) {
    const int kib = 110000 + i / 2 * 10000;
    const fs::path sequence = i % 2 == 0 ? large : drive_;  // for this one it ends at the sheet too
    const fs::path out = folder_ / ("search" + std::to_string(i));
    const ProgramResult result = under(
        "ulimit -v " + std::to_string(kib),
        "search " + sequence.string() +
            " --exhaustive --filters 0:2 --no-baselines --set 'evaluation.segment_lengths_m=[1]'"
            " --quiet --out " +
            out.string());
    if (result.exit_code == 0) {
      EXPECT_THAT(read_file(out / "filters.csv"), Not(HasSubstr("out of memory"))) << kib;
      EXPECT_TRUE(fs::exists(out / "sheet.png")) << kib << result.err;
      continue;
    }
    ++num_refused;
    expect_out_of_memory(result, kib);
  }
  EXPECT_GE(num_refused, 3);
}

/// Of a contender it says nothing.
TEST_F(ResourceLimits, TooLittleMemoryToCompare) {
  const std::string words = "robustness --kinds none --controls gray --frames 0:6 --quiet " +
                            drive_.string() + " --out " + (folder_ / "out").string();
  int num_refused = 0;
  for (int kib = 110000; kib < 170000; kib += 4000) {
    const ProgramResult result = under("ulimit -v " + std::to_string(kib), words);
    if (result.exit_code == 0) {
      EXPECT_THAT(result.err, IsEmpty()) << kib;
      continue;
    }
    ++num_refused;
    expect_out_of_memory(result, kib);
  }
  EXPECT_GE(num_refused, 2);
}

/// Of room for the stack of one thread more, where what was kept in the first second is on the
/// heap: the files so far were written empty, to where the program was called.
TEST_F(ResourceLimits, NoThreadForTheFilesSoFar) {
  const fs::path drive = test::rendered_drive({.frames = 200, .width_px = 310, .height_px = 94});
  const fs::path here = folder_ / "here";
  fs::create_directories(here);
  write_file(here / "frames.csv", "mine");
  int num_done = 0;
  for (int kib = 160000; kib < 300000 && num_done < 3; kib += 5000) {
    const ProgramResult result =
        under(fmt::format("cd {}; ulimit -s 65536; ulimit -v {}", here.string(), kib),
              fmt::format("run {} --threads 1 --quiet --out {} --set features.max_features=5000 "
                          "--set features.min_distance_px=2",
                          (drive / "sequences/00").string(), (folder_ / "out").string()));
    num_done += result.exit_code == 0;
    EXPECT_EQ(read_file(here / "frames.csv"), "mine") << kib;
    EXPECT_FALSE(fs::exists(here / "trajectory_kitti.txt")) << kib;
  }
  EXPECT_EQ(num_done, 3);
}

TEST_F(ResourceLimits, TooLittleMemory) {
  const ProgramResult probe = test::run_program(
      "/bin/bash",
      {"-c", std::string(STEMVO_PROGRAM) +
                 " --version & wait $!; "
                 "for v in $(seq 50000 5000 500000); do (ulimit -c 0; ulimit -v $v; exec " +
                 STEMVO_PROGRAM + " --version >/dev/null 2>&1) && echo $v && break; done"});
  const std::string first = probe.out.substr(probe.out.find('\n') + 1);
  ASSERT_FALSE(first.empty()) << probe.err;
  int num_refused = 0;
  for (int kib = std::stoi(first), end = kib + 96000; kib < end; kib += 8000) {
    num_refused += expect_said("ulimit -v " + std::to_string(kib),
                               "out of memory|out of threads|no thread|Cannot allocate memory");
  }
  EXPECT_GE(num_refused, 3) << "from " << first << " kB on";
}

}  // namespace
}  // namespace stemvo
