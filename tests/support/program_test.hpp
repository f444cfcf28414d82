// SPDX-License-Identifier: MIT
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "support/drives.hpp"
#include "support/run_program.hpp"

/// What tests of whole programs call by short names.
namespace stemvo {

namespace fs = std::filesystem;
using test::ProgramResult;
using test::read_file;
using test::run_stemvo;
using test::TemporaryFolder;
using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;
using ::testing::StartsWith;

}  // namespace stemvo
