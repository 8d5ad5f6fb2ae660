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
using ::testing::IsEmpty;
using ::testing::SizeIs;
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

// ---- the plane of focus ----

// f1 50 mm, f2 52 mm, thickness 4 mm.
model::Camera MacroCamera() {
  model::Camera camera = Camera();
  camera.lens = {50, 52, 4, 5};
  return camera;
}

model::Camera Microscope() {
  model::Camera camera = Camera();
  camera.objective = model::Objective{10, 0.25, 200};
  camera.lens = model::LensOfObjective(*camera.objective);
  return camera;
}

TEST(MakeFocusSweep, TakesEachStatementOfThePlaneOfFocus) {
  model::SweepFile file;
  EXPECT_THAT(MakeFocusSweep(file, MacroCamera()).stated_focus, IsEmpty());
  file.focus_depth_mm = model::Estimate{150, 1};
  file.image_distance_mm = model::Estimate{82, 0.2};
  file.optical_tube_length_mm = model::Estimate{26, 0.3};
  file.magnification = model::Estimate{0.5, 0.01};
  const auto stated = MakeFocusSweep(file, MacroCamera()).stated_focus;
  ASSERT_THAT(stated, SizeIs(4));
  const struct {
    const char* name;
    model::ConjugateKind kind;
    model::Estimate value;
  } expected[] = {{"focus_depth_mm", model::ConjugateKind::kFocusDepth, {150, 1}},
                  {"image_distance_mm", model::ConjugateKind::kImageDistance, {82, 0.2}},
                  {"optical_tube_length_mm", model::ConjugateKind::kTubeLength, {26, 0.3}},
                  {"magnification", model::ConjugateKind::kMagnification, {0.5, 0.01}}};
  for (std::size_t i = 0; i < stated.size(); ++i) {
    EXPECT_EQ(stated[i].name, expected[i].name);
    EXPECT_EQ(stated[i].kind, expected[i].kind);
    EXPECT_EQ(stated[i].value.value, expected[i].value.value);
    EXPECT_EQ(stated[i].value.sigma, expected[i].value.sigma);
    // All four describe one plane.
    EXPECT_NEAR(model::FocusDepthOf(MacroCamera().lens, stated[i]).value, 150, 1e-9);
  }
}

TEST(MakeFocusSweep, AWorkingDistanceBecomesADepthFromTheAperture) {
  model::Camera camera = MacroCamera();
  model::SweepFile file;
  file.working_distance_mm = model::Estimate{120, 0.4};
  EXPECT_EQ(ErrorOf([&] { MakeFocusSweep(file, camera); }),
            "working_distance_mm is measured from the front of the lens: state "
            "lens.aperture_behind_front_mm in the camera file (the distance from there to the "
            "aperture), or state focus_depth_mm");
  camera.aperture_behind_front_mm = 31;
  auto stated = MakeFocusSweep(file, camera).stated_focus;
  ASSERT_THAT(stated, SizeIs(1));
  EXPECT_EQ(stated[0].name, "working_distance_mm");
  EXPECT_EQ(stated[0].kind, model::ConjugateKind::kFocusDepth);
  EXPECT_EQ(stated[0].value.value, 151);
  EXPECT_DOUBLE_EQ(stated[0].value.sigma, 0.4);
  // A tolerance is the half width of an interval: 0.3 sqrt(3) has the standard deviation 0.3.
  camera.statements["lens.aperture_behind_front_mm"] = {0.3 * std::sqrt(3.0), false};
  stated = MakeFocusSweep(file, camera).stated_focus;
  EXPECT_NEAR(stated.at(0).value.sigma, 0.5, 1e-12);
  camera.aperture_behind_front_mm = -75;
  EXPECT_EQ(ErrorOf([&] { MakeFocusSweep(file, camera); }),
            "working_distance_mm is 120: with lens.aperture_behind_front_mm -75 of the camera file "
            "it is a depth of 45 mm from the aperture, which must be larger than the front focal "
            "length (50 mm), because nothing nearer comes into focus");
}

TEST(MakeFocusSweep, AnObjectiveStatesItsMagnification) {
  model::Camera camera = Microscope();
  model::SweepFile file;
  auto stated = MakeFocusSweep(file, camera).stated_focus;
  ASSERT_THAT(stated, SizeIs(1));
  EXPECT_EQ(stated[0].name, "lens.magnification");
  EXPECT_EQ(stated[0].kind, model::ConjugateKind::kMagnification);
  EXPECT_EQ(stated[0].value.value, 10);
  // Its error is a tolerance, and no standard deviation.
  EXPECT_EQ(stated[0].value.sigma, 0);
  // A measured magnification takes its place. The equivalent lens has no length to measure.
  file.magnification = model::Estimate{9.8, 0.01};
  stated = MakeFocusSweep(file, camera).stated_focus;
  ASSERT_THAT(stated, SizeIs(1));
  EXPECT_EQ(stated[0].name, "magnification");
  EXPECT_EQ(stated[0].value.value, 9.8);
  file.magnification.reset();
  file.optical_tube_length_mm = model::Estimate{200, 1};
  EXPECT_THAT(
      ErrorOf([&] { MakeFocusSweep(file, camera); }),
      AllOf(HasSubstr("optical_tube_length_mm is stated"), HasSubstr("state magnification")));
}

TEST(FocusSweep, AnImpossibleStatementOfFocusIsNamed) {
  FocusSweep sweep;
  sweep.camera = MacroCamera();
  sweep.read_frame = [](std::size_t) { return cv::Mat(); };
  std::string why;
  sweep.stated_focus = {{model::ConjugateKind::kFocusDepth, {150, 1}, "focus_depth_mm"}};
  EXPECT_TRUE(sweep.IsValid(&why)) << why;
  sweep.stated_focus.push_back(
      {model::ConjugateKind::kImageDistance, {55.5, 0.2}, "image_distance_mm"});
  EXPECT_FALSE(sweep.IsValid(&why));
  EXPECT_FALSE(sweep.IsValid(nullptr));
  EXPECT_THAT(why, AllOf(HasSubstr("image_distance_mm is 55.5"), HasSubstr("larger than 56 mm")));
  sweep.stated_focus[1].value = {57, -1};
  EXPECT_FALSE(sweep.IsValid(&why));
  EXPECT_THAT(why, HasSubstr("a standard deviation >= 0"));
  sweep.stated_focus[1].value = {57, 1};
  EXPECT_TRUE(sweep.IsValid(&why)) << why;
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
