#include "thicklens/kernels/patch_filter.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <random>
#include <vector>

#include "kernels/cpu/patch_loops.h"
#include "kernels/cpu/processor.h"

namespace thicklens::kernels {
namespace {

constexpr int kEdge = 8;
constexpr double kPi = 3.14159265358979323846;

std::size_t Index(int i) { return static_cast<std::size_t>(i); }

double Cosine(int k, int j) {
  static const std::vector<double> table = [] {
    std::vector<double> values;
    for (int of = 0; of < kEdge; ++of) {
      for (int at = 0; at < kEdge; ++at) {
        values.push_back((of == 0 ? std::sqrt(1.0 / kEdge) : 0.5) *
                         std::cos((2 * at + 1) * of * kPi / (2 * kEdge)));
      }
    }
    return values;
  }();
  return table[Index(k * kEdge + j)];
}

// Filters patch by patch with the sums that define the filter.
std::vector<double> FilterPlane(int width, int height, const std::vector<double>& image,
                                double threshold) {
  std::vector<double> sum(image.size()), weights(image.size());
  for (int y = 0; y + kEdge <= height; ++y) {
    for (int x = 0; x + kEdge <= width; ++x) {
      double waves[kEdge][kEdge];
      int kept = 0;
      for (int k = 0; k < kEdge; ++k) {
        for (int l = 0; l < kEdge; ++l) {
          double wave = 0;
          for (int j = 0; j < kEdge; ++j) {
            for (int i = 0; i < kEdge; ++i) {
              wave += Cosine(k, j) * Cosine(l, i) * image[Index((y + j) * width + x + i)];
            }
          }
          const bool keep = (k == 0 && l == 0) || std::abs(wave) > threshold;
          waves[k][l] = keep ? wave : 0;
          kept += keep ? 1 : 0;
        }
      }
      for (int j = 0; j < kEdge; ++j) {
        for (int i = 0; i < kEdge; ++i) {
          double value = 0;
          for (int k = 0; k < kEdge; ++k) {
            for (int l = 0; l < kEdge; ++l) value += Cosine(k, j) * Cosine(l, i) * waves[k][l];
          }
          sum[Index((y + j) * width + x + i)] += value / kept;
          weights[Index((y + j) * width + x + i)] += 1.0 / kept;
        }
      }
    }
  }
  for (std::size_t i = 0; i < sum.size(); ++i) sum[i] /= weights[i];
  return sum;
}

// Makes noise around a mean, with an edge and a slope.
template <typename Real>
std::vector<Real> Sample(int width, int height, int channels, double sigma, unsigned seed) {
  std::mt19937 engine(seed);
  std::normal_distribution<double> noise(0, sigma);
  std::vector<Real> image;
  for (int channel = 0; channel < channels; ++channel) {
    for (int y = 0; y < height; ++y) {
      for (int x = 0; x < width; ++x) {
        const double scene = 0.3 + 0.1 * channel + (2 * x > width + y ? 0.2 : 0.0) + 0.001 * y;
        image.push_back(static_cast<Real>(scene + noise(engine)));
      }
    }
  }
  return image;
}

template <typename Real>
class PatchFilterTest : public ::testing::Test {
 protected:
  static constexpr double kTolerance = sizeof(Real) == sizeof(float) ? 1e-5 : 1e-12;
};
using Reals = ::testing::Types<float, double>;
TYPED_TEST_SUITE(PatchFilterTest, Reals);

TYPED_TEST(PatchFilterTest, DoesWhatDefinesIt) {
  struct Size {
    int width, height;
  };
  for (const Size size : {Size{8, 8}, Size{9, 20}, Size{71, 9}, Size{64, 12}, Size{130, 75}}) {
    const auto image = Sample<TypeParam>(size.width, size.height, 2, 0.02, 1);
    const auto found = FilterPatches(size.width, size.height, 2, image, 0.05, 2);
    const std::size_t pixels = Index(size.width * size.height);
    for (const std::size_t plane : {std::size_t{0}, pixels}) {
      const std::vector<double> from(image.begin() + static_cast<std::ptrdiff_t>(plane),
                                     image.begin() + static_cast<std::ptrdiff_t>(plane + pixels));
      const std::vector<double> right = FilterPlane(size.width, size.height, from, 0.05);
      double squares = 0;
      for (std::size_t i = 0; i < pixels; ++i) {
        // Rounding decides about a wave whose coefficient is close to the threshold, so a single
        // pixel may differ by more.
        const double error = static_cast<double>(found[plane + i]) - right[i];
        squares += error * error;
        ASSERT_NEAR(error, 0, sizeof(TypeParam) == sizeof(float) ? 2e-3 : 1e-12)
            << size.width << "x" << size.height << ", " << i;
      }
      EXPECT_LE(std::sqrt(squares / static_cast<double>(pixels)), this->kTolerance);
    }
  }
}

TYPED_TEST(PatchFilterTest, FiltersColoursAsASumAndDifferences) {
  constexpr int kWidth = 40, kHeight = 33;
  constexpr std::size_t kPixels = kWidth * kHeight;
  const auto image = Sample<TypeParam>(kWidth, kHeight, 3, 0.02, 2);
  const double rows[3][3] = {{1, 1, 1}, {1, 0, -1}, {1, -2, 1}};
  const double squares[3] = {3, 2, 6};
  std::vector<double> right(image.size());
  for (std::size_t row = 0; row < 3; ++row) {
    std::vector<double> mixed(kPixels);
    for (std::size_t i = 0; i < image.size(); ++i) {
      mixed[i % kPixels] +=
          rows[row][i / kPixels] / std::sqrt(squares[row]) * static_cast<double>(image[i]);
    }
    mixed = FilterPlane(kWidth, kHeight, mixed, 0.05);
    for (std::size_t i = 0; i < image.size(); ++i) {
      right[i] += rows[row][i / kPixels] / std::sqrt(squares[row]) * mixed[i % kPixels];
    }
  }
  const auto found = FilterPatches(kWidth, kHeight, 3, image, 0.05, 1);
  for (std::size_t i = 0; i < right.size(); ++i) {
    ASSERT_NEAR(found[i], right[i], sizeof(TypeParam) == sizeof(float) ? 2e-3 : 1e-12) << i;
  }
}

TYPED_TEST(PatchFilterTest, LeavesAConstantAndAWaveAsTheyAre) {
  constexpr int kWidth = 48, kHeight = 40;
  std::vector<TypeParam> constant(kWidth * kHeight, TypeParam(0.7)), wave;
  const auto flat = FilterPatches(kWidth, kHeight, 1, constant, 1e9, 1);
  for (const TypeParam value : flat) EXPECT_NEAR(value, 0.7, this->kTolerance);
  // In a wave of period 8, every coefficient of a patch is either 0 or far above the threshold.
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth; ++x) {
      wave.push_back(static_cast<TypeParam>(std::cos(kPi * (2 * x + 1) / kEdge)));
    }
  }
  const auto kept = FilterPatches(kWidth, kHeight, 1, wave, 0.02, 1);
  for (std::size_t i = 0; i < wave.size(); ++i) EXPECT_NEAR(kept[i], wave[i], 1e-3);
}

