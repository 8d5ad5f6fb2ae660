#ifndef THICKLENS_TESTS_FUZZ_READERS_H_
#define THICKLENS_TESTS_FUZZ_READERS_H_

#include <functional>
#include <ostream>
#include <string>
#include <vector>

#include "support/temporary_folder.h"

namespace thicklens::testing {

// One of the program's readers, fed with the bytes of one file.
struct FuzzedReader {
  std::string name;  // of the folder of its corpus, too
  // Reads the bytes, which it puts into the folder, where what belongs beside them is. Throws Error
  // for what is not right, and nothing else whatever the bytes are.
  std::function<void(const std::string& bytes, const TemporaryFolder& folder)> read;
};

// For GoogleTest.
inline void PrintTo(const FuzzedReader& reader, std::ostream* out) { *out << reader.name; }

const std::vector<FuzzedReader>& FuzzedReaders();

// Puts what the readers need beside the file there.
void PrepareFuzzFolder(const TemporaryFolder& folder);

// What the reader refused the bytes with; empty: it read them. Anything but an Error passes
// through, and so does an Error without a message.
std::string Refusal(const FuzzedReader& reader, const std::string& bytes,
                    const TemporaryFolder& folder);

}  // namespace thicklens::testing

#endif  // THICKLENS_TESTS_FUZZ_READERS_H_
