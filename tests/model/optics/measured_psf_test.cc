#include "thicklens/model/measured_psf.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "support/error_message.h"

namespace thicklens::model {
namespace {

using ::testing::HasSubstr;

using thicklens::testing::ErrorOf;

MeasuredPsf Square(int side, double step) {
  MeasuredPsf psf;
  psf.step = step;
  psf.light = Eigen::ArrayXXd::Constant(side, side, 1.0 / (side * side));
  return psf;
}

// A uniform square of the width w has the second moment w^2/12 along each axis.
TEST(MeasuredPsf, HasTheMomentsOfAUniformSquare) {
  const MeasuredPsf psf = Square(9, 0.2);
  EXPECT_NEAR(psf.BlurRatio(), 1.8 / std::sqrt(12), 1e-12);
  EXPECT_NEAR(psf.Centroid().norm(), 0, 1e-12);
  MeasuredPsf wide = psf;  // three rows of nine
  wide.light.topRows(3) = 0;
  wide.light.bottomRows(3) = 0;
  wide = Normalised(wide);
  EXPECT_NEAR(wide.AxisSigmas().x(), 1.8 / std::sqrt(12), 1e-12);
  EXPECT_NEAR(wide.AxisSigmas().y(), 0.6 / std::sqrt(12), 1e-12);
  EXPECT_NEAR(wide.light.sum(), 1, 1e-12);
}

TEST(MeasuredPsf, RefusesWhatIsNone) {
  std::string why;
  EXPECT_TRUE(Square(9, 0.2).IsValid(&why)) << why;
  MeasuredPsf psf = Square(9, 0.2);
  psf.light.conservativeResize(9, 7);
  EXPECT_FALSE(psf.IsValid(&why));
  EXPECT_THAT(why, HasSubstr("must be square"));
  psf = Square(8, 0.2);
  EXPECT_FALSE(psf.IsValid(&why));
  EXPECT_THAT(why, HasSubstr("an odd number"));
  psf = Square(9, 0.2);
  psf.light(2, 3) = -0.01;
  EXPECT_FALSE(psf.IsValid(&why));
  EXPECT_THAT(why, HasSubstr("light in row 3, column 4 is -0.01"));
  psf.light(2, 3) = std::nan("");
  EXPECT_FALSE(psf.IsValid(&why));
  psf = Square(9, 0.2);
  psf.light *= 2;
  EXPECT_FALSE(psf.IsValid(&why));
  EXPECT_THAT(why, HasSubstr("sum"));
  psf = Square(9, 0.2);
  psf.light.leftCols(2) = 0;
  psf = Normalised(psf);
  EXPECT_FALSE(psf.IsValid(&why));
  EXPECT_THAT(why, HasSubstr("off-centre"));
  psf = Square(9, 0);
  EXPECT_FALSE(psf.IsValid(&why));
  psf = Square(9, 0.2);
  psf.sigma = Eigen::ArrayXXd::Zero(3, 3);
  EXPECT_FALSE(psf.IsValid(&why));
  psf.light.setZero();
  EXPECT_THAT(ErrorOf([&] { Normalised(psf); }), HasSubstr("a sum > 0 is expected"));
}

}  // namespace
}  // namespace thicklens::model
