// A lens or a sensor that moves, as an equivalent target: the lens equation at every frame is the
// oracle.
#include "calib/calibrate/focus_motion.h"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "thicklens/model/thick_lens.h"

namespace thicklens::calib {
namespace {

using model::SweepMotion;

FocusSweep SweepOf(const model::ThickLens& lens, bool in_dioptres = false) {
  FocusSweep sweep;
  sweep.camera.lens = lens;
  sweep.readings_are_focus_distances = in_dioptres;
  return sweep;
}

struct MotionCase {
  model::ThickLens lens;
  double focus_depth_mm;
  SweepMotion moves;
};

// Thin and thick lenses, in air and not, at magnifications from 0.03 to 3.
std::vector<MotionCase> Cases() {
  std::vector<MotionCase> cases;
  for (const SweepMotion moves : {SweepMotion::kLens, SweepMotion::kSensor}) {
    cases.push_back({{50, 50, 0, 9}, 300, moves});
    cases.push_back({{50, 50, 12, 9}, 1700, moves});
    cases.push_back({{48, 64, -5, 6}, 170, moves});
    cases.push_back({{100, 100, 3, 18}, 140, moves});
    cases.push_back({{100, 100, 0, 18}, 133, moves});
  }
  return cases;
}

// Blur radius and image scale of a frame, by the lens equation: the cone from the aperture to the
// image of the target, cut by the sensor.
struct Frame {
  double blur_per_aperture, scale;
};
Frame TracedFrame(const MotionCase& of, double moved_mm) {
  const double f1 = of.lens.front_focal_length_mm, f2 = of.lens.rear_focal_length_mm;
  const double xf = f2 * of.focus_depth_mm / (of.focus_depth_mm - f1);
  const double z = of.focus_depth_mm - (of.moves == SweepMotion::kLens ? moved_mm : 0);
  const double image = f2 * z / (z - f1);  // of the target, behind the rear principal plane
  const double sensor = xf + moved_mm;
  return {std::abs(sensor - image) / image, (sensor / z) / (xf / of.focus_depth_mm)};
}

TEST(FocusMotion, EquivalentTargetHasTheBlurOfTheLensEquation) {
  for (const MotionCase& of : Cases()) {
    const double xf = SensorDistanceOf(of.lens, of.focus_depth_mm);
    const FocusMotion motion(SweepOf(of.lens), of.moves, xf, 7);
    const model::ThickLens equivalent = motion.EquivalentLens();
    const double d1_mm = model::ImageDistanceMm(equivalent, motion.unit_mm());
    for (const double part : {-0.02, -0.004, 0.003, 0.02}) {
      const double moved_mm = part * xf;
      const auto depth_mm = motion.EquivalentDepthMm(7 + moved_mm);
      ASSERT_TRUE(depth_mm);
      const Frame frame = TracedFrame(of, moved_mm);
      EXPECT_NEAR(std::abs(model::DefocusPerAperture(equivalent, d1_mm, *depth_mm)),
                  frame.blur_per_aperture, 1e-9);
      const double scale = motion.unit_mm() / *depth_mm;
      // Exact for the sensor, to second order for the lens.
      const double allowed =
          of.moves == SweepMotion::kSensor ? 1e-12 : 3 * std::pow(frame.scale - 1, 2) + 1e-12;
      EXPECT_NEAR(scale, frame.scale, allowed);
      EXPECT_NEAR(*motion.ReadingAt(*depth_mm), 7 + moved_mm, 1e-7);
    }
  }
}

TEST(FocusMotion, OneMillimetreOfReadingIsOneOfTheEquivalentDepthAtFocus) {
  for (const MotionCase& of : Cases()) {
    const double xf = SensorDistanceOf(of.lens, of.focus_depth_mm);
    const FocusMotion motion(SweepOf(of.lens), of.moves, xf, 0);
    const double step_mm = 1e-4;
    EXPECT_NEAR(*motion.EquivalentDepthMm(0), motion.unit_mm(), 1e-9);
    EXPECT_NEAR(
        (*motion.EquivalentDepthMm(step_mm) - *motion.EquivalentDepthMm(-step_mm)) / (2 * step_mm),
        -1, 1e-6);
    EXPECT_NEAR(motion.BlurGrowth(), TracedFrame(of, step_mm).blur_per_aperture / step_mm,
                1e-4 * motion.BlurGrowth());
  }
}

// A thin lens that moves changes the scale by 1/f per mm at any magnification, and does not change
// the focus at 1:1.
TEST(FocusMotion, OfALensHasTheScaleOfTheFocalLengthAndNoFocusAtOneToOne) {
  const model::ThickLens lens{50, 50, 0, 9};
  for (const double zf : {60.0, 99.0, 150.0, 5000.0}) {
    const FocusMotion motion(SweepOf(lens), SweepMotion::kLens, SensorDistanceOf(lens, zf), 0);
    EXPECT_NEAR(motion.unit_mm(), 50, 1e-9);
  }
  const FocusMotion even(SweepOf(lens), SweepMotion::kLens, 100, 0);
  EXPECT_NEAR(even.blur_per_scale(), 0, 1e-12);
}

// Readings of a focus drive are the distances that it is focused on.
TEST(FocusMotion, OfFocusDistancesFollowsTheLensEquation) {
  const model::ThickLens lens{4.74, 4.74, 0, 1.3};
  const double zf = 1000 / 5.7;
  const FocusMotion motion(SweepOf(lens, true), SweepMotion::kSensor, 0, zf);
  EXPECT_NEAR(motion.FocusDepthMm(), zf, 1e-9);
  for (const double dioptres : {2.5, 5.0, 6.2, 9.0}) {
    const double focused_mm = 1000 / dioptres;
    const double sensor = 1 / (1 / 4.74 - dioptres / 1000), image = 1 / (1 / 4.74 - 1 / zf);
    EXPECT_NEAR(std::abs(motion.DefocusPerAperture(focused_mm).value()),
                std::abs(sensor - image) / image, 1e-12);
    EXPECT_NEAR(motion.SensorDistanceMm(focused_mm), sensor, 1e-12);
    EXPECT_NEAR(*motion.ReadingAt(*motion.EquivalentDepthMm(focused_mm)), focused_mm, 1e-5);
  }
}

}  // namespace
}  // namespace thicklens::calib
