// The answers of the public interface to a depth that contradicts its photograph, and to depths
// that mean nothing.
#include "tools/interface/contradiction.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include "support/error_message.h"
#include "support/layered_scene.h"
#include "thicklens/base/error.h"
#include "thicklens/estimate.h"
#include "tools/interface/run_scope.h"

namespace thicklens {
namespace {

using ::testing::AllOf;
using ::testing::AnyOf;
using ::testing::Contains;
using ::testing::Each;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;
using thicklens::testing::ErrorOf;
using thicklens::testing::LayeredScene;

constexpr int kSidePx = 128;

struct Files {
  Image photo;
  DepthMap map;
};

Files FilesOf(const LayeredScene& scene) {
  std::vector<std::uint16_t> levels;
  for (const float value : scene.input().image.values)
    levels.push_back(static_cast<std::uint16_t>(std::lround(255 * value)));
  Files files{Image::FromEncoded(kSidePx, kSidePx, ChannelOrder::kGrey, 8, std::move(levels),
                                 TransferCurve::Linear()),
              {}};
  files.map.width_px = files.map.height_px = kSidePx;
  files.map.values = scene.input().disparity.disparity;
  files.map.meaning.kind = DepthKind::kDisparity;
  files.map.source = "map";
  return files;
}

EstimateOptions FiveViews() {
  EstimateOptions options;
  options.views = ViewCounts{LayeredScene::kViews, LayeredScene::kViews};
  options.aperture.shape = model::ApertureShape::kUniform;
  return options;
}

RunControl OneThread() {
  RunControl control;
  control.threads = 1;
  control.option_name = [](const std::string& field) { return "<" + field + ">"; };
  return control;
}

TEST(ContradictedDepth, MakesTheResultPartialAndNamesTheRemedy) {
  const LayeredScene scene(3, kSidePx, kSidePx);
  Files right = FilesOf(scene);
  const LightFieldEstimate of_right =
      EstimateLightField(right.photo, right.map, {}, FiveViews(), OneThread());
  EXPECT_THAT(of_right.summary.partial_reason, IsEmpty());
  ASSERT_TRUE(of_right.diagnostics.contradiction);
  EXPECT_FALSE(of_right.diagnostics.contradiction->is_contradicted);

  Files wrong = FilesOf(scene);
  model::FlipDepth(model::DepthFlip::kRows, kSidePx, &wrong.map.values);
  const LightFieldEstimate of_wrong =
      EstimateLightField(wrong.photo, wrong.map, {}, FiveViews(), OneThread());
  EXPECT_THAT(of_wrong.summary.partial_reason,
              AllOf(HasSubstr("map: the photograph contradicts the depth"),
                    HasSubstr("upside down"), HasSubstr("<depth.flip> rows")));
  EXPECT_THAT(of_wrong.summary.warnings, Contains(of_wrong.summary.partial_reason));
  // No other reason stands beside the right one.
  EXPECT_THAT(of_wrong.summary.warnings,
              Each(Not(AnyOf(HasSubstr("sharper than"), HasSubstr("sharp at all depths"),
                             HasSubstr("smaller aperture")))));

  EstimateOptions strict = FiveViews();
  strict.strict = true;
  EXPECT_THAT(ErrorOf([&] { EstimateLightField(wrong.photo, wrong.map, {}, strict, OneThread()); }),
              HasSubstr("upside down"));
  EXPECT_EQ(
      EstimateLightField(right.photo, right.map, {}, strict, OneThread()).summary.partial_reason,
      "");
}

TEST(ContradictedDepth, AReversedMapThatWasReversedWhenItWasReadIsToldSo) {
  const LayeredScene scene(3, kSidePx, kSidePx);
  Files files = FilesOf(scene);
  model::FlipDepth(model::DepthFlip::kColumns, kSidePx, &files.map.values);
  files.map.flip = model::DepthFlip::kColumns;
  EXPECT_THAT(EstimateLightField(files.photo, files.map, {}, FiveViews(), OneThread())
                  .summary.partial_reason,
              HasSubstr("without <depth.flip> the program"));
}

TEST(ContradictedDepth, EachCauseHasItsRemedy) {
  const RunControl control = OneThread();
  const RunScope run(control);
  const auto text = [&run](estimator::DepthCause cause, double scale, DepthKind kind) {
    estimator::DepthContradiction found;
    found.is_contradicted = true;
    estimator::DepthCauseTrial trial;
    trial.cause = cause;
    trial.scale = scale;
    found.causes = {trial};
    DepthOrigin depth;
    depth.name = "map.png";
    depth.meaning.kind = kind;
    return ContradictionText(depth, found, run);
  };
  using estimator::DepthCause;
  EXPECT_THAT(text(DepthCause::kShift, 1, DepthKind::kZ),
              AllOf(HasSubstr("<depth_fit.part>"), HasSubstr("<depth_fit.camera>")));
  EXPECT_THAT(text(DepthCause::kOffset, 1, DepthKind::kZ),
              AllOf(HasSubstr("focus distance"), HasSubstr("<lens_position>")));
  EXPECT_THAT(text(DepthCause::kScaleOffset, -1, DepthKind::kZ),
              AllOf(HasSubstr("near and far are exchanged"), HasSubstr("<lens_position>")));
  EXPECT_THAT(text(DepthCause::kScaleOffset, -1, DepthKind::kDisparity),
              AllOf(HasSubstr("near and far are exchanged"),
                    HasSubstr("<depth.meaning.disparity_scale> -1")));
  EXPECT_THAT(text(DepthCause::kScaleOffset, 1, DepthKind::kDisparity),
              Not(HasSubstr("exchanged")));
  EXPECT_THAT(text(DepthCause::kOtherImage, 1, DepthKind::kZ),
              HasSubstr("map.png and the photograph"));
}

TEST(DepthPlausibility, WholeNumbersOfPixelsAreAccepted) {
  Files files = FilesOf(LayeredScene(3, kSidePx, kSidePx));
  files.map.is_integer = true;
  for (std::size_t i = 0; i < files.map.values.size(); ++i)
    files.map.values[i] = static_cast<float>(4 + i % 2);
  EstimateOptions options = FiveViews();
  options.views = ViewCounts{3, 3};
  // 2 steps of 5 px are less than an eighth of 128 px.
  EXPECT_NO_THROW(PrepareProblem(files.photo, files.map, {}, options, nullptr, OneThread()));
}

TEST(DepthPlausibility, GreyLevelsAreNoPixelsAndAScaleIsProposed) {
  Files files = FilesOf(LayeredScene(3, kSidePx, kSidePx));
  files.map.is_integer = true;
  for (float& value : files.map.values) value = std::round(20 * (value + 2));
  const std::string refused =
      ErrorOf([&] { EstimateLightField(files.photo, files.map, {}, FiveViews(), OneThread()); });
  EXPECT_THAT(refused, AllOf(HasSubstr("px per view step = scale * value + offset"),
                             HasSubstr("<depth.meaning.disparity_scale> 0."),
                             HasSubstr("<depth.meaning.disparity_offset_px> -")));
  // The proposal is accepted.
  files.map.meaning.disparity_scale = 0.05;
  files.map.meaning.disparity_offset_px = -2;
  EXPECT_NO_THROW(PrepareProblem(files.photo, files.map, {}, FiveViews(), nullptr, OneThread()));
}

TEST(DepthPlausibility, ViewsThatLieAPartOfAnImageApartAreRefused) {
  Files files = FilesOf(LayeredScene(3, kSidePx, kSidePx));
  for (float& value : files.map.values) value = 40 + value;
  EXPECT_THAT(ErrorOf([&] {
                PrepareProblem(files.photo, files.map, {}, FiveViews(), nullptr, OneThread());
              }),
              HasSubstr("a large part of the 128 px of the image"));
}

TEST(DepthPlausibility, RangeAndMissingParallaxAreReported) {
  Files files = FilesOf(LayeredScene(3, kSidePx, kSidePx));
  EstimateDiagnostics found;
  PrepareProblem(files.photo, files.map, {}, FiveViews(), &found, OneThread());
  const auto texts = [&found] {
    std::vector<std::string> all;
    for (const Notice& notice : found.notices) all.push_back(notice.text);
    return all;
  };
  EXPECT_THAT(texts(), Contains(HasSubstr("neighbouring views move by -1.2 .. ")));
  EXPECT_THAT(texts(), Each(Not(HasSubstr("no visible parallax"))));
  // 4 steps of up to 0.05 px.
  for (float& value : files.map.values) value *= 0.03F;
  PrepareProblem(files.photo, files.map, {}, FiveViews(), &found, OneThread());
  EXPECT_THAT(texts(), Contains(AllOf(HasSubstr("no visible parallax"),
                                      HasSubstr("<depth.meaning.disparity_scale>"))));
}

}  // namespace
}  // namespace thicklens
