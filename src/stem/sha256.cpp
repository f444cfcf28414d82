// SPDX-License-Identifier: MIT
#include <array>

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <openssl/evp.h>

#include "internal_check.hpp"
#include "stem/model_file.hpp"

namespace stemvo::internal {

std::string sha256_hex(std::string_view bytes) {
  std::array<unsigned char, 32> digest{};
  unsigned int size = 0;
  const int done =
      EVP_Digest(bytes.data(), bytes.size(), digest.data(), &size, EVP_sha256(), nullptr);
  STEMVO_CHECK(done == 1 && size == digest.size(), "libcrypto computes a SHA-256");
  return fmt::format("{:02x}", fmt::join(digest, ""));
}

}  // namespace stemvo::internal
