#include "architecture/include_rules.h"

#include <algorithm>
#include <optional>
#include <regex>
#include <set>
#include <sstream>
#include <utility>

namespace thicklens::architecture {
namespace {

// Headers of C++17, the C headers that it includes, and those of POSIX.
bool IsSystemHeader(const std::string& header) {
  static const std::set<std::string> headers = {
      "algorithm", "any", "array", "atomic", "bitset", "charconv", "chrono", "codecvt", "complex",
      "condition_variable", "deque", "exception", "execution", "filesystem", "forward_list",
      "fstream", "functional", "future", "initializer_list", "iomanip", "ios", "iosfwd", "iostream",
      "istream", "iterator", "limits", "list", "locale", "map", "memory", "memory_resource",
      "mutex", "new", "numeric", "optional", "ostream", "queue", "random", "ratio", "regex",
      "scoped_allocator", "set", "shared_mutex", "sstream", "stack", "stdexcept", "streambuf",
      "string", "string_view", "system_error", "thread", "tuple", "type_traits", "typeindex",
      "typeinfo", "unordered_map", "unordered_set", "utility", "valarray", "variant", "vector",
      "cassert", "cctype", "cerrno", "cfenv", "cfloat", "cinttypes", "climits", "clocale", "cmath",
      "csetjmp", "csignal", "cstdarg", "cstddef", "cstdint", "cstdio", "cstdlib", "cstring",
      "ctime", "cuchar", "cwchar", "cwctype", "assert.h", "ctype.h", "errno.h", "fenv.h", "float.h",
      "inttypes.h", "limits.h", "locale.h", "math.h", "setjmp.h", "signal.h", "stdarg.h",
      "stddef.h", "stdint.h", "stdio.h", "stdlib.h", "string.h", "time.h", "dirent.h", "dlfcn.h",
      "fcntl.h", "fnmatch.h", "glob.h", "iconv.h", "libgen.h", "poll.h", "pthread.h", "pwd.h",
      "sched.h", "semaphore.h", "spawn.h", "strings.h", "termios.h", "unistd.h",
      // Vector instructions of the compiler, for the hot files with run-time dispatch.
      "immintrin.h",
      // The settings of the GNU C library's allocator.
      "malloc.h"};
  return headers.count(header) > 0 || header.rfind("sys/", 0) == 0;
}

bool StartsWith(const std::string& text, const std::string& prefix) {
  return text.rfind(prefix, 0) == 0;
}

// "opencv2/core" allows opencv2/core.hpp and opencv2/core/mat.hpp but not opencv2/core_detect.hpp;
// "Eigen/" allows a folder, "csv.h" one file.
bool Allows(const std::string& prefix, const std::string& header) {
  if (!StartsWith(header, prefix)) return false;
  return prefix.back() == '/' || header.size() == prefix.size() || header[prefix.size()] == '/' ||
         header[prefix.size()] == '.';
}

bool AnyAllows(const Names& prefixes, const std::string& header) {
  return std::any_of(prefixes.begin(), prefixes.end(),
                     [&](const std::string& prefix) { return Allows(prefix, header); });
}

std::string FileName(const std::string& path) { return path.substr(path.rfind('/') + 1); }

constexpr char kInclude[] = "/include/";
bool IsPublic(const std::string& path) { return path.find(kInclude) != std::string::npos; }

// Returns the name by which a public header is included: the part after the first include/.
std::string PublicName(const std::string& path) {
  return path.substr(path.find(kInclude) + std::string(kInclude).size());
}

// Checks the includes of one file.
class Judge {
 public:
  // `public_headers` maps the name by which a header is included to its path.
  Judge(const SourceTree& tree, const std::map<std::string, std::string>& public_headers,
        const std::set<std::string>& internal_headers, const RoomsTable& table, std::string path,
        std::string room)
      : tree_(tree),
        public_headers_(public_headers),
        internal_headers_(internal_headers),
        table_(table),
        path_(std::move(path)),
        room_(std::move(room)) {}

