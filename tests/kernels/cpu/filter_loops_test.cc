#if defined(__x86_64__)
#include "kernels/cpu/filter_loops.h"

#include <gtest/gtest.h>

#include <cstddef>
#include <cstdint>
#include <random>
#include <vector>

#include "kernels/cpu/processor.h"
#include "support/image_planes.h"

namespace thicklens::kernels {
namespace {

using ::thicklens::testing::kUntouched;
using ::thicklens::testing::Planes;
using ::thicklens::testing::RandomPlanes;

// The loops for all processors are tested, not only those that this processor selects: they must
// agree with the fastest ones, whose results are compared with the reference.
template <typename Real>
class FilterLoopsTest : public ::testing::Test {
 protected:
  void SetUp() override {
    if (!HasAvx2AndFma()) GTEST_SKIP() << "this processor has one kind of loops";
  }
  static constexpr double kTolerance = sizeof(Real) == sizeof(float) ? 5e-6 : 1e-14;
};
using Reals = ::testing::Types<float, double>;
TYPED_TEST_SUITE(FilterLoopsTest, Reals);

TYPED_TEST(FilterLoopsTest, SumsOfTermsAgree) {
  const auto plain = PlainFilterLoops<TypeParam>(), fast = Avx2FilterLoops<TypeParam>();
  const auto x = RandomPlanes<TypeParam>(200, 1, 4, 1);
  const auto weights = RandomPlanes<TypeParam>(200, 5, 1, 2);
  std::vector<FilterTerm<TypeParam>> terms;
  for (int k = 0; k < 5; ++k) {
    terms.push_back({weights.values.data() + 200 * k, x.values.data() + k});
  }
  for (int count = 0; count < 150; ++count) {
    for (int channels = 1; channels <= 4; ++channels) {
      Planes<TypeParam> y(200, 1, channels, kUntouched), z = y;
      plain.sum_terms(terms.data(), 5, 64, x.stride, channels, count, y.values.data(), y.stride);
      fast.sum_terms(terms.data(), 5, 64, x.stride, channels, count, z.values.data(), z.stride);
      for (std::size_t i = 0; i < y.values.size(); ++i) {
        ASSERT_NEAR(y.values[i], z.values[i], this->kTolerance) << count << ", " << i;
      }
    }
  }
}

TYPED_TEST(FilterLoopsTest, DotsAgree) {
  const auto plain = PlainFilterLoops<TypeParam>(), fast = Avx2FilterLoops<TypeParam>();
  const auto numbers = RandomPlanes<TypeParam>(150, 1, 3, 1);
  const TypeParam* x = numbers.values.data();
  const TypeParam* y = x + numbers.stride;
  const TypeParam* w = y + numbers.stride;
  for (std::size_t count = 0; count < 150; ++count) {
    EXPECT_NEAR(plain.dot(x, y, nullptr, count), fast.dot(x, y, nullptr, count), 1e-14);
    EXPECT_NEAR(plain.dot(x, y, w, count), fast.dot(x, y, w, count), 1e-14);
  }
}

TYPED_TEST(FilterLoopsTest, RunsAgree) {
  const auto plain = PlainFilterLoops<TypeParam>(), fast = Avx2FilterLoops<TypeParam>();
  constexpr int kPixels = 200;
  std::vector<std::int32_t> pixels, indices;
  std::vector<std::int64_t> run = {0};
  std::mt19937 random(4);
  for (int p = 0; p < kPixels; ++p) {
    pixels.push_back(p);
    for (auto runs = random() % 4; runs > 0; --runs) {
      indices.push_back(static_cast<std::int32_t>(random() % (kPixels - kPixelsOfRun + 1)));
    }
    run.push_back(static_cast<std::int64_t>(indices.size()));
  }
  const auto weights =
      RandomPlanes<TypeParam>(kPixelsOfRun * static_cast<int>(indices.size()), 1, 1, 5);
  const RunRange<TypeParam> rows{pixels.data(),         run.data(), indices.data(),
                                 weights.values.data(), 0,          kPixels};
  for (int channels = 1; channels <= 4; ++channels) {
    const auto x = RandomPlanes<TypeParam>(kPixels, 1, channels, 1);
    Planes<TypeParam> y(kPixels, 1, channels, kUntouched), z = y;
    plain.sum_runs(rows, x.values.data(), x.stride, channels, y.values.data(), y.stride);
    fast.sum_runs(rows, x.values.data(), x.stride, channels, z.values.data(), z.stride);
    for (std::size_t i = 0; i < y.values.size(); ++i) {
      ASSERT_NEAR(y.values[i], z.values[i], 4 * this->kTolerance) << i;
    }
    Planes<TypeParam> back(kPixels, 1, channels, 1), other = back;
    plain.spread_runs(rows, x.values.data(), x.stride, channels, back.values.data(), back.stride);
    fast.spread_runs(rows, x.values.data(), x.stride, channels, other.values.data(), other.stride);
    for (std::size_t i = 0; i < back.values.size(); ++i) {
      ASSERT_NEAR(back.values[i], other.values[i], 4 * this->kTolerance) << i;
    }
  }
}

}  // namespace
}  // namespace thicklens::kernels
#endif
