// Every command is stopped at random moments.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <csignal>
#include <cstdio>
#include <filesystem>
#include <functional>
#include <map>
#include <random>
#include <set>
#include <string>
#include <thread>
#include <vector>

#include "support/temporary_folder.h"
#include "tools/support/child_process.h"
#include "tools/support/stopped_program.h"

namespace thicklens::tools {
namespace {

namespace fs = std::filesystem;
using Arguments = std::vector<std::string>;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

constexpr int kMoments = 50;
constexpr int kThreadsOfCommand = 2;
constexpr double kRequired_s = 1;

double SecondsBetween(std::chrono::steady_clock::time_point from,
                      std::chrono::steady_clock::time_point to) {
  return std::chrono::duration<double>(to - from).count();
}

// The largest delay so far with which the machine wakes a sleeping thread. On a busy machine all
// waiting threads are delayed.
class Lateness {
 public:
  Lateness() : thread_([this] { Watch(); }) {}
  ~Lateness() {
    is_over_ = true;
    thread_.join();
  }
  Lateness(const Lateness&) = delete;
  Lateness& operator=(const Lateness&) = delete;

  // Since the last call.
  double TakeWorst() { return worst_s_.exchange(0); }

 private:
  void Watch() {
    constexpr double kSleep_s = 0.005;
    while (!is_over_) {
      const auto start = std::chrono::steady_clock::now();
      std::this_thread::sleep_for(std::chrono::duration<double>(kSleep_s));
      const double late_s = SecondsBetween(start, std::chrono::steady_clock::now()) - kSleep_s;
      if (late_s > worst_s_) worst_s_ = late_s;
    }
  }

  std::atomic<bool> is_over_{false};
  std::atomic<double> worst_s_{0};
  std::thread thread_;
};

// All that is below a folder.
std::set<std::string> NamesBelow(const std::string& folder) {
  std::set<std::string> names;
  for (const auto& entry : fs::recursive_directory_iterator(folder)) {
    names.insert(fs::relative(entry.path(), folder).string());
  }
  return names;
}

struct StoppedCommand {
  std::string name;
  Arguments arguments;            // its outputs are below kOutputs
  std::set<std::string> whole{};  // the names of all its outputs
  double seconds = 0;             // that it takes
};

class InterruptMoments : public ::testing::Test {
 protected:
  std::string Config(const std::string& name) const {
    return std::string(THICKLENS_SOURCE_DIR "/configs/") + name;
  }

  void Succeed(const Arguments& arguments) const {
    const ProgramResult result = ChildProgram(arguments, scratch_.path(), 0).Wait();
    ASSERT_EQ(result.exit_code, 0) << result.err;
  }

  // Makes the inputs of the commands.
  void MakeInputs() const {
    Succeed({"simulate", "image", Config("scenes/demo.yaml"), "-o", inputs_ / "image"});
    Succeed({"simulate", "light-field", Config("scenes/demo.yaml"), "--views", "3x3", "-o",
             inputs_ / "truth"});
    Succeed({"simulate", "sweep", Config("sweeps/case-iv.yaml"), "-o", inputs_ / "sweep"});
    Succeed(Estimate({"--views", "3x3", "-o", inputs_ / "estimate"}));
  }
  Arguments Estimate(const Arguments& more) const {
    Arguments all = {"estimate",
                     inputs_ / "image/picture.png",
                     inputs_ / "image/depth.pfm",
                     "--depth-kind",
                     "z",
                     "--depth-unit",
                     "mm",
                     "--camera",
                     inputs_ / "image/camera.yaml"};
    all.insert(all.end(), more.begin(), more.end());
    return all;
  }

  std::vector<StoppedCommand> Commands() const {
    const std::string out = outputs_ / "out", json = outputs_ / "out.json";
    return {
        {"simulate image",
         {"simulate", "image", Config("scenes/demo.yaml"), "--ablate", "-o", out}},
        {"simulate light-field",
         {"simulate", "light-field", Config("scenes/demo.yaml"), "-o", out}},
        {"simulate sweep",
         {"simulate", "sweep", Config("sweeps/case-ii.yaml"), "--ablate", "-o", out}},
        {"calibrate",
         {"calibrate", inputs_ / "sweep/sweep.yaml", "--floor-px", "0.5:0.05", "--report", out,
          "-o", outputs_ / "camera.yaml"}},
        {"estimate scene", Estimate({"--views", "7x7", "--prior", "patches", "--report",
                                     outputs_ / "report", "-o", out})},
        {"estimate blocks", Estimate({"--views", "3x3", "--solver", "blocks", "--block-px", "48",
                                      "--checkpoint", outputs_ / "blocks", "-o", out})},
        {"estimate grid", Estimate({"--views", "7x7", "--solver", "grid", "-o", out})},
        {"estimate functional",
         Estimate({"--views", "5x5", "--solver", "functional", "--fill", "telea", "-o", out})},
        {"render", {"render", inputs_ / "truth", "--as-captured", "-o", outputs_ / "out.png"}},
        {"compare",
         {"compare", inputs_ / "truth", inputs_ / "estimate", "--dibr",
          inputs_ / "image/picture.png", inputs_ / "image/depth.pfm", "--depth-kind", "z",
          "--depth-unit", "mm", "--json", json}},
        {"report",
         {"report", inputs_ / "estimate", "--truth", inputs_ / "truth", "--photo",
          inputs_ / "image/picture.png", "-o", outputs_ / "out.html"}},
        {"explain",
         {"explain", inputs_ / "image/camera.yaml", "--depth-range", "290:310", "--costs",
          "--figure", outputs_ / "out.svg"}},
        {"bench calibration", {"bench", "calibration", "--sweeps", "2", "--report", out}},
        {"bench inpainting", {"bench", "inpainting", "--json", json}},
        {"doctor", {"doctor", "--json", json}},
        {"doctor --hard-cases", {"doctor", "--hard-cases", "--only", "estimator", "--json", json}},
        {"target", {"target", "--dpi", "300", "-o", outputs_ / "out.png"}},
    };
  }

