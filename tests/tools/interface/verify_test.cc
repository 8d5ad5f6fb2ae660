// The verdict about cameras that are known exactly. Its statistics are checked by hand in
// tests/calib/calibrate/verification_test.cc.
#include "thicklens/verify.h"

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "support/error_message.h"
#include "support/special_numbers.h"
#include "support/temporary_folder.h"
#include "tools/support/bench_simulation.h"
#include "tools/support/option_error.h"

namespace thicklens {
namespace {

using ::testing::AllOf;
using ::testing::ElementsAre;
using testing::ErrorOf;
using testing::FieldOfOptionError;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using testing::SmallBenchSimulation;
using testing::TemporaryFolder;

// The sensor of a thin lens of 50 mm that is focused at 300 mm.
constexpr double kTrueD1Mm = 60;

const calib::ComparedParameter& ComparedOf(const CameraVerification& verification,
                                           const std::string& name) {
  for (const calib::ComparedParameter& parameter : verification.parameters) {
    if (parameter.name == name) return parameter;
  }
  throw Error(name + " was not compared");
}

// Two sweeps of one camera that all tests share, and the true camera.
class VerifyInterfaceTest : public ::testing::Test {
 protected:
  static void SetUpTestSuite() {
    shared_ = std::make_unique<TemporaryFolder>();
    for (const int seed : {1, 2}) {
      SimulateSweep(SmallBenchSimulation(static_cast<std::uint64_t>(seed)), FolderOf(seed));
    }
  }
  static void TearDownTestSuite() { shared_.reset(); }

  static std::string FolderOf(int seed) { return *shared_ / fmt::format("sweep{}", seed); }
  static Sweep SweepOf(const std::string& folder) {
    SweepOverrides overrides;
    overrides.floor_px = Measured{0.5, 0.01};
    return ReadSweep(folder, overrides);
  }
  // The camera that took the photographs, but for an error of d1.
  static Camera Stored(double d1_error_mm = 0) {
    Camera camera = SmallBenchSimulation().camera;
    camera.calibration.emplace();
    camera.calibration->image_distance_mm = Measured{kTrueD1Mm + d1_error_mm, 0.001};
    camera.calibration->blur_ratio = Measured{0.45, 0.001};
    return camera;
  }

