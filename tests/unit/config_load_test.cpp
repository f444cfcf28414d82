// SPDX-License-Identifier: MIT
#include "config/config.hpp"
#include "options/visit.hpp"
#include "support/test.hpp"

namespace stemvo {
namespace {

class ConfigLoad : public ::testing::Test {
 protected:
  Expected<Config> load(const std::string& text) { return load_config(write(text)); }
  std::filesystem::path write(const std::string& text) { return folder_.file("config.yaml", text); }
  /// The error without the folder: "<name>.yaml:3: ...".
  std::string error_of(const std::string& text) {
    const Expected<Config> config = load(text);
    if (config) {
      return "no error";
    }
    EXPECT_THAT(config.error().message, Not(HasSubstr("\n")));
    EXPECT_THAT(config.error().message, StartsWith(file_.string()));
    return config.error().message.substr(file_.string().size());
  }

  TempFolder folder_;
  const std::filesystem::path file_ = folder_ / "config.yaml";
};

TEST_F(ConfigLoad, ReadsEveryKindOfValueOverTheDefaults) {
  const Expected<Config> config = load(
      "stem:\n  model: input_layer\n  filter: 010\n"
      "two_view:\n  refine: false\n  sigma_px: 2.5\n"
      "evaluation:\n  segment_lengths_m: [10, 20.5]\n"
      "seed: 18446744073709551615\n");
  EXPECT_EQ(config->stem.model, "input_layer");
  EXPECT_EQ(config->stem.filter, 10) << "decimal";
  EXPECT_FALSE(config->two_view.refine);
  EXPECT_EQ(config->two_view.sigma_px, 2.5);
  EXPECT_THAT(config->evaluation.segment_lengths_m, ::testing::ElementsAre(10.0, 20.5));
  EXPECT_EQ(config->seed, std::numeric_limits<std::uint64_t>::max());
  EXPECT_EQ(config->features.method, Config{}.features.method);
}

TEST_F(ConfigLoad, EmptyFileAndEmptySectionAreTheDefaults) {
  EXPECT_EQ(dump_config(load("").value()), dump_config({}));
  EXPECT_EQ(dump_config(load("stem:\n# filter: 3\n").value()), dump_config({}));
}

TEST_F(ConfigLoad, TheScaleHasSourcesThatTheLibraryDoesNotKnow) {
  EXPECT_EQ(scale_source({}), "auto");
  for (const char* name : {"auto", "none", "constant_speed", "camera_height", "ground_truth"}) {
    const auto config = load(std::string("scale:\n  source: ") + name);
    EXPECT_EQ(scale_source(*config), name);
    EXPECT_THAT(dump_config(*config), HasSubstr(std::string("  source: ") + name + "\n"));
    const bool is_programs = *name == 'a' || *name == 'g';
    EXPECT_EQ(options::to_string(config->scale.source), is_programs ? "none" : name);
  }
}

TEST_F(ConfigLoad, TellsWhichKeysAFileSets) {
  const auto config = load_config(write("stem:\n  filter: 3\nscale:\n# source: none\nseed: 2\n"));
  EXPECT_THAT(config->keys_in_file, ::testing::ElementsAre("seed", "stem.filter"));
  EXPECT_THAT(config->keys_overridden, ::testing::IsEmpty());
  EXPECT_THAT(load_config(write(""))->keys_in_file, ::testing::IsEmpty());
  Config changed = *config;
  ASSERT_TRUE(apply_override(changed, "scale.source=none"));
  EXPECT_THAT(changed.keys_overridden, ::testing::ElementsAre("scale.source"));
}

TEST_F(ConfigLoad, UnknownKeyNamesLineAndKnownKeys) {
  EXPECT_THAT(error_of("stem:\n  model: gray\n  filtre: 3\n"),
              StartsWith(":3: stem.filtre: unknown key; known keys of stem: model, filter, "));
  EXPECT_THAT(
      error_of("\nstm:\n  filter: 3\n"),
      AllOf(StartsWith(":2: stm: unknown key; known keys: input, evaluation, stem, features, "),
            EndsWith(", scale, seed, threads")));
}

TEST_F(ConfigLoad, DuplicatedKeyNamesBothLines) {
  EXPECT_THAT(error_of("stem:\n  filter: 3\n  filter: 4\n"),
              StartsWith(":3: stem.filter: duplicated key; it stands on line 2 already"));
  EXPECT_THAT(error_of("stem:\n  filter: 3\nseed: 1\nstem:\n  model: gray\n"),
              StartsWith(":4: stem: duplicated key; it stands on line 1 already"));
}

TEST_F(ConfigLoad, WrongValuesAreNamedWithTheirLine) {
  for (const auto& [text, error] : {
           std::pair("stem:\n  filter: ten\n",
                     ":2: stem.filter: expected a whole number, found 'ten'"),
           {"stem:\n  filter: 1.5\n", ":2: stem.filter: expected a whole number, found '1.5'"},
           {"stem:\n  filter: [1]\n", ":2: stem.filter: expected one value, found a list"},
           {"stem:\n  filter:\n", ":2: stem.filter: expected one value, found nothing"},
           {"stem: 3\n", ":1: stem: expected keys with values, found a value"},
           {"- 1\n- 2\n", ":1: expected keys with values, found a list"},
           {"two_view:\n  refine: yes\n",
            ":2: two_view.refine: expected true or false, found 'yes'"},
           {"evaluation:\n  segment_lengths_m: 10, 20\n",
            ":2: evaluation.segment_lengths_m: expected a list of numbers like [100, 200], found "
            "a value"},
           {"evaluation:\n  segment_lengths_m: [10, [20]]\n",
            ":2: evaluation.segment_lengths_m: expected one value, found a list"},
           {"seed: 1\nstem:\n  filter: -2\n",
            ":3: stem.filter: expected a whole number from -1 to 1000000, found -2"},
           {"features:\n  method: surf\n",
            ":2: features.method: expected one of patch, klt, orb, sift, found 'surf'"},
           {"features:\n  klt_window: 20\n",
            ":2: features.klt_window: expected a whole number odd, from 3 to 201, found 20"},
           {"scale:\n  step_m: nan\n",
            ":2: scale.step_m: expected a number from 1e-06 to 1000000, found nan"},
           {"scale:\n  step_m: inf\n",
            ":2: scale.step_m: expected a number from 1e-06 to 1000000, found inf"},
           {"seed: -1\n", ":1: seed: expected a whole number of at least 0, found '-1'"},
           {"stem:\n  filter: 99999999999\n",
            ":2: stem.filter: expected a whole number, found '99999999999'"},
       }) {
    EXPECT_EQ(error_of(text), error);
  }
}

TEST_F(ConfigLoad, NotYamlNamesTheLine) {
  EXPECT_THAT(error_of("seed: 1\nstem: [1,\n"), StartsWith(":3: not YAML: "));
  EXPECT_THAT(error_of("seed: 1\n---\nseed: 2\n"),
              HasSubstr(":2: not YAML: expected one document, found more behind it"));
  // yaml-cpp's LoadAll never ends here.
  for (const char* text :
       {"seed: 1\n...\nseed: 2\n", "{seed: 1}\nstem: {filter: 3}\n", "{stem: {filter: 3}},\n"}) {
    EXPECT_THAT(error_of(text), HasSubstr("more behind it")) << text;
  }
  EXPECT_THAT(error_of(std::string("\x89PNG\r\n\x1a\n\0\0", 10)), HasSubstr(": not YAML: "));
}

TEST_F(ConfigLoad, DumpReadsBackToTheSameBits) {
  Config config;
  config.stem.model = "models/a b: \"c\" #\n\xc3\xa9.onnx";
  config.two_view.sigma_px = 0.1 + 0.2;
  config.two_view.refine_loss_px = std::nextafter(1.0, 2.0);
  config.scale.step_m = 1e-6;
  config.scale.camera_height_m = 1e3 / 7.0;
  config.evaluation.segment_lengths_m = {1.0 / 3.0, 5.0};
  config.seed = std::numeric_limits<std::uint64_t>::max();
  const Expected<Config> read = load(dump_config(config));
  EXPECT_EQ(read->stem.model, config.stem.model);
  EXPECT_EQ(read->two_view.sigma_px, config.two_view.sigma_px);
  EXPECT_EQ(read->two_view.refine_loss_px, config.two_view.refine_loss_px);
  EXPECT_EQ(read->scale.step_m, config.scale.step_m);
  EXPECT_EQ(read->evaluation.segment_lengths_m, config.evaluation.segment_lengths_m);
  EXPECT_EQ(dump_config(*read), dump_config(config));
  for (const char* model : {"null", "~", "10", "true", "-", "- a", "a: b", "#x"}) {
    config.stem.model = model;
    const Expected<Config> again = load(dump_config(config));
    EXPECT_EQ(again->stem.model, model);
  }
}

TEST(ConfigOverride, SetsOneKey) {
  Config config;
  ASSERT_TRUE(apply_override(config, "stem.filter=10"));
  ASSERT_TRUE(apply_override(config, "stem.model=models/odd: name=1.onnx"));
  ASSERT_TRUE(apply_override(config, "evaluation.segment_lengths_m=[10,20]"));
  ASSERT_TRUE(apply_override(config, "seed=7"));
  EXPECT_EQ(config.stem.filter, 10);
  EXPECT_EQ(config.stem.model, "models/odd: name=1.onnx");
  EXPECT_THAT(config.evaluation.segment_lengths_m, ::testing::ElementsAre(10.0, 20.0));
  EXPECT_EQ(config.seed, 7U);
  ASSERT_TRUE(apply_override(config, "evaluation.segment_lengths_m=[]"));
  EXPECT_TRUE(config.evaluation.segment_lengths_m.empty());
}

TEST(ConfigOverride, ErrorsAreOneLineAndLeaveTheConfigAlone) {
  Config config;
  const auto error_of = [&config](const std::string& assignment) {
    const Status status = apply_override(config, assignment);
    EXPECT_EQ(dump_config(config), dump_config({}));
    return message_of(status);
  };
  EXPECT_THAT(error_of("stem.filtre=1"),
              StartsWith("--set stem.filtre: unknown key; known keys of stem: model, "));
  EXPECT_THAT(error_of("stm=1"), AllOf(StartsWith("--set stm: unknown key; known keys: input, "),
                                       EndsWith(", scale, seed, threads")));
  EXPECT_THAT(error_of("stem.filtre=1"), EndsWith("; did you mean stem.filter?"));
  EXPECT_THAT(error_of("max_feature=1"), EndsWith("; did you mean features.max_features?"));
  EXPECT_THAT(error_of("colour=1"), Not(HasSubstr("did you mean")));
  EXPECT_THAT(error_of("stem=1"), StartsWith("--set stem: unknown key; known keys: input, "));
  EXPECT_THAT(error_of("stem.filter"), HasSubstr("expected key=value"));
  EXPECT_EQ(error_of("stem.filter=a"), "--set stem.filter: expected a whole number, found 'a'");
  EXPECT_EQ(error_of("scale.source=gps"),
            "--set scale.source: expected one of auto, none, constant_speed, camera_height, "
            "ground_truth, found 'gps'");
  EXPECT_EQ(error_of("stem.model="), "--set stem.model: expected a text, found nothing");
  EXPECT_EQ(
      error_of("evaluation.segment_lengths_m=[10,-20]"),
      "--set evaluation.segment_lengths_m: expected a number from 0.01 to 1000000, found -20");
  EXPECT_THAT(error_of("evaluation.segment_lengths_m=[10"), HasSubstr("not YAML"));
}

TEST(ConfigValidate, PercentilesMustBeInOrder) {
  Config config;
  config.stem.contrast_low_percent = 99.9;
  ASSERT_FALSE(validate(config));
  EXPECT_THAT(validate(config).error().message,
              StartsWith("stem.contrast_low_percent: expected less than "));
}

TEST(ConfigFiles, DefaultYamlIsWhatTheProgramWrites) {
  EXPECT_EQ(read_all(STEMVO_SOURCE_DIR "/config/default.yaml"), dump_config({}))
      << "config/default.yaml is stale: run 'stemvo --dump-config > config/default.yaml'";
}

}  // namespace
}  // namespace stemvo
