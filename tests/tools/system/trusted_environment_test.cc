// Nothing is loaded from the current folder, and no file gets the number of a closed standard
// descriptor.
#include "tools/system/trusted_environment.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <cstdlib>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>

#include "support/temporary_folder.h"
#include "thicklens/base/output_file.h"
#include "tools/system/program_run.h"

namespace thicklens::tools {
namespace {

namespace fs = std::filesystem;
using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using thicklens::testing::ContentOf;
using thicklens::testing::TemporaryFolder;

// Sets a variable, or takes it out, until the end of the test.
class SetVariable {
 public:
  SetVariable(const char* name, const char* value) : name_(name) {
    if (const char* older = std::getenv(name)) older_ = older;
    value == nullptr ? ::unsetenv(name) : ::setenv(name, value, 1);
  }
  ~SetVariable() { older_ ? ::setenv(name_, older_->c_str(), 1) : ::unsetenv(name_); }
  SetVariable(const SetVariable&) = delete;
  SetVariable& operator=(const SetVariable&) = delete;

 private:
  const char* name_;
  std::optional<std::string> older_;
};

std::string VariableOf(const char* name) {
  const char* value = std::getenv(name);
  return value == nullptr ? "(none)" : value;
}

TEST(TrustedEnvironment, PathsThatAreNotAbsoluteAreLeftOut) {
  const SetVariable cache("POCL_CACHE_DIR", "cache"), temporary("TMPDIR", "."),
      plugins("GDAL_DRIVER_PATH", "/usr/lib:plugins"), fonts("FONTCONFIG_PATH", ":/etc/fonts:"),
      hardware("HWLOC_PLUGINS_PATH", ":"), data("XDG_DATA_DIRS", "/usr/share:/usr/local/share"),
      config("XDG_CONFIG_HOME", "/somewhere"), vendors("OCL_ICD_VENDORS", "./vendors"),
      layers("OPENCL_LAYERS", "libnot-here.so");
  EXPECT_THAT(DistrustRelativePaths(),
              ElementsAre(AllOf(HasSubstr("TMPDIR"), HasSubstr("'.'")),
                          AllOf(HasSubstr("POCL_CACHE_DIR"), HasSubstr("'cache'")),
                          AllOf(HasSubstr("GDAL_DRIVER_PATH"), HasSubstr("'plugins'")),
                          HasSubstr("OCL_ICD_VENDORS")));
  for (const char* name : {"TMPDIR", "HWLOC_PLUGINS_PATH", "OCL_ICD_VENDORS"}) {
    EXPECT_EQ(VariableOf(name), "(none)") << name;
  }
  EXPECT_EQ(VariableOf("GDAL_DRIVER_PATH"), "/usr/lib");
  EXPECT_EQ(VariableOf("FONTCONFIG_PATH"), "/etc/fonts") << "nobody asked for its empty parts";
  EXPECT_EQ(VariableOf("XDG_CONFIG_HOME"), "/somewhere");
  EXPECT_EQ(VariableOf("XDG_DATA_DIRS"), "/usr/share:/usr/local/share");
  EXPECT_EQ(VariableOf("OPENCL_LAYERS"), "libnot-here.so");
}

// PoCL would use /tmp/pocl, where every user may place code that it then loads.
TEST(TrustedEnvironment, CompiledKernelsAreNotSharedWithOtherUsers) {
  const SetVariable home("HOME", nullptr), cache("XDG_CACHE_HOME", nullptr),
      pocl("POCL_CACHE_DIR", nullptr);
  EXPECT_THAT(DistrustRelativePaths(), IsEmpty());
  EXPECT_THAT(VariableOf("POCL_CACHE_DIR"), ::testing::StartsWith("/"));
  EXPECT_THAT(VariableOf("POCL_CACHE_DIR"), ::testing::Not(HasSubstr("/tmp/pocl")));
}

// A file with the name of a library that is not a library stops the loader wherever it looks at it.
TEST(TrustedEnvironment, LibrariesOfTheCurrentFolderAreNotLoaded) {
  const TemporaryFolder folder;
  for (const char* name :
       {"libcsv.so.3", "libfmt.so.9", "libOpenCL.so.1", "libpocl.so.2", "libopencv_core.so.406",
        "thicklens_image_library.so", "thicklens_array_library.so", ".exiv2"}) {
    folder.Put(name, "no library");
  }
  const ProgramRun run =
      RunProgram(THICKLENS_PROGRAM, {"doctor", "--device", "cpu"}, folder.path(), 60);
  EXPECT_EQ(run.exit_code, 0) << run.err;
  EXPECT_THAT(run.out, HasSubstr("JPEG"));
}

// The library of decoders is searched only by the search path of the program.
TEST(TrustedEnvironment, DecodersAreNotFoundByARelativeSearchPath) {
  const TemporaryFolder folder;
  folder.Put("thicklens_image_library.so", "no library");
  const ProgramRun run = RunProgram(
      "/usr/bin/env", {"LD_LIBRARY_PATH=.", THICKLENS_PROGRAM, "doctor", "--device", "cpu"},
      folder.path(), 60);
  EXPECT_EQ(run.exit_code, 0) << run.err;
}

class ClosedDescriptors : public ::testing::TestWithParam<const char*> {};

TEST_P(ClosedDescriptors, OutputsHoldWhatBelongsThere) {
  const TemporaryFolder folder;
  const std::string camera =
      std::string(THICKLENS_SOURCE_DIR) + "/configs/cameras/macro-bench.yaml";
  // It warns of assumed values, and prints a table.
  const std::string command =
      "exec " + ShellCommand({THICKLENS_PROGRAM, "explain", camera, "--depth-range", "280:320",
                              "--json", folder / "a.json", "--figure", folder / "a.svg"});
  const ProgramRun run =
      RunProgram("/bin/sh", {"-c", command + " " + GetParam()}, folder.path(), 60);
  EXPECT_EQ(run.exit_code, 0) << run.err;
  EXPECT_EQ(nlohmann::json::parse(ContentOf(folder / "a.json"))["status"], "ok");
  const std::string figure = ContentOf(folder / "a.svg");
  EXPECT_THAT(figure, AllOf(HasSubstr("<svg"), ::testing::EndsWith("</svg>\n")));
}

INSTANTIATE_TEST_SUITE_P(TrustedEnvironment, ClosedDescriptors,
                         ::testing::Values("2>&-", ">&-", "<&-", "2>&- >&-", "<&- >&- 2>&-"));

TEST(TrustedEnvironment, ClosedDescriptorsAreTheNullDevice) {
  const TemporaryFolder folder;
  // The process is examined only when the program runs, because before that the shell's descriptors
  // are closed.
  const std::string command =
      ShellCommand({THICKLENS_PROGRAM, "bench", "solvers", "--size", "2048x2048", "--quiet"}) +
      " <&- >&- 2>&- & for i in 1 2 3 4 5 6 7 8 9 10 11 12 13 14 15; do sleep 0.3; "
      "ls -l /proc/$!/fd >fds 2>no-proc; grep -q ' 2 -> ' fds && break; done; kill -9 $!";
  RunProgram("/bin/sh", {"-c", command}, folder.path(), 60);
  if (!fs::exists("/proc/self/fd")) GTEST_SKIP() << "there is no /proc";
  const std::string descriptors = ContentOf(folder / "fds");
  for (const char* descriptor : {" 0 -> /dev/null", " 1 -> /dev/null", " 2 -> /dev/null"})
    EXPECT_THAT(descriptors, HasSubstr(descriptor));
}

}  // namespace
}  // namespace thicklens::tools
