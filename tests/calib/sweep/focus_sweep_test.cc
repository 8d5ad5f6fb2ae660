#include "thicklens/calib/focus_sweep.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <string>

#include "support/error_message.h"
#include "tests/calib/simulated_sweep.h"

namespace thicklens::calib {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::thicklens::testing::ErrorOf;

model::Camera Camera() { return thicklens::testing::SweepCase("ii", 64, 1).camera; }

TEST(MakeFocusSweep, TakesWhatTheFileSays) {
  model::SweepFile file;
  file.target = model::SweepTarget::kKnifeEdge;
  file.target_period_mm = 5;
  file.floor.given_px = model::Estimate{0.5, 0.02};
  file.frames = {{"a.png", 3}};
  const FocusSweep sweep = MakeFocusSweep(file, Camera());
  EXPECT_EQ(sweep.target, model::SweepTarget::kKnifeEdge);
  EXPECT_EQ(sweep.target_period_mm.value(), 5);
  EXPECT_EQ(sweep.floor.given_px.value().sigma, 0.02);
  EXPECT_EQ(sweep.frames.at(0).reading_mm, 3);
}

TEST(MakeFocusSweep, RefusesTheFloorOfAnotherCamera) {
  const model::Camera camera = Camera();
  model::SweepFile file;
  file.floor.given_px = model::Estimate{0.5, 0.02};
  file.floor_origin =
      model::FloorOrigin{"s.yaml:3:9: ", "edge.yaml", camera.lens, camera.sensor.pixel_pitch_mm};
  EXPECT_EQ(MakeFocusSweep(file, camera).floor.given_px.value().value, 0.5);
  file.floor_origin->pixel_pitch_mm *= 2;
  EXPECT_THAT(ErrorOf([&] { MakeFocusSweep(file, camera); }),
              AllOf(HasSubstr("s.yaml:3:9: edge.yaml has sensor.pixel_pitch_mm 0.009"),
                    HasSubstr("of this sweep has 0.0045")));
}

TEST(FocusSweep, APeriodMustBePositive) {
  FocusSweep sweep;
  sweep.camera = Camera();
  sweep.read_frame = [](std::size_t) { return cv::Mat(); };
  std::string why;
  EXPECT_TRUE(sweep.IsValid(&why)) << why;
  sweep.target_period_mm = 5;
  EXPECT_TRUE(sweep.IsValid(&why)) << why;
  for (const double wrong : {0.0, -5.0, std::nan("")}) {
    sweep.target_period_mm = wrong;
    EXPECT_FALSE(sweep.IsValid(&why));
    EXPECT_THAT(why, HasSubstr("target_period_mm must be finite and > 0"));
  }
}

}  // namespace
}  // namespace thicklens::calib
