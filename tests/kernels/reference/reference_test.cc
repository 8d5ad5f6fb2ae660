#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <limits>
#include <map>
#include <memory>
#include <vector>

#include "support/error_message.h"
#include "support/kernel_samples.h"
#include "thicklens/kernels/kernels.h"

namespace thicklens::kernels {
namespace {

using ::thicklens::testing::BlockSize;
using ::thicklens::testing::Dense;
using ::thicklens::testing::DenseOf;
using ::thicklens::testing::ErrorOf;
using ::thicklens::testing::RandomBlock;
using ::thicklens::testing::RandomCsr;
using ::thicklens::testing::RandomReals;
using Vector = Eigen::VectorXd;
using Matrix = Eigen::MatrixXd;

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

std::size_t Index(int i) { return static_cast<std::size_t>(i); }

// Samples of a light field as (s, t, k, l), which is how rays are known before a block numbers
// them.
using Sample = std::array<int, 4>;

// Returns the samples that land nearest to a pixel of the block, with their numbers, computed only
// from where they land.
std::map<Sample, int> SamplesOf(const BlockGeometry& block) {
  std::map<Sample, int> samples;
  for (int l = 0; l < block.v_count; ++l) {
    for (int k = 0; k < block.u_count; ++k) {
      for (int t = 0; t < block.t_count; ++t) {
        for (int s = 0; s < block.s_count; ++s) {
          const double x = s + block.s_shift[Index(k)] + block.s_fraction[Index(k)];
          const double y = t + block.t_shift[Index(l)] + block.t_fraction[Index(l)];
          const int pixel_x = static_cast<int>(std::floor(x + 0.5)) - block.first_x;
          const int pixel_y = static_cast<int>(std::floor(y + 0.5)) - block.first_y;
          if (pixel_x < 0 || pixel_x >= block.width_px) continue;
          if (pixel_y < 0 || pixel_y >= block.height_px) continue;
          samples[{s, t, k, l}] =
              ((l * block.u_count + k) * block.height_px + pixel_y) * block.width_px + pixel_x;
        }
      }
    }
  }
  return samples;
}

// The unit impulse at a distance, on one axis.
double Impulse(Splat splat, double distance) {
  if (splat == Splat::kBilinear) return std::max(0.0, 1 - std::abs(distance));
  return std::floor(distance + 0.5) == 0 ? 1 : 0;
}

// H from every sample to every pixel, computed from positions.
Matrix NaiveProjection(const BlockGeometry& block, Splat splat, const std::vector<double>& e) {
  Matrix h = Matrix::Zero(block.pixels(), block.rays());
  for (const auto& [sample, ray] : SamplesOf(block)) {
    const auto [s, t, k, l] = sample;
    const double x = s + block.s_shift[Index(k)] + block.s_fraction[Index(k)] - block.first_x;
    const double y = t + block.t_shift[Index(l)] + block.t_fraction[Index(l)] - block.first_y;
    for (int pixel = 0; pixel < block.pixels(); ++pixel) {
      h(pixel, ray) = block.view_weight[Index(l * block.u_count + k)] *
                      Impulse(splat, x - pixel % block.width_px) *
                      Impulse(splat, y - pixel / block.width_px);
    }
  }
  for (int pixel = 0; pixel < block.pixels(); ++pixel) {
    const double sum = h.row(pixel).sum();
    if (sum > 0) h.row(pixel) /= sum;
  }
  for (int ray = 0; !e.empty() && ray < block.rays(); ++ray) h.col(ray) *= e[Index(ray)];
  return h;
}

// Returns the light field's values at a block's rays, and 0 for rays that do not exist.
Vector RaysOf(const BlockGeometry& block,
              const std::function<double(int s, int t, int k, int l)>& light_field) {
  Vector rays = Vector::Zero(block.rays());
  for (const auto& [sample, ray] : SamplesOf(block)) {
    rays(ray) = light_field(sample[0], sample[1], sample[2], sample[3]);
  }
  return rays;
}

// The blocks are inside, at corners, half outside, or wider than the light field. Some have 1 view
// or 1 pixel.
const std::vector<BlockSize>& BlockSizes() {
  static const std::vector<BlockSize> sizes = {
      {5, 4, 7, 5, 20, 16, 3, 3}, {0, 0, 5, 7, 9, 9, 3, 2},     {6, 5, 3, 4, 9, 9, 2, 3},
      {-3, -2, 6, 5, 9, 7, 3, 3}, {-2, -2, 13, 11, 9, 7, 2, 2}, {3, 3, 1, 1, 8, 8, 3, 3},
      {2, 1, 6, 5, 9, 9, 1, 1},   {0, 0, 1, 9, 1, 9, 5, 1},     {40, 40, 3, 3, 9, 9, 2, 2}};
  return sizes;
}

class ReferenceTest : public ::testing::Test {
 protected:
  EllMatrix<double> Projection(const BlockGeometry& block, Splat splat,
                               const std::vector<double>& irradiance = {}) {
    return reference_->WeightRays(block, splat, reference_->FindRays(block, splat), irradiance);
  }

