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

// The outcome of a script.
struct Outcome {
  int exit_code = -1;
  bool timed_out = false;
  double seconds = 0;
  std::string out, err;
  std::vector<std::string> changes;  // changes to the work folder, as returned by Changes()
};

// A folder `work` with small inputs, in which a script of /bin/sh starts the built program as a
// user would. The inputs are:
//   camera.yaml picture.png depth.pfm     a photograph of 24 x 16 px with its camera and its depth
//   lf/                                   a light field of 2 x 2 views of that size
//   scene.yaml recipe.yaml                for `simulate image` and `simulate sweep`
// and, after MakeSweep(), also sweep/: 11 simulated frames of 96 x 96 px that can be calibrated.
class HostileTest : public ::testing::Test {
 protected:
  HostileTest();

  // Runs the script in the work folder; "$T" is the program. After the limit, the script and
  // everything that it started are ended, and the test fails. Temporary files go to a folder that
  // must be empty afterwards.
  Outcome Shell(const std::string& script, double limit_seconds = kLimitSeconds);

  // Checks that the program refused: with this exit code and one line of error, which contains all
  // these texts and no control characters for a terminal, and without a change to the work folder.
  void ExpectRefused(const Outcome& outcome, int exit_code,
                     const std::vector<std::string>& reported) const;
  // Checks that the program succeeded: exit code 0, no error, and these changes.
  void ExpectDone(const Outcome& outcome, const std::vector<std::string>& changes) const;
  // Checks what holds after every script, whether it succeeded or not: the inputs are unchanged,
  // and there is nothing beside them except these outputs, which may be missing.
  void ExpectNothingBut(const Outcome& outcome, const std::vector<std::string>& outputs) const;

  void MakeSweep();

  // Gives the work folder to the user nobody and returns how to start a program as that user,
  // because root may do everything. If the user is not root, nothing changes. If this is not
  // possible, the result is empty and `why_not` gets the reason.
  std::string AsOrdinaryUser(std::string* why_not);
  // True if this process may create a mount namespace; otherwise `why_not` gets the reason.
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

// Returns the text quoted as one word of /bin/sh.
std::string Quoted(const std::string& text);

// Returns the error lines of the program in its standard error, without their prefix.
std::vector<std::string> ErrorsIn(const std::string& err);

}  // namespace thicklens::hostile

// Skips the test, with the reason, if mount namespaces are not available.
#define SKIP_WITHOUT_MOUNTS()                                   \
  do {                                                          \
    std::string why_not;                                        \
    if (!HasMountNamespaces(&why_not)) GTEST_SKIP() << why_not; \
  } while (false)

#endif  // THICKLENS_TESTS_HOSTILE_HOSTILE_TEST_H_
