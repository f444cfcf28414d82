// SPDX-License-Identifier: MIT
#pragma once

#include <filesystem>

namespace stemvo::bench {

/// The default model at its samplings, gray, and every .onnx of a folder.
void register_stems(const std::filesystem::path& models);

}  // namespace stemvo::bench