  // Returns what is wrong with the include, or nothing if it is allowed.
  std::string Complaint(const std::string& header, bool quoted) const {
    if (StartsWith(header, "thicklens/")) return OfPublic(header);
    Names foreign = table_.Shows(room_);
    if (!IsPublic(path_)) {
      const Names inside = table_.Uses(room_);
      foreign.insert(foreign.end(), inside.begin(), inside.end());
    }
    if (IsSystemHeader(header) || AnyAllows(foreign, header)) return "";
    if (quoted) {
      const std::optional<std::string> of_ours = OfPrivate(header);
      if (of_ours) return *of_ours;
    }
    return std::string(IsPublic(path_) ? "a public header of " : "") + room_ +
           " may include of other libraries: the standard library, " + Joined(foreign);
  }

 private:
  std::string OfPublic(const std::string& header) const {
    const auto found = public_headers_.find(header);
    if (found == public_headers_.end()) return "there is no such public header";
    const bool is_installed = IsPublic(path_) && internal_headers_.count(path_) == 0;
    if (is_installed && internal_headers_.count(found->second) > 0) {
      return "an installed header may not include an internal one, which is not installed (" +
             found->second + ")";
    }
    return OfArrow(found->second);
  }

  // Returns nothing if the name of the header does not lead into a module of this repository.
  std::optional<std::string> OfPrivate(const std::string& header) const {
    const std::string module = RoomsTable::ModuleOf(path_);
    if (tree_.count(header) > 0) {
      if (IsPublic(header)) return "it is included as " + PublicName(header);
      return OfPrivateFile(header);
    }
    // In a module without rooms, a private header is included by its name below src/.
    if (!table_.IsModuleWithRooms(module) && header.find("..") == std::string::npos) {
      const std::string beside = path_.substr(0, path_.rfind('/') + 1) + header;
      for (const std::string& file : {beside, module + "/src/" + header}) {
        if (tree_.count(file) > 0) return OfPrivateFile(file);
      }
    }
    for (const auto& entry : tree_) {
      if (FileName(entry.first) != FileName(header)) continue;
      const std::string wrong = OfPrivateFile(entry.first);
      if (!wrong.empty()) return wrong;
      return "private headers are included by their path in the repository (there is " +
             entry.first + ")";
    }
    return std::nullopt;
  }

  std::string OfPrivateFile(const std::string& file) const {
    if (RoomsTable::ModuleOf(file) != RoomsTable::ModuleOf(path_)) {
      return "private headers are for their own module only (" + file + ")";
    }
    if (IsPublic(path_)) return "a public header may not include a private one (" + file + ")";
    return OfArrow(file);
  }

  std::string OfArrow(const std::string& file) const {
    const std::optional<std::string> other = table_.RoomOf(file);
    if (!other) return file + " lies in no room";
    if (table_.MayInclude(room_, *other)) return "";
    return "the arrow " + room_ + " -> " + *other + " is wrong; of ours, " + room_ +
           " may include: itself, " + table_.WhatMayInclude(room_);
  }

