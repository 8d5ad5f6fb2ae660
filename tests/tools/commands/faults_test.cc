// Faults around the program: it is killed or interrupted at any moment, runs twice at the same
// time, has too little memory, or loses the folder to which it writes. Earlier files stay complete,
// new files are complete, and no run takes forever.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <chrono>
#include <csignal>
#include <filesystem>
#include <map>
#include <memory>
#include <random>
#include <set>
#include <sstream>
#include <string>
#include <thread>
#include <vector>

#include "support/sanitizers.h"
#include "support/temporary_folder.h"
#include "thicklens/base/output_file.h"
#include "tools/support/child_process.h"
#include "tools/system/program_run.h"

namespace thicklens::tools {
namespace {

namespace fs = std::filesystem;
using Arguments = std::vector<std::string>;
using ::testing::AllOf;
using ::testing::AnyOf;
using ::testing::HasSubstr;

constexpr char kScene[] = R"(schema: thicklens/simulate-scene/1
camera: camera.yaml
truth: {focus_depth_mm: 300, blur_ratio: 0.45}
size_px: [96, 80]
layers:
  - plane: {depth_mm: 300, slope: [0.4, 0]}
    texture: {kind: dead-leaves, colour: [0.5, 0.5, 0.45]}
)";

constexpr char kSweep[] = R"(schema: thicklens/simulate-sweep/1
camera: camera.yaml
truth: {focus_depth_mm: 300, blur_ratio: 0.45, blur_floor_px: 0.5}
target: {kind: dead-leaves, contrast: 0.6}
bench: {first_depth_mm: 285, step_mm: 3, frames: 11, offset_mm: 0, direction: away, reading_sigma_mm: 0.07}
noise: {full_well_electrons: 10000}
bits: 8
seed: 1
)";

constexpr char kBenchCamera[] = R"(schema: thicklens/camera/2
name: 50 mm at f/2.8
lens: {front_focal_length_mm: 50, rear_focal_length_mm: 50, lens_thickness_mm: 0, aperture_radius_mm: 8.9}
sensor: {width_px: 128, height_px: 128, pixel_pitch_mm: 0.0045, principal_point_px: [63.5, 63.5], transfer: linear}
psf: gaussian
)";

// All files below a folder, or the one file, by their paths.
using Contents = std::map<std::string, std::string>;
Contents ContentsOf(const std::string& path) {
  Contents contents;
  if (fs::is_regular_file(path)) return {{"", ReadWholeFile(path)}};
  for (const auto& entry : fs::recursive_directory_iterator(path)) {
    if (entry.is_regular_file()) {
      contents[fs::relative(entry.path(), path).string()] = ReadWholeFile(entry.path().string());
    }
  }
  return contents;
}

// A command that writes `output` in one of two ways: over and over, with the same bytes each time.
struct Job {
  std::string output;
  std::vector<Arguments> ways;
};

class Faults : public ::testing::Test {
 protected:
  Faults() {
    folder_.Put("camera.yaml", kBenchCamera);
    folder_.Put("scene.yaml", kScene);
    folder_.Put("sweep.yaml", kSweep);
  }

  ProgramResult Run(const Arguments& arguments) {
    return ChildProgram(arguments, folder_.path(), 0).Wait();
  }

  void Simulate(const std::string& what, const std::string& config, const std::string& output) {
    const ProgramResult result = Run({"simulate", what, folder_ / config, "-o", folder_ / output});
    ASSERT_EQ(result.exit_code, 0) << result.err;
  }

  Arguments Estimate(const Arguments& more) const {
    Arguments all = {"estimate",
                     folder_ / "pic/picture.png",
                     folder_ / "pic/depth.pfm",
                     "--depth-kind",
                     "z",
                     "--depth-unit",
                     "mm",
                     "--camera",
                     folder_ / "pic/camera.yaml"};
    all.insert(all.end(), more.begin(), more.end());
    return all;
  }

  Job EstimateJob() {
    Simulate("image", "scene.yaml", "pic");
    const std::string output = folder_ / "lf";
    return {output,
            {Estimate({"--views", "3x3", "--prior", "ridge", "-o", output}),
             Estimate({"--views", "5x5", "--prior", "gradient", "-o", output})}};
  }

