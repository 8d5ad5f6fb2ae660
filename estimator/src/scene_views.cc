#include "scene_views.h"

#include <memory>
#include <mutex>
#include <optional>

#include "surface_taps.h"
#include "thicklens/model/parallel.h"

namespace thicklens::estimator {
namespace {

// Views of one picture, on a device or on the processor; by many threads.
class ViewMaker {
 public:
  ViewMaker(const model::LinearPicture& picture, const DisparityMap& map, kernels::Backend* backend)
      : picture_(picture) {
    if (backend == nullptr || !backend->is_opencl()) {
      native_.emplace(picture, map);
      return;
    }
    on_device_ =
        backend->NewWarp({picture.width_px, picture.height_px, picture.channels, &picture.values,
                          &map.disparity, static_cast<float>(SurfaceTolerance(map))});
  }

  model::LinearPicture Make(const ViewDisparity& view) {
    if (native_) return native_->Warp(view);
    model::LinearPicture made{picture_.width_px, picture_.height_px, picture_.channels, {}};
    made.values.resize(picture_.values.size());
    const std::lock_guard<std::mutex> lock(mutex_);  // a device has one queue
    on_device_->Warp({&view.disparity, &view.source_x, &view.source_y}, &made.values);
    return made;
  }

 private:
  const model::LinearPicture& picture_;
  std::optional<PictureWarper> native_;
  std::unique_ptr<kernels::ViewWarp> on_device_;
  std::mutex mutex_;
};

}  // namespace

void ShowInAllViews(const EstimateInput& input, const SolvedScene& solved, int threads,
                    kernels::Backend* backend, IterationProgress* progress,
                    const SceneViewSink& sink) {
  const auto u_count = static_cast<int>(input.weights.cols());
  const auto v_count = static_cast<int>(input.weights.rows());
  const DisparityRenderer renderer(input.disparity);
  ViewMaker maker(solved.radiance, input.disparity, backend);
  model::ParallelFor(u_count * v_count, threads, [&](int view) {
    const int k = view % u_count, l = view / u_count;
    const double a = k - (u_count - 1) / 2.0, b = l - (v_count - 1) / 2.0;
    const ViewDisparity rendered = renderer.Render(a, b);
    sink.take(k, l, maker.Make(rendered), RayConfidence(solved.of_points, rendered));
    progress->Count();
  });
}

}  // namespace thicklens::estimator
