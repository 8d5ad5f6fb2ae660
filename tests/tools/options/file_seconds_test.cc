#include "tools/options/file_seconds.h"

#include <gtest/gtest.h>

#include <vector>

namespace thicklens::tools {
namespace {

TEST(FileSeconds, AreThoseOfAllViews) {
  estimator::EstimateInput input;
  input.image = model::LinearImage{40, 30, 3, std::vector<float>(40 * 30 * 3, 0.5F)};
  input.disparity.width_px = 40;
  input.disparity.height_px = 30;
  input.disparity.disparity.assign(40 * 30, 0.8F);
  input.weights = Eigen::ArrayXXd::Constant(5, 5, 1.0 / 25);
  const estimator::Workload load = MeasuredWorkload(input);
  EXPECT_EQ(load.views, 25);
  // Made of 40 x 30 x 3 x 25 values.
  EXPECT_GT(load.file_seconds, 1e-9 * 40 * 30 * 3 * 25);
  input.image = model::LinearImage{40, 30, 2, std::vector<float>(40 * 30 * 2, 0.5F)};
  EXPECT_EQ(FileSeconds(input), 0);
}

}  // namespace
}  // namespace thicklens::tools