  const std::unique_ptr<Kernels<double>> reference_ = NewReference<double>();
};

TEST_F(ReferenceTest, ProjectionByHand) {
  // In one row of two views, the first view lands a quarter to the right and the second one exactly
  // one to the left.
  BlockGeometry block;
  block.width_px = 3;
  block.height_px = 1;
  block.s_count = 3;
  block.t_count = 1;
  block.u_count = 2;
  block.v_count = 1;
  block.s_shift = {0, -1};
  block.s_fraction = {0.25, 0};
  block.t_shift = {0};
  block.t_fraction = {0};
  block.view_weight = {2, 1};

  const std::vector<std::int32_t> rays = reference_->FindRays(block, Splat::kBilinear);
  // The slots are those of view 0, (y0 x0), (y0 x1), (y1 x0), (y1 x1), then those of view 1, whose
  // sample 3 does not exist.
  const std::vector<std::int32_t> expected = {0, 1, 2,  -1, 0,  1,  -1, -1, -1, -1, -1, -1,
                                              3, 4, -1, -1, -1, -1, -1, -1, -1, -1, -1, -1};
  EXPECT_EQ(rays, expected);
  EXPECT_EQ(reference_->FindRays(block, Splat::kNearest),
            (std::vector<std::int32_t>{0, 1, 2, 3, 4, -1}));

  Matrix h(3, 6);
  h << 1.5 / 2.5, 0, 0, 1 / 2.5, 0, 0,   //
      .5 / 3, 1.5 / 3, 0, 0, 1. / 3, 0,  //
      0, .5 / 2, 1.5 / 2, 0, 0, 0;
  EXPECT_TRUE(DenseOf(Projection(block, Splat::kBilinear)).isApprox(h, 1e-15));
}

TEST_F(ReferenceTest, ProjectionIsTheNaiveOne) {
  std::uint32_t seed = 0;
  for (const BlockSize& size : BlockSizes()) {
    for (const Splat splat : {Splat::kNearest, Splat::kBilinear}) {
      const BlockGeometry block = RandomBlock(size, 3, ++seed);
      const auto irradiance = RandomReals<double>(Index(block.rays()), 0.5, 2, seed);
      const Matrix h = DenseOf(Projection(block, splat, irradiance));
      const Matrix naive = NaiveProjection(block, splat, irradiance);
      EXPECT_LE((h - naive).cwiseAbs().maxCoeff(), 1e-14) << "seed " << seed;
    }
  }
}

TEST_F(ReferenceTest, RowsOfTheProjectionSumToOneOrAreEmpty) {
  const BlockGeometry block = RandomBlock({-4, -4, 17, 13, 9, 9, 3, 3}, 2, 1);
  for (const Splat splat : {Splat::kNearest, Splat::kBilinear}) {
    const Vector sums = DenseOf(Projection(block, splat)).rowwise().sum();
    int full = 0;
    for (const double sum : sums) {
      EXPECT_TRUE(sum == 0 || std::abs(sum - 1) < 1e-14) << sum;
      full += sum > 0;
    }
    EXPECT_GE(full, 49);
    EXPECT_LT(full, block.pixels());
  }
}

TEST_F(ReferenceTest, NearestPutsEveryRayOnOnePixel) {
  const BlockGeometry block = RandomBlock({-1, 2, 8, 6, 9, 9, 3, 3}, 3, 5);
  const std::map<Sample, int> samples = SamplesOf(block);
  std::vector<int> landings(Index(block.rays()), 0);
  for (const std::int32_t ray : reference_->FindRays(block, Splat::kNearest)) {
    if (ray >= 0) ++landings[Index(ray)];
  }
  std::vector<int> expected(Index(block.rays()), 0);
  for (const auto& sample : samples) expected[Index(sample.second)] = 1;
  EXPECT_EQ(landings, expected);
}

TEST_F(ReferenceTest, ViewsWithoutWeightAreUnused) {
  BlockGeometry block = RandomBlock({0, 0, 5, 4, 9, 9, 3, 1}, 0, 7);
  block.view_weight = {0, 1, 0};
  const EllMatrix<double> h = Projection(block, Splat::kNearest);
  for (int ray = 0; ray < 20; ++ray) {
    EXPECT_EQ(h.column[Index(ray)], -1);
    EXPECT_EQ(h.column[Index(20 + ray)], 20 + ray);
  }
  block.view_weight = {0, 0, 0};
  EXPECT_EQ(Compress(Projection(block, Splat::kBilinear)).entries(), 0);
}

// The rows of D, computed from positions: a sample, a slope, and the samples of the next view
// around it.
Matrix NaiveDifferences(const BlockGeometry& block, const std::vector<double>& slope_u,
                        const std::vector<double>& slope_v) {
  const std::map<Sample, int> samples = SamplesOf(block);
  Matrix d = Matrix::Zero(2 * block.rays(), block.rays());
  for (const auto& [sample, ray] : samples) {
    for (int axis = 0; axis < 2; ++axis) {
      const double m = axis == 0 ? slope_u[Index(ray)] : slope_v[Index(ray)];
      if (std::isnan(m)) continue;
      const int row = axis * block.rays() + ray;
      Eigen::RowVectorXd weights = Eigen::RowVectorXd::Zero(block.rays());
      double found = 0;
      // The samples of the next view are weighted with a hat at s + m.
      for (const auto& [other, other_ray] : samples) {
        if (other[Index(1 - axis)] != sample[Index(1 - axis)]) continue;
        if (other[Index(2 + axis)] != sample[Index(2 + axis)] + 1) continue;
        if (other[Index(3 - axis)] != sample[Index(3 - axis)]) continue;
        const double weight =
            Impulse(Splat::kBilinear, other[Index(axis)] - (sample[Index(axis)] + m));
        weights(other_ray) = weight;
        found += weight;
      }
      if (std::abs(found - 1) > 1e-12) continue;  // a tap is missing
      d.row(row) = weights;
      d(row, ray) = -1;
    }
  }
  return d;
}

TEST_F(ReferenceTest, DifferencesAreTheNaiveOnes) {
  std::uint32_t seed = 10;
  for (const BlockSize& size : BlockSizes()) {
    const BlockGeometry block = RandomBlock(size, 2, ++seed);
    auto slope_u = RandomReals<double>(Index(block.rays()), -2.5, 2.5, seed);
    auto slope_v = RandomReals<double>(Index(block.rays()), -2.5, 2.5, seed + 100);
    // Integer slopes have one tap, NaN has none.
    for (std::size_t i = 0; i < slope_u.size(); i += 3) slope_u[i] = std::round(slope_u[i]);
    for (std::size_t i = 1; i < slope_v.size(); i += 3) slope_v[i] = std::round(slope_v[i]);
    for (std::size_t i = 0; i < slope_v.size(); i += 7) slope_v[i] = kNan;
    for (std::size_t i = 3; i < slope_u.size(); i += 7) slope_u[i] = kNan;
    const Matrix d = DenseOf(reference_->WarpDifferences(block, slope_u, slope_v));
    const Matrix naive = NaiveDifferences(block, slope_u, slope_v);
    ASSERT_EQ(d.rows(), naive.rows());
    EXPECT_LE((d - naive).cwiseAbs().maxCoeff(), 1e-14) << "seed " << seed;
  }
}

TEST_F(ReferenceTest, DifferencesReachPastTheShiftsOfTheViews) {
  // A slope of 0 relates equal samples, wherever they land in their views.
  const BlockGeometry block = RandomBlock({2, 2, 9, 8, 14, 14, 3, 3}, 2, 3);
  const std::vector<double> zero(Index(block.rays()), 0);
  const Vector l = RaysOf(block, [](int s, int t, int, int) { return 1 + s + 100 * t; });
  const EllMatrix<double> d = reference_->WarpDifferences(block, zero, zero);
  EXPECT_EQ((DenseOf(d) * l).cwiseAbs().maxCoeff(), 0);
  EXPECT_GT(Compress(d).entries(), 2 * 9 * 8);
}

TEST_F(ReferenceTest, DifferencesOfAConstantAndAlongTheSlopeAreZero) {
  const BlockGeometry block = RandomBlock({1, 1, 12, 11, 16, 16, 3, 3}, 2, 4);
  const std::vector<double> slope_u(Index(block.rays()), 0.7);
  const std::vector<double> slope_v(Index(block.rays()), -1.3);
  const Matrix d = DenseOf(reference_->WarpDifferences(block, slope_u, slope_v));
  const Vector ones = RaysOf(block, [](int, int, int, int) { return 1; });
  EXPECT_LE((d * ones).cwiseAbs().maxCoeff(), 1e-15);
  // This light field is constant along (m, 1) in (s, u) and (n, 1) in (t, v).
  const Vector along = RaysOf(
      block, [](int s, int t, int k, int l) { return 2 * (s - 0.7 * k) + 3 * (t + 1.3 * l); });
  EXPECT_LE((d * along).cwiseAbs().maxCoeff(), 1e-12);
  const Vector against = RaysOf(block, [](int s, int, int k, int) { return s + 0.7 * k; });
  // In rows that are not empty, the difference is m + 0.7 in u and 0 in v.
  const Vector change = d * against;
  int used = 0;
  for (int row = 0; row < block.rays(); ++row) {
    if (d.row(row).isZero(0)) continue;
    ++used;
    EXPECT_NEAR(change(row), 1.4, 1e-12);
  }
  EXPECT_GT(used, block.rays() / 3);
}

TEST_F(ReferenceTest, HugeSlopesHaveNoDifference) {
  const BlockGeometry block = RandomBlock({0, 0, 4, 4, 4, 4, 2, 2}, 0, 4);
  for (const double slope :
       {1e300, -1e300, 4e9, 2147483648.0, std::numeric_limits<double>::infinity()}) {
    const std::vector<double> slopes(Index(block.rays()), slope);
    EXPECT_EQ(Compress(reference_->WarpDifferences(block, slopes, slopes)).entries(), 0) << slope;
  }
}

// True if all neighbours of the sample that the six terms use are in the block.
bool HasAllNeighbours(const std::map<Sample, int>& samples, const Sample& sample) {
  for (std::size_t axis = 0; axis < 2; ++axis) {
    for (int ds = -1; ds <= 1; ++ds) {
      for (int dk = -1; dk <= 1; ++dk) {
        Sample other = sample;
        other[axis] += ds;
        other[axis + 2] += dk;
        if (samples.count(other) == 0) return false;
      }
    }
  }
  return true;
}

TEST_F(ReferenceTest, SixTermsAreExactForQuadraticLightFields) {
  const BlockGeometry block = RandomBlock({2, 1, 10, 9, 16, 16, 4, 4}, 1, 6);
  const auto m = RandomReals<double>(Index(block.rays()), -2, 2, 1);
  const auto n = RandomReals<double>(Index(block.rays()), -2, 2, 2);
  const EllMatrix<double> ell = reference_->SixTermMasks(block, m, n);
  EXPECT_EQ(ell.slots, 17);
  const Matrix g = DenseOf(ell);
  // L = 2 s^2 + 3 s k - k^2 + t^2/2 - 5 t l + 4 l^2 + linear terms.
  const Vector l = RaysOf(block, [](int s, int t, int k, int v) {
    return 2. * s * s + 3. * s * k - k * k + t * t / 2. - 5. * t * v + 4. * v * v + 6 * s - 7 * t +
           k + 8 * v;
  });
  const std::map<Sample, int> samples = SamplesOf(block);
  int interior = 0;
  for (const auto& [sample, ray] : samples) {
    if (!HasAllNeighbours(samples, sample)) continue;
    ++interior;
    const double mm = m[Index(ray)];
    const double nn = n[Index(ray)];
    const double exact = 4 * mm * mm + 6 * mm - 2 + nn * nn - 10 * nn + 8;
    EXPECT_NEAR(g.row(ray).dot(l), exact, 1e-10);
  }
  EXPECT_GT(interior, 40);
}

TEST_F(ReferenceTest, SixTermsAnnihilateWhatIsConstantAlongTheSlope) {
  const BlockGeometry block = RandomBlock({2, 1, 10, 9, 16, 16, 3, 3}, 1, 8);
  const std::vector<double> m(Index(block.rays()), 1.5);
  const std::vector<double> n(Index(block.rays()), -0.25);
  const Matrix g = DenseOf(reference_->SixTermMasks(block, m, n));
  const Vector l = RaysOf(block, [](int s, int t, int k, int v) {
    const double a = s - 1.5 * k;
    const double b = t + 0.25 * v;
    return a * a - 2 * a + b * b / 3 + b;
  });
  const std::map<Sample, int> samples = SamplesOf(block);
  int interior = 0;
  for (const auto& [sample, ray] : samples) {
    if (!HasAllNeighbours(samples, sample)) continue;
    ++interior;
    EXPECT_NEAR(g.row(ray).dot(l), 0, 1e-10);
  }
  EXPECT_GT(interior, 30);
}

TEST_F(ReferenceTest, SixTermsOfAConstantAreZeroEverywhere) {
  std::uint32_t seed = 30;
  for (const BlockSize& size : BlockSizes()) {
    const BlockGeometry block = RandomBlock(size, 2, ++seed);
    auto m = RandomReals<double>(Index(block.rays()), -2, 2, seed);
    auto n = RandomReals<double>(Index(block.rays()), -2, 2, seed + 100);
    for (std::size_t i = 0; i < m.size(); i += 5) (i % 2 == 0 ? m : n)[i] = kNan;
    const Matrix g = DenseOf(reference_->SixTermMasks(block, m, n));
    EXPECT_LE((g * Vector::Ones(block.rays())).cwiseAbs().maxCoeff(), 1e-13);
    for (std::size_t i = 0; i < m.size(); i += 5) {
      EXPECT_TRUE(g.row(static_cast<int>(i)).isZero(0));
    }
  }
}

TEST_F(ReferenceTest, SixTermsAtABorder) {
  // One view has three samples in a row, so that only m^2 L_ss is left, one-sided at the ends.
  const BlockGeometry block = RandomBlock({0, 0, 3, 1, 3, 1, 1, 1}, 0, 9);
  const std::vector<double> m = {2, 3, 5};
  const std::vector<double> n = {7, 7, 7};
  Matrix expected(3, 3);
  expected << -4, 4, 0,  //
      9, -18, 9,         //
      0, 25, -25;
  EXPECT_LE((DenseOf(reference_->SixTermMasks(block, m, n)) - expected).cwiseAbs().maxCoeff(),
            1e-12);
}

TEST_F(ReferenceTest, ProductsAreTheDenseOnes) {
  for (std::uint32_t seed = 0; seed < 10; ++seed) {
    const CsrMatrix<double> a = RandomCsr<double>(13, 17, 0.3, seed);
    const auto x = RandomReals<double>(17, -1, 1, seed);
    const auto y = RandomReals<double>(13, -1, 1, seed + 50);
    const Matrix dense = DenseOf(a);
    const Vector ax = DenseOf(reference_->Multiply(a, x));
    const Vector aty = DenseOf(reference_->MultiplyTransposed(a, y));
    EXPECT_LE((ax - dense * DenseOf(x)).norm(), 1e-14);
    EXPECT_LE((aty - dense.transpose() * DenseOf(y)).norm(), 1e-14);
    EXPECT_NEAR(ax.dot(DenseOf(y)), aty.dot(DenseOf(x)), 1e-14);

    const CsrPattern pattern =
        SumPattern(NormalPattern(a), PatternOf(RandomCsr<double>(17, 17, 0.2, seed)));
    CsrMatrix<double> normal{17, 17, pattern.row_start, pattern.column,
                             RandomReals<double>(pattern.column.size(), -1, 1, seed)};
    const Matrix before = DenseOf(normal);
    reference_->AddNormalProduct(a, -2.5, pattern, &normal.value);
    EXPECT_LE((DenseOf(normal) - before + 2.5 * dense.transpose() * dense).norm(), 1e-13);
  }
}

TEST_F(ReferenceTest, NormalProductIsSymmetricBitForBit) {
  const BlockGeometry block = RandomBlock({1, 1, 5, 4, 9, 9, 3, 3}, 2, 4);
  const CsrMatrix<double> h = Compress(Projection(block, Splat::kBilinear));
  const CsrPattern pattern = NormalPattern(h);
  CsrMatrix<double> normal{block.rays(), block.rays(), pattern.row_start, pattern.column,
                           std::vector<double>(pattern.column.size(), 0)};
  reference_->AddNormalProduct(h, 0.3, pattern, &normal.value);
  const Matrix dense = DenseOf(normal);
  EXPECT_EQ(dense, dense.transpose());
}

TEST_F(ReferenceTest, TheImageIsTheProjectionOfTheViews) {
  std::uint32_t seed = 50;
  for (const BlockSize& size : BlockSizes()) {
    for (const Splat splat : {Splat::kNearest, Splat::kBilinear}) {
      BlockGeometry block = RandomBlock(size, 3, ++seed);
      if (block.views() > 2) block.view_weight[2] = 0;
      const std::size_t view_samples = Index(block.s_count * block.t_count);
      const auto views = RandomReals<double>(view_samples * Index(block.views()), -1, 1, seed);
      const Vector rays = RaysOf(block, [&](int s, int t, int k, int l) {
        return views[Index(l * block.u_count + k) * view_samples + Index(t * block.s_count + s)];
      });
      const Vector image = DenseOf(reference_->FormImage(block, splat, views));
      EXPECT_LE((image - NaiveProjection(block, splat, {}) * rays).cwiseAbs().maxCoeff(), 1e-14)
          << "seed " << seed;
    }
  }
}

TEST_F(ReferenceTest, TheImageDoesNotLookAtViewsWithoutWeight) {
  BlockGeometry block = RandomBlock({0, 0, 5, 4, 5, 4, 2, 1}, 0, 3);
  block.view_weight = {0, 1};
  std::vector<double> views(40, kNan);
  std::fill(views.begin() + 20, views.end(), 3.0);
  for (const double value : reference_->FormImage(block, Splat::kBilinear, views)) {
    EXPECT_NEAR(value, 3, 1e-15);
  }
}

TEST_F(ReferenceTest, BlocksShareTheRaysOfAnImage) {
  for (std::uint32_t seed = 0; seed < 5; ++seed) {
    // An image of 11 x 9 px in blocks of 4 x 5, in which every ray is 1 + its position in the light
    // field.
    const BlockGeometry whole = RandomBlock({0, 0, 11, 9, 11, 9, 3, 2}, 4, seed);
    reference_->StartWhole(11, 9, 3, 2, 2);
    for (int y = 0; y < 9; y += 5) {
      for (int x = 0; x < 11; x += 4) {
        BlockGeometry block = whole;
        block.first_x = x;
        block.first_y = y;
        block.width_px = std::min(4, 11 - x);
        block.height_px = std::min(5, 9 - y);
        const Vector rays = RaysOf(
            block, [](int s, int t, int k, int l) { return 1 + s + 11 * (t + 9 * (k + 3 * l)); });
        std::vector<double> values(rays.begin(), rays.end());
        // Numbers without a ray are left out, whatever their value is.
        for (double& value : values) value = value == 0 ? kNan : value;
        reference_->AddBlock(block, 1, values);
      }
    }
    const std::vector<float> light_field = reference_->FinishWhole();
    const std::map<Sample, int> samples = SamplesOf(whole);
    ASSERT_EQ(light_field.size(), Index(2 * 6 * 99));
    for (int i = 0; i < 6 * 99; ++i) {
      EXPECT_EQ(light_field[Index(i)], 0) << "the other channel";
      const Sample sample = {i % 11, i / 11 % 9, i / 99 % 3, i / 297};
      const bool lands = samples.count(sample) > 0;
      EXPECT_EQ(light_field[Index(6 * 99 + i)], lands ? static_cast<float>(1 + i) : 0.0F);
    }
  }
}

TEST_F(ReferenceTest, AddingIsAdding) {
  BlockGeometry block = RandomBlock({1, 0, 2, 1, 4, 1, 1, 1}, 0, 1);
  reference_->StartWhole(4, 1, 1, 1, 1);
  reference_->AddBlock(block, 0, {1, 2});
  reference_->AddBlock(block, 0, {10, 20});
  EXPECT_EQ(reference_->FinishWhole(), (std::vector<float>{0, 11, 22, 0}));
  reference_->StartWhole(4, 1, 1, 1, 1);
  EXPECT_EQ(reference_->FinishWhole(), std::vector<float>(4, 0.0F)) << "anew";
}

TEST_F(ReferenceTest, EmptyArgumentsHaveEmptyResults) {
  const BlockGeometry block = RandomBlock({0, 0, 0, 5, 9, 9, 2, 2}, 0, 1);
  EXPECT_TRUE(reference_->FindRays(block, Splat::kBilinear).empty());
  EXPECT_TRUE(reference_->WeightRays(block, Splat::kBilinear, {}, {}).value.empty());
  EXPECT_EQ(reference_->WarpDifferences(block, {}, {}).rows, 0);
  EXPECT_EQ(reference_->SixTermMasks(block, {}, {}).rows, 0);
  EXPECT_TRUE(reference_->Multiply({}, {}).empty());
  EXPECT_TRUE(reference_->MultiplyTransposed({}, {}).empty());
  std::vector<double> nothing;
  reference_->AddNormalProduct({}, 1, {}, &nothing);
  EXPECT_TRUE(reference_->FormImage(block, Splat::kNearest, std::vector<double>(4 * 81)).empty());
  reference_->StartWhole(9, 9, 2, 2, 1);
  reference_->AddBlock(block, 0, {});
  EXPECT_EQ(reference_->FinishWhole().size(), Index(4 * 81));
}

TEST_F(ReferenceTest, WrongArgumentsAreNamed) {
  const BlockGeometry block = RandomBlock({0, 0, 3, 2, 9, 9, 2, 1}, 0, 1);
  const auto bad = [&](const std::function<void(BlockGeometry*)>& change) {
    return ErrorOf([&] {
      BlockGeometry changed = block;
      change(&changed);
      reference_->FindRays(changed, Splat::kBilinear);
    });
  };
  EXPECT_EQ(bad([](BlockGeometry* b) { b->width_px = -1; }),
            "block: width_px is -1: it must be 0 to 268435455");
  EXPECT_EQ(bad([](BlockGeometry* b) { b->s_shift.pop_back(); }),
            "block: s_shift has 1 elements: it must have 2");
  EXPECT_EQ(bad([](BlockGeometry* b) { b->t_fraction[0] = kNan; }),
            "block: t_fraction is nan: it must be -1/2 to 1/2");
  EXPECT_EQ(bad([](BlockGeometry* b) { b->view_weight[1] = -1; }),
            "block: view_weight is -1: it must be finite and >= 0");
  EXPECT_EQ(bad([](BlockGeometry* b) { b->width_px = 1 << 14, b->height_px = 1 << 15; }),
            "block: number of pixels is 536870912: it must be 0 to 268435455");

  EXPECT_EQ(ErrorOf([&] { reference_->WeightRays(block, Splat::kNearest, {1}, {}); }),
            "list of rays has 1 elements: it must have 12");
  EXPECT_EQ(ErrorOf([&] {
              reference_->WeightRays(block, Splat::kNearest, std::vector<std::int32_t>(12, 12), {});
            }),
            "list of rays: 12 is not a ray of the block: it must be -1 to 11");
  EXPECT_EQ(ErrorOf([&] {
              reference_->WeightRays(block, Splat::kNearest, std::vector<std::int32_t>(12, 0), {1});
            }),
            "irradiance has 1 elements: it must have 12");
  EXPECT_EQ(ErrorOf([&] { reference_->WarpDifferences(block, {}, std::vector<double>(12)); }),
            "slope_u has 0 elements: it must have 12");
  EXPECT_EQ(ErrorOf([&] { reference_->SixTermMasks(block, std::vector<double>(12), {}); }),
            "slope_v has 0 elements: it must have 12");
  EXPECT_EQ(ErrorOf([&] { reference_->FormImage(block, Splat::kNearest, {}); }),
            "light field to form an image of has 0 elements: it must have 162");
  const CsrMatrix<double> a = RandomCsr<double>(3, 4, 0.5, 1);
  EXPECT_EQ(ErrorOf([&] { reference_->Multiply(a, std::vector<double>(3)); }),
            "vector to be multiplied has 3 elements: it must have 4");
  EXPECT_EQ(ErrorOf([&] { reference_->MultiplyTransposed(a, std::vector<double>(4)); }),
            "vector to be multiplied has 4 elements: it must have 3");
  std::vector<double> values;
  EXPECT_EQ(ErrorOf([&] { reference_->AddNormalProduct(a, 1, PatternOf(a), &values); }),
            "pattern of a normal product has 3 x 4 entries: it must have 4 x 4");
  EXPECT_EQ(
      ErrorOf([&] { reference_->AddNormalProduct(a, 1, NormalPattern(a), &values); }).substr(0, 35),
      "values of a normal product has 0 el");
  reference_->StartWhole(9, 9, 2, 1, 1);
  EXPECT_EQ(ErrorOf([&] { reference_->AddBlock(block, 1, std::vector<double>(12)); }),
            "a block is added to channel 1: it must be 0 to 0");
  EXPECT_EQ(ErrorOf([&] { reference_->AddBlock(block, 0, std::vector<double>(11)); }),
            "block's rays has 11 elements: it must have 12");
  EXPECT_EQ(ErrorOf([&] { reference_->StartWhole(-1, 9, 2, 1, 1); }).substr(0, 13),
            "s_count is -1");
}

}  // namespace
}  // namespace thicklens::kernels
