#include <gtest/gtest.h>

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <random>
#include <set>
#include <vector>

#include "support/image_planes.h"
#include "thicklens/kernels/image_filter.h"

namespace thicklens::kernels {
namespace {

using ::thicklens::testing::ExpectOutsideUntouched;
using ::thicklens::testing::kUntouched;
using ::thicklens::testing::Planes;
using ::thicklens::testing::RandomPlanes;

std::size_t Index(std::int64_t i) { return static_cast<std::size_t>(i); }

template <typename Real>
class PixelBlockedCsrTest : public ::testing::Test {
 protected:
  // The tolerance is that of sums of some hundred numbers below 1.
  static constexpr double kTolerance = sizeof(Real) == sizeof(float) ? 5e-5 : 1e-13;
};
using Reals = ::testing::Types<float, double>;
TYPED_TEST_SUITE(PixelBlockedCsrTest, Reals);

// Two thirds of the pixels have rows, or only a few have. A row has 0 to 12 runs, which begin at
// most `reach` rows above or below their pixel, anywhere in the row. Some runs overlap.
template <typename Real>
PixelBlockedCsr<Real> RandomRuns(int width_px, int height_px, int reach, std::uint32_t seed,
                                 bool few = false) {
  PixelBlockedCsr<Real> runs;
  runs.width_px = width_px;
  runs.height_px = height_px;
  runs.run = {0};
  std::mt19937 random(seed);
  std::uniform_real_distribution<Real> value(-1, 1);
  for (int p = 0; p < width_px * height_px; ++p) {
    if (few ? random() % 1000 != 0 : random() % 3 == 0) continue;
    runs.pixel.push_back(p);
    for (auto count = random() % 13; count > 0; --count) {
      const int row = p / width_px - reach + static_cast<int>(random() % (2u * Index(reach) + 1));
      const int x = static_cast<int>(random() % static_cast<unsigned>(width_px));
      runs.index.push_back(std::clamp(row, 0, height_px - 1) * runs.stride_px() + x);
      for (int i = 0; i < kPixelsOfRun; ++i) {
        runs.weight.push_back(x + i < width_px ? value(random) : Real{0});
      }
    }
    runs.run.push_back(static_cast<std::int64_t>(runs.index.size()));
  }
  SetBands(&runs);
  return runs;
}

// Calls use(pixel, pixel that it reads, weight) for all entries.
template <typename Real, typename Use>
void ForWeights(const PixelBlockedCsr<Real>& runs, const Use& use) {
  for (std::size_t r = 0; r < runs.pixel.size(); ++r) {
    for (std::size_t n = Index(runs.run[r]); n < Index(runs.run[r + 1]); ++n) {
      const int x = runs.index[n] % runs.stride_px(), y = runs.index[n] / runs.stride_px();
      for (int i = 0; i < std::min(kPixelsOfRun, runs.width_px - x); ++i) {
        use(runs.pixel[r], y * runs.width_px + x + i,
            static_cast<double>(runs.weight[n * Index(kPixelsOfRun) + Index(i)]));
      }
    }
  }
}

TYPED_TEST(PixelBlockedCsrTest, RunsAreThePlainSum) {
  std::uint32_t seed = 100;
  for (const int width : {1, 5, 8, 63, 64, 130, 500}) {
    for (const int channels : {1, 2, 3, 4, 5, 7}) {
      const int pixels = 5 * width;
      const auto runs = RandomRuns<TypeParam>(width, 5, 2, ++seed, width > 130);
      const auto x = RandomPlanes<TypeParam>(pixels, 1, channels, ++seed);
      Planes<TypeParam> y(pixels, 1, channels, kUntouched);
      Planes<TypeParam> back = y;
      ApplyRuns(runs, x.in(), y.out(), 2);
      AddTransposed(runs, x.in(), back.out(), 2);
      for (int c = 0; c < channels; ++c) {
        std::vector<double> plain(Index(pixels), kUntouched), plain_back = plain;
        for (const std::int32_t pixel : runs.pixel) plain[Index(pixel)] = 0;
        ForWeights(runs, [&](int to, int from, double weight) {
          plain[Index(to)] += weight * static_cast<double>(x.at(c, from));
          plain_back[Index(from)] += weight * static_cast<double>(x.at(c, to));
        });
        for (int p = 0; p < pixels; ++p) {
          ASSERT_NEAR(y.at(c, p), plain[Index(p)], this->kTolerance)
              << width << " pixels wide, channel " << c << " of " << channels;
          // The sum is added to 1234, which costs it 4 digits.
          ASSERT_NEAR(back.at(c, p), plain_back[Index(p)], 100 * this->kTolerance);
        }
      }
      ExpectOutsideUntouched(y);
      ExpectOutsideUntouched(back);
    }
  }
}

TYPED_TEST(PixelBlockedCsrTest, EveryOtherBandReadsOtherPixels) {
  constexpr int kPixels = 300 * 300;
  const auto runs = RandomRuns<TypeParam>(300, 300, 5, 3);
  ASSERT_GE(runs.band.size(), 5u);
  EXPECT_EQ(runs.band.front(), 0u);
  EXPECT_EQ(runs.band.back(), runs.pixel.size());
  EXPECT_TRUE(std::is_sorted(runs.band.begin(), runs.band.end()));
  std::vector<std::size_t> band_of(kPixels);
  for (std::size_t band = 0; band + 1 < runs.band.size(); ++band) {
    for (std::size_t r = runs.band[band]; r < runs.band[band + 1]; ++r) {
      band_of[Index(runs.pixel[r])] = band;
    }
  }
  std::vector<std::set<std::size_t>> readers(kPixels);
  ForWeights(runs,
             [&](int to, int from, double) { readers[Index(from)].insert(band_of[Index(to)]); });
  for (const auto& bands : readers) {
    ASSERT_LE(bands.size(), 2u);
    if (!bands.empty()) {
      ASSERT_LE(*bands.rbegin() - *bands.begin(), 1u);
    }
  }
}

TYPED_TEST(PixelBlockedCsrTest, ReportsWhatIsRead) {
  for (const bool few : {false, true}) {
    const auto runs = RandomRuns<TypeParam>(500, 20, 3, 9, few);
    const int stride = runs.stride_px();
    std::vector<bool> is_read(Index(stride) * 20, false);
    std::int32_t end = 0;
    for (const auto& part : runs.read) {
      ASSERT_GE(part.first, end);
      ASSERT_GT(part.last, part.first);
      ASSERT_EQ(part.first / stride, (part.last - 1) / stride);
      std::fill(is_read.begin() + part.first, is_read.begin() + part.last, true);
      end = part.last;
    }
    for (const std::int32_t index : runs.index) {
      for (int i = 0; i < kPixelsOfRun; ++i) ASSERT_TRUE(is_read[Index(index + i)]);
    }
    const auto count = std::count(is_read.begin(), is_read.end(), true);
    if (few) {
      EXPECT_FALSE(runs.index.empty());
      EXPECT_LT(count, stride * 20 / 2);
    }
  }
}

TYPED_TEST(PixelBlockedCsrTest, FormsSayTheSame) {
  const auto runs = RandomRuns<TypeParam>(30, 10, 2, 5);
  const PixelCsr<TypeParam> rows = RowsOf(runs);
  Check(rows);
  const PixelBlockedCsr<TypeParam> again = RunsOf(rows, 30);
  const auto x = RandomPlanes<TypeParam>(300, 1, 2, 6);
  Planes<TypeParam> y(300, 1, 2, kUntouched), z = y;
  ApplyRuns(runs, x.in(), y.out(), 1);
  ApplyRuns(again, x.in(), z.out(), 1);
  for (std::size_t i = 0; i < y.values.size(); ++i) {
    ASSERT_NEAR(y.values[i], z.values[i], this->kTolerance);
  }
  // Consecutive entries share a run.
  EXPECT_LE(again.index.size(), runs.index.size());
}

TYPED_TEST(PixelBlockedCsrTest, NoRowsDoNothing) {
  PixelBlockedCsr<TypeParam> none;
  none.width_px = 13;
  none.height_px = 5;
  none.run = {0};
  SetBands(&none);
  const auto x = RandomPlanes<TypeParam>(65, 1, 3, 1);
  Planes<TypeParam> y(65, 1, 3, kUntouched);
  ApplyRuns(none, x.in(), y.out(), 2);
  AddTransposed(none, x.in(), y.out(), 2);
  EXPECT_EQ(y.values, std::vector<TypeParam>(y.values.size(), kUntouched));
}

template <typename Real>
std::vector<Real> AllResults(int threads) {
  constexpr int kPixels = 300 * 300;
  std::vector<Real> results;
  const auto x = RandomPlanes<Real>(kPixels, 1, 3, 11);
  const auto runs = RandomRuns<Real>(300, 300, 5, 13);
  for (const int channels : {1, 3}) {
    Planes<Real> y(kPixels, 1, channels, 1);
    ImageIn<Real> in = x.in();
    in.channels = channels;
    ApplyRuns(runs, in, y.out(), threads);
    AddTransposed(runs, in, y.out(), threads);
    results.insert(results.end(), y.values.begin(), y.values.end());
  }
  return results;
}

TYPED_TEST(PixelBlockedCsrTest, ThreadsDoNotChangeABit) {
  const std::vector<TypeParam> one = AllResults<TypeParam>(1);
  for (const int threads : {2, 3, 7}) {
    const std::vector<TypeParam> many = AllResults<TypeParam>(threads);
    ASSERT_EQ(many.size(), one.size());
    EXPECT_EQ(std::memcmp(many.data(), one.data(), one.size() * sizeof(TypeParam)), 0)
        << threads << " threads";
  }
}

}  // namespace
}  // namespace thicklens::kernels
