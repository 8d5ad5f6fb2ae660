#include "estimator/projection/scene_projection.h"

#include <fmt/format.h>

#include <Eigen/SVD>
#include <algorithm>
#include <cmath>

#include "estimator/projection/plain_pixels.h"
#include "estimator/projection/seen_share.h"
#include "thicklens/base/error.h"

namespace thicklens::estimator {
namespace {

// A sum of this many products costs no more than rows for all pixels would.
constexpr int kMostTerms = 4;

// Weights as a sum of products of a column and a row, by singular values: exact to rounding.
struct Product {
  Eigen::VectorXd across, down;
};
std::vector<Product> ProductsOf(const Eigen::ArrayXXd& weights) {
  const Eigen::JacobiSVD<Eigen::MatrixXd> svd(weights.matrix(),
                                              Eigen::ComputeThinU | Eigen::ComputeThinV);
  std::vector<Product> products;
  for (Eigen::Index i = 0; i < svd.singularValues().size(); ++i) {
    const double value = svd.singularValues()[i];
    if (!(value > 1e-12 * svd.singularValues()[0])) break;
    products.push_back({svd.matrixV().col(i), svd.matrixU().col(i) * value});
  }
  return products;
}

std::vector<float> HiddenShare(const ViewFan& fan, std::size_t pixels) {
  std::vector<double> share(pixels, 0.0);
  for (const FanView& view : fan.views) {
    for (const CompactView::Hidden& hidden : view.sees.hidden)
      share[static_cast<std::size_t>(hidden.index)] += view.weight;
    for (const CompactView::Mixed& mixed : view.sees.mixed) {
      const auto i = static_cast<std::size_t>(mixed.index);
      const double hidden_before = std::isnan(view.sees.disparity[i]) ? 1 : 0;
      const double other_hidden = mixed.other.index == mixed.index ? 0 : 1;
      share[i] += view.weight * static_cast<double>(mixed.share) * (other_hidden - hidden_before);
    }
  }
  return {share.begin(), share.end()};
}

// The centre view is the map itself.
void DropCentre(ViewFan* fan) {
  const auto is_centre = [](const FanView& view) { return view.a == 0 && view.b == 0; };
  fan->views.erase(std::remove_if(fan->views.begin(), fan->views.end(), is_centre),
                   fan->views.end());
}

}  // namespace

template <typename Real>
void SceneProjection<Real>::Apply(const Real* x, int channels, Real* y) const {
  const auto stride = static_cast<std::ptrdiff_t>(pixels());
  const std::size_t size = pixels() * static_cast<std::size_t>(channels);
  const kernels::PictureIn<Real> in{x, stride, channels};
  const kernels::PictureOut<Real> out{y, stride, channels};
  between_.resize(size);
  if (terms.size() > 1) other_.resize(size);
  for (std::size_t t = 0; t < terms.size(); ++t) {
    kernels::Apply(terms[t].across, in, {between_.data(), stride, channels}, threads);
    Real* to = t == 0 ? y : other_.data();
    kernels::Apply(terms[t].down, {between_.data(), stride, channels}, {to, stride, channels},
                   threads);
    for (std::size_t i = 0; t > 0 && i < size; ++i) y[i] += other_[i];
  }
  kernels::ApplyRuns(rows, in, out, threads);
}

template <typename Real>
void SceneProjection<Real>::ApplyTransposed(const Real* y, int channels, Real* x) const {
  const auto stride = static_cast<std::ptrdiff_t>(pixels());
  const std::size_t size = pixels() * static_cast<std::size_t>(channels);
  const kernels::PictureOut<Real> out{x, stride, channels};
  if (terms.empty()) {
    std::fill(x, x + size, Real(0));
  } else {
    between_.resize(size);
    other_.assign(y, y + size);  // without the pixels that have rows
    for (int c = 0; c < channels; ++c) {
      Real* plane = other_.data() + c * stride;
      for (const std::int32_t pixel : rows.pixel) plane[pixel] = 0;
    }
    std::vector<Real> sum;
    for (std::size_t t = 0; t < terms.size(); ++t) {
      kernels::ApplyTransposed(terms[t].down, {other_.data(), stride, channels},
                               {between_.data(), stride, channels}, threads);
      if (t == 0) {
        kernels::ApplyTransposed(terms[t].across, {between_.data(), stride, channels}, out,
                                 threads);
        continue;
      }
      sum.resize(size);
      kernels::ApplyTransposed(terms[t].across, {between_.data(), stride, channels},
                               {sum.data(), stride, channels}, threads);
      for (std::size_t i = 0; i < size; ++i) x[i] += sum[i];
    }
  }
  kernels::AddTransposed(rows, {y, stride, channels}, out, threads);
}

template <typename Real>
double SceneProjection<Real>::row_share() const {
  return static_cast<double>(rows.pixel.size()) / static_cast<double>(pixels());
}

// Returns indices into `rows`.
template <typename Real>
std::pair<std::size_t, std::size_t> SceneProjection<Real>::RowsOfOwn(int first_row,
                                                                     int last_row) const {
  const auto from = [&](int row) {
    const auto pixel = static_cast<std::int32_t>(row * width_px);
    return static_cast<std::size_t>(std::lower_bound(rows.pixel.begin(), rows.pixel.end(), pixel) -
                                    rows.pixel.begin());
  };
  return {from(first_row), from(last_row)};
}

template <typename Real>
std::size_t SceneProjection<Real>::pixels_with_row(int first_row, int last_row) const {
  const auto [first, last] = RowsOfOwn(first_row, last_row);
  return last - first;
}

template <typename Real>
double SceneProjection<Real>::bytes(int first_row, int last_row) const {
  const auto [first, last] = RowsOfOwn(first_row, last_row);
  const auto first_run = static_cast<std::size_t>(rows.run[first]);
  const auto last_run = static_cast<std::size_t>(rows.run[last]);
  std::size_t sum =
      (last_run - first_run) * (kernels::kPixelsOfRun * sizeof(Real) + sizeof(std::int32_t)) +
      (last - first) * (sizeof(std::int64_t) + sizeof(std::int32_t));
  for (const Term& term : terms) {
    for (const kernels::PixelFilter<Real>* filter : {&term.across, &term.down}) {
      const auto start = [&](int row) {
        return filter->start[static_cast<std::size_t>(row) *
                             static_cast<std::size_t>(filter->blocks_in_row())];
      };
      sum += (start(last_row) - start(first_row)) * sizeof(Real);
    }
  }
  return static_cast<double>(sum);
}

template <typename Real>
SceneProjection<Real> MakeSceneProjection(const DisparityMap& disparity,
                                          const Eigen::ArrayXXd& weights,
                                          const ProjectionOptions& options) {
  ViewFan fan = RenderFan(disparity, weights, options.threads, options.progress);
  const auto u_count = static_cast<int>(weights.cols()), v_count = static_cast<int>(weights.rows());
  const std::vector<Product> products = ProductsOf(weights);
  const bool has_products = products.size() <= kMostTerms;
  PlainPixels plain;
  if (has_products || options.seen_share) {
    plain = FindPlainPixels(disparity, u_count, v_count, options.tolerance_px);
  }
  SceneProjection<Real> projection;
  projection.width_px = disparity.width_px;
  projection.height_px = disparity.height_px;
  projection.threads = options.threads;
  projection.fan_bytes = BytesOf(fan);
  projection.hidden_share = HiddenShare(fan, projection.pixels());
  if (options.seen_share)
    projection.seen_share = SeenShare(fan, disparity, plain.is_seen, options.threads);

  std::vector<unsigned char> is_product(projection.pixels(), 0);
  if (has_products) {
    FanAxes axes = AxesOf(fan, disparity, u_count, v_count, options.threads);
    is_product =
        IsProduct(fan, axes, disparity, options.tolerance_px, plain.is_product, options.threads);
    for (const FanView& view : fan.views) {
      for (const CompactView::Mixed& mixed : view.sees.mixed) {
        is_product[static_cast<std::size_t>(mixed.index)] = 0;
      }
    }
    for (const Product& product : products) {
      projection.terms.emplace_back();
      auto& term = projection.terms.back();
      term.across = FilterOf<Real>(axes.across, kernels::Axis::kAcross, disparity, product.across,
                                   options.between, options.threads);
      // The axes of the last term are not read again; freeing them makes room for the other filter.
      if (&product == &products.back()) axes.across = {};
      term.down = FilterOf<Real>(axes.down, kernels::Axis::kDown, disparity, product.down,
                                 options.between, options.threads);
    }
  }
  projection.rows = RunsOf<Real>(fan, disparity, is_product, options.threads, options.freed);
  if (options.fan) {
    DropCentre(&fan);
    projection.fan = std::move(fan);
  }
  return projection;
}

template class SceneProjection<float>;
template class SceneProjection<double>;
template SceneProjection<float> MakeSceneProjection(const DisparityMap&, const Eigen::ArrayXXd&,
                                                    const ProjectionOptions&);
template SceneProjection<double> MakeSceneProjection(const DisparityMap&, const Eigen::ArrayXXd&,
                                                     const ProjectionOptions&);

DisparityMap PhotographDisparity(const DisparityMap& on_grid,
                                 const Eigen::Vector2d& landing_step_px) {
  DisparityMap map = on_grid;
  const Eigen::Vector2d& step = on_grid.step;
  const int axis = std::abs(step.x()) >= std::abs(step.y()) ? 0 : 1;
  const double offset = step[axis] == 0 ? 0 : landing_step_px[axis] / step[axis];
  for (int other = 0; other < 2; ++other) {
    const double expected = offset * step[other];
    if (std::abs(expected - landing_step_px[other]) <= 1e-6 * (1 + std::abs(expected))) continue;
    throw Error(
        fmt::format("light field: its rays land {:.6g} px beside their samples per view across and "
                    "{:.6g} down, "
                    "where steps of {:.6g} and {:.6g} ask for the same ratio",
                    landing_step_px.x(), landing_step_px.y(), step.x(), step.y()));
  }
  for (float& d : map.disparity) d = static_cast<float>(d - offset);
  return map;
}

}  // namespace thicklens::estimator
