#ifndef THICKLENS_TESTS_HOSTILE_HOSTILE_TEST_H_
#define THICKLENS_TESTS_HOSTILE_HOSTILE_TEST_H_

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "hostile/folder_tree.h"
#include "hostile/situation.h"
#include "support/temporary_folder.h"

namespace thicklens::hostile {

// How a script ended.
struct Outcome {
  int exit_code = -1;
  bool timed_out = false;
  double seconds = 0;
  std::string out, err;
  std::vector<std::string> changes;  // to the work folder, see Changes()
};

// A folder `work` with small inputs, in which the built program is started as a person would start
// it: by a script of /bin/sh. The inputs:
//   camera.yaml picture.png depth.pfm     a photograph of 24 x 16 px with its camera and its depth
//   lf/                                   a light field of 2 x 2 views of that size
//   scene.yaml recipe.yaml                for `simulate picture` and `simulate sweep`
// and after MakeSweep() also sweep/, 11 simulated frames of 96 x 96 px that can be calibrated.
class HostileTest : public ::testing::Test {
 protected:
  HostileTest();

  // Runs the script in the work folder, where "$T" is the program. It is ended after the limit,
  // along with all that it started, and fails the test then. Files for temporary use are asked for
  // in a folder that must be empty afterwards.
  Outcome Shell(const std::string& script, double limit_seconds = kLimitSeconds);

  // The outcome of what must have been refused: with this exit code and one line of error that
  // holds all these texts and nothing that a terminal would obey, and without a change to the work
  // folder.
  void ExpectRefused(const Outcome& outcome, int exit_code,
                     const std::vector<std::string>& told) const;
  // The outcome of what must have been done: exit code 0, no error, and these changes.
  void ExpectDone(const Outcome& outcome, const std::vector<std::string>& changes) const;
  // What holds after each script, whatever came of it: the inputs are as they were, and nothing
  // lies beside them but these outputs, which may be missing.
  void ExpectNothingBut(const Outcome& outcome, const std::vector<std::string>& outputs) const;

  void MakeSweep();

  // Gives the work folder to the user nobody, and tells how to start a program as that user: root
  // may do everything. Of a user who is not root it changes nothing. Empty, and `why_not` says why,
  // where that cannot be had.
  std::string AsOrdinaryUser(std::string* why_not);
  // Whether a mount namespace of one's own can be had.
  static bool HasMountNamespaces(std::string* why_not);

  std::string Work(const std::string& name) const { return root_ / ("work/" + name); }
  std::string Put(const std::string& name, const std::string& content) const {
    return root_.Put("work/" + name, content);
  }
  std::string Beside(const std::string& name) const { return root_ / name; }  // the work folder

  // Commands that read the inputs and write to OUTPUT.
  static std::string Explain(const std::string& output);    // camera.yaml to a JSON file
  static std::string Estimate(const std::string& output);   // the photograph to a light field
  static std::string Render(const std::string& output);     // lf to an image
  static std::string Calibrate(const std::string& output);  // sweep to a camera

  static constexpr double kLimitSeconds = 120;

 private:
  testing::TemporaryFolder root_;
};

std::string Repeated(const std::string& text, int times);

// As one word of /bin/sh.
std::string Quoted(const std::string& text);

// The lines of what the program told that are errors of its own, without their prefix.
std::vector<std::string> ErrorsIn(const std::string& err);

}  // namespace thicklens::hostile

// Leaves the test where what it needs cannot be had: a reason in place of an outcome.
#define SKIP_WITHOUT_MOUNTS()                                   \
  do {                                                          \
    std::string why_not;                                        \
    if (!HasMountNamespaces(&why_not)) GTEST_SKIP() << why_not; \
  } while (false)

#endif  // THICKLENS_TESTS_HOSTILE_HOSTILE_TEST_H_
