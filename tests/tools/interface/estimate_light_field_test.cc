// The estimate of the public interface: at once and into a sink, with the library's solvers.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>
#include <limits>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "support/error_message.h"
#include "thicklens/calibrate.h"
#include "thicklens/estimate.h"
#include "thicklens/explain.h"

namespace thicklens {
namespace {

using ::testing::HasSubstr;
using ::testing::StartsWith;
using thicklens::testing::ErrorOf;

constexpr int kWidthPx = 20, kHeightPx = 14;

Image Photo() {
  std::vector<std::uint16_t> values;
  for (int y = 0; y < kHeightPx; ++y) {
    for (int x = 0; x < kWidthPx; ++x) {
      values.push_back(static_cast<std::uint16_t>(
          std::lround(128 + 60 * std::sin(0.9 * x) + 40 * std::cos(0.7 * y + 0.3 * x))));
    }
  }
  return Image::FromEncoded(kWidthPx, kHeightPx, ChannelOrder::kGrey, 8, std::move(values),
                            TransferCurve::Srgb());
}

// A ramp with one hole.
DepthMap Disparity() {
  DepthMap map;
  map.width_px = kWidthPx;
  map.height_px = kHeightPx;
  for (int i = 0; i < kWidthPx * kHeightPx; ++i) {
    map.values.push_back(0.03F * static_cast<float>(i % kWidthPx));
  }
  map.values[kWidthPx + 5] = std::numeric_limits<float>::quiet_NaN();
  map.meaning.kind = DepthKind::kDisparity;
  map.source = "ramp";
  return map;
}

class KeepingSink : public ViewSink {
 public:
  void TakeView(int k, int l, const model::LinearImage& view) override {
    const std::lock_guard<std::mutex> lock(mutex_);
    views[{k, l}] = view.values;
  }
  void TakeConfidence(int k, int l, const std::vector<std::uint8_t>& of_view,
                      int /*width_px*/) override {
    const std::lock_guard<std::mutex> lock(mutex_);
    confidence[{k, l}] = of_view;
  }
  std::map<std::pair<int, int>, std::vector<float>> views;
  std::map<std::pair<int, int>, std::vector<std::uint8_t>> confidence;

