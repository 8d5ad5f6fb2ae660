#include <gtest/gtest.h>

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <map>
#include <random>
#include <string>
#include <utility>
#include <vector>

#include "support/error_message.h"
#include "support/image_planes.h"
#include "thicklens/kernels/image_filter.h"

namespace thicklens::kernels {
namespace {

using ::thicklens::testing::ErrorOf;
using ::thicklens::testing::RandomPlanes;

std::size_t Index(std::int64_t i) { return static_cast<std::size_t>(i); }

template <typename Real>
class PixelCsrTest : public ::testing::Test {};
using Reals = ::testing::Types<float, double>;
TYPED_TEST_SUITE(PixelCsrTest, Reals);

// Makes rows with 0 to 40 entries, in which some pixels occur twice.
template <typename Real>
PixelCsr<Real> RandomRows(int pixels, std::uint32_t seed) {
  PixelCsr<Real> rows;
  rows.pixels = pixels;
  rows.start = {0};
  std::mt19937 random(seed);
  std::uniform_real_distribution<Real> value(-1, 1);
  for (int p = 0; p < pixels; ++p) {
    if (random() % 3 == 0) continue;
    rows.pixel.push_back(p);
    for (auto entries = random() % 41; entries > 0; --entries) {
      rows.index.push_back(static_cast<std::int32_t>(random() % static_cast<unsigned>(pixels)));
      rows.weight.push_back(value(random));
    }
    rows.start.push_back(static_cast<std::int64_t>(rows.index.size()));
  }
  return rows;
}

// Maps (row, column) to the values of that entry, in order.
template <typename Real>
std::map<std::pair<int, int>, std::vector<Real>> Entries(const PixelCsr<Real>& rows, bool swapped) {
  std::map<std::pair<int, int>, std::vector<Real>> entries;
  for (std::size_t r = 0; r < rows.pixel.size(); ++r) {
    for (std::size_t e = Index(rows.start[r]); e < Index(rows.start[r + 1]); ++e) {
      std::pair<int, int> at(rows.pixel[r], rows.index[e]);
      if (swapped) std::swap(at.first, at.second);
      entries[at].push_back(rows.weight[e]);
    }
  }
  return entries;
}

TYPED_TEST(PixelCsrTest, TransposedRowsAreTheTransposedMatrix) {
  const auto rows = RandomRows<TypeParam>(200, 5);
  const PixelCsr<TypeParam> transposed = Transposed(rows);
  Check(transposed);
  EXPECT_EQ(transposed.pixels, 200);
  EXPECT_EQ(Entries(transposed, true), Entries(rows, false));
  for (std::size_t r = 0; r < transposed.pixel.size(); ++r) {
    const auto first = transposed.index.begin() + transposed.start[r];
    const auto last = transposed.index.begin() + transposed.start[r + 1];
    EXPECT_NE(first, last) << "a row without entries";
    EXPECT_TRUE(std::is_sorted(first, last)) << "not in the order of the rows";
  }
  const PixelCsr<TypeParam> twice = Transposed(transposed);
  Check(twice);
  EXPECT_EQ(Entries(twice, false), Entries(rows, false));
  // Rows that are sorted stay identical if they are transposed twice.
  const PixelCsr<TypeParam> four_times = Transposed(Transposed(twice));
  EXPECT_EQ(four_times.pixel, twice.pixel);
  EXPECT_EQ(four_times.start, twice.start);
  EXPECT_EQ(four_times.index, twice.index);
  EXPECT_EQ(four_times.weight, twice.weight);
}

TYPED_TEST(PixelCsrTest, NoRowsAreNoneTransposed) {
  PixelCsr<TypeParam> none;
  none.pixels = 65;
  none.start = {0};
  Check(none);
  const PixelCsr<TypeParam> transposed = Transposed(none);
  Check(transposed);
  EXPECT_TRUE(transposed.pixel.empty());
}

TYPED_TEST(PixelCsrTest, DotIsThePlainSum) {
  std::mt19937 random(3);
  std::uniform_real_distribution<TypeParam> value(-1, 1);
  for (const std::size_t count : {0u, 1u, 7u, 33u, 4095u, 4096u, 4097u, 20001u}) {
    std::vector<TypeParam> x(count), y(count), w(count);
    for (auto* numbers : {&x, &y, &w}) {
      for (TypeParam& number : *numbers) number = value(random);
    }
    long double plain = 0, weighted = 0;
    for (std::size_t i = 0; i < count; ++i) {
      plain += static_cast<long double>(x[i]) * static_cast<long double>(y[i]);
      weighted += static_cast<long double>(x[i]) * static_cast<long double>(y[i]) *
                  static_cast<long double>(w[i]);
    }
    // Sums are computed in double, for float as well.
    EXPECT_NEAR(Dot<TypeParam>(x.data(), y.data(), nullptr, count, 2), static_cast<double>(plain),
                1e-15 * static_cast<double>(count));
    EXPECT_NEAR(Dot(x.data(), y.data(), w.data(), count, 2), static_cast<double>(weighted),
                1e-15 * static_cast<double>(count));
  }
}

TYPED_TEST(PixelCsrTest, ThreadsDoNotChangeADot) {
  const auto x = RandomPlanes<TypeParam>(300001, 1, 1, 3);
  const auto dot = [&](int threads) {
    return Dot(x.values.data(), x.values.data(), x.values.data(), 300001, threads);
  };
  for (const int threads : {2, 3, 7}) {
    EXPECT_EQ(dot(threads), dot(1)) << threads << " threads";
  }
}

template <typename Change>
std::string RowsError(const Change& change) {
  PixelCsr<double> rows{5, {1, 4}, {0, 2, 3}, {0, 4, 2}, {1, 2, 3}};
  change(&rows);
  return ErrorOf([&] { Check(rows); });
}

TEST(PixelCsrCheckTest, WrongRowsAreNamed) {
  using Rows = PixelCsr<double>;
  EXPECT_EQ(RowsError([](Rows*) {}), "(no error)");
  EXPECT_EQ(RowsError([](Rows* r) { r->pixels = -1; }), "rows: pixels is -1: it must be >= 0");
  EXPECT_EQ(RowsError([](Rows* r) { r->pixel[1] = 1; }),
            "rows: pixel: 1 follows 1: the list must ascend from 0 to at most 4");
  EXPECT_EQ(RowsError([](Rows* r) { r->pixel[0] = -1; }),
            "rows: pixel: -1 follows -1: the list must ascend from 0 to at most 4");
  EXPECT_EQ(RowsError([](Rows* r) { r->pixel[1] = 5; }),
            "rows: pixel: 5 follows 1: the list must ascend from 0 to at most 4");
  EXPECT_EQ(RowsError([](Rows* r) { r->start.pop_back(); }),
            "rows: start has 2 elements: it must have 3");
  EXPECT_EQ(RowsError([](Rows* r) { r->start[0] = 1; }),
            "rows: start begins with 1: it must begin with 0");
  EXPECT_EQ(RowsError([](Rows* r) { r->start[1] = -1; }),
            "rows: start of row 1 is -1: it must be at least the previous start, 0");
  EXPECT_EQ(RowsError([](Rows* r) { r->index.pop_back(); }),
            "rows: index has 2 elements: it must have 3");
  EXPECT_EQ(RowsError([](Rows* r) { r->weight.pop_back(); }),
            "rows: weight has 2 elements: it must have 3");
  EXPECT_EQ(RowsError([](Rows* r) { r->index[1] = 5; }),
            "rows: index of entry 1 is 5: it must be 0 to 4");
  EXPECT_EQ(RowsError([](Rows* r) { r->index[0] = -1; }),
            "rows: index of entry 0 is -1: it must be 0 to 4");
  EXPECT_EQ(RowsError([](Rows* r) { r->weight[2] = std::numeric_limits<double>::infinity(); }),
            "rows: weight of entry 2 is inf: it must be finite");
}

}  // namespace
}  // namespace thicklens::kernels
