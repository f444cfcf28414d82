// SPDX-License-Identifier: MIT
#include <fmt/core.h>

#include "stemvo/config.hpp"

int main() { fmt::print("{}", stemvo::dump_config({})); }
