#include "calib/uncertainty/relief_parts.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <functional>
#include <random>

namespace thicklens::calib {
namespace {

constexpr int kColumns = 10, kRows = 8;
constexpr double kStepMm = 1, kSigmaMm = 0.1;

// Zones whose readings are a function of the place, -1 to 1, with noise.
ReliefFinding Zones(const std::function<double(double, double)>& reading_mm, unsigned seed = 1) {
  ReliefFinding finding;
  finding.columns = kColumns;
  finding.rows = kRows;
  std::mt19937 engine(seed);
  std::normal_distribution<double> noise(0, kSigmaMm);
  for (int row = 0; row < kRows; ++row) {
    for (int column = 0; column < kColumns; ++column) {
      const double x = 2.0 * column / (kColumns - 1) - 1, y = 2.0 * row / (kRows - 1) - 1;
      finding.sharpest_mm.push_back(model::Estimate{reading_mm(x, y) + noise(engine), kSigmaMm});
    }
  }
  return finding;
}

ReliefFinding Divided(const std::function<double(double, double)>& reading_mm, unsigned seed = 1) {
  ReliefFinding finding = Zones(reading_mm, seed);
  DivideByDepth(kStepMm, 1, &finding);
  return finding;
}

TEST(ReliefParts, ABlockOnAPlateIsTwoDepths) {
  const ReliefFinding found =
      Divided([](double x, double y) { return x > 0.2 && y < 0.5 ? 303.0 : 300.0; });
  ASSERT_TRUE(found.measured);
  EXPECT_TRUE(found.is_relief);
  ASSERT_EQ(found.parts.size(), 2U);
  EXPECT_NEAR(found.parts[1].nearer_mm.value, 3, 0.1);
  EXPECT_LT(found.parts[1].nearer_mm.sigma, 0.05);
  EXPECT_NEAR(found.parts[0].share + found.parts[1].share, 1, 0.02);
  int part = -1;
  const cv::Rect largest = LargestRectangle(found, &part);
  EXPECT_EQ(part, 0);
  EXPECT_EQ(largest.width, 6);
  EXPECT_EQ(largest.height, kRows);
  EXPECT_THAT(PartsInWords(found), ::testing::HasSubstr("mm nearer"));
}

TEST(ReliefParts, SmoothFieldsAreNoRelief) {
  for (unsigned seed = 1; seed <= 40; ++seed) {
    EXPECT_FALSE(Divided([](double, double) { return 300.0; }, seed).is_relief) << "flat";
    EXPECT_FALSE(Divided([](double x, double) { return 300 + 4 * x; }, seed).is_relief) << "tilted";
    EXPECT_FALSE(
        Divided([](double x, double y) { return 300 - 3 * (x * x + y * y); }, seed).is_relief)
        << "curved";
    EXPECT_FALSE(Divided(
                     [](double x, double y) {
                       const double r2 = x * x + y * y;
                       return 300 + 2 * x - 2 * r2 - 0.6 * r2 * r2;
                     },
                     seed)
                     .is_relief)
        << "curved and tilted, with a term of the fourth order";
  }
}

TEST(ReliefParts, AFewWrongZonesAreNoRelief) {
  ReliefFinding finding = Zones([](double, double) { return 300.0; });
  for (const std::size_t zone : {3U, 27U, 55U, 71U}) finding.sharpest_mm[zone]->value += 5;
  DivideByDepth(kStepMm, 1, &finding);
  EXPECT_FALSE(finding.is_relief);
}

TEST(ReliefParts, TooFewZonesAreNotJudged) {
  ReliefFinding finding = Zones([](double, double) { return 300.0; });
  for (std::size_t i = 8; i < finding.sharpest_mm.size(); ++i) finding.sharpest_mm[i].reset();
  DivideByDepth(kStepMm, 1, &finding);
  EXPECT_FALSE(finding.measured);
  EXPECT_THAT(finding.message, ::testing::HasSubstr("8 zones"));
}

TEST(ReliefParts, TheMeasuredPartBecomesTheFirst) {
  ReliefFinding found = Divided([](double x, double) { return x > -0.4 ? 300.0 : 302.0; });
  ASSERT_EQ(found.parts.size(), 2U);
  const double before = found.parts[1].nearer_mm.value;
  MakeFirst(1, &found);
  EXPECT_EQ(found.parts[0].nearer_mm.value, 0);
  EXPECT_NEAR(found.parts[1].nearer_mm.value, -before, 1e-12);
  EXPECT_EQ(found.part_of_zone[0], 0);
  EXPECT_EQ(found.part_of_zone[kColumns - 1], 1);
}

TEST(ReliefParts, TheMapHasALetterForEachPart) {
  TargetFinding target;
  target.relief.columns = 3;
  target.relief.rows = 2;
  target.relief.part_of_zone = {0, 0, 1, -1, 0, 1};
  EXPECT_EQ(target.ReliefMap(), "aab\n.ab\n");
}

}  // namespace
}  // namespace thicklens::calib
