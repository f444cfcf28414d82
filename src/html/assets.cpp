// SPDX-License-Identifier: MIT
#include "html/assets.hpp"

// The assembler puts the files into the program as they are: as arrays of C++ they would take
// longer to compile than everything else.
#define STEMVO_ASSET(name, file)                                   \
  __asm__(                                                         \
      ".section .rodata\n"                                         \
      ".globl " #name                                              \
      "_begin\n"                                                   \
      ".hidden " #name "_begin\n" #name "_begin:\n.incbin \"" file \
      "\"\n"                                                       \
      ".globl " #name                                              \
      "_end\n"                                                     \
      ".hidden " #name "_end\n" #name                              \
      "_end:\n"                                                    \
      ".previous\n");                                              \
  extern "C" const char name##_begin[];                            \
  extern "C" const char name##_end[]

STEMVO_ASSET(stemvo_page_html, STEMVO_PAGE_HTML);
STEMVO_ASSET(stemvo_plotly_gz, STEMVO_PLOTLY_GZ);

namespace stemvo::html {

std::string_view page_template() { return {stemvo_page_html_begin, stemvo_page_html_end}; }
std::string_view plotly_gz() { return {stemvo_plotly_gz_begin, stemvo_plotly_gz_end}; }

}  // namespace stemvo::html
