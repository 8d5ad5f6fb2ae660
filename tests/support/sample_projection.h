#ifndef THICKLENS_TESTS_SUPPORT_SAMPLE_PROJECTION_H_
#define THICKLENS_TESTS_SUPPORT_SAMPLE_PROJECTION_H_

#include <Eigen/Core>
#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <random>
#include <vector>

#include "thicklens/kernels/radiance_steps.h"

namespace thicklens::testing {

// Random maps between images, as numbers and as the dense matrix that they represent.

// A filter with radii from 0 to `most_radius`, which change from block to block.
template <typename Real>
kernels::VaryingFilter<Real> SampleFilter(kernels::Axis axis, int width, int height,
                                          int most_radius, std::uint32_t seed) {
  kernels::VaryingFilter<Real> filter;
  filter.axis = axis;
  filter.width_px = width;
  filter.height_px = height;
  filter.start = std::vector<std::size_t>{0};
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> value(0, 0.4);
  for (int y = 0; y < height; ++y) {
    for (int b = 0; b < filter.blocks_in_row(); ++b) {
      const int radius = static_cast<int>(random() % static_cast<unsigned>(most_radius + 1));
      filter.radius_px.push_back(radius);
      for (int n = -radius; n <= radius; ++n) {
        for (int i = 0; i < kernels::kFilterBlockPx; ++i) {
          const int x = b * kernels::kFilterBlockPx + i;
          const int from = (axis == kernels::Axis::kAcross ? x : y) + n;
          const bool inside =
              x < width && from >= 0 && from < (axis == kernels::Axis::kAcross ? width : height);
          filter.coefficients.push_back(inside ? static_cast<Real>(value(random)) : Real{0});
        }
      }
      filter.start.push_back(filter.coefficients.size());
    }
  }
  return filter;
}

template <typename Real>
Eigen::MatrixXd DenseOf(const kernels::VaryingFilter<Real>& filter) {
  const int pixels = filter.width_px * filter.height_px;
  Eigen::MatrixXd dense = Eigen::MatrixXd::Zero(pixels, pixels);
  for (int p = 0; p < pixels; ++p) {
    const int x = p % filter.width_px;
    const int y = p / filter.width_px;
    const auto block =
        static_cast<std::size_t>(y * filter.blocks_in_row() + x / kernels::kFilterBlockPx);
    const int radius = filter.radius_px[block];
    for (int n = -radius; n <= radius; ++n) {
      const int to_x = filter.axis == kernels::Axis::kAcross ? x + n : x;
      const int to_y = filter.axis == kernels::Axis::kAcross ? y : y + n;
      if (to_x < 0 || to_x >= filter.width_px || to_y < 0 || to_y >= filter.height_px) continue;
      dense(p, to_y * filter.width_px + to_x) += static_cast<double>(
          filter.coefficients[filter.start[block] +
                              static_cast<std::size_t>((n + radius) * kernels::kFilterBlockPx +
                                                       x % kernels::kFilterBlockPx)]);
    }
  }
  return dense;
}

// About every `every`-th pixel has a row of 0 to 40 entries. Some pixels are read twice.
template <typename Real>
kernels::PixelCsr<Real> SampleRows(int pixels, unsigned every, std::uint32_t seed) {
  kernels::PixelCsr<Real> rows;
  rows.pixels = pixels;
  rows.start = {0};
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> value(0, 0.2);
  for (int p = 0; p < pixels; ++p) {
    if (every == 0 || random() % every != 0) continue;
    rows.pixel.push_back(p);
    for (auto entries = random() % 41; entries > 0; --entries) {
      rows.index.push_back(static_cast<std::int32_t>(random() % static_cast<unsigned>(pixels)));
      rows.weight.push_back(static_cast<Real>(value(random)));
    }
    rows.start.push_back(static_cast<std::int64_t>(rows.index.size()));
  }
  return rows;
}

// A map of `products` products, and rows at every `every`-th pixel (0: none; 1: all).
template <typename Real>
class SampleProjection {
 public:
  SampleProjection(int width, int height, int products, unsigned every, std::uint32_t seed)
      : width_(width), height_(height) {
    const int pixels = width * height;
    dense_ = Eigen::MatrixXd::Zero(pixels, pixels);
    for (int i = 0; i < products; ++i) {
      filters_.push_back(
          SampleFilter<Real>(kernels::Axis::kAcross, width, height, 4 + 3 * i, ++seed));
      filters_.push_back(SampleFilter<Real>(kernels::Axis::kDown, width, height, 5, ++seed));
      dense_ += DenseOf(filters_[filters_.size() - 1]) * DenseOf(filters_[filters_.size() - 2]);
    }
    const kernels::PixelCsr<Real> rows = SampleRows<Real>(pixels, every, ++seed);
    for (std::size_t r = 0; r < rows.pixel.size(); ++r) {
      dense_.row(rows.pixel[r]).setZero();
      for (auto e = static_cast<std::size_t>(rows.start[r]);
           e < static_cast<std::size_t>(rows.start[r + 1]); ++e) {
        dense_(rows.pixel[r], rows.index[e]) += static_cast<double>(rows.weight[e]);
      }
    }
    rows_ = kernels::RunsOf(rows, width);
  }

