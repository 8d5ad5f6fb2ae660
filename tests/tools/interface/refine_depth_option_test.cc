// The option that repairs depth maps, from the call to the problem that the solver gets.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstddef>
#include <string>
#include <utility>
#include <vector>

#include "thicklens/estimate.h"

namespace thicklens {
namespace {

constexpr int kRefinedPx = 96;
constexpr double kRefinedRadiusPx = 28;

// How far the pixel is inside of a disc.
double InsideDiscPx(int x, int y) { return kRefinedRadiusPx - std::hypot(x - 46.0, y - 50.0); }

Image PhotoOfDisc() {
  std::vector<float> light;
  for (int y = 0; y < kRefinedPx; ++y) {
    for (int x = 0; x < kRefinedPx; ++x) {
      const auto texture = static_cast<float>(0.02 * std::sin(0.9 * x) * std::cos(0.7 * y));
      const bool is_disc = InsideDiscPx(x, y) > 0;
      for (const float part : {is_disc ? 0.4F : 0.1F, 0.2F, is_disc ? 0.1F : 0.3F})
        light.push_back(part + texture);
    }
  }
  return Image::FromLight(kRefinedPx, kRefinedPx, ChannelOrder::kRgb, std::move(light));
}

// A disc of disparity 1 before a wall of -1; the step is a ramp of that width.
DepthMap MapOfDisc(double ramp_px) {
  DepthMap map;
  map.width_px = map.height_px = kRefinedPx;
  map.meaning.kind = DepthKind::kDisparity;
  for (int y = 0; y < kRefinedPx; ++y) {
    for (int x = 0; x < kRefinedPx; ++x) {
      const double share = InsideDiscPx(x, y) / ramp_px + 0.5;
      map.values.push_back(static_cast<float>(2 * std::fmin(1, std::fmax(0, share)) - 1));
    }
  }
  return map;
}

Problem PreparedWith(DepthRefining refining, const DepthMap& map, EstimateDiagnostics* found) {
  EstimateOptions options;
  options.views = ViewCounts{3, 3};
  options.refine_depth = refining;
  return PrepareProblem(PhotoOfDisc(), map, std::nullopt, options, found);
}

TEST(RefineDepthOption, ARampBecomesAStepUnlessItIsOff) {
  const DepthMap map = MapOfDisc(6);
  EstimateDiagnostics off, refined;
  EXPECT_EQ(PreparedWith(DepthRefining::kOff, map, &off).disparity(), map.values);
  EXPECT_FALSE(off.depth_refinement);
  const std::vector<float> values = PreparedWith(DepthRefining::kAuto, map, &refined).disparity();
  ASSERT_TRUE(refined.depth_refinement);
  EXPECT_TRUE(refined.depth_refinement->applied);
  EXPECT_THAT(refined.depth_refinement->message, ::testing::HasSubstr("made steps"));
  int between = 0;
  for (const float value : values) between += std::abs(value) < 0.9F ? 1 : 0;
  EXPECT_LT(between, 20);
}

TEST(RefineDepthOption, AStepStays) {
  for (const DepthRefining refining : {DepthRefining::kAuto, DepthRefining::kOn}) {
    const DepthMap map = MapOfDisc(1e-3);
    EstimateDiagnostics found;
    EXPECT_EQ(PreparedWith(refining, map, &found).disparity(), map.values);
    ASSERT_TRUE(found.depth_refinement);
    EXPECT_FALSE(found.depth_refinement->applied) << found.depth_refinement->message;
  }
}

TEST(RefineDepthOption, NoEnumeratorIsRefused) {
  EstimateOptions options;
  options.refine_depth = static_cast<DepthRefining>(7);
  std::string why;
  EXPECT_FALSE(options.IsValid(&why));
  EXPECT_THAT(why, ::testing::HasSubstr("refine_depth"));
}

}  // namespace
}  // namespace thicklens
