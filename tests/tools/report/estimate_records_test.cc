#include "tools/report/estimate_records.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <string>

#include "support/error_message.h"
#include "support/temporary_folder.h"

namespace thicklens::tools {
namespace {

using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::Not;
using ::testing::Optional;
using ::testing::StartsWith;
using thicklens::testing::ErrorOf;
using thicklens::testing::TemporaryFolder;

constexpr char kEstimate[] = R"({
  "status": "ok", "reason": "", "output": "est", "solver": "blocks", "block_solver": "cholmod",
  "stencil": "warp", "splat": "bilinear", "prior": "ridge", "gamma": 1.5, "ridge": 0.0004,
  "device": "cpu", "threads": 2, "views": [5, 3], "size": [64, 48], "channels": 3, "block_px": 16,
  "blocks": 12, "seconds": {"setup": 0.5, "solve": 2.25, "views": 0.25, "total": 3.0},
  "peak_rss_mib": 123.5, "predicted_memory_mib": 100, "iterations": null,
  "relative_residual": 2e-15, "rcond_min": 0.001, "effects": ["defocus", "falloff"],
  "holes_filled": 7, "clipped_fraction": 0})";

constexpr char kComparison[] = R"({
  "status": "ok", "reason": "",
  "mean": {"psnr_db": 31.25, "ssim": 0.9, "delta_e94_mean": 2.5, "macade_standin": null},
  "centre": {"psnr_db": null, "ssim": 1, "delta_e94_mean": 0, "macade_standin": 1},
  "corner": null,
  "per_view": [{"u": 0, "v": 1, "psnr_db": 30.5, "ssim": 0.8, "dibr_psnr_db": 32.5},
               {"u": 1, "v": 1, "psnr_db": null, "dibr_psnr_db": null}],
  "dibr": {"mean": {"psnr_db": 33.5}, "centre": null, "corner": {"psnr_db": 29}},
  "views_above_dibr": 1})";

class Records : public ::testing::Test {
 protected:
  std::string EstimateError(const std::string& text) {
    return ErrorOf([&] { ReadEstimateRecord(folder_.Put("r.json", text)); });
  }
  std::string ComparisonError(const std::string& text) {
    return ErrorOf([&] { ReadComparisonRecord(folder_.Put("r.json", text)); });
  }
  static std::string Replaced(std::string text, const std::string& from, const std::string& to) {
    const std::size_t at = text.find(from);
    EXPECT_NE(at, std::string::npos) << from;
    return text.replace(at, from.size(), to);
  }

  TemporaryFolder folder_;
};

TEST_F(Records, EstimateIsRead) {
  const EstimateRecord record = ReadEstimateRecord(folder_.Put("e.json", kEstimate));
  EXPECT_EQ(record.solver, "blocks");
  EXPECT_EQ(record.block_solver, "cholmod");
  EXPECT_EQ(record.stencil, "warp");
  EXPECT_EQ(record.splat, "bilinear");
  EXPECT_EQ(record.device, "cpu");
  EXPECT_THAT(record.gamma, Optional(1.5));
  EXPECT_THAT(record.ridge, Optional(0.0004));
  EXPECT_THAT(record.threads, Optional(2));
  EXPECT_EQ(record.u_count, 5);
  EXPECT_EQ(record.v_count, 3);
  EXPECT_EQ(record.s_count, 64);
  EXPECT_EQ(record.t_count, 48);
  EXPECT_THAT(record.block_px, Optional(16));
  EXPECT_THAT(record.blocks, Optional(12));
  EXPECT_THAT(record.holes_filled, Optional(7));
  EXPECT_THAT(record.setup_seconds, Optional(0.5));
  EXPECT_THAT(record.solve_seconds, Optional(2.25));
  EXPECT_THAT(record.views_seconds, Optional(0.25));
  EXPECT_THAT(record.total_seconds, Optional(3.0));
  EXPECT_THAT(record.peak_rss_mib, Optional(123.5));
  EXPECT_THAT(record.relative_residual, Optional(2e-15));
  EXPECT_THAT(record.rcond_min, Optional(0.001));
  EXPECT_THAT(record.effects, Optional(ElementsAre("defocus", "falloff")));
}