  Job CalibrateJob() {
    Simulate("sweep", "sweep.yaml", "sweep");
    const std::string output = folder_ / "calibrated.yaml";
    return {output,
            {{"calibrate", folder_ / "sweep/sweep.yaml", "--floor-px", "0.5:0.05", "-o", output},
             {"calibrate", folder_ / "sweep/sweep.yaml", "--floor-px", "0.55:0.05", "-o", output}}};
  }

  // Dates and seconds differ from run to run.
  static Contents WithoutTimes(Contents contents) {
    for (auto& [name, text] : contents) {
      if (name.find(".png") != std::string::npos) continue;
      std::istringstream lines(text);
      std::string kept, line;
      while (std::getline(lines, line)) {
        if (line.find("date:") == std::string::npos && line.find("seconds:") == std::string::npos) {
          kept += line + "\n";
        }
      }
      text = kept;
    }
    return contents;
  }

  // Kills or interrupts one way after the other at moments by chance; whatever it was, the output
  // is that of one of them.
  void StopAtRandom(const Job& job, int times) {
    std::set<Contents> whole;
    double seconds = 0;
    for (const Arguments& way : job.ways) {
      const auto start = std::chrono::steady_clock::now();
      const ProgramResult result = Run(way);
      ASSERT_EQ(result.exit_code, 0) << result.err;
      seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
      whole.insert(WithoutTimes(ContentsOf(job.output)));
    }
    ASSERT_EQ(whole.size(), job.ways.size());
    const auto siblings = [&] {
      std::set<std::string> names;
      for (const auto& entry : fs::directory_iterator(folder_.path())) {
        names.insert(entry.path().filename().string());
      }
      return names;
    };
    const std::set<std::string> before = siblings();

    std::mt19937 engine(3);
    int stopped = 0;
    for (int i = 0; i < times; ++i) {
      const double wait = std::uniform_real_distribution<double>(0, seconds)(engine);
      const bool interrupt = i % 2 == 0;
      SCOPED_TRACE(std::string(interrupt ? "SIGINT" : "SIGKILL") + " after " +
                   std::to_string(wait) + " of about " + std::to_string(seconds) + " s");
      {
        ChildProgram program(job.ways[static_cast<std::size_t>(i / 2 % 2)], folder_.path(), 0);
        std::this_thread::sleep_for(std::chrono::duration<double>(wait));
        if (program.Running()) ++stopped;
        if (interrupt) {
          program.Interrupt();
          const ProgramResult result = program.Wait();
          // Before it listens, the signal ends it as it ends any program.
          if (result.exit_code == -1) {
            EXPECT_EQ(result.signal, SIGINT);
          }
          if (result.exit_code == 1) {
            EXPECT_THAT(result.err, HasSubstr("interrupted"));
          }
        }
      }
      ASSERT_EQ(whole.count(WithoutTimes(ContentsOf(job.output))), 1U);
    }
    // The next run removes what the killed one left.
    EXPECT_GT(stopped, 0);
    for (const Arguments& way : job.ways) EXPECT_EQ(Run(way).exit_code, 0);
    EXPECT_EQ(whole.count(WithoutTimes(ContentsOf(job.output))), 1U);
    EXPECT_EQ(siblings(), before);
  }

  testing::TemporaryFolder folder_;
};

TEST_F(Faults, EstimateIsStoppedAtAnyMomentSlow) { StopAtRandom(EstimateJob(), 50); }

TEST_F(Faults, CalibrateIsStoppedAtAnyMomentSlow) { StopAtRandom(CalibrateJob(), 50); }

