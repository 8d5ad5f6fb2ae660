// SIGINT, SIGTERM and SIGHUP while the program is where no loop looks at them: it waits for the
// reader of a full pipe here, as it would for a library that computes.
#include "tools/system/interrupt.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <chrono>
#include <csignal>
#include <filesystem>
#include <string>
#include <thread>
#include <vector>

#include "support/temporary_folder.h"
#include "tools/support/stopped_program.h"

namespace thicklens::tools {
namespace {

namespace fs = std::filesystem;
using Arguments = std::vector<std::string>;
using ::testing::ElementsAre;
using ::testing::EndsWith;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::MatchesRegex;

class InterruptTest : public ::testing::Test {
 protected:
  // Prints more than a pipe and the program's buffers hold.
  Arguments ExplainAtLength(const Arguments& more) const {
    Arguments all = {"explain",       THICKLENS_SOURCE_DIR "/configs/cameras/thick.yaml",
                     "--depth-range", "500:2000",
                     "--steps",       "10000"};
    all.insert(all.end(), more.begin(), more.end());
    return all;
  }
  StoppedProgram::Settings WithFullStdout() const {
    StoppedProgram::Settings settings{scratch_.path(), "", {}};
    settings.stdout_fd = pipe_.write_end();
    return settings;
  }

  // Until its outputs are claimed, and then until it waits.
  void WaitUntilBlocked(StoppedProgram* program) const {
    while (!program->HasEnded() && folder_.Entries().empty()) {
      std::this_thread::sleep_for(std::chrono::milliseconds(5));
    }
    program->WaitUntilBlocked();
  }

  testing::TemporaryFolder folder_, scratch_;
  FullPipe pipe_;
};

TEST_F(InterruptTest, EachSignalEndsWhatDoesNotLookAtIt) {
  for (const int signal : {SIGINT, SIGTERM, SIGHUP}) {
    SCOPED_TRACE(signal);
    StoppedProgram program(ExplainAtLength({"--json", folder_ / "out.json"}), WithFullStdout());
    WaitUntilBlocked(&program);
    EXPECT_THAT(folder_.Entries(), ElementsAre(MatchesRegex("\\.out\\.json\\.[0-9a-f]+\\.part")));
    program.Send(signal);
    const StoppedProgram::End end = program.Wait();
    EXPECT_EQ(end.exit_code, 1);
    EXPECT_THAT(end.err, EndsWith("thicklens: error: interrupted; nothing was written\n"));
    EXPECT_THAT(folder_.Entries(), IsEmpty());
    // It does not end before loops have had the time to check.
    EXPECT_GE(end.seconds, kGraceSeconds);
  }
}

// The message must be true.
TEST_F(InterruptTest, WhatIsInPlaceIsNamed) {
  const std::string figure = folder_ / "blur.svg";
  StoppedProgram program(ExplainAtLength({"--json", folder_ / "out.json", "--figure", figure}),
                         WithFullStdout());
  WaitUntilBlocked(&program);
  program.Send(SIGTERM);
  const StoppedProgram::End end = program.Wait();
  EXPECT_EQ(end.exit_code, 1);
  EXPECT_THAT(end.err, EndsWith("thicklens: error: interrupted after " + figure +
                                " was written; nothing else was written\n"));
  EXPECT_THAT(folder_.Entries(), ElementsAre("blur.svg"));
}

TEST_F(InterruptTest, ASecondSignalEndsItAtOnce) {
  double least_s = 1e9;
  for (int i = 0; i < 10 && least_s >= kGraceSeconds; ++i) {
    StoppedProgram program(ExplainAtLength({"--json", folder_ / "out.json"}), WithFullStdout());
    WaitUntilBlocked(&program);
    program.Send(SIGINT);
    program.Send(SIGTERM);
    const StoppedProgram::End end = program.Wait();
    EXPECT_EQ(end.exit_code, 1);
    EXPECT_THAT(end.err, HasSubstr("interrupted; nothing was written"));
    EXPECT_THAT(folder_.Entries(), IsEmpty());
    least_s = std::min(least_s, end.seconds);
  }
  // A machine that is busy may be late once, not each time.
  EXPECT_LT(least_s, kGraceSeconds);
}

// This is the behaviour that `nohup` requests.
TEST_F(InterruptTest, AHangUpThatIsIgnoredAtTheStartStaysIgnored) {
  StoppedProgram::Settings settings{scratch_.path(), "", {SIGHUP}};
  StoppedProgram program(ExplainAtLength({"--json", folder_ / "out.json"}), settings);
  while (!program.HasEnded()) program.Send(SIGHUP);
  EXPECT_EQ(program.Wait().exit_code, 0);
  EXPECT_THAT(folder_.Entries(), ElementsAre("out.json"));
}

// Nobody takes its last message either.
TEST_F(InterruptTest, EndsWhereStandardErrorIsBlocked) {
  StoppedProgram::Settings settings = WithFullStdout();
  settings.stderr_fd = pipe_.write_end();
  StoppedProgram program(ExplainAtLength({"--json", folder_ / "out.json"}), settings);
  WaitUntilBlocked(&program);
  program.Send(SIGTERM);
  EXPECT_EQ(program.Wait().exit_code, 1);
  EXPECT_THAT(folder_.Entries(), IsEmpty());
}

}  // namespace
}  // namespace thicklens::tools