TEST_F(Records, EstimateOfTheSceneIsRead) {
  const EstimateRecord record = ParseEstimateRecord(R"({
    "status": "ok", "solver": "scene", "block_solver": null, "prior": "tv", "strength": 0.0017,
    "strength_rule": "auto", "noise_sigma": 0.004, "residual_rms": 0.005, "row_share": 0.25,
    "occluded_fraction": 0.125, "iterations": 57, "converged": false, "rcond_min": null,
    "views": [7, 5], "size": [64, 48], "seconds": {"files": 1.5}})",
                                                    "e.json");
  EXPECT_EQ(record.solver, "scene");
  EXPECT_EQ(record.block_solver, "");
  EXPECT_EQ(record.prior, "tv");
  EXPECT_EQ(record.strength_rule, "auto");
  EXPECT_THAT(record.strength, Optional(0.0017));
  EXPECT_THAT(record.noise_sigma, Optional(0.004));
  EXPECT_THAT(record.residual_rms, Optional(0.005));
  EXPECT_THAT(record.row_share, Optional(0.25));
  EXPECT_THAT(record.occluded_fraction, Optional(0.125));
  EXPECT_THAT(record.iterations, Optional(57));
  EXPECT_THAT(record.converged, Optional(false));
  EXPECT_THAT(record.files_seconds, Optional(1.5));
  EXPECT_FALSE(record.rcond_min.has_value());
  EXPECT_FALSE(record.solve_seconds.has_value());
  EXPECT_THAT(EstimateError(R"({"solver": "scene", "views": [1, 2], "size": [3, 4],
                                "converged": 1})"),
              AllOf(HasSubstr("r.json"), HasSubstr("converged"), HasSubstr("true or false")));
}

TEST_F(Records, ComparisonIsRead) {
  const ComparisonRecord record = ReadComparisonRecord(folder_.Put("c.json", kComparison));
  EXPECT_EQ(record.mean.psnr_db, 31.25);
  EXPECT_THAT(record.mean.ssim, Optional(0.9));
  EXPECT_THAT(record.mean.delta_e94_mean, Optional(2.5));
  EXPECT_FALSE(record.mean.macade_standin.has_value());
  ASSERT_TRUE(record.centre.has_value());
  EXPECT_TRUE(std::isinf(record.centre->psnr_db));
  EXPECT_FALSE(record.corner.has_value());
  ASSERT_TRUE(record.dibr_mean.has_value());
  EXPECT_EQ(record.dibr_mean->psnr_db, 33.5);
  EXPECT_FALSE(record.dibr_centre.has_value());
  EXPECT_EQ(record.dibr_corner->psnr_db, 29);
  ASSERT_EQ(record.views.size(), 2u);
  EXPECT_EQ(record.views[0].u, 0);
  EXPECT_EQ(record.views[0].v, 1);
  EXPECT_EQ(record.views[0].psnr_db, 30.5);
  EXPECT_THAT(record.views[0].dibr_psnr_db, Optional(32.5));
  EXPECT_FALSE(record.views[1].dibr_psnr_db.has_value());
  EXPECT_THAT(record.views_above_dibr, Optional(1));
}

TEST_F(Records, BrokenFilesAreReportedInOneLine) {
  for (const char* text : {"", "{", "{\"solver\": ", "\x89PNG\r\n", "nonsense"}) {
    EXPECT_THAT(EstimateError(text),
                AllOf(HasSubstr("r.json: not a JSON file"), Not(HasSubstr("\n"))));
    EXPECT_THAT(ComparisonError(text),
                AllOf(HasSubstr("r.json: not a JSON file"), Not(HasSubstr("\n"))));
  }
  EXPECT_THAT(EstimateError("[1, 2]"), HasSubstr("an object is expected"));
  EXPECT_THAT(ErrorOf([&] { ReadEstimateRecord(folder_ / "missing.json"); }),
              StartsWith(folder_ / "missing.json"));
}

