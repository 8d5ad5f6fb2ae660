#ifndef THICKLENS_TESTS_ARCHITECTURE_REPOSITORY_H_
#define THICKLENS_TESTS_ARCHITECTURE_REPOSITORY_H_

#include <string>
#include <vector>

#include "architecture/include_rules.h"
#include "architecture/rooms_table.h"

namespace thicklens::architecture {

// Returns the content of a file. The test fails if the file cannot be read.
std::string ContentOf(const std::string& path);

// Reads docs/rooms.txt.
RoomsTable RepositoryTable();

// Reads all sources of these modules.
SourceTree ReadRepository(const std::vector<std::string>& modules);

}  // namespace thicklens::architecture

#endif  // THICKLENS_TESTS_ARCHITECTURE_REPOSITORY_H_
