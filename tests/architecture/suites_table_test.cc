// tests/suites.txt names tests that exist: a pattern whose test was renamed would let that test
// into a suite that leaves it out.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cctype>
#include <filesystem>
#include <map>
#include <sstream>
#include <string>
#include <utility>
#include <vector>

#include "architecture/repository.h"

namespace thicklens::architecture {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;
using ::testing::UnorderedElementsAre;

// The first two arguments of each call of a macro that begins a line.
std::vector<std::pair<std::string, std::string>> CallsOf(const std::string& macro,
                                                         const std::string& source) {
  const std::string call = "\n" + macro + "(";
  std::vector<std::pair<std::string, std::string>> calls;
  for (auto at = source.find(call); at != std::string::npos; at = source.find(call, at + 1)) {
    std::vector<std::string> arguments(1);
    for (auto next = at + call.size(); next < source.size(); ++next) {
      const char c = source[next];
      if (c == ')' || (c == ',' && arguments.size() == 2)) break;
      if (c == ',') {
        arguments.emplace_back();
      } else if (std::isspace(static_cast<unsigned char>(c)) == 0) {
        arguments.back() += c;
      }
    }
    if (arguments.size() == 2) calls.emplace_back(arguments[0], arguments[1]);
  }
  return calls;
}

// The names of the tests of these sources as GoogleTest has them. A name that ends in a slash is
// continued by a parameter.
std::vector<std::string> TestNames(const std::vector<std::string>& sources) {
  std::multimap<std::string, std::string> prefixes;  // of suites with parameters
  for (const std::string& source : sources) {
    for (const auto& [prefix, suite] : CallsOf("INSTANTIATE_TEST_SUITE_P", "\n" + source)) {
      prefixes.emplace(suite, prefix);
    }
  }
  std::vector<std::string> names;
  for (const std::string& source : sources) {
    for (const char* macro : {"TEST", "TEST_F"}) {
      for (const auto& [suite, test] : CallsOf(macro, "\n" + source)) {
        names.push_back(suite + "." + test);
      }
    }
    for (const auto& [suite, test] : CallsOf("TEST_P", "\n" + source)) {
      const auto [begin, end] = prefixes.equal_range(suite);
      for (auto prefix = begin; prefix != end; ++prefix) {
        names.push_back(prefix->second + "/" + suite + "." + test + "/");
      }
    }
  }
  return names;
}

// A pattern in which * stands for any text.
bool Matches(const std::string& pattern, const std::string& name) {
  if (pattern.empty()) return name.empty();
  if (pattern[0] == '*') {
    return Matches(pattern.substr(1), name) || (!name.empty() && Matches(pattern, name.substr(1)));
  }
  return !name.empty() && pattern[0] == name[0] && Matches(pattern.substr(1), name.substr(1));
}

// Whether a pattern selects a test, or may select a parameter of one.
bool Selects(const std::string& pattern, const std::string& name) {
  if (Matches(pattern, name)) return true;
  if (name.back() != '/') return false;
  // A pattern that goes into the parameter is compared up to it.
  const auto dot = pattern.find('.');
  const auto slash = pattern.rfind('/');
  if (dot == std::string::npos || slash == std::string::npos || slash < dot) return false;
  return Matches(pattern.substr(0, slash + 1), name);
}

// The lines of a table that are wrong, for the names of each module's tests.
std::vector<std::string> WrongLines(const std::string& table,
                                    const std::map<std::string, std::vector<std::string>>& tests) {
  std::vector<std::string> wrong;
  std::istringstream lines(table);
  for (std::string line; std::getline(lines, line);) {
    if (line.empty() || line[0] == '#') continue;
    std::istringstream words(line);
    std::string group;
    std::string module;
    std::string pattern;
    words >> group >> module >> pattern;
    const auto found = tests.find(module);
    const bool is_right = found != tests.end() &&
                          (group == "ci" || std::any_of(found->second.begin(), found->second.end(),
                                                        [&](const std::string& name) {
                                                          return Selects(pattern, name);
                                                        }));
    if (!is_right) wrong.push_back(line);
  }
  return wrong;
}

TEST(SuitesTable, TestsAreFoundInSources) {
  EXPECT_THAT(TestNames({"TEST(A, B) {}\nTEST_F(\n    C,\n    D) {}\n// TEST(E, F)\n",
                         "TEST_P(P, Q) {}\nINSTANTIATE_TEST_SUITE_P(\n    R, P, Values(1, 2));\n"}),
              UnorderedElementsAre("A.B", "C.D", "R/P.Q/"));
}

TEST(SuitesTable, PatternsWithoutATestAreFound) {
  EXPECT_THAT(WrongLines("# x y z\n\nci m\nci n\nunsanitized m A.*\nunsanitized m A.C\n"
                         "not-in-ci m */P.Q/one_*\nnot-in-ci m */P.R/*\nnot-in-ci m R/*\n"
                         "not-in-ci n A.*\nunsanitized m *.B*\n",
                         {{"m", {"A.B", "R/P.Q/"}}}),
              ElementsAre("ci n", "unsanitized m A.C", "not-in-ci m */P.R/*", "not-in-ci n A.*"));
}

TEST(SuitesTable, EachPatternNamesATestOfItsModule) {
  const std::string root = THICKLENS_SOURCE_DIR "/tests/";
  std::map<std::string, std::vector<std::string>> tests;
  for (const char* module :
       {"model", "kernels", "calib", "estimator", "tools", "architecture", "hostile"}) {
    std::vector<std::string> sources;
    for (const auto& entry : std::filesystem::recursive_directory_iterator(root + module)) {
      const auto extension = entry.path().extension();
      if (extension == ".cc" || extension == ".h") sources.push_back(ContentOf(entry.path()));
    }
    tests[module] = TestNames(sources);
    EXPECT_FALSE(tests[module].empty()) << module;
  }
  EXPECT_THAT(WrongLines(ContentOf(root + "suites.txt"), tests), IsEmpty());
}

}  // namespace
}  // namespace thicklens::architecture
