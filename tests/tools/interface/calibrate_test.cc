// A sweep that determines no camera: Calibrate throws, or it returns what it found.
#include "thicklens/calibrate.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstddef>
#include <cstdint>
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

using testing::ErrorOf;
using testing::FieldOfOptionError;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;
using ::testing::SizeIs;
using testing::SmallBenchSimulation;
using testing::TemporaryFolder;

CalibrateOptions On(OnRefusal on_refusal, CalibrationMethod method = CalibrationMethod::kFit) {
  CalibrateOptions options;
  options.map_field = false;  // it takes most of the time
  options.on_refusal = on_refusal;
  options.method = method;
  return options;
}

// Frames of one grey: nothing on them can be sharp or blurred.
class GreyFrames : public FrameSource {
 public:
  explicit GreyFrames(const model::Sensor& sensor) : sensor_(sensor) {}
  Image Read(std::size_t /*index*/) const override {
    const auto count =
        static_cast<std::size_t>(sensor_.width_px) * static_cast<std::size_t>(sensor_.height_px);
    return Image::FromEncoded(sensor_.width_px, sensor_.height_px, ChannelOrder::kGrey, 8,
                              std::vector<std::uint16_t>(count, 128));
  }

 private:
  model::Sensor sensor_;
};

// One simulated sweep that all tests share.
class CalibrateInterfaceTest : public ::testing::Test {
 protected:
  static void SetUpTestSuite() {
    shared_ = std::make_unique<TemporaryFolder>();
    simulated_ = std::make_unique<Sweep>(SimulateSweep(SmallBenchSimulation(), *shared_ / "sweep"));
  }
  static void TearDownTestSuite() {
    simulated_.reset();
    shared_.reset();
  }
  static Sweep Determined() {
    Sweep sweep = *simulated_;
    sweep.description.floor.given_px = Measured{0.5, 0.01};
    return sweep;
  }
  static Sweep Grey() {
    Sweep sweep = Determined();
    sweep.frames = std::make_shared<GreyFrames>(sweep.camera.sensor);
    return sweep;
  }

 private:
  static std::unique_ptr<TemporaryFolder> shared_;
  static std::unique_ptr<Sweep> simulated_;
};

std::unique_ptr<TemporaryFolder> CalibrateInterfaceTest::shared_;
std::unique_ptr<Sweep> CalibrateInterfaceTest::simulated_;

TEST_F(CalibrateInterfaceTest, BothChoicesRefuseForOneReason) {
  for (const auto method : {CalibrationMethod::kFit, CalibrationMethod::kPaper}) {
    SCOPED_TRACE(static_cast<int>(method));
    const Calibration returned = Calibrate(Grey(), On(OnRefusal::kReturn, method));
    EXPECT_THAT(returned.refusal, Not(IsEmpty()));
    EXPECT_THAT(returned.refusal, Not(HasSubstr("\n")));
    EXPECT_EQ(returned.summary.outcome, calib::Outcome::kRefused);
    EXPECT_FALSE(returned.camera.calibration);
    EXPECT_EQ(returned.camera.name, "case-ii");
    EXPECT_THAT(returned.frames, SizeIs(10));
    try {
      Calibrate(Grey(), On(OnRefusal::kThrow, method));
      ADD_FAILURE() << "it was not refused";
    } catch (const CalibrationRefused& refused) {
      EXPECT_EQ(refused.what(), returned.refusal);
      EXPECT_EQ(refused.calibration().refusal, returned.refusal);
      EXPECT_FALSE(refused.calibration().camera.calibration);
      EXPECT_THAT(refused.calibration().frames, SizeIs(10));
    }
  }
}

TEST_F(CalibrateInterfaceTest, ARefusalIsThrownUnlessOtherwiseStated) {
  CalibrateOptions options;
  options.map_field = false;
  EXPECT_THROW(Calibrate(Grey(), options), CalibrationRefused);
}

