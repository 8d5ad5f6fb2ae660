#include "thicklens/kernels/device.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <poll.h>
#include <sys/wait.h>
#include <unistd.h>

#include <atomic>
#include <chrono>
#include <cmath>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include "kernels/opencl/device_choice.h"
#include "kernels/opencl/device_survey.h"
#include "kernels/opencl/isolated_subprocess.h"
#include "kernels/opencl/opencl_program.h"
#include "kernels/opencl/opencl_use.h"
#include "support/error_message.h"
#include "thicklens/base/cancel.h"
#include "thicklens/base/error.h"
#include "thicklens/kernels/kernels.h"

namespace thicklens::kernels {
namespace {

using ::testing::AllOf;
using ::testing::ElementsAre;
using testing::ErrorOf;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;
using Kind = DeviceRequest::Kind;

constexpr double kLongS = 60;

// The first use of OpenCL must be in a child process, so tests that need a device begin with this
// function.
const DeviceDescription& AnyDevice() {
  const DeviceSurvey& survey = SurveyDevices();
  for (const DeviceDescription& device : survey.devices) {
    if (device.problem.empty()) return device;
  }
  throw Error("these tests need an OpenCL device (pocl-opencl-icd is one)");
}

std::shared_ptr<const OpenClDevice> OpenAnyDevice() {
  const DeviceDescription& device = AnyDevice();
  return OpenOpenClDevice(device.platform, device.device);
}

TEST(DeviceRequest, IsReadFromText) {
  EXPECT_EQ(ParseDeviceRequest("auto").kind, Kind::kAuto);
  EXPECT_EQ(ParseDeviceRequest("cpu").kind, Kind::kCpu);
  for (const char* text : {"opencl", "opencl:2", "opencl:0:13"}) {
    EXPECT_EQ(ParseDeviceRequest(text).kind, Kind::kOpenCl);
    EXPECT_EQ(RequestText(ParseDeviceRequest(text)), text);
  }
  const DeviceRequest request = ParseDeviceRequest("opencl:2:13");
  EXPECT_EQ(request.platform, 2);
  EXPECT_EQ(request.device, 13);
  EXPECT_EQ(ParseDeviceRequest("opencl:2").device, -1);
}

TEST(DeviceRequest, RefusesWhatItDoesNotKnow) {
  for (const char* text : {"", "gpu", "CPU", "opencl:", "opencl:x", "opencl:1:", "opencl::1",
                           "opencl:1:2:3", "opencl:-1", "opencl:1 ", "openclx", "opencl:99999"}) {
    EXPECT_THAT(ErrorOf([&] { ParseDeviceRequest(text); }),
                AllOf(HasSubstr(std::string("'") + text + "'"),
                      HasSubstr("auto, cpu, opencl, opencl:PLATFORM or opencl:PLATFORM:DEVICE")));
  }
}

DeviceDescription Device(int platform, int device, const std::string& name, const std::string& type,
                         bool has_double, const std::string& problem = "") {
  DeviceDescription known;
  known.platform = platform;
  known.device = device;
  known.name = name;
  known.type = type;
  known.has_double = has_double;
  known.problem = problem;
  return known;
}

std::vector<std::string> NamesOf(const std::vector<DeviceDescription>& devices) {
  std::vector<std::string> names;
  for (const DeviceDescription& device : devices) names.push_back(device.name);
  return names;
}

DeviceSurvey ManyDevices() {
  DeviceSurvey survey;
  survey.devices = {Device(0, 0, "Oclgrind Simulator", "gpu", true),
                    Device(1, 0, "processor", "cpu", true),
                    Device(1, 1, "card without double", "gpu", false),
                    Device(2, 0, "card", "gpu", true),
                    Device(2, 1, "broken card", "gpu", true, "not available"),
                    Device(3, 0, "board", "accelerator", true),
                    Device(3, 1, "something", "other", true),
                    Device(4, 0, "second card", "gpu", true)};
  return survey;
}

TEST(Candidates, AreSortedWithSimulatorsLast) {
  std::vector<std::string> problems;
  EXPECT_THAT(NamesOf(Candidates(ManyDevices(), {}, &problems)),
              ElementsAre("card", "second card", "board", "processor", "something",
                          "card without double", "Oclgrind Simulator"));
  EXPECT_THAT(problems, ElementsAre("device opencl:2:1 (broken card): not available"));
}

TEST(Candidates, AreThoseThatWereAskedFor) {
  std::vector<std::string> problems;
  EXPECT_THAT(NamesOf(Candidates(ManyDevices(), ParseDeviceRequest("opencl:1"), &problems)),
              ElementsAre("processor", "card without double"));
  EXPECT_THAT(NamesOf(Candidates(ManyDevices(), ParseDeviceRequest("opencl:0:0"), &problems)),
              ElementsAre("Oclgrind Simulator"));
  EXPECT_THAT(problems, IsEmpty());
  EXPECT_THAT(Candidates(ManyDevices(), ParseDeviceRequest("opencl:1:2"), &problems), IsEmpty());
  ASSERT_EQ(problems.size(), 1U);
  EXPECT_THAT(problems[0], AllOf(HasSubstr("no such device"), HasSubstr("opencl:1:0 (processor)")));
}

TEST(OneLine, HasNoControlCharacters) {
  EXPECT_EQ(OneLine("\n  one\ttwo \r\n three\x7f\n"), "one two three");
  EXPECT_EQ(OneLine(" \n"), "");
  EXPECT_EQ(OneLine("\xc3\xa9"), "\xc3\xa9");
}

TEST(RunInSubprocess, TheReportOfTheChildArrives) {
  const SubprocessOutcome outcome = RunInSubprocess(
      [](const SubprocessReport& report) {
        report("one\n");
        std::puts("chatter");
        report(std::string(300000, 'x'));
      },
      kLongS);
  EXPECT_EQ(outcome.failure, "");
  EXPECT_EQ(outcome.reported, "one\n" + std::string(300000, 'x'));
}

TEST(RunInSubprocess, LeavesThisProcessAlone) {
  int here = 1;
  RunInSubprocess([&here](const SubprocessReport&) { here = 2; }, kLongS);
  EXPECT_EQ(here, 1);
}

TEST(RunInSubprocess, SurvivesWhateverTheChildDoes) {
  const auto failure = [](const std::function<void()>& work, double limit_s = kLongS) {
    const SubprocessOutcome outcome = RunInSubprocess(
        [&work](const SubprocessReport& report) {
          report("before");
          work();
        },
        limit_s);
    EXPECT_EQ(outcome.reported, "before");
    return outcome.failure;
  };
  EXPECT_THAT(failure([] { ::raise(SIGKILL); }), HasSubstr("crashed (signal 9"));
  EXPECT_THAT(failure([] { std::abort(); }), HasSubstr("crashed (signal 6"));
  EXPECT_THAT(failure([] { ::_exit(3); }), HasSubstr("failed (exit code 3)"));
  EXPECT_THAT(failure([] { throw Error("a reason"); }),
              HasSubstr("the last line of its output: a reason"));
  EXPECT_THAT(failure([] { throw 1; }), HasSubstr("failed"));
  EXPECT_THAT(failure(
                  [] {
                    while (true) ::pause();
                  },
                  0.2),
              HasSubstr("did not end within 0.2 s"));
}

TEST(RunInSubprocess, CatchesWhatIsPrintedAndTellsItsLastLine) {
  ::testing::internal::CaptureStdout();
  ::testing::internal::CaptureStderr();
  const SubprocessOutcome outcome = RunInSubprocess(
      [](const SubprocessReport&) {
        std::fputs("first\n", stdout);
        std::fflush(stdout);
        std::fputs("second:\tcause\n\n", stderr);
        std::abort();
      },
      kLongS);
  EXPECT_EQ(::testing::internal::GetCapturedStdout(), "");
  EXPECT_EQ(::testing::internal::GetCapturedStderr(), "");
  EXPECT_THAT(outcome.failure, ::testing::EndsWith("the last line of its output: second: cause"));
}

// A grandchild that outlives the child must not block the parent.
TEST(RunInSubprocess, DoesNotWaitForGrandchildren) {
  const SubprocessOutcome outcome = RunInSubprocess(
      [](const SubprocessReport& report) {
        const pid_t grandchild = ::fork();
        if (grandchild == 0) {
          ::sleep(30);
          ::_exit(0);
        }
        report(std::to_string(grandchild));
      },
      kLongS);
  EXPECT_EQ(outcome.failure, "");
  EXPECT_EQ(::kill(std::stoi(outcome.reported), SIGKILL), 0);
}

TEST(RunInSubprocess, DoesNotInheritSignalHandlersOrBlockedSignals) {
  const auto before = std::signal(SIGALRM, SIG_IGN);
  const SubprocessOutcome outcome =
      RunInSubprocess([](const SubprocessReport&) { ::raise(SIGALRM); }, kLongS);
  std::signal(SIGALRM, before);
  EXPECT_THAT(outcome.failure, HasSubstr("crashed (signal 14"));
}

// Ctrl-C in a terminal and the stop of a service signal the whole group. The child sends the
// signals itself, so that they arrive while it works, and it is in a group of its own, so that no
// other process gets them.
TEST(RunInSubprocess, LeavesRequestsToStopToTheParent) {
  const SubprocessOutcome tested = RunInSubprocess(
      [](const SubprocessReport& tell_test) {
        static std::atomic<int> heard{0};
        std::signal(SIGINT, [](int) { ++heard; });
        const pid_t parents_group = ::getpgrp();
        const SubprocessOutcome outcome = RunInSubprocess(
            [parents_group](const SubprocessReport& report) {
              ::kill(-parents_group, SIGINT);
              ::raise(SIGINT);
              ::raise(SIGTERM);
              ::raise(SIGHUP);
              report(::getpgrp() == parents_group ? "in the parent's group" : "went on");
            },
            kLongS);
        tell_test(outcome.reported + ", parent heard " + std::to_string(heard) + outcome.failure);
      },
      kLongS);
  EXPECT_EQ(tested.reported, "went on, parent heard 1");
  EXPECT_EQ(tested.failure, "");
}

TEST(RunInSubprocess, ARequestToStopEndsTheChildAndItsChildren) {
  int ends[2];
  ASSERT_EQ(::pipe(ends), 0);
  int calls = 0;
  EXPECT_THROW(RunInSubprocess(
                   [&ends](const SubprocessReport&) {
                     ::fork();
                     while (::write(ends[1], "+", 1) == 1) ::pause();
                   },
                   kLongS,
                   [&] {
                     char both[2];
                     // Both processes run before the end begins.
                     if (++calls == 3) {
                       EXPECT_EQ(::read(ends[0], both, 1), 1);
                       EXPECT_EQ(::read(ends[0], both, 1), 1);
                       throw Interrupted();
                     }
                   }),
               Interrupted);
  EXPECT_EQ(calls, 3);
  // Ends only after all copies of the other end are closed.
  ::close(ends[1]);
  pollfd hang_up{ends[0], 0, 0};
  EXPECT_EQ(::poll(&hang_up, 1, 10000), 1) << "what the child started lives on";
  ::close(ends[0]);
  EXPECT_EQ(::waitpid(-1, nullptr, WNOHANG), -1) << "the child was not waited for";
}

// The child must end however its parent ends. Here the parent ends at once, as after a second
// signal.
TEST(RunInSubprocess, EndsWithTheProcessThatStartedIt) {
  int ends[2];
  ASSERT_EQ(::pipe(ends), 0);
  const SubprocessOutcome outcome = RunInSubprocess(
      [&ends](const SubprocessReport&) {
        std::thread([&ends] {
          char one = 0;
          if (::read(ends[0], &one, 1) == 1) ::_exit(3);
        }).detach();
        RunInSubprocess(
            [&ends](const SubprocessReport&) {
              while (::write(ends[1], "+", 1) == 1) ::pause();
            },
            kLongS);
      },
      kLongS);
  EXPECT_THAT(outcome.failure, HasSubstr("exit code 3"));
  // Ends only after all copies of the other end are closed.
  ::close(ends[1]);
  pollfd hang_up{ends[0], 0, 0};
  EXPECT_EQ(::poll(&hang_up, 1, 10000), 1) << "the child lives on";
  ::close(ends[0]);
}

TEST(RunInSubprocess, IsStoppedByTheTokenToo) {
  CancelToken token;
  const CancelScope scope(&token);
  std::thread other([&token] {
    std::this_thread::sleep_for(std::chrono::milliseconds(20));
    token.Cancel();
  });
  EXPECT_THROW(RunInSubprocess([](const SubprocessReport&) { ::pause(); }, kLongS), Interrupted);
  other.join();
}

TEST(RunInSubprocess, NeverBlamesTheWorkForARequestToStop) {
  for (const int signal : {SIGINT, SIGTERM, SIGHUP}) {
    const auto work = [signal](const SubprocessReport&) {
      std::signal(signal, SIG_DFL);
      ::raise(signal);
    };
    EXPECT_THROW(RunInSubprocess(work, kLongS), Interrupted) << signal;
    EXPECT_THROW(SurveyWith([&](int, const SubprocessReport& report) { work(report); }, kLongS),
                 Interrupted);
  }
}

TEST(Survey, EveryFieldOfADeviceIsReported) {
  DeviceDescription device = Device(1, 2, "a\tname\nin lines", "gpu", true, "a problem");
  device.platform_name = "platform";
  device.platform_version = "OpenCL 1.2";
  device.version = "OpenCL 3.0";
  device.driver_version = "";
  device.compute_units = 7;
  device.global_memory_bytes = 1ULL << 40;
  device.max_allocation_bytes = 1ULL << 38;
  device.local_memory_bytes = 65536;
  device.max_work_group = 1024;
  const DeviceSurvey survey =
      SurveyWith([&](int, const SubprocessReport& report) { report(DeviceLine(device)); }, kLongS);
  ASSERT_EQ(survey.devices.size(), 1U);
  const DeviceDescription& read = survey.devices[0];
  EXPECT_EQ(read.platform, 1);
  EXPECT_EQ(read.device, 2);
  EXPECT_EQ(read.name, "a name in lines");
  EXPECT_EQ(read.platform_name, "platform");
  EXPECT_EQ(read.platform_version, "OpenCL 1.2");
  EXPECT_EQ(read.version, "OpenCL 3.0");
  EXPECT_EQ(read.driver_version, "");
  EXPECT_EQ(read.type, "gpu");
  EXPECT_EQ(read.compute_units, 7);
  EXPECT_TRUE(read.has_double);
  EXPECT_EQ(read.global_memory_bytes, 1ULL << 40);
  EXPECT_EQ(read.max_allocation_bytes, 1ULL << 38);
  EXPECT_EQ(read.local_memory_bytes, 65536U);
  EXPECT_EQ(read.max_work_group, 1024U);
  EXPECT_EQ(read.problem, "a problem");
}

// A driver that crashes does not hide the devices of the others.
TEST(Survey, GoesOnAfterAPlatformThatCrashes) {
  const DeviceSurvey survey = SurveyWith(
      [](int first_platform, const SubprocessReport& report) {
        for (int platform = first_platform; platform < 3; ++platform) {
          report(PlatformLine(platform, "platform " + std::to_string(platform)));
          if (platform == 1) std::abort();
          report(
              DeviceLine(Device(platform, 0, "device " + std::to_string(platform), "cpu", true)));
        }
      },
      kLongS);
  EXPECT_THAT(NamesOf(survey.devices), ElementsAre("device 0", "device 2"));
  ASSERT_EQ(survey.problems.size(), 1U);
  EXPECT_THAT(survey.problems[0],
              AllOf(HasSubstr("OpenCL platform 1 (platform 1)"), HasSubstr("crashed (signal 6")));
}

TEST(Survey, EndsIfTheDriversCannotEvenBeLoaded) {
  const DeviceSurvey crashed =
      SurveyWith([](int, const SubprocessReport&) { std::abort(); }, kLongS);
  ASSERT_EQ(crashed.problems.size(), 1U);
  EXPECT_THAT(crashed.problems[0],
              AllOf(HasSubstr("loading the drivers crashed"), HasSubstr("installed twice")));
  const DeviceSurvey hung = SurveyWith(
      [](int, const SubprocessReport&) {
        while (true) ::pause();
      },
      0.2);
  ASSERT_EQ(hung.problems.size(), 1U);
  EXPECT_THAT(hung.problems[0], HasSubstr("did not end within 0.2 s"));
}

// A survey of the drivers of this machine. Every machine that runs these tests has a device: PoCL.
TEST(Survey, FindsADevice) {
  const DeviceDescription& device = AnyDevice();
  EXPECT_FALSE(device.name.empty());
  EXPECT_FALSE(device.platform_name.empty());
  EXPECT_THAT(device.version, HasSubstr("OpenCL"));
  EXPECT_GT(device.compute_units, 0);
  EXPECT_GT(device.global_memory_bytes, 1U << 26);
  EXPECT_GE(device.global_memory_bytes, device.max_allocation_bytes);
  EXPECT_GE(device.max_work_group, 64U);
  EXPECT_EQ(&SurveyDevices(), &SurveyDevices());
}

TEST(OpenBackend, CpuIsTheReference) {
  std::string notice = "old";
  const auto backend = OpenBackend(ParseDeviceRequest("cpu"), &notice);
  EXPECT_FALSE(backend->is_opencl());
  EXPECT_TRUE(backend->has_double());
  EXPECT_EQ(backend->name(), "cpu");
  EXPECT_EQ(notice, "");
  EXPECT_NE(backend->NewFloat(), nullptr);
  EXPECT_NE(backend->NewDouble(), nullptr);
}

TEST(OpenBackend, AutoIsADeviceWhereThereIsOne) {
  std::string notice;
  const auto backend = OpenBackend(ParseDeviceRequest("auto"), &notice);
  EXPECT_TRUE(backend->is_opencl()) << notice;
  EXPECT_EQ(notice, "");
  EXPECT_EQ(backend->name().rfind("opencl:", 0), 0U);
  EXPECT_FALSE(backend->description().empty());
  const auto same = OpenBackend(ParseDeviceRequest(backend->name()), nullptr);
  EXPECT_EQ(same->name(), backend->name());
}

// The request arrives first during the survey, then during the trial of a device.
TEST(OpenBackend, ARequestToStopIsObeyed) {
  const auto stop = [] { throw Interrupted(); };
  if (IsOpenClInUse()) GTEST_SKIP() << "OpenCL is in use: no child is waited for any more";
  EXPECT_THROW(SurveyDevices(true, stop), Interrupted);
  std::string notice;
  EXPECT_THROW(OpenBackend(ParseDeviceRequest("auto"), &notice, stop), Interrupted);
  EXPECT_FALSE(SurveyDevices().devices.empty());
  EXPECT_THROW(OpenBackend(ParseDeviceRequest("auto"), &notice, stop), Interrupted);
  EXPECT_THROW(OpenBackend(ParseDeviceRequest("opencl"), &notice, stop), Interrupted);
  EXPECT_EQ(notice, "");
  EXPECT_TRUE(OpenBackend(ParseDeviceRequest("auto"), &notice, [] {})->is_opencl()) << notice;
}

TEST(OpenBackend, NamesTheDevicesThereAreIfAnotherIsAskedFor) {
  AnyDevice();
  EXPECT_THAT(ErrorOf([] { OpenBackend(ParseDeviceRequest("opencl:900"), nullptr); }),
              AllOf(HasSubstr("device 'opencl:900' cannot be used"), HasSubstr("no such device"),
                    HasSubstr("opencl:0:0"), Not(HasSubstr("\n"))));
}

TEST(OpenBackend, ServesSeveralThreads) {
  const auto backend = OpenBackend(ParseDeviceRequest("opencl"), nullptr);
  std::atomic<int> good{0};
  std::vector<std::thread> threads;
  for (int i = 0; i < 4; ++i) {
    threads.emplace_back([&] {
      const CsrMatrix<float> two{1, 1, {0, 1}, {0}, {2}};
      if (backend->NewFloat()->Multiply(two, {3}) == std::vector<float>{6}) ++good;
    });
  }
  for (std::thread& thread : threads) thread.join();
  EXPECT_EQ(good, 4);
}

TEST(BuildProgram, HasTheCompilersMessageWithFileAndLine) {
  const auto device = OpenAnyDevice();
  const std::vector<EmbeddedFile> files = {
      {"kernels/opencl/first.cl", "kernel void First(global REAL* x) { x[0] = 1; }\n// end\n"},
      {"kernels/opencl/second.cl",
       "kernel void Second(global REAL* x) {\n  x[0] = nonsense;\n}\n"}};
  const std::string message = ErrorOf([&] { BuildProgram(*device, files, "float"); });
  EXPECT_THAT(
      message,
      AllOf(HasSubstr("device " + device->name), HasSubstr("do not build for float"),
            HasSubstr("kernels/opencl/second.cl:2"), HasSubstr("nonsense"), Not(HasSubstr("\n"))));
  EXPECT_THAT(message, Not(HasSubstr("first.cl:")));
}

// The log is what NVIDIA's compiler printed for the program of the test above.
TEST(BuildProgram, NamesFilesWhereTheCompilerCountsTheLinesOfAllOfThem) {
  const std::string source =
      "#pragma OPENCL EXTENSION cl_khr_fp64 : enable\n"
      "#line 1 \"kernels/opencl/first.cl\"\nkernel void First(global REAL* x) { x[0] = 1; }\n"
      "// end\n\n"
      "#line 1 \"kernels/opencl/second.cl\"\nkernel void Second(global REAL* x) {\n"
      "  x[0] = nonsense;\n}\n\n";
  EXPECT_EQ(WithFilesNamed("<kernel>:8:10: error: use of undeclared identifier 'nonsense'\n"
                           "  x[0] = nonsense;\n         ^\n<kernel>:3:1: note: see here\n",
                           source),
            "kernels/opencl/second.cl:2:10: error: use of undeclared identifier 'nonsense'\n"
            "  x[0] = nonsense;\n         ^\nkernels/opencl/first.cl:1:1: note: see here\n");
  // Logs that name no file, a line that does not exist, or that are from other compilers stay
  // unchanged.
  for (const char* log : {"<kernel>:1:1: x", "<kernel>:0:1: x", "<kernel>:11:1: x", "a.cl:8:1: x",
                          "<kernel>:99999999999:1: x", ""}) {
    EXPECT_EQ(WithFilesNamed(log, source), log);
  }
}

TEST(BuildProgram, TheProgramGetsItsRealType) {
  const auto device = OpenAnyDevice();
  const std::vector<EmbeddedFile> wants_float = {
      {"a.cl",
       "#ifdef REAL_IS_DOUBLE\n#error double\n#endif\n"
       "kernel void K(global REAL* x, global float* y) { y = x; }\n"}};
  const std::vector<EmbeddedFile> wants_double = {
      {"a.cl",
       "#ifndef REAL_IS_DOUBLE\n#error float\n#endif\n"
       "kernel void K(global REAL* x, global double* y) { y = x; }\n"}};
  EXPECT_EQ(ErrorOf([&] { BuildProgram(*device, wants_float, "float"); }), "(no error)");
  EXPECT_THAT(ErrorOf([&] { BuildProgram(*device, wants_double, "float"); }), HasSubstr("build"));
  if (!device->has_double) GTEST_SKIP() << "the device has no double";
  EXPECT_EQ(ErrorOf([&] { BuildProgram(*device, wants_double, "double"); }), "(no error)");
  EXPECT_THAT(ErrorOf([&] { BuildProgram(*device, wants_float, "double"); }), HasSubstr("build"));
}

TEST(BuildProgram, RefusesDoubleWhereThereIsNone) {
  OpenClDevice device = *OpenAnyDevice();
  device.has_double = false;
  EXPECT_THAT(ErrorOf([&] { BuildProgram(device, EmbeddedKernelFiles(), "double"); }),
              HasSubstr("does not support double precision"));
}

TEST(TryDevice, ADeviceThatCannotBuildTheKernelsIsReported) {
  const DeviceDescription& device = AnyDevice();
  EXPECT_EQ(TryDevice(device.platform, device.device, EmbeddedKernelFiles()), "");
  EXPECT_THAT(TryDevice(device.platform, device.device, {{"broken.cl", "no C\n"}}),
              HasSubstr("broken.cl:1"));
  EXPECT_THAT(TryDevice(device.platform, 900, EmbeddedKernelFiles()),
              HasSubstr("device opencl:" + std::to_string(device.platform) + ":900"));
}

}  // namespace
}  // namespace thicklens::kernels
