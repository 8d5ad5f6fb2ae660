#ifndef THICKLENS_TESTS_FUZZ_READERS_H_
#define THICKLENS_TESTS_FUZZ_READERS_H_

#include <functional>
#include <ostream>
#include <string>
#include <vector>

#include "support/temporary_folder.h"

namespace thicklens::testing {

// One of the program's readers, which gets the bytes of one file.
struct FuzzedReader {
  std::string name;  // also the name of the folder of its corpus
  // Writes the bytes to the folder, which contains the files that they refer to, and reads them.
  // Throws Error for invalid bytes, and must throw nothing else for any bytes.
  std::function<void(const std::string& bytes, const TemporaryFolder& folder)> read;
};

// GoogleTest prints this.
inline void PrintTo(const FuzzedReader& reader, std::ostream* out) { *out << reader.name; }

const std::vector<FuzzedReader>& FuzzedReaders();

// Writes the files that the readers need beside the one that is read.
void PrepareFuzzFolder(const TemporaryFolder& folder);

// Returns the message with which the reader refused the bytes, or an empty string if it read them.
// Exceptions other than Error pass through, and so does an Error without a message.
std::string Refusal(const FuzzedReader& reader, const std::string& bytes,
                    const TemporaryFolder& folder);

}  // namespace thicklens::testing

#endif  // THICKLENS_TESTS_FUZZ_READERS_H_
