// Views and refocused images of a scene.
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <utility>

#include "thicklens/base/cancel.h"
#include "thicklens/base/error.h"
#include "thicklens/base/index.h"
#include "thicklens/base/parallel.h"
#include "thicklens/estimator/scene_form.h"
#include "thicklens/estimator/view_geometry.h"

namespace thicklens::estimator {
namespace {

void RequireValid(const SceneForm& scene) {
  std::string why;
  if (!scene.IsValid(&why)) throw Error("scene: " + why);
}

void RequireWeights(const SceneForm& scene, const Eigen::ArrayXXd& weights) {
  const model::LightField& frame = scene.frame;
  if (weights.rows() != frame.v_count || weights.cols() != frame.u_count) {
    throw Error(fmt::format("weights: {} rows of {} numbers: {} rows of {} are needed",
                            weights.rows(), weights.cols(), frame.v_count, frame.u_count));
  }
  if (!weights.allFinite() || !(weights >= 0).all() || !(weights.sum() > 0)) {
    throw Error("weights: they must be finite and >= 0, and one of them > 0");
  }
}

// A view by its place on the aperture, in steps from the middle, and its share in a sum.
struct PlacedView {
  double a = 0, b = 0, weight = 0;
};

std::vector<PlacedView> ViewsWithWeight(const model::LightField& frame,
                                        const Eigen::ArrayXXd& weights) {
  std::vector<PlacedView> views;
  for (int l = 0; l < frame.v_count; ++l) {
    for (int k = 0; k < frame.u_count; ++k) {
      if (weights(l, k) == 0) continue;
      views.push_back({frame.u_offset(k), frame.v_offset(l), weights(l, k) / weights.sum()});
    }
  }
  return views;
}

// Places and weights along one axis of the aperture that stand for its `count` views. These are the
// middles of equal parts of the aperture, whose sum is near the integral. What a view lacks grows
// from the middle to both sides, with a kink in the middle, so each half has a rule of its own.
std::vector<std::pair<double, double>> NodesOf(int count) {
  constexpr int kNodes = 4;
  std::vector<std::pair<double, double>> nodes;
  if (count <= kNodes) {
    for (int k = 0; k < count; ++k) nodes.emplace_back(k - (count - 1) / 2.0, 1.0 / count);
    return nodes;
  }
  const double inner = (1 - 1 / std::sqrt(3.0)) * count / 4;
  const double outer = (1 + 1 / std::sqrt(3.0)) * count / 4;
  for (const double place : {-outer, -inner, inner, outer}) nodes.emplace_back(place, 1.0 / kNodes);
  return nodes;
}

}  // namespace

struct SceneRenderer::Parts {
  explicit Parts(const SceneForm& of)
      : scene(of), geometry(of.disparity), image(of.radiance, of.disparity) {}
  const SceneForm& scene;
  DisparityRenderer geometry;
  ImageWarper image;
};

SceneRenderer::SceneRenderer(const SceneForm& scene) {
  RequireValid(scene);
  parts_ = std::make_unique<const Parts>(scene);
}
SceneRenderer::~SceneRenderer() = default;
SceneRenderer::SceneRenderer(SceneRenderer&&) noexcept = default;

model::LinearImage SceneRenderer::View(double a, double b) const {
  model::LinearImage view;
  parts_->image.Warp(parts_->geometry.RenderCompact(a, b), &view);
  return view;
}

std::vector<Confidence> SceneRenderer::ViewConfidence(double a, double b) const {
  if (parts_->scene.confidence.empty()) return {};
  return RayConfidence(parts_->scene.confidence, parts_->geometry.RenderCompact(a, b));
}

model::LinearImage RefocusScene(const SceneForm& scene, double disparity,
                                const Eigen::ArrayXXd& weights, int threads) {
  RequireValid(scene);
  RequireWeights(scene, weights);
  if (!std::isfinite(disparity)) {
    throw Error(fmt::format("disparity is {}: it must be finite", disparity));
  }
  // A view that is displaced by the disparity in focus is the view of a map without it.
  DisparityMap map = scene.disparity;
  for (float& value : map.disparity) value -= static_cast<float>(disparity);
  const DisparityRenderer geometry(map);
  const ImageWarper image(scene.radiance, map);
  const std::vector<PlacedView> views = ViewsWithWeight(scene.frame, weights);
  model::LinearImage sum{
      scene.radiance.width_px, scene.radiance.height_px, scene.radiance.channels, {}};
  sum.values.assign(scene.radiance.values.size(), 0.0F);
  // Views are rendered as many at a time as there are threads. Each is added in its turn, so that
  // the sum is the same for any number of them.
  const int at_once = ResolveThreads(threads);
  std::vector<model::LinearImage> rendered(Index(at_once));
  const int count = static_cast<int>(views.size());
  const std::size_t row = Index(sum.width_px) * Index(sum.channels);
  for (int first = 0; first < count; first += at_once) {
    const int these = std::min(at_once, count - first);
    ParallelFor(these, threads, [&](int i) {
      ThrowIfCancelled();
      const PlacedView& view = views[Index(first + i)];
      image.Warp(geometry.RenderCompact(view.a, view.b), &rendered[Index(i)]);
    });
    ParallelFor(sum.height_px, threads, [&](int y) {
      const std::size_t begin = Index(y) * row;
      for (int i = 0; i < these; ++i) {
        const auto weight = static_cast<float>(views[Index(first + i)].weight);
        const float* const values = rendered[Index(i)].values.data();
        for (std::size_t x = begin; x < begin + row; ++x) sum.values[x] += weight * values[x];
      }
    });
  }
  return sum;
}

model::LightField ViewsOf(const SceneForm& scene, int threads) {
  const SceneRenderer renderer(scene);
  model::LightField light_field = model::DescriptionOf(scene.frame);
  light_field.present.clear();
  light_field.values.assign(light_field.ViewStart(light_field.channels, 0, 0), 0.0F);
  ParallelFor(light_field.u_count * light_field.v_count, threads, [&](int i) {
    ThrowIfCancelled();
    const int k = i % light_field.u_count, l = i / light_field.u_count;
    model::SetView(&light_field, k, l,
                   renderer.View(light_field.u_offset(k), light_field.v_offset(l)));
  });
  return light_field;
}

std::vector<Confidence> RayConfidenceOf(const SceneForm& scene, int threads) {
  const SceneRenderer renderer(scene);
  if (scene.confidence.empty()) return {};
  const model::LightField& frame = scene.frame;
  std::vector<Confidence> confidence(frame.ViewStart(1, 0, 0));
  ParallelFor(frame.u_count * frame.v_count, threads, [&](int i) {
    ThrowIfCancelled();
    const int k = i % frame.u_count, l = i / frame.u_count;
    const std::vector<Confidence> view =
        renderer.ViewConfidence(frame.u_offset(k), frame.v_offset(l));
    std::copy(view.begin(), view.end(),
              confidence.begin() + static_cast<std::ptrdiff_t>(Index(i) * frame.view_size()));
  });
  return confidence;
}

ConfidenceShares RaySharesOf(const SceneForm& scene, int threads) {
  RequireValid(scene);
  if (scene.confidence.empty()) return {};
  const DisparityRenderer geometry(scene.disparity);
  std::vector<PlacedView> views;
  for (const auto& [b, weight_of_row] : NodesOf(scene.frame.v_count)) {
    for (const auto& [a, weight] : NodesOf(scene.frame.u_count))
      views.push_back({a, b, weight * weight_of_row});
  }
  std::vector<ConfidenceShares> of_views(views.size());
  ParallelFor(static_cast<int>(views.size()), threads, [&](int i) {
    ThrowIfCancelled();
    std::array<std::size_t, 256> counts{};
    const CompactView view = geometry.RenderCompact(views[Index(i)].a, views[Index(i)].b);
    for (const Confidence confidence : RayConfidence(scene.confidence, view)) ++counts[confidence];
    of_views[Index(i)] = SharesOf(counts);
  });
  ConfidenceShares shares;
  for (std::size_t i = 0; i < views.size(); ++i) {
    shares.visible += views[i].weight * of_views[i].visible;
    shares.partly_visible += views[i].weight * of_views[i].partly_visible;
    shares.blurred += views[i].weight * of_views[i].blurred;
    shares.filled_in += views[i].weight * of_views[i].filled_in;
  }
  return shares;
}

}  // namespace thicklens::estimator
