#include "estimator/functional/grid_links.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "estimator/projection/grid_photograph.h"
#include "estimator/views/same_point.h"
#include "thicklens/base/index.h"
#include "thicklens/base/parallel.h"
#include "thicklens/kernels/grid_loops.h"

namespace thicklens::estimator {
namespace {

constexpr std::size_t kBandSamples = kernels::kLongestRun;

}  // namespace

GridLinks::GridLinks(const DisparityMap& map, std::vector<std::vector<float>> disparity,
                     const kernels::BlockGeometry& image, int threads)
    : map_(map),
      disparity_(std::move(disparity)),
      image_(image),
      threads_(threads),
      across_(Index(image.views())),
      down_(Index(image.views())) {
  ParallelFor(image.views(), threads, [&](int view) {
    across_[Index(view)] = FindLinks(Axis::kU, view);
    down_[Index(view)] = FindLinks(Axis::kV, view);
  });
}

std::size_t GridLinks::BandCount() const {
  return (Index(image_.s_count) + kBandSamples - 1) / kBandSamples;
}

bool GridLinks::FindLink(Axis axis, int view, int s, int t, Run* run) const {
  const int k = view % image_.u_count, l = view / image_.u_count;
  const bool across = axis == Axis::kU;
  if (across ? k + 1 == image_.u_count : l + 1 == image_.v_count) return false;
  // The shifts of a view lead from its samples to the pixels that they land on.
  const LandingRect here = LandingIn(image_, k, l);
  const LandingRect there = LandingIn(image_, across ? k + 1 : k, across ? l : l + 1);
  const int x = s + image_.s_shift[Index(k)], y = t + image_.t_shift[Index(l)];
  if (x < here.x_begin || x >= here.x_end || y < here.y_begin || y >= here.y_end) return false;
  const int first = across ? there.x_begin - image_.s_shift[Index(k + 1)]
                           : there.y_begin - image_.t_shift[Index(l + 1)];
  const int end = across ? there.x_end - image_.s_shift[Index(k + 1)]
                         : there.y_end - image_.t_shift[Index(l + 1)];

  const double d = disparity_[Index(view)][Index(t) * Index(image_.s_count) + Index(s)];
  const double m = -d * (across ? map_.step.x() : map_.step.y());
  const int next = view + (across ? 1 : image_.u_count);
  if (!ShowsSamePoint(map_, disparity_[Index(next)], across ? s + m : s, across ? t : t + m, d)) {
    return false;
  }
  const double floored = std::floor(m);
  const double w = m - floored;
  run->sample = s;
  run->count = 1;
  run->whole = static_cast<std::int32_t>(floored);
  run->is_single = w == 0 || w == 1;  // 1 by rounding
  if (w == 1) ++run->whole;
  const int near = (across ? s : t) + run->whole;
  return near >= first && near + (run->is_single ? 0 : 1) < end;
}

GridLinks::ViewLinks GridLinks::FindLinks(Axis axis, int view) const {
  ViewLinks links;
  for (int t = 0; t < image_.t_count; ++t) {
    for (int s = 0; s < image_.s_count; ++s) {
      if (Index(s) % kBandSamples == 0) links.start.push_back(links.runs.size());
      Run run;
      if (!FindLink(axis, view, s, t, &run)) continue;
      if (links.runs.size() > links.start.back()) {
        Run& last = links.runs.back();
        if (last.sample + last.count == s && last.whole == run.whole &&
            last.is_single == run.is_single) {
          ++last.count;
          continue;
        }
      }
      links.runs.push_back(run);
    }
  }
  links.start.push_back(links.runs.size());
  links.runs.shrink_to_fit();
  return links;
}

template <typename Real>
void GridLinks::AddBand(Axis axis, int view, int t, std::size_t band, Real gamma, const Real* x,
                        Real* y) const {
  const bool across = axis == Axis::kU;
  const ViewLinks& links = (across ? across_ : down_)[Index(view)];
  const std::size_t width = Index(image_.s_count), view_size = width * Index(image_.t_count);
  const std::size_t row = Index(t) * width;
  const Real* here = x + Index(view) * view_size;
  Real* sum_here = y + Index(view) * view_size;
  const std::size_t to_next = (across ? 1 : Index(image_.u_count)) * view_size;
  const std::size_t to_far = across ? 1 : width;
  const std::size_t first = Index(t) * BandCount() + band;
  for (std::size_t n = links.start[first]; n < links.start[first + 1]; ++n) {
    const Run& run = links.runs[n];
    const std::size_t at = row + Index(run.sample);
    // A negative `whole` wraps around, and the sum is still correct.
    const std::size_t near =
        at + to_next + static_cast<std::size_t>(run.whole) * (across ? 1 : width);
    kernels::LinkRun<Real> loop;
    loop.count = Index(run.count);
    loop.disparity = disparity_[Index(view)].data() + at;
    loop.slope = static_cast<Real>(-(across ? map_.step.x() : map_.step.y()));
    loop.whole = static_cast<Real>(run.whole);
    loop.here = here + at;
    loop.near = here + near;
    loop.far = run.is_single ? nullptr : here + near + to_far;
    loop.sum_here = sum_here + at;
    loop.sum_near = sum_here + near;
    loop.sum_far = run.is_single ? nullptr : sum_here + near + to_far;
    kernels::AddLinks(gamma, loop);
  }
}

template <typename Real>
void GridLinks::Apply(double gamma, double mu, const Real* x, Real* y) const {
  const std::size_t width = Index(image_.s_count), view_size = width * Index(image_.t_count);
  const auto gamma_here = static_cast<Real>(gamma), mu_here = static_cast<Real>(mu);
  // Differences across link a row of a view to the same row of the next view; differences down link
  // a column.
  ParallelFor(image_.v_count * image_.t_count, threads_, [&](int i) {
    const int l = i / image_.t_count, t = i % image_.t_count;
    for (int k = 0; k < image_.u_count; ++k) {
      const std::size_t from = Index(l * image_.u_count + k) * view_size + Index(t) * width;
      for (std::size_t s = from; s < from + width; ++s) y[s] = mu_here * x[s];
    }
    for (int k = 0; k + 1 < image_.u_count; ++k) {
      for (std::size_t band = 0; band < BandCount(); ++band) {
        AddBand(Axis::kU, l * image_.u_count + k, t, band, gamma_here, x, y);
      }
    }
  });
  const auto bands = static_cast<int>(BandCount());
  ParallelFor(image_.u_count * bands, threads_, [&](int i) {
    const int k = i / bands;
    const std::size_t band = Index(i % bands);
    for (int l = 0; l + 1 < image_.v_count; ++l) {
      for (int t = 0; t < image_.t_count; ++t) {
        AddBand(Axis::kV, l * image_.u_count + k, t, band, gamma_here, x, y);
      }
    }
  });
}

double GridLinks::bytes() const {
  double sum = 0;
  for (const auto& view : disparity_) sum += static_cast<double>(view.capacity() * sizeof(float));
  for (const auto* links : {&across_, &down_}) {
    for (const ViewLinks& view : *links) {
      sum += static_cast<double>(view.runs.capacity() * sizeof(Run) +
                                 view.start.capacity() * sizeof(std::size_t));
    }
  }
  return sum;
}

template void GridLinks::Apply(double, double, const float*, float*) const;
template void GridLinks::Apply(double, double, const double*, double*) const;

}  // namespace thicklens::estimator
