// SPDX-License-Identifier: MIT
#include "features/patch_kernels.hpp"
#include "instruction_set.hpp"
#include "support/plain_samples.hpp"
#include "support/planted_warps.hpp"
#include "support/test.hpp"

namespace stemvo {
namespace {

/// Without it the tests below would run the same code twice: `unit.portable` sets STEMVO_PORTABLE.
TEST(InstructionSet, IsThePortableOneWhereThatIsAskedFor) {
  const char* value = std::getenv("STEMVO_PORTABLE");
  if (value != nullptr && std::string_view(value) == "1") {
    EXPECT_FALSE(uses_avx2());
    return;
  }
#if defined(__x86_64__)
  EXPECT_EQ(uses_avx2(), __builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma"));
#endif
}

class PatchKernelsTest : public ::testing::Test {
 protected:
  const TestPyramid pyramid_{View().render()};
  const BorderedImage& image_ = pyramid_.levels.front();
  const PatchKernels& kernels_ = patch_kernels();
};

TEST_F(PatchKernelsTest, SamplesAreThoseOfTheFormula) {
  for (const Similarity& warp : {Similarity{60.3F, 70.8F, 1.1F, 0.2F},
                                 {0.0F, 0.0F, 1.0F, 0.0F},
                                 {60.3F, 70.9F, 1.0F, 0.0F},
                                 {319.0F, 239.0F, 0.8F, -0.3F}}) {
    FineValues values;
    kernels_.sample_fine(image_, warp, values);
    const Eigen::VectorXd expected =
        samples(image_, Complex(warp.x, warp.y), Complex(warp.a, warp.b), cubic_weight);
    for (Eigen::Index k = 0; k < expected.size(); ++k) {
      EXPECT_NEAR(values[static_cast<std::size_t>(k)], expected[k], 0.02);
    }
  }
  CoarseValues coarse;
  kernels_.sample_coarse(image_, 20.25F, 30.75F, coarse);
  const Eigen::VectorXd expected = samples(image_, {23.75, 34.25}, 1.0, linear_weight);
  for (Eigen::Index k = 0; k < expected.size(); ++k) {
    EXPECT_NEAR(coarse[static_cast<std::size_t>(k)], expected[k], 1e-3);
  }
}

TEST_F(PatchKernelsTest, SumsAreThoseOfTheirSamples) {
  CoarseValues coarse;
  kernels_.sample_coarse(image_, 20.25F, 30.75F, coarse);
  const double sum = std::accumulate(coarse.begin(), coarse.end(), 0.0);
  const double squares = std::inner_product(coarse.begin(), coarse.end(), coarse.begin(), 0.0);
  float sums[2];
  CoarsePatch patch{{}, {}, coarse};
  patch.gx.fill(1.0F);
  kernels_.coarse_sums(image_, 20.25F, 30.75F, patch, sums);
  EXPECT_NEAR(sums[0], sum, 1e-5 * sum);
  EXPECT_NEAR(sums[1], squares, 1e-5 * squares);
  FineColumns columns{};
  columns[2] = coarse;
  FineValues ramp;
  std::iota(ramp.begin(), ramp.end(), 0.0F);
  float fine[7];
  kernels_.fine_sums(coarse, columns, ramp, fine);
  EXPECT_EQ(fine[0], 0.0F);
  EXPECT_NEAR(fine[2], squares, 1e-5 * squares);
  EXPECT_NEAR(fine[4], sum, 1e-5 * sum);
  EXPECT_NEAR(fine[5], squares, 1e-5 * squares);
  const double product = std::inner_product(coarse.begin(), coarse.end(), ramp.begin(), 0.0);
  EXPECT_NEAR(fine[6], product, 1e-5 * product);
}

}  // namespace
}  // namespace stemvo
