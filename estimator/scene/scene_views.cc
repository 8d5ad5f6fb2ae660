#include "estimator/scene/scene_views.h"

#include <memory>
#include <mutex>
#include <optional>
#include <utility>
#include <vector>

#include "estimator/views/surface_taps.h"
#include "thicklens/base/parallel.h"
#include "thicklens/estimator/view_geometry.h"
#include "thicklens/kernels/device.h"
#include "thicklens/kernels/view_warp.h"

namespace thicklens::estimator {
namespace {

// Objects whose memory is reused, by many threads: memory that is new to the process costs more
// than a view.
template <typename T>
class Spare {
 public:
  T Take() {
    const std::lock_guard<std::mutex> lock(mutex_);
    if (spare_.empty()) return {};
    T object = std::move(spare_.back());
    spare_.pop_back();
    return object;
  }
  void Give(T object) {
    const std::lock_guard<std::mutex> lock(mutex_);
    spare_.push_back(std::move(object));
  }

 private:
  std::mutex mutex_;
  std::vector<T> spare_;
};

kernels::ViewSources SourcesOf(const CompactView& view) {
  return {&view.disparity, view.shift.x(), view.shift.y(), &view.occluded, &view.boundary};
}

// Makes views of one image, on a device or on the processor; for use by many threads.
class ViewMaker {
 public:
  ViewMaker(const model::LinearImage& image, const DisparityMap& map, kernels::Backend* backend)
      : image_(image) {
    if (backend == nullptr || !backend->is_opencl()) {
      cpu_.emplace(image, map);
      return;
    }
    on_device_ = backend->NewWarp({image.width_px, image.height_px, image.channels, &image.values,
                                   &map.disparity, static_cast<float>(SurfaceTolerance(map))});
  }

  void Make(const CompactView& view, model::LinearImage* made) {
    if (cpu_) return cpu_->Warp(view, made);
    *made = {image_.width_px, image_.height_px, image_.channels, std::move(made->values)};
    on_device_->Warp(SourcesOf(view), &made->values);
  }

 private:
  const model::LinearImage& image_;
  std::optional<ImageWarper> cpu_;
  std::unique_ptr<kernels::ViewWarp> on_device_;
};

}  // namespace

void ShowInAllViews(const EstimateInput& input, const SolvedScene& solved, int threads,
                    kernels::Backend* backend, IterationProgress* progress,
                    const SceneViewSink& sink) {
  const auto u_count = static_cast<int>(input.weights.cols());
  const auto v_count = static_cast<int>(input.weights.rows());
  const DisparityRenderer renderer(input.disparity);
  ViewMaker maker(solved.radiance, input.disparity, backend);
  Spare<model::LinearImage> spare;
  ParallelFor(u_count * v_count, threads, [&](int view) {
    const int k = view % u_count, l = view / u_count;
    const double a = k - (u_count - 1) / 2.0, b = l - (v_count - 1) / 2.0;
    const CompactView* seen = ViewAt(solved.bundle, a, b);
    const CompactView rendered = seen != nullptr ? CompactView() : renderer.RenderCompact(a, b);
    if (seen == nullptr) seen = &rendered;
    model::LinearImage made = spare.Take();
    maker.Make(*seen, &made);
    sink.take(
        k, l, made,
        sink.wants_confidence ? RayConfidence(solved.of_points, *seen) : std::vector<Confidence>());
    spare.Give(std::move(made));
    progress->Count();
  });
}

}  // namespace thicklens::estimator
