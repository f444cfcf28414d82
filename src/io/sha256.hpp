// SPDX-License-Identifier: MIT
#pragma once

#include <memory>
#include <string>
#include <string_view>

using EVP_MD_CTX = struct evp_md_ctx_st;  // libcrypto's

namespace stemvo::internal {

/// SHA-256 as 64 lower-case hexadecimal digits.
[[nodiscard]] std::string sha256_hex(std::string_view bytes);

/// The same of many texts with one beginning, which is hashed once.
class Sha256 {
 public:
  explicit Sha256(std::string_view beginning);
  [[nodiscard]] std::string hex(std::string_view rest) const;

 private:
  std::shared_ptr<EVP_MD_CTX> state_;
};

}  // namespace stemvo::internal
