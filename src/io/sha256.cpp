// SPDX-License-Identifier: MIT
#include "io/sha256.hpp"

#include <array>

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <openssl/evp.h>

#include "internal_check.hpp"

namespace stemvo::internal {

std::string sha256_hex(std::string_view bytes) { return Sha256({}).hex(bytes); }

Sha256::Sha256(std::string_view beginning) : state_(EVP_MD_CTX_new(), &EVP_MD_CTX_free) {
  STEMVO_CHECK(EVP_DigestInit_ex(state_.get(), EVP_sha256(), nullptr) == 1 &&
                   EVP_DigestUpdate(state_.get(), beginning.data(), beginning.size()) == 1,
               "libcrypto begins a SHA-256");
}

std::string Sha256::hex(std::string_view rest) const {
  const std::unique_ptr<EVP_MD_CTX, decltype(&EVP_MD_CTX_free)> state(EVP_MD_CTX_new(),
                                                                      &EVP_MD_CTX_free);
  std::array<unsigned char, 32> digest{};
  unsigned int size = 0;
  STEMVO_CHECK(EVP_MD_CTX_copy_ex(state.get(), state_.get()) == 1 &&
                   EVP_DigestUpdate(state.get(), rest.data(), rest.size()) == 1 &&
                   EVP_DigestFinal_ex(state.get(), digest.data(), &size) == 1 &&
                   size == digest.size(),
               "libcrypto computes a SHA-256");
  return fmt::format("{:02x}", fmt::join(digest, ""));
}

}  // namespace stemvo::internal
