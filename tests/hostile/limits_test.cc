// Resources that `ulimit` takes away.
#include <filesystem>

#include "hostile/hostile_test.h"
#include "support/sanitizers.h"

namespace thicklens::hostile {
namespace {

namespace fs = std::filesystem;
using ::testing::AnyOf;
using ::testing::HasSubstr;

class HostileLimits : public HostileTest {
 protected:
  void SetUp() override {
    if (testing::kIsSanitized) GTEST_SKIP() << "a sanitizer takes memory, threads and files itself";
  }

  // The command either succeeds or is refused with a reason by the program, by the loader, which
  // has no memory for it, or by a library that needs threads. Only if it succeeds does it leave an
  // output, and it leaves nothing besides.
  Outcome ExpectDoneOrReported(const std::string& limit, const std::string& script) {
    SCOPED_TRACE(limit + script);
    const Outcome outcome = Shell(limit + script);
    ExpectNothingBut(outcome, {"new.png"});
    EXPECT_EQ(fs::exists(Work("new.png")), outcome.exit_code == 0) << outcome.err;
    constexpr int kNotLoaded = 127;
    EXPECT_THAT(outcome.exit_code, AnyOf(0, 1, kNotLoaded)) << outcome.err;
    if (outcome.exit_code != 0) {
      EXPECT_FALSE(outcome.err.empty());
    }
    if (outcome.exit_code == 1) {
      EXPECT_THAT(outcome.err, AnyOf(HasSubstr("thicklens: error: "), HasSubstr("libgomp: ")));
    }
    fs::remove_all(Work("new.png"));
    return outcome;
  }
};

THICKLENS_SITUATION(HostileLimits, Memory, "`ulimit -v` allows from 60 to 400 MB",
                    "Done, or refused as out of memory (by the loader or OpenMP where there is too "
                    "little for them); the output is complete or absent") {
  MakeSweep();
  for (const std::string& script : {Estimate("new.png"), Calibrate("new.png"), Render("new.png")}) {
    for (int megabytes = 60; megabytes <= 400; megabytes += 68) {
      ExpectDoneOrReported("ulimit -v " + std::to_string(megabytes * 1000) + "; ", script);
    }
    EXPECT_EQ(ExpectDoneOrReported("ulimit -v 4000000; ", script).exit_code, 0);
  }
}

THICKLENS_SITUATION(HostileLimits, OpenFiles, "`ulimit -n` allows 3, 4, 5, ... 12 open files",
                    "Done, or refused with `Too many open files` (by the loader where it cannot "
                    "open libraries); nothing is left beside the output") {
  MakeSweep();
  for (const std::string& script : {Render("new.png"), Estimate("new.png"), Calibrate("new.png")}) {
    for (int files = 3; files <= 12; ++files) {
      const Outcome outcome =
          ExpectDoneOrReported("ulimit -n " + std::to_string(files) + "; ", script);
      if (outcome.exit_code == 1) {
        EXPECT_THAT(outcome.err, HasSubstr("Too many open files"));
      }
    }
    EXPECT_EQ(ExpectDoneOrReported("ulimit -n 16; ", script).exit_code, 0);
  }
}

THICKLENS_SITUATION(HostileLimits, Threads,
                    "`ulimit -u` allows an ordinary user 1, 2, 3 ... processes and threads, and "
                    "more threads are requested",
                    "Done with the available threads, or refused with the reason") {
  MakeSweep();
  std::string why_not;
  const std::string user = AsOrdinaryUser(&why_not);
  if (user.empty() || user == "env") GTEST_SKIP() << "only root can become a user without threads";
  for (std::string script : {Estimate("new.png --threads 8"), Calibrate("new.png --threads 8")}) {
    script.replace(script.find("\"$T\""), 4, "exec " + user + " \"$T\"");
    for (const int threads : {1, 2, 3, 4, 6, 20}) {
      SCOPED_TRACE(std::to_string(threads) + ": " + script);
      const Outcome outcome = Shell("ulimit -u " + std::to_string(threads) + "; " + script);
      ExpectNothingBut(outcome, {"new.png"});
      EXPECT_EQ(fs::exists(Work("new.png")), outcome.exit_code == 0) << outcome.err;
      if (outcome.exit_code != 0) {
        EXPECT_EQ(outcome.exit_code, 1) << outcome.err;
        EXPECT_EQ(ErrorsIn(outcome.err).size(), 1U) << outcome.err;
      }
      fs::remove_all(Work("new.png"));
    }
  }
}

THICKLENS_SITUATION(HostileLimits, ProcessorTime,
                    "`ulimit -t` (the soft limit) allows 1 second for a command that takes longer",
                    "Ends with an exit code above 0; the older output stays whole, nothing is left "
                    "beside it") {
  Put("long.yaml",
      "schema: thicklens/simulate-sweep/1\n"
      "camera: " THICKLENS_SOURCE_DIR
      "/configs/cameras/case-ii.yaml\n"
      "truth: {focus_depth_mm: 300, blur_ratio: 0.45, blur_floor_px: 0.5}\n"
      "size_px: [400, 400]\ntarget: {kind: dead-leaves}\n"
      "bench: {first_depth_mm: 290, step_mm: 0.01, frames: 2000}\n");
  ASSERT_EQ(Shell("\"$T\" simulate sweep recipe.yaml --quiet -o new").exit_code, 0);
  const Outcome outcome =
      Shell("(ulimit -S -t 1; exec \"$T\" simulate sweep long.yaml --quiet -o new)");
  EXPECT_NE(outcome.exit_code, 0);
  EXPECT_THAT(outcome.changes, ::testing::IsEmpty());
}

THICKLENS_SITUATION(
    HostileLimits, Stack, "`ulimit -s` allows 64 to 1,024 KiB, or is unlimited",
    "Done, or refused with the limit and the size that is needed; never a segmentation fault") {
  MakeSweep();
  for (const std::string& script : {Render("new.png"), Estimate("new.png"), Calibrate("new.png")}) {
    for (const char* kibibytes : {"64", "128", "256", "512", "1024", "unlimited"}) {
      const Outcome outcome =
          ExpectDoneOrReported(std::string("ulimit -s ") + kibibytes + "; ", script);
      if (outcome.exit_code == 1) {
        EXPECT_THAT(outcome.err, HasSubstr("ulimit -s"));
      }
    }
    EXPECT_EQ(ExpectDoneOrReported("ulimit -s 1024; ", script).exit_code, 0);
  }
}

}  // namespace
}  // namespace thicklens::hostile
