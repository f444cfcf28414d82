// SPDX-License-Identifier: MIT
#include "stem/onnx_session.hpp"
#include "support/test.hpp"

namespace stemvo::internal {
namespace {

std::string read_model(const std::string& name) {
  return read_all(std::string(STEMVO_SOURCE_DIR) + "/tests/data/stems/" + name);
}

std::string error_of(const std::string& name, const std::string& bytes) {
  return message_of(OnnxSession::create(name, bytes));
}

TEST(OnnxSession, LoadsAStem) {
  const auto session = OnnxSession::create("plain", read_model("plain_k4s4.onnx"));
  EXPECT_EQ(session->num_filters(), 3);
  EXPECT_EQ(session->fixed_size(), cv::Size(0, 0));
}

TEST(OnnxSession, LoadsAStemOfOneSize) {
  const auto session = OnnxSession::create("fixed", read_model("fixed_k4s4.onnx"));
  EXPECT_EQ(session->fixed_size(), cv::Size(48, 32));
  const std::vector<float> image(3 * 40 * 32);
  std::vector<float> channels(3 * 10 * 8);
  EXPECT_THAT(session->run(image.data(), {40, 32}, channels.data(), {10, 8}).error().message,
              AllOf(HasSubstr("fixed: ONNX Runtime"), Not(HasSubstr("\n"))));
}

TEST(OnnxSession, RunsOnTheCallersBuffers) {
  auto created = OnnxSession::create("plain", read_model("plain_k4s4.onnx"));
  const OnnxSession session = std::move(*created);  // still works after a move
  const std::vector<float> image(3 * 8 * 8, 100.0F);
  std::vector<float> channels(3 * 2 * 2, -1.0F);
  const Status status = session.run(image.data(), {8, 8}, channels.data(), {2, 2});
  ASSERT_TRUE(status) << status.error().message;
  for (int i = 0; i < 4; ++i) {  // filter 0 is the mean over the window, less the mean colour
    EXPECT_NEAR(channels[static_cast<std::size_t>(i)], -15.0F, 1e-4F);
  }
  EXPECT_THAT(session.run(image.data(), {8, 8}, channels.data(), {1, 2}).error().message,
              HasSubstr("plain: ONNX Runtime"));
}

TEST(OnnxSession, FindsMetadataByTheirKey) {
  const auto session = OnnxSession::create("plain", read_model("plain_k4s4.onnx"));
  EXPECT_EQ(session->metadata("stemvo.kernel").value(), "4 4");
  EXPECT_EQ(session->metadata("stemvo.none").value(), std::nullopt);
}

TEST(OnnxSession, RefusesWhatIsNoModel) {
  EXPECT_THAT(error_of("a.onnx", "this is not a model"), HasSubstr("a.onnx: ONNX Runtime: "));
  EXPECT_THAT(error_of("a.onnx", ""), HasSubstr("a.onnx: ONNX Runtime: "));
  const std::string whole = read_model("norm_k4s4.onnx");
  for (std::size_t size = 1; size < whole.size(); size += 97) {
    EXPECT_NE(error_of("cut.onnx", whole.substr(0, size)), "no error") << size;
  }
}

/// ONNX Runtime would look for them in the folder it runs in.
TEST(OnnxSession, RefusesWeightsInAnotherFile) {
  const std::filesystem::path file = "wrong_external.bin";
  std::ofstream(file, std::ios::binary) << std::string(36, '\0');
  EXPECT_THAT(error_of("a.onnx", read_model("wrong_external.onnx")),
              AllOf(HasSubstr("a.onnx: ONNX Runtime: "), HasSubstr("xternal data")));
  std::filesystem::remove(file);
}

TEST(OnnxSession, RefusesOperatorsOfOthers) {
  EXPECT_THAT(error_of("a.onnx", read_model("wrong_domain.onnx")),
              AllOf(HasSubstr("a.onnx: ONNX Runtime: "), HasSubstr("Steal")));
}

TEST(OnnxSession, RefusesOtherInputsAndOutputs) {
  const std::vector<std::pair<std::string, std::string>> cases = {
      {"wrong_input_name",
       "expected input 'image float 1x3xHxW' or 1x1xHxW, found 'x float 1x3x?x?'"},
      {"wrong_two_outputs", "expected 1 output, found 2"},
      {"wrong_rank", "expected input 'image float 1x3xHxW' or 1x1xHxW, found 'image float 3x?x?'"},
      {"wrong_planes",
       "expected input 'image float 1x3xHxW' or 1x1xHxW, found 'image float 1x2x?x?'"},
      {"wrong_type",
       "expected input 'image float 1x3xHxW' or 1x1xHxW, found 'image no float 1x3x?x?'"},
      {"wrong_free_filters",
       "expected output 'float 1xCxhxw' with C known, found 'channels float 1x?x?x?'"},
      {"wrong_two_inputs", "expected 1 input, found 2"},
      {"wrong_output_rank",
       "expected output 'float 1xCxhxw' with C known, found 'channels float 1x?x?'"},
  };
  for (const auto& [name, message] : cases) {
    EXPECT_EQ(error_of(name, read_model(name + ".onnx")), name + ": " + message);
  }
}

}  // namespace
}  // namespace stemvo::internal
