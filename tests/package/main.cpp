// SPDX-License-Identifier: MIT
#include <iostream>

#include <stemvo/stem/stem.hpp>
#include <stemvo/version.hpp>

int main(int argc, char** argv) {
  const auto stem = stemvo::Stem::create({}, argc > 1 ? argv[1] : "models");
  if (!stem) return std::cerr << stem.error().message << "\n", 1;
  std::cout << stemvo::version() << ": " << stem->info().num_filters << " filters\n";
}
