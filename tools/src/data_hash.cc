#include "data_hash.h"

#include <fmt/format.h>
#include <openssl/evp.h>

#include <array>

#include "thicklens/error.h"

namespace thicklens::tools {

std::string Sha256Hex(const std::string& bytes) {
  std::array<unsigned char, EVP_MAX_MD_SIZE> digest{};
  unsigned int length = 0;
  if (EVP_Digest(bytes.data(), bytes.size(), digest.data(), &length, EVP_sha256(), nullptr) != 1) {
    throw Error("SHA-256 is not available from OpenSSL here");
  }
  return fmt::format("{:02x}", fmt::join(digest.data(), digest.data() + length, ""));
}

}  // namespace thicklens::tools
