// The process around the program: descriptors, pipes, signals, a system without /proc.
#include <filesystem>
#include <nlohmann/json.hpp>

#include "hostile/hostile_test.h"

namespace thicklens::hostile {
namespace {

namespace fs = std::filesystem;
using ::testing::AnyOf;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

class HostileProcess : public HostileTest {
 protected:
  // Returns the content of a JSON file that a run wrote, without what differs from run to run.
  nlohmann::json JsonIn(const std::string& name) {
    return nlohmann::json::parse(testing::ContentOf(Work(name)), nullptr, false);
  }

  // Starts the command, which writes `new`, and sends it the signal after so many seconds.
  void Stop(const std::string& script, const std::string& signal, double seconds) {
    SCOPED_TRACE("SIG" + signal + " after " + std::to_string(seconds) + " s: " + script);
    const Outcome outcome = Shell(
        "exec 3>&2; " + script + " & p=$!; sleep " + std::to_string(seconds) + "; kill -" + signal +
            " $p; begin=$(date +%s%N); wait $p; code=$?; echo $((($(date +%s%N) - begin) / "
            "1000000)); exit $code",
        kLimitSeconds);
    ExpectNothingBut(outcome, {"new"});
    // Until the program installs its handler, the signal ends it as it ends any program.
    EXPECT_THAT(outcome.exit_code, AnyOf(0, 1, 128 + 15, 128 + 1)) << outcome.err;
    if (outcome.exit_code != 0) {
      EXPECT_FALSE(fs::exists(Work("new")));
    }
    if (outcome.exit_code == 1) {
      EXPECT_THAT(ErrorsIn(outcome.err), ::testing::ElementsAre(HasSubstr("interrupted")));
    }
    // The program promises to stop within 1 s, but a busy machine may take longer.
    constexpr int kMaxMs = 10000;
    EXPECT_LE(std::atoi(outcome.out.c_str()), kMaxMs);
    fs::remove_all(Work("new"));
  }

