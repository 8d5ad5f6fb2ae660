#include "thicklens/model/target_texture.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <set>
#include <vector>

#include "thicklens/model/target_page.h"

namespace thicklens::model {
namespace {

// Half an A4 sheet: quick, and with all that a whole one has.
TargetRequest SmallRequest() {
  TargetRequest request;
  request.sheet = {148, 120, false};
  request.feature_mm = 0.5;
  return request;
}

TEST(DeadLeaves, KeepsItsBoundsAndUsesTheWholeContrast) {
  const TargetPage page = LayOutTarget(SmallRequest());
  const std::vector<TargetLeaf> leaves = DeadLeaves(page);
  ASSERT_GT(leaves.size(), 5000U);
  double smallest_mm = 1e9, largest_mm = 0, mean = 0;
  std::set<int> greys;
  for (const TargetLeaf& leaf : leaves) {
    smallest_mm = std::min(smallest_mm, leaf.radius_mm);
    largest_mm = std::max(largest_mm, leaf.radius_mm);
    mean += leaf.grey / static_cast<double>(leaves.size());
    greys.insert(leaf.grey);
  }
  EXPECT_GE(smallest_mm, page.feature_mm / 2);
  EXPECT_LT(smallest_mm, 1.002 * page.feature_mm / 2);
  EXPECT_GT(largest_mm, 10 * page.feature_mm);
  EXPECT_LE(largest_mm, 0.1 * page.pattern.height + 1e-9);
  EXPECT_EQ(*greys.begin(), 51);    // 0.2
  EXPECT_EQ(*greys.rbegin(), 230);  // 0.9
  EXPECT_EQ(greys.size(), 180U);
  EXPECT_NEAR(mean, 140.5, 3);
}

// Among leaves that lie wholly in front, whose radii nothing but the law decides, as many as r^-3
// says: the foremost ones of the pile, before any was left out.
TEST(DeadLeaves, HasRadiiOfTheInverseCube) {
  TargetRequest request = SmallRequest();
  request.feature_mm = 0.3;
  const TargetPage page = LayOutTarget(request);
  std::vector<TargetLeaf> leaves = DeadLeaves(page);
  std::reverse(leaves.begin(), leaves.end());
  leaves.resize(3000);
  const double a = page.feature_mm / 2, b = 0.1 * page.pattern.height;
  const double up_to_twice = (1 - 0.25) / (1 - a * a / (b * b));  // part with r <= 2 a
  const auto count = std::count_if(leaves.begin(), leaves.end(),
                                   [&](const TargetLeaf& leaf) { return leaf.radius_mm <= 2 * a; });
  EXPECT_NEAR(static_cast<double>(count) / 3000, up_to_twice, 0.03);
}

}  // namespace
}  // namespace thicklens::model
