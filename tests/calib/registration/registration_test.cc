// Registration is compared with textures that are known in closed form and with simulated sweeps.
#include "calib/registration/registration.h"

#include <gtest/gtest.h>

#include <cmath>
#include <opencv2/imgproc.hpp>
#include <string>
#include <vector>

#include "calib/registration/image_scale.h"
#include "tests/calib/registration/wave_image.h"
#include "tests/calib/simulated_sweep.h"

namespace thicklens::calib {
namespace {

using thicklens::testing::SweepCase;
using thicklens::testing::View;
using thicklens::testing::WaveImage;

constexpr int kSizePx = 256;
constexpr double kMiddlePx = 0.5 * (kSizePx - 1);
const cv::Point2d kCentre(kMiddlePx, kMiddlePx);

TEST(Register, FindsScaleRotationAndShiftOfAHandHeldRail) {
  const WaveImage texture(1);
  const cv::Mat reference = texture.Render(kSizePx, {});
  for (const double sign : {-1.0, 1.0}) {
    for (const double scale : {0.8, 0.97, 1.0, 1.04, 1.25}) {
      View view;
      view.scale = scale;
      view.rotation_rad = sign * 0.052;  // 3 degrees
      view.shift_x = 0.1 * kSizePx;
      view.shift_y = -0.08 * sign * kSizePx;
      const auto found = Register(reference, texture.Render(kSizePx, view), 1.01 * scale, kCentre);
      ASSERT_TRUE(found) << scale;
      EXPECT_NEAR(found->scale / scale, 1, 1e-4) << scale;
      EXPECT_NEAR(found->rotation_rad, view.rotation_rad, 1e-4);
      EXPECT_NEAR(found->shift_px.x(), view.shift_x, 0.02);
      EXPECT_NEAR(found->shift_px.y(), view.shift_y, 0.02);
      EXPECT_NEAR(found->scale_x / found->scale_y, 1, 2e-4);
      EXPECT_LT(std::abs(found->scale - scale), 5 * found->scale_sigma);
    }
  }
}

// The caller chooses the centre: shift and scale about another pixel describe the same map.
TEST(Register, ShiftIsAboutTheGivenCentre) {
  const WaveImage texture(2);
  View view;
  view.scale = 1.1;
  view.shift_x = 3;
  const cv::Mat reference = texture.Render(kSizePx, {});
  const cv::Mat frame = texture.Render(kSizePx, view);
  const auto found = Register(reference, frame, 1.1, {100, 60});
  ASSERT_TRUE(found);
  EXPECT_NEAR(found->shift_px.x(), 3 + 0.1 * (100 - kMiddlePx), 0.02);
  EXPECT_NEAR(found->shift_px.y(), 0.1 * (60 - kMiddlePx), 0.02);
}

TEST(Register, SymmetricBlurDoesNotBias) {
  const WaveImage texture(3);
  for (const double blur_px : {1.0, 3.0, 6.0}) {
    View sharp, soft;
    soft.blur_px = blur_px;
    soft.scale = 1.06;
    const auto forward =
        Register(texture.Render(kSizePx, sharp), texture.Render(kSizePx, soft), 1.05, kCentre);
    const auto backward =
        Register(texture.Render(kSizePx, soft), texture.Render(kSizePx, sharp), 0.95, kCentre);
    ASSERT_TRUE(forward && backward) << blur_px;
    EXPECT_NEAR(forward->scale / 1.06, 1, 2e-5 + 7e-5 * blur_px) << blur_px;
    EXPECT_NEAR(backward->scale * 1.06, 1, 2e-5 + 7e-5 * blur_px) << blur_px;
  }
}

// A disc changes the sign of frequencies beyond its first zero, here at 0.12 cycles per px.
TEST(Register, ADiscsTurnedSignsDoNotBias) {
  const WaveImage texture(9);
  View disc;
  disc.disc_px = 5;
  disc.scale = 0.94;
  const auto found =
      Register(texture.Render(kSizePx, {}), texture.Render(kSizePx, disc), 0.95, kCentre);
  ASSERT_TRUE(found);
  EXPECT_NEAR(found->scale / 0.94, 1, 2e-4);
  EXPECT_LT(std::abs(found->scale - 0.94), 4 * found->scale_sigma);
}

TEST(Register, GainOffsetAndSlopeOfTheLightDoNotBias) {
  const WaveImage texture(4);
  View view;
  view.scale = 0.95;
  const cv::Mat reference = texture.Render(kSizePx, {});
  const auto even = Register(reference, texture.Render(kSizePx, view), 0.96, kCentre);
  view.gain = 0.3;
  view.offset = 0.1;
  view.slope = 1e-3;  // 26 % over the field
  const auto uneven = Register(reference, texture.Render(kSizePx, view), 0.96, kCentre);
  ASSERT_TRUE(even && uneven);
  EXPECT_NEAR(uneven->scale / 0.95, 1, 3e-5);
  EXPECT_NEAR(uneven->scale, even->scale, 5e-5);
  EXPECT_NEAR(uneven->shift_px.x(), even->shift_px.x(), 0.02);
}

// Both images are distorted by x' = X (1 + k X^2). In closed form, the remaining distortion is k
// (1 - 1/s^2).
TEST(Register, FindsRadialDistortionAsACubicTerm) {
  const WaveImage texture(5);
  const double k = 0.02 / (2 * kMiddlePx * kMiddlePx);  // 2 % at the corner
  for (const double scale : {0.8, 1.25}) {
    View reference, frame;
    reference.distortion = frame.distortion = k;
    frame.scale = scale;
    const auto found = Register(texture.Render(kSizePx, reference), texture.Render(kSizePx, frame),
                                scale, kCentre);
    ASSERT_TRUE(found);
    const double cubic = k * (1 - 1 / (scale * scale));
    EXPECT_NEAR(found->cubic / cubic, 1, 0.1) << scale;
    EXPECT_NEAR(found->scale / scale, 1, 5e-4) << scale;  // the affine map alone is 2e-3 off
  }
}

TEST(Register, WithoutDistortionTheCubicTermIsNothing) {
  const WaveImage texture(6);
  View view;
  view.scale = 1.2;
  view.noise = 0.005;
  const auto found =
      Register(texture.Render(kSizePx, {}), texture.Render(kSizePx, view), 1.2, kCentre);
  ASSERT_TRUE(found);
  EXPECT_GT(found->cubic_sigma, 0);
  EXPECT_LT(std::abs(found->cubic), 4 * found->cubic_sigma);
  EXPECT_LT(found->cubic_sigma * kMiddlePx * kMiddlePx, 2e-3);
}

// If the cubic term is known instead of free, the scatter is smaller and the answer is that of the
// affine map.
TEST(FreeRegistration, AKnownCubicTermMakesTheScaleSurer) {
  const WaveImage texture(7);
  View view;
  view.scale = 1.1;
  view.noise = 0.01;
  const auto found =
      RegisterFreely(texture.Render(kSizePx, {}), texture.Render(kSizePx, view), 1.1, kCentre);
  ASSERT_TRUE(found);
  const Registration known = found->WithCubic(0, 0);
  EXPECT_LT(known.scale_sigma, found->free.scale_sigma);
  EXPECT_NEAR(known.scale / 1.1, 1, 1e-4);
  const Registration same = found->WithCubic(found->free.cubic, found->free.cubic_sigma);
  EXPECT_DOUBLE_EQ(same.scale, found->free.scale);
  EXPECT_NEAR(same.scale_sigma / found->free.scale_sigma, 1, 1e-6);
}

TEST(Register, TheImageItselfHasScaleOne) {
  const cv::Mat image = WaveImage(8).Render(kSizePx, {});
  const auto found = Register(image, image, 1, kCentre);
  ASSERT_TRUE(found);
  EXPECT_NEAR(found->scale, 1, 2e-5);
  EXPECT_NEAR(found->shift_px.norm(), 0, 1e-3);
}

TEST(Register, RejectsUnrelatedImages) {
  std::vector<cv::Mat> images;
  for (unsigned seed = 10; seed < 14; ++seed) images.push_back(WaveImage(seed).Render(kSizePx, {}));
  for (std::size_t i = 0; i < images.size(); ++i) {
    for (std::size_t j = 0; j < images.size(); ++j) {
      EXPECT_EQ(Register(images[i], images[j], 1, kCentre).has_value(), i == j);
    }
  }
}

TEST(Register, RejectsAnImageStretchedOneWay) {
  const WaveImage texture(14);
  View view;
  view.scale = 0.99;
  view.stretch_x = 1.025;
  const cv::Mat reference = texture.Render(kSizePx, {});
  EXPECT_FALSE(Register(reference, texture.Render(kSizePx, view), 1, kCentre));
  view.stretch_x = 1.005;
  const auto found = Register(reference, texture.Render(kSizePx, view), 1, kCentre);
  ASSERT_TRUE(found);
  EXPECT_NEAR(found->scale_x / found->scale_y, 1.005, 3e-4);
  EXPECT_NEAR(found->scale, 0.99 * std::sqrt(1.005), 1e-4);
}

TEST(Register, RejectsBlankAndTinyImages) {
  const cv::Mat image = WaveImage(15).Render(kSizePx, {});
  EXPECT_FALSE(Register(image, cv::Mat(kSizePx, kSizePx, CV_32F, cv::Scalar(0.5)), 1, kCentre));
  const cv::Mat tiny = image(cv::Rect(0, 0, 40, 40)).clone();
  EXPECT_FALSE(Register(tiny, tiny, 1, {19.5, 19.5}));
  EXPECT_FALSE(Register(image, image, 9, kCentre));  // 28 px of the reference would be left
}

// Frames of a simulated sweep, with their true scales relative to the middle one.
struct Frames {
  std::vector<cv::Mat> grey;
  std::vector<double> scale;
  std::size_t middle = 0;
};
Frames Simulated(const std::string& name, model::TargetKind kind, std::uint64_t seed, int count,
                 double part = 1) {
  model::SweepSimulationOptions options = SweepCase(name, kSizePx, seed);
  options.target.kind = kind;
  const double range_mm = options.step_mm * (options.frame_count - 1);
  options.first_depth_mm += 0.5 * (1 - part) * range_mm;
  options.step_mm = part * range_mm / (count - 1);
  options.frame_count = count;
  const auto simulated = thicklens::testing::Simulate(options);
  Frames frames;
  frames.middle = static_cast<std::size_t>(count / 2);
  for (std::size_t i = 0; i < simulated.stored->size(); ++i) {
    frames.grey.push_back(LinearGrey((*simulated.stored)[i], simulated.sweep, i));
    frames.scale.push_back(simulated.TrueScale(i, frames.middle));
  }
  return frames;
}

// Spokes look the same at any scale, and a lone edge at any scale along it. The test expects no
// answer instead of a wrong one.
TEST(Register, RejectsTargetsWithoutAScale) {
  for (const char* name : {"i", "ii", "iv"}) {
    for (const model::TargetKind kind :
         {model::TargetKind::kSiemensStar, model::TargetKind::kKnifeEdge}) {
      const Frames frames = Simulated(name, kind, 1, 5, 0.5);
      for (const std::size_t i : {std::size_t{1}, std::size_t{3}}) {
        EXPECT_FALSE(Register(frames.grey[2], frames.grey[i], 1.005 * frames.scale[i], kCentre));
      }
    }
  }
}

// Errors divided by the stated sigma. The registration starts half a per cent off.
struct Pull {
  double square = 0, worst = 0;
  int count = 0, missed = 0;
};
void Add(const Frames& frames, Pull* pull) {
  for (std::size_t i = 0; i < frames.grey.size(); ++i) {
    if (i == frames.middle) continue;
    const auto found =
        Register(frames.grey[frames.middle], frames.grey[i], 1.005 * frames.scale[i], kCentre);
    if (!found) {
      ++pull->missed;
      continue;
    }
    const double error = std::abs(found->scale - frames.scale[i]);
    pull->square += std::pow(error / found->scale_sigma, 2);
    pull->worst = std::max(pull->worst, error);
    ++pull->count;
  }
}

TEST(Register, StatedSigmaIsTheErrorOnSimulatedSweeps) {
  Pull pull;
  std::uint64_t seed = 1;
  for (const char* name : {"i", "iii", "iv"}) {
    for (const model::TargetKind kind :
         {model::TargetKind::kDeadLeaves, model::TargetKind::kPinkNoise,
          model::TargetKind::kWhiteNoise, model::TargetKind::kCheckerboard}) {
      Add(Simulated(name, kind, seed++, 5), &pull);
    }
  }
  EXPECT_EQ(pull.missed, 0);
  EXPECT_GT(std::sqrt(pull.square / pull.count), 0.7);
  EXPECT_LT(std::sqrt(pull.square / pull.count), 1.4);
  EXPECT_LT(pull.worst, 4e-4);
}

// Up to 9 px of blur on 256 px.
TEST(Register, StatedSigmaIsTheErrorWhereDefocusIsStrong) {
  Pull pull;
  std::uint64_t seed = 21;
  for (const char* name : {"ii", "v"}) {
    for (const model::TargetKind kind :
         {model::TargetKind::kDeadLeaves, model::TargetKind::kPinkNoise,
          model::TargetKind::kWhiteNoise, model::TargetKind::kCheckerboard}) {
      Add(Simulated(name, kind, seed++, 7), &pull);
    }
  }
  EXPECT_LE(pull.missed, 3);
  EXPECT_GT(std::sqrt(pull.square / pull.count), 0.7);
  EXPECT_LT(std::sqrt(pull.square / pull.count), 1.4);
  EXPECT_LT(pull.worst, 4e-3);
}

}  // namespace
}  // namespace thicklens::calib
