// Every include of the repository is compared with the table of docs/rooms.txt.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <set>
#include <sstream>
#include <string>
#include <vector>

#include "architecture/include_rules.h"
#include "architecture/repository.h"
#include "architecture/rooms_table.h"

namespace thicklens::architecture {
namespace {

namespace fs = std::filesystem;
using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::StartsWith;

std::string Lines(const std::vector<std::string>& lines) {
  std::string joined;
  for (const std::string& line : lines) joined += line + "\n";
  return joined;
}

// Returns the paths of the headers that CMake listed as internal.
std::set<std::string> InternalHeaders() {
  std::istringstream lines(ContentOf(THICKLENS_INTERNAL_HEADERS));
  std::set<std::string> headers;
  for (std::string line; std::getline(lines, line);) headers.insert(line);
  return headers;
}

TEST(IncludeScan, EveryIncludeOfTheRepositoryIsAllowed) {
  const RoomsTable table = RepositoryTable();
  const SourceTree tree = ReadRepository(table.Modules());
  // An empty scan would pass as well.
  ASSERT_GT(tree.size(), 500U);
  const std::set<std::string> internal_headers = InternalHeaders();
  ASSERT_GT(internal_headers.size(), 5U);
  for (const std::string& header : internal_headers) EXPECT_EQ(tree.count(header), 1U) << header;
  EXPECT_THAT(Lines(Violations(tree, table, internal_headers)), IsEmpty());
}

// The command line is a client of the libraries as any other program is: what it needs is public.
TEST(IncludeScan, TheCommandsIncludeNoPrivateHeaderOfALibrary) {
  const SourceTree tree = ReadRepository(RepositoryTable().Modules());
  ASSERT_EQ(tree.count("tools/commands/calibrate.cc"), 1U);
  EXPECT_THAT(Lines(PrivateIncludes(
                  tree, "tools/commands",
                  {"model", "kernels", "calib", "estimator", "tools/io", "tools/interface"})),
              IsEmpty());
}

TEST(IncludeScan, EveryRoomHasSources) {
  const RoomsTable table = RepositoryTable();
  std::set<std::string> found;
  for (const auto& entry : ReadRepository(table.Modules())) {
    const auto room = table.RoomOf(entry.first);
    if (room) found.insert(*room);
  }
  const Names rooms = table.rooms();
  EXPECT_EQ(found, std::set<std::string>(rooms.begin(), rooms.end()));
}

TEST(IncludeScan, NoOtherTopLevelFolder) {
  std::set<std::string> folders = {"configs", "docs", "tests"};
  for (const std::string& module : RepositoryTable().Modules()) folders.insert(module);
  for (const auto& entry : fs::directory_iterator(THICKLENS_SOURCE_DIR)) {
    const std::string name = entry.path().filename().string();
    // Dotted folders are ignored, and so is what .gitignore names: build*, out, fresh-out.
    const bool ignored =
        name[0] == '.' || name.rfind("build", 0) == 0 || name == "out" || name == "fresh-out";
    if (!entry.is_directory() || ignored) continue;
    EXPECT_EQ(folders.count(name), 1U) << "a top-level folder that is no module: " << name;
  }
}

// Tests of the scanner itself, on planted trees.

const char kTable[] =
    "glass shows: Eigen/\n"
    "glass uses: fmt/ yaml-cpp/ opencv2/core\n"
    "glass/base:\n"
    "glass/base headers: thicklens/base\n"
    "glass/base shows:\n"
    "glass/optics: glass/base\n"
    "glass/image: glass/base glass/optics\n"
    "glass/image/files: glass\n"
    "fits: glass\n"
    "fits headers: thicklens thicklens/fits\n"
    "fits uses: ceres/ CLI/ csv.h\n";

TEST(IncludeScanner, PassesWhatTheTableAllows) {
  EXPECT_THAT(
      Violations({{"glass/base/include/thicklens/base/error.h", "#include <string>\n"},
                  {"glass/base/error.cc", "#include <fmt/format.h>\n#include <unistd.h>\n"},
                  {"glass/optics/include/thicklens/glass/camera.h",
                   "#include <Eigen/Core>\n#include \"thicklens/base/error.h\"\n"},
                  {"glass/optics/camera.cc",
                   "#include \"thicklens/glass/camera.h\"\n#include <yaml-cpp/yaml.h>\n"
                   "#include \"glass/optics/pupil.h\"\n"},
                  {"glass/optics/pupil.h", "#include <opencv2/core/mat.hpp>\n"},
                  {"glass/image/scene.cc",
                   "#include \"glass/optics/pupil.h\"\n#include <thicklens/glass/camera.h>\n"},
                  {"glass/image/scene.h", "// #include <anything.h>\n"},
                  {"glass/image/files/reader.cc", "#include \"glass/image/scene.h\"\n"},
                  {"fits/include/thicklens/fits/fit.h",
                   "#include \"thicklens/glass/camera.h\"\n#include \"thicklens/fit_error.h\"\n"},
                  {"fits/include/thicklens/fit_error.h", ""},
                  {"fits/src/fit.cc", "#include \"cost.h\"\n#include <csv.h>\n"},
                  {"fits/src/cost.h", "#include <ceres/ceres.h>\n"},
                  {"elsewhere/a.cc", "#include <anything.h>\n"}},
                 RoomsTable::Parse(kTable)),
      IsEmpty());
}

struct Planted {
  const char* name;
  const char* path;
  const char* include;
  const char* allowed;  // a part of the message
};

// GoogleTest prints this instead of the structure's bytes when a test fails.
void PrintTo(const Planted& planted, std::ostream* os) { *os << planted.name; }

class IncludeScannerRefuses : public ::testing::TestWithParam<Planted> {};

TEST_P(IncludeScannerRefuses, WithFileLineAndWhatIsAllowed) {
  const Planted& planted = GetParam();
  const SourceTree tree = {
      {"glass/optics/secret.h", ""},
      {"glass/image/scene.h", ""},
      {"glass/optics/include/thicklens/glass/camera.h", ""},
      {"glass/image/include/thicklens/glass/image.h", ""},
      {"fits/src/cost.h", ""},
      {"fits/include/thicklens/fits/fit.h", ""},
      {planted.path, std::string("// line 1\n#include <vector>\n  #  include ") + planted.include +
                         "  // why\n"}};
  EXPECT_THAT(Violations(tree, RoomsTable::Parse(kTable)),
              ElementsAre(AllOf(StartsWith(std::string(planted.path) + ":3: includes "),
                                HasSubstr(planted.allowed))));
}

INSTANTIATE_TEST_SUITE_P(
    Planted, IncludeScannerRefuses,
    ::testing::Values(
        Planted{"AnotherModule", "glass/optics/a.cc", "\"thicklens/fits/fit.h\"",
                "the arrow glass/optics -> fits is wrong; of ours, glass/optics may include: "
                "itself, glass/base"},
        Planted{"AnotherRoom", "glass/optics/a.cc", "\"thicklens/glass/image.h\"",
                "the arrow glass/optics -> glass/image is wrong"},
        Planted{"AnotherRoomsPrivate", "glass/optics/a.cc", "\"glass/image/scene.h\"",
                "the arrow glass/optics -> glass/image is wrong"},
        Planted{"AnotherRoomOfAHeader", "glass/optics/include/thicklens/glass/a.h",
                "<thicklens/glass/image.h>", "the arrow glass/optics -> glass/image is wrong"},
        Planted{"BaseUsesOptics", "glass/base/a.cc", "\"thicklens/glass/camera.h\"",
                "glass/base may include: itself, nothing"},
        Planted{"NoSuchHeader", "glass/optics/a.cc", "\"thicklens/util/b.h\"",
                "there is no such public header"},
        Planted{"PublicByPath", "glass/image/a.cc",
                "\"glass/optics/include/thicklens/glass/camera.h\"",
                "it is included as thicklens/glass/camera.h"},
        Planted{"PrivateByName", "glass/optics/a.cc", "\"secret.h\"",
                "included by their path in the repository (there is glass/optics/secret.h)"},
        Planted{"PrivateByWay", "glass/image/a.cc", "\"../optics/secret.h\"",
                "included by their path in the repository"},
        Planted{"PublicIncludesPrivate", "glass/optics/include/thicklens/glass/a.h",
                "\"glass/optics/secret.h\"", "may not include a private one"},
        Planted{"AnotherModulesPrivate", "fits/src/a.cc", "\"glass/optics/secret.h\"",
                "for their own module only (glass/optics/secret.h)"},
        Planted{"AnotherModulesPrivateByName", "fits/src/a.cc", "\"secret.h\"",
                "for their own module only (glass/optics/secret.h)"},
        Planted{"BaseUsesEigen", "glass/base/include/thicklens/base/a.h", "<Eigen/Core>",
                "a public header of glass/base"},
        Planted{"AllOfOpenCv", "glass/image/a.cc", "<opencv2/opencv.hpp>", "opencv2/core"},
        Planted{"ALongerName", "glass/image/a.cc", "<opencv2/core_detect.hpp>", "opencv2/core"},
        Planted{"PublicFmt", "glass/image/include/thicklens/glass/a.h", "<fmt/format.h>",
                "a public header of glass/image"},
        Planted{"Boost", "fits/src/a.cc", "<boost/any.hpp>", "CLI/"},
        Planted{"ForeignInQuotes", "fits/src/a.cc", "\"boost/any.hpp\"", "CLI/"},
        Planted{"ByMacro", "fits/src/a.cc", "HEADER_NAME", "cannot be judged"},
        Planted{"OpenClCode", "fits/src/a.cl", "<Eigen/Core>", "ceres/, CLI/"},
        Planted{"OtherExtension", "glass/image/a.hpp", "<boost/any.hpp>", "yaml-cpp/"}),
    [](const auto& planted) { return std::string(planted.param.name); });

TEST(IncludeScanner, FindsPrivateHeadersOfLibrariesAlsoThroughOthers) {
  const SourceTree tree = {
      {"program/commands/a.cc",
       "#include <vector>\n#include \"thicklens/glass/camera.h\"\n#include \"program/words.h\"\n"},
      {"program/commands/b.cc", "#include \"glass/optics/secret.h\"\n"},
      {"program/words.h", "#include \"program/words.h\"\n\n # include \"program/io/codec.h\"\n"},
      {"program/words.cc", "#include \"glass/optics/secret.h\"\n"},  // included by nobody
      {"program/io/codec.h", "#include \"glass/optics/secret.h\"\n"},
      {"glass/optics/secret.h", ""},
      {"glass/optics/include/thicklens/glass/camera.h", "#include \"glass/optics/secret.h\"\n"}};
  EXPECT_THAT(PrivateIncludes(tree, "program/commands", {"glass", "program/io"}),
              ElementsAre("program/commands/b.cc:1: includes glass/optics/secret.h",
                          "program/words.h:3: includes program/io/codec.h"));
  EXPECT_THAT(PrivateIncludes(tree, "program/commands", {"other"}), IsEmpty());
}

TEST(IncludeScanner, RefusesAnInternalHeaderInAnInstalledOne) {
  const std::string plumbing = "glass/base/include/thicklens/base/plumbing.h";
  const std::string pipes = "glass/optics/include/thicklens/glass/pipes.h";
  const std::string include = "#include \"thicklens/base/plumbing.h\"\n";
  EXPECT_THAT(Violations({{plumbing, ""},
                          {pipes, include},
                          {"glass/optics/camera.cc", include},
                          {"glass/optics/pupil.h", include},
                          {"glass/optics/include/thicklens/glass/camera.h", include}},
                         RoomsTable::Parse(kTable), {plumbing, pipes}),
              ElementsAre(AllOf(StartsWith("glass/optics/include/thicklens/glass/camera.h:1: "),
                                HasSubstr("may not include an internal one"))));
}

TEST(IncludeScanner, RefusesFilesInTheWrongPlace) {
  EXPECT_THAT(Violations({{"glass/a.cc", ""},
                          {"glass/base/include/thicklens/glass/a.h", ""},
                          {"glass/optics/include/a.h", ""},
                          {"glass/pupil/a.cc", ""}},
                         RoomsTable::Parse(kTable)),
              ElementsAre("glass/a.cc:1: lies in no room",
                          AllOf(StartsWith("glass/base/include/thicklens/glass/a.h:1: "),
                                HasSubstr("allowed: glass/base/include/thicklens/base/")),
                          AllOf(StartsWith("glass/optics/include/a.h:1: "),
                                HasSubstr("allowed: glass/optics/include/thicklens/glass/")),
                          "glass/pupil/a.cc:1: lies in no room"));
}

}  // namespace
}  // namespace thicklens::architecture
