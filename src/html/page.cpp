// SPDX-License-Identifier: MIT
#include "html/page.hpp"

#include <cmath>
#include <string_view>
#include <utility>

#include <nlohmann/json.hpp>
#include <openssl/evp.h>

#include "text/text_file.hpp"

// The assembler puts the files into the program as they are: as arrays of C++ they would take
// longer to compile than everything else.
#define STEMVO_ASSET(name, file)                                                    \
  __asm__(".section .rodata\n.globl " #name "_begin, " #name "_end\n.hidden " #name \
          "_begin, " #name "_end\n" #name "_begin:\n.incbin \"" file "\"\n" #name   \
          "_end:\n.previous\n");                                                    \
  extern "C" const char name##_begin[];                                             \
  extern "C" const char name##_end[]

STEMVO_ASSET(stemvo_page_html, STEMVO_PAGE_HTML);
STEMVO_ASSET(stemvo_plotly_gz, STEMVO_PLOTLY_GZ);

namespace stemvo::html {
namespace {

using Json = nlohmann::ordered_json;

std::string base64(std::string_view bytes) {
  std::string text(4 * ((bytes.size() + 2) / 3) + 1, '\0');  // and a final zero
  const int size = EVP_EncodeBlock(reinterpret_cast<unsigned char*>(text.data()),
                                   reinterpret_cast<const unsigned char*>(bytes.data()),
                                   static_cast<int>(bytes.size()));
  text.resize(static_cast<std::size_t>(size));
  return text;
}

/// JSON inside a script element: no text in it can end the element.
std::string script_json(const Json& content) {
  const std::string json = content.dump(-1, ' ', false, Json::error_handler_t::replace);
  std::string text;
  for (const char letter : json) {
    text += letter == '<' ? "\\u003c" : std::string(1, letter);
  }
  return text;
}

void fill_in(std::string& page, std::string_view place, std::string_view value) {
  page.replace(page.find(place), place.size(), value);
}

}  // namespace

Json images_json(const std::vector<CaptionedImage>& images) {
  Json list = Json::array();
  for (const CaptionedImage& image : images) {
    list.push_back({{"row", image.row}, {"caption", image.caption}, {"jpeg", base64(image.jpeg)}});
  }
  return list;
}

Json path_json(std::span<const Rigid3> poses) {
  Json path;
  for (const auto& [name, axis] : {std::pair("x", 0), std::pair("y", 1), std::pair("z", 2)}) {
    Json& values = path[name] = Json::array();
    for (const Rigid3& pose : poses) {
      values.push_back(std::round(pose.translation[axis] * 1e5) / 1e5);  // null where not finite
    }
  }
  return path;
}

Status write_page(const std::filesystem::path& file, const Json& content) {
  std::string page(stemvo_page_html_begin, stemvo_page_html_end);
  fill_in(page, "{{plotly}}", base64({stemvo_plotly_gz_begin, stemvo_plotly_gz_end}));
  fill_in(page, "{{content}}", script_json(content));  // last: it may hold any text
  return write_text_file(file, page);
}

}  // namespace stemvo::html
