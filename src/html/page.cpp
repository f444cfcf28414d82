// SPDX-License-Identifier: MIT
#include "html/page.hpp"

#include <memory>
#include <string_view>
#include <utility>

#include <nlohmann/json.hpp>
#include <openssl/evp.h>

#include "html/assets.hpp"
#include "internal_check.hpp"
#include "text/text_file.hpp"

namespace stemvo::html {
namespace {

using nlohmann::json;

std::string base64(std::string_view bytes) {
  std::string text(4 * ((bytes.size() + 2) / 3) + 1, '\0');  // and a final zero
  const int size = EVP_EncodeBlock(reinterpret_cast<unsigned char*>(text.data()),
                                   reinterpret_cast<const unsigned char*>(bytes.data()),
                                   static_cast<int>(bytes.size()));
  text.resize(static_cast<std::size_t>(size));
  return text;
}

/// plotly.js takes some HTML in names, hover texts and categories: here every letter is itself, and
/// a new line is one.
json literal(const json& value) {
  json result = value;
  if (value.is_structured()) {
    for (json& element : result) {
      element = literal(element);
    }
  } else if (value.is_string()) {
    std::string text;
    for (const char letter : value.get_ref<const std::string&>()) {
      text += letter == '&'    ? "&amp;"
              : letter == '<'  ? "&lt;"
              : letter == '>'  ? "&gt;"
              : letter == '\n' ? "<br>"
                               : std::string(1, letter);
    }
    result = std::move(text);
  }
  return result;
}

/// JSON inside a script element: no text in it can end the element.
std::string script_json(const json& content) {
  std::string text = content.dump(-1, ' ', false, json::error_handler_t::replace);
  for (std::size_t at = 0; (at = text.find('<', at)) != std::string::npos;) {
    text.replace(at, 1, "\\u003c");
  }
  return text;
}

/// Puts `value` in the place of `{{name}}`, which the template has once.
void fill_in(std::string& page, std::string_view name, std::string_view value) {
  const std::string place = "{{" + std::string(name) + "}}";
  const std::size_t at = page.find(place);
  STEMVO_CHECK(at != std::string::npos, "a place of the template");
  page.replace(at, place.size(), value);
}

}  // namespace

Page::Page(const std::string& title, const std::string& subtitle)
    : content_(std::make_unique<json>(json{{"title", title},
                                           {"subtitle", subtitle},
                                           {"frames", json::array()},
                                           {"sections", json::array()}})) {}
Page::Page(Page&&) noexcept = default;
Page& Page::operator=(Page&&) noexcept = default;
Page::~Page() = default;

void Page::set_frames(const std::vector<std::string>& descriptions) {
  (*content_)["frames"] = descriptions;
}

void Page::add_figure(const Figure& figure) {
  (*content_)["sections"].push_back({{"heading", figure.heading},
                                     {"note", figure.note},
                                     {"traces", literal(figure.traces)},
                                     {"layout", literal(figure.layout)},
                                     {"frame_trace", figure.frame_trace}});
}

void Page::add_images(const std::string& heading, const std::vector<CaptionedImage>& images) {
  json list = json::array();
  for (const CaptionedImage& image : images) {
    list.push_back({{"caption", image.caption}, {"jpeg", base64(image.jpeg)}});
  }
  (*content_)["sections"].push_back({{"heading", heading}, {"images", std::move(list)}});
}

void Page::add_text(const std::string& heading, const std::string& text) {
  (*content_)["sections"].push_back({{"heading", heading}, {"text", text}, {"folded", false}});
}

void Page::add_folded_text(const std::string& heading, const std::string& text) {
  (*content_)["sections"].push_back({{"heading", heading}, {"text", text}, {"folded", true}});
}

Status Page::write(const std::filesystem::path& file) const {
  std::string page(page_template());
  fill_in(page, "licence", plotly_licence());
  fill_in(page, "plotly", base64(plotly_gz()));
  fill_in(page, "content", script_json(*content_));  // last: it may hold any text
  return write_text_file(file, page);
}

}  // namespace stemvo::html
