// Scale and offset of a depth map that the blur of the photograph corrects, or finds.
#include "tools/interface/depth_values_choice.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include "support/error_message.h"
#include "support/stepped_scene.h"
#include "thicklens/base/error.h"
#include "thicklens/estimate.h"

namespace thicklens {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using thicklens::testing::ErrorOf;
using thicklens::testing::SteppedScene;

constexpr int kChoiceSidePx = 320;

SteppedScene SceneOf(unsigned seed, const Eigen::ArrayXXd& weights = SteppedScene::UniformViews()) {
  return SteppedScene(seed, kChoiceSidePx, {-2, 1, 2, -1, 0}, 1, weights);
}

Image PhotoOf(const SteppedScene& scene) {
  std::vector<std::uint16_t> levels;
  for (const float value : scene.input().image.values)
    levels.push_back(static_cast<std::uint16_t>(std::lround(255 * value)));
  return Image::FromEncoded(kChoiceSidePx, kChoiceSidePx, ChannelOrder::kGrey, 8, std::move(levels),
                            TransferCurve::Linear());
}

// The map whose disparities are scale * value + offset.
DepthMap MapOf(const SteppedScene& scene, double scale, double offset_px) {
  DepthMap map;
  map.width_px = map.height_px = kChoiceSidePx;
  map.meaning.kind = DepthKind::kDisparity;
  map.source = "map";
  for (const float value : scene.input().disparity.disparity)
    map.values.push_back(static_cast<float>((static_cast<double>(value) - offset_px) / scale));
  return map;
}

EstimateOptions RefinedBy(DepthRefining refining = DepthRefining::kAuto) {
  EstimateOptions options;
  options.views = ViewCounts{SteppedScene::kViews, SteppedScene::kViews};
  options.aperture.shape = model::ApertureShape::kUniform;
  options.refine_depth = refining;
  return options;
}

RunControl OnOneThread() {
  RunControl control;
  control.threads = 1;
  control.option_name = [](const std::string& field) { return "<" + field + ">"; };
  return control;
}

double RmsError(const std::vector<float>& found, const SteppedScene& scene) {
  double squares = 0;
  for (std::size_t i = 0; i < found.size(); ++i) {
    squares += std::pow(
        static_cast<double>(found[i]) - static_cast<double>(scene.input().disparity.disparity[i]),
        2);
  }
  return std::sqrt(squares / static_cast<double>(found.size()));
}

TEST(DepthValuesChoice, AWrongScaleIsCorrected) {
  const SteppedScene scene = SceneOf(1);
  const DepthMap map = MapOf(scene, 1 / 1.12, 0);
  EstimateDiagnostics found;
  const Problem problem =
      PrepareProblem(PhotoOf(scene), map, {}, RefinedBy(), &found, OnOneThread());
  ASSERT_TRUE(found.depth_refinement);
  EXPECT_TRUE(found.are_depth_values_wrong) << found.depth_values->message;
  EXPECT_TRUE(found.depth_refinement->applied);
  EXPECT_NEAR(found.depth_refinement->scale, 1 / 1.12, 3 * found.depth_refinement->scale_sigma);
  EXPECT_THAT(found.depth_refinement->message, HasSubstr("scale 0."));
  EXPECT_LT(RmsError(problem.disparity(), scene), 0.4 * RmsError(map.values, scene));
}

TEST(DepthValuesChoice, AWrongScaleIsReportedIfNothingIsRefined) {
  const SteppedScene scene = SceneOf(1);
  const DepthMap map = MapOf(scene, 1 / 1.12, 0);
  const LightFieldEstimate estimate =
      EstimateLightField(PhotoOf(scene), map, {}, RefinedBy(DepthRefining::kOff), OnOneThread());
  EXPECT_EQ(estimate.problem->disparity(), map.values);
  EXPECT_THAT(estimate.summary.partial_reason,
              AllOf(HasSubstr("map: the blur of the photograph agrees with other disparities"),
                    HasSubstr("<depth.meaning.disparity_scale> 0."),
                    HasSubstr("<refine_depth> auto"), HasSubstr("the aperture is not")));
}

TEST(DepthValuesChoice, ARightMapStays) {
  for (unsigned seed = 1; seed <= 3; ++seed) {
    SCOPED_TRACE(seed);
    const SteppedScene scene = SceneOf(seed);
    const DepthMap map = MapOf(scene, 1, 0);
    EstimateDiagnostics found;
    const Problem problem =
        PrepareProblem(PhotoOf(scene), map, {}, RefinedBy(), &found, OnOneThread());
    EXPECT_EQ(problem.disparity(), map.values) << found.depth_refinement->message;
    EXPECT_FALSE(found.are_depth_values_wrong);
  }
}

// Their values are not what is wrong, or a smaller aperture explains them as well.
TEST(DepthValuesChoice, AReversedMapAndASmallApertureAreLeftToTheirOwnChecks) {
  const SteppedScene scene = SceneOf(3);
  DepthMap reversed = MapOf(scene, 1, 0);
  model::FlipDepth(model::DepthFlip::kRows, kChoiceSidePx, &reversed.values);
  EstimateDiagnostics found;
  const Problem kept =
      PrepareProblem(PhotoOf(scene), reversed, {}, RefinedBy(), &found, OnOneThread());
  EXPECT_FALSE(found.are_depth_values_wrong);
  EXPECT_EQ(found.depth_refinement->scale, 1);
  Eigen::ArrayXXd inner = SteppedScene::UniformViews();
  inner.row(0).setZero();
  inner.row(4).setZero();
  inner.col(0).setZero();
  inner.col(4).setZero();
  inner /= inner.sum();
  const SteppedScene small = SceneOf(3, inner);
  const DepthMap map = MapOf(small, 1, 0);
  EXPECT_EQ(PrepareProblem(PhotoOf(small), map, {}, RefinedBy(), &found, OnOneThread()).disparity(),
            map.values)
      << found.depth_refinement->message;
  EXPECT_FALSE(found.are_depth_values_wrong);
}

TEST(DepthValuesChoice, TheValuesOfARelativeMapAreFound) {
  const SteppedScene scene = SceneOf(2);
  // The numbers may be larger than the image, as those of a map of 16 bits.
  for (const double per_px : {60.0, -60.0, 6000.0}) {
    const double sign = per_px < 0 ? -1 : 1;
    DepthMap map = MapOf(scene, 1 / per_px, -1.8);
    for (float& value : map.values) value = std::round(value);
    map.meaning.is_relative = true;
    map.meaning.disparity_scale = sign;
    EstimateDiagnostics found;
    const Problem problem =
        PrepareProblem(PhotoOf(scene), map, {}, RefinedBy(), &found, OnOneThread());
    ASSERT_TRUE(found.depth_values);
    EXPECT_NEAR(found.depth_values->best.scale, 1 / std::abs(per_px),
                3 * found.depth_values->scale_sigma);
    EXPECT_LT(RmsError(problem.disparity(), scene), 0.06);
    std::string said;
    for (const Notice& notice : found.notices) said += notice.text + "\n";
    EXPECT_THAT(said, AllOf(HasSubstr("px per view step = ("),
                            HasSubstr("<depth.meaning.disparity_offset_px> -1.")));
  }
}

TEST(DepthValuesChoice, ARelativeMapOfASharpPhotographIsRefusedWithWhatToState) {
  const SteppedScene sharp = SceneOf(2, SteppedScene::Pinhole());
  DepthMap map = MapOf(sharp, 1 / 60.0, -1.8);
  map.meaning.is_relative = true;
  const auto refused = [&](const EstimateOptions& options) {
    return ErrorOf(
        [&] { PrepareProblem(PhotoOf(sharp), map, {}, options, nullptr, OnOneThread()); });
  };
  EXPECT_THAT(refused(RefinedBy()), AllOf(HasSubstr("map: its scale and its offset are not known"),
                                          HasSubstr("<depth.meaning.disparity_scale> and "
                                                    "<depth.meaning.disparity_offset_px>")));
  EstimateOptions stated = RefinedBy();
  SceneSolver solver;
  solver.photo = PhotoKind::kSharp;
  stated.solver = solver;
  EXPECT_THAT(refused(stated), HasSubstr("a sharp photograph (<solver.photo>)"));
  map.values.assign(map.values.size(), 7);
  EXPECT_THAT(refused(RefinedBy()), HasSubstr("all of its values are equal"));
}

TEST(DepthValuesChoice, ARelativeMapStatesNothingButWhichValuesAreNear) {
  DepthMeaning meaning;
  meaning.kind = DepthKind::kDisparity;
  meaning.is_relative = true;
  EXPECT_TRUE(meaning.IsValid(nullptr));
  meaning.disparity_scale = -1;
  EXPECT_TRUE(meaning.IsValid(nullptr));
  std::string why;
  meaning.disparity_scale = 2;
  EXPECT_FALSE(meaning.IsValid(&why));
  EXPECT_THAT(why, HasSubstr("disparity_scale"));
  meaning.disparity_scale = 1;
  meaning.disparity_offset_px = 1;
  EXPECT_FALSE(meaning.IsValid(&why));
  EXPECT_THAT(why, HasSubstr("disparity_offset_px"));
  meaning = {DepthKind::kInverse};
  meaning.is_relative = true;
  EXPECT_FALSE(meaning.IsValid(&why));
  EXPECT_THAT(why, HasSubstr("is_relative"));
}

}  // namespace
}  // namespace thicklens
