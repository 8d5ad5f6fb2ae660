// The layering of CONTRIBUTING.md, held against every include of the repository.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <set>
#include <sstream>
#include <string>
#include <vector>

#include "house/include_rules.h"

namespace thicklens::house {
namespace {

namespace fs = std::filesystem;
using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::StartsWith;

SourceTree ReadRepository() {
  SourceTree tree;
  const fs::path top = THICKLENS_SOURCE_DIR;
  for (const std::string& module : Modules()) {
    if (!fs::is_directory(top / module)) continue;
    for (const auto& entry : fs::recursive_directory_iterator(top / module)) {
      const std::string path = fs::relative(entry.path(), top).generic_string();
      if (!entry.is_regular_file() || !IsSource(path)) continue;
      std::ifstream file(entry.path(), std::ios::binary);
      EXPECT_TRUE(file.good()) << path;
      std::ostringstream text;
      text << file.rdbuf();
      tree[path] = text.str();
    }
  }
  return tree;
}

std::string Lines(const std::vector<std::string>& lines) {
  std::string joined;
  for (const std::string& line : lines) joined += line + "\n";
  return joined;
}

TEST(IncludeScan, EveryIncludeOfTheRepositoryIsAllowed) {
  const SourceTree tree = ReadRepository();
  // An empty scan would pass, too.
  ASSERT_EQ(tree.count("model/include/thicklens/error.h"), 1u);
  ASSERT_EQ(tree.count("calib/include/thicklens/calib/calibrate.h"), 1u);
  EXPECT_THAT(Lines(Violations(tree)), IsEmpty());
}

TEST(IncludeScan, NoOtherTopLevelFolder) {
  const std::set<std::string> rooms = {"calib",   "configs", "docs",  "estimator",
                                       "kernels", "model",   "tests", "tools"};
  for (const auto& entry : fs::directory_iterator(THICKLENS_SOURCE_DIR)) {
    const std::string name = entry.path().filename().string();
    // Dotted folders, and what .gitignore names: build*, out, fresh-out.
    const bool ignored =
        name[0] == '.' || name.rfind("build", 0) == 0 || name == "out" || name == "fresh-out";
    if (!entry.is_directory() || ignored) continue;
    EXPECT_EQ(rooms.count(name), 1u) << "a top-level folder without a room: " << name;
  }
}

// The scanner itself, on planted trees.

TEST(IncludeScanner, PassesWhatTheTableAllows) {
  EXPECT_THAT(
      Violations({{"model/include/thicklens/error.h", "#include <string>\n"},
                  {"model/include/thicklens/model/camera.h",
                   "#include <Eigen/Core>\n#include \"thicklens/error.h\"\n"},
                  {"model/src/camera.cc",
                   "#include \"thicklens/model/camera.h\"\n#include <yaml-cpp/yaml.h>\n"
                   "#include <fmt/format.h>\n#include \"reader.h\"\n#include <unistd.h>\n"},
                  {"model/src/reader.h", "#include <csv.h>\n#include <opencv2/imgproc.hpp>\n"},
                  {"kernels/src/device.cc", "#include <CL/cl.h>\n#include \"thicklens/error.h\"\n"},
                  {"kernels/src/a.cl", "#include \"b.cl\"\n"},
                  {"kernels/src/b.cl", "// #include <anything.h>\n"},
                  {"calib/include/thicklens/calib/meter.h",
                   "#include <opencv2/core/mat.hpp>\n#include \"thicklens/model/camera.h\"\n"},
                  {"calib/src/meter.cc",
                   "#include <ceres/ceres.h>\n"
                   "#include <opencv2/video/tracking.hpp>\n"},
                  {"estimator/src/h.cc",
                   "#include \"thicklens/kernels/kernels.h\"\n"
                   "#include <suitesparse/umfpack.h>\n"},
                  {"tools/src/main.cc",
                   "#include \"thicklens/calib/meter.h\"\n"
                   "#include <opencv2/imgcodecs.hpp>\n"
                   "#include <CLI/CLI.hpp>\n"}}),
      IsEmpty());
}

struct Planted {
  const char* name;
  const char* path;
  const char* include;
  const char* allowed;  // part of the message
};

// Printed in the place of the structure's bytes where a test fails.
void PrintTo(const Planted& planted, std::ostream* os) { *os << planted.name; }

class IncludeScannerRefuses : public ::testing::TestWithParam<Planted> {};

TEST_P(IncludeScannerRefuses, WithFileLineAndWhatIsAllowed) {
  const Planted& planted = GetParam();
  const SourceTree tree = {
      {"model/src/secret.h", ""},
      {planted.path, std::string("// line 1\n#include <vector>\n  #  include ") + planted.include +
                         "  // why\n"}};
  EXPECT_THAT(Violations(tree),
              ElementsAre(AllOf(StartsWith(std::string(planted.path) + ":3: includes "),
                                HasSubstr(planted.allowed))));
}

INSTANTIATE_TEST_SUITE_P(
    Planted, IncludeScannerRefuses,
    ::testing::Values(
        Planted{"ModelUsesCalib", "model/src/a.cc", "\"thicklens/calib/b.h\"", "cancel.h, nothing"},
        Planted{"CalibUsesEstimator", "calib/src/a.cc", "\"thicklens/estimator/b.h\"",
                "cancel.h, model"},
        Planted{"EstimatorUsesCalib", "estimator/src/a.cc", "<thicklens/calib/b.h>",
                "cancel.h, model, kernels"},
        Planted{"KernelsUseModel", "kernels/src/a.cc", "\"thicklens/model/b.h\"",
                "cancel.h, nothing"},
        Planted{"AModuleNobodyKnows", "tools/src/a.cc", "\"thicklens/util/b.h\"", "calib"},
        Planted{"KernelsUseEigen", "kernels/src/a.cc", "<Eigen/Core>", "fmt/, CL/"},
        Planted{"CalibReadsPictures", "calib/src/a.cc", "<opencv2/imgcodecs.hpp>", "ceres/"},
        Planted{"CalibReadsYaml", "calib/src/a.cc", "<yaml-cpp/yaml.h>", "ceres/"},
        Planted{"AllOfOpenCv", "model/src/a.cc", "<opencv2/opencv.hpp>", "opencv2/core"},
        Planted{"ALongerName", "model/src/a.cc", "<opencv2/core_detect.hpp>", "opencv2/core"},
        Planted{"PublicFmt", "model/include/thicklens/model/a.h", "<fmt/format.h>",
                "a public header of model"},
        Planted{"PublicOpenCv", "model/include/thicklens/model/a.h", "<opencv2/core.hpp>",
                "a public header of model"},
        Planted{"PublicCeres", "calib/include/thicklens/calib/a.h", "<ceres/ceres.h>",
                "a public header of calib"},
        Planted{"PublicIncludesPrivate", "model/include/thicklens/model/a.h", "\"secret.h\"",
                "may not include a private one"},
        Planted{"AnothersPrivate", "calib/src/a.cc", "\"secret.h\"", "model/src/secret.h"},
        Planted{"AnothersPrivateByPath", "calib/src/a.cc", "\"../../model/src/secret.h\"",
                "model/src/secret.h"},
        Planted{"Boost", "tools/src/a.cc", "<boost/any.hpp>", "CLI/"},
        Planted{"ForeignInQuotes", "tools/src/a.cc", "\"boost/any.hpp\"", "CLI/"},
        Planted{"ByMacro", "tools/src/a.cc", "HEADER_NAME", "cannot be judged"},
        Planted{"OpenClCode", "kernels/a.cl", "<Eigen/Core>", "fmt/, CL/"},
        Planted{"OtherExtension", "model/src/a.hpp", "<boost/any.hpp>", "yaml-cpp/"}),
    [](const auto& planted) { return std::string(planted.param.name); });

TEST(IncludeScanner, RefusesPublicHeadersInTheWrongPlace) {
  EXPECT_THAT(Violations({{"calib/include/thicklens/error.h", ""},
                          {"calib/include/thicklens/model/a.h", ""},
                          {"model/include/a.h", ""}}),
              ElementsAre(StartsWith("calib/include/thicklens/error.h:1: "),
                          StartsWith("calib/include/thicklens/model/a.h:1: "),
                          AllOf(StartsWith("model/include/a.h:1: "),
                                HasSubstr("allowed: model/include/thicklens/model/"))));
}

}  // namespace
}  // namespace thicklens::house
