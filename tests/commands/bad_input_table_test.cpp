// SPDX-License-Identifier: MIT
// Faults that any file may have, of each file that the program reads. What is wrong with one kind
// of file only is with the tests of its reader.
#include "support/program_test.hpp"
#include "support/test.hpp"
#include "support/tiny_stem.hpp"

namespace stemvo {
namespace {

/// A call of the program, and the word its one line must hold.
struct Case {
  std::string name;
  Words arguments;
  std::string word;
};

/// Each ends with 1 and one line, within ten seconds, by no crash and no bug of ours.
void expect_refused(const std::vector<Case>& cases) {
  for (const Case& one : cases) {
    const auto start = std::chrono::steady_clock::now();
    const ProgramResult result = run_stemvo(one.arguments);
    EXPECT_LT(std::chrono::steady_clock::now() - start, std::chrono::seconds(10)) << one.name;
    EXPECT_EQ(result.exit_code, 1) << one.name << ": " << result.err;
    EXPECT_THAT(result.err,
                AllOf(StartsWith("error: "), Not(HasSubstr("internal")), HasSubstr(one.word)))
        << one.name;
    EXPECT_EQ(std::ranges::count(result.err, '\n'), 1) << one.name << ": " << result.err;
  }
}

/// A name and what it does to a file.
using Fault = std::pair<std::string, std::function<void(const fs::path&)>>;

/// `number`: one of the file's, as it stands there.
std::vector<Fault> faults(const std::string& number) {
  const auto with = [](const auto& change) {
    return [change](const fs::path& file) { write_file(file, change(read_file(file))); };
  };
  const auto with_number = [&](const std::string& text) {
    return with([=](const std::string& whole) { return replace_first(whole, number, text); });
  };
  return {
      {"cut", with([](const std::string& whole) { return whole.substr(0, whole.size() / 2); })},
      {"binary", with([](const std::string&) {
         std::mt19937 random(1);
         std::string bytes(3000, '\0');
         std::ranges::generate(bytes, [&] { return static_cast<char>(random()); });
         return bytes;
       })},
      {"NaN", with_number("nan")},
      {"1e300", with_number("1e300")},
      {"decimal comma", with_number("1,5 ,")},
      {"a word", with_number("street")},
      {"folder",
       [](const fs::path& file) {
         fs::remove(file);
         fs::create_directory(file);
       }},
      {"missing", [](const fs::path& file) { fs::remove(file); }},
  };
}

class BadInputTable : public ::testing::Test {
 protected:
  /// Every fault but `spared`, which such a file may have, and `more`.
  void expect_refused_with_faults(const fs::path& file,
                                  const std::string& number,
                                  const Words& arguments,
                                  const Words& spared = {},
                                  const std::vector<Fault>& more = {}) {
    ASSERT_TRUE(fs::exists(file));
    const fs::path kept = file.string() + ".kept";
    fs::copy_file(file, kept);
    std::vector<Fault> all = faults(number);
    all.insert(all.end(), more.begin(), more.end());
    for (const auto& [name, damage] : all) {
      if (std::ranges::find(spared, name) == spared.end()) {
        damage(file);
        expect_refused(
            {{file.filename().string() + ", " + name, arguments, file.filename().string()}});
        fs::remove_all(file);
        fs::copy_file(kept, file);
      }
    }
  }
  static Fault text(const std::string& name, const std::string& content) {
    return {name, [content](const fs::path& file) { write_file(file, content); }};
  }
  static Fault large() {
    return {"70 MB", [](const fs::path& file) { fs::resize_file(file, 70000000); }};
  }
  [[nodiscard]] Words run() const {
    return {"run", sequence_.string(), "--out", folder_ / "out", "--quiet", "--frames", "0:1"};
  }

