// SPDX-License-Identifier: MIT
// Clip 03 with frames dropped, and with times that jitter.
#include "dataset/frame_source.hpp"
#include "evaluation/metrics.hpp"
#include "evaluation/trajectory.hpp"
#include "stemvo/odometry.hpp"
#include "support/kitti_clips.hpp"
#include "support/test.hpp"

namespace stemvo {
namespace {

struct GivenFrame {
  std::size_t index;
  double time_s;
};

struct Outcome {
  double t_rel_percent = 0.0;  ///< with true steps: what the road tells has its own tests
  double inliers = 0.0;        ///< mean
};

class Times : public NeedsClips {
 protected:
  void SetUp() override {
    NeedsClips::SetUp();
    if (!IsSkipped()) {
      clip_.emplace(open_kitti(shared_data() / "kitti/sequences/03", {}).value());
    }
  }

  [[nodiscard]] std::vector<GivenFrame> whole() const {
    std::vector<GivenFrame> frames;
    for (std::size_t i = 0; i < clip_->size(); ++i) {
      frames.push_back({i, clip_->time_s(i)});
    }
    return frames;
  }
  [[nodiscard]] double interval_s() const {
    const auto last = static_cast<double>(clip_->size() - 1);
    return (clip_->time_s(clip_->size() - 1) - clip_->time_s(0)) / last;
  }
  [[nodiscard]] Outcome run(const std::vector<GivenFrame>& frames) const {
    Odometry odometry = Odometry::create(clip_->camera).value();
    Trajectory estimate;
    Trajectory truth;
    Outcome outcome;
    for (const GivenFrame& given : frames) {
      const cv::Mat image = clip_->read(given.index).value();
      const PixelOrder order = image.channels() == 1 ? PixelOrder::kGray : PixelOrder::kRgb;
      const FrameResult frame = odometry.process(image, order, given.time_s).value();
      estimate.push_back(frame.world_from_camera);
      truth.push_back(clip_->ground_truth->poses[given.index]);
      outcome.inliers += frame.num_inliers / static_cast<double>(frames.size());
    }
    const Metrics metrics = evaluate({rescale_steps({estimate, truth}), truth});
    outcome.t_rel_percent = metrics.t_rel_percent.value();
    std::cout << "t_rel " << outcome.t_rel_percent << " %, inliers " << outcome.inliers << "\n";
    return outcome;
  }

  std::optional<FrameSource> clip_;
};

TEST_F(Times, DroppedFramesAndJitterCostLittleAndFramesTakenForEvenlySpacedMore) {
  const Outcome all = run(whole());
  std::mt19937 random(1);
  std::uniform_real_distribution<double> share(0.0, 1.0);
  constexpr int kNumDrives = 2;
  double jittered_percent = 0.0;
  for (int i = 0; i < kNumDrives; ++i) {
    std::vector<GivenFrame> jittered = whole();
    for (GivenFrame& frame : jittered) {
      frame.time_s += 0.2 * interval_s() * (2.0 * share(random) - 1.0);
    }
    jittered_percent += run(jittered).t_rel_percent / kNumDrives;
  }
  // Harmless changes move the errors of 03 by 0.05 %: 1.15 and, below, 1.04 to 1.10 were seen.
  EXPECT_LT(jittered_percent, 1.25 * all.t_rel_percent);
  Outcome with_times;
  Outcome without;
  for (int i = 0; i < kNumDrives; ++i) {
    std::vector<GivenFrame> dropped = whole();
    std::erase_if(dropped,
                  [&](const GivenFrame& frame) { return frame.index > 0 && share(random) < 0.2; });
    std::vector<GivenFrame> even = dropped;
    for (std::size_t k = 0; k < even.size(); ++k) {
      even[k].time_s = static_cast<double>(k) * interval_s();
    }
    for (auto& [sum, frames] : {std::pair(&with_times, &dropped), std::pair(&without, &even)}) {
      const Outcome outcome = run(*frames);
      sum->t_rel_percent += outcome.t_rel_percent / kNumDrives;
      sum->inliers += outcome.inliers / kNumDrives;
    }
  }
  EXPECT_LT(with_times.t_rel_percent, 1.2 * all.t_rel_percent);
  // Images say where to look: errors without times are no larger, but tracks are lost.
  EXPECT_GT(with_times.inliers, 1.01 * without.inliers);
}

}  // namespace
}  // namespace stemvo
