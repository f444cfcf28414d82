// SPDX-License-Identifier: MIT
#pragma once

#include <string>

#include <CLI/CLI.hpp>

namespace stemvo::apps {

/// CLI11's help in lines of at most 80 characters; a command to copy stays whole.
class HelpFormat : public CLI::Formatter {
 public:
  std::string make_help(const CLI::App* app,
                        std::string name,
                        CLI::AppFormatMode mode) const override;
};

}  // namespace stemvo::apps
