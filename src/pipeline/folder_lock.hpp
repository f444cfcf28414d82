// SPDX-License-Identifier: MIT
#pragma once

#include <filesystem>

#include "stemvo/error.hpp"

namespace stemvo::pipeline {

/// While it lives no other process writes into the folder, as far as it asks for this lock too. An
/// advisory lock of the folder itself: nothing lies in it, and the kernel lets go of it however the
/// process ends.
class FolderLock {
 public:
  /// Of a folder that is there. Error: another one has it. On a file system without locks it is
  /// taken without one.
  [[nodiscard]] static Expected<FolderLock> take(const std::filesystem::path& folder);

  FolderLock(FolderLock&& other) noexcept;
  FolderLock& operator=(FolderLock&& other) noexcept;
  ~FolderLock();

 private:
  explicit FolderLock(int descriptor) : descriptor_(descriptor) {}

  int descriptor_;  ///< -1: nothing to let go of
};

}  // namespace stemvo::pipeline
