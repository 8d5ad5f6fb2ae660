#ifndef THICKLENS_TESTS_HOSTILE_SITUATION_H_
#define THICKLENS_TESTS_HOSTILE_SITUATION_H_

#include <gtest/gtest.h>

#include <string>
#include <vector>

namespace thicklens::hostile {

// A row of docs/hostile-situations.md.
struct Situation {
  std::string test;      // "HostileNames.ANewline"
  std::string done;      // what is done to the program
  std::string required;  // the required outcome
};

// All situations of this test program, in no particular order.
std::vector<Situation>& Situations();
bool ListSituation(const std::string& test, const std::string& done, const std::string& required);

}  // namespace thicklens::hostile

// Defines the test of a situation, which has a row with these words in the table. `group` is an
// alias of HostileTest.
#define THICKLENS_SITUATION(group, name, done, required)                     \
  [[maybe_unused]] static const bool group##_##name##_is_listed =            \
      ::thicklens::hostile::ListSituation(#group "." #name, done, required); \
  TEST_F(group, name)

#endif  // THICKLENS_TESTS_HOSTILE_SITUATION_H_
