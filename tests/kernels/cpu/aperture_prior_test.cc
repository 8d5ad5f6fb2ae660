#include "thicklens/kernels/aperture_prior.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <random>
#include <vector>

#include "support/difference_matrix.h"
#include "support/error_message.h"

namespace thicklens::kernels {
namespace {

using ::testing::HasSubstr;
using thicklens::testing::DifferenceMatrix;
using thicklens::testing::ErrorOf;

constexpr std::size_t kPoints = 5 * AperturePrior<float>::kPacket;
constexpr std::size_t kStride = kPoints + 2 * AperturePrior<float>::kPacket;

std::vector<float> RandomPlanes(int views) {
  std::mt19937 engine(4);
  std::uniform_real_distribution<float> uniform(-1, 1);
  std::vector<float> planes(static_cast<std::size_t>(views) * kStride);
  for (float& value : planes) value = uniform(engine);
  return planes;
}

void ExpectInverse(int u_count, int v_count, double gamma, double mu) {
  const int views = u_count * v_count;
  const Eigen::MatrixXd d = DifferenceMatrix(u_count, v_count);
  const Eigen::MatrixXd inverse =
      (gamma * d.transpose() * d + mu * Eigen::MatrixXd::Identity(views, views)).inverse();
  const std::vector<float> before = RandomPlanes(views);
  std::vector<float> after = before;
  AperturePrior<float>(u_count, v_count, gamma, mu).ApplyInverse(kPoints, kStride, 1, after.data());
  for (std::size_t point = 0; point < kStride; ++point) {
    Eigen::VectorXd x(views);
    for (int k = 0; k < views; ++k) x[k] = before[static_cast<std::size_t>(k) * kStride + point];
    const Eigen::VectorXd expected = point < kPoints ? Eigen::VectorXd(inverse * x) : x;
    for (int k = 0; k < views; ++k) {
      ASSERT_NEAR(after[static_cast<std::size_t>(k) * kStride + point], expected[k],
                  3e-6 * inverse.norm())
          << u_count << "x" << v_count << ", view " << k << ", point " << point;
    }
  }
}

TEST(AperturePrior, IsTheInverseOfItsMatrix) {
  for (const int count : {2, 3, 5, 7, 9, 11, 12}) ExpectInverse(count, count, 0.7, 0.03);
  ExpectInverse(4, 3, 0.7, 0.03);
  ExpectInverse(3, 6, 0.7, 0.03);
  ExpectInverse(1, 5, 0.7, 0.03);
  ExpectInverse(7, 1, 0.7, 0.03);
}

TEST(AperturePrior, IsTheInverseForWeakAndStrongSmoothness) {
  ExpectInverse(7, 7, 1e-6, 0.5);
  ExpectInverse(7, 7, 1e6, 0.5);
  ExpectInverse(5, 3, 0, 0.5);
}

TEST(AperturePrior, SameBitsOnAnyNumberOfThreads) {
  constexpr std::size_t kMany = 1000 * AperturePrior<float>::kPacket;
  std::mt19937 engine(4);
  std::uniform_real_distribution<float> uniform(-1, 1);
  std::vector<float> planes(15 * kMany);
  for (float& value : planes) value = uniform(engine);
  std::vector<float> expected = planes;
  AperturePrior<float>(5, 3, 1, 0.1).ApplyInverse(kMany, kMany, 1, expected.data());
  for (const int threads : {2, 3}) {
    std::vector<float> found = planes;
    AperturePrior<float>(5, 3, 1, 0.1).ApplyInverse(kMany, kMany, threads, found.data());
    EXPECT_EQ(found, expected);
  }
}

TEST(AperturePrior, RefusesMoreSamplesThanItHasRoomFor) {
  EXPECT_THAT(ErrorOf([] { AperturePrior<float>(65, 1, 1, 1); }), HasSubstr("65x1"));
  EXPECT_EQ(ErrorOf([] { AperturePrior<float>(64, 1, 1, 1); }), "(no error)");
}

}  // namespace
}  // namespace thicklens::kernels