  const SourceTree& tree_;
  const std::map<std::string, std::string>& public_headers_;
  const std::set<std::string>& internal_headers_;
  const RoomsTable& table_;
  const std::string path_, room_;
};

void CheckPlace(const RoomsTable& table, const std::string& room, const std::string& path,
                std::vector<std::string>* violations) {
  if (!IsPublic(path)) return;
  std::string places;
  for (const std::string& folder : table.Headers(room)) {
    const std::string place = room + kInclude + folder + "/";
    if (path == place + FileName(path)) return;
    places += (places.empty() ? "" : ", ") + place;
  }
  violations->push_back(path + ":1: a public header in the wrong place; allowed: " + places);
}

void CheckIncludes(const Judge& judge, const std::string& path, const std::string& text,
                   std::vector<std::string>* violations) {
  static const std::regex directive(R"re(^\s*#\s*(include|include_next|import)\b\s*(.*)$)re");
  static const std::regex plain(R"re(^(?:<([^>]+)>|"([^"]+)").*$)re");
  std::istringstream lines(text);
  std::string line;
  for (int number = 1; std::getline(lines, line); ++number) {
    std::smatch found, name;
    if (!std::regex_match(line, found, directive)) continue;
    const std::string where = path + ":" + std::to_string(number) + ": ";
    const std::string rest = found[2];
    if (!std::regex_match(rest, name, plain)) {
      violations->push_back(where + "includes " + rest +
                            ", which cannot be judged; allowed: <header> or \"header\"");
      continue;
    }
    const bool quoted = name[2].matched;
    const std::string header = quoted ? name[2] : name[1];
    const std::string complaint = judge.Complaint(header, quoted);
    if (!complaint.empty()) violations->push_back(where + "includes " + header + "; " + complaint);
  }
}

struct QuotedInclude {
  int line = 0;
  std::string header;
};

std::vector<QuotedInclude> QuotedIncludes(const std::string& text) {
  static const std::regex directive(
      R"re(^\s*#\s*(?:include|include_next|import)\s*"([^"]+)".*$)re");
  std::vector<QuotedInclude> includes;
  std::istringstream lines(text);
  std::string line;
  for (int number = 1; std::getline(lines, line); ++number) {
    std::smatch found;
    if (std::regex_match(line, found, directive)) includes.push_back({number, found[1]});
  }
  return includes;
}

bool LiesInOneOf(const Names& folders, const std::string& path) {
  return std::any_of(folders.begin(), folders.end(),
                     [&](const std::string& folder) { return StartsWith(path, folder + "/"); });
}

}  // namespace

bool IsSource(const std::string& path) {
  static const std::set<std::string> extensions = {".h",  ".hh",  ".hpp", ".hxx", ".inc", ".inl",
                                                   ".cc", ".cpp", ".cxx", ".c",   ".cl",  ".ipp"};
  const std::string name = FileName(path);
  const std::size_t dot = name.rfind('.');
  return dot != std::string::npos && extensions.count(name.substr(dot)) > 0;
}

std::vector<std::string> Violations(const SourceTree& tree, const RoomsTable& table,
                                    const std::set<std::string>& internal_headers) {
  const Names modules = table.Modules();
  std::map<std::string, std::string> public_headers;
  for (const auto& entry : tree) {
    if (IsPublic(entry.first)) public_headers[PublicName(entry.first)] = entry.first;
  }
  std::vector<std::string> violations;
  for (const auto& [path, text] : tree) {
    const bool is_ours =
        std::find(modules.begin(), modules.end(), RoomsTable::ModuleOf(path)) != modules.end();
    if (!is_ours || !IsSource(path)) continue;
    const std::optional<std::string> room = table.RoomOf(path);
    if (!room) {
      violations.push_back(path + ":1: lies in no room");
      continue;
    }
    CheckPlace(table, *room, path, &violations);
    CheckIncludes(Judge(tree, public_headers, internal_headers, table, path, *room), path, text,
                  &violations);
  }
  return violations;
}

std::vector<std::string> PrivateIncludes(const SourceTree& tree, const std::string& client,
                                         const Names& libraries) {
  Names left;
  for (const auto& entry : tree) {
    if (StartsWith(entry.first, client + "/") && IsSource(entry.first)) left.push_back(entry.first);
  }
  std::set<std::string> seen(left.begin(), left.end());
  std::set<std::string> found;
  while (!left.empty()) {
    const std::string path = left.back();
    left.pop_back();
    for (const QuotedInclude& include : QuotedIncludes(tree.at(path))) {
      // A public header is included by another name than its path.
      if (tree.count(include.header) == 0) continue;
      if (LiesInOneOf(libraries, include.header)) {
        found.insert(path + ":" + std::to_string(include.line) + ": includes " + include.header);
      } else if (seen.insert(include.header).second) {
        left.push_back(include.header);
      }
    }
  }
  return {found.begin(), found.end()};
}

}  // namespace thicklens::architecture
