// SPDX-License-Identifier: MIT
#include <nlohmann/json.hpp>

#include "html/page.hpp"
#include "support/report_content.hpp"
#include "support/test.hpp"
#include "text/text_file.hpp"

namespace stemvo::html {
namespace {

using Json = nlohmann::ordered_json;

class HtmlPage : public ::testing::Test {
 protected:
  std::string written(const Json& content) {
    EXPECT_TRUE(write_page(folder_ / "page.html", content));
    return read_text_file(folder_ / "page.html").value_or("");
  }

  TempFolder folder_;
};

TEST_F(HtmlPage, TextFromOutsideStaysText) {
  const std::string hostile = "</script><script>alert(1)</script> {{plotly}} \"' \xff <!--";
  const std::string text = written({{"page", "run"}, {"title", hostile}});
  EXPECT_THAT(text, Not(HasSubstr("alert(1)</script>")));
  EXPECT_THAT(text, Not(HasSubstr("<!--\""))) << "a comment would swallow the rest";
  EXPECT_THAT(text, HasSubstr("{{plotly}}")) << "a place of the template is filled in once";
  EXPECT_EQ(report_content(text)["title"],
            "</script><script>alert(1)</script> {{plotly}} \"' \xef\xbf\xbd <!--");
}

TEST_F(HtmlPage, ImagesAreInIt) {
  EXPECT_EQ(images_json({{"frame 1", "\xff\xd8\x01", 7}})[0],
            (Json{{"row", 7}, {"caption", "frame 1"}, {"jpeg", "/9gB"}}));
}

TEST_F(HtmlPage, PathsAreRoundedAndWhatIsNotFiniteIsNull) {
  std::vector<Rigid3> poses(2);
  poses[0].translation = {1.234567, -2.0, 3.0};
  poses[1].translation.x() = std::nan("");
  const std::string text = written({{"page", "run"}, {"path", path_json(poses)}});
  const nlohmann::json path = report_content(text)["path"];
  EXPECT_EQ(path["x"], nlohmann::json({1.23457, nullptr}));
  EXPECT_EQ(path["y"], nlohmann::json({-2.0, 0.0}));
  EXPECT_EQ(path["z"], nlohmann::json({3.0, 0.0}));
}

TEST_F(HtmlPage, NeedsNothingFromElsewhereAndNamesTheLicence) {
  const std::string text = written(Json::object());
  for (const char* elsewhere : {"src=\"http", "href=\"http", "@import", "url("}) {
    EXPECT_THAT(text, Not(HasSubstr(elsewhere)));
  }
  EXPECT_THAT(text, HasSubstr("Plotly"));
  EXPECT_THAT(text, HasSubstr("Permission is hereby granted, free of charge"));
  EXPECT_THAT(text, Not(HasSubstr("@STEMVO"))) << "a place that the build fills in";
}

TEST_F(HtmlPage, AFileThatCannotBeWrittenIsAnError) {
  EXPECT_THAT(write_page("/dev/full", Json::object()).error().message, HasSubstr("/dev/full"));
}

}  // namespace
}  // namespace stemvo::html
