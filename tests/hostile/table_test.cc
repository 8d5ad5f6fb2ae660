// docs/hostile-situations.md has a row for each tested situation, word for word.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <set>
#include <sstream>
#include <string>

#include "hostile/situation.h"
#include "support/temporary_folder.h"

namespace thicklens::hostile {
namespace {

std::set<std::string> RowsOf(const std::string& page) {
  std::set<std::string> rows;
  std::istringstream lines(page);
  for (std::string line; std::getline(lines, line);) {
    // The last column is the name of a test.
    if (line.rfind("| ", 0) == 0 && line.find("| `Hostile") != std::string::npos) {
      EXPECT_TRUE(rows.insert(line).second) << "twice: " << line;
    }
  }
  return rows;
}

TEST(HostileTable, HasARowForEachSituationThatIsTested) {
  std::set<std::string> expected;
  for (const Situation& situation : Situations()) {
    expected.insert("| " + situation.done + " | " + situation.required + " | `" + situation.test +
                    "` |");
  }
  EXPECT_GE(expected.size(), 40U);
  const std::string page = testing::ContentOf(THICKLENS_SOURCE_DIR "/docs/hostile-situations.md");
  const std::set<std::string> found = RowsOf(page);
  for (const std::string& row : expected) EXPECT_EQ(found.count(row), 1U) << "missing:\n" << row;
  for (const std::string& row : found) EXPECT_EQ(expected.count(row), 1U) << "untested:\n" << row;
}

TEST(HostileTable, IsOfTestsThatExist) {
  std::set<std::string> tests;
  const ::testing::UnitTest& all = *::testing::UnitTest::GetInstance();
  for (int i = 0; i < all.total_test_suite_count(); ++i) {
    const ::testing::TestSuite& suite = *all.GetTestSuite(i);
    for (int k = 0; k < suite.total_test_count(); ++k) {
      const std::string name = std::string(suite.name()) + "." + suite.GetTestInfo(k)->name();
      if (name.rfind("HostileTable.", 0) != 0) tests.insert(name);
    }
  }
  std::set<std::string> listed;
  for (const Situation& situation : Situations()) listed.insert(situation.test);
  EXPECT_EQ(tests, listed);
}

}  // namespace
}  // namespace thicklens::hostile