// The sensor of a thin lens of 50 mm that is focused at 300 mm is at 60 mm.
TEST_F(CalibrateInterfaceTest, ADeterminedCameraIsReturnedByBothChoices) {
  for (const auto on_refusal : {OnRefusal::kThrow, OnRefusal::kReturn}) {
    const Calibration calibration = Calibrate(Determined(), On(on_refusal));
    EXPECT_EQ(calibration.refusal, "");
    ASSERT_TRUE(calibration.camera.calibration);
    const Measured d1 = calibration.camera.calibration->image_distance_mm.value();
    EXPECT_GT(d1.sigma, 0);
    EXPECT_LT(d1.sigma, 0.05);
    EXPECT_LT(std::abs(d1.value - 60), 5 * d1.sigma);
  }
}

// The frames on one side of focus are not enough for a fit, but the sharpest of them is enough for
// the paper's recipe, which takes its depth for that of focus.
TEST_F(CalibrateInterfaceTest, OnlyTheChosenMethodCanRefuse) {
  Sweep nearer = Determined();
  nearer.description.frames.resize(5);  // 286 to 298 mm
  EXPECT_THROW(Calibrate(nearer, On(OnRefusal::kThrow)), CalibrationRefused);
  const Calibration paper = Calibrate(nearer, On(OnRefusal::kThrow, CalibrationMethod::kPaper));
  EXPECT_EQ(paper.summary.outcome, calib::Outcome::kRefused);
  EXPECT_EQ(paper.refusal, "");
  EXPECT_NEAR(paper.camera.focus_depth_mm(), 298, 0.3);  // and an error of the reading
}

// A sweep of so few frames is refused before any method begins.
TEST_F(CalibrateInterfaceTest, TooFewFramesAreTheReasonOfBothMethods) {
  Sweep three = Determined();
  three.description.frames.resize(3);
  for (const auto method : {CalibrationMethod::kFit, CalibrationMethod::kPaper}) {
    EXPECT_THAT(Calibrate(three, On(OnRefusal::kReturn, method)).refusal,
                HasSubstr("at least 5 frames"));
  }
}

// A refusal is a finding about the sweep. What was not measured has no finding.
TEST_F(CalibrateInterfaceTest, OtherErrorsAreThrownByBothChoices) {
  for (const auto on_refusal : {OnRefusal::kThrow, OnRefusal::kReturn}) {
    Sweep missing = Determined();
    missing.description.frames.at(4).image = "no-such-frame.png";
    try {
      Calibrate(missing, On(on_refusal));
      ADD_FAILURE() << "a frame is missing";
    } catch (const CalibrationRefused& refused) {
      ADD_FAILURE() << refused.what();
    } catch (const Error& error) {
      EXPECT_THAT(error.what(), HasSubstr("no-such-frame.png"));
    }
    for (const bool at_once : {true, false}) {
      CancelToken token;
      RunControl run;
      run.cancel = &token;
      run.progress = [&](const Progress&) { token.Cancel(); };
      if (at_once) token.Cancel();
      EXPECT_THROW(Calibrate(Grey(), On(on_refusal), run), Interrupted);
    }
  }
}

TEST_F(CalibrateInterfaceTest, WrongOptionsAreNamedBeforeAFrameIsRead) {
  Sweep missing = Determined();
  missing.description.frames.at(0).image = "no-such-frame.png";
  EXPECT_EQ(FieldOfOptionError([&] { Calibrate(missing, On(static_cast<OnRefusal>(2))); }),
            "on_refusal");
  EXPECT_EQ(FieldOfOptionError([&] {
              Calibrate(missing, On(OnRefusal::kThrow, static_cast<CalibrationMethod>(-1)));
            }),
            "method");
  RunControl run;
  run.threads = -1;
  EXPECT_EQ(FieldOfOptionError([&] { Calibrate(missing, On(OnRefusal::kReturn), run); }),
            "threads");
  Sweep no_number = Determined();
  no_number.description.frames.at(0).reading_mm = testing::kNan;
  EXPECT_THAT(ErrorOf([&] { Calibrate(no_number, On(OnRefusal::kReturn)); }), HasSubstr("reading"));
}

}  // namespace
}  // namespace thicklens
