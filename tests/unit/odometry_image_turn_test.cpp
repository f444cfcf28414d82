// SPDX-License-Identifier: MIT
#include "odometry/image_turn.hpp"
#include "stemvo/rigid3.hpp"
#include "support/test.hpp"

namespace stemvo {
namespace {

const Camera kCamera{300.0, 300.0, 159.5, 119.5, 320, 240};

/// Gray values of directions.
class Surroundings {
 public:
  explicit Surroundings(unsigned seed) {
    std::mt19937 random(seed);
    std::normal_distribution<double> normal;
    for (Wave& wave : waves_) {
      wave.along = 12.0 * Eigen::Vector3d(normal(random), normal(random), normal(random));
      wave.phase = 10.0 * normal(random);
    }
  }

  [[nodiscard]] ImagePyramid seen(const Eigen::Quaterniond& world_from_camera,
                                  double gain = 1.0,
                                  double bias = 0.0) const {
    cv::Mat pixels(kCamera.height_px, kCamera.width_px, CV_8U);
    for (int y = 0; y < pixels.rows; ++y) {
      for (int x = 0; x < pixels.cols; ++x) {
        const Eigen::Vector3d ray =
            world_from_camera * kCamera.normalize({x, y}).homogeneous().normalized();
        double sum = 0.0;
        for (const Wave& wave : waves_) {
          sum += std::sin(wave.along.dot(ray) + wave.phase);
        }
        pixels.at<unsigned char>(y, x) =
            cv::saturate_cast<unsigned char>(gain * (128.0 + 12.0 * sum) + bias);
      }
    }
    return ImagePyramid({pixels, {}});
  }

 private:
  struct Wave {
    Eigen::Vector3d along;
    double phase = 0.0;
  };
  std::array<Wave, 20> waves_;
};

TEST(ImageTurn, IsFoundHoweverFastTheCameraTurnsAndWhateverTheExposure) {
  const Surroundings around(1);
  for (const Eigen::Vector3d& turn :
       {Eigen::Vector3d(0.0, 0.3, 0.0), Eigen::Vector3d(0.12, -0.15, 0.08),
        Eigen::Vector3d(-0.2, 0.02, -0.1), Eigen::Vector3d(0.001, 0.0, 0.002)}) {
    ImageTurn aligner(kCamera);
    EXPECT_FALSE(aligner.align(around.seen(Eigen::Quaterniond::Identity()), 0.1, {}).has_value());
    const auto found = aligner.align(around.seen(so3_exp(turn), 0.7, 20.0), 0.1, {});
    ASSERT_TRUE(found.has_value()) << turn.transpose();
    EXPECT_LT(found->angularDistance(so3_exp(turn)), 0.002) << turn.transpose();
    static_cast<void>(aligner.align(around.seen(so3_exp(turn)), 0.05, {}));
    EXPECT_LT(aligner.expected().angularDistance(so3_exp(0.5 * turn)), 0.002);
  }
}

TEST(ImageTurn, AHintLeadsWhereAShiftDoesNot) {
  const Surroundings around(2);
  const Eigen::Quaterniond turn = so3_exp({0.0, 0.0, 0.9});  // about the optical axis
  const auto found = [&](const std::optional<Eigen::Quaterniond>& hint) {
    ImageTurn aligner(kCamera);
    static_cast<void>(aligner.align(around.seen(Eigen::Quaterniond::Identity()), 0.1, {}));
    return aligner.align(around.seen(turn), 0.1, hint);
  };
  const auto hinted = found(so3_exp({0.03, 0.0, 0.85}));
  ASSERT_TRUE(hinted.has_value());
  EXPECT_LT(hinted->angularDistance(turn), 0.002);
  EXPECT_FALSE(found(std::nullopt).has_value());
}

TEST(ImageTurn, AGuessIsRefutedByImagesThatAreMoreAlikeWithoutIt) {
  const Surroundings around(6);
  const Eigen::Quaterniond turn = so3_exp({0.02, 0.2, 0.0});
  const auto refutes = [&](const std::optional<Eigen::Quaterniond>& hint, const cv::Mat& mask) {
    ImageTurn aligner(kCamera);
    for (const auto& at : {Eigen::Quaterniond::Identity(), turn}) {
      ImagePyramid image = around.seen(at);
      image.mask = mask;
      static_cast<void>(aligner.align(image, 0.1, hint));
    }
    return aligner.refutes_guess();
  };
  EXPECT_TRUE(refutes(std::nullopt, {})) << "the camera stood before";
  EXPECT_FALSE(refutes(turn * so3_exp({0.0, 0.005, 0.002}), {}));
  const Eigen::Quaterniond wrong = turn * so3_exp({0.1, 0.0, 0.1});
  EXPECT_TRUE(refutes(wrong, {}));
  EXPECT_FALSE(refutes(wrong, cv::Mat::zeros(kCamera.height_px, kCamera.width_px, CV_8U)));
}

TEST(ImageTurn, LooksPastTheMask) {
  const Surroundings around(7);
  const Eigen::Quaterniond turn = so3_exp({0.03, -0.15, 0.05});
  const auto found = [&](const cv::Mat& mask) {
    ImageTurn aligner(kCamera);
    std::optional<Eigen::Quaterniond> last;
    for (const auto& at : {Eigen::Quaterniond::Identity(), turn}) {
      ImagePyramid image = around.seen(at);
      // A thing that turns with the camera, strong and nearly half of the image.
      const cv::Rect below(0, 130, kCamera.width_px, kCamera.height_px - 130);
      image.channel.pixels(below) = 2 * (Surroundings(8).seen({1, 0, 0, 0}).levels[0](below) - 64);
      image.mask = mask;
      last = aligner.align(image, 0.1, {});
    }
    return last;
  };
  cv::Mat mask(kCamera.height_px, kCamera.width_px, CV_8U, cv::Scalar(255));
  mask.rowRange(130, kCamera.height_px) = 0;
  ASSERT_TRUE(found(mask).has_value());
  EXPECT_LT(found(mask)->angularDistance(turn), 0.003);
  const auto unmasked = found({});
  EXPECT_FALSE(unmasked.has_value() && unmasked->angularDistance(turn) < 0.05);
}

TEST(ImageTurn, PlainImagesAndOtherScenesTellNone) {
  ImageTurn aligner(kCamera);
  const ImagePyramid plain({cv::Mat(240, 320, CV_8U, cv::Scalar(90)), {}});
  const auto look = [&](const ImagePyramid& image) { return aligner.align(image, 0.1, {}); };
  EXPECT_FALSE(look(plain).has_value());
  EXPECT_FALSE(look(plain).has_value());
  EXPECT_FALSE(look(Surroundings(3).seen(Eigen::Quaterniond::Identity())).has_value());
  EXPECT_FALSE(look(Surroundings(4).seen(Eigen::Quaterniond::Identity())).has_value());
}

}  // namespace
}  // namespace stemvo
