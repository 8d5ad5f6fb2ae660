// The table of docs/rooms.txt, held against what the sources of the libraries ask of each other as
// the linker sees it.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <sstream>
#include <string>
#include <utility>
#include <vector>

#include "architecture/elf_bytes.h"
#include "architecture/repository.h"
#include "architecture/rooms_table.h"
#include "architecture/symbol_rules.h"

namespace thicklens::architecture {
namespace {

namespace fs = std::filesystem;
using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::StartsWith;

// Object files, relative to the build's top, of which CMake made a list.
std::vector<std::string> ObjectsOfTheBuild() {
  std::istringstream lines(ContentOf(THICKLENS_OBJECTS));
  std::vector<std::string> objects;
  for (std::string line; std::getline(lines, line);) {
    const fs::path object = fs::path(line).lexically_normal();
    // Headers that are compiled in advance are in the list, too.
    if (object.extension() != ".o") continue;
    objects.push_back(object.lexically_relative(THICKLENS_BINARY_DIR).generic_string());
  }
  return objects;
}

TEST(SymbolScan, EveryUseAcrossRoomsIsAllowed) {
  std::vector<ObjectSymbols> objects;
  for (const std::string& object : ObjectsOfTheBuild()) {
    const std::string source = SourceOfObject(object);
    // Some sources are made by the build, and some are compiled several at a time.
    if (!fs::is_regular_file(fs::path(THICKLENS_SOURCE_DIR) / source)) continue;
    auto symbols = ReadObject(BytesOf(fs::path(THICKLENS_BINARY_DIR) / object));
    ASSERT_TRUE(symbols.has_value()) << object;
    symbols->source = source;
    objects.push_back(std::move(*symbols));
  }
  // An empty scan would pass, too.
  ASSERT_GT(objects.size(), 200U);
  std::string lines;
  for (const std::string& arrow : WrongArrows(objects, RepositoryTable())) lines += arrow + "\n";
  EXPECT_THAT(lines, IsEmpty());
}

TEST(SymbolScanner, ReadsAnObject) {
  for (const std::string& object : ObjectsOfTheBuild()) {
    if (fs::path(object).filename() != "parallel.cc.o") continue;
    const auto symbols = ReadObject(BytesOf(fs::path(THICKLENS_BINARY_DIR) / object));
    ASSERT_TRUE(symbols.has_value());
    EXPECT_THAT(symbols->defined, ::testing::Contains(HasSubstr("ResolveThreads")));
    EXPECT_THAT(symbols->used, ::testing::Contains(HasSubstr("hardware_concurrency")));
    return;
  }
  FAIL() << "no parallel.cc.o in the build's list of objects";
}

TEST(SymbolScanner, KnowsTheSourceOfAnObject) {
  EXPECT_EQ(SourceOfObject("glass/base/CMakeFiles/thicklens_base.dir/error.cc.o"),
            "glass/base/error.cc");
  EXPECT_EQ(SourceOfObject("fits/CMakeFiles/thicklens_fits.dir/src/fit.cc.o"), "fits/src/fit.cc");
  EXPECT_EQ(SourceOfObject("fits/fit.cc.o"), "");
  EXPECT_FALSE(ReadObject("no object at all").has_value());
}

TEST(SymbolScanner, FindsAWrongArrow) {
  const RoomsTable table =
      RoomsTable::Parse("glass/base:\nglass/optics: glass/base\nfits: glass\n");
  const std::vector<ObjectSymbols> objects = {
      {"glass/base/error.cc", {"_ZN5glass5ErrorEv"}, {"_ZN5glass6CameraEv", "malloc"}},
      {"glass/optics/camera.cc", {"_ZN5glass6CameraEv"}, {"_ZN5glass5ErrorEv", "_ZN5glass3ByEv"}},
      {"fits/src/fit.cc", {"_ZN4fits3FitEv"}, {"_ZN5glass6CameraEv", "_ZN5glass5ErrorEv"}}};
  EXPECT_THAT(WrongArrows(objects, table),
              ElementsAre(AllOf(
                  StartsWith("glass/base/error.cc: uses glass::Camera() of glass/optics/camera.cc"),
                  HasSubstr("the arrow glass/base -> glass/optics is wrong"),
                  HasSubstr("glass/base may include: itself, nothing"))));
}

TEST(SymbolScanner, LetsFunctionsOfTemplatesStandInSeveralObjects) {
  const RoomsTable table = RoomsTable::Parse("a:\nb:\nc:\n");
  EXPECT_THAT(
      WrongArrows(
          {{"a/a.cc", {"Inline"}, {}}, {"b/b.cc", {"Inline"}, {}}, {"c/c.cc", {}, {"Inline"}}},
          table),
      IsEmpty());
}

}  // namespace
}  // namespace thicklens::architecture
