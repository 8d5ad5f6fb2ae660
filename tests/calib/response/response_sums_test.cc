#include "calib/response/response_sums.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

namespace thicklens::calib {
namespace {

TEST(ResponseSums, OfExactValuesIsTheSlopeWithoutError) {
  ResponseSums sums;
  for (int part = 0; part < 6; ++part) {
    for (std::size_t frame = 0; frame < 5; ++frame) {
      const double square = 1 + part + 2 * static_cast<double>(frame);
      sums.Add(part, frame, 0.3 * square, square);
    }
  }
  const auto slope = sums.Slope();
  ASSERT_TRUE(slope);
  EXPECT_NEAR(slope->value, 0.3, 1e-12);
  EXPECT_NEAR(slope->sigma, 0, 1e-9);
}

TEST(ResponseSums, TooFewPartsOrFramesGiveNothing) {
  ResponseSums parts, frames;
  for (int i = 0; i < 20; ++i) {
    parts.Add(i % 3, static_cast<std::size_t>(i), 1, 1);
    frames.Add(i, static_cast<std::size_t>(i % 2), 1, 1);
  }
  EXPECT_FALSE(parts.Slope());
  EXPECT_FALSE(frames.Slope());
  EXPECT_FALSE(ResponseSums().Slope());
}

// Errors that all frames share in a part, and errors that all parts share in a frame.
TEST(ResponseSums, SigmaIsTheScatterOfRepeats) {
  std::mt19937_64 engine(7);
  std::normal_distribution<double> normal;
  double squares = 0, stated = 0;
  constexpr int kRepeats = 400;
  for (int repeat = 0; repeat < kRepeats; ++repeat) {
    ResponseSums sums;
    double of_part[16], of_frame[10];
    for (double& error : of_part) error = 0.1 * normal(engine);
    for (double& error : of_frame) error = 0.1 * normal(engine);
    for (int part = 0; part < 16; ++part) {
      for (std::size_t frame = 0; frame < 10; ++frame)
        sums.Add(part, frame, 0.5 + of_part[part] + of_frame[frame], 1);
    }
    const auto slope = sums.Slope();
    ASSERT_TRUE(slope);
    squares += std::pow(slope->value - 0.5, 2) / kRepeats;
    stated += slope->sigma * slope->sigma / kRepeats;
  }
  EXPECT_NEAR(std::sqrt(stated / squares), 1, 0.1);
}

}  // namespace
}  // namespace thicklens::calib
