// What all commands have in common.
#include "commands.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <csignal>
#include <cstdlib>
#include <string>

#include "interrupt.h"
#include "support/temporary_folder.h"

namespace thicklens::tools {
namespace {

// Its outputs are in place by then: to say that nothing was written would not be true.
TEST(RunCommand, ACommandThatIsDoneIsNotInterrupted) {
  const thicklens::testing::TemporaryFolder folder;
  GTEST_FLAG_SET(death_test_style, "threadsafe");
  EXPECT_EXIT(
      {
        CatchSignals();
        CommonOptions options;
        options.json_path = folder / "summary.json";
        RunCommand(options, [] {
          std::raise(SIGINT);  // right after the output was put in place
          return CommandResult{{{"status", "ok"}}, ""};
        });
        const std::string json = thicklens::testing::ContentOf(folder / "summary.json");
        std::_Exit(json.find("\"ok\"") != std::string::npos ? 0 : 1);
      },
      ::testing::ExitedWithCode(0), "");
}

TEST(RunCommand, WhatIsInterruptedWritesNothing) {
  const thicklens::testing::TemporaryFolder folder;
  GTEST_FLAG_SET(death_test_style, "threadsafe");
  EXPECT_EXIT(
      {
        CatchSignals();
        CommonOptions options;
        options.json_path = folder / "summary.json";
        try {
          RunCommand(options, []() -> CommandResult {
            std::raise(SIGINT);
            ThrowIfInterrupted();
            return {};
          });
        } catch (const Interrupted&) {
          std::_Exit(folder.Entries().empty() ? 0 : 1);
        }
        std::_Exit(2);
      },
      ::testing::ExitedWithCode(0), "");
}

}  // namespace
}  // namespace thicklens::tools
