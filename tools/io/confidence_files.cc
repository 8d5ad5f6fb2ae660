#include "thicklens/io/confidence_files.h"

#include <cstddef>

#include "thicklens/base/cancel.h"
#include "thicklens/base/parallel.h"
#include "thicklens/estimator/view_geometry.h"

namespace thicklens::io {

void WriteConfidence(const std::vector<estimator::Confidence>& of_rays, int u_count, int width_px,
                     int height_px, LightFieldWriter* writer) {
  const auto pixels = static_cast<std::ptrdiff_t>(width_px) * height_px;
  const auto views = static_cast<int>(static_cast<std::ptrdiff_t>(of_rays.size()) / pixels);
  for (int i = 0; i < views; ++i) {
    ThrowIfCancelled();
    const auto first = of_rays.begin() + i * pixels;
    writer->WriteConfidence(i % u_count, i / u_count, {first, first + pixels}, width_px);
  }
}

void WriteConfidence(const estimator::EstimateInput& input, int threads, LightFieldWriter* writer) {
  const std::vector<estimator::Confidence> of_points = estimator::PointConfidence(input, threads);
  const estimator::DisparityRenderer renderer(input.disparity);
  const auto u_count = static_cast<int>(input.weights.cols());
  const auto v_count = static_cast<int>(input.weights.rows());
  ParallelFor(u_count * v_count, ResolveThreads(threads), [&](int i) {
    ThrowIfCancelled();
    const int k = i % u_count, l = i / u_count;
    const estimator::CompactView view =
        renderer.RenderCompact(k - (u_count - 1) / 2.0, l - (v_count - 1) / 2.0);
    writer->WriteConfidence(k, l, estimator::RayConfidence(of_points, view), view.width_px);
  });
}

}  // namespace thicklens::io
