// SPDX-License-Identifier: MIT
#include "stem/model.hpp"
#include "stem/onnx_session.hpp"
#include "support/test.hpp"
#include "support/tiny_stem.hpp"

namespace stemvo {
namespace {

TEST(Model, SaysWhatItIs) {
  const auto info = read_model_info(tiny_model("plain_k3s2same"));
  EXPECT_EQ(info->network, "tiny");
  EXPECT_EQ(info->layer, "stem");
  EXPECT_EQ(info->licence, "MIT");
  EXPECT_EQ(info->command, "tests/data/make_models.py");
  EXPECT_EQ(info->num_filters, 3);
  EXPECT_EQ(info->default_filter, 1);
  EXPECT_FALSE(info->only_filter.has_value());
  EXPECT_THAT(info->kernel_px, ElementsAre(3, 3));
  EXPECT_EQ(info->stride_px, 2);
  EXPECT_THAT(info->padding_px, ElementsAre(0, 0, 1, 1));
  EXPECT_FALSE(info->native_sampling_only);
  EXPECT_TRUE(read_model_info(tiny_model("deep_k12s4"))->native_sampling_only);
  EXPECT_EQ(read_model_info(tiny_model("gray_k4s4_filter_1"))->only_filter, 1);
}

TEST(Model, TheBuiltInOnesAreThoseOfTheFolder) {
  EXPECT_THAT(built_in_models(), ElementsAre("default", "default_filter_0", "paper"));
  for (const std::string& model : built_in_models()) {
    EXPECT_EQ(read_model(model).value(), read_all(STEMVO_SOURCE_DIR "/models/" + model + ".onnx"));
    EXPECT_TRUE(internal::open_model(model)) << model;
  }
}

TEST(Model, WithoutMetadataTheCommandThatAddsThemIsNamed) {
  const std::string model = tiny_model("wrong_no_metadata");
  EXPECT_THAT(internal::open_model(model).error().message,
              AllOf(HasSubstr(model + ": expected metadata stemvo.network, found none"),
                    HasSubstr("stemvo-lab export")));
}

/// Error of a model that says something else under a key.
std::string error_with(const std::string& name, const std::string& key, const std::string& value) {
  const TempFolder folder;
  const std::string bytes = read_all(tiny_model(name));
  const auto file = folder.file("changed.onnx", with_metadata(bytes, key, value));
  return message_of(internal::open_model(file.string()));
}

TEST(Model, MetadataThatAreNoneAreNamed) {
  EXPECT_EQ(error_with("plain_k4s4", "licence", "CC0"), "no error");
  for (const auto& [key, value, expected] :
       {std::tuple("kernel", "4", "2 whole numbers from 1 to 4096"),
        {"kernel", "4 4.5", "2 whole numbers from 1 to 4096"},
        {"kernel", "40000 4", "2 whole numbers from 1 to 4096"},
        {"stride", "0", "1 whole numbers from 1 to 256"},
        {"stride", "many", "1 whole numbers from 1 to 256"},
        {"padding", "0 0 4 0", "4 whole numbers from 0 to 3"},
        {"padding", "0 0 -1 0", "4 whole numbers from 0 to 3"},
        {"filters", "5000", "1 whole numbers from 1 to 4096"},
        {"default_filter", "3", "1 whole numbers from 0 to 2"},
        {"filter", "3", "1 whole numbers from 0 to 2"}}) {
    EXPECT_THAT(error_with("plain_k4s4", key, value),
                HasSubstr(std::string("changed.onnx: stemvo.") + key + ": expected " + expected +
                          ", found '" + value + "'"));
  }
}

TEST(Model, IsHeldAgainstItsGraph) {
  EXPECT_THAT(error_with("plain_k3s2p1", "filters", "4"), HasSubstr("expected 4 filters, found 3"));
  EXPECT_THAT(error_with("plain_k3s2p1", "filter", "0"), HasSubstr("expected 1 filters, found 3"));
  EXPECT_THAT(error_with("plain_k3s2p1", "stride", "1"), HasSubstr("expected channels of"));
  EXPECT_THAT(error_with("plain_k3s2p1", "kernel", "5 5"), HasSubstr("expected channels of"));
  EXPECT_THAT(error_with("deep_k12s4", "kernel", "17 17"), HasSubstr("expected channels of"));
  // The same sizes, but another pixel map: only the values can tell.
  EXPECT_THAT(error_with("plain_k3s2p1", "padding", "1 0 1 2"),
              HasSubstr("found that pixels outside it matter"));
  EXPECT_THAT(error_with("deep_k12s4", "sampling", "any"),
              HasSubstr("found that pixels outside it matter"));
  EXPECT_THAT(internal::open_model(tiny_model("wrong_infinite")).error().message,
              HasSubstr("expected finite channels"));
}

/// Every side of the window matters.
TEST(Model, ALargerWindowThanTheGraphsIsRefused) {
  const TempFolder folder;
  std::string bytes = read_all(tiny_model("plain_k3s2p1"));
  bytes = with_metadata(bytes, "kernel", "4 3");
  bytes = with_metadata(bytes, "padding", "1 1 2 1");
  EXPECT_THAT(internal::open_model(folder.file("changed.onnx", bytes).string()).error().message,
              HasSubstr("found that pixels along one of its sides do not matter"));
}

std::string session_error(const std::string& name) {
  return message_of(internal::OnnxSession::create(name, read_all(tiny_model(name))));
}

/// ONNX Runtime would look for them in the folder it runs in.
TEST(OnnxSession, RefusesWeightsInAnotherFile) {
  const std::filesystem::path file = "wrong_external.bin";
  std::ofstream(file, std::ios::binary) << std::string(36, '\0');
  EXPECT_THAT(session_error("wrong_external"),
              AllOf(HasSubstr(": ONNX Runtime: "), HasSubstr("xternal data")));
  std::filesystem::remove(file);
}

TEST(OnnxSession, RefusesOperatorsOfOthers) {
  EXPECT_THAT(session_error("wrong_domain"),
              AllOf(HasSubstr(": ONNX Runtime: "), HasSubstr("Steal")));
}

TEST(OnnxSession, RefusesOtherInputsAndOutputs) {
  const std::vector<std::pair<std::string, std::string>> cases = {
      {"wrong_input_name",
       "expected input 'image float 1x3xHxW' or 1x1xHxW, found 'x float 1x3x-1x-1'"},
      {"wrong_two_outputs", "expected 1 output, found 2"},
      {"wrong_rank",
       "expected input 'image float 1x3xHxW' or 1x1xHxW, found 'image float 3x-1x-1'"},
      {"wrong_planes",
       "expected input 'image float 1x3xHxW' or 1x1xHxW, found 'image float 1x2x-1x-1'"},
      {"wrong_type",
       "expected input 'image float 1x3xHxW' or 1x1xHxW, found 'image no float 1x3x-1x-1'"},
      {"wrong_free_filters",
       "expected output 'float 1xCxhxw' with C known, found 'channels float 1x-1x-1x-1'"},
      {"wrong_two_inputs", "expected 1 input, found 2"},
      {"wrong_output_rank",
       "expected output 'float 1xCxhxw' with C known, found 'channels float 1x-1x-1'"},
  };
  for (const auto& [name, message] : cases) {
    EXPECT_EQ(session_error(name), name + ": " + message);
  }
}

}  // namespace
}  // namespace stemvo
