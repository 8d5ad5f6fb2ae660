#include "tools/interface/blur_proposal.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "support/test_cameras.h"
#include "thicklens/model/light_field_grid.h"
#include "thicklens/model/thick_lens.h"

namespace thicklens {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;
using thicklens::testing::CentredSensor;
using thicklens::testing::TestCameraFocusedAt;
using thicklens::testing::WideLens;

estimator::EstimateInput WithCamera() {
  estimator::EstimateInput input;
  input.weights = model::ApertureWeights(model::ApertureShape::kGaussian, 7, 5);
  input.camera = TestCameraFocusedAt(800, "", WideLens(), CentredSensor(96, 64, 0.006));
  return input;
}

DepthMeaning Meaning(DepthKind kind) {
  DepthMeaning meaning;
  meaning.kind = kind;
  return meaning;
}

std::string Warning(const estimator::BlurCheck& check, const estimator::EstimateInput& input,
                    const DepthMeaning& meaning) {
  const RunControl control;
  return BlurWarning(check, ProposalOf(check, input, meaning), input, RunScope(control));
}

estimator::BlurTrial Trial(double scale, double offset_px, double unexplained) {
  estimator::BlurTrial trial;
  trial.blur_scale = scale;
  trial.focus_offset_px = offset_px;
  trial.unexplained = unexplained;
  return trial;
}

estimator::BlurCheck Checked() {
  estimator::BlurCheck check;
  check.message = "looked";
  check.blocks = 20;
  check.unexplained_blocks = 7;
  check.trials = {Trial(1, 0, 1), Trial(0.5, 0, 0.1)};
  return check;
}

// A point in focus then has the disparity -offset with the present camera.
TEST(BlurProposal, FocusIsWhereTheOffsetLeadsToNoDisparity) {
  const estimator::EstimateInput input = WithCamera();
  const model::Camera& camera = *input.camera;
  const model::ApertureSamples samples = model::SampleAperture(input.weights, 0.45, 4.46);
  ASSERT_LT(samples.u_step_mm, samples.v_step_mm);
  for (const double offset_px : {-0.4, -0.01, 0.3}) {
    const double depth_mm = FocusDepthForOffsetMm(input, offset_px);
    const double disparity_px =
        samples.v_step_mm *
        model::DefocusPerAperture(camera.lens, camera.calibration->image_distance_mm->value,
                                  depth_mm) /
        0.006;
    EXPECT_NEAR(disparity_px, -offset_px, 1e-9);
  }
  EXPECT_TRUE(std::isinf(FocusDepthForOffsetMm(input, 100)));
}

TEST(BlurProposal, SaysNothingWhereNothingIsFound) {
  EXPECT_THAT(Warning(Checked(), WithCamera(), Meaning(DepthKind::kZ)), IsEmpty());
  const BlurProposal proposal = ProposalOf(Checked(), WithCamera(), Meaning(DepthKind::kZ));
  EXPECT_FALSE(proposal.narrower_blur || proposal.other_focus);
}

TEST(BlurProposal, SpeaksOfTheCameraWhereDepthIsADepth) {
  estimator::BlurCheck check = Checked();
  check.narrower_blur = Trial(0.5, 0, 0.1);
  EXPECT_THAT(Warning(check, WithCamera(), Meaning(DepthKind::kZ)),
              AllOf(HasSubstr("7 of 20 blocks"), HasSubstr("0.5 times"),
                    HasSubstr("blur_ratio of 0.225 instead of 0.45"), HasSubstr("leaves 10 %"),
                    HasSubstr("none of this was applied"), Not(HasSubstr("plane of focus"))));
  const BlurProposal blur = ProposalOf(check, WithCamera(), Meaning(DepthKind::kZ));
  EXPECT_DOUBLE_EQ(blur.narrower_blur.value().blur_ratio.value(), 0.225);
  EXPECT_FALSE(blur.narrower_blur->disparity_scale);
  EXPECT_FALSE(blur.other_focus);

  check.other_focus = Trial(1, -0.3, 0.2);
  const estimator::EstimateInput input = WithCamera();
  EXPECT_THAT(Warning(check, input, Meaning(DepthKind::kRange)),
              AllOf(HasSubstr("plane of focus at"), HasSubstr("instead of 800 mm"),
                    HasSubstr("-0.3 px"), HasSubstr("the photograph does not show")));
  const BlurProposal both = ProposalOf(check, input, Meaning(DepthKind::kRange));
  EXPECT_EQ(both.other_focus.value().focus_depth_mm.value(), FocusDepthForOffsetMm(input, -0.3));
}

TEST(BlurProposal, SpeaksOfTheMapWhereItHoldsDisparities) {
  estimator::BlurCheck check = Checked();
  check.narrower_blur = Trial(0.5, 0, 0.1);
  check.other_focus = Trial(1, 0.25, 0.2);
  DepthMeaning meaning = Meaning(DepthKind::kDisparity);
  meaning.disparity_scale = 0.02;
  meaning.disparity_offset_px = -1.5;
  estimator::EstimateInput input;
  input.weights = model::ApertureWeights(model::ApertureShape::kUniform, 5, 5);
  // 0.5 (0.02 v - 1.5) and 0.02 v - 1.5 + 0.25.
  EXPECT_THAT(Warning(check, input, meaning),
              AllOf(HasSubstr("depth.meaning.disparity_scale 0.01"),
                    HasSubstr("depth.meaning.disparity_offset_px -0.75"),
                    HasSubstr("depth.meaning.disparity_offset_px -1.25 ")));
  const BlurProposal proposal = ProposalOf(check, input, meaning);
  EXPECT_DOUBLE_EQ(proposal.narrower_blur.value().disparity_scale.value(), 0.01);
  EXPECT_DOUBLE_EQ(proposal.narrower_blur->disparity_offset_px.value(), -0.75);
  EXPECT_DOUBLE_EQ(proposal.other_focus.value().disparity_offset_px.value(), -1.25);
}

}  // namespace
}  // namespace thicklens
