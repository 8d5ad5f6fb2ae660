#if defined(__x86_64__)
#include "filter_loops.h"

#include <gtest/gtest.h>

#include <cstddef>
#include <cstdint>
#include <random>
#include <vector>

#include "support/picture_planes.h"

namespace thicklens::kernels {
namespace {

using ::thicklens::testing::kUntouched;
using ::thicklens::testing::Planes;
using ::thicklens::testing::RandomPlanes;

// Whatever this processor chooses, the loops for the others are tested as well: these and the
// fastest must agree. What is right is tested with the fastest.
template <typename Real>
class FilterLoopsTest : public ::testing::Test {
 protected:
  void SetUp() override {
    if (!HasAvx2()) GTEST_SKIP() << "this processor has one kind of loops";
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

TYPED_TEST(FilterLoopsTest, SumsOfRowEntriesAgree) {
  const auto plain = PlainFilterLoops<TypeParam>(), fast = Avx2FilterLoops<TypeParam>();
  const auto x = RandomPlanes<TypeParam>(200, 1, 3, 1);
  std::vector<std::int32_t> pixels, indices;
  std::vector<std::int64_t> start = {0};
  std::mt19937 random(4);
  for (int p = 0; p < 200; ++p) {
    pixels.push_back(p);
    for (auto entries = random() % 14; entries > 0; --entries) {
      indices.push_back(static_cast<std::int32_t>(random() % 200));
    }
    start.push_back(static_cast<std::int64_t>(indices.size()));
  }
  const auto weights = RandomPlanes<TypeParam>(static_cast<int>(indices.size()), 1, 1, 5);
  const RowRange<TypeParam> rows{
      pixels.data(), start.data(), indices.data(), weights.values.data(), 0, pixels.size()};
  std::vector<TypeParam> x_plain(800), x_fast(800);
  plain.interleave(x.values.data(), x.stride, 3, 200, x_plain.data());
  fast.interleave(x.values.data(), x.stride, 3, 200, x_fast.data());
  EXPECT_EQ(x_plain, x_fast);
  for (const bool add : {false, true}) {
    Planes<TypeParam> y(200, 1, 3, 1), z = y, one_by_one = y;
    plain.sum_row_entries_of_4(rows, x_plain.data(), add, 3, y.values.data(), y.stride);
    fast.sum_row_entries_of_4(rows, x_fast.data(), add, 3, z.values.data(), z.stride);
    plain.sum_row_entries(rows, x.values.data(), add, one_by_one.values.data());
    fast.sum_row_entries(rows, x.values.data() + x.stride, add,
                         one_by_one.values.data() + x.stride);
    for (int p = 0; p < 200; ++p) {
      for (int c = 0; c < 3; ++c) EXPECT_NEAR(y.at(c, p), z.at(c, p), this->kTolerance);
      for (int c = 0; c < 2; ++c) EXPECT_NEAR(y.at(c, p), one_by_one.at(c, p), this->kTolerance);
    }
  }
}

}  // namespace
}  // namespace thicklens::kernels
#endif
