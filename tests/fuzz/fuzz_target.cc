// What libFuzzer calls: the reader that THICKLENS_FUZZ_READER names, fed with what it makes up.
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <string>

#include "fuzz/readers.h"

namespace {

using thicklens::testing::FuzzedReader;
using thicklens::testing::TemporaryFolder;

const FuzzedReader* TheReader() {
  const char* name = std::getenv("THICKLENS_FUZZ_READER");
  for (const FuzzedReader& reader : thicklens::testing::FuzzedReaders()) {
    if (name != nullptr && reader.name == name) return &reader;
  }
  std::fputs("THICKLENS_FUZZ_READER must name one of:\n", stderr);
  for (const FuzzedReader& reader : thicklens::testing::FuzzedReaders()) {
    std::fprintf(stderr, "  %s\n", reader.name.c_str());
  }
  std::exit(2);
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  static const FuzzedReader* const reader = TheReader();
  static const TemporaryFolder folder;  // the caller removes it: libFuzzer need not come to an end
  static const bool is_prepared = (thicklens::testing::PrepareFuzzFolder(folder), true);
  static_cast<void>(is_prepared);
  const std::string bytes(reinterpret_cast<const char*>(data), size);
  thicklens::testing::Refusal(*reader, bytes, folder);
  return 0;
}