TEST_F(Faults, TwoAtATimeLeaveTheOutputOfOne) {
  for (const Job& job : {EstimateJob(), CalibrateJob()}) {
    std::set<Contents> whole;
    for (const Arguments& way : job.ways) {
      ASSERT_EQ(Run(way).exit_code, 0);
      whole.insert(WithoutTimes(ContentsOf(job.output)));
    }
    for (int i = 0; i < 4; ++i) {
      testing::TemporaryFolder scratch;
      ChildProgram first(job.ways[0], folder_.path(), 0);
      ChildProgram second(job.ways[1], scratch.path(), 0);
      const ProgramResult results[] = {first.Wait(), second.Wait()};
      EXPECT_TRUE(results[0].exit_code == 0 || results[1].exit_code == 0)
          << results[0].err << results[1].err;
      for (const ProgramResult& result : results) {
        if (result.exit_code != 0) {
          EXPECT_THAT(result.err, HasSubstr(job.output));
        }
      }
      EXPECT_EQ(whole.count(WithoutTimes(ContentsOf(job.output))), 1U);
    }
  }
}

TEST_F(Faults, AnOutputFolderThatVanishesIsReported) {
  const Job job = EstimateJob();
  const std::string parent = folder_ / "gone";
  fs::create_directory(parent);
  ChildProgram program(
      Estimate({"--views", "3x3", "--solver", "blocks", "--block-px", "48", "-o", parent + "/lf"}),
      folder_.path(), 0);
  // Held while that is done: the solver takes a second or more, its folder is there long before.
  while (program.Running() && fs::is_empty(parent)) {
    std::this_thread::sleep_for(std::chrono::milliseconds(1));
  }
  program.Send(SIGSTOP);
  ASSERT_TRUE(program.Running());
  fs::remove_all(parent);
  program.Send(SIGCONT);
  const ProgramResult result = program.Wait();
  EXPECT_EQ(result.exit_code, 1);
  EXPECT_THAT(result.err, HasSubstr(parent + "/lf"));
}

TEST_F(Faults, TooLittleMemoryIsReportedAndRemovesNoFile) {
  if (testing::kIsSanitized) GTEST_SKIP() << "a sanitizer takes memory by the terabyte";
  const Job job = EstimateJob();
  ASSERT_EQ(Run(job.ways[0]).exit_code, 0);
  // The limits start below the memory that the libraries need. The system decides where the program
  // reaches its own code, and from there to what the run needs may be as little as 16 MiB.
  bool was_reported = false, was_enough = false;
  for (int mebibytes = 80; mebibytes <= 520; mebibytes += was_enough ? 40 : 4) {
    SCOPED_TRACE(mebibytes);
    const Contents before = ContentsOf(job.output);
    Arguments words = {THICKLENS_PROGRAM};
    words.insert(words.end(), job.ways[0].begin(), job.ways[0].end());
    const ProgramRun run =
        RunProgram("/bin/sh",
                   {"-c", "ulimit -v " + std::to_string(mebibytes * 1024) +
                              "; export OMP_NUM_THREADS=2 OPENBLAS_NUM_THREADS=2; exec " +
                              ShellCommand(words)},
                   folder_.path(), 60);
    EXPECT_FALSE(run.timed_out);
    if (run.exit_code == 1) {
      // libgomp ends the program where there is none for its threads.
      EXPECT_THAT(run.err, AnyOf(HasSubstr("out of memory"), HasSubstr("Thread creation failed")));
      was_reported = true;
    }
    if (run.exit_code == 0) {
      was_enough = true;
    } else {
      EXPECT_EQ(ContentsOf(job.output), before);
    }
  }
  EXPECT_TRUE(was_reported);
  EXPECT_TRUE(was_enough);
}

TEST_F(Faults, AFileThatEndsTooEarlyIsReported) {
  const Job job = EstimateJob();
  ASSERT_EQ(Run(job.ways[0]).exit_code, 0);
  const Contents before = ContentsOf(job.output);
  for (const std::string name : {"picture.png", "depth.pfm", "camera.yaml"}) {
    SCOPED_TRACE(name);
    const std::string whole = folder_ / "pic/" + name;
    const std::string bytes = ReadWholeFile(whole);
    const std::string cut = folder_.Put("cut-" + name, bytes.substr(0, bytes.size() / 2));
    Arguments arguments = job.ways[0];
    std::replace(arguments.begin(), arguments.end(), whole, cut);
    const ProgramResult result = Run(arguments);
    EXPECT_EQ(result.exit_code, 1);
    EXPECT_THAT(result.err, HasSubstr("error: " + cut));
    EXPECT_EQ(ContentsOf(job.output), before);
  }
}