TEST_F(Records, FilesOfOtherCommandsAreReported) {
  EXPECT_THAT(EstimateError(kComparison),
              AllOf(HasSubstr("'solver' is missing"), HasSubstr("`thicklens estimate --json`")));
  EXPECT_THAT(ComparisonError(kEstimate),
              AllOf(HasSubstr("'mean' is missing"), HasSubstr("for two light fields")));
  // Two images compared.
  EXPECT_THAT(ComparisonError(R"({"psnr_db": 30, "ssim": 0.9})"), HasSubstr("'mean' is missing"));
}

TEST_F(Records, RefusedRunsAreReported) {
  const std::string refused = R"({"status": "refused", "reason": "no depth"})";
  EXPECT_THAT(EstimateError(refused), HasSubstr("this run was refused: \"no depth\""));
  EXPECT_THAT(ComparisonError(refused), HasSubstr("this run was refused"));
  EXPECT_THAT(EstimateError(R"({"status": "refused"})"), HasSubstr("refused"));
}

TEST_F(Records, WrongTypesNameTheField) {
  EXPECT_THAT(EstimateError(Replaced(kEstimate, "1.5", "\"much\"")),
              HasSubstr("'gamma': a number is expected, found \"much\""));
  EXPECT_THAT(EstimateError(Replaced(kEstimate, "2.25", "[]")), HasSubstr("'seconds.solve'"));
  EXPECT_THAT(EstimateError(Replaced(kEstimate, "[5, 3]", "[5]")), HasSubstr("'views'"));
  EXPECT_THAT(EstimateError(Replaced(kEstimate, "[5, 3]", "[5, 0]")), HasSubstr("'views'"));
  EXPECT_THAT(EstimateError(Replaced(kEstimate, "[5, 3]", "null")),
              HasSubstr("'views' is missing"));
  EXPECT_THAT(EstimateError(Replaced(kEstimate, "\"blocks\": 12", "\"blocks\": 1.5")),
              HasSubstr("'blocks'"));
  EXPECT_THAT(EstimateError(Replaced(kEstimate, "\"blocks\": 12", "\"blocks\": 1e300")),
              HasSubstr("'blocks'"));
  EXPECT_THAT(EstimateError(Replaced(kEstimate, "[\"defocus\", \"falloff\"]", "[1]")),
              HasSubstr("'effects'"));
  EXPECT_THAT(EstimateError(Replaced(kEstimate, "\"cpu\"", "{}")), HasSubstr("'device'"));
  EXPECT_THAT(ComparisonError(Replaced(kComparison, "31.25", "true")), HasSubstr("'mean.psnr_db'"));
  EXPECT_THAT(ComparisonError(Replaced(kComparison, "\"u\": 1", "\"u\": -1")),
              HasSubstr("'per_view[1].u'"));
  EXPECT_THAT(ComparisonError(Replaced(kComparison, "\"u\": 1", "\"u\": 1000000")),
              HasSubstr("'per_view[1].u'"));
  EXPECT_THAT(ComparisonError(Replaced(kComparison, "\"u\": 1, ", "")),
              HasSubstr("'per_view[1].u' is missing"));
  EXPECT_THAT(
      ComparisonError(Replaced(kComparison, "{\"mean\": {\"psnr_db\": 33.5}", "{\"mean\": 3")),
      HasSubstr("'dibr.mean': an object is expected, found 3"));
}

// A long or strange value does not make the message long or strange.
TEST_F(Records, ValuesInMessagesAreShort) {
  const std::string message =
      EstimateError(Replaced(kEstimate, "1.5", '"' + std::string(5000, 'x') + '"'));
  EXPECT_LT(message.size(), folder_.path().size() + 150);
}

}  // namespace
}  // namespace thicklens::tools