  StoppedProgram::Settings Settings() const { return {scratch_.path(), temporary_.path(), {}}; }

  // Measures the time of the whole command, up to a limit.
  void MeasureWhole(StoppedCommand* command) {
    constexpr double kMax_s = 5;
    const auto start = std::chrono::steady_clock::now();
    StoppedProgram program(command->arguments, Settings());
    const auto so_far_s = [&] { return SecondsBetween(start, std::chrono::steady_clock::now()); };
    while (!program.HasEnded() && so_far_s() < kMax_s) {
      std::this_thread::sleep_for(std::chrono::milliseconds(5));
    }
    command->seconds = so_far_s();
    const bool is_whole = program.HasEnded();
    program.Send(SIGTERM);
    const StoppedProgram::End end = program.Wait();
    if (is_whole) {
      ASSERT_EQ(end.exit_code, 0) << command->name << ": " << end.err;
      command->whole = NamesBelow(outputs_.path());
    }
    Empty();
  }

  void Empty() const {
    for (const std::string& name : outputs_.Entries()) fs::remove_all(outputs_ / name);
  }

  // The outputs that are there are those of a whole run or some of them, each complete.
  void ExpectNothingHalfWritten(const StoppedCommand& command, const StoppedProgram::End& end) {
    EXPECT_THAT(temporary_.Entries(), IsEmpty());
    std::set<std::string> left = NamesBelow(outputs_.path());
    left.erase("blocks");  // a checkpoint is there to stay
    if (end.exit_code == 0) {
      if (!command.whole.empty()) {
        EXPECT_EQ(left, command.whole);
      }
      return;
    }
    if (end.exit_code == 1) {
      EXPECT_THAT(end.err, HasSubstr("interrupted"));
    }
    if (end.err.find("nothing was written") != std::string::npos) {
      EXPECT_THAT(left, IsEmpty());
    }
    for (const std::string& name : outputs_.Entries()) {
      EXPECT_NE(name.front(), '.') << "a part was left";
      if (name == "blocks" || command.whole.empty()) continue;
      for (const std::string& inner : command.whole) {
        if (inner.rfind(name + "/", 0) == 0) {
          EXPECT_EQ(left.count(inner), 1U) << inner;
        }
      }
    }
  }

  testing::TemporaryFolder inputs_, outputs_, temporary_, scratch_;
};

TEST_F(InterruptMoments, EndEveryCommandWithinASecondSlow) {
  MakeInputs();
  if (HasFatalFailure()) return;
  std::vector<StoppedCommand> commands = Commands();
  for (StoppedCommand& command : commands) {
    for (const char* more : {"--threads", "2", "--quiet"}) command.arguments.emplace_back(more);
    MeasureWhole(&command);
    if (HasFatalFailure()) return;
  }
  Lateness lateness;
  std::mt19937 engine(35);
  std::vector<double> seconds;
  int interrupted = 0;
  for (int i = 0; i < kMoments; ++i) {
    const StoppedCommand& command = commands[static_cast<std::size_t>(i) % commands.size()];
    const int signal = std::vector<int>{SIGINT, SIGTERM, SIGHUP}[static_cast<std::size_t>(i % 3)];
    const double wait_s = std::uniform_real_distribution<double>(0, command.seconds)(engine);
    SCOPED_TRACE(command.name + ", signal " + std::to_string(signal) + " after " +
                 std::to_string(wait_s) + " of " + std::to_string(command.seconds) + " s");
    StoppedProgram program(command.arguments, Settings());
    std::this_thread::sleep_for(std::chrono::duration<double>(wait_s));
    lateness.TakeWorst();
    program.Send(signal);
    const StoppedProgram::End end = program.Wait();
    const double late_s = lateness.TakeWorst();
    // Until the program installs its handler, the signal ends it as it ends any program.
    if (end.exit_code == -1) {
      EXPECT_EQ(end.signal, signal) << end.err;
    }
    if (end.exit_code == 1) ++interrupted;
    ExpectNothingHalfWritten(command, end);
    Empty();
    seconds.push_back(end.seconds);
    std::printf("%-22s %2d after %.2f s: exit %2d, %.3f s (CPU %.3f s; woken up to %.3f s late)\n",
                command.name.c_str(), signal, wait_s, end.exit_code, end.seconds, end.cpu_seconds,
                late_s);
    // The CPU time after the signal does not depend on the load of the machine; the elapsed time
    // does.
    EXPECT_LE(end.cpu_seconds, kThreadsOfCommand * kRequired_s);
    constexpr double kWakings = 20;
    EXPECT_LE(end.seconds, kRequired_s + kWakings * late_s);
  }
  std::sort(seconds.begin(), seconds.end());
  std::printf("of %zu: median %.3f s, longest %.3f s\n", seconds.size(),
              seconds[seconds.size() / 2], seconds.back());
  // Otherwise the test would have tested nothing.
  EXPECT_GT(interrupted, kMoments / 2);
}

}  // namespace
}  // namespace thicklens::tools
