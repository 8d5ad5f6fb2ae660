#include "kernels/opencl/packed_map.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <set>
#include <vector>

#include "support/sample_projection.h"

namespace thicklens::kernels {
namespace {

using ::thicklens::testing::DenseOf;
using ::thicklens::testing::SampleFilter;
using ::thicklens::testing::SampleRows;

std::size_t Index(std::int64_t i) { return static_cast<std::size_t>(i); }

// The matrix that a packed filter represents, on the image without the padding.
Eigen::MatrixXd DenseOf(const PackedFilter<double>& packed, const PackedPlane& plane, Axis axis,
                        int tile) {
  const int pixels = plane.width_px * plane.height_px;
  Eigen::MatrixXd dense = Eigen::MatrixXd::Zero(pixels, pixels);
  for (int place = 0; place < static_cast<int>(plane.size()); ++place) {
    const int x = place % plane.stride_px;
    const int y = place / plane.stride_px;
    const std::size_t t = Index(place / tile);
    for (std::int32_t term = packed.start[t]; term < packed.start[t + 1]; ++term) {
      const double value = packed.coefficients[Index(term) * Index(tile) + Index(place % tile)];
      const int n = packed.first[t] + term - packed.start[t];
      const int from_x = axis == Axis::kAcross ? x + n : x;
      const int from_y = axis == Axis::kAcross ? y : y + n;
      const bool inside = x < plane.width_px && from_x >= 0 && from_x < plane.width_px &&
                          from_y >= 0 && from_y < plane.height_px;
      if (!inside) {
        EXPECT_EQ(value, 0) << x << " " << y << " " << n;
        continue;
      }
      dense(y * plane.width_px + x, from_y * plane.width_px + from_x) += value;
    }
  }
  return dense;
}

TEST(PackedMap, RowsAreAnOddNumberOfTilesApart) {
  EXPECT_EQ(PackedPlaneOf(512, 3, 16).stride_px, 528);
  EXPECT_EQ(PackedPlaneOf(513, 3, 16).stride_px, 528);
  EXPECT_EQ(PackedPlaneOf(1, 3, 32).stride_px, 32);
  EXPECT_EQ(PackedPlaneOf(33, 3, 32).stride_px, 96);
  const std::vector<std::int32_t> places = PackedPlaces(PackedPlaneOf(3, 2, 8));
  EXPECT_EQ(places, (std::vector<std::int32_t>{0, 1, 2, 8, 9, 10}));
}

TEST(PackedMap, FiltersAndTheirTransposedKeepEveryCoefficient) {
  std::uint32_t seed = 1;
  for (const int tile : {8, 16, 32}) {
    for (const Axis axis : {Axis::kAcross, Axis::kDown}) {
      const int width = axis == Axis::kAcross ? 131 : 19;
      const int height = axis == Axis::kAcross ? 3 : 21;
      const auto filter = SampleFilter<double>(axis, width, height, 9, ++seed);
      const PackedPlane plane = PackedPlaneOf(width, height, tile);
      Eigen::MatrixXd right = DenseOf(filter);
      const std::vector<std::int32_t> left_out = {0, 5, 6, width + 3};
      for (const std::int32_t pixel : left_out) right.row(pixel).setZero();
      for (const int threads : {1, 3}) {
        EXPECT_EQ(DenseOf(Pack(filter, false, left_out, plane, tile, threads), plane, axis, tile),
                  right);
        EXPECT_EQ(DenseOf(Pack(filter, true, left_out, plane, tile, threads), plane, axis, tile),
                  right.transpose());
      }
    }
  }
}

TEST(PackedMap, OnlyTermsAreKeptThatATileHas) {
  VaryingFilter<double> filter{Axis::kAcross, 64, 1, {3}, {0, 7 * 64}, {}};
  filter.coefficients.assign(7 * 64, 0.0);
  filter.coefficients[4 * 64 + 20] = 0.5;  // c_1(20)
  filter.coefficients[6 * 64 + 21] = 0.5;  // c_3(21)
  const auto packed = Pack(filter, false, {}, PackedPlaneOf(64, 1, 16), 16, 1);
  EXPECT_EQ(packed.start, (std::vector<std::int32_t>{0, 0, 3, 3, 3, 3}));
  EXPECT_EQ(packed.first[1], 1);
  EXPECT_EQ(packed.reach_px, 3);
}

TEST(PackedMap, RowsKeepEveryEntryAndAreNearEqualInASlice) {
  for (const int slice : {1, 4, 32}) {
    const auto rows = SampleRows<double>(900, 2, 5);
    const PackedPlane plane = PackedPlaneOf(30, 30, 16);
    const auto packed = Pack(rows, PackedPlaces(plane), plane, slice, 2);
    const std::size_t count = rows.pixel.size();
    ASSERT_EQ(packed.order.size(), count);
    EXPECT_EQ(std::set<std::int32_t>(packed.order.begin(), packed.order.end()).size(), count);
    for (std::size_t i = 0; i < count; ++i) {
      const std::size_t row = Index(packed.order[i]);
      const auto place = [](int pixel) { return pixel / 30 * 48 + pixel % 30; };
      EXPECT_EQ(packed.pixel[i], place(rows.pixel[row]));
      const std::size_t s = i / Index(slice);
      const auto length = Index((packed.start[s + 1] - packed.start[s]) / slice);
      const std::size_t entries = Index(rows.start[row + 1] - rows.start[row]);
      ASSERT_LE(entries, length);
      for (std::size_t e = 0; e < length; ++e) {
        const std::size_t at = Index(packed.start[s]) + e * Index(slice) + i % Index(slice);
        const std::size_t from = Index(rows.start[row]) + e;
        EXPECT_EQ(packed.weight[at], e < entries ? rows.weight[from] : 0) << at;
        if (e < entries) {
          EXPECT_EQ(packed.index[at], place(rows.index[from]));
        }
      }
    }
    if (slice == 1) {
      EXPECT_EQ(packed.weight.size(), rows.weight.size());
    }
    EXPECT_LT(packed.weight.size(), rows.weight.size() * 13 / 10);
  }
}

}  // namespace
}  // namespace thicklens::kernels
