#ifndef THICKLENS_TESTS_ARCHITECTURE_ROOMS_TABLE_H_
#define THICKLENS_TESTS_ARCHITECTURE_ROOMS_TABLE_H_

#include <map>
#include <optional>
#include <string>
#include <vector>

namespace thicklens::architecture {

using Names = std::vector<std::string>;

// The table of docs/rooms.txt.
class RoomsTable {
 public:
  // Throws std::runtime_error that names the line: a line of another form, a room named twice, or
  // one that may include what is no room.
  static RoomsTable Parse(const std::string& text);

  // In the order of the table. The name of a module without rooms is a room's.
  const Names& rooms() const { return rooms_; }
  Names Modules() const;

  // The room that a file lies in, the innermost of those that hold it; none: it lies in no room.
  std::optional<std::string> RoomOf(const std::string& path) const;
  static std::string ModuleOf(const std::string& path);
  bool IsModuleWithRooms(const std::string& module) const;

  bool MayInclude(const std::string& room, const std::string& other) const;
  // "model/base, model/optics", or "nothing".
  std::string WhatMayInclude(const std::string& room) const;

  // Prefixes of headers of other libraries, and the folders of its public headers.
  Names Shows(const std::string& room) const { return Said(room, "shows"); }
  Names Uses(const std::string& room) const { return Said(room, "uses"); }
  Names Headers(const std::string& room) const;

  // Rooms each of which may include the next one, and the last one the first; empty: there are
  // none.
  Names Circle() const;

 private:
  // What is said of the room, or else of its module.
  Names Said(const std::string& room, const std::string& what) const;
  // With each module in the place of its rooms.
  Names Allowed(const std::string& room) const;
  // Goes on with a way through rooms until it meets itself; true: then `way` is the circle.
  bool Closes(Names* way, std::map<std::string, bool>* is_done) const;

  Names rooms_;
  std::map<std::string, Names> may_include_;
  std::map<std::string, Names> said_;  // by "ROOM uses"
};

std::string Joined(const Names& names);

}  // namespace thicklens::architecture

#endif  // THICKLENS_TESTS_ARCHITECTURE_ROOMS_TABLE_H_
