#ifndef THICKLENS_TESTS_ARCHITECTURE_SYMBOL_RULES_H_
#define THICKLENS_TESTS_ARCHITECTURE_SYMBOL_RULES_H_

#include <optional>
#include <set>
#include <string>
#include <vector>

#include "architecture/rooms_table.h"

namespace thicklens::architecture {

// What one source asks of others, as the linker sees it: names as the compiler writes them.
struct ObjectSymbols {
  std::string source;  // path relative to the repository's top
  std::set<std::string> defined, used;
};

// The symbols of an object file; nothing: it is none of this machine's kind.
std::optional<ObjectSymbols> ReadObject(const std::string& bytes);

// "model/base/CMakeFiles/thicklens_base.dir/parallel.cc.o" -> "model/base/parallel.cc"; empty of
// any other path.
std::string SourceOfObject(const std::string& object);

// Every use of a symbol that one source of another room defines (a function of a template that
// several define is none) and that the table does not allow, as "source: uses NAME of OTHER; the
// arrow ROOM -> ROOM is wrong; what is allowed". An include may hide such an arrow: a header of one
// room whose functions are defined in another.
std::vector<std::string> WrongArrows(const std::vector<ObjectSymbols>& objects,
                                     const RoomsTable& table);

}  // namespace thicklens::architecture

#endif  // THICKLENS_TESTS_ARCHITECTURE_SYMBOL_RULES_H_
