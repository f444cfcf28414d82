// SPDX-License-Identifier: MIT
#pragma once

#include <unistd.h>

#include "support/program_test.hpp"
#include "support/test.hpp"

/// Faults of files, and that the program refuses them.
namespace stemvo {

/// A call of the program, and the word its one line must hold.
struct Case {
  std::string name;
  Words arguments;
  std::string word;
};

/// Each ends with 1 and one line, within ten seconds, by no crash and no bug of ours.
inline void expect_refused(const std::vector<Case>& cases) {
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

inline std::string replace_first(std::string text, const std::string& from, const std::string& to) {
  const std::size_t at = text.find(from);
  return at == text.npos ? to : text.replace(at, from.size(), to);
}

/// `number`: one of the file's, as it stands there.
inline std::vector<Fault> faults(const std::string& number) {
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
      {"zeros", with([](const std::string&) { return std::string(5000, '\0'); })},
      {"one long word", with([](const std::string&) { return std::string(1 << 20, 'x'); })},
      {"open brackets", with([](const std::string&) { return std::string(100000, '['); })},
      {"NaN", with_number("nan")},
      {"infinity", with_number("inf")},
      {"1e300", with_number("1e300")},
      {"1e999", with_number("1e999")},
      {"hexadecimal", with_number("0x1p3")},
      {"decimal comma", with_number("1,5 ,")},
      {"a word", with_number("street")},
      {"folder",
       [](const fs::path& file) {
         fs::remove(file);
         fs::create_directory(file);
       }},
      {"missing", [](const fs::path& file) { fs::remove(file); }},
      {"link to nowhere",
       [](const fs::path& file) {
         fs::remove(file);
         fs::create_symlink("none", file);
       }},
      {"device",
       [](const fs::path& file) {
         fs::remove(file);
         fs::create_symlink("/dev/zero", file);
       }},
      {"unreadable",
       [](const fs::path& file) {
         ::geteuid() == 0 ? static_cast<void>(fs::remove(file))
                          : fs::permissions(file, fs::perms::none);
       }},
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

}  // namespace stemvo
