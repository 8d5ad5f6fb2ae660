// Tests the front, the figures and the files of the tables of time and error.
#include "tools/bench/cost_rows.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>
#include <string>
#include <utility>
#include <vector>

#include "tools/bench/cost_page.h"
#include "tools/bench/cost_plans.h"
#include "tools/bench/pareto_front.h"
#include "tools/support/xml_elements.h"

namespace thicklens::tools {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

TEST(ParetoFront, HoldsWhatNothingBeats) {
  // (cost, error): the third is beaten by the second, the fourth by the first alone.
  EXPECT_THAT(ParetoFront({{1, 5}, {2, 3}, {3, 4}, {1, 6}, {9, 1}}),
              ElementsAre(true, true, false, false, true));
  EXPECT_THAT(ParetoFront({{1, 1}, {1, 1}}), ElementsAre(true, true));
  EXPECT_THAT(ParetoFront({}), IsEmpty());
}

// Sorted by cost, the front is where the running least of the errors falls.
TEST(ParetoFront, IsTheRunningLeastOfSortedPoints) {
  std::mt19937 engine(3);
  std::uniform_real_distribution<double> number(0, 1);
  std::vector<std::pair<double, double>> points(200);
  for (auto& [cost, error] : points) {
    cost = number(engine);
    error = number(engine);
  }
  std::sort(points.begin(), points.end());
  const std::vector<bool> front = ParetoFront(points);
  double least = 2;
  for (std::size_t i = 0; i < points.size(); ++i) {
    EXPECT_EQ(front[i], points[i].second < least) << i;
    least = std::min(least, points[i].second);
  }
}

CostRow RowOf(const std::string& scene, const std::string& prior, double seconds, double psnr_db) {
  CostRow row;
  row.scene = scene;
  row.views = 5;
  row.plan.prior = prior;
  row.setup_seconds = {0.1 * seconds};
  row.solve_seconds = {0.8 * seconds};
  row.views_seconds = {0.1 * seconds};
  row.seconds = {seconds};
  row.scores.psnr_mean_db = psnr_db;
  return row;
}

std::vector<CostRow> SomeRows() {
  std::vector<CostRow> rows = {RowOf("a", "ridge", 1, 40), RowOf("a", "tv", 2, 39),
                               RowOf("b", "tv", 3, 30), RowOf("a", "patches", 4, 45)};
  rows.push_back(RowOf("a", "gradient", 1, 99));
  rows.back().failure = "out of luck";
  rows.push_back(RowOf("a", "", 0.1, 35));
  rows.back().is_warping = true;
  return rows;
}

TEST(MarkFront, ComparesWithinASceneAndLeavesFailuresOut) {
  std::vector<CostRow> rows = SomeRows();
  MarkFront(&rows);
  std::vector<bool> front;
  for (const CostRow& row : rows) front.push_back(row.on_front);
  EXPECT_THAT(front, ElementsAre(true, false, true, true, false, true));
}

TEST(ErrorGreyLevels, IsTheRootMeanSquare) {
  EXPECT_NEAR(ErrorGreyLevels(0), 255, 1e-9);
  EXPECT_NEAR(ErrorGreyLevels(20 * std::log10(255.0)), 1, 1e-12);
}

TEST(CostTable, FailuresAreListedAndTheFrontIsMarked) {
  std::vector<CostRow> rows = SomeRows();
  MarkFront(&rows);
  const std::string table = CostTable(rows);
  EXPECT_THAT(table, HasSubstr("a, 5 x 5 views"));
  EXPECT_THAT(table, HasSubstr("b, 5 x 5 views"));
  EXPECT_THAT(table, HasSubstr("out of luck"));
  EXPECT_THAT(table, HasSubstr("> scene patches"));
  EXPECT_THAT(table, HasSubstr("\n  scene tv"));
}

TEST(CostTable, ExtrapolatedSecondsStandInAColumnOfTheirOwn) {
  std::vector<CostRow> rows = {RowOf("a", "tv", 2, 39), RowOf("a", "ridge", 64, 40)};
  rows[1].sample = BlockSample{64, 256};
  rows[0].scored = rows[1].scored = ScoredArea{4, 32, 32};
  const std::string table = CostTable(rows);
  EXPECT_THAT(table, HasSubstr("scores of 4 areas of 32 x 32 px"));
  EXPECT_THAT(table, ::testing::ContainsRegex("scene tv +2 +- +2 .. 2"));
  EXPECT_THAT(table, ::testing::ContainsRegex("scene ridge +- +64 +64 .. 64"));
  EXPECT_TRUE(CostRowJson(rows[1])["seconds"].is_null());
  EXPECT_TRUE(CostRowJson(rows[1])["solve_seconds"].is_null());
  EXPECT_EQ(CostRowJson(rows[1])["extrapolated_seconds"], 64);
  EXPECT_EQ(CostRowJson(rows[0])["seconds"], 2);
  EXPECT_THAT(CostPage(rows, ""), ::testing::AllOf(HasSubstr("seconds, extrapolated"),
                                                   HasSubstr("64 s extrapolated, 40.00 dB"),
                                                   HasSubstr("4 areas of 32 x 32 px")));
}

TEST(CostCsv, HasAsManyCellsInEachLineAsNames) {
  std::vector<CostRow> rows = SomeRows();
  rows.front().plan.tolerance = 0.01;  // a name with a comma
  rows.front().scene = "a \"scene\"";
  rows.front().sample = BlockSample{64, 256};
  const std::string csv = CostCsv(rows);
  std::vector<int> counts;
  int cells = 1;
  bool quoted = false;
  for (const char c : csv) {
    if (c == '"') quoted = !quoted;
    if (c == ',' && !quoted) ++cells;
    if (c != '\n') continue;
    counts.push_back(cells);
    cells = 1;
  }
  ASSERT_EQ(counts.size(), rows.size() + 1);  // the names
  EXPECT_THAT(csv, HasSubstr("out of luck"));
  EXPECT_THAT(counts, ::testing::Each(counts.front()));
}

TEST(CostPage, IsWellFormedAndNamesEachPoint) {
  std::vector<CostRow> rows = SomeRows();
  MarkFront(&rows);
  const std::string page = CostPage(rows, "a machine & its < figures");
  EXPECT_THAT(page, HasSubstr("scene patches: 4 s, 45.00 dB"));
  EXPECT_THAT(page, HasSubstr("warping alone (DIBR), 0.1 s"));
  EXPECT_THAT(page, HasSubstr("a machine &amp; its &lt; figures"));
  const Plot plot = CostFigure(CostGroups(rows).front(), "prices-1");
  EXPECT_TRUE(plot.x_axis.logarithmic);
  EXPECT_EQ(ParseXml(SvgFile(SvgPlot(plot))).error, "");
  EXPECT_EQ(ParseXml(SvgPlot(plot)).Named("circle", 0).size(), 3U + 1U);  // and the legend's
}

TEST(PlansOf, NamesNoPlanTwiceAndFullHasThemAll) {
  PlanGrid some, full;
  some.opencl = full.opencl = true;
  full.full = true;
  const auto names = [](const PlanGrid& grid) {
    std::vector<std::string> found;
    for (const estimator::EstimatePlan& plan : PlansOf(grid))
      found.push_back(estimator::PlanName(plan));
    std::sort(found.begin(), found.end());
    EXPECT_EQ(std::adjacent_find(found.begin(), found.end()), found.end());
    return found;
  };
  const std::vector<std::string> few = names(some), all = names(full);
  EXPECT_TRUE(std::includes(all.begin(), all.end(), few.begin(), few.end()));
  EXPECT_GT(all.size(), 2 * few.size());
  PlanGrid base;
  base.base_only = true;
  EXPECT_EQ(PlansOf(base).size(), 6U);
}

}  // namespace
}  // namespace thicklens::tools
