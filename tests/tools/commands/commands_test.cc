// Behaviour that all commands have in common.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <csignal>
#include <cstdlib>
#include <string>

#include "support/temporary_folder.h"
#include "thicklens/base/error.h"
#include "tools/options/command_frame.h"
#include "tools/system/interrupt.h"

namespace thicklens::tools {
namespace {

// Exit code of a process in which a command is interrupted when its work is done: 0 if it ended
// well and wrote its --json file, 1 if it was stopped and wrote nothing, otherwise 2.
int EndOfACommand(bool is_written) {
  const thicklens::testing::TemporaryFolder folder;
  CommonOptions options;
  options.json_path = folder / "summary.json";
  CatchSignals();
  const CancelScope scope(ProgramToken());
  try {
    RunCommand(options, [is_written] {
      std::raise(SIGINT);
      return CommandResult{{{"status", "ok"}}, "", is_written};
    });
  } catch (const Interrupted&) {
    return folder.Entries().empty() ? 1 : 2;
  }
  const std::string json = thicklens::testing::ContentOf(options.json_path);
  return json.find("\"ok\"") != std::string::npos ? 0 : 2;
}

class RunCommandTest : public ::testing::Test {
 protected:
  RunCommandTest() { GTEST_FLAG_SET(death_test_style, "threadsafe"); }
  ~RunCommandTest() override { GTEST_FLAG_SET(death_test_style, style_); }

 private:
  const std::string style_ = GTEST_FLAG_GET(death_test_style);
};

// A message that nothing was written would be wrong.
TEST_F(RunCommandTest, AnInterruptAfterTheOutputsAreInPlaceComesTooLate) {
  EXPECT_EXIT(std::_Exit(EndOfACommand(true)), ::testing::ExitedWithCode(0), "");
}

TEST_F(RunCommandTest, AnInterruptBeforeStopsIt) {
  EXPECT_EXIT(std::_Exit(EndOfACommand(false)), ::testing::ExitedWithCode(1), "");
}

}  // namespace
}  // namespace thicklens::tools
