#include "estimator/projection/visible_fraction.h"

#include <cstddef>

#include "estimator/views/surface_taps.h"
#include "thicklens/base/index.h"
#include "thicklens/base/parallel.h"
#include "thicklens/kernels/seen_row.h"

namespace thicklens::estimator {
std::vector<float> VisibleFraction(const AngularBundle& bundle, const DisparityMap& disparity,
                                   const std::vector<unsigned char>& known, int threads) {
  const auto same_surface = static_cast<float>(SurfaceTolerance(disparity));
  std::vector<float> share(disparity.disparity.size(), 0.0F);
  ParallelFor(disparity.height_px, threads, [&](int y) {
    const std::size_t at = Index(y) * Index(disparity.width_px);
    for (const BundleView& view : bundle.views) {
      kernels::AddVisible(
          {disparity.width_px, disparity.height_px, y, static_cast<float>(view.sees.shift.x()),
           static_cast<float>(view.sees.shift.y()), disparity.disparity.data() + at,
           view.sees.disparity.data(), known.data() + at, same_surface,
           static_cast<float>(view.weight)},
          share.data() + at);
    }
  });
  return share;
}

}  // namespace thicklens::estimator
