#include "estimator/projection/scene_rays.h"

#include <algorithm>
#include <cmath>

#include "estimator/views/surface_taps.h"
#include "thicklens/base/cancel.h"
#include "thicklens/base/index.h"
#include "thicklens/base/parallel.h"

namespace thicklens::estimator {
namespace {

// Rows of the photograph that are summed together.
constexpr int kBandRows = 8;

template <typename Real>
std::int32_t Floor(Real x) {
  const auto toward_zero = static_cast<std::int32_t>(x);
  return toward_zero - (static_cast<Real>(toward_zero) > x ? 1 : 0);
}

template <typename Choose>
std::vector<float> OfCells(const DisparityMap& map, const Choose& choose) {
  const std::size_t width = Index(map.width_px);
  std::vector<float> chosen(map.disparity.size());
  for (std::size_t i = 0; i + width + 1 < chosen.size(); ++i) {
    const float* d = map.disparity.data() + i;
    chosen[i] = choose(choose(d[0], d[1]), choose(d[width], d[width + 1]));
  }
  return chosen;
}

}  // namespace

template <typename Real>
ViewRays<Real>::ViewRays(const DisparityMap& map, const std::vector<float>& lowest,
                         const std::vector<float>& highest, const ViewDisparity& view, double a,
                         double b)
    : width_px_(map.width_px),
      shift_x_(static_cast<Real>(a * map.step.x())),
      shift_y_(static_cast<Real>(b * map.step.y())) {
  disparity_.reserve(view.disparity.size() + kMargin);
  disparity_.assign(view.disparity.begin(), view.disparity.end());
  disparity_.resize(view.disparity.size() + kMargin, Real{0});
  const double tolerance = SurfaceTolerance(map);
  const auto room = static_cast<float>(tolerance);
  std::size_t i = 0;
  for (int y = 0; y < map.height_px; ++y) {
    ThrowIfCancelled();
    run_start_.push_back(runs_.size());
    odd_start_.push_back(odd_.size());
    for (int x = 0; x < map.width_px; ++x, ++i) {
      const float d = view.disparity[i];
      const std::int32_t step_x = Floor(shift_x_ * d), step_y = Floor(shift_y_ * d);
      const int cell_x = x + step_x, cell_y = y + step_y;
      bool plain = view.visibility[i] == Visibility::kVisible && cell_x >= 0 &&
                   cell_x + 1 < map.width_px && cell_y >= 0 && cell_y + 1 < map.height_px;
      if (plain) {
        const std::size_t cell = Index(cell_y) * Index(map.width_px) + Index(cell_x);
        plain = highest[cell] - d <= room && d - lowest[cell] <= room;
      }
      if (!plain) {
        odd_.push_back(OddRayOf(map, tolerance, i,
                                {0, view.source_x[i], view.source_y[i], view.disparity[i]}));
        disparity_[i] = 0;
        continue;
      }
      const bool goes_on = runs_.size() > run_start_.back() &&
                           runs_.back().x + runs_.back().count == x &&
                           runs_.back().step_x == step_x && runs_.back().step_y == step_y;
      if (!goes_on) runs_.push_back({x, 0, step_x, step_y});
      ++runs_.back().count;
    }
  }
  run_start_.push_back(runs_.size());
  odd_start_.push_back(odd_.size());
  AddBoundaryRays(map, tolerance, view);
  runs_.shrink_to_fit();
  odd_.shrink_to_fit();
}

template <typename Real>
typename ViewRays<Real>::OddRay ViewRays<Real>::OddRayOf(
    const DisparityMap& map, double tolerance, std::size_t sample,
    const kernels::OccludedSample& source) const {
  const std::size_t x = sample % Index(map.width_px), y = sample / Index(map.width_px);
  const SurfaceTaps taps =
      TapsAt(map, tolerance, static_cast<double>(x) + static_cast<double>(source.source_x),
             static_cast<double>(y) + static_cast<double>(source.source_y), source.disparity);
  OddRay ray;
  ray.x = static_cast<std::int32_t>(x);
  ray.pixel.fill(static_cast<std::int32_t>(taps.pixel[0]));
  for (std::size_t t = 0; t < Index(taps.count); ++t) {
    ray.pixel[t] = static_cast<std::int32_t>(taps.pixel[t]);
    ray.weight[t] = static_cast<Real>(taps.weight[t]);
  }
  return ray;
}

template <typename Real>
void ViewRays<Real>::AddBoundaryRays(const DisparityMap& map, double tolerance,
                                     const ViewDisparity& view) {
  boundary_.reserve(view.boundary.size());
  mixed_start_.assign(Index(map.height_px) + 1, view.boundary.size());
  std::size_t row = 0;
  for (const kernels::BoundarySample& boundary : view.boundary) {
    const std::size_t sample = Index(boundary.index);
    while (row <= sample / Index(map.width_px)) mixed_start_[row++] = boundary_.size();
    BoundaryRay ray{OddRayOf(map, tolerance, sample, boundary.other),
                    1 - static_cast<Real>(boundary.share)};
    for (Real& weight : ray.other.weight) weight *= static_cast<Real>(boundary.share);
    boundary_.push_back(ray);
  }
}

template <typename Real>
kernels::RayRow<Real> ViewRays<Real>::RowOf(int row) const {
  return {disparity_.data() + Index(row) * Index(width_px_),
          shift_x_,
          shift_y_,
          runs_.data() + run_start_[Index(row)],
          runs_.data() + run_start_[Index(row) + 1],
          width_px_};
}

template <typename Real>
void ViewRays<Real>::Warp(int row, const Real* image, Real* warped) const {
  kernels::WarpRow(RowOf(row), image + Index(row) * Index(width_px_), warped);
  for (std::size_t n = odd_start_[Index(row)]; n < odd_start_[Index(row) + 1]; ++n) {
    const OddRay& ray = odd_[n];
    Real sum = 0;
    for (std::size_t t = 0; t < 4; ++t) sum += ray.weight[t] * image[ray.pixel[t]];
    warped[ray.x] = sum;
  }
  for (std::size_t n = mixed_start_[Index(row)]; n < mixed_start_[Index(row) + 1]; ++n) {
    const OddRay& other = boundary_[n].other;
    Real sum = boundary_[n].rest * warped[other.x];
    for (std::size_t t = 0; t < 4; ++t) sum += other.weight[t] * image[other.pixel[t]];
    warped[other.x] = sum;
  }
}

template <typename Real>
void ViewRays<Real>::Spread(int row, Real* values, Real* image) const {
  for (std::size_t n = mixed_start_[Index(row)]; n < mixed_start_[Index(row) + 1]; ++n) {
    const OddRay& other = boundary_[n].other;
    for (std::size_t t = 0; t < 4; ++t) image[other.pixel[t]] += other.weight[t] * values[other.x];
    values[other.x] *= boundary_[n].rest;
  }
  kernels::SpreadRow(RowOf(row), values, image + Index(row) * Index(width_px_));
  for (std::size_t n = odd_start_[Index(row)]; n < odd_start_[Index(row) + 1]; ++n) {
    const OddRay& ray = odd_[n];
    for (std::size_t t = 0; t < 4; ++t) image[ray.pixel[t]] += ray.weight[t] * values[ray.x];
  }
}

template <typename Real>
double ViewRays<Real>::bytes() const {
  return static_cast<double>(
      disparity_.capacity() * sizeof(Real) + runs_.capacity() * sizeof(kernels::RayRun) +
      odd_.capacity() * sizeof(OddRay) + boundary_.capacity() * sizeof(BoundaryRay) +
      3 * run_start_.capacity() * sizeof(std::size_t));
}

template <typename Real>
SceneRays<Real>::SceneRays(const DisparityMap& disparity, const Eigen::ArrayXXd& weights,
                           int threads, const std::function<void()>& progress)
    : width_px_(disparity.width_px),
      height_px_(disparity.height_px),
      threads_(threads),
      views_(static_cast<std::size_t>(weights.size())) {
  const auto u_count = static_cast<int>(weights.cols()), v_count = static_cast<int>(weights.rows());
  for (int l = 0; l < v_count; ++l) {
    for (int k = 0; k < u_count; ++k) weights_.push_back(static_cast<Real>(weights(l, k)));
  }
  const std::vector<float> lowest =
      OfCells(disparity, [](float a, float b) { return std::min(a, b); });
  const std::vector<float> highest =
      OfCells(disparity, [](float a, float b) { return std::max(a, b); });
  const DisparityRenderer renderer(disparity);
  ParallelFor(u_count * v_count, threads, [&](int view) {
    if (progress) progress();
    if (!(weights_[Index(view)] > 0)) return;
    const double a = view % u_count - (u_count - 1) / 2.0;
    const double b = view / u_count - (v_count - 1) / 2.0;
    views_[Index(view)] = ViewRays<Real>(disparity, lowest, highest, renderer.Render(a, b), a, b);
  });
  const std::size_t bands = Index((height_px_ + kBandRows - 1) / kBandRows);
  rows_.resize(std::max(bands, views_.size()) * (Index(width_px_) + ViewRays<Real>::kMargin));
}

template <typename Real>
std::size_t SceneRays<Real>::plane_stride() const {
  constexpr std::size_t kMultiple = ViewRays<Real>::kMargin;
  return (pixels() + kMultiple - 1) / kMultiple * kMultiple + ViewRays<Real>::kMargin;
}

template <typename Real>
void SceneRays<Real>::Apply(const Real* planes, std::size_t stride, Real* photograph) {
  const std::size_t width = Index(width_px_);
  const int bands = (height_px_ + kBandRows - 1) / kBandRows;
  ParallelFor(bands, threads_, [&](int band) {
    const int first = band * kBandRows, last = std::min(height_px_, first + kBandRows);
    Real* warped = rows_.data() + Index(band) * (width + ViewRays<Real>::kMargin);
    std::fill(photograph + Index(first) * width, photograph + Index(last) * width, Real{0});
    for (std::size_t k = 0; k < views_.size(); ++k) {
      const Real weight = weights_[k];
      if (!(weight > 0)) continue;
      for (int y = first; y < last; ++y) {
        views_[k].Warp(y, planes + k * stride, warped);
        Real* sum = photograph + Index(y) * width;
        for (std::size_t x = 0; x < width; ++x) sum[x] += weight * warped[x];
      }
    }
  });
}

template <typename Real>
void SceneRays<Real>::ApplyTransposed(const Real* photograph, Real* planes) {
  const std::size_t width = Index(width_px_), stride = plane_stride();
  ParallelFor(static_cast<int>(views_.size()), threads_, [&](int view) {
    const std::size_t k = Index(view);
    Real* plane = planes + k * stride;
    std::fill(plane, plane + stride, Real{0});
    const Real weight = weights_[k];
    if (!(weight > 0)) return;
    Real* values = rows_.data() + k * (width + ViewRays<Real>::kMargin);
    for (int y = 0; y < height_px_; ++y) {
      ThrowIfCancelled();
      const Real* row = photograph + Index(y) * width;
      for (std::size_t x = 0; x < width; ++x) values[x] = weight * row[x];
      views_[k].Spread(y, values, plane);
    }
  });
}

template <typename Real>
void SceneRays<Real>::Show(std::size_t k, const Real* plane, float* shown) const {
  const std::size_t width = Index(width_px_);
  std::vector<Real> warped(width + ViewRays<Real>::kMargin);
  for (int y = 0; y < height_px_; ++y) {
    ThrowIfCancelled();
    views_[k].Warp(y, plane, warped.data());
    for (std::size_t x = 0; x < width; ++x) {
      shown[Index(y) * width + x] = static_cast<float>(warped[x]);
    }
  }
}

template <typename Real>
double SceneRays<Real>::bytes() const {
  double sum = static_cast<double>(rows_.capacity() * sizeof(Real));
  for (const ViewRays<Real>& view : views_) sum += view.bytes();
  return sum;
}

template class ViewRays<float>;
template class ViewRays<double>;
template class SceneRays<float>;
template class SceneRays<double>;

}  // namespace thicklens::estimator
