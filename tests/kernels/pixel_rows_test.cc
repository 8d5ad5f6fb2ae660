#include <gtest/gtest.h>

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <limits>
#include <map>
#include <random>
#include <string>
#include <utility>
#include <vector>

#include "support/error_message.h"
#include "support/picture_planes.h"
#include "thicklens/kernels/picture_filter.h"

namespace thicklens::kernels {
namespace {

using ::thicklens::testing::ErrorOf;
using ::thicklens::testing::ExpectOutsideUntouched;
using ::thicklens::testing::kUntouched;
using ::thicklens::testing::Planes;
using ::thicklens::testing::RandomPlanes;

std::size_t Index(std::int64_t i) { return static_cast<std::size_t>(i); }

template <typename Real>
class PixelRowsTest : public ::testing::Test {
 protected:
  // Of sums of some ten numbers below 1.
  static constexpr double kTolerance = sizeof(Real) == sizeof(float) ? 5e-6 : 1e-14;
};
using Reals = ::testing::Types<float, double>;
TYPED_TEST_SUITE(PixelRowsTest, Reals);

// Rows with 0 to 40 entries, some pixels twice.
template <typename Real>
PixelRows<Real> RandomRows(int pixels, std::uint32_t seed) {
  PixelRows<Real> rows;
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

TYPED_TEST(PixelRowsTest, RowsAreThePlainSum) {
  std::uint32_t seed = 100;
  for (const int pixels : {1, 5, 63, 64, 650}) {
    for (const int channels : {1, 2, 3, 4, 5, 7}) {
      const auto rows = RandomRows<TypeParam>(pixels, ++seed);
      Check(rows);
      const auto x = RandomPlanes<TypeParam>(pixels, 1, channels, ++seed);
      Planes<TypeParam> set(pixels, 1, channels, kUntouched);
      Planes<TypeParam> added = set;
      ApplyRows(rows, x.in(), set.out(), 2);
      AddRows(rows, x.in(), added.out(), 2);
      for (int c = 0; c < channels; ++c) {
        std::vector<double> plain(Index(x.pixels()), kUntouched), plain_added = plain;
        for (std::size_t r = 0; r < rows.pixel.size(); ++r) {
          double sum = 0;
          for (std::size_t e = Index(rows.start[r]); e < Index(rows.start[r + 1]); ++e) {
            sum +=
                static_cast<double>(rows.weight[e]) * static_cast<double>(x.at(c, rows.index[e]));
          }
          plain[Index(rows.pixel[r])] = sum;
          plain_added[Index(rows.pixel[r])] += sum;
        }
        for (int p = 0; p < x.pixels(); ++p) {
          ASSERT_NEAR(set.at(c, p), plain[Index(p)], this->kTolerance)
              << pixels << " pixels"
              << ", channel " << c << " of " << channels;
          // Beside 1234 there are 4 digits less.
          ASSERT_NEAR(added.at(c, p), plain_added[Index(p)], 100 * this->kTolerance);
        }
      }
      ExpectOutsideUntouched(set);
      ExpectOutsideUntouched(added);
    }
  }
}

// (row, column) -> values of that entry, in order.
template <typename Real>
std::map<std::pair<int, int>, std::vector<Real>> Entries(const PixelRows<Real>& rows,
                                                         bool swapped) {
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

TYPED_TEST(PixelRowsTest, TransposedRowsAreTheTransposedMatrix) {
  const auto rows = RandomRows<TypeParam>(200, 5);
  const PixelRows<TypeParam> transposed = Transposed(rows);
  Check(transposed);
  EXPECT_EQ(transposed.pixels, 200);
  EXPECT_EQ(Entries(transposed, true), Entries(rows, false));
  for (std::size_t r = 0; r < transposed.pixel.size(); ++r) {
    const auto first = transposed.index.begin() + transposed.start[r];
    const auto last = transposed.index.begin() + transposed.start[r + 1];
    EXPECT_NE(first, last) << "a row without entries";
    EXPECT_TRUE(std::is_sorted(first, last)) << "not in the order of the rows";
  }
  const PixelRows<TypeParam> twice = Transposed(transposed);
  Check(twice);
  EXPECT_EQ(Entries(twice, false), Entries(rows, false));
  // Sorted once, rows come back number by number.
  const PixelRows<TypeParam> four_times = Transposed(Transposed(twice));
  EXPECT_EQ(four_times.pixel, twice.pixel);
  EXPECT_EQ(four_times.start, twice.start);
  EXPECT_EQ(four_times.index, twice.index);
  EXPECT_EQ(four_times.weight, twice.weight);
}

TYPED_TEST(PixelRowsTest, NoRowsDoNothing) {
  PixelRows<TypeParam> none;
  none.pixels = 65;
  none.start = {0};
  Check(none);
  const PixelRows<TypeParam> transposed = Transposed(none);
  Check(transposed);
  EXPECT_TRUE(transposed.pixel.empty());
  const auto x = RandomPlanes<TypeParam>(65, 1, 3, 1);
  Planes<TypeParam> y(65, 1, 3, kUntouched);
  ApplyRows(none, x.in(), y.out(), 2);
  AddRows(transposed, x.in(), y.out(), 2);
  EXPECT_EQ(y.values, std::vector<TypeParam>(y.values.size(), kUntouched));
}

TYPED_TEST(PixelRowsTest, DotIsThePlainSum) {
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
    // In double, for float, too.
    EXPECT_NEAR(Dot<TypeParam>(x.data(), y.data(), nullptr, count, 2), static_cast<double>(plain),
                1e-15 * static_cast<double>(count));
    EXPECT_NEAR(Dot(x.data(), y.data(), w.data(), count, 2), static_cast<double>(weighted),
                1e-15 * static_cast<double>(count));
  }
}

template <typename Real>
std::vector<Real> AllResults(int threads) {
  constexpr int kPixels = 150000;
  std::vector<Real> results;
  const auto x = RandomPlanes<Real>(kPixels, 1, 3, 11);
  const auto rows = RandomRows<Real>(kPixels, 13);
  for (const int channels : {1, 3}) {
    Planes<Real> y(kPixels, 1, channels, 1);
    PictureIn<Real> in = x.in();
    in.channels = channels;
    ApplyRows(rows, in, y.out(), threads);
    AddRows(rows, in, y.out(), threads);
    results.insert(results.end(), y.values.begin(), y.values.end());
  }
  return results;
}

TYPED_TEST(PixelRowsTest, ThreadsDoNotChangeABit) {
  const std::vector<TypeParam> one = AllResults<TypeParam>(1);
  const auto x = RandomPlanes<TypeParam>(300001, 1, 1, 3);
  const auto dot = [&](int threads) {
    return Dot(x.values.data(), x.values.data(), x.values.data(), 300001, threads);
  };
  for (const int threads : {2, 3, 7}) {
    const std::vector<TypeParam> many = AllResults<TypeParam>(threads);
    ASSERT_EQ(many.size(), one.size());
    EXPECT_EQ(std::memcmp(many.data(), one.data(), one.size() * sizeof(TypeParam)), 0)
        << threads << " threads";
    EXPECT_EQ(dot(threads), dot(1)) << threads << " threads";
  }
}

template <typename Change>
std::string RowsError(const Change& change) {
  PixelRows<double> rows{5, {1, 4}, {0, 2, 3}, {0, 4, 2}, {1, 2, 3}};
  change(&rows);
  return ErrorOf([&] { Check(rows); });
}

TEST(PixelRowsCheckTest, WrongRowsAreNamed) {
  using Rows = PixelRows<double>;
  EXPECT_EQ(RowsError([](Rows*) {}), "(no error)");
  EXPECT_EQ(RowsError([](Rows* r) { r->pixels = -1; }), "rows: pixels is -1: it must be >= 0");
  EXPECT_EQ(RowsError([](Rows* r) { r->pixel[1] = 1; }),
            "rows: pixel has 1 after 1: it must ascend from 0 to at most 4");
  EXPECT_EQ(RowsError([](Rows* r) { r->pixel[0] = -1; }),
            "rows: pixel has -1 after -1: it must ascend from 0 to at most 4");
  EXPECT_EQ(RowsError([](Rows* r) { r->pixel[1] = 5; }),
            "rows: pixel has 5 after 1: it must ascend from 0 to at most 4");
  EXPECT_EQ(RowsError([](Rows* r) { r->start.pop_back(); }),
            "rows: start has 2 elements: it must have 3");
  EXPECT_EQ(RowsError([](Rows* r) { r->start[0] = 1; }),
            "rows: start begins with 1: it must begin with 0");
  EXPECT_EQ(RowsError([](Rows* r) { r->start[1] = -1; }),
            "rows: start of row 1 is -1: it must be at least the one before, 0");
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