  static std::unique_ptr<TemporaryFolder> shared_;
};

std::unique_ptr<TemporaryFolder> VerifyInterfaceTest::shared_;

TEST_F(VerifyInterfaceTest, TheTrueCameraHolds) {
  for (const int seed : {1, 2}) {
    SCOPED_TRACE(seed);
    const CameraVerification verification = VerifyCamera(Stored(), SweepOf(FolderOf(seed)));
    EXPECT_EQ(verification.verdict, calib::Verdict::kHolds) << verification.reason;
    EXPECT_EQ(verification.degrees_of_freedom, 2);
    EXPECT_GT(verification.p_value, 0.0027);
    const calib::ComparedParameter& d1 = ComparedOf(verification, "image_distance_mm");
    EXPECT_EQ(d1.stored.value, kTrueD1Mm);
    EXPECT_EQ(d1.stored.sigma, 0.001);
    EXPECT_LT(std::abs(d1.found.value - kTrueD1Mm), 5 * d1.sigma);
    EXPECT_LT(d1.sigma, 0.05);
    const calib::ComparedParameter& ratio = ComparedOf(verification, "blur_ratio");
    EXPECT_LT(std::abs(ratio.found.value - 0.45), 5 * ratio.sigma);
    EXPECT_LT(ratio.sigma, 0.05);
    // The calibration of the new sweep is part of the result.
    EXPECT_EQ(verification.calibration.summary.image_distance_mm.value().value, d1.found.value);
    EXPECT_EQ(verification.calibration.frames.size(), 10U);
  }
}

TEST_F(VerifyInterfaceTest, ACameraOfAnotherImageDistanceDoesNotHold) {
  const Sweep sweep = SweepOf(FolderOf(2));
  for (const double error_mm : {-0.4, 0.4}) {
    SCOPED_TRACE(error_mm);
    const CameraVerification verification = VerifyCamera(Stored(error_mm), sweep);
    EXPECT_EQ(verification.verdict, calib::Verdict::kDoesNotHold);
    EXPECT_THAT(verification.reason, HasSubstr("image_distance_mm"));
    EXPECT_LT(verification.p_value, 0.0027);
    const calib::ComparedParameter& d1 = ComparedOf(verification, "image_distance_mm");
    EXPECT_LT(d1.sigma, 0.05);  // the error is at least eight of them
    EXPECT_NEAR(d1.difference, -error_mm, 5 * d1.sigma);
    EXPECT_LT(d1.smallest_detectable, 0.4);
  }
}

// The plane of focus is where the frames are sharp, whatever is stored and whatever lens the sweep
// has. A thick lens puts the sensor behind its rear principal plane.
TEST_F(VerifyInterfaceTest, TheLensIsThatOfTheStoredCameraAndItsCalibrationIsNotUsed) {
  Sweep sweep = SweepOf(FolderOf(2));
  const CameraVerification thin = VerifyCamera(Stored(), sweep);
  sweep.camera.lens = {75, 75, 0, 3};
  Camera thick = Stored(0.4);
  thick.lens.lens_thickness_mm = 7;
  const CameraVerification other = VerifyCamera(thick, sweep);
  EXPECT_NEAR(ComparedOf(other, "image_distance_mm").found.value,
              ComparedOf(thin, "image_distance_mm").found.value + 7, 1e-6);
  EXPECT_NEAR(ComparedOf(other, "blur_ratio").found.value,
              ComparedOf(thin, "blur_ratio").found.value, 1e-6);
}

TEST_F(VerifyInterfaceTest, TheLimitsAreThoseOfTheOptions) {
  const Sweep sweep = SweepOf(FolderOf(2));
  VerifyOptions options;
  options.needed_blur_px = 1e-6;  // nothing so small can be seen
  const CameraVerification blind = VerifyCamera(Stored(), sweep, options);
  EXPECT_EQ(blind.verdict, calib::Verdict::kUndetermined);
  ASSERT_LT(blind.p_value, 0.99);
  options = {};
  options.significance = blind.p_value + 0.005;
  EXPECT_EQ(VerifyCamera(Stored(), sweep, options).verdict, calib::Verdict::kDoesNotHold);
}

TEST_F(VerifyInterfaceTest, TheSweepOfTheCalibrationDecidesNothing) {
  CalibrateOptions options;
  options.map_field = false;
  const Camera stored = Calibrate(SweepOf(FolderOf(1)), options).camera;
  // The content counts and not the path.
  std::filesystem::copy(FolderOf(1), *shared_ / "copy", std::filesystem::copy_options::recursive);
  const CameraVerification same = VerifyCamera(stored, SweepOf(*shared_ / "copy"));
  EXPECT_EQ(same.verdict, calib::Verdict::kUndetermined);
  EXPECT_THAT(same.reason, HasSubstr("take a new one"));
  const CameraVerification other = VerifyCamera(stored, SweepOf(FolderOf(2)));
  EXPECT_EQ(other.verdict, calib::Verdict::kHolds) << other.reason;
}

TEST_F(VerifyInterfaceTest, ASweepThatDeterminesNothingCannotTell) {
  Sweep three = SweepOf(FolderOf(2));
  three.description.frames.resize(3);
  const CameraVerification verification = VerifyCamera(Stored(0.4), three);
  EXPECT_EQ(verification.verdict, calib::Verdict::kUndetermined);
  EXPECT_EQ(verification.calibration.summary.outcome, calib::Outcome::kRefused);
  EXPECT_THAT(verification.reason, HasSubstr(verification.calibration.summary.reason));
  EXPECT_THAT(verification.parameters, IsEmpty());
}

TEST_F(VerifyInterfaceTest, ProgressAndNoticesAreThoseOfTheSweep) {
  Sweep sweep = SweepOf(FolderOf(2));
  sweep.notices = {"of the sweep"};
  Camera stored = Stored();
  stored.notices = {"of the camera"};
  std::vector<std::string> notices;
  int done = 0, total = 0;
  RunControl run;
  run.notice = [&](const Notice& notice) { notices.push_back(notice.text); };
  run.progress = [&](const Progress& progress) {
    EXPECT_EQ(progress.stage, "measuring");
    EXPECT_GE(progress.done, done);
    done = progress.done;
    total = progress.total;
  };
  VerifyCamera(stored, sweep, {}, run);
  EXPECT_THAT(notices, ElementsAre("of the sweep", "of the camera"));
  EXPECT_GE(done, 10);  // each frame is a step at least
  EXPECT_LE(done, total);
}

TEST_F(VerifyInterfaceTest, WrongOptionsAreNamedBeforeAFrameIsRead) {
  Sweep sweep = SweepOf(FolderOf(2));
  for (model::SweepFrame& frame : sweep.description.frames) frame.image = "";
  const auto field_of = [&](double VerifyOptions::*member, double value) {
    VerifyOptions options;
    options.*member = value;
    return FieldOfOptionError([&] { VerifyCamera(Stored(), sweep, options); });
  };
  for (const double value : {testing::kNan, 0.0, -1.0, testing::kInfinity}) {
    EXPECT_EQ(field_of(&VerifyOptions::significance, value), "significance");
    EXPECT_EQ(field_of(&VerifyOptions::needed_blur_px, value), "needed_blur_px");
    EXPECT_EQ(field_of(&VerifyOptions::needed_blur_ratio, value), "needed_blur_ratio");
  }
  EXPECT_EQ(field_of(&VerifyOptions::significance, 1), "significance");
  RunControl run;
  run.threads = -1;
  EXPECT_EQ(FieldOfOptionError([&] { VerifyCamera(Stored(), sweep, {}, run); }), "threads");
}

TEST_F(VerifyInterfaceTest, ACameraWithoutCalibrationIsNamed) {
  Camera none = Stored();
  none.calibration.reset();
  const Sweep sweep = SweepOf(FolderOf(2));
  none.source = "";
  EXPECT_THAT(ErrorOf([&] { VerifyCamera(none, sweep); }),
              AllOf(HasSubstr("camera 'case-ii'"), HasSubstr("calibration is missing")));
  none.source = "stored.yaml";
  EXPECT_THAT(ErrorOf([&] { VerifyCamera(none, sweep); }), HasSubstr("stored.yaml: calibration"));
}

TEST_F(VerifyInterfaceTest, AFrameThatCannotBeReadIsNamed) {
  Sweep sweep = SweepOf(FolderOf(2));
  sweep.description.frames.at(4).image = "no-such-frame.png";
  EXPECT_THAT(ErrorOf([&] { VerifyCamera(Stored(), sweep); }), HasSubstr("no-such-frame.png"));
  sweep.description.frames.at(4).image = "";
  EXPECT_NE(ErrorOf([&] { VerifyCamera(Stored(), sweep); }), "(no error)");
}

TEST_F(VerifyInterfaceTest, ACancelledRunIsInterrupted) {
  const Sweep sweep = SweepOf(FolderOf(2));
  for (const int steps_before : {0, 1, 5}) {
    SCOPED_TRACE(steps_before);
    CancelToken token;
    RunControl run;
    run.threads = 1;
    run.cancel = &token;
    int steps = 0;
    run.progress = [&](const Progress&) {
      if (++steps >= steps_before) token.Cancel();
    };
    if (steps_before == 0) token.Cancel();
    EXPECT_THROW(VerifyCamera(Stored(), sweep, {}, run), Interrupted);
    EXPECT_EQ(steps, steps_before);
  }
}

}  // namespace
}  // namespace thicklens
