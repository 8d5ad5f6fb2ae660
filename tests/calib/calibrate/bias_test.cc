// The errors of a calibration have the mean 0, or a bias that is known and small.
#include <gtest/gtest.h>

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "tests/calib/simulated_sweep.h"
#include "thicklens/base/parallel.h"
#include "thicklens/calib/calibrate.h"

namespace thicklens::calib {
namespace {

using namespace thicklens::testing;

struct Errors {
  bool found = false;
  double image_distance_mm = 0, blur_ratio = 0;
};

// The mean errors over all sweeps of a case, where they are known to differ from 0.
struct Bias {
  double image_distance_mm = 0, blur_ratio = 0;
};

// Expects that the mean error differs from the known bias by at most two of its own standard
// errors.
void ExpectBias(const std::string& name, const std::vector<double>& errors, double bias) {
  const auto count = static_cast<double>(errors.size());
  double mean = 0, variance = 0;
  for (const double error : errors) mean += error / count;
  for (const double error : errors) variance += std::pow(error - mean, 2) / (count - 1);
  const double standard_error = std::sqrt(variance / count);
  EXPECT_GT(standard_error, 0) << name;
  EXPECT_LT(std::abs(mean - bias), 2 * standard_error)
      << name << ": mean " << mean << ", known bias " << bias;
  ::testing::Test::RecordProperty(name + "_mean", std::to_string(1e6 * mean) + "e-6");
  ::testing::Test::RecordProperty(name + "_standard_error",
                                  std::to_string(1e6 * standard_error) + "e-6");
}

// Calibrates a hundred sweeps of leaves, with floors drawn from their stated error. Even at the
// known bias, one of the two results is outside its two standard errors for one in ten choices of
// seeds.
void ExpectBiasOfSweeps(const std::string& case_name, const Bias& bias) {
  constexpr int kSweeps = 100, kSizePx = 96;
  CalibrationOptions how;
  how.map_field = false;
  how.threads = 1;
  std::vector<Errors> errors(kSweeps);
  ParallelFor(kSweeps, 0, [&](int i) {
    const auto seed = static_cast<std::uint64_t>(20000 + i);
    SimulatedSweep s = Simulate(SweepCase(case_name, kSizePx, seed));
    GiveDrawnFloor(&s, seed);
    const Calibration c = Calibrate(s.sweep, how);
    if (!c.summary.image_distance_mm || !c.summary.blur_ratio) return;
    errors[static_cast<std::size_t>(i)] = {
        true, c.summary.image_distance_mm->value - s.truth.image_distance_mm,
        c.summary.blur_ratio->value - s.truth.blur_ratio};
  });
  std::vector<double> image_distance_mm, blur_ratio;
  for (const Errors& error : errors) {
    if (!error.found) continue;
    image_distance_mm.push_back(error.image_distance_mm);
    blur_ratio.push_back(error.blur_ratio);
  }
  ASSERT_GE(image_distance_mm.size(), 98U);
  ExpectBias("image_distance_mm", image_distance_mm, bias.image_distance_mm);
  ExpectBias("blur_ratio", blur_ratio, bias.blur_ratio);
}

TEST(BiasSlow, MacroLens) { ExpectBiasOfSweeps("ii", {}); }

// The calibration is biased here: d1 comes out too small by 0.01 um (docs/calibration.md), which is
// 0.12 of its standard deviation, and the blur ratio by 0.05 %, which is 0.3 of its own. That of
// the blur ratio was measured on 450 sweeps, as -0.00023 with a standard error of 0.00004.
TEST(BiasSlow, WideThickLens) { ExpectBiasOfSweeps("iii", {-1e-5, -2.3e-4}); }

}  // namespace
}  // namespace thicklens::calib
