#include "estimator/projection/angular_bundle.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>

#include "thicklens/base/index.h"
#include "thicklens/base/parallel.h"

namespace thicklens::estimator {
namespace {

constexpr float kNone = std::numeric_limits<float>::quiet_NaN();

double Offset(int position, int count) { return position - (count - 1) / 2.0; }

// Returns a view's displacements to its sources along one axis, NaN where it is hidden. They come
// from the bundle if it contains the view.
std::vector<float> SourcesOf(const AngularBundle& bundle, const DisparityMap& disparity, double a,
                             double b, bool across) {
  const auto ways_of = [across](const CompactView& view) {
    std::vector<float> ways = view.disparity;
    const auto shift = static_cast<float>(across ? view.shift.x() : view.shift.y());
    for (float& way : ways) way *= shift;
    return ways;
  };
  if (const CompactView* view = ViewAt(bundle, a, b)) return ways_of(*view);
  return ways_of(DisparityRenderer(disparity).RenderCompact(a, b));
}

// Returns the displacements for a position on an axis of the aperture. For an even count of views
// they are the mean of the two views beside the axis.
std::vector<float> SourcesOnAxis(const AngularBundle& bundle, const DisparityMap& disparity,
                                 double offset, int other_count, bool across) {
  const auto of = [&](double other) {
    return across ? SourcesOf(bundle, disparity, offset, other, true)
                  : SourcesOf(bundle, disparity, other, offset, false);
  };
  if (other_count % 2 == 1) return of(0);
  std::vector<float> way = of(-0.5);
  const std::vector<float> beside = of(0.5);
  for (std::size_t i = 0; i < way.size(); ++i) way[i] = 0.5F * (way[i] + beside[i]);
  return way;
}

}  // namespace

double BytesOf(const AngularBundle& bundle) {
  std::size_t bytes = 0;
  for (const BundleView& view : bundle.views) {
    bytes += view.sees.disparity.capacity() * sizeof(float) +
             view.sees.occluded.capacity() * sizeof(CompactView::Occluded) +
             view.sees.boundary.capacity() * sizeof(CompactView::Boundary);
  }
  return static_cast<double>(bytes);
}

const CompactView* ViewAt(const AngularBundle& bundle, double a, double b) {
  for (const BundleView& view : bundle.views) {
    if (view.a == a && view.b == b) return &view.sees;
  }
  return nullptr;
}

AngularBundle RenderBundle(const DisparityMap& disparity, const Eigen::ArrayXXd& weights,
                           int threads, const std::function<void()>& progress) {
  AngularBundle bundle;
  bundle.width_px = disparity.width_px;
  bundle.height_px = disparity.height_px;
  const int u_count = static_cast<int>(weights.cols()), v_count = static_cast<int>(weights.rows());
  for (int l = 0; l < v_count; ++l) {
    for (int k = 0; k < u_count; ++k) {
      if (!(weights(l, k) > 0)) continue;
      BundleView view;
      view.a = Offset(k, u_count);
      view.b = Offset(l, v_count);
      view.weight = weights(l, k);
      bundle.views.push_back(view);
    }
  }
  const DisparityRenderer renderer(disparity);
  ParallelFor(static_cast<int>(bundle.views.size()), threads, [&](int i) {
    if (progress) progress();
    BundleView& view = bundle.views[Index(i)];
    view.sees = renderer.RenderCompact(view.a, view.b);
  });
  return bundle;
}

BundleAxes AxesOf(const AngularBundle& bundle, const DisparityMap& disparity, int u_count,
                  int v_count, int threads) {
  BundleAxes axes;
  axes.across = {u_count, std::vector<std::vector<float>>(Index(u_count)), {}};
  axes.down = {v_count, std::vector<std::vector<float>>(Index(v_count)), {}};
  ParallelFor(u_count + v_count, threads, [&](int i) {
    if (i < u_count) {
      axes.across.source_px[Index(i)] =
          SourcesOnAxis(bundle, disparity, Offset(i, u_count), v_count, true);
    } else {
      axes.down.source_px[Index(i - u_count)] =
          SourcesOnAxis(bundle, disparity, Offset(i - u_count, v_count), u_count, false);
    }
  });
  for (BundleAxis* axis : {&axes.across, &axes.down}) {
    axis->usable.assign(disparity.disparity.size(), 1);
    for (const std::vector<float>& way : axis->source_px) {
      for (std::size_t i = 0; i < way.size(); ++i) {
        if (std::isnan(way[i])) axis->usable[i] = 0;
      }
    }
    for (std::vector<float>& way : axis->source_px) {
      for (std::size_t i = 0; i < way.size(); ++i) {
        if (axis->usable[i] == 0) way[i] = kNone;
      }
    }
  }
  return axes;
}

}  // namespace thicklens::estimator