  TempFolder folder_;
  fs::path sequence_ = copy_drive(folder_.path(), 3);
};

TEST_F(BadInputTable, Calibration) {
  write_file(sequence_ / "calib.txt",
             "P0: 360 0 310 0 0 360 94 0 0 0 1 0\nP2: 361 0 310 0 0 361 94 0 0 0 1 0\n");
  expect_refused_with_faults(
      sequence_ / "calib.txt", "361", run(), {},
      {large(), text("tiny focal length", "P2: 1e-300 0 310 0 0 1e-300 94 0 0 0 1 0\n"),
       text("of images twice as large", "P2: 722 0 609 0 0 722 172 0 0 0 1 0\n"),
       text("a view of 172 degrees", "P2: 20 0 310 0 0 20 94 0 0 0 1 0\n"),
       text("negative focal length", "P2: -361 0 310 0 0 361 94 0 0 0 1 0\n")});
}

TEST_F(BadInputTable, Poses) {
  write_file(folder_ / "truth.txt", "1 0 0 0.125 0 1 0 0 0 0 1 0\n1 0 0 0 0 1 0 0 0 0 1 1\n");
  fs::copy_file(folder_ / "truth.txt", folder_ / "estimate.txt");
  for (const char* name : {"truth.txt", "estimate.txt"}) {
    expect_refused_with_faults(
        folder_ / name, "0.125",
        {"evaluate", "--gt", folder_ / "truth.txt", folder_ / "estimate.txt"}, {},
        {large(), text("1e160", "1 0 0 1e160 0 1 0 0 0 0 1 0\n1 0 0 0 0 1 0 0 0 0 1 1\n")});
  }
}

TEST_F(BadInputTable, OnePoseIsNotCompared) {
  write_file(folder_ / "one.txt", "1 0 0 0 0 1 0 0 0 0 1 0\n");
  const ProgramResult result =
      run_stemvo({"evaluate", "--gt", folder_ / "one.txt", folder_ / "one.txt"});
  expect_error(result, 1, {"one.txt: expected at least 2 poses"});
}

TEST_F(BadInputTable, TumPoses) {
  write_file(folder_ / "truth.txt", "1 0 0 0 0 1 0 0 0 0 1 0\n1 0 0 0 0 1 0 0 0 0 1 1\n");
  write_file(folder_ / "tum.txt", "1.5 0 0 0 0 0 0 1\n2.5 0 0 1 0 0 0 1\n");
  expect_refused_with_faults(folder_ / "tum.txt", "2.5",
                             {"evaluate", "--gt", folder_ / "truth.txt", folder_ / "tum.txt"}, {},
                             {text("no rotation", "1.5 0 0 0 0 0 0 1\n2.5 0 0 1 0 0 0 0\n"),
                              text("1e160", "1.5 0 0 1e160 0 0 0 1\n2.5 0 0 1 0 0 0 1\n")});
}

TEST_F(BadInputTable, Times) {
  write_file(sequence_ / "times.txt", "0.0\n0.125\n0.25\n");
  expect_refused_with_faults(sequence_ / "times.txt", "0.125", run(), {"cut"},
                             {large(), text("two columns", "0 1\n1 2\n2 3\n")});
}

TEST_F(BadInputTable, CameraFile) {
  write_file(
      folder_ / "camera.yaml",
      "image_width: 620\nimage_height: 188\nintrinsics: [360.5, 360, 310, 94]\n"
      "distortion_model: radial-tangential\ndistortion_coefficients: [0, 0, 0, 0]\nrate_hz: 10\n");
  const std::string good = read_file(folder_ / "camera.yaml");
  const auto with = [&](const std::string& from, const std::string& to) {
    return text(from + " -> " + to, replace_first(good, from, to));
  };
  expect_refused_with_faults(
      folder_ / "camera.yaml", "360.5",
      {"run", (sequence_ / "image_2").string(), "--camera", folder_ / "camera.yaml", "--out",
       folder_ / "out"},
      {},
      {with("188", "99999999999999999999"), with("[0, 0, 0, 0]", "[1e300, 0, 0, 0]"),
       text("a list", "- 1\n- 2\n"), text("a tab", "\t" + good)});
}

TEST_F(BadInputTable, ConfigurationFile) {
  write_file(folder_ / "my.yaml", "scale:\n  step_m: 1.5\n");
  expect_refused_with_faults(
      folder_ / "my.yaml", "1.5",
      {"run", folder_ / "none", "--out", folder_ / "out", "--config", folder_ / "my.yaml"},
      {"cut", "missing"},
      {text("an alias", "seed: *one\n"),
       text("a bomb", "a: &a [x, x, x]\nb: &b [*a, *a, *a]\nc: [*b, *b, *b]\n"),
       text("no end", "stem: {model: \"gray\n")});
}

TEST_F(BadInputTable, Model) {
  const std::string model = folder_ / "plain_k4s4.onnx";
  write_file(model, read_file(tiny_model("plain_k4s4")));
  expect_refused_with_faults(model, "weights", {"models", model}, {}, {text("empty", "")});
}

TEST_F(BadInputTable, MetricsAndThresholds) {
  write_file(folder_ / "metrics.json", "{\"t_rel_percent\": 0.875, \"segments\": null}\n");
  write_file(folder_ / "limits.yaml", "t_rel_percent: {max: 1.5}\n");
  const Words check = {"check", folder_ / "metrics.json", "--against", folder_ / "limits.yaml"};
  expect_refused_with_faults(folder_ / "metrics.json", "0.875", check, {"1e300"},
                             {text("more behind it", "{} {}")});
  expect_refused_with_faults(
      folder_ / "limits.yaml", "1.5", check, {},
      {text("two documents", "t_rel_percent: {max: 1}\n---\nt_rel_percent: {max: 2}\n")});
}

TEST_F(BadInputTable, Images) {
  const fs::path image = sequence_ / "image_2/000000.png";
  const std::string good = read_file(image);
  const auto with = [&](std::size_t at, const std::string& bytes) {
    return text(fmt::format("byte {}", at), std::string(good).replace(at, bytes.size(), bytes));
  };
  expect_refused_with_faults(
      image, "IDAT", run(), {},
      {text("empty", ""), text("signature alone", good.substr(0, 8)),
       text("header alone", good.substr(0, 33)), with(0, "x"), with(16, std::string("\0\0\0\0", 4)),
       with(16, "\xff\xff\xff\xff"), with(20, "\x7f\xff\xff\xff"), with(24, "\x07"),
       with(25, "\x09"), with(29, "xxxx"), with(good.size() / 2, "xxxx"),
       with(good.size() - 12, "\xff"), text("a JPEG", "\xff\xd8\xff\xe0 and no more")});
}

}  // namespace
}  // namespace stemvo