TYPED_TEST(PatchFilterTest, TakesNoiseOut) {
  constexpr int kWidth = 100, kHeight = 90;
  std::mt19937 engine(3);
  std::normal_distribution<double> normal(0, 0.01);
  std::vector<TypeParam> noise(kWidth * kHeight * 3);
  for (TypeParam& value : noise) value = static_cast<TypeParam>(normal(engine));
  const auto rms = [](const std::vector<TypeParam>& values) {
    double sum = 0;
    for (const TypeParam value : values) {
      sum += static_cast<double>(value) * static_cast<double>(value);
    }
    return std::sqrt(sum / static_cast<double>(values.size()));
  };
  // Only the mean is left of the 64 cosines of a patch, with 1/8 of the standard deviation of the
  // pixels, reduced further because patches overlap, and a few in a thousand of the other
  // coefficients.
  const double left = rms(FilterPatches(kWidth, kHeight, 3, noise, 0.03, 1));
  EXPECT_LT(left, 0.0016);
  EXPECT_GT(left, 0.0005);
  // A threshold of 0 leaves all noise.
  EXPECT_NEAR(rms(FilterPatches(kWidth, kHeight, 3, noise, 0.0, 1)), rms(noise), 1e-6);
}

TYPED_TEST(PatchFilterTest, LeavesImagesSmallerThanAPatch) {
  for (const int width : {7, 100}) {
    const auto image = Sample<TypeParam>(width, 107 - width, 3, 0.02, 4);
    EXPECT_EQ(FilterPatches(width, 107 - width, 3, image, 0.05, 2), image);
  }
}

TYPED_TEST(PatchFilterTest, DoesNotDependOnThreads) {
  const auto image = Sample<TypeParam>(90, 200, 3, 0.02, 5);
  const auto one = FilterPatches(90, 200, 3, image, 0.05, 1);
  for (const int threads : {2, 3, 8}) {
    EXPECT_EQ(FilterPatches(90, 200, 3, image, 0.05, threads), one) << threads;
  }
}

// Rows farther than 7 px have no influence, so that bands of an image fit together.
TYPED_TEST(PatchFilterTest, LooksNoFartherThanAPatch) {
  const auto image = Sample<TypeParam>(40, 60, 1, 0.02, 6);
  const std::vector<TypeParam> part(image.begin() + 40 * 20, image.end());
  const auto whole = FilterPatches(40, 60, 1, image, 0.05, 1);
  const auto of_part = FilterPatches(40, 40, 1, part, 0.05, 1);
  EXPECT_TRUE(std::equal(of_part.begin() + 40 * 7, of_part.end(), whole.begin() + 40 * 27));
  EXPECT_FALSE(std::equal(of_part.begin(), of_part.end(), whole.begin() + 40 * 20));
}

#if defined(__x86_64__)
TYPED_TEST(PatchFilterTest, LoopsForAllProcessorsAgree) {
  if (!HasAvx2AndFma()) GTEST_SKIP() << "this processor has one kind of loops";
  constexpr int kWidth = 70, kStride = 2 * kPatchChunkPx + 16;
  std::vector<TypeParam> from(kPatchPx * kStride);
  const auto image = Sample<TypeParam>(kWidth, kPatchPx, 1, 0.02, 7);
  for (int y = 0; y < kPatchPx; ++y) {
    std::copy_n(image.begin() + y * kWidth, kWidth, from.begin() + y * kStride);
  }
  std::vector<TypeParam> columns(from.size());
  // The threshold is 0, because rounding could otherwise decide whether a wave is kept.
  const auto filter = [&](const PatchLoops<TypeParam>& loops) {
    std::vector<TypeParam> sum(from.size()), weight(from.size());
    loops.filter_row({from.data(), columns.data(), kStride, kWidth - kPatchPx + 1, TypeParam(0),
                      sum.data(), weight.data()});
    sum.insert(sum.end(), weight.begin(), weight.end());
    return sum;
  };
  const auto plain = filter(PlainPatchLoops<TypeParam>());
  const auto fast = filter(Avx2PatchLoops<TypeParam>());
  for (std::size_t i = 0; i < plain.size(); ++i) ASSERT_NEAR(plain[i], fast[i], 1e-6) << i;
}
#endif

}  // namespace
}  // namespace thicklens::kernels
