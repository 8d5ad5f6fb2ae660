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
  // Throws std::runtime_error, which names the line, if a line has another form, names a room
  // twice, or allows a room to include what is no room.
  static RoomsTable Parse(const std::string& text);

  // Rooms in the order of the table. A module without rooms counts as one room with its name.
  const Names& rooms() const { return rooms_; }
  Names Modules() const;

  // Returns the innermost room that contains the file, or nothing if the file is in no room.
  std::optional<std::string> RoomOf(const std::string& path) const;
  static std::string ModuleOf(const std::string& path);
  bool IsModuleWithRooms(const std::string& module) const;

  bool MayInclude(const std::string& room, const std::string& other) const;
  // Returns for example "model/base, model/optics", or "nothing".
  std::string WhatMayInclude(const std::string& room) const;

  // Prefixes of headers of other libraries that the room's public headers may include, and the
  // folders of its public headers.
  Names Shows(const std::string& room) const { return Said(room, "shows"); }
  Names Uses(const std::string& room) const { return Said(room, "uses"); }
  Names Headers(const std::string& room) const;

  // Returns rooms each of which may include the next one, and the last one the first. Empty: there
  // is no such circle.
  Names Circle() const;

 private:
  // Returns the entry of the room if there is one, or that of its module.
  Names Said(const std::string& room, const std::string& what) const;
  // Returns the rooms that the room may include, with each module replaced by its rooms.
  Names Allowed(const std::string& room) const;
  // Extends a way through rooms until it meets itself. Returns true if it does; then `way` is the
  // circle.
  bool Closes(Names* way, std::map<std::string, bool>* is_done) const;

  Names rooms_;
  std::map<std::string, Names> may_include_;
  std::map<std::string, Names> said_;  // the key is "ROOM uses"
};

std::string Joined(const Names& names);

}  // namespace thicklens::architecture

#endif  // THICKLENS_TESTS_ARCHITECTURE_ROOMS_TABLE_H_
