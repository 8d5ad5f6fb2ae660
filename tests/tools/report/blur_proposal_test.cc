#include "tools/report/blur_proposal.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "support/test_cameras.h"
#include "thicklens/model/light_field_grid.h"
#include "thicklens/model/thick_lens.h"

namespace thicklens::tools {
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

DepthOptions Depth(const std::string& kind) {
  DepthOptions depth;
  depth.kind = kind;
  return depth;
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
  const BlurProposal proposal(Checked(), WithCamera(), Depth("z"));
  EXPECT_THAT(proposal.Warning(), IsEmpty());
  EXPECT_TRUE(proposal.Json().at("proposal").is_null());
  EXPECT_EQ(proposal.Json().at("evaluations").size(), 2u);
  EXPECT_EQ(proposal.Json().at("evaluations")[1].at("blur_scale"), 0.5);
  EXPECT_THAT(proposal.Summary(), HasSubstr("looked (2 solve(s)"));
}

TEST(BlurProposal, SpeaksOfTheCameraWhereDepthIsADepth) {
  estimator::BlurCheck check = Checked();
  check.narrower_blur = Trial(0.5, 0, 0.1);
  const BlurProposal blur(check, WithCamera(), Depth("z"));
  EXPECT_THAT(blur.Warning(),
              AllOf(HasSubstr("7 of 20 blocks"), HasSubstr("0.5 times"),
                    HasSubstr("blur_ratio of 0.225 instead of 0.45"), HasSubstr("leaves 10 %"),
                    HasSubstr("none of this was applied"), Not(HasSubstr("plane of focus"))));
  EXPECT_DOUBLE_EQ(blur.Json().at("proposal").at("narrower_blur").at("blur_ratio").get<double>(),
                   0.225);
  EXPECT_FALSE(blur.Json().at("proposal").contains("other_focus"));

  check.other_focus = Trial(1, -0.3, 0.2);
  const estimator::EstimateInput input = WithCamera();
  const BlurProposal both(check, input, Depth("range"));
  EXPECT_THAT(both.Warning(),
              AllOf(HasSubstr("plane of focus at"), HasSubstr("instead of 800 mm"),
                    HasSubstr("-0.3 px"), HasSubstr("the photograph does not show")));
  EXPECT_EQ(both.Json().at("proposal").at("other_focus").at("focus_depth_mm"),
            FocusDepthForOffsetMm(input, -0.3));
}

TEST(BlurProposal, SpeaksOfTheMapWhereItHoldsDisparities) {
  estimator::BlurCheck check = Checked();
  check.narrower_blur = Trial(0.5, 0, 0.1);
  check.other_focus = Trial(1, 0.25, 0.2);
  DepthOptions depth = Depth("disparity");
  depth.disparity_scale = 0.02;
  depth.disparity_offset_px = -1.5;
  estimator::EstimateInput input;
  input.weights = model::ApertureWeights(model::ApertureShape::kUniform, 5, 5);
  const BlurProposal proposal(check, input, depth);
  // 0.5 (0.02 v - 1.5) and 0.02 v - 1.5 + 0.25.
  EXPECT_THAT(proposal.Warning(),
              AllOf(HasSubstr("--disparity-scale 0.01 --disparity-offset -0.75"),
                    HasSubstr("--disparity-offset -1.25 ")));
  const nlohmann::json json = proposal.Json().at("proposal");
  EXPECT_DOUBLE_EQ(json.at("narrower_blur").at("disparity_scale").get<double>(), 0.01);
  EXPECT_DOUBLE_EQ(json.at("narrower_blur").at("disparity_offset_px").get<double>(), -0.75);
  EXPECT_DOUBLE_EQ(json.at("other_focus").at("disparity_offset_px").get<double>(), -1.25);
}

}  // namespace
}  // namespace thicklens::tools