 private:
  std::mutex mutex_;
};

EstimateOptions With(AnySolver solver) {
  EstimateOptions options;
  options.views = ViewCounts{3, 3};
  options.solver = std::move(solver);
  options.device = "auto";
  return options;
}

std::vector<AnySolver> Solvers() {
  BlockSolver blocks;
  blocks.linear = BlockSolver::Linear::kEigen;
  blocks.block_px = 8;
  return {SceneSolver(), blocks, FunctionalSolver(), GridSolver()};
}

TEST(EstimateLightField, GivesASinkTheSameRays) {
  for (const AnySolver& solver : Solvers()) {
    SCOPED_TRACE(SolverName(solver));
    const LightFieldEstimate whole =
        EstimateLightField(Photo(), Disparity(), std::nullopt, With(solver));
    KeepingSink sink;
    const LightFieldEstimate streamed =
        EstimateLightFieldTo(&sink, Photo(), Disparity(), std::nullopt, With(solver));
    EXPECT_TRUE(streamed.light_field.values.empty());
    EXPECT_TRUE(streamed.confidence.empty());
    ASSERT_EQ(sink.views.size(), 9U);
    const std::size_t view_size = whole.light_field.view_size();
    for (const auto& [place, values] : sink.views) {
      const auto [k, l] = place;
      EXPECT_EQ(values, model::ViewImage(whole.light_field, k, l).values) << k << " " << l;
      const auto first =
          whole.confidence.begin() + static_cast<std::ptrdiff_t>(view_size) * (l * 3 + k);
      EXPECT_EQ(sink.confidence[place],
                std::vector<std::uint8_t>(first, first + static_cast<std::ptrdiff_t>(view_size)));
    }
    EXPECT_EQ(streamed.diagnostics.rays_visible, whole.diagnostics.rays_visible);
    EXPECT_EQ(streamed.diagnostics.rays_filled_in, whole.diagnostics.rays_filled_in);
    EXPECT_EQ(streamed.summary.relative_residual, whole.summary.relative_residual);
  }
}

TEST(EstimateLightField, ReturnsWhatTheSolverStartedFrom) {
  const LightFieldEstimate estimate =
      EstimateLightField(Photo(), Disparity(), std::nullopt, With(SceneSolver()));
  ASSERT_TRUE(estimate.problem);
  EXPECT_EQ(estimate.problem->width_px(), kWidthPx);
  ASSERT_EQ(estimate.was_hole.size(), static_cast<std::size_t>(kWidthPx * kHeightPx));
  EXPECT_TRUE(estimate.was_hole[kWidthPx + 5]);
  EXPECT_EQ(estimate.diagnostics.holes_filled, 1U);
  ASSERT_TRUE(estimate.maps);
  EXPECT_EQ(estimate.maps->residual.size(), estimate.was_hole.size());
}

TEST(EstimateLightField, NamesOptionsAsTheProgramAsks) {
  RunControl run;
  run.option_name = [](const std::string& field) { return "<" + field + ">"; };
  std::vector<std::string> notices;
  run.notice = [&](const Notice& notice) { notices.push_back(notice.text); };
  EstimateOptions options = With(SceneSolver());
  options.views = ViewCounts{1, 3};
  EstimateLightField(Photo(), Disparity(), std::nullopt, options, run);
  EXPECT_THAT(notices, ::testing::Contains(StartsWith("<views>: one view along u")));
}

// The warnings about a map are given also where it is refused.
TEST(EstimateLightField, ReportsAMarkThatNobodyStated) {
  DepthMap map = Disparity();
  for (int i = 0; i < 40; ++i) map.values[static_cast<std::size_t>(3 * i)] = 9999;
  map.warnings = {"The reader is in doubt."};
  RunControl run;
  run.option_name = [](const std::string& field) { return "<" + field + ">"; };
  std::vector<std::string> notices;
  run.notice = [&](const Notice& notice) { notices.push_back(notice.text); };
  EXPECT_THAT(
      ErrorOf([&] { EstimateLightField(Photo(), map, std::nullopt, With(SceneSolver()), run); }),
      HasSubstr("disparities from"));
  EXPECT_THAT(notices, ::testing::Contains("ramp: The reader is in doubt."));
  EXPECT_THAT(notices,
              ::testing::Contains(
                  "ramp: 40 pixels (14.3 %) have exactly the value 9999, far beyond all others: if "
                  "it means 'no depth', state it by <depth.holes> 9999"));
  notices.clear();
  map.holes.hole_values = {9999};
  EstimateLightField(Photo(), map, std::nullopt, With(SceneSolver()), run);
  EXPECT_THAT(notices, ::testing::Not(::testing::Contains(HasSubstr("exactly the value"))));
}

// Rounding is in the noise that is found, unless it hides it.
TEST(EstimateDiagnosticsTest, DoubtsBeginAboveWhatStoringDid) {
  EstimateDiagnostics found;
  EXPECT_FALSE(found.DoubtSigma());
  found.noise_sigma = 0.08 / 255;
  found.rounding_sigma = 0.29 / 255;
  EXPECT_DOUBLE_EQ(found.DoubtSigma().value(), 0.29 / 255);
  found.noise_sigma = 3.0 / 255;
  EXPECT_DOUBLE_EQ(found.DoubtSigma().value(), 3.0 / 255);
  found.compression_sigma = 4.0 / 255;
  EXPECT_DOUBLE_EQ(found.DoubtSigma().value(), 5.0 / 255);
  EXPECT_DOUBLE_EQ(found.DoubtSigmaOfMean().value(), 3.0 / 255);
}

TEST(EstimateLightField, RefusesANullSinkAndOneView) {
  EXPECT_THAT(ErrorOf([] {
                EstimateLightFieldTo(nullptr, Photo(), Disparity(), std::nullopt,
                                     With(SceneSolver()));
              }),
              HasSubstr("sink"));
  EstimateOptions options = With(SceneSolver());
  options.views = ViewCounts{1, 1};
  EXPECT_THAT(ErrorOf([&] { EstimateLightField(Photo(), Disparity(), std::nullopt, options); }),
              StartsWith("views: 1x1 is not a light field"));
}

TEST(EstimateLightField, OptionsMayBeLeftOut) {
  const LightFieldEstimate estimate = EstimateLightField(Photo(), Disparity(), std::nullopt);
  EXPECT_EQ(estimate.light_field.u_count, 7);
  EXPECT_EQ(estimate.light_field.v_count, 7);
  KeepingSink sink;
  EstimateLightFieldTo(&sink, Photo(), Disparity(), std::nullopt);
  EXPECT_EQ(sink.views.size(), 49U);
  EXPECT_THROW(Calibrate(Sweep()), Error);
}

TEST(EstimateLightField, StatesThatTheCameraIsNotValid) {
  Camera camera;
  camera.name = "empty";
  EXPECT_THAT(ErrorOf([&] { EstimateLightField(Photo(), Disparity(), camera); }),
              StartsWith("camera 'empty' is not valid: lens: front_focal_length_mm"));
  camera.source = "empty.yaml";
  EXPECT_THAT(ErrorOf([&] { PrepareProblem(Photo(), Disparity(), camera, {}, nullptr); }),
              StartsWith("empty.yaml: the camera is not valid: lens: front_focal_length_mm"));
  ExplainOptions options;
  options.depth_range = DepthRange{500, 1000};
  EXPECT_THAT(ErrorOf([&] { ExplainCamera(camera, options); }),
              StartsWith("empty.yaml: the camera is not valid: lens: front_focal_length_mm"));
}

TEST(EstimateLightField, StatesThatALightFieldHasNoViews) {
  EstimateOptions options = With(SceneSolver());
  ApertureViews views;
  options.aperture.views_of = std::make_shared<ApertureViews>(views);
  const auto refusal = [&] {
    return ErrorOf([&] { EstimateLightField(Photo(), Disparity(), std::nullopt, options); });
  };
  EXPECT_EQ(refusal(),
            "aperture.views_of: a light field with views is expected, found 0 x 0 views");
  options.views.reset();
  EXPECT_THAT(refusal(), StartsWith("aperture.views_of: a light field with views"));
  views.description.u_count = views.description.v_count = 3;
  options.aperture.views_of = std::make_shared<ApertureViews>(views);
  EXPECT_THAT(refusal(), StartsWith("aperture.views_of: a weight for each of the 3 x 3 views"));
}

}  // namespace
}  // namespace thicklens
