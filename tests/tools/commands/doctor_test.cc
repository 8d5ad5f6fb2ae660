// thicklens doctor as a person meets it, with drivers that misbehave in all the ways they do.
#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <poll.h>
#include <sys/stat.h>
#include <unistd.h>

#include <csignal>
#include <cstdlib>
#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "support/temporary_folder.h"
#include "thicklens/io/image_io.h"
#include "tools/support/child_process.h"

namespace thicklens::tools {
namespace {

namespace fs = std::filesystem;
using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;
using ::testing::StartsWith;
using thicklens::testing::ContentOf;
using thicklens::testing::TemporaryFolder;

// A variable of the environment, for the programs that are started while this lives.
class ScopedVariable {
 public:
  ScopedVariable(std::string name, const std::string& value) : name_(std::move(name)) {
    if (const char* before = std::getenv(name_.c_str())) before_ = before;
    ::setenv(name_.c_str(), value.c_str(), 1);
  }
  ScopedVariable(const ScopedVariable&) = delete;
  ScopedVariable& operator=(const ScopedVariable&) = delete;
  ~ScopedVariable() {
    if (before_) {
      ::setenv(name_.c_str(), before_->c_str(), 1);
    } else {
      ::unsetenv(name_.c_str());
    }
  }

 private:
  std::string name_;
  std::optional<std::string> before_;
};

class DoctorTest : public ::testing::Test {
 protected:
  ProgramResult Run(std::vector<std::string> arguments) const {
    arguments.insert(arguments.begin(), "doctor");
    return ChildProgram(arguments, scratch_.path(), 0).Wait();
  }
  // Returns the JSON of the command, and expects the exit code.
  nlohmann::json Json(const std::string& device, int exit_code = 0) const {
    const std::string file = scratch_ / "doctor.json";
    const ProgramResult result = Run({"--device", device, "--json", file});
    EXPECT_EQ(result.exit_code, exit_code) << result.err;
    return nlohmann::json::parse(ContentOf(file));
  }

  // Expectations if no device can be used, for the reason that contains `why`.
  void ExpectNoDevice(const std::string& why) const {
    const nlohmann::json cpu = Json("cpu");
    EXPECT_EQ(cpu["status"], "ok");
    EXPECT_EQ(cpu["used"]["name"], "cpu");
    EXPECT_TRUE(cpu["opencl"].is_null());

    const ProgramResult fallen_back = Run({});
    EXPECT_EQ(fallen_back.exit_code, 0) << fallen_back.err;
    EXPECT_THAT(
        fallen_back.err,
        AllOf(StartsWith("thicklens: warning: no OpenCL device can be used"), HasSubstr(why)));
    EXPECT_EQ(fallen_back.err.find('\n'), fallen_back.err.size() - 1) << fallen_back.err;
    EXPECT_THAT(fallen_back.out, HasSubstr("used           cpu"));

    const ProgramResult refused = Run({"--device", "opencl", "--json", scratch_ / "refused.json"});
    EXPECT_EQ(refused.exit_code, 1);
    EXPECT_THAT(refused.err,
                AllOf(StartsWith("thicklens: error: device 'opencl' cannot be used"),
                      HasSubstr(why), HasSubstr("the device cpu does not need OpenCL")));
    EXPECT_EQ(refused.err.find('\n'), refused.err.size() - 1) << refused.err;
    const auto json = nlohmann::json::parse(ContentOf(scratch_ / "refused.json"));
    EXPECT_EQ(json["status"], "refused");
    EXPECT_THAT(json["reason"].get<std::string>(), HasSubstr(why));
    ASSERT_EQ(json["opencl"]["problems"].size(), 1U);
    EXPECT_THAT(json["opencl"]["problems"][0].get<std::string>(), HasSubstr(why));
    EXPECT_TRUE(json["used"].is_null());
  }

