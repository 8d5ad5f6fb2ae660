#include "calib/registration/target_period.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <string>

#include "tests/calib/drawn_edges.h"
#include "tests/calib/simulated_sweep.h"
#include "thicklens/model/thick_lens.h"

namespace thicklens::calib {
namespace {

using thicklens::testing::SweepCase;

// A pattern in its own coordinates u, v (px), rotated by `angle_deg`, under a lamp that is darker
// on one side, with noise.
using Pattern = std::function<double(double u, double v)>;
cv::Mat Draw(cv::Size size, double angle_deg, const Pattern& pattern, double noise = 0.01) {
  const double c = std::cos(angle_deg * CV_PI / 180), s = std::sin(angle_deg * CV_PI / 180);
  cv::Mat grey(size, CV_32F), grain(size, CV_32F);
  for (int y = 0; y < size.height; ++y) {
    for (int x = 0; x < size.width; ++x) {
      const double lamp = 1 + 0.4 * (x - 0.5 * size.width) / size.width;
      grey.at<float>(y, x) =
          static_cast<float>(lamp * pattern(c * x + s * y + 3.3, c * y - s * x + 7.1));
    }
  }
  cv::RNG random(11);
  random.fill(grain, cv::RNG::NORMAL, 0, noise);
  return grey + grain;
}

// Dark lines `width` (sigma) wide at multiples of the period.
double Line(double u, double period_px, double sigma_px) {
  const double d = u - period_px * std::round(u / period_px);
  return std::exp(-0.5 * d * d / (sigma_px * sigma_px));
}
Pattern LineGrid(double along_u_px, double along_v_px, double sigma_px) {
  return [=](double u, double v) {
    return 0.7 * (1 - 0.8 * Line(u, along_u_px, sigma_px)) *
           (1 - 0.8 * Line(v, along_v_px, sigma_px));
  };
}
Pattern Checkerboard(double square_px, double blur_px) {
  return [=](double u, double v) {
    const auto wave = [&](double t) {
      return std::tanh(std::sin(CV_PI * t / square_px) * square_px / (CV_PI * blur_px));
    };
    return 0.5 + 0.3 * wave(u) * wave(v);
  };
}

void ExpectPeriod(const cv::Mat& grey, double period_px, double relative) {
  const auto found = MeasurePeriodPx(grey);
  ASSERT_TRUE(found);
  EXPECT_NEAR(found->period_px / period_px, 1, relative);
  EXPECT_GT(found->sigma_px, 0);
  EXPECT_LT(found->sigma_px, relative * period_px);
}

TEST(TargetPeriod, OfALineGridIsTheDistanceOfItsLines) {
  for (const double angle_deg : {0.0, 3.0, 17.0, 45.0, -30.0}) {
    for (const double period_px : {6.13, 13.4, 31.7}) {
      SCOPED_TRACE(::testing::Message() << angle_deg << " deg, " << period_px << " px");
      ExpectPeriod(Draw({256, 256}, angle_deg, LineGrid(period_px, period_px, 1)), period_px, 5e-5);
    }
  }
}

TEST(TargetPeriod, OfACheckerboardIsTwoSquaresAlongTheirSides) {
  for (const double angle_deg : {0.0, 3.0, 17.0, 45.0, -30.0}) {
    for (const double square_px : {5.37, 9.1, 20.3}) {
      SCOPED_TRACE(::testing::Message() << angle_deg << " deg, " << square_px << " px");
      ExpectPeriod(Draw({256, 256}, angle_deg, Checkerboard(square_px, 1)), 2 * square_px, 1e-4);
    }
  }
}

TEST(TargetPeriod, FewPeriodsAreEnoughAndFewerGiveNothing) {
  ExpectPeriod(Draw({256, 200}, 4, LineGrid(45, 45, 2)), 45, 5e-3);
  EXPECT_FALSE(MeasurePeriodPx(Draw({256, 200}, 4, LineGrid(70, 70, 2))));
}

TEST(TargetPeriod, TheShorterOneOfTwo) {
  ExpectPeriod(Draw({256, 256}, 5, LineGrid(21.3, 14.2, 1)), 14.2, 5e-5);
  ExpectPeriod(Draw({256, 256}, 5, LineGrid(14.2, 21.3, 1)), 14.2, 5e-5);
}

TEST(TargetPeriod, OfARulingAcrossItsLines) {
  const Pattern ruling = [](double u, double) { return 0.7 - 0.5 * Line(u, 11.7, 1.5); };
  for (const double angle_deg : {0.0, 12.0, 90.0})
    ExpectPeriod(Draw({256, 256}, angle_deg, ruling), 11.7, 5e-5);
}

TEST(TargetPeriod, BrokenLinesDoNotHalveIt) {
  // Dashes of half and of a third of the period, which make the second and third line stronger.
  for (const int parts : {2, 3}) {
    const double period_px = 24.6;
    const Pattern dashed = [&](double u, double v) {
      const auto dash = [&](double t) {
        return std::cos(2 * CV_PI * parts * t / period_px) > -0.6 ? 1.0 : 0.1;
      };
      return 0.7 * (1 - 0.8 * Line(u, period_px, 1) * dash(v)) *
             (1 - 0.8 * Line(v, period_px, 1) * dash(u));
    };
    ExpectPeriod(Draw({300, 300}, 3, dashed), period_px, 1e-3);
  }
}

TEST(TargetPeriod, SigmaIsThatOfRepeats) {
  // Errors divided by sigma over 30 draws of noise. Their rms is near 1 if sigma is right.
  double sum = 0;
  constexpr int kDraws = 30;
  for (int i = 0; i < kDraws; ++i) {
    const cv::Mat clean = Draw({160, 160}, 3 + 0.1 * i, LineGrid(11.3, 11.3, 1), 0);
    cv::Mat noise(clean.size(), CV_32F);
    cv::RNG random(static_cast<std::uint64_t>(100 + i));
    random.fill(noise, cv::RNG::NORMAL, 0, 0.08);
    const auto found = MeasurePeriodPx(clean + noise);
    ASSERT_TRUE(found);
    sum += std::pow((found->period_px - 11.3) / found->sigma_px, 2);
  }
  EXPECT_GT(std::sqrt(sum / kDraws), 0.4);
  EXPECT_LT(std::sqrt(sum / kDraws), 1.6);
}

TEST(TargetPeriod, LargeFramesGiveFineAndCoarsePeriods) {
  ExpectPeriod(Draw({1500, 1100}, 7, LineGrid(9.3, 9.3, 1)), 9.3, 2e-4);
  ExpectPeriod(Draw({1500, 1100}, 7, Checkerboard(95, 2)), 190, 1e-3);
}

TEST(TargetPeriod, NothingOfWhatHasNone) {
  for (const auto kind : {model::TargetKind::kDeadLeaves, model::TargetKind::kPinkNoise,
                          model::TargetKind::kWhiteNoise, model::TargetKind::kSiemensStar,
                          model::TargetKind::kKnifeEdge}) {
    for (const std::uint64_t seed : {1U, 2U, 3U}) {
      model::SweepSimulationOptions options = SweepCase("ii", 256, seed);
      options.target.kind = kind;
      options.first_depth_mm = 299;
      options.step_mm = 6;
      options.frame_count = 2;
      auto simulated = thicklens::testing::Simulate(options);
      for (int i = 0; i < 2; ++i) {
        const cv::Mat grey = LinearGrey(simulated.frame(i), simulated.sweep, 0);
        EXPECT_FALSE(MeasurePeriodPx(grey)) << model::TargetKindName(kind) << seed << i;
      }
    }
  }
  EXPECT_FALSE(MeasurePeriodPx(cv::Mat(100, 100, CV_32F, cv::Scalar(0.5))));
  EXPECT_FALSE(MeasurePeriodPx(cv::Mat(10, 10, CV_32F, cv::Scalar(0.5))));
}

TEST(TargetPeriod, WhatMayBeBothIsLeftOpen) {
  // Two crossed cosines: a grid of which defocus has left only the first lines, or a checkerboard.
  const Pattern both = [](double u, double v) {
    return 0.5 + 0.1 * std::cos(2 * CV_PI * u / 20) + 0.1 * std::cos(2 * CV_PI * v / 20);
  };
  EXPECT_FALSE(MeasurePeriodPx(Draw({256, 256}, 3, both)));
}

TEST(TargetPeriod, LinesThatWanderHaveNone) {
  const Pattern wavy = [](double u, double v) {
    return 0.7 - 0.5 * Line(u + 2.5 * std::cos(2 * CV_PI * v / 256), 11.7, 1.5);
  };
  EXPECT_FALSE(MeasurePeriodPx(Draw({256, 256}, 0, wavy)));
}

TEST(TargetPeriod, FollowsTheMagnificationOfASimulatedCheckerboard) {
  // m = f1 D/(f2 z) from the middle of the aperture, in focus and out of it. From the centre of
  // perspective the magnification is the same in the plane of focus.
  model::SweepSimulationOptions options = SweepCase("iii", 384, 1);
  options.target.kind = model::TargetKind::kCheckerboard;
  options.target.feature_size_mm = 1.5;
  options.frame_count = 4;
  options.step_mm = 40;
  auto simulated = thicklens::testing::Simulate(options);
  const model::ThickLens& lens = options.camera.lens;
  const double rear_mm = simulated.truth.image_distance_mm - lens.lens_thickness_mm;
  const double focus_mm = simulated.truth.focus_depth_mm;
  for (int i = 0; i < options.frame_count; ++i) {
    const double depth_mm = simulated.truth.frames[static_cast<std::size_t>(i)].depth_mm;
    const double magnification =
        lens.front_focal_length_mm * rear_mm / (lens.rear_focal_length_mm * focus_mm) *
        (focus_mm - simulated.centre_mm) / (depth_mm - simulated.centre_mm);
    ExpectPeriod(LinearGrey(simulated.frame(i), simulated.sweep, 0),
                 3 * magnification / options.camera.sensor.pixel_pitch_mm, 1e-4);
  }
}

// A photographed 5 mm grid with broken lines, a mark and labels. Known values: the scale is
// proportional to 1/(z + 106.2 mm) to 0.4 %; f = 3.6 mm and a pixel pitch of about 6.45 um put d1
// near 3.84 mm.
TEST(TargetPeriod, OfAPhotographedGridIsItsFiveMillimetres) {
  const std::string folder = THICKLENS_SHARED_DATA_DIR "/picam_sweep/frames/";
  if (!std::filesystem::exists(folder)) GTEST_SKIP() << folder << " is not here";
  FocusSweep sweep;
  sweep.camera.sensor.width_px = sweep.camera.sensor.height_px = 400;
  sweep.frames.resize(1);
  for (const int z_mm : {20, 10, 0, -10, -25, -40, -50}) {
    SCOPED_TRACE(z_mm);
    const cv::Mat stored =
        cv::imread(folder + "XP005_Z" + std::to_string(z_mm) + "X0Y0@1#1.jpg", cv::IMREAD_COLOR);
    ASSERT_FALSE(stored.empty());
    cv::Mat rgb;
    cv::cvtColor(stored, rgb, cv::COLOR_BGR2RGB);
    const auto found = MeasurePeriodPx(LinearGrey(rgb, sweep, 0));
    ASSERT_TRUE(found);
    const double image_distance_mm = found->period_px * 0.00645 / 5 * (z_mm + 106.2);
    EXPECT_NEAR(image_distance_mm, 3.83, 0.035);
    EXPECT_LT(found->sigma_px, 3e-3 * found->period_px);
  }
}

}  // namespace
}  // namespace thicklens::calib
