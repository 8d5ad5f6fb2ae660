#include "calib/edges/edge_blur.h"

#include <gtest/gtest.h>

#include "tests/calib/drawn_edges.h"

namespace thicklens::calib {
namespace {

using thicklens::testing::DrawnEdge;

TEST(MeasureSourceEdgeBlur, IsNearlyFlatBelowSevenTenthsOfAPixel) {
  // The numbers are from a study of the paper's blur estimator on slanted edges.
  const auto measure = [](double sigma_px) {
    const auto blur = MeasureSourceEdgeBlur(DrawnEdge(128, 5, sigma_px, 0.2, 0.8));
    return blur ? blur->sigma_px : -1;
  };
  EXPECT_NEAR(measure(0.3), 0.83, 0.06);
  EXPECT_NEAR(measure(0.7), 0.99, 0.06);
  EXPECT_NEAR(measure(1), 1.21, 0.06);
  EXPECT_NEAR(measure(2), 2.10, 0.06);
  // The estimator shows less than half of a change of 0.4 px.
  EXPECT_LT(measure(0.7) - measure(0.3), 0.2);
}

TEST(MeasureSourceEdgeBlur, CountsItsEdgesAndSaysNothingWithoutAny) {
  const auto blur = MeasureSourceEdgeBlur(DrawnEdge(128, 0, 1, 0.2, 0.8));
  ASSERT_TRUE(blur);
  EXPECT_GE(blur->edge_count, 100);  // one per row, except in the margins
  EXPECT_LE(blur->edge_count, 2 * 128);
  EXPECT_FALSE(MeasureSourceEdgeBlur(cv::Mat(64, 64, CV_32F, cv::Scalar(0.4))));
}

}  // namespace
}  // namespace thicklens::calib
