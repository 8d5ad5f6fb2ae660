#include "house/include_rules.h"

#include <algorithm>
#include <regex>
#include <set>
#include <sstream>

namespace thicklens::house {
namespace {

using Names = std::vector<std::string>;

struct Room {
  std::string name;
  Names ours;     // modules it may include, besides itself, thicklens/error.h and cancel.h
  Names showing;  // foreign headers (prefixes) that its public headers may include
  Names inside;   // and those that its sources and private headers may include besides
};

// The table of CONTRIBUTING.md.
const std::vector<Room>& Rooms() {
  static const std::vector<Room> rooms = {
      {"model", {}, {"Eigen/"}, {"fmt/", "yaml-cpp/", "csv.h", "opencv2/core", "opencv2/imgproc"}},
      {"kernels", {}, {}, {"fmt/", "CL/"}},
      {"calib",
       {"model"},
       {"Eigen/", "opencv2/core"},
       {"fmt/", "ceres/", "opencv2/imgproc", "opencv2/video"}},
      {"estimator",
       {"model", "kernels"},
       {"Eigen/"},
       {"fmt/", "suitesparse/", "umfpack.h", "cholmod.h", "SuiteSparse_config.h", "viennacl/",
        "opencv2/core", "opencv2/imgproc", "opencv2/photo"}},
      {"tools",
       {"model", "kernels", "calib", "estimator"},
       {},
       {"Eigen/", "fmt/", "CLI/", "nlohmann/", "spdlog/", "exiv2/", "openssl/", "glog/", "cairo.h",
        "tiffio.h", "spng.h", "zlib.h", "cairo-pdf.h", "opencv2/core", "opencv2/imgcodecs",
        "opencv2/imgproc"}},
  };
  return rooms;
}

// C++17, the C headers it takes over, and POSIX.
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
      "fcntl.h", "fnmatch.h", "glob.h", "libgen.h", "poll.h", "pthread.h", "pwd.h", "sched.h",
      "semaphore.h", "spawn.h", "strings.h", "termios.h", "unistd.h",
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

std::string Joined(const Names& names) {
  std::string joined;
  for (const std::string& name : names) joined += (joined.empty() ? "" : ", ") + name;
  return joined.empty() ? "nothing" : joined;
}

const Room* RoomNamed(const std::string& name) {
  for (const Room& room : Rooms()) {
    if (room.name == name) return &room;
  }
  return nullptr;
}

std::string TopFolder(const std::string& path) { return path.substr(0, path.find('/')); }
std::string FileName(const std::string& path) { return path.substr(path.rfind('/') + 1); }

// What is wrong with the include, or nothing.
std::string Complaint(const Room& room, const std::string& path, const std::string& header,
                      bool quoted, const SourceTree& tree) {
  const bool is_public = StartsWith(path, room.name + "/include/");
  if (header == "thicklens/error.h" || header == "thicklens/cancel.h") return "";
  if (StartsWith(header, "thicklens/")) {
    const std::string module = TopFolder(header.substr(std::string("thicklens/").size()));
    if (module == room.name ||
        std::find(room.ours.begin(), room.ours.end(), module) != room.ours.end()) {
      return "";
    }
    return "of the project's modules, " + room.name +
           " may include: itself, thicklens/error.h, "
           "thicklens/cancel.h, " +
           Joined(room.ours);
  }

  Names allowed = room.showing;
  if (!is_public) allowed.insert(allowed.end(), room.inside.begin(), room.inside.end());
  if (IsSystemHeader(header) || AnyAllows(allowed, header)) return "";

  if (quoted) {
    // A private header is told from a foreign one by where it is.
    const std::string beside = path.substr(0, path.rfind('/') + 1) + header;
    const bool own =
        !is_public && (tree.count(beside) > 0 || tree.count(room.name + "/src/" + header) > 0 ||
                       tree.count(room.name + "/" + header) > 0);
    if (own && header.find("..") == std::string::npos) return "";
    for (const auto& entry : tree) {
      if (FileName(entry.first) != FileName(header)) continue;
      if (is_public && TopFolder(entry.first) == room.name) {
        return "a public header may not include a private one (" + entry.first + ")";
      }
      return "private headers are for their own module only, by their name below src/ (there is " +
             entry.first + ")";
    }
  }
  return std::string(is_public ? "a public header of " : "") + room.name +
         " may include of other libraries: the standard library, " + Joined(allowed);
}

void CheckPlace(const Room& room, const std::string& path, std::vector<std::string>* violations) {
  if (!StartsWith(path, room.name + "/include/") || path == "model/include/thicklens/error.h" ||
      path == "model/include/thicklens/cancel.h") {
    return;
  }
  const std::string place = room.name + "/include/thicklens/" + room.name + "/";
  if (path == place + FileName(path)) return;
  violations->push_back(path + ":1: a public header in the wrong place; allowed: " + place);
}

}  // namespace

std::vector<std::string> Modules() {
  std::vector<std::string> names;
  for (const Room& room : Rooms()) names.push_back(room.name);
  return names;
}

bool IsSource(const std::string& path) {
  static const std::set<std::string> extensions = {".h",  ".hh",  ".hpp", ".hxx", ".inc", ".inl",
                                                   ".cc", ".cpp", ".cxx", ".c",   ".cl",  ".ipp"};
  const std::string name = FileName(path);
  const std::size_t dot = name.rfind('.');
  return dot != std::string::npos && extensions.count(name.substr(dot)) > 0;
}

std::vector<std::string> Violations(const SourceTree& tree) {
  static const std::regex directive(R"re(^\s*#\s*(include|include_next|import)\b\s*(.*)$)re");
  static const std::regex plain(R"re(^(?:<([^>]+)>|"([^"]+)").*$)re");
  std::vector<std::string> violations;
  for (const auto& [path, text] : tree) {
    const Room* room = RoomNamed(TopFolder(path));
    if (room == nullptr || !IsSource(path)) continue;
    CheckPlace(*room, path, &violations);
    std::istringstream lines(text);
    std::string line;
    for (int number = 1; std::getline(lines, line); ++number) {
      std::smatch found, name;
      if (!std::regex_match(line, found, directive)) continue;
      const std::string where = path + ":" + std::to_string(number) + ": ";
      const std::string rest = found[2];
      if (!std::regex_match(rest, name, plain)) {
        violations.push_back(where + "includes " + rest +
                             ", which cannot be judged; allowed: <header> or \"header\"");
        continue;
      }
      const bool quoted = name[2].matched;
      const std::string header = quoted ? name[2] : name[1];
      const std::string complaint = Complaint(*room, path, header, quoted, tree);
      if (!complaint.empty()) {
        violations.push_back(where + "includes " + header + "; " + complaint);
      }
    }
  }
  return violations;
}

}  // namespace thicklens::house