// ---- OpenCL drivers that fail ----

#ifdef THICKLENS_OPENCL_FAULTS

class OpenClFaults : public Faults {
 protected:
  // The form is CALL:N:ERROR, see faults/opencl_faults.cc.
  ProgramRun RunWith(const std::string& fault, const Arguments& arguments) {
    Arguments words = {std::string("LD_PRELOAD=") + THICKLENS_OPENCL_FAULTS,
                       "THICKLENS_FAULT=" + fault, THICKLENS_PROGRAM};
    words.insert(words.end(), arguments.begin(), arguments.end());
    return RunProgram("/usr/bin/env", words, folder_.path(), 120);
  }
};

// Calls that fail from one on, at any stage of the work, on each way that has a device.
TEST_F(OpenClFaults, ADeviceThatIsLostHalfwayIsReportedAndRemovesNoFile) {
  const Job job = EstimateJob();
  ASSERT_EQ(Run(job.ways[0]).exit_code, 0);
  const Contents before = ContentsOf(job.output);
  const std::vector<Arguments> commands = {
      Estimate({"--views", "3x3", "--solver", "blocks", "--device", "opencl", "-o", job.output}),
      Estimate({"--views", "3x3", "--solver", "scene", "--store", "views", "--device", "opencl",
                "-o", job.output}),
      {"render", job.output, "--focus", "300", "--device", "opencl", "-o", folder_ / "new.png"}};
  int lost = 0;
  for (const Arguments& command : commands) {
    // The first two run in the trial, which has its own count; an estimate needs some hundred.
    for (const std::string fault : {"clEnqueueNDRangeKernel:3:-5", "clEnqueueNDRangeKernel:20:-5",
                                    "clFinish:5:-36", "clCreateBuffer:9:-4"}) {
      SCOPED_TRACE(command[0] + " " + command[command.size() - 4] + " " + fault);
      const ProgramRun run = RunWith(fault, command);
      if (run.exit_code == 0 && command[0] == "render") continue;  // fewer calls than that
      EXPECT_EQ(run.exit_code, 1) << run.err;
      EXPECT_FALSE(run.timed_out);
      EXPECT_THAT(run.err, HasSubstr("error: device opencl:0:0"));
      EXPECT_EQ(ContentsOf(job.output), before);
      EXPECT_FALSE(fs::exists(folder_ / "new.png"));
      ++lost;
    }
  }
  EXPECT_GE(lost, 8);  // all of the estimates
}

TEST_F(OpenClFaults, ACompilerThatFailsLeavesTheWorkToTheProcessor) {
  const Job job = EstimateJob();
  const std::string fault = "clBuildProgram:1:-11";
  const Arguments blocks = {"--views", "3x3", "--solver", "blocks", "-o", job.output};
  Arguments processor = Estimate(blocks);
  processor.insert(processor.end(), {"--device", "cpu"});
  ASSERT_EQ(Run(processor).exit_code, 0);
  const Contents expected = WithoutTimes(ContentsOf(job.output));
  const ProgramRun chosen = RunWith(fault, Estimate(blocks));
  ASSERT_EQ(chosen.exit_code, 0) << chosen.err;
  EXPECT_THAT(chosen.err, AllOf(HasSubstr("device opencl:0:0"), HasSubstr("build")));
  EXPECT_EQ(WithoutTimes(ContentsOf(job.output)), expected);

  Arguments asked = Estimate(blocks);
  asked.insert(asked.end(), {"--device", "opencl"});
  const ProgramRun refused = RunWith(fault, asked);
  EXPECT_EQ(refused.exit_code, 1);
  EXPECT_THAT(refused.err, AllOf(HasSubstr("device opencl:0:0"), HasSubstr("build")));
  EXPECT_EQ(WithoutTimes(ContentsOf(job.output)), expected);
}

#endif  // THICKLENS_OPENCL_FAULTS

}  // namespace
}  // namespace thicklens::tools
