// SPDX-License-Identifier: MIT
#include <chrono>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "stem/foreign_model.hpp"
#include "stem/model_file.hpp"
#include "support/temp_folder.hpp"
#include "support/tiny_stem.hpp"

namespace stemvo::internal {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::StartsWith;

std::string bytes_of(const std::string& name) {
  return testing::read_all(testing::tiny_stems() / (name + ".onnx"));
}

/// What a network of that file, of 3 filters of one pixel, is refused with.
std::string error_of(const std::string& name) {
  StemNetwork network;
  network.name = name;
  network.file = testing::tiny_stems() / (name + ".onnx");
  network.layer = "stem";
  network.num_filters = 3;
  network.kernel_px = {1, 1};
  network.stride_px = 1;
  const auto session = open_model(network);
  return session ? "no error" : session.error().message;
}

TEST(ForeignModel, IsRefusedForTheRightReason) {
  for (const auto& [name, reason] : {
           std::pair("kernel",
                     "operator MaxPool: expected kernel_shape of at most 256, found 40000"),
           std::pair("stride", "operator MaxPool: expected strides of at most 256, found 8000"),
           std::pair(
               "size",
               "expected an input of at most 16777216 pixels, found 'image float 1x3x46341x46341'"),
           std::pair("domain", "expected ONNX's own operators, found Steal of 'com.example'"),
           std::pair("loop", "operator Loop: expected a graph without loops and branches"),
           std::pair("external", "expected all weights in the file, found 'weights' in another"),
           std::pair("nan", "expected finite weights, found NaN or infinity in 'weights'"),
           std::pair("infinite", "expected finite channels"),
           std::pair("pads", "operator Conv: expected pads of at most 256, found 4096"),
           std::pair("across", "operator LRN: expected size of at most 256, found 65537"),
           std::pair("samples", "operator Multinomial: expected an operator that layers of"),
           std::pair("words", "operator TfIdfVectorizer: expected an operator that layers of"),
           std::pair("tile", "operator Tile: expected an operator that layers of"),
           std::pair("constant", "operator Conv: expected it to depend on the image"),
           std::pair("pairs", "operator Add: expected at most 134217728 values that depend on no"),
           std::pair("rank", "expected output 'channels float 1x3xhxw', found 'channels float 3x"),
       }) {
    const std::string file = std::string("hostile_") + name;
    EXPECT_THAT(error_of(file), AllOf(HasSubstr(file + ".onnx: "), HasSubstr(reason)));
  }
}

TEST(ForeignModel, SoundOnesPass) {
  for (const char* name : {"plain_k4s4", "norm_k4s4", "two_layers", "gray_k4s4_filter_1"}) {
    EXPECT_TRUE(check_foreign_model(name, bytes_of(name))) << name;
  }
}

TEST(ForeignModel, WhatIsNoModelIsRefusedBeforeTheRuntimeSeesIt) {
  const std::string whole = bytes_of("norm_k4s4");
  EXPECT_FALSE(check_foreign_model("empty", ""));
  EXPECT_FALSE(check_foreign_model("text", "this is not a model\n"));
  EXPECT_THAT(check_foreign_model("a", "\x12\x06xxORTMxx").error().message,
              StartsWith("a: expected an ONNX model, found one in ONNX Runtime's own format"));
  for (std::size_t size = 0; size < whole.size(); ++size) {
    static_cast<void>(check_foreign_model("cut", whole.substr(0, size)));  // reads nothing beyond
  }
  std::string changed = whole;
  for (std::size_t i = 0; i < whole.size(); ++i) {
    changed[i] = '\xff';
    static_cast<void>(check_foreign_model("changed", changed));
    changed[i] = whole[i];
  }
}

TEST(ForeignModel, AGraphOfTooManyOperatorsIsRefused) {
  const auto with_nodes = [](std::size_t count) {
    const std::string node =
        "\x0a\x0a\x22\x08"
        "Constant";
    std::string model = "\x3a";  // the graph, its length, nodes
    for (std::size_t rest = node.size() * count; rest > 0; rest >>= 7U) {
      model += static_cast<char>((rest & 0x7fU) | (rest > 0x7fU ? 0x80U : 0U));
    }
    for (std::size_t i = 0; i < count; ++i) {
      model += node;
    }
    return check_foreign_model("many", model);
  };
  EXPECT_TRUE(with_nodes(kMaxNodes));
  EXPECT_THAT(with_nodes(kMaxNodes + 1).error().message, HasSubstr("at most 2000 operators"));
}

/// The parts would be merged to one that is checked nowhere.
TEST(ForeignModel, AGraphInPartsIsRefused) {
  const std::string part(
      "\x3a\x0c\x0a\x0a\x22\x08"
      "Constant");
  EXPECT_TRUE(check_foreign_model("one", part));
  EXPECT_EQ(check_foreign_model("two", part + part).error().message,
            "two: expected one graph, found several");
}

TEST(ForeignModel, TooManyInputsOrWeightsAreRefused) {
  const auto message = [](const char* key, const std::string& content) {
    std::string result = key;  // the field, its length
    for (std::size_t rest = content.size(); rest > 0; rest >>= 7U) {
      result += static_cast<char>((rest & 0x7fU) | (rest > 0x7fU ? 0x80U : 0U));
    }
    return result + content;
  };
  const auto repeated = [](const std::string& text, std::size_t count) {
    std::string result;
    for (std::size_t i = 0; i < count; ++i) {
      result += text;
    }
    return result;
  };
  const std::string weight = message("\x2a", message("\x42", "a"));
  const std::string input = message("\x0a", "a");
  const std::string image = message("\x5a", input);
  for (const std::size_t count : {kMaxLinks, kMaxLinks + 1}) {
    const std::string node = message("\x0a", repeated(input, count - 1) + message("\x22", "Max"));
    for (const std::string& graph : {repeated(weight, count), image + node}) {
      EXPECT_EQ(check_foreign_model("many", message("\x3a", graph)).has_value(),
                count == kMaxLinks);
    }
  }
}

TEST(ForeignModel, ARunEndsAtItsTimeLimit) {
  const auto session = OnnxSession::create("slow", bytes_of("hostile_slow"), "stem");
  ASSERT_TRUE(session) << session.error().message;
  const auto start = std::chrono::steady_clock::now();
  const auto size = session->channel_size({64, 64}, std::chrono::milliseconds(100));
  EXPECT_LT(std::chrono::steady_clock::now() - start, std::chrono::seconds(10));
  ASSERT_FALSE(size);
  EXPECT_EQ(size.error().message,
            "slow: expected a small image to take less than 0.1 s, found that it takes longer");
}

TEST(ForeignModel, NumbersOfAManifestHaveEnds) {
  StemNetwork network;
  network.name = "big";
  network.file = testing::tiny_stems() / "plain_k4s4.onnx";
  network.layer = "stem";
  network.num_filters = 3;
  network.kernel_px = {4096, 4096};
  network.stride_px = 256;
  const auto session = open_model(network);
  ASSERT_FALSE(session);
  EXPECT_THAT(session.error().message, HasSubstr("an image of at most 16777216 pixels"));
}

}  // namespace
}  // namespace stemvo::internal
