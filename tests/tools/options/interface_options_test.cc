#include "tools/options/interface_options.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace thicklens::tools {
namespace {

const OptionNames kNames = {{"views", "--views"},
                            {"depth.meaning.unit", "--depth-unit"},
                            {"solver.tolerance", "--tolerance"}};

TEST(OptionNames, NameAMemberAndTheMembersBelowIt) {
  EXPECT_EQ(kNames("views"), "--views");
  EXPECT_EQ(kNames("views.u"), "--views");
  EXPECT_EQ(kNames("depth.meaning.unit"), "--depth-unit");
}

TEST(OptionNames, KeepAPathWithoutAnOption) {
  EXPECT_EQ(kNames("depth.meaning.kind"), "depth.meaning.kind");
  EXPECT_EQ(kNames("viewsandmore"), "viewsandmore");
  EXPECT_EQ(kNames(""), "");
}

TEST(WithOptionNames, TurnsAnInvalidOptionIntoAUsageErrorWithTheNameOfTheOption) {
  try {
    WithOptionNames(kNames, []() -> int {
      throw OptionError("solver.tolerance",
                        "solver.tolerance: a number > 0 and < 1 is expected, found nan");
    });
    FAIL() << "no error was thrown";
  } catch (const UsageError& error) {
    EXPECT_STREQ(error.what(), "--tolerance: a number > 0 and < 1 is expected, found nan");
  }
}

TEST(WithOptionNames, LeavesOtherErrorsAndResultsAsTheyAre) {
  EXPECT_EQ(WithOptionNames(kNames, [] { return 3; }), 3);
  EXPECT_THROW(WithOptionNames(kNames, [] { throw Interrupted(); }), Interrupted);
}

TEST(CommandRun, NamesOptionsAsTheCommandLineDoes) {
  CommonOptions common;
  common.threads = 3;
  const CommandRun run(common, kNames);
  EXPECT_EQ(run.control().threads, 3);
  EXPECT_EQ(run.control().option_name("views.v"), "--views");
  run.control().progress({"measuring", 1, 2});
  run.control().progress({"estimating", 1, 2});
}

}  // namespace
}  // namespace thicklens::tools