  TemporaryFolder scratch_;
  TemporaryFolder drivers_;
};

// Returns PoCL's library as installed, or an empty string if it is not.
std::string PoclLibrary() {
  for (const char* folder : {"/usr/lib/x86_64-linux-gnu", "/usr/lib/aarch64-linux-gnu", "/usr/lib",
                             "/usr/lib64", "/usr/local/lib"}) {
    for (const char* name : {"libpocl.so.2", "libpocl.so"}) {
      const fs::path file = fs::path(folder) / name;
      if (fs::exists(file)) return fs::canonical(file).string();
    }
  }
  return "";
}

TEST_F(DoctorTest, SaysWhichImageFilesAreRead) {
  EXPECT_EQ(Json("cpu")["image_files"], io::ReadableImageKinds());
}

TEST_F(DoctorTest, FindsThisMachineWell) {
  const nlohmann::json json = Json("auto");
  EXPECT_EQ(json["status"], "ok");
  EXPECT_EQ(json["reason"], "");
  EXPECT_THAT(json["used"]["name"].get<std::string>(), StartsWith("opencl:"));
  EXPECT_THAT(json["used"]["why"].get<std::string>(), HasSubstr("best working OpenCL device"));
  ASSERT_GE(json["opencl"]["devices"].size(), 1U);
  EXPECT_GT(json["opencl"]["devices"][0]["compute_units"], 0);
  EXPECT_GT(json["opencl"]["devices"][0]["global_memory_bytes"], 1 << 20);
  EXPECT_TRUE(json["self_test"]["agrees"]);
  EXPECT_LE(json["self_test"]["float_relative_error"], 1e-4);
  EXPECT_GT(json["cores"], 0);
  EXPECT_FALSE(json["blas"].get<std::string>().empty());
  EXPECT_THAT(json["block_solvers"], ::testing::Contains("eigen"));
}

TEST_F(DoctorTest, PrintsWhatItFound) {
  const ProgramResult result = Run({"--threads", "1"});
  EXPECT_EQ(result.exit_code, 0);
  EXPECT_EQ(result.err, "");
  EXPECT_THAT(result.out,
              AllOf(StartsWith("thicklens "), HasSubstr(" core(s), 1 thread(s)"),
                    HasSubstr("\nblas  "), HasSubstr("\nblock solvers  "),
                    HasSubstr("\nopencl:0:0 "), HasSubstr("\nused           opencl:"),
                    HasSubstr("the default solver of estimate uses it only with --device opencl"),
                    HasSubstr("\nself-test      yes: ")));
  EXPECT_THAT(Run({"--quiet"}).out, IsEmpty());
}

TEST_F(DoctorTest, CpuDoesNotTouchOpenCl) {
  const ProgramResult result = Run({"--device", "cpu"});
  EXPECT_EQ(result.exit_code, 0);
  EXPECT_THAT(result.out,
              AllOf(HasSubstr("opencl         not examined"),
                    HasSubstr("requested by --device cpu"), Not(HasSubstr("platform"))));
}

TEST_F(DoctorTest, RefusesADeviceThatIsNotThere) {
  const nlohmann::json json = Json("opencl:77", 1);
  EXPECT_EQ(json["status"], "refused");
  EXPECT_THAT(json["reason"].get<std::string>(),
              AllOf(HasSubstr("no such device"), HasSubstr("opencl:0:0")));
  EXPECT_GE(json["opencl"]["devices"].size(), 1U);
}

TEST_F(DoctorTest, RefusesADeviceThatIsNone) {
  const ProgramResult result = Run({"--device", "gpu"});
  EXPECT_EQ(result.exit_code, 2);
  EXPECT_THAT(result.err, HasSubstr("--device: device 'gpu' is unknown"));
}

TEST_F(DoctorTest, WithoutADriver) {
  const ScopedVariable vendors("OCL_ICD_VENDORS", drivers_.path());
  ExpectNoDevice("install one (pocl-opencl-icd");
}

TEST_F(DoctorTest, WithATextAsDriver) {
  drivers_.Put("text.icd", "this is a text, and not the name of a library\n");
  const ScopedVariable vendors("OCL_ICD_VENDORS", drivers_.path());
  ExpectNoDevice(drivers_.path());
}

TEST_F(DoctorTest, WithADriverWhoseLibraryIsMissing) {
  drivers_.Put("missing.icd", "libno-such-driver.so.7\n");
  const ScopedVariable vendors("OCL_ICD_VENDORS", drivers_.path());
  ExpectNoDevice("error -1001");
}

TEST_F(DoctorTest, WithADriverWhoseLibraryIsNone) {
  drivers_.Put("broken.icd", drivers_.Put("broken.so", "no library") + "\n");
  const ScopedVariable vendors("OCL_ICD_VENDORS", drivers_.path());
  ExpectNoDevice("error -1001");
}

// Ctrl-C in a terminal goes to the program and to the child that looks at the drivers: no driver is
// to blame, and nobody waits for one. Opening a pipe that nobody writes to takes forever.
TEST_F(DoctorTest, CtrlCWhileADriverIsLoading) {
  const std::string pipe = drivers_ / "waits.so";
  ASSERT_EQ(::mkfifo(pipe.c_str(), 0600), 0);
  drivers_.Put("waits.icd", pipe + "\n");
  const ScopedVariable vendors("OCL_ICD_VENDORS", drivers_.path());
  const pid_t group = ::getpgrp();
  ::setpgid(0, 0);
  ASSERT_EQ(::getpgrp(), ::getpid());
  const auto before = std::signal(SIGINT, [](int) {});

  ChildProgram program({"doctor", "--json", scratch_ / "doctor.json"}, scratch_.path(), 0);
  int write_end = -1;
  while (write_end < 0 && program.Running()) {
    ::usleep(1000);
    write_end = ::open(pipe.c_str(), O_WRONLY | O_NONBLOCK | O_CLOEXEC);
  }
  ::kill(0, SIGINT);
  const ProgramResult result = program.Wait();
  std::signal(SIGINT, before);
  ::setpgid(0, group);

  ASSERT_GE(write_end, 0) << result.err;
  EXPECT_EQ(result.exit_code, 1);
  EXPECT_EQ(result.err, "thicklens: error: interrupted; nothing was written\n");
  EXPECT_EQ(result.out, "");
  EXPECT_FALSE(fs::exists(scratch_ / "doctor.json"));
  // Nobody reads the pipe any more.
  pollfd readers{write_end, 0, 0};
  EXPECT_EQ(::poll(&readers, 1, 0), 1);
  EXPECT_NE(readers.revents & POLLERR, 0);
  ::close(write_end);
}

// Two copies of PoCL in one process abort in the compiler library that they share.
TEST_F(DoctorTest, WithPoclInstalledTwice) {
  const std::string library = PoclLibrary();
  if (library.empty()) GTEST_SKIP() << "libpocl.so was not found";
  fs::copy_file(library, drivers_ / "libcopy.so");
  drivers_.Put("first.icd", library + "\n");
  drivers_.Put("second.icd", drivers_ / "libcopy.so\n");
  const ScopedVariable vendors("OCL_ICD_VENDORS", drivers_.path());
  ExpectNoDevice("installed twice");
}

// A path below a file cannot be made, not even by root.
TEST_F(DoctorTest, WithACacheFolderThatCannotBeWritten) {
  if (PoclLibrary().empty()) GTEST_SKIP() << "libpocl.so was not found";
  drivers_.Put("only.icd", PoclLibrary() + "\n");
  const ScopedVariable vendors("OCL_ICD_VENDORS", drivers_.path());
  const ScopedVariable cache("POCL_CACHE_DIR", drivers_.Put("file") + "/cache");
  ExpectNoDevice("POCL_CACHE_DIR=" + drivers_.path());
}

}  // namespace
}  // namespace thicklens::tools
