// SPDX-License-Identifier: MIT
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "models/manifest.hpp"
#include "stem/model_file.hpp"
#include "support/temp_folder.hpp"
#include "support/tiny_stem.hpp"

namespace stemvo {
namespace {

using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::EndsWith;
using ::testing::HasSubstr;
using ::testing::StartsWith;

const char* const kEntry =
    "models:\n"
    "  - name: one\n"
    "    file: one.onnx\n"
    "    sha256: 0123456789abcdef0123456789abcdef0123456789abcdef0123456789abcdef\n"
    "    network: Net\n"
    "    layer: stem\n"
    "    filters: 16\n"
    "    kernel: [4, 5]  # y, x\n"
    "    stride: 2\n"
    "    padding: [0, 1, 2, 3]\n"
    "    default_filter: 7\n"
    "    licence: MIT\n"
    "    command: make it\n";

const char* const kFoldedKey =
    "    folded: {filter: 3, sampling: 1, file: three.onnx, "
    "sha256: 0123456789abcdef0123456789abcdef0123456789abcdef0123456789abcdef}\n";

class Manifest : public ::testing::Test {
 protected:
  std::string error_of(const std::string& text) {
    const auto file = folder.file("manifest.yaml", text);
    const auto entries = load_manifest(file);
    const std::string prefix = file.string();
    if (entries) {
      return "no error";
    }
    EXPECT_THAT(entries.error().message, StartsWith(prefix + ":"));
    return entries.error().message.substr(prefix.size());
  }
  /// kEntry with one text replaced by another.
  std::string error_with(const std::string& from, const std::string& to) {
    std::string text = kEntry;
    const std::size_t at = text.find(from);
    EXPECT_NE(at, std::string::npos) << from;
    return error_of(text.replace(at, from.size(), to));
  }
  testing::TempFolder folder;
};

TEST_F(Manifest, ReadsTheFileOfOneFilter) {
  const std::string text = std::string(kEntry) + kFoldedKey;
  const auto entries = load_manifest(folder.file("manifest.yaml", text));
  ASSERT_TRUE(entries) << entries.error().message;
  const auto& folded = entries->front().folded;
  ASSERT_TRUE(folded.has_value());
  EXPECT_EQ(folded->filter, 3);
  EXPECT_EQ(folded->sampling_px, 1);
  EXPECT_EQ(folded->file, folder / "three.onnx");
  EXPECT_EQ(folded->sha256.size(), 64U);
  const auto error_with_folded = [&](const std::string& from, const std::string& to) {
    std::string changed = text;
    return error_of(changed.replace(changed.rfind(from), from.size(), to));
  };
  EXPECT_EQ(error_with_folded("filter: 3", "filter: 16"),
            ":14: folded.filter: expected 0 to 15, found 16");
  EXPECT_EQ(error_with_folded("sampling: 1", "sampling: 3"),
            ":14: folded.sampling: expected a divisor of the stride 2, found 3");
  EXPECT_EQ(error_with_folded("three.onnx", "../three.onnx"),
            ":14: folded.file: expected a name beside the manifest, found '../three.onnx'");
  EXPECT_EQ(error_with_folded("sampling: 1, ", ""), ":14: missing key 'folded.sampling'");
  EXPECT_EQ(error_with_folded("sha256: 01", "sha256: "),
            ":14: folded.sha256: expected 64 digits 0-9 and a-f, found 62 characters");
  EXPECT_EQ(
      error_with_folded("filter: 3", "filters: 3"),
      ":14: folded.filters: unknown key; known keys of folded: filter, sampling, file, sha256");
}

TEST_F(Manifest, ReadsEveryKey) {
  const auto entries = load_manifest(folder.file("manifest.yaml", kEntry));
  ASSERT_TRUE(entries) << entries.error().message;
  ASSERT_EQ(entries->size(), 1U);
  const ModelEntry& entry = entries->front();
  EXPECT_EQ(entry.name, "one");
  EXPECT_EQ(entry.file, folder / "one.onnx");
  EXPECT_THAT(entry.sha256, AllOf(StartsWith("0123"), EndsWith("cdef")));
  EXPECT_EQ(entry.network, "Net");
  EXPECT_EQ(entry.layer, "stem");
  EXPECT_EQ(entry.num_filters, 16);
  EXPECT_THAT(entry.kernel_px, ElementsAre(4, 5));
  EXPECT_EQ(entry.stride_px, 2);
  EXPECT_THAT(entry.padding_px, ElementsAre(0, 1, 2, 3));
  EXPECT_FALSE(entry.native_sampling_only);
  EXPECT_EQ(entry.default_filter, 7);
  EXPECT_EQ(entry.licence, "MIT");
  EXPECT_EQ(entry.command, "make it");
}

std::string with(const std::string& text, const std::string& from, const std::string& to) {
  return std::string(text).replace(text.find(from), from.size(), to);
}

TEST_F(Manifest, OneNameMayHaveSeveralLayersOfOneFile) {
  const std::string entry = std::string(kEntry).substr(8);
  const std::string deep = with(with(entry, "layer: stem", "layer: deep"), "stride: 2",
                                "sampling: native\n    stride: 2");
  const auto entries = load_manifest(folder.file("manifest.yaml", kEntry + deep));
  ASSERT_TRUE(entries) << entries.error().message;
  ASSERT_EQ(entries->size(), 2U);
  EXPECT_TRUE(entries->back().native_sampling_only);
  EXPECT_EQ(error_of(kEntry + with(deep, "file: one", "file: two")),
            ":15: file: expected one.onnx with the same sha256 as the other layers of 'one', found "
            "two.onnx");
  EXPECT_EQ(error_with("stride: 2", "sampling: dense\n    stride: 2"),
            ":9: sampling: expected one of any, native, found 'dense'");
}

TEST_F(Manifest, UnknownMissingAndDuplicatedKeysNameTheLine) {
  EXPECT_THAT(error_with("    stride: 2\n", "    strides: 2\n"),
              StartsWith(":9: strides: unknown key; known keys: name, file, "));
  EXPECT_EQ(error_with("    stride: 2\n", ""), ":2: missing key 'stride'");
  EXPECT_EQ(error_with("    stride: 2\n", "    stride: 2\n    stride: 4\n"),
            ":10: stride: duplicated key; it stands on line 9 already");
  const std::string entry = std::string(kEntry).substr(8);
  EXPECT_EQ(error_of(kEntry + entry), ":14: name: 'one' with layer 'stem' stands here twice");
  EXPECT_EQ(error_of("models: []\nmodels: []\n"), ":1: expected the one key 'models'");
  EXPECT_EQ(error_of("models: []\nmore: 1\n"), ":1: expected the one key 'models'");
}

TEST_F(Manifest, WrongValuesNameTheLine) {
  EXPECT_EQ(error_with("filters: 16", "filters: many"),
            ":7: filters: expected a whole number, found 'many'");
  EXPECT_EQ(error_with("filters: 16", "filters: 99999999999"),
            ":7: filters: expected a whole number, found '99999999999'");
  EXPECT_EQ(error_with("stride: 2", "stride: 0"),
            ":9: stride: expected a whole number from 1 to 256, found 0");
  EXPECT_EQ(error_with("[4, 5]", "4"),
            ":8: kernel: expected a list of numbers like [100, 200], found '4'");
  EXPECT_EQ(error_with("[4, 5]", "[4, 5.5]"), ":8: kernel: expected a list of 2 whole numbers");
  EXPECT_EQ(error_with("[4, 5]", "[4]"), ":8: kernel: expected a list of 2 whole numbers");
  EXPECT_EQ(error_with("[4, 5]", "[4, .nan]"), ":8: kernel: expected a number, found '.nan'");
  EXPECT_EQ(error_with("[0, 1, 2, 3]", "[0, 1, 2, -3]"),
            ":10: padding: expected a number from 0 to 4096, found -3");
  EXPECT_EQ(error_with("[0, 1, 2, 3]", "[0, 1, 4, 3]"),
            ":10: padding: expected less than the kernel (4), found 4");
  EXPECT_EQ(error_with("default_filter: 7", "default_filter: 16"),
            ":11: default_filter: expected 0 to 15, found 16");
  EXPECT_EQ(error_with("licence: MIT", "licence:"),
            ":12: licence: expected one value, found nothing");
  EXPECT_EQ(error_with("file: one.onnx", "file: ../one.onnx"),
            ":3: file: expected a name beside the manifest, found '../one.onnx'");
  EXPECT_EQ(error_with("name: one", "name: gray"),
            ":2: name: 'gray' means something else in stem.model");
  EXPECT_EQ(error_with("sha256: 01", "sha256: XY"),
            ":4: sha256: expected 64 digits 0-9 and a-f, found 64 characters");
}

TEST_F(Manifest, OtherDocumentsAreRefused) {
  EXPECT_EQ(error_of(""), ":1: expected the one key 'models'");
  EXPECT_EQ(error_of("- 1\n"), ":1: expected the one key 'models'");
  EXPECT_EQ(error_of("models: 3\n"), ":1: models: expected a list of models");
  EXPECT_THAT(error_of("models:\n  - name: [\n"), HasSubstr("not YAML"));
  EXPECT_EQ(error_of("models:\n  - 3\n"), ":2: expected keys with values, found a value");
  EXPECT_EQ(load_manifest(folder / "absent.yaml").error().message,
            (folder / "absent.yaml").string() +
                ": cannot read: No such file or directory; check the path");
  EXPECT_THAT(load_manifest(folder.path()).error().message, HasSubstr("found a folder"));
}

TEST(Sha256, StandardVectors) {  // FIPS 180-4, examples of NIST
  EXPECT_EQ(internal::sha256_hex("abc"),
            "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad");
  EXPECT_EQ(internal::sha256_hex(""),
            "e3b0c44298fc1c149afbf4c8996fb92427ae41e4649b934ca495991b7852b855");
  const internal::Sha256 beginning("a");
  EXPECT_EQ(beginning.hex("bc"), internal::sha256_hex("abc"));
  EXPECT_EQ(beginning.hex("b"), internal::sha256_hex("ab"));
}

TEST(CheckModel, FindsTheFirstThingThatIsWrong) {
  const testing::TempFolder folder;
  testing::write_models(folder, testing::kPadded3);
  const auto entries = load_manifest(folder / "manifest.yaml");
  ASSERT_TRUE(entries) << entries.error().message;
  const ModelEntry good = entries->front();
  const auto error_of = [&](auto change) {
    ModelEntry entry = good;
    change(entry);
    const Status status = check_model(entry);
    return status ? "no error" : status.error().message;
  };
  EXPECT_EQ(error_of([](ModelEntry&) {}), "no error");
  EXPECT_THAT(error_of([](ModelEntry& e) { e.file += ".gone"; }), HasSubstr("cannot read"));
  EXPECT_THAT(error_of([](ModelEntry& e) { e.sha256[0] = e.sha256[0] == '0' ? '1' : '0'; }),
              HasSubstr(", found " + good.sha256));
  EXPECT_THAT(error_of([](ModelEntry& e) { e.num_filters = 4; }),
              HasSubstr("expected 4 filters, found 3"));
  EXPECT_THAT(error_of([](ModelEntry& e) { e.stride_px = 1; }), HasSubstr("expected channels of"));
  EXPECT_THAT(error_of([](ModelEntry& e) { e.kernel_px = {5, 5}; }),
              HasSubstr("expected channels of"));
  // The same sizes, but another pixel map: only the values can tell.
  EXPECT_THAT(error_of([](ModelEntry& e) { e.padding_px = {1, 0, 1, 2}; }),
              HasSubstr("found that pixels outside it matter"));
  EXPECT_THAT(error_of([](ModelEntry& e) {
                e.kernel_px = {4, 3};
                e.padding_px = {1, 1, 2, 1};
              }),
              HasSubstr("found that its last row does not matter"));
}

}  // namespace
}  // namespace stemvo
