#ifndef THICKLENS_IO_DATA_HASH_H_
#define THICKLENS_IO_DATA_HASH_H_

#include <memory>
#include <string>
#include <string_view>

#include "thicklens/base/export.h"

namespace thicklens::io {

// SHA-256 of data that arrives in pieces.
class THICKLENS_EXPORT Sha256 {
 public:
  // Starts a hash of no data.
  Sha256();
  ~Sha256();
  // Appends bytes to the data.
  void Add(std::string_view bytes);
  // Call this once, at the end. Returns lower-case hexadecimal, as sha256sum prints it.
  std::string Hex();

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

// The SHA-256 of the bytes, in lower-case hexadecimal.
THICKLENS_EXPORT std::string Sha256Hex(std::string_view bytes);

}  // namespace thicklens::io

#endif  // THICKLENS_IO_DATA_HASH_H_
