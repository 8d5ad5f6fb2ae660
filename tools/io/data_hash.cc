#include "thicklens/io/data_hash.h"

#include <fmt/format.h>
#include <openssl/evp.h>

#include <array>

#include "thicklens/base/error.h"

namespace thicklens::io {
namespace {

void Require(int result) {
  if (result != 1) throw Error("SHA-256 is not available from OpenSSL here");
}

}  // namespace

struct Sha256::Impl {
  std::unique_ptr<EVP_MD_CTX, decltype(&EVP_MD_CTX_free)> context{EVP_MD_CTX_new(),
                                                                  &EVP_MD_CTX_free};
};

Sha256::Sha256() : impl_(std::make_unique<Impl>()) {
  Require(impl_->context != nullptr ? 1 : 0);
  Require(EVP_DigestInit_ex(impl_->context.get(), EVP_sha256(), nullptr));
}

Sha256::~Sha256() = default;

void Sha256::Add(std::string_view bytes) {
  Require(EVP_DigestUpdate(impl_->context.get(), bytes.data(), bytes.size()));
}

std::string Sha256::Hex() {
  std::array<unsigned char, EVP_MAX_MD_SIZE> digest{};
  unsigned int length = 0;
  Require(EVP_DigestFinal_ex(impl_->context.get(), digest.data(), &length));
  return fmt::format("{:02x}", fmt::join(digest.data(), digest.data() + length, ""));
}

std::string Sha256Hex(std::string_view bytes) {
  Sha256 hash;
  hash.Add(bytes);
  return hash.Hex();
}

}  // namespace thicklens::io
