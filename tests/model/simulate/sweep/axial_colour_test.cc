// Simulated sweeps of lenses whose colours come into focus at different depths.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstddef>

#include "thicklens/model/sweep_simulator.h"

namespace thicklens::model {
namespace {

constexpr double kColourFocusMm = 300;

SweepSimulationOptions Edge(const Eigen::Vector3d& colours_mm) {
  SweepSimulationOptions options =
      ReadSweepSimulation(THICKLENS_SOURCE_DIR "/configs/sweeps/case-ii.yaml");
  options.camera.sensor.width_px = 160;
  options.camera.sensor.height_px = 8;
  options.camera.sensor.principal_point_px = {79.5, 3.5};
  options.camera.sensor.transfer = TransferCurve::Linear();
  options.camera.lens = {50, 50, 0, 8.9};
  options.camera.calibration->image_distance_mm =
      Estimate{ImageDistanceMm(options.camera.lens, kColourFocusMm), 0};
  options.camera.calibration->blur_ratio = Estimate{0.45, 0};
  options.camera.calibration->blur_floor_px = Estimate{0.5, 0};
  options.target = {};
  options.target.kind = TargetKind::kKnifeEdge;
  options.target.edge_angle_deg = 0;
  options.pupil_law = PupilLaw::kUniform;
  options.lamp_falloff = false;
  options.first_depth_mm = 286;
  options.step_mm = 30;
  options.frame_count = 2;
  options.aberrations.axial_colour_mm = colours_mm;
  options.effects.base = EffectSelectionOptions::Base::kGiven;
  options.effects.given = {Effect::kDefocus,  Effect::kLensFloor,   Effect::kMagnification,
                           Effect::kPixelBox, Effect::kAberrations, Effect::kShotNoise};
  return options;
}

// Sigma of the spread of an edge in a row of one channel, from the second moment of its slope, px.
double SigmaOfEdge(const LinearImage& image, int channel) {
  double sum = 0, first = 0, second = 0;
  const auto value = [&](int x) {
    return static_cast<double>(
        image
            .values[static_cast<std::size_t>((4 * image.width_px + x) * image.channels + channel)]);
  };
  for (int x = 1; x < image.width_px; ++x) {
    const double slope = value(x) - value(x - 1);
    sum += slope;
    first += slope * x;
    second += slope * x * x;
  }
  const double mean = first / sum;
  return std::sqrt(second / sum - mean * mean - 1.0 / 12 - 1.0 / 12);
}

// The blur of each colour is kappa r K/p |1/z - 1/zf of the colour|, with one K for all.
TEST(AxialColour, AnEdgeHasTheBlurOfItsColour) {
  const Eigen::Vector3d colours_mm(6, 0, -4);
  const SweepSimulator simulator(Edge(colours_mm), {});
  const double k_mm = 50 * kColourFocusMm / (kColourFocusMm - 50);
  const double p_mm = simulator.camera().sensor.pixel_pitch_mm;
  for (int frame = 0; frame < 2; ++frame) {
    const LinearImage image = simulator.RenderNoiseless(frame);
    ASSERT_EQ(image.channels, 3);
    for (int c = 0; c < 3; ++c) {
      const double z = 286 + 30 * frame;
      const double sigma_px =
          0.45 * 8.9 * k_mm / p_mm * std::abs(1 / z - 1 / (kColourFocusMm + colours_mm[c]));
      EXPECT_NEAR(SigmaOfEdge(image, c), std::hypot(0.5, sigma_px), 0.01)
          << "frame " << frame << ", channel " << c;
    }
  }
  ASSERT_TRUE(simulator.truth().aberrations.axial_colour_mm);
  EXPECT_EQ(*simulator.truth().aberrations.axial_colour_mm, colours_mm);
}

// Without displacement, or with the effect left out, each channel is the grey frame bit for bit.
TEST(AxialColour, WithoutItEachChannelIsTheGreyFrame) {
  SweepSimulationOptions grey = Edge({0, 0, 0});
  grey.target.kind = TargetKind::kDeadLeaves;
  SweepSimulationOptions colour = grey, left_out = grey;
  grey.aberrations.axial_colour_mm.reset();
  left_out.aberrations.axial_colour_mm.emplace(6, 0, -4);
  left_out.effects.given.Remove(Effect::kAberrations);
  const SweepSimulator of_left_out(left_out, {});
  const LinearImage expected = SweepSimulator(grey, {}).RenderNoiseless(1);
  const LinearImage same = SweepSimulator(colour, {}).RenderNoiseless(1);
  ASSERT_EQ(same.values.size(), 3 * expected.values.size());
  for (std::size_t i = 0; i < same.values.size(); ++i)
    ASSERT_EQ(same.values[i], expected.values[i / 3]) << i;
  const LinearImage without = of_left_out.RenderNoiseless(1);
  for (std::size_t i = 0; i < without.values.size(); i += 3) {
    ASSERT_EQ(without.values[i], without.values[i + 1]);
    ASSERT_EQ(without.values[i], without.values[i + 2]);
  }
  EXPECT_FALSE(of_left_out.truth().aberrations.axial_colour_mm);
}

// The noise of the channels is independent.
TEST(AxialColour, ChannelsHaveTheirOwnNoise) {
  SweepSimulationOptions options = Edge({0, 0, 0});
  options.full_well_electrons = 1000;
  options.bits = 16;
  const EncodedImage image = SweepSimulator(options, {}).RenderFrame(0);
  ASSERT_EQ(image.channels, 3);
  int different = 0;
  for (std::size_t i = 0; i < image.values.size(); i += 3)
    different += image.values[i] != image.values[i + 2] ? 1 : 0;
  EXPECT_GT(different, 160 * 8 * 9 / 10);
}

}  // namespace
}  // namespace thicklens::model
