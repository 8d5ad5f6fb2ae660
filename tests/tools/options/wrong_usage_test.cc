#include "tools/options/wrong_usage.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <memory>
#include <string>
#include <vector>

#include "tools/options/deprecated_names.h"
#include "tools/options/help_format.h"

namespace thicklens::tools {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;

TEST(NearestNameTest, DiffersByFewLetters) {
  const std::vector<std::string> names = {"calibrate", "camera", "compare", "estimate"};
  EXPECT_EQ(NearestName("calibrat", names), "calibrate");
  EXPECT_EQ(NearestName("etsimate", names), "estimate");
  EXPECT_EQ(NearestName("est", names), "estimate");
  EXPECT_EQ(NearestName("canera", names), "camera");
  EXPECT_EQ(NearestName("frobnicate", names), "");
  EXPECT_EQ(NearestName("c", names), "");
  EXPECT_EQ(NearestName("", names), "");
  EXPECT_EQ(NearestName("--veiws", {"--quiet", "--views"}), "--views");
  EXPECT_EQ(NearestName("--", {"--views"}), "");
  EXPECT_EQ(NearestName(std::string(100000, 'a'), names), "");
}

// A program with the commands `make` and `camera init`.
class WrongUsageTest : public ::testing::Test {
 protected:
  WrongUsageTest() : program_("A program", "program") {
    program_.require_subcommand(1);
    program_.formatter(std::make_shared<HelpFormat>());
    CLI::App* make = program_.add_subcommand("make", "Make it");
    make->add_option("input", input_, "Its input")->required();
    make->add_option("--views", views_, "Its views");
    CLI::Option* quiet = make->add_flag("--quiet", quiet_, "Say nothing");
    make->add_flag("--verbose", verbose_, "Say all")->excludes(quiet);
    make->add_flag("--veiw", verbose_, "A former name")->group(kFormerNamesGroup);
    CLI::App* camera = program_.add_subcommand("camera", "Cameras");
    camera->require_subcommand(1);
    camera->add_subcommand("init", "A new one");
  }

  // Returns what is wrong with this command line, or "help" if the help is the answer.
  std::string Wrong(std::vector<std::string> words) {
    std::reverse(words.begin(), words.end());
    try {
      program_.parse(words);
    } catch (const CLI::ParseError& error) {
      return EndsBeforeACommand(program_, error) ? "help" : WrongUsageText(program_, error);
    }
    return "";
  }

  CLI::App program_;
  std::string input_, views_;
  bool quiet_ = false, verbose_ = false;
};

TEST_F(WrongUsageTest, AnUnknownCommandIsNamedWithTheNearestOne) {
  EXPECT_EQ(Wrong({"maek", "x"}), "unknown command 'maek'; did you mean make?");
  EXPECT_EQ(Wrong({"frobnicate", "--quiet"}),
            "unknown command 'frobnicate'; the commands are: make, camera");
  EXPECT_EQ(Wrong({"camera", "inti"}), "unknown command 'inti' of camera; did you mean init?");
}

TEST_F(WrongUsageTest, AnUnknownOptionComesBeforeWhatIsMissing) {
  EXPECT_EQ(Wrong({"make", "--veiws", "5x5"}),
            "--veiws: unknown option of make; did you mean --views?");
  EXPECT_EQ(Wrong({"make", "--veiws=5x5"}),
            "--veiws: unknown option of make; did you mean --views?");
  EXPECT_EQ(Wrong({"make", "a", "--veiws", "5x5"}),
            "--veiws: unknown option of make; did you mean --views?");
  EXPECT_EQ(Wrong({"make", "a", "--first", "--second"}), "--first: unknown option of make");
  EXPECT_EQ(Wrong({"camera", "init", "--views", "3"}), "--views: unknown option of camera init");
  EXPECT_EQ(Wrong({"--quiet", "make", "a"}), "--quiet: this option of make belongs behind 'make'");
}

TEST_F(WrongUsageTest, TooManyWordsAreNamedInTheirOrder) {
  EXPECT_EQ(Wrong({"make", "a", "b", "c"}), "make does not take: b c");
  EXPECT_THAT(Wrong({"make"}), HasSubstr("input is required"));
}

TEST_F(WrongUsageTest, WithoutACommandTheHelpIsTheAnswer) {
  EXPECT_EQ(Wrong({}), "help");
  EXPECT_THAT(program_.help(), AllOf(HasSubstr("A program"), HasSubstr("make")));
  EXPECT_EQ(Wrong({"camera"}), "help");
  EXPECT_THAT(program_.help(), AllOf(HasSubstr("Cameras"), HasSubstr("init")));
}

TEST_F(WrongUsageTest, TheHelpHasNoListsOfOtherOptions) {
  EXPECT_EQ(Wrong({"make", "a"}), "");
  EXPECT_THAT(program_.help(), AllOf(HasSubstr("--verbose"), Not(HasSubstr("Excludes")),
                                     Not(HasSubstr("{")), Not(HasSubstr("ormer name"))));
}

TEST_F(WrongUsageTest, TheMarkBehindWhichNoOptionFollowsIsNotUnknown) {
  EXPECT_EQ(Wrong({"make", "--", "a", "b"}), "make does not take: b");
  EXPECT_EQ(Wrong({"--"}), "help");
}

TEST_F(WrongUsageTest, AWrongValueBeforeACommandIsNoQuestionForHelp) {
  EXPECT_NE(Wrong({"--help=foo"}), "help");
}

}  // namespace
}  // namespace thicklens::tools
