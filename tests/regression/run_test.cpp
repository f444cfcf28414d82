// SPDX-License-Identifier: MIT
#include "report/evaluate_report.hpp"
#include "support/program_test.hpp"
#include "support/test.hpp"

namespace stemvo {
namespace {

constexpr const char* kTrueScale = "scale.source=ground_truth";

ProgramResult run_drive(const fs::path& sequence, const std::string& out, const Words& more = {}) {
  return run_stemvo({"run", sequence.string(), "--out", out}, more);
}

std::ptrdiff_t count_lines(const std::string& text) {
  return std::count(text.begin(), text.end(), '\n');
}

class Run : public ::testing::Test {
 protected:
  TempFolder folder_;
  fs::path sequence_ = rendered_drive() / "sequences/00";
  std::string out_ = folder_ / "result";
};

TEST_F(Run, WritesEveryFileAndPrintsTheTable) {
  const ProgramResult result =
      succeeded(run_drive(sequence_, out_, {"--set", kTrueScale, "--pictures", "20"}));
  EXPECT_EQ(count_lines(read_file(out_ + "/trajectory_kitti.txt")), 60);
  EXPECT_EQ(count_lines(read_file(out_ + "/trajectory_tum.txt")), 60);
  EXPECT_EQ(count_lines(read_file(out_ + "/frames.csv")), 61);
  EXPECT_GT(fs::file_size(out_ + "/trajectory.png"), 10000U);
  EXPECT_GT(fs::file_size(out_ + "/report.html"), 1000000U);
  EXPECT_THAT(read_file(out_ + "/config.yaml"),
              AllOf(HasSubstr("# stemvo 0."), HasSubstr("# model default: 16 filters"),
                    HasSubstr("frames 0:60 of 00"), HasSubstr("source: ground_truth")));
  for (const char* name : {"000000", "000020", "000040"}) {
    EXPECT_TRUE(fs::exists(out_ + "/pictures/" + name + ".png")) << name;
  }
  EXPECT_FALSE(fs::exists(out_ + "/pictures/000001.png"));
  EXPECT_THAT(result.out, AllOf(HasSubstr("t_rel"), HasSubstr("report.html")));
  EXPECT_THAT(result.err, HasSubstr("60/60 frames"));
}

TEST_F(Run, NothingLooksAhead) {
  succeeded(run_drive(sequence_, out_ + "long", {"--frames", "0:40"}));
  succeeded(run_drive(sequence_, out_ + "short", {"--frames", "0:25"}));
  const std::string longer = read_file(out_ + "long/trajectory_kitti.txt");
  const std::string shorter = read_file(out_ + "short/trajectory_kitti.txt");
  EXPECT_EQ(count_lines(shorter), 25);
  EXPECT_EQ(longer.substr(0, shorter.size()), shorter);
}

/// The code for processors without AVX2: bytes of its own for any number of threads, and a path
/// near the other one.
TEST_F(Run, PortableCodeHasItsOwnBytesAndTheSamePath) {
  const std::string path = "/trajectory_kitti.txt";
  succeeded(run_drive(sequence_, out_));
  for (const std::string threads : {"1", "2"}) {
    succeeded(run_program("/usr/bin/env", {"STEMVO_PORTABLE=1", STEMVO_PROGRAM, "run", sequence_,
                                           "--out", out_ + threads, "--threads", threads}));
  }
  EXPECT_TRUE(read_file(out_ + "1" + path) == read_file(out_ + "2" + path));
#if defined(__x86_64__)
  EXPECT_EQ(read_file(out_ + "1" + path) == read_file(out_ + path),
            !(__builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma")));
#endif
  const auto difference = evaluate_files({out_ + path, {out_ + "1" + path}});
  ASSERT_TRUE(difference.has_value());
  std::cout << difference->rows.front().metrics.ate_rmse.none_m << " m apart\n";
  EXPECT_LE(difference->rows.front().metrics.ate_rmse.none_m, 0.02);  // found: 0.002
}

TEST_F(Run, WithoutGroundTruthNoByteOfTheTrajectoryChanges) {
  const fs::path copy = copy_drive(folder_.path(), 12);
  succeeded(run_drive(copy, out_ + "1"));
  EXPECT_FALSE(metrics_of(out_ + "1")["t_rel_percent"].is_null() &&
               metrics_of(out_ + "1")["path_length_m"].is_null());
  fs::remove(folder_.path() / "poses/00.txt");
  succeeded(run_drive(copy, out_ + "2"));
  EXPECT_TRUE(read_file(out_ + "1/trajectory_kitti.txt") ==
              read_file(out_ + "2/trajectory_kitti.txt"));
  const nlohmann::json metrics = metrics_of(out_ + "2");
  for (const char* key : {"path_length_m", "average_offset_m", "t_rel_percent", "ate_rmse_m"}) {
    EXPECT_TRUE(metrics.contains(key)) << key;
  }
  EXPECT_TRUE(metrics["path_length_m"].is_null());
  EXPECT_TRUE(metrics["t_rel_percent"].is_null());
  EXPECT_EQ(metrics["frames"], 12);
}

TEST_F(Run, ItsConfigRunsAgain) {
  succeeded(run_drive(sequence_, out_ + "1",
                      {"--frames", "0:10", "--set", "stem.model=gray", "--set", "seed=5"}));
  succeeded(
      run_drive(sequence_, out_ + "2", {"--frames", "0:10", "--config", out_ + "1/config.yaml"}));
  EXPECT_TRUE(read_file(out_ + "1/trajectory_kitti.txt") ==
              read_file(out_ + "2/trajectory_kitti.txt"));
  EXPECT_TRUE(read_file(out_ + "1/config.yaml") == read_file(out_ + "2/config.yaml"));
  succeeded(run_drive(sequence_, out_ + "2", {"--config", out_ + "2/config.yaml"}));
}

TEST_F(Run, AnyChannelAndFrontEndRuns) {
  for (const std::string model : {"gray", "input_layer", "default"}) {
    for (const std::string method : {"klt", "orb", "sift"}) {
      const std::string out = out_ + model + method;
      const ProgramResult result =
          run_drive(sequence_, out,
                    {"--frames", "0:6", "--set", "stem.model=" + model, "--set",
                     "features.method=" + method, "--set", "scale.source=none", "--quiet"});
      EXPECT_EQ(result.exit_code, 0) << model << " " << method << ": " << result.err;
      EXPECT_THAT(result.out + result.err, IsEmpty());
      EXPECT_EQ(count_lines(read_file(out + "/trajectory_kitti.txt")), 6);
    }
  }
  succeeded(run_drive(sequence_, out_, {"--frames", "0:6", "--config", "paper"}));
}

TEST_F(Run, InterruptWritesWhatWasComputed) {
  for (const int signal : {SIGINT, SIGTERM}) {
    // The same few frames many times over last long enough to be interrupted.
    const fs::path copy = copy_drive(folder_.path() / std::to_string(signal), 2);
    for (int i = 2; i < 4000; ++i) {
      fs::create_symlink(copy / image_name(i % 2), copy / image_name(i));
    }
    fs::remove(copy / "../../poses/00.txt");
    std::ofstream times(copy / "times.txt");
    for (int i = 0; i < 4000; ++i) {
      times << 0.1 * i << "\n";
    }
    times.close();
    const std::string out = out_ + std::to_string(signal);
    RunningProgram program(STEMVO_PROGRAM, {"run", copy.string(), "--out", out});
    for (int i = 0; i < 600 && !fs::exists(out + "/frames.csv"); ++i) {
      std::this_thread::sleep_for(std::chrono::milliseconds(50));
    }
    std::this_thread::sleep_for(std::chrono::milliseconds(500));
    program.send(signal);
    const ProgramResult result = program.wait();
    EXPECT_EQ(result.exit_code, 130) << result.err;
    const auto num_poses = count_lines(read_file(out + "/trajectory_kitti.txt"));
    EXPECT_GT(num_poses, 0);
    EXPECT_LT(num_poses, 4000);
    EXPECT_EQ(metrics_of(out)["frames"], num_poses);
    EXPECT_EQ(count_lines(read_file(out + "/frames.csv")), num_poses + 1);
    EXPECT_TRUE(fs::exists(out + "/trajectory.png"));
  }
}

}  // namespace
}  // namespace stemvo
