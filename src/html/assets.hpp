// SPDX-License-Identifier: MIT
#pragma once

#include <string_view>

namespace stemvo::html {

/// page.html with the styles and scripts beside it and plotly.js' licence, and the places that
/// write_page() fills in.
[[nodiscard]] std::string_view page_template();
/// plotly.min.js, packed by gzip, as `make build` fetched it.
[[nodiscard]] std::string_view plotly_gz();

}  // namespace stemvo::html
