#include "thicklens/calib/camera_response.h"

#include <gtest/gtest.h>

namespace thicklens::calib {
namespace {

TEST(CameraResponse, NothingMeasuredIsNoFinding) {
  const CameraResponse response;
  EXPECT_FALSE(response.ContradictsTransfer() || response.LosesWeakDetail() ||
               response.IsSharpened() || response.IsCompressed());
}

// A finding needs both significance and a size that matters.
TEST(CameraResponse, AFindingIsSignificantAndLarge) {
  CameraResponse response;
  response.light_exponent = model::Estimate{1.1, 0.001};
  EXPECT_FALSE(response.ContradictsTransfer());
  response.light_exponent = model::Estimate{2.2, 0.5};
  EXPECT_FALSE(response.ContradictsTransfer());
  response.light_exponent = model::Estimate{2.2, 0.05};
  EXPECT_TRUE(response.ContradictsTransfer());
  response.light_exponent = model::Estimate{0.45, 0.01};
  EXPECT_TRUE(response.ContradictsTransfer());
  response.light_exponent = model::Estimate{-1, 0.01};
  EXPECT_FALSE(response.ContradictsTransfer());

  response.weak_detail_loss = model::Estimate{0.05, 0.02};
  EXPECT_FALSE(response.LosesWeakDetail());
  response.weak_detail_loss = model::Estimate{0.05, 0.01};
  EXPECT_TRUE(response.LosesWeakDetail());
  response.weak_detail_loss = model::Estimate{-0.05, 0.001};
  EXPECT_FALSE(response.LosesWeakDetail());

  response.noise_rise = model::Estimate{0.1, 0.001};
  EXPECT_FALSE(response.IsSharpened());
  response.noise_rise = model::Estimate{1, 0.05};
  EXPECT_TRUE(response.IsSharpened());
  response.block_grid = model::Estimate{2, 0.05};
  EXPECT_TRUE(response.IsCompressed());
}

}  // namespace
}  // namespace thicklens::calib
