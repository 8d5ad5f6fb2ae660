// The table of thicklens bench solvers: all values of a column refer to the same area.
#include "tools/bench/solvers_table.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <nlohmann/json.hpp>
#include <sstream>
#include <string>
#include <vector>

#include "thicklens/estimator/compare.h"
#include "tools/bench/bench_scene.h"
#include "tools/bench/bench_solvers.h"
#include "tools/bench/whole_time.h"

namespace thicklens::tools {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::Not;

SolversRun SomeSolversRun(bool is_sampled) {
  SolversRun run;
  run.width_px = run.height_px = 256;
  run.u_count = run.v_count = 7;
  run.threads = 2;
  run.repeat = 3;
  run.is_sampled = is_sampled;
  run.part = is_sampled ? ScoredArea{1, 32, 32} : ScoredArea{1, 216, 216};
  run.pixels_ratio = is_sampled ? 16 : 1;
  run.solved_px = 64;
  return run;
}

std::vector<std::string> WordsOf(const std::string& line) {
  std::istringstream stream(line);
  std::vector<std::string> words;
  for (std::string word; stream >> word;) words.push_back(word);
  return words;
}

std::string LineWith(const std::string& text, const std::string& begin) {
  std::istringstream stream(text);
  for (std::string line; std::getline(stream, line);) {
    if (line.rfind(begin, 0) == 0) return line;
  }
  return "";
}

TEST(SolversTable, ExtrapolatedSecondsAndPsnrOfThePartHaveColumnsOfTheirOwn) {
  SolversRow blocks{"blocks", "umfpack", "ridge", {{32, 48, 40}, true}, 45.65, {}};
  SolversRow scene{"scene", "", "tv", {{0.5}, false}, 44.1, 42.8};
  const std::string text = SolversTableText(SomeSolversRun(true), {blocks, scene});
  // Measured, extrapolated, ratios of the same work and of unlike, PSNR of the part and of it all.
  EXPECT_THAT(WordsOf(LineWith(text, "blocks")),
              ElementsAre("blocks", "umfpack", "ridge", "-", "40", "1", "-", "45.65", "-"));
  EXPECT_THAT(WordsOf(LineWith(text, "scene")),
              ElementsAre("scene", "tv", "0.5", "-", "-", "80", "44.10", "42.80"));
  EXPECT_THAT(text, HasSubstr("1 area of 32 x 32 px"));
  const nlohmann::json json = SolversRowJson(SomeSolversRun(true), blocks, blocks);
  EXPECT_TRUE(json["psnr_db"].is_null());
  EXPECT_TRUE(json["seconds"].is_null());
  EXPECT_EQ(json["psnr_part_db"], 45.65);
  EXPECT_EQ(json["extrapolated_seconds"], 40);
  EXPECT_EQ(SolversRowJson(SomeSolversRun(true), scene, blocks)["times_faster_extrapolated"], 80);
}

TEST(SolversTable, OfAllThatIsSolvedOneColumnOfEachWillDo) {
  const SolversRow blocks{"blocks", "umfpack", "ridge", {{40}, false}, 40.25, 40.25};
  const SolversRow scene{"scene", "", "tv", {{0.5}, false}, 42.8, 42.8};
  const std::string text = SolversTableText(SomeSolversRun(false), {blocks, scene});
  EXPECT_THAT(WordsOf(LineWith(text, "blocks")),
              ElementsAre("blocks", "umfpack", "ridge", "40", "1", "40.25"));
  EXPECT_THAT(text, Not(HasSubstr("extrapolated")));
  const nlohmann::json json = SolversRowJson(SomeSolversRun(false), scene, blocks);
  EXPECT_EQ(json["psnr_db"], 42.8);
  EXPECT_EQ(json["times_faster"], 80);
  EXPECT_TRUE(json["psnr_part_db"].is_null());
}

TEST(WholeTime, IsMeasuredOrExtrapolatedAndNeverBoth) {
  const WholeTime measured{{1, 3, 2}, false}, extrapolated{{4}, true};
  EXPECT_EQ(measured.MeasuredCell(), "2");
  EXPECT_EQ(measured.ExtrapolatedCell(), "-");
  EXPECT_EQ(measured.RangeCell(), "1 .. 3");
  EXPECT_TRUE(measured.Json()["extrapolated_seconds"].is_null());
  EXPECT_EQ(extrapolated.MeasuredCell(), "-");
  EXPECT_EQ(extrapolated.ExtrapolatedCell(), "4");
  EXPECT_TRUE(extrapolated.Json()["seconds_of_runs"].is_null());
  EXPECT_EQ(extrapolated.Json()["extrapolated_seconds_of_runs"], nlohmann::json({4}));
}

// The scored area of a whole estimate is the same part inside the whole.
TEST(ScoredArea, OfAPartIsThatPartOfTheWholeWithoutItsBorder) {
  SampledImage image;
  image.whole = MakeBenchScene(160, 160, 3, 3, 4, 2, {});
  CutParts(false, PartCount::kTwo, &image);
  const ScoredArea area = ScoredAreaOf(image);
  EXPECT_EQ(area.parts, 2);
  EXPECT_EQ(area.width_px, 32);
  EXPECT_EQ(ScoredAreaText(area), "2 areas of 32 x 32 px");
  const model::LightField warped = estimator::WarpedLightField(image.whole.input, true, 2);
  double mean_db = 0;
  for (const model::PixelRect& rect : image.rects) {
    const model::PixelRect inner{rect.x + 16, rect.y + 16, 32, 32};
    mean_db += estimator::CompareLightFields(model::CropViews(image.whole.truth, inner),
                                             model::CropViews(warped, inner), 0, std::nullopt, 1)
                   .mean.psnr_db /
               2;
  }
  EXPECT_NEAR(ScoresOfViews(image, PartsOf(image, warped), 1).psnr_mean_db, mean_db, 1e-9);
}

}  // namespace
}  // namespace thicklens::tools
