// The tags of docs/equations.md are the same as those that comments cite, and the files, functions
// and tests that the page names exist.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <map>
#include <regex>
#include <set>
#include <sstream>
#include <string>
#include <vector>

namespace thicklens::architecture {
namespace {

namespace fs = std::filesystem;
using ::testing::ElementsAre;
using ::testing::IsEmpty;

// The sources in these folders cite formulas.
constexpr const char* kFolders[] = {"model", "kernels", "calib", "estimator", "tools", "tests"};

std::string ContentOf(const fs::path& path) {
  std::ifstream file(path);
  std::ostringstream content;
  content << file.rdbuf();
  return content.str();
}

// Returns what the first group of the expression matched, for every match.
std::vector<std::string> AllMatches(const std::string& text, const std::string& pattern) {
  std::vector<std::string> found;
  const std::regex expression(pattern);
  for (std::sregex_iterator at(text.begin(), text.end(), expression), end; at != end; ++at)
    found.push_back((*at)[1]);
  return found;
}

std::vector<std::string> TagsIn(const std::string& text) {
  return AllMatches(text, R"(\[([SMDL][0-9]+)\])");
}

struct Row {
  std::string tag, code, tests;
};

std::vector<Row> RowsOf(const std::string& page) {
  std::vector<Row> rows;
  const std::regex row(R"(\| \[([SMDL][0-9]+)\] \|.*\| (.*) \| (.*) \|)");
  std::istringstream lines(page);
  for (std::string line; std::getline(lines, line);) {
    std::smatch match;
    if (std::regex_match(line, match, row)) rows.push_back({match[1], match[2], match[3]});
  }
  return rows;
}

// Returns the names in a cell that do not exist. The form of a cell is "`path`: `Name`, `Name`;
// `path`: `Name`".
std::vector<std::string> MissingIn(const std::string& cell, const fs::path& root, bool is_tests) {
  std::vector<std::string> missing;
  std::string path, content;
  for (const std::string& name : AllMatches(cell, "`([^`]+)`")) {
    if (name.find('/') != std::string::npos) {
      path = name;
      if (!fs::is_regular_file(root / path)) missing.push_back(path);
      content = ContentOf(root / path);
      continue;
    }
    std::string wanted = name;
    const std::size_t dot = name.find('.');
    if (is_tests && dot != std::string::npos) {
      // The names of parametrised suites have a prefix: "Prefix/Suite.Name/0".
      std::string suite = name.substr(0, dot), test = name.substr(dot + 1);
      suite = suite.substr(suite.rfind('/') == std::string::npos ? 0 : suite.rfind('/') + 1);
      test = test.substr(0, test.find('/'));
      const std::regex declared(suite + R"(,\s*)" + test + R"(\b)");
      if (!std::regex_search(content, declared)) missing.push_back(path + ": " + name);
      continue;
    }
    wanted = wanted.substr(wanted.rfind(':') == std::string::npos ? 0 : wanted.rfind(':') + 1);
    if (content.find(wanted) == std::string::npos) missing.push_back(path + ": " + name);
  }
  return missing;
}

const fs::path kRoot = THICKLENS_SOURCE_DIR;

std::map<std::string, std::string> CitedTags() {
  std::map<std::string, std::string> cited;  // each tag with a file that cites it
  for (const char* folder : kFolders) {
    for (const auto& entry : fs::recursive_directory_iterator(kRoot / folder)) {
      const std::string ending = entry.path().extension().string();
      if (ending != ".cc" && ending != ".h" && ending != ".cl") continue;
      if (entry.path().filename() == "equation_tags_test.cc") continue;
      for (const std::string& tag : TagsIn(ContentOf(entry.path())))
        cited.emplace(tag, fs::relative(entry.path(), kRoot).string());
    }
  }
  return cited;
}

TEST(EquationTags, EachIsOnThePageOnce) {
  std::set<std::string> seen;
  for (const Row& row : RowsOf(ContentOf(kRoot / "docs/equations.md")))
    EXPECT_TRUE(seen.insert(row.tag).second) << row.tag << " stands there twice";
  EXPECT_GE(seen.size(), 26U) << "the page is not read";
}

TEST(EquationTags, ThoseOfCommentsAndOfThePageAreTheSame) {
  std::set<std::string> of_page;
  for (const Row& row : RowsOf(ContentOf(kRoot / "docs/equations.md"))) of_page.insert(row.tag);
  const std::map<std::string, std::string> cited = CitedTags();
  for (const auto& [tag, file] : cited)
    EXPECT_EQ(of_page.count(tag), 1U) << file << " cites [" << tag << "], which is not on the page";
  for (const std::string& tag : of_page)
    EXPECT_EQ(cited.count(tag), 1U) << "no comment cites [" << tag << "]";
}

TEST(EquationTags, FilesFunctionsAndTestsOfThePageExist) {
  for (const Row& row : RowsOf(ContentOf(kRoot / "docs/equations.md"))) {
    EXPECT_THAT(MissingIn(row.code, kRoot, false), IsEmpty()) << row.tag;
    EXPECT_THAT(MissingIn(row.tests, kRoot, true), IsEmpty()) << row.tag;
  }
}

TEST(EquationTags, TheCheckFindsWhatIsMissing) {
  const std::string here = "tests/architecture/equation_tags_test.cc";
  EXPECT_THAT(MissingIn("`no/such/file.cc`", kRoot, false), ElementsAre("no/such/file.cc"));
  EXPECT_THAT(MissingIn("`" + here + "`: `MissingIn`, `Missing" + "Out`", kRoot, false),
              ElementsAre(here + ": Missing" + "Out"));
  EXPECT_THAT(MissingIn("`" + here + "`: `EquationTags.EachIsOnThePageOnce`; `" + here +
                            "`: `EquationTags.No" + "Test`",
                        kRoot, true),
              ElementsAre(here + ": EquationTags.No" + "Test"));
  EXPECT_THAT(TagsIn("see [S12], [D3]; not (12) or [x]"), ElementsAre("S12", "D3"));
  const std::vector<Row> rows = RowsOf("| [S1] | `a | b`: text | `f.h`: `F` | - |\n| tag | x |\n");
  ASSERT_EQ(rows.size(), 1U);
  EXPECT_EQ(rows[0].code, "`f.h`: `F`");
  EXPECT_EQ(rows[0].tests, "-");
}

}  // namespace
}  // namespace thicklens::architecture
