#ifndef THICKLENS_TOOLS_DATA_HASH_H_
#define THICKLENS_TOOLS_DATA_HASH_H_

#include <memory>
#include <string>
#include <string_view>

namespace thicklens::tools {

// SHA-256 of data that arrives in pieces.
class Sha256 {
 public:
  Sha256();
  ~Sha256();
  void Add(std::string_view bytes);
  // Call this once, at the end. Returns lower-case hexadecimal, as sha256sum prints it.
  std::string Hex();

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

std::string Sha256Hex(std::string_view bytes);

}  // namespace thicklens::tools

#endif  // THICKLENS_TOOLS_DATA_HASH_H_