  void StopEverywhere(const std::string& signal) {
    MakeSweep();
    Put("long.yaml",
        "schema: thicklens/simulate-scene/1\ncamera: " THICKLENS_SOURCE_DIR
        "/configs/cameras/case-ii.yaml\ntruth: {focus_depth_mm: 300, blur_ratio: 0.45}\n"
        "layers:\n  - plane: {depth_mm: 310, slope: [0.4, 0]}\n"
        "    texture: {kind: noise, colour: [0.5, 0.5, 0.45]}\n");
    for (const std::string& script : {std::string("\"$T\" simulate image long.yaml --quiet -o new"),
                                      Calibrate("new"), Estimate("new")}) {
      for (const double seconds : {0.01, 0.06, 0.15}) Stop(script, signal, seconds);
    }
  }
};

THICKLENS_SITUATION(
    HostileProcess, ClosedDescriptors,
    "Standard input, output and error are closed at the start, in each combination",
    "The outputs are those of a usual run, byte for byte; no message gets into them") {
  ASSERT_EQ(Shell(Explain("usual.json")).exit_code, 0);
  const std::string usual = testing::ContentOf(Work("usual.json"));
  for (int closed = 0; closed < 8; ++closed) {
    const std::string redirections = std::string((closed & 1) != 0 ? " <&-" : "") +
                                     ((closed & 2) != 0 ? " >&-" : "") +
                                     ((closed & 4) != 0 ? " 2>&-" : "");
    SCOPED_TRACE(redirections);
    // The command runs without --quiet, so that it prints results and warnings.
    const Outcome outcome =
        Shell("\"$T\" explain camera.yaml --depth-range 290:310 --json new.json" + redirections);
    EXPECT_EQ(outcome.exit_code, 0) << outcome.err;
    EXPECT_THAT(outcome.changes, ::testing::ElementsAre("new new.json"));
    EXPECT_EQ(testing::ContentOf(Work("new.json")), usual);
    const Outcome estimated = Shell(Estimate("new") + redirections);
    EXPECT_EQ(estimated.exit_code, 0) << estimated.err;
    EXPECT_EQ(Shell("\"$T\" compare lf new --quiet").exit_code, 0);
    const Outcome refused = Shell("\"$T\" explain none.yaml --depth-range 290:310" + redirections);
    EXPECT_EQ(refused.exit_code, 1);
    fs::remove_all(Work("new"));
    fs::remove(Work("new.json"));
  }
}

THICKLENS_SITUATION(
    HostileProcess, AReaderThatGoesAway,
    "Standard output, or standard error, is a pipe whose reader is gone (`| head "
    "-1`), with SIGPIPE as usual or ignored",
    "The outputs are complete, the exit code is the usual one, and nothing is left") {
  for (const char* trap : {"", "trap '' PIPE; "}) {
    for (const char* to : {"", "2>&1 >/dev/null"}) {
      SCOPED_TRACE(std::string(trap) + to);
      const Outcome outcome =
          Shell(std::string(trap) +
                "{ sleep 0.1; \"$T\" explain camera.yaml --depth-range 290:310 --json new.json; "
                "echo $? >code; } " +
                to + " | true; read code <code; rm code; exit $code");
      EXPECT_EQ(outcome.exit_code, 0) << outcome.err;
      EXPECT_THAT(outcome.changes, ::testing::ElementsAre("new new.json"));
      EXPECT_TRUE(JsonIn("new.json").is_object());
      fs::remove(Work("new.json"));
    }
  }
}

THICKLENS_SITUATION(
    HostileProcess, NoRoomForWhatIsPrinted, "Standard output, or standard error, is `/dev/full`",
    "Results that cannot be printed are an error; messages that cannot be printed are not") {
  if (!fs::exists("/dev/full")) GTEST_SKIP() << "there is no /dev/full here";
  ExpectRefused(Shell("\"$T\" explain camera.yaml --depth-range 290:310 > /dev/full"), 1,
                {"standard output cannot be written", "No space left"});
  ExpectRefused(Shell("\"$T\" camera init --focal-mm 50 --f-number 2 --pitch-um 5 --size 10x10 "
                      "> /dev/full"),
                1, {"standard output cannot be written"});
  EXPECT_EQ(Shell(Explain("new") + " 2> /dev/full").exit_code, 0);
}

THICKLENS_SITUATION(HostileProcess, SigtermAtAnyStage,
                    "SIGTERM while it starts, simulates, calibrates, estimates, writes",
                    "Ends within a second with exit code 1; no output, nothing left; or it was "
                    "done before") {
  StopEverywhere("TERM");
}

THICKLENS_SITUATION(HostileProcess, SighupAtAnyStage,
                    "SIGHUP, as when the terminal is closed, at the same stages", "As SIGTERM") {
  StopEverywhere("HUP");
}

THICKLENS_SITUATION(
    HostileProcess, SignalsThatAreIgnored,
    "SIGHUP, or SIGINT, is ignored at the start, as by `nohup` and a shell's `&`, and is sent",
    "The command continues and succeeds") {
  MakeSweep();
  for (const char* signal : {"HUP", "INT"}) {
    SCOPED_TRACE(signal);
    const std::string trap = std::string("trap '' ") + signal + "; ";
    const Outcome outcome = Shell(trap + Calibrate("new") + " & p=$!; sleep 0.1; kill -" + signal +
                                  " $p; sleep 0.05; kill -" + signal + " $p; wait $p");
    ExpectDone(outcome, {"new new"});
    fs::remove(Work("new"));
  }
}

THICKLENS_SITUATION(HostileProcess, ASystemWithoutProc,
                    "`/proc` and `/sys` are empty, as in a bare chroot", "The commands succeed") {
  SKIP_WITHOUT_MOUNTS();
  MakeSweep();
  for (const std::string& script :
       {Explain("new.png"), Estimate("new.png"), Calibrate("new.png"), Render("new.png")}) {
    SCOPED_TRACE(script);
    const Outcome outcome =
        Shell("unshare -m sh -c " +
              Quoted("mount -t tmpfs none /proc && mount -t tmpfs none /sys && " + script));
    ExpectDone(outcome, {"new new.png"});
    fs::remove_all(Work("new.png"));
  }
}

THICKLENS_SITUATION(
    HostileProcess, OneProcessor,
    "The process may use one processor of the machine only, and 64 threads are requested",
    "The result is the same as usual") {
  ASSERT_EQ(Shell("command -v taskset").exit_code, 0);
  ExpectDone(Shell(Estimate("usual --store views")), {"new usual"});
  ExpectDone(Shell("cpu=$(taskset -cp $$ | sed 's/.*: //; s/[-,].*//'); taskset -c $cpu sh -c " +
                   Quoted(Estimate("new --threads 64 --store views"))),
             {"new new"});
  for (const char* view : {"views/view_00_00.png", "views/view_01_01.png"}) {
    EXPECT_EQ(testing::ContentOf(Work(std::string("new/") + view)),
              testing::ContentOf(Work(std::string("usual/") + view)));
  }
}

}  // namespace
}  // namespace thicklens::hostile
