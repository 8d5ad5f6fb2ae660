#include "architecture/rooms_table.h"

#include <algorithm>
#include <regex>
#include <sstream>
#include <stdexcept>

namespace thicklens::architecture {
namespace {

bool Holds(const std::string& folder, const std::string& path) {
  return path.rfind(folder + "/", 0) == 0;
}

bool IsAmong(const Names& names, const std::string& name) {
  return std::find(names.begin(), names.end(), name) != names.end();
}

}  // namespace

RoomsTable RoomsTable::Parse(const std::string& text) {
  static const std::regex form(R"(^([\w/]+)(?: (shows|uses|headers))?:((?: [^\s]+)*)$)");
  RoomsTable table;
  std::istringstream lines(text);
  std::string line;
  for (int number = 1; std::getline(lines, line); ++number) {
    if (line.empty() || line[0] == '#') continue;
    const std::string where = "line " + std::to_string(number) + " of the table of rooms: ";
    std::smatch part;
    if (!std::regex_match(line, part, form)) {
      throw std::runtime_error(where + "'ROOM: ROOM ..' is expected, found '" + line + "'");
    }
    const std::string room = part[1], what = part[2], rest = part[3];
    std::istringstream words(rest);
    Names names;
    for (std::string word; words >> word;) names.push_back(word);
    const std::string key = what.empty() ? room : room + " " + what;
    auto* entries = what.empty() ? &table.may_include_ : &table.said_;
    if (!entries->emplace(key, names).second) {
      throw std::runtime_error(where + "'" + key + "' was there before");
    }
    if (what.empty()) table.rooms_.push_back(room);
  }
  const Names modules = table.Modules();
  for (const auto& [room, names] : table.may_include_) {
    for (const std::string& name : names) {
      if (IsAmong(table.rooms_, name) || IsAmong(modules, name)) continue;
      throw std::runtime_error("the table of rooms: " + room + " may include '" + name +
                               "', which is no room");
    }
  }
  return table;
}

Names RoomsTable::Modules() const {
  Names modules;
  for (const std::string& room : rooms_) {
    if (!IsAmong(modules, ModuleOf(room))) modules.push_back(ModuleOf(room));
  }
  return modules;
}

std::optional<std::string> RoomsTable::RoomOf(const std::string& path) const {
  std::optional<std::string> innermost;
  for (const std::string& room : rooms_) {
    if (Holds(room, path) && (!innermost || room.size() > innermost->size())) innermost = room;
  }
  return innermost;
}

std::string RoomsTable::ModuleOf(const std::string& path) { return path.substr(0, path.find('/')); }

bool RoomsTable::IsModuleWithRooms(const std::string& module) const {
  return !IsAmong(rooms_, module) && IsAmong(Modules(), module);
}

bool RoomsTable::MayInclude(const std::string& room, const std::string& other) const {
  return room == other || IsAmong(Allowed(room), other);
}

std::string RoomsTable::WhatMayInclude(const std::string& room) const {
  return Joined(may_include_.at(room));
}

Names RoomsTable::Headers(const std::string& room) const {
  const Names said = Said(room, "headers");
  return said.empty() ? Names{"thicklens/" + ModuleOf(room)} : said;
}

Names RoomsTable::Said(const std::string& room, const std::string& what) const {
  for (const std::string& name : {room, ModuleOf(room)}) {
    const auto found = said_.find(name + " " + what);
    if (found != said_.end()) return found->second;
  }
  return {};
}

Names RoomsTable::Allowed(const std::string& room) const {
  Names allowed;
  for (const std::string& name : may_include_.at(room)) {
    for (const std::string& other : rooms_) {
      const bool is_meant = other == name || (IsModuleWithRooms(name) && ModuleOf(other) == name);
      if (is_meant && other != room) allowed.push_back(other);
    }
  }
  return allowed;
}

Names RoomsTable::Circle() const {
  std::map<std::string, bool> is_done;
  for (const std::string& room : rooms_) {
    Names way = {room};
    if (Closes(&way, &is_done)) return way;
  }
  return {};
}

bool RoomsTable::Closes(Names* way, std::map<std::string, bool>* is_done) const {
  const std::string room = way->back();
  if ((*is_done)[room]) return false;
  for (const std::string& next : Allowed(room)) {
    const auto met = std::find(way->begin(), way->end(), next);
    if (met != way->end()) {
      way->erase(way->begin(), met);
      return true;
    }
    way->push_back(next);
    if (Closes(way, is_done)) return true;
    way->pop_back();
  }
  (*is_done)[room] = true;
  return false;
}

std::string Joined(const Names& names) {
  std::string joined;
  for (const std::string& name : names) joined += (joined.empty() ? "" : ", ") + name;
  return joined.empty() ? "nothing" : joined;
}

}  // namespace thicklens::architecture
