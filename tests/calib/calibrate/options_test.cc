// Every bound of the option structs of calib: each fault gives the field, its value and the
// constraint.
#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstddef>
#include <functional>
#include <limits>
#include <opencv2/core/mat.hpp>
#include <string>
#include <vector>

#include "support/special_numbers.h"
#include "support/test_cameras.h"
#include "thicklens/calib/calibrate.h"
#include "thicklens/calib/focus_sweep.h"
#include "thicklens/calib/frame_checks.h"
#include "thicklens/calib/verification.h"

namespace thicklens::calib {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::StartsWith;

using testing::kInfinity;
using testing::kNan;

std::string WhyNot(const CalibrationOptions& options) {
  std::string why;
  return options.IsValid(&why) ? "" : why;
}
std::string WhyNot(const VerificationOptions& options) {
  std::string why;
  return options.IsValid(&why) ? "" : why;
}
std::string WhyNot(const FocusSweep& sweep) {
  std::string why;
  return sweep.IsValid(&why) ? "" : why;
}

// One member of QualityCheckOptions, with values that are not valid.
struct WrongCheck {
  double QualityCheckOptions::*member;
  const char* field;
  const char* constraint;
  std::vector<double> wrong, right;
};

TEST(QualityCheckOptions, HaveABoundForEachNumber) {
  const std::vector<double> no_share = {-0.1, 1.1, kNan, kInfinity, -kInfinity};
  const std::vector<double> no_ratio = {-0.1, kNan, kInfinity, -kInfinity};
  const std::vector<double> shares = {0, 0.5, 1}, ratios = {0, 1, 1e6};
  const WrongCheck checks[] = {
      {&QualityCheckOptions::min_mean_encoded, "min_mean_encoded", "from 0 to 1", no_share, shares},
      {&QualityCheckOptions::max_saturated_fraction, "max_saturated_fraction", "from 0 to 1",
       no_share, shares},
      {&QualityCheckOptions::max_black_fraction, "max_black_fraction", "from 0 to 1", no_share,
       shares},
      {&QualityCheckOptions::min_relative_contrast, "min_relative_contrast", "finite and >= 0",
       no_ratio, ratios},
      {&QualityCheckOptions::min_gradient_to_noise, "min_gradient_to_noise", "finite and >= 0",
       no_ratio, ratios},
      {&QualityCheckOptions::min_coarse_texture, "min_coarse_texture", "finite and >= 0", no_ratio,
       ratios}};
  for (const WrongCheck& check : checks) {
    CalibrationOptions options;
    for (const double right : check.right) {
      options.checks.*check.member = right;
      EXPECT_EQ(WhyNot(options), "");
    }
    for (const double wrong : check.wrong) {
      options.checks.*check.member = wrong;
      EXPECT_THAT(WhyNot(options),
                  AllOf(StartsWith(std::string("checks.") + check.field + " is "),
                        HasSubstr(fmt::format("is {}: ", wrong)), HasSubstr(check.constraint)));
    }
  }
}

TEST(CalibrationOptions, HaveARangeOfThreads) {
  CalibrationOptions options;
  for (const int right : {0, 1, 1024}) {
    options.threads = right;
    EXPECT_EQ(WhyNot(options), "");
  }
  for (const int wrong : {-1, 1025, std::numeric_limits<int>::max()}) {
    options.threads = wrong;
    EXPECT_EQ(WhyNot(options), fmt::format("threads is {}: it must be from 0 to 1024", wrong));
  }
  EXPECT_FALSE(options.IsValid(nullptr));
}

TEST(VerificationOptions, HaveABoundForEachNumber) {
  const struct {
    double VerificationOptions::*member;
    const char* field;
    std::vector<double> wrong;
  } checks[] = {
      {&VerificationOptions::significance, "significance", {0, 1, -1, kNan, kInfinity}},
      {&VerificationOptions::needed_blur_px, "needed_blur_px", {0, -1, kNan, kInfinity}},
      {&VerificationOptions::needed_blur_ratio, "needed_blur_ratio", {0, -1, kNan, kInfinity}}};
  EXPECT_EQ(WhyNot(VerificationOptions()), "");
  for (const auto& check : checks) {
    for (const double wrong : check.wrong) {
      VerificationOptions options;
      options.*check.member = wrong;
      EXPECT_THAT(WhyNot(options), StartsWith(fmt::format("{} is {}: ", check.field, wrong)));
    }
  }
}

TEST(FocusSweep, HasABoundForEachNumber) {
  FocusSweep valid;
  valid.camera = testing::TestCameraFocusedAt(500, "bench", testing::WideLens(),
                                              testing::CentredSensor(400, 300, 0.005));
  valid.read_frame = [](std::size_t) { return cv::Mat(); };
  ASSERT_EQ(WhyNot(valid), "");
  const struct {
    const char* field;
    std::function<void(FocusSweep*, double)> set;
    std::vector<double> wrong;
  } checks[] = {{"reading_sigma_mm",
                 [](auto* sweep, double x) { sweep->reading_sigma_mm = x; },
                 {-1, kNan, kInfinity}},
                {"offset_mm",
                 [](auto* sweep, double x) {
                   sweep->offset_mm = model::Estimate{x, 1};
                 },
                 {kNan, kInfinity, -kInfinity}},
                {"offset_mm",
                 [](auto* sweep, double x) {
                   sweep->offset_mm = model::Estimate{1, x};
                 },
                 {-1, kNan, kInfinity}},
                {"floor.given_px",
                 [](auto* sweep, double x) {
                   sweep->floor.given_px = model::Estimate{x, 0};
                 },
                 {-1, kNan, kInfinity}},
                {"floor.given_px",
                 [](auto* sweep, double x) {
                   sweep->floor.given_px = model::Estimate{1, x};
                 },
                 {-1, kNan, kInfinity}},
                {"floor.from_px",
                 [](auto* sweep, double x) {
                   sweep->floor.from_px = x;
                   sweep->floor.to_px = 0.8;
                 },
                 {-1, 0.9, kNan, kInfinity}},
                {"floor.from_px",
                 [](auto* sweep, double x) {
                   sweep->floor.from_px = 0.2;
                   sweep->floor.to_px = x;
                 },
                 {-1, 0.1, kNan, kInfinity}},
                {"floor.from_px", [](auto* sweep, double x) { sweep->floor.from_px = x; }, {0.2}},
                {"target_period_mm",
                 [](auto* sweep, double x) { sweep->target_period_mm = x; },
                 {0, -5, kNan, kInfinity}},
                {"a.png: reading_mm",
                 [](auto* sweep, double x) {
                   sweep->frames.resize(1);
                   sweep->frames[0].image = "a.png";
                   sweep->frames[0].reading_mm = x;
                 },
                 {kNan, kInfinity}}};
  for (const auto& check : checks) {
    for (const double wrong : check.wrong) {
      FocusSweep sweep = valid;
      check.set(&sweep, wrong);
      EXPECT_THAT(WhyNot(sweep), StartsWith(check.field)) << wrong;
    }
  }
}

}  // namespace
}  // namespace thicklens::calib
