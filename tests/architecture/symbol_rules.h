#ifndef THICKLENS_TESTS_ARCHITECTURE_SYMBOL_RULES_H_
#define THICKLENS_TESTS_ARCHITECTURE_SYMBOL_RULES_H_

#include <optional>
#include <set>
#include <string>
#include <vector>

#include "architecture/rooms_table.h"

namespace thicklens::architecture {

// The symbols that one source defines and those that it uses from others, as the linker sees them
// (mangled names).
struct ObjectSymbols {
  std::string source;  // relative to the top of the repository
  std::set<std::string> defined, used;
};

// Returns the symbols of an object file, or nothing if the file is not of this machine's kind.
std::optional<ObjectSymbols> ReadObject(const std::string& bytes);

// Returns the symbols that a shared library exports (mangled names), or nothing if the file is not
// of this machine's kind.
std::optional<std::set<std::string>> ReadExportedSymbols(const std::string& bytes);

// Returns the name of a symbol in C++, or the symbol itself if it has none.
std::string Demangled(const std::string& symbol);

// Maps "model/base/CMakeFiles/thicklens_base.dir/parallel.cc.o" to "model/base/parallel.cc".
// Returns an empty string for any other path.
std::string SourceOfObject(const std::string& object);

// Returns every use of a symbol that one source of another room defines and that the table does not
// allow, as "source: uses NAME of OTHER; the arrow ROOM -> ROOM is wrong; what is allowed".
// Functions of templates, which several sources define, are not counted. An include may hide such
// an arrow if a header of one room declares functions that are defined in another.
std::vector<std::string> WrongArrows(const std::vector<ObjectSymbols>& objects,
                                     const RoomsTable& table);

}  // namespace thicklens::architecture

#endif  // THICKLENS_TESTS_ARCHITECTURE_SYMBOL_RULES_H_
