// SPDX-License-Identifier: MIT
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "html/figures.hpp"
#include "html/page.hpp"
#include "support/temp_folder.hpp"
#include "text/text_file.hpp"

namespace stemvo::html {
namespace {

using nlohmann::json;
using ::testing::HasSubstr;
using ::testing::Not;

class HtmlPage : public ::testing::Test {
 protected:
  std::string written(const Page& page) {
    EXPECT_TRUE(page.write(folder_ / "page.html"));
    return read_text_file(folder_ / "page.html").value_or("");
  }
  /// What the page's script reads.
  json content(const Page& page) {
    const std::string text = written(page);
    const std::string begin = "<script type=\"application/json\" id=\"content\">";
    const std::size_t at = text.find(begin) + begin.size();
    return json::parse(text.substr(at, text.find("</script>", at) - at));
  }

  testing::TempFolder folder_;
};

TEST_F(HtmlPage, HoldsTheSectionsInTheirOrder) {
  Page page("a drive", "numbers");
  page.set_frames({"frame 0", "frame 1"});
  const json traces = {{{"x", {1, 2}}, {"y", {3, 4}}}};
  const json layout = {{"xaxis", {{"type", "log"}}}};
  page.add_figure({"a figure", "seen from above", traces, layout, 0});
  page.add_text("a table", "a  1\nb  2\n");
  page.add_folded_text("a file", "key: value");
  page.add_images("images", {{"frame 1", "\xff\xd8\x01"}});

  const json found = content(page);
  EXPECT_EQ(found["title"], "a drive");
  EXPECT_EQ(found["subtitle"], "numbers");
  EXPECT_EQ(found["frames"], json({"frame 0", "frame 1"}));
  ASSERT_EQ(found["sections"].size(), 4U);
  EXPECT_EQ(found["sections"][0]["traces"], traces);
  EXPECT_EQ(found["sections"][0]["layout"], layout);
  EXPECT_EQ(found["sections"][0]["frame_trace"], 0);
  EXPECT_EQ(found["sections"][1]["text"], "a  1\nb  2\n");
  EXPECT_EQ(found["sections"][2]["folded"], true);
  EXPECT_EQ(found["sections"][3]["images"][0]["jpeg"], "/9gB");
}

TEST_F(HtmlPage, TextFromOutsideStaysText) {
  const std::string hostile = "</script><script>alert(1)</script> {{plotly}} \xff <!--";
  Page page(hostile, hostile);
  page.add_text(hostile, hostile);
  const std::string text = written(page);
  EXPECT_THAT(text, Not(HasSubstr("alert(1)</script>")));
  EXPECT_THAT(text, HasSubstr("{{plotly}}")) << "a place of the template is filled in once";
  const std::string readable = "</script><script>alert(1)</script> {{plotly}} \xef\xbf\xbd <!--";
  EXPECT_EQ(content(page)["title"], readable);
  EXPECT_EQ(content(page)["sections"][0]["text"], readable);
}

// plotly.js would make the first bold and show an entity's letter for the second.
TEST_F(HtmlPage, NamesInFiguresAreShownAsTheyAre) {
  Page page("a drive");
  const json traces = {
      {{"name", "<b>a</b> &deg;"}, {"x", {"a & b", 1.5, nullptr}}, {"text", {"a\nb"}}}};
  const json layout = {{"xaxis", {{"title", {{"text", "x < y"}}}}}};
  page.add_figure({"a figure", "", traces, layout});
  const json found = content(page)["sections"][0];
  EXPECT_EQ(found["traces"][0]["name"], "&lt;b&gt;a&lt;/b&gt; &amp;deg;");
  EXPECT_EQ(found["traces"][0]["x"], json({"a &amp; b", 1.5, nullptr}));
  EXPECT_EQ(found["traces"][0]["text"][0], "a<br>b");
  EXPECT_EQ(found["layout"]["xaxis"]["title"]["text"], "x &lt; y");
}

// There are more paths than colours.
TEST_F(HtmlPage, DottedPathsAreToldFromTheOthers) {
  Page page("a drive");
  add_paths_from_above(page, "paths", "", {{"a", {{0, 1}}}, {"b", {{0, 1}}, false, true}});
  const json traces = content(page)["sections"][0]["traces"];
  EXPECT_FALSE(traces[0]["line"].contains("dash"));
  EXPECT_EQ(traces[1]["line"]["dash"], "dot");
}

TEST_F(HtmlPage, NeedsNothingFromElsewhereAndNamesTheLicence) {
  const std::string text = written(Page("a drive"));
  for (const char* elsewhere : {"src=\"http", "href=\"http", "@import", "url("}) {
    EXPECT_THAT(text, Not(HasSubstr(elsewhere)));
  }
  EXPECT_THAT(text, HasSubstr("Plotly"));
  EXPECT_THAT(text, HasSubstr("Permission is hereby granted, free of charge"));
}

TEST_F(HtmlPage, AFileThatCannotBeWrittenIsAnError) {
  EXPECT_THAT(Page("a drive").write("/dev/full").error().message, HasSubstr("/dev/full"));
}

}  // namespace
}  // namespace stemvo::html