  const Eigen::MatrixXd& dense() const { return dense_; }

  // The result refers to this object.
  kernels::FilteredMap<Real> filters() const {
    kernels::FilteredMap<Real> map;
    for (std::size_t i = 0; i < filters_.size(); i += 2) {
      map.products.push_back({&filters_[i], &filters_[i + 1]});
    }
    map.rows = &rows_;
    return map;
  }

  // Multiplies by the dense matrix.
  std::vector<Real> Multiply(bool transposed, const Real* x, int channels) const {
    std::vector<Real> y;
    for (int channel = 0; channel < channels; ++channel) {
      Eigen::VectorXd from(dense_.cols());
      for (Eigen::Index i = 0; i < from.size(); ++i) {
        from[i] = static_cast<double>(x[channel * from.size() + i]);
      }
      const Eigen::VectorXd to = transposed ? (dense_.transpose() * from).eval() : dense_ * from;
      for (const double value : to) y.push_back(static_cast<Real>(value));
    }
    return y;
  }

  // A photograph with this projection. The result refers to this object.
  kernels::DataTerm<Real> Data(int channels, std::uint32_t seed) const {
    kernels::DataTerm<Real> data;
    data.width_px = width_;
    data.height_px = height_;
    data.channels = channels;
    data.filters = filters();
    const auto multiply = [this](bool transposed) {
      return [this, transposed](const Real* x, int count, Real* y) {
        const std::vector<Real> product = Multiply(transposed, x, count);
        std::copy(product.begin(), product.end(), y);
      };
    };
    data.projection = {multiply(false), multiply(true)};
    data.photograph = Numbers(static_cast<std::size_t>(channels) * data.pixels(), ++seed);
    data.weight = Numbers(data.pixels(), ++seed);
    for (Eigen::Index i = 0; i < dense_.rows(); ++i) {
      data.row_norm2.push_back(static_cast<Real>(dense_.row(i).squaredNorm()));
    }
    return data;
  }

  static std::vector<Real> Numbers(std::size_t count, std::uint32_t seed) {
    std::mt19937 random(seed);
    std::uniform_real_distribution<double> value(0.2, 1);
    std::vector<Real> numbers(count);
    for (Real& number : numbers) number = static_cast<Real>(value(random));
    return numbers;
  }

 private:
  int width_, height_;
  std::vector<kernels::VaryingFilter<Real>> filters_;  // across, down, across, ...
  kernels::PixelBlockedCsr<Real> rows_;
  Eigen::MatrixXd dense_;
};

}  // namespace thicklens::testing

#endif  // THICKLENS_TESTS_SUPPORT_SAMPLE_PROJECTION_H_
