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
