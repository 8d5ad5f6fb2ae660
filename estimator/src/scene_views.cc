#include "scene_views.h"

#include <memory>
#include <mutex>
#include <optional>
#include <utility>
#include <vector>

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

  void Make(const CompactView& view, model::LinearPicture* made) {
    if (native_) return native_->Warp(view, made);
    const ViewDisparity whole = Expanded(view);
    *made = {picture_.width_px, picture_.height_px, picture_.channels, std::move(made->values)};
    made->values.resize(picture_.values.size());
    const std::lock_guard<std::mutex> lock(mutex_);  // a device has one queue
    on_device_->Warp({&whole.disparity, &whole.source_x, &whole.source_y}, &made->values);
  }

 private:
  const model::LinearPicture& picture_;
  std::optional<PictureWarper> native_;
  std::unique_ptr<kernels::ViewWarp> on_device_;
  std::mutex mutex_;
};

// Pictures whose memory can be taken again, by many threads: what is new to the process costs more
// than a view.
class SparePictures {
 public:
  model::LinearPicture Take() {
    const std::lock_guard<std::mutex> lock(mutex_);
    if (spare_.empty()) return {};
    model::LinearPicture picture = std::move(spare_.back());
    spare_.pop_back();
    return picture;
  }
  void Give(model::LinearPicture picture) {
    const std::lock_guard<std::mutex> lock(mutex_);
    spare_.push_back(std::move(picture));
  }

 private:
  std::mutex mutex_;
  std::vector<model::LinearPicture> spare_;
};

}  // namespace

void ShowInAllViews(const EstimateInput& input, const SolvedScene& solved, int threads,
                    kernels::Backend* backend, IterationProgress* progress,
                    const SceneViewSink& sink) {
  const auto u_count = static_cast<int>(input.weights.cols());
  const auto v_count = static_cast<int>(input.weights.rows());
  const DisparityRenderer renderer(input.disparity);
  ViewMaker maker(solved.radiance, input.disparity, backend);
  SparePictures spare;
  model::ParallelFor(u_count * v_count, threads, [&](int view) {
    const int k = view % u_count, l = view / u_count;
    const double a = k - (u_count - 1) / 2.0, b = l - (v_count - 1) / 2.0;
    const CompactView* seen = ViewAt(solved.fan, a, b);
    const CompactView rendered = seen != nullptr ? CompactView() : renderer.RenderCompact(a, b);
    if (seen == nullptr) seen = &rendered;
    model::LinearPicture made = spare.Take();
    maker.Make(*seen, &made);
    sink.take(
        k, l, made,
        sink.wants_confidence ? RayConfidence(solved.of_points, *seen) : std::vector<Confidence>());
    spare.Give(std::move(made));
    progress->Count();
  });
}

}  // namespace thicklens::estimator
