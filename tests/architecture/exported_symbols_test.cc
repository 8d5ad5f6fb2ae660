// The names that each shared library exports are those of the list in exported_symbols/, which thus
// shows in a review what a change adds to the interface or takes from it.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <map>
#include <regex>
#include <set>
#include <sstream>
#include <string>

#include "architecture/elf_bytes.h"
#include "architecture/repository.h"
#include "architecture/symbol_rules.h"

namespace thicklens::architecture {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;

constexpr char kUpdate[] = "THICKLENS_UPDATE_EXPORTED_SYMBOLS";

struct Exported {
  std::set<std::string> names;    // functions and variables of the namespace thicklens
  std::set<std::string> strange;  // what is in no such namespace
};

// Type information, virtual tables, thunks and the like of a class are not listed, only looked at:
// which of them a library contains depends on the compiler. The same holds of the two names that
// the standard library has for one type.
Exported Sorted(const std::set<std::string>& symbols) {
  static const std::regex companion(R"(^([\w-]+ )+(for|to) (.*)$)");
  static const std::regex tag(R"(\[abi:\w+\]|\b__cxx11::)");
  Exported exported;
  for (const std::string& symbol : symbols) {
    std::string name = Demangled(symbol);
    std::smatch part;
    const bool is_companion = std::regex_match(name, part, companion);
    if (is_companion) name = part[3];
    name = std::regex_replace(name, tag, "");
    // Functions of templates begin with what they return.
    const std::string scope = name.substr(0, name.find('('));
    const bool is_ours = symbol.rfind("_ZN9thicklens", 0) == 0 ||
                         symbol.rfind("_ZNK9thicklens", 0) == 0 ||
                         (is_companion && scope.rfind("thicklens::", 0) == 0);
    if (!is_ours) {
      exported.strange.insert(name);
    } else if (!is_companion) {
      exported.names.insert(name);
    }
  }
  return exported;
}

// Maps the name of each module to the path of its shared library.
std::map<std::string, std::string> SharedLibraries() {
  std::istringstream lines(ContentOf(THICKLENS_LIBRARIES));
  std::map<std::string, std::string> libraries;
  for (std::string name, path; lines >> name && std::getline(lines >> std::ws, path);)
    libraries[name] = path;
  return libraries;
}

std::string ListOf(const std::string& library) {
  return std::string(THICKLENS_SOURCE_DIR) + "/tests/architecture/exported_symbols/" + library +
         ".txt";
}

std::string Lines(const std::set<std::string>& names) {
  std::string lines;
  for (const std::string& name : names) lines += name + "\n";
  return lines;
}

// Returns the elements of `a` that `b` lacks, one per line.
std::string Less(const std::set<std::string>& a, const std::set<std::string>& b) {
  std::set<std::string> rest;
  std::set_difference(a.begin(), a.end(), b.begin(), b.end(), std::inserter(rest, rest.end()));
  return Lines(rest);
}

TEST(ExportedSymbols, AreThoseOfTheLists) {
  const std::map<std::string, std::string> libraries = SharedLibraries();
  if (libraries.empty()) GTEST_SKIP() << "this build has no shared libraries";
  ASSERT_EQ(libraries.size(), 7U);
  for (const auto& [library, path] : libraries) {
    SCOPED_TRACE("thicklens::" + library);
    const auto symbols = ReadExportedSymbols(BytesOf(path));
    ASSERT_TRUE(symbols.has_value()) << path;
    const Exported exported = Sorted(*symbols);
    EXPECT_THAT(Lines(exported.strange), IsEmpty()) << "exported, but not in namespace thicklens";
    if (std::getenv(kUpdate) != nullptr) {
      std::ofstream(ListOf(library)) << Lines(exported.names);
      continue;
    }
    std::istringstream lines(ContentOf(ListOf(library)));
    std::set<std::string> listed;
    for (std::string line; std::getline(lines, line);) listed.insert(line);
    const std::string added = Less(exported.names, listed), lost = Less(listed, exported.names);
    EXPECT_TRUE(added.empty() && lost.empty())
        << "added:\n"
        << added << "lost:\n"
        << lost << "If this is what the change is for, run\n  " << kUpdate
        << "=1 build/tests/thicklens_architecture_test --gtest_filter='ExportedSymbols.*'\n"
        << "and commit the changed lists of tests/architecture/exported_symbols.";
  }
}

TEST(ExportedSymbols, AreSortedByTheirNamespace) {
  const Exported exported =
      Sorted({"_ZN9thicklens10NowIso8601B5cxx11Ev", "_ZNK9thicklens5model6Camera7IsValidEv",
              "_ZTIN9thicklens5ErrorE", "_ZThn8_N9thicklens5model6CameraD1Ev",
              "_ZNSt6vectorIN9thicklens5ErrorESaIS1_EED1Ev", "_ZTISt9exception", "main"});
  EXPECT_THAT(exported.names,
              ElementsAre("thicklens::NowIso8601()", "thicklens::model::Camera::IsValid() const"));
  EXPECT_THAT(
      exported.strange,
      ElementsAre("main", "std::exception",
                  "std::vector<thicklens::Error, std::allocator<thicklens::Error> >::~vector()"));
}

}  // namespace
}  // namespace thicklens::architecture
