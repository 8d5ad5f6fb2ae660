#include "estimator/projection/scene_projection.h"

#include <fmt/format.h>

#include <Eigen/SVD>
#include <algorithm>
#include <cmath>

#include "estimator/projection/separable_mask.h"
#include "estimator/projection/visible_fraction.h"
#include "thicklens/base/error.h"

namespace thicklens::estimator {
namespace {

// A sum of this many products costs no more than rows for all pixels would.
constexpr int kMaxTerms = 4;

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

std::vector<float> OccludedFraction(const AngularBundle& bundle, std::size_t pixels) {
  std::vector<double> share(pixels, 0.0);
  for (const BundleView& view : bundle.views) {
    for (const CompactView::Occluded& occluded : view.sees.occluded)
      share[static_cast<std::size_t>(occluded.index)] += view.weight;
    for (const CompactView::Boundary& boundary : view.sees.boundary) {
      const auto i = static_cast<std::size_t>(boundary.index);
      const double occluded_before = std::isnan(view.sees.disparity[i]) ? 1 : 0;
      const double other_occluded = boundary.other.index == boundary.index ? 0 : 1;
      share[i] +=
          view.weight * static_cast<double>(boundary.share) * (other_occluded - occluded_before);
    }
  }
  return {share.begin(), share.end()};
}

// The centre view is the map itself.
void DropCentre(AngularBundle* bundle) {
  const auto is_centre = [](const BundleView& view) { return view.a == 0 && view.b == 0; };
  bundle->views.erase(std::remove_if(bundle->views.begin(), bundle->views.end(), is_centre),
                      bundle->views.end());
}

}  // namespace

template <typename Real>
void SceneProjection<Real>::Apply(const Real* x, int channels, Real* y) const {
  const auto stride = static_cast<std::ptrdiff_t>(pixels());
  const std::size_t size = pixels() * static_cast<std::size_t>(channels);
  const kernels::ImageIn<Real> in{x, stride, channels};
  const kernels::ImageOut<Real> out{y, stride, channels};
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
  const kernels::ImageOut<Real> out{x, stride, channels};
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
    for (const kernels::VaryingFilter<Real>* filter : {&term.across, &term.down}) {
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
  AngularBundle bundle = RenderBundle(disparity, weights, options.threads, options.progress);
  const auto u_count = static_cast<int>(weights.cols()), v_count = static_cast<int>(weights.rows());
  const std::vector<Product> products = ProductsOf(weights);
  const bool has_products = products.size() <= kMaxTerms;
  SeparableMask plain;
  if (has_products || options.visible_fraction) {
    plain = FindSeparablePixels(disparity, u_count, v_count, options.tolerance_px);
  }
  SceneProjection<Real> projection;
  projection.width_px = disparity.width_px;
  projection.height_px = disparity.height_px;
  projection.threads = options.threads;
  projection.bundle_bytes = BytesOf(bundle);
  projection.occluded_fraction = OccludedFraction(bundle, projection.pixels());
  if (options.visible_fraction)
    projection.visible_fraction =
        VisibleFraction(bundle, disparity, plain.is_visible, options.threads);

  std::vector<unsigned char> is_product(projection.pixels(), 0);
  if (has_products) {
    BundleAxes axes = AxesOf(bundle, disparity, u_count, v_count, options.threads);
    is_product =
        IsProduct(bundle, axes, disparity, options.tolerance_px, plain.is_product, options.threads);
    for (const BundleView& view : bundle.views) {
      for (const CompactView::Boundary& boundary : view.sees.boundary) {
        is_product[static_cast<std::size_t>(boundary.index)] = 0;
      }
    }
    for (const Product& product : products) {
      projection.terms.emplace_back();
      auto& term = projection.terms.back();
      term.across = FilterOf<Real>(axes.across, kernels::Axis::kAcross, disparity, product.across,
                                   options.interpolation, options.threads);
      // The axes of the last term are not read again; freeing them makes room for the other filter.
      if (&product == &products.back()) axes.across = {};
      term.down = FilterOf<Real>(axes.down, kernels::Axis::kDown, disparity, product.down,
                                 options.interpolation, options.threads);
    }
  }
  projection.rows = RunsOf<Real>(bundle, disparity, is_product, options.threads, options.freed);
  if (options.bundle) {
    DropCentre(&bundle);
    projection.bundle = std::move(bundle);
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
    throw Error(fmt::format(
        "light field: per view its rays land {:.6g} px (x) and {:.6g} px (y) from their samples: "
        "the ratio of these must be that of the steps, {:.6g} and {:.6g}",
        landing_step_px.x(), landing_step_px.y(), step.x(), step.y()));
  }
  for (float& d : map.disparity) d = static_cast<float>(d - offset);
  return map;
}

}  // namespace thicklens::estimator
