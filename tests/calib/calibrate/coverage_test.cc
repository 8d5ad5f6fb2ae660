// The errors that a calibration states agree with the errors that it makes.
#include <gtest/gtest.h>

#include <cmath>
#include <string>
#include <vector>

#include "support/sample_statistics.h"
#include "tests/calib/damaged_sweep.h"
#include "thicklens/calib/calibrate.h"

namespace thicklens::calib {
namespace {

using namespace thicklens::testing;

TEST(BinomialTestP, IsWhatCanBeCountedByHand) {
  EXPECT_NEAR(BinomialTestP(0, 10, 0.5), 2.0 / 1024, 1e-12);
  EXPECT_NEAR(BinomialTestP(2, 10, 0.5), 2 * (1 + 10 + 45) / 1024.0, 1e-12);
  EXPECT_NEAR(BinomialTestP(5, 10, 0.5), 1, 1e-12);
  // The most likely outcome has the probability 0.95^3; the two less likely ones have 3 * 0.95 *
  // 0.05^2 and 0.05^3.
  EXPECT_NEAR(BinomialTestP(1, 3, 0.95), 3 * 0.95 * 0.0025 + 0.000125, 1e-12);
}

// The normalised error of each result of each sweep.
struct ZScores {
  std::vector<double> focus_depth, image_distance, blur_ratio;
};

void ExpectHonest(const std::string& name, const std::vector<double>& z) {
  SCOPED_TRACE(name);
  const double rms = RootMeanSquare(z);
  EXPECT_GT(rms, 0.75);
  EXPECT_LT(rms, 1.35);
  int inside = 0;
  for (const double value : z) inside += std::abs(value) <= 1.96 ? 1 : 0;
  EXPECT_GT(BinomialTestP(inside, static_cast<int>(z.size()), 0.95), 0.001)
      << inside << " of " << z.size() << " within 1.96 sigma";
}

// Calibrates sweeps of three textures, with floors drawn from their stated error.
void ExpectHonestErrors(const std::string& case_name, int size_px, int sweeps_per_texture,
                        int most_refused) {
  CalibrationOptions how;
  how.map_field = false;
  ZScores z;
  int refused = 0;
  std::uint64_t seed = 5000;
  for (const model::TargetKind kind :
       {model::TargetKind::kDeadLeaves, model::TargetKind::kWhiteNoise,
        model::TargetKind::kPinkNoise}) {
    for (int i = 0; i < sweeps_per_texture; ++i, ++seed) {
      model::SweepSimulationOptions options = SweepCase(case_name, size_px, seed);
      options.target.kind = kind;
      SimulatedSweep s = Simulate(options);
      GiveDrawnFloor(&s, seed);
      const Calibration c = Calibrate(s.sweep, how);
      if (!c.summary.focus_depth_mm || !c.summary.image_distance_mm || !c.summary.blur_ratio) {
        ++refused;
        continue;
      }
      const auto score = [](const Result& r, double truth) { return (r.value - truth) / r.sigma; };
      z.focus_depth.push_back(score(*c.summary.focus_depth_mm, s.truth.focus_depth_mm));
      z.image_distance.push_back(score(*c.summary.image_distance_mm, s.truth.image_distance_mm));
      z.blur_ratio.push_back(score(*c.summary.blur_ratio, s.truth.blur_ratio));
    }
  }
  EXPECT_LE(refused, most_refused);
  ASSERT_GT(z.focus_depth.size(), 1U);
  ExpectHonest("focus_depth_mm", z.focus_depth);
  ExpectHonest("image_distance_mm", z.image_distance);
  ExpectHonest("blur_ratio", z.blur_ratio);
}

TEST(CoverageSlow, CaseI) { ExpectHonestErrors("i", 128, 14, 0); }
TEST(CoverageSlow, CaseII) { ExpectHonestErrors("ii", 128, 14, 0); }
TEST(CoverageSlow, CaseIII) { ExpectHonestErrors("iii", 128, 14, 0); }
TEST(CoverageSlow, CaseIV) { ExpectHonestErrors("iv", 128, 14, 0); }
// In a sweep of seven frames with white noise, too few frames may show the same texture, so one
// sweep in a hundred is refused.
TEST(CoverageSlow, CaseV) { ExpectHonestErrors("v", 192, 40, 2); }

// Fewer frames of the same sweep give the same results with larger errors. The difference is
// smaller than either error, because the frames of the part are in the whole sweep, too.
TEST(CoverageSlow, ThinningMovesTheFocusByLessThanTheErrors) {
  for (const std::string name : {"i", "iii"}) {
    SimulatedSweep whole = SweepWithFloor(name, 192, 7);
    const Calibration all = Calibrate(whole.sweep, {});
    ASSERT_TRUE(all.summary.focus_depth_mm) << name << ": " << all.summary.reason;
    for (const std::size_t every : {2U, 3U, 6U}) {
      SCOPED_TRACE(name + ", one frame of " + std::to_string(every));
      const Calibration part = Calibrate(Thinned(whole, every).sweep, {});
      ASSERT_TRUE(part.summary.focus_depth_mm) << part.summary.reason;
      const double moved_mm =
          std::abs(part.summary.focus_depth_mm->value - all.summary.focus_depth_mm->value);
      EXPECT_LT(moved_mm, 2 * std::hypot(part.summary.focus_depth_mm->sigma,
                                         all.summary.focus_depth_mm->sigma));
      EXPECT_GT(part.summary.focus_depth_mm->sigma, all.summary.focus_depth_mm->sigma);
    }
  }
}

}  // namespace
}  // namespace thicklens::calib
