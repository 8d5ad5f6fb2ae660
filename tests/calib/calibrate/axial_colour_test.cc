// Calibrations of sweeps in colour, of lenses with and without axial colour.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>

#include "tests/calib/simulated_sweep.h"
#include "thicklens/calib/calibrate.h"
#include "thicklens/model/light_field.h"

namespace thicklens::calib {
namespace {

using ::testing::Contains;
using ::testing::HasSubstr;
using ::testing::Not;

constexpr double kGrey[] = {0.2126, 0.7152, 0.0722};

Calibration OfColours(const Eigen::Vector3d& colours_mm, std::uint64_t seed, bool maps_field) {
  model::SweepSimulationOptions options = testing::SweepCase("ii", 0, seed);
  options.camera = model::CropCamera(options.camera, {156, 156, 160, 160});
  options.bits = 16;
  options.aberrations.axial_colour_mm = colours_mm;
  const testing::SimulatedSweep simulated = testing::Simulate(options);
  CalibrationOptions how;
  how.map_field = maps_field;
  return Calibrate(simulated.sweep, how);
}

double SigmasBeyond(const Result& result, double truth) {
  const Eigen::Vector2d interval =
      result.systematic.value_or(Eigen::Vector2d(result.value, result.value));
  const double low = std::min(result.value, interval.x());
  const double high = std::max(result.value, interval.y());
  return std::max({0.0, low - truth, truth - high}) / result.sigma;
}

// The distances between the colours and kappa of each are the truth within their errors over the
// seeds, and so is zf with the error that all colours share. The grey 1/zf is the mean weighted as
// in grey, and kappa is not changed by the colour.
TEST(AxialColourOfSweeps, EachColourHasItsFocusAndTheSameRatio) {
  const Eigen::Vector3d colours_mm(2.5, 0, -1.5);
  constexpr double kFocusMm = 300, kRatio = 0.45;
  constexpr int kSeeds = 3;
  constexpr double kMaxChi2 = 16.3;  // 99.9 % of chi^2 with three degrees of freedom
  Eigen::Array3d apart_chi2 = Eigen::Array3d::Zero(), focus_chi2 = apart_chi2;
  Eigen::Array3d ratio_chi2 = apart_chi2;
  double inverse_mm = 0;
  for (int c = 0; c < 3; ++c) inverse_mm += kGrey[c] / (kFocusMm + colours_mm[c]);
  for (int seed = 1; seed <= kSeeds; ++seed) {
    const Calibration found = OfColours(colours_mm, static_cast<std::uint64_t>(seed), true);
    ASSERT_TRUE(found.summary.blur_ratio) << found.summary.reason;
    const Result& grey = *found.summary.focus_depth_mm;
    const auto& channels = found.diagnostics.channels;
    ASSERT_EQ(channels.size(), 3U);
    for (const ChannelFocus& channel : channels) ASSERT_TRUE(channel.done) << channel.message;
    for (int c = 0; c < 3; ++c) {
      const ChannelFocus& of = channels[static_cast<std::size_t>(c)];
      const ChannelFocus& next = channels[static_cast<std::size_t>((c + 1) % 3)];
      const model::Estimate &focus = of.focus_depth_mm, &other = next.focus_depth_mm;
      apart_chi2[c] +=
          std::pow((focus.value - other.value - colours_mm[c] + colours_mm[(c + 1) % 3]) /
                       std::hypot(focus.sigma, other.sigma),
                   2);
      focus_chi2[c] += std::pow(
          (focus.value - kFocusMm - colours_mm[c]) / std::hypot(focus.sigma, grey.sigma), 2);
      ratio_chi2[c] += std::pow((of.blur_ratio.value - kRatio) / of.blur_ratio.sigma, 2);
    }
    EXPECT_NEAR(grey.value, 1 / inverse_mm, 4 * grey.sigma);
    EXPECT_LT(SigmasBeyond(grey, 1 / inverse_mm), 2.5);
    // The root mean square of the colours about grey, 1.15 mm, is no error of zf.
    EXPECT_LT(0.5 * (grey.systematic->y() - grey.systematic->x()), 0.3);
    // The sensor is in the focus of the colour that the focal length is of, which is green.
    EXPECT_LT(SigmasBeyond(*found.summary.image_distance_mm, 60), 2);
    EXPECT_LT(SigmasBeyond(*found.summary.blur_ratio, kRatio), 3);
    EXPECT_THAT(found.summary.warnings, Contains(HasSubstr("the colours come into focus")));
    EXPECT_THAT(found.diagnostics.systematic_parts,
                Contains(::testing::Field(&SystematicPart::name, "axial colour")));
  }
  EXPECT_LT(apart_chi2.maxCoeff(), kMaxChi2) << apart_chi2;
  EXPECT_LT(focus_chi2.maxCoeff(), kMaxChi2) << focus_chi2;
  EXPECT_LT(ratio_chi2.maxCoeff(), kMaxChi2) << ratio_chi2;
}

// Without the map, a few frames show it.
TEST(AxialColourOfSweeps, IsFoundWithoutTheMap) {
  const Calibration found = OfColours({2.5, 0, -1.5}, 5, false);
  EXPECT_THAT(found.summary.warnings, Contains(HasSubstr("the colours come into focus")));
}

// Channels that differ by their noise alone are compared, and nothing is said of them.
TEST(AxialColourOfSweeps, ALensWithoutItIsNotAccused) {
  for (const std::uint64_t seed : {1, 2}) {
    const Calibration found = OfColours({0, 0, 0}, seed, true);
    ASSERT_EQ(found.diagnostics.channels.size(), 3U);
    EXPECT_THAT(found.summary.warnings, Not(Contains(HasSubstr("the colours"))));
    EXPECT_THAT(found.diagnostics.systematic_parts,
                Not(Contains(::testing::Field(&SystematicPart::name, "axial colour"))));
  }
}

}  // namespace
}  // namespace thicklens::calib
