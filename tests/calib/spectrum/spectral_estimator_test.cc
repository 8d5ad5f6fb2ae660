#include "calib/spectrum/spectral_estimator.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <numeric>
#include <vector>

#include "tests/calib/known_texture.h"

namespace thicklens::calib {
namespace {

using ::testing::Each;
using ::testing::ElementsAre;
using thicklens::testing::GaussianOf;
using thicklens::testing::KnownTexture;
using thicklens::testing::TextureView;
using thicklens::testing::WithWhiteNoise;

constexpr int kWidthPx = 168, kHeightPx = 150;
constexpr double kPi = 3.14159265358979323846;

// Frames that need not be read.
SpectralEstimatorSetup Unread(const std::vector<double>& variances_px2) {
  SpectralEstimatorSetup setup;
  setup.origin_px = {80, 76};
  setup.size_px = {kWidthPx, kHeightPx};
  setup.threads = 1;
  for (std::size_t i = 0; i < variances_px2.size(); ++i) {
    EstimatorFrame frame;
    frame.frame = i;
    frame.expected_variance_px2 = variances_px2[i];
    frame.pixel_noise = 1e-3;
    setup.frames.push_back(frame);
  }
  return setup;
}

// ---- the window ----

TEST(PlanRegion, TheWindowIsWhatAllFramesSee) {
  SpectralEstimatorSetup setup = Unread(std::vector<double>(9, 0.3));
  setup.reference = 4;
  const double scales[] = {1.2, 1.1, 1.06, 1.02, 1, 0.97, 0.94, 0.91, 0.88};
  for (std::size_t i = 0; i < 9; ++i) {
    setup.frames[i].place.scale = scales[i];
    if (i != 4) {
      setup.frames[i].place.shift_px = {2.0 * static_cast<double>(i) - 7,
                                        5 - 1.5 * static_cast<double>(i)};
    }
  }
  const auto region = PlanRegion(setup, 1, {0, 0});
  ASSERT_TRUE(region);
  EXPECT_EQ(region->frames.size(), 9U);
  EXPECT_EQ(region->frames[region->reference], 4U);
  // Its corners are inside every frame, and on each side it touches the border of one frame.
  const Eigen::Vector2d low = region->window.centre_px - 0.5 * region->window.size_px;
  const Eigen::Vector2d high = region->window.centre_px + 0.5 * region->window.size_px;
  Eigen::Vector2d least = {1e9, 1e9}, room = {1e9, 1e9};
  for (const EstimatorFrame& frame : setup.frames) {
    const auto pixel = [&](const Eigen::Vector2d& target) {
      return Eigen::Vector2d(setup.origin_px + frame.place.shift_px + frame.place.scale * target);
    };
    least = least.cwiseMin(pixel(low));
    room = room.cwiseMin(Eigen::Vector2d(kWidthPx - 1, kHeightPx - 1) - pixel(high));
  }
  for (int axis = 0; axis < 2; ++axis) {
    EXPECT_NEAR(least[axis], 0, 1e-9);
    EXPECT_NEAR(room[axis], 0, 1e-9);
  }
}

TEST(PlanRegion, APartLiesWhereItIsAskedFor) {
  const SpectralEstimatorSetup setup = Unread(std::vector<double>(9, 0.3));
  const auto whole = PlanRegion(setup, 1, {0, 0});
  const auto part = PlanRegion(setup, 0.4, {-0.3, 0.2});
  ASSERT_TRUE(whole && part);
  const Eigen::Vector2d size = whole->window.size_px;
  EXPECT_LT((part->window.size_px - 0.4 * size).norm(), 1e-9);
  EXPECT_LT((part->window.centre_px - whole->window.centre_px -
             Eigen::Vector2d(-0.3 * size.x(), 0.2 * size.y()))
                .norm(),
            1e-9);
}

// Blurs from 0 upward in steps of `step_px`; the reference is the sharpest.
std::vector<double> Blurs(int count, double step_px) {
  std::vector<double> variances;
  for (int i = 0; i < count; ++i) variances.push_back(0.4 + std::pow(step_px * i, 2));
  return variances;
}

TEST(PlanRegion, FramesTooBlurredForTheWindowAreDropped) {
  // The smaller side of the window is 149 px: 149/35 = 4.26 px of blur beyond the sharpest.
  const SpectralEstimatorSetup setup = Unread(Blurs(14, 0.4));
  const auto region = PlanRegion(setup, 1, {0, 0});
  ASSERT_TRUE(region);
  EXPECT_EQ(region->frames.size(), 11U);
  EXPECT_EQ(region->frames.back(), 10U);
  EXPECT_EQ(region->reference, 0U);
}

TEST(PlanRegion, WhereTooFewWouldBeLeftMoreBlurIsAllowed) {
  // 4.26 px would leave 6 frames, 149/25 = 5.96 px 8, 149/16 = 9.3 px 12.
  const auto wide = PlanRegion(Unread(Blurs(14, 0.8)), 1, {0, 0});
  ASSERT_TRUE(wide);
  EXPECT_EQ(wide->frames.size(), 12U);
  // Here a factor of 25 leaves 9 frames, which is enough.
  const auto middle = PlanRegion(Unread(Blurs(14, 0.7)), 1, {0, 0});
  ASSERT_TRUE(middle);
  EXPECT_EQ(middle->frames.size(), 9U);
  // A short sweep needs all of its frames.
  const auto few = PlanRegion(Unread(Blurs(6, 1.8)), 1, {0, 0});
  ASSERT_TRUE(few);
  EXPECT_EQ(few->frames.size(), 6U);
}

TEST(PlanRegion, FewerThanFiveFramesAreNothing) {
  EXPECT_FALSE(PlanRegion(Unread(Blurs(12, 2.5)), 1, {0, 0}));
  EXPECT_TRUE(PlanRegion(Unread(Blurs(12, 2.2)), 1, {0, 0}));  // 9.3 px: 5 frames
  EXPECT_FALSE(PlanRegion(Unread(Blurs(4, 0.1)), 1, {0, 0}));
  // The reference itself is too blurred.
  SpectralEstimatorSetup setup = Unread(Blurs(12, 1));
  setup.reference = 11;
  EXPECT_FALSE(PlanRegion(setup, 1, {0, 0}));
}

// One frame that shows almost nothing of the target of the others must not make the window empty
// for all.
TEST(PlanRegion, AFrameThatSeesLittleIsDroppedRatherThanTheOthers) {
  SpectralEstimatorSetup setup = Unread(Blurs(14, 0.3));
  setup.frames[2].place.shift_px = {120, 0};
  const auto region = PlanRegion(setup, 1, {0, 0});
  ASSERT_TRUE(region);
  EXPECT_GE(region->frames.size(), 12U);
}

// ---- the spectra ----

struct Rendered {
  SpectralEstimatorSetup setup;
  std::vector<cv::Mat> images;
  std::shared_ptr<std::atomic<int>> ticks = std::make_shared<std::atomic<int>>(0);
};

// Nine frames of a known texture, of which the fifth is the sharpest.
Rendered Render(double rotation_rad, double highest = 0.4, double noise = 0) {
  Rendered r;
  std::vector<double> variances;
  for (int i = 0; i < 9; ++i) variances.push_back(0.35 + 0.3 * (i - 4) * (i - 4));
  r.setup = Unread(variances);
  r.setup.reference = 4;
  const KnownTexture texture(7, highest, 350);
  for (int i = 0; i < 9; ++i) {
    EstimatorFrame& frame = r.setup.frames[static_cast<std::size_t>(i)];
    frame.place.scale = 1 - 0.02 * (i - 4);
    TextureView view;
    view.scale = frame.place.scale;
    if (i != 4) {
      frame.place.shift_px = view.shift_px = {1.3 - 0.4 * i, 0.2 * i};
      frame.rotation_rad = view.rotation_rad = rotation_rad;
    }
    cv::Mat image = texture.Render(kWidthPx, kHeightPx, r.setup.origin_px, view,
                                   GaussianOf(frame.expected_variance_px2));
    if (noise > 0) image = WithWhiteNoise(image, noise, 50 + static_cast<unsigned>(i));
    r.images.push_back(image);
  }
  r.setup.read_grey = [images = r.images](std::size_t frame) { return images[frame]; };
  r.setup.tick = [ticks = r.ticks] { ++*ticks; };
  return r;
}

std::vector<EstimatorRegion> Measured(const SpectralEstimatorSetup& setup, double part = 1) {
  std::vector<EstimatorRegion> regions = {PlanRegion(setup, part, {0, 0}).value()};
  MeasureRegions(setup, &regions);
  return regions;
}

TEST(MeasureRegions, GivesEveryFramesSpectrumInItsBand) {
  const Rendered r = Render(0);
  const EstimatorRegion region = Measured(r.setup)[0];
  ASSERT_EQ(region.frames.size(), 9U);
  ASSERT_EQ(region.samples.size(), 9U);
  EXPECT_EQ(*r.ticks, 9);
  EXPECT_EQ(region.samples[region.reference].spectrum.values.size(),
            static_cast<Eigen::Index>(region.modes.size()));
  for (std::size_t i = 0; i < 9; ++i) {
    const EstimatorFrame& frame = r.setup.frames[region.frames[i]];
    const SpectrumSample& sample = region.samples[i];
    EXPECT_EQ(sample.scale, frame.place.scale);
    EXPECT_EQ(sample.pixel_noise, frame.pixel_noise);
    EXPECT_EQ(sample.start_variance_px2, frame.expected_variance_px2);
    const auto count = static_cast<std::size_t>(sample.spectrum.values.size());
    const auto direct = MeasureSpectrum(r.images[region.frames[i]], r.setup.origin_px, frame.place,
                                        region.window, region.modes, count);
    ASSERT_TRUE(direct);
    EXPECT_EQ((direct->values - sample.spectrum.values).abs().maxCoeff(), 0);
    EXPECT_EQ(direct->noise_gain, sample.spectrum.noise_gain);
    // The modes that a fit with a band of 2 may need are present; those lost in blur are not.
    if (frame.frame == 4) continue;
    const double added = frame.expected_variance_px2 - 0.35;
    for (std::size_t k = 0; k < region.modes.size(); ++k) {
      const double nu = ModeFrequency(region.modes[k], region.window).norm();
      const double exponent = 2 * kPi * kPi * added * nu * nu;
      if (k < count) {
        EXPECT_LT(exponent, 4) << i;
      }
      if (k >= count) {
        EXPECT_GT(std::max(exponent / 2.5, nu / (0.35 * frame.place.scale)), 1) << i;
      }
    }
  }
}

TEST(MeasureRegions, ChoosesModesThatTheTextureHas) {
  // Waves up to 0.15 cycles per px, and noise at all frequencies.
  Rendered r = Render(0, 0.15, 2e-3);
  for (EstimatorFrame& frame : r.setup.frames) frame.pixel_noise = 2e-3;
  const EstimatorRegion region = Measured(r.setup)[0];
  ASSERT_GT(region.modes.size(), 50U);
  std::size_t beyond = 0;
  for (const Mode& mode : region.modes)
    beyond += ModeFrequency(mode, region.window).norm() > 0.17 ? 1U : 0U;
  // Chance alone lifts a few modes above four times the noise.
  EXPECT_LT(static_cast<double>(beyond), 0.05 * static_cast<double>(region.modes.size()));
}

TEST(MeasureRegions, DropsFramesThatDoNotSeeTheWindow) {
  Rendered r = Render(0);
  std::vector<EstimatorRegion> regions = {PlanRegion(r.setup, 1, {0, 0}).value(),
                                          PlanRegion(r.setup, 0.5, {0, 0}).value()};
  // The registration of two frames is corrected after the window was planned.
  r.setup.frames[1].place.shift_px.x() += 24;
  r.setup.frames[7].place.shift_px.y() -= 24;
  MeasureRegions(r.setup, &regions);
  EXPECT_THAT(regions[0].frames, ElementsAre(0U, 2U, 3U, 4U, 5U, 6U, 8U));
  EXPECT_EQ(regions[0].frames[regions[0].reference], 4U);
  ASSERT_EQ(regions[0].samples.size(), 7U);
  EXPECT_EQ(regions[0].samples[1].scale, r.setup.frames[2].place.scale);
  // All frames still contain the smaller window.
  EXPECT_EQ(regions[1].frames.size(), 9U);
}

TEST(MeasureRegions, DoesNotDependOnThreads) {
  Rendered r = Render(0.004);
  const EstimatorRegion one = Measured(r.setup)[0];
  r.setup.threads = 3;
  const EstimatorRegion three = Measured(r.setup)[0];
  ASSERT_EQ(one.samples.size(), three.samples.size());
  for (std::size_t i = 0; i < one.samples.size(); ++i)
    EXPECT_TRUE((one.samples[i].spectrum.values == three.samples[i].spectrum.values).all());
  EXPECT_TRUE((one.leakage.At(3, one.modes.size()) == three.leakage.At(3, one.modes.size())).all());
}

// V of every frame as the blur estimator finds it, minus the truth.
Eigen::VectorXd FoundErrors(const Rendered& r, const EstimatorRegion& region) {
  const RelativeBlur fit = FitRelativeBlur(region.samples, region.reference, region.window,
                                           region.modes, region.leakage, {});
  EXPECT_TRUE(fit.done) << fit.message;
  Eigen::VectorXd errors = fit.variances_px2;
  for (std::size_t i = 0; i < region.frames.size(); ++i)
    errors[static_cast<Eigen::Index>(i)] -= r.setup.frames[region.frames[i]].expected_variance_px2;
  return errors;
}

TEST(MeasureRegions, GivesAFitWhatItNeeds) {
  const Rendered r = Render(0);
  EXPECT_LT(FoundErrors(r, Measured(r.setup)[0]).cwiseAbs().maxCoeff(), 0.02);
}

// Rotated frames are rotated back. Otherwise they would look more blurred.
TEST(MeasureRegions, TakesRotationOut) {
  for (const double rotation_rad : {0.012, -0.02}) {
    Rendered r = Render(rotation_rad);
    EXPECT_LT(FoundErrors(r, Measured(r.setup)[0]).cwiseAbs().maxCoeff(), 0.03);
    for (EstimatorFrame& frame : r.setup.frames) frame.rotation_rad = 0;
    EXPECT_GT(FoundErrors(r, Measured(r.setup)[0]).cwiseAbs().maxCoeff(), 0.06);
  }
}

TEST(MeasureRegions, LeavesAHairOfRotationInRatherThanResample) {
  const Rendered r = Render(5e-4);  // 0.08 px over the field
  const EstimatorRegion region = Measured(r.setup)[0];
  const auto raw = MeasureSpectrum(r.images[0], r.setup.origin_px, r.setup.frames[0].place,
                                   region.window, region.modes, 20);
  ASSERT_TRUE(raw);
  // The order of the sums differs.
  EXPECT_LT((raw->values - region.samples[0].spectrum.values.head(20)).abs().maxCoeff(), 1e-8);
  EXPECT_LT(FoundErrors(r, region).cwiseAbs().maxCoeff(), 0.02);
}

}  // namespace
}  // namespace thicklens::calib
