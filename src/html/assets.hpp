// SPDX-License-Identifier: MIT
#pragma once

#include <string_view>

namespace stemvo::html {

/// src/html/page.html, with the places that HtmlPage fills in.
[[nodiscard]] std::string_view page_template();
/// plotly.min.js, packed by gzip, as `make build` fetched it.
[[nodiscard]] std::string_view plotly_gz();
/// Its licence, whole.
[[nodiscard]] std::string_view plotly_licence();

}  // namespace stemvo::html
