#include <fmt/format.h>

#include <algorithm>
#include <cstddef>
#include <functional>
#include <memory>
#include <utility>
#include <vector>

#include "estimator/projection/grid_photograph.h"
#include "estimator/render/shown_views.h"
#include "estimator/views/ray_irradiance.h"
#include "estimator/views/ray_landing.h"
#include "thicklens/base/error.h"
#include "thicklens/base/index.h"
#include "thicklens/base/parallel.h"
#include "thicklens/estimator/render.h"
#include "thicklens/kernels/kernels.h"

namespace thicklens::estimator {
namespace {

// Calls work(view, k, l) for all views.
template <typename Work>
void ForEachView(const model::LightField& light_field, int threads, const Work& work) {
  ParallelFor(light_field.u_count * light_field.v_count, threads, [&](int view) {
    work(view, view % light_field.u_count, view / light_field.u_count);
  });
}

// Irradiance of every ray, for each view, relative to that of `weights` at the principal point;
// empty where `seen` is 0.
std::vector<std::vector<float>> FalloffOfViews(const model::LightField& light_field,
                                               const model::Camera& camera,
                                               const Eigen::ArrayXXd& weights,
                                               const Eigen::ArrayXXd& seen, int threads) {
  std::vector<std::vector<float>> falloff(Index(light_field.u_count * light_field.v_count));
  ForEachView(light_field, threads, [&](int view, int k, int l) {
    if (seen(l, k) == 0) return;
    falloff[Index(view)] = RelativeFalloff(*light_field.grid, camera, weights, k, l);
  });
  return falloff;
}

// Share of every ray that the aperture passes, for each view; empty where `seen` is 0.
std::vector<std::vector<float>> PassedByViews(const model::LightField& light_field,
                                              const Vignetting& vignetting,
                                              const Eigen::ArrayXXd& seen, int threads) {
  std::vector<std::vector<float>> passed(Index(light_field.u_count * light_field.v_count));
  ForEachView(light_field, threads, [&](int view, int k, int l) {
    if (seen(l, k) > 0)
      passed[Index(view)] = ApertureTransmissionMap(light_field, vignetting, k, l);
  });
  return passed;
}

// Forms the image of one channel from its views as they lie in the light field.
using ImageFormer = std::function<std::vector<float>(const float* rays)>;

// Uses `kernels` or, if it is null, vector instructions of the processor; both give the numbers of
// Kernels::FormImage. If there are `shares`, they multiply the rays.
ImageFormer NewFormer(const kernels::BlockGeometry& whole, kernels::Splat splat,
                      std::vector<std::vector<float>> shares, kernels::Kernels<float>* kernels,
                      int threads) {
  if (kernels == nullptr) {
    kernels::BlockGeometry geometry = whole;
    if (splat == kernels::Splat::kNearest) {  // each ray counts fully, as if it landed on its pixel
      std::fill(geometry.s_fraction.begin(), geometry.s_fraction.end(), 0.0);
      std::fill(geometry.t_fraction.begin(), geometry.t_fraction.end(), 0.0);
    }
    const auto photograph =
        std::make_shared<GridPhotograph<float>>(geometry, std::move(shares), threads);
    return [photograph](const float* rays) {
      std::vector<float> pixels(photograph->pixels());
      photograph->Apply(rays, pixels.data());
      return pixels;
    };
  }
  const std::size_t view_size = Index(whole.s_count) * Index(whole.t_count);
  return
      [&whole, splat, shares = std::move(shares), kernels, threads, view_size](const float* rays) {
        std::vector<float> weighted(rays, rays + view_size * Index(whole.views()));
        if (!shares.empty()) {
          ParallelFor(whole.views(), threads, [&](int view) {
            const std::vector<float>& share = shares[Index(view)];
            float* values = weighted.data() + Index(view) * view_size;
            for (std::size_t i = 0; i < share.size(); ++i) values[i] *= share[i];
          });
        }
        return kernels->FormImage(whole, splat, weighted);
      };
}

// Mean share that the aperture passes, over the rays of each pixel. Throws Error where there are
// rays and the aperture passes none.
std::vector<float> BundleOf(const model::LightField& light_field,
                            const std::vector<std::vector<float>>& passed,
                            const ImageFormer& form) {
  std::vector<float> rays;
  rays.reserve(passed.size() * light_field.view_size());
  for (const std::vector<float>& view : passed) {
    rays.insert(rays.end(), view.begin(), view.end());
    if (view.empty()) rays.resize(rays.size() + light_field.view_size());
  }
  std::vector<float> bundle = form(rays.data());
  if (std::all_of(bundle.begin(), bundle.end(), [](float sum) { return sum > 0; })) return bundle;
  std::fill(rays.begin(), rays.end(), 1.0F);
  const std::vector<float> landed = form(rays.data());
  for (std::size_t i = 0; i < bundle.size(); ++i) {
    if (bundle[i] > 0) continue;
    if (landed[i] == 0) {  // black, with vignetting or without
      bundle[i] = 1;
      continue;
    }
    const auto pixel = static_cast<int>(i);
    throw Error(fmt::format(
        "vignetting: the aperture passes no ray of the light field that lands at the pixel ({}, "
        "{}), with the UV plane at a depth of {:g} mm: a larger aperture, more views, or no "
        "vignetting is needed",
        pixel % light_field.s_count, pixel / light_field.s_count,
        light_field.grid->planes.uv_depth_mm));
  }
  return bundle;
}

// Multiplies the shares; an empty `product` counts as 1.
void MultiplyInto(const std::vector<std::vector<float>>& shares,
                  std::vector<std::vector<float>>* product) {
  if (product->empty()) {
    *product = shares;
    return;
  }
  for (std::size_t view = 0; view < shares.size(); ++view) {
    for (std::size_t i = 0; i < shares[view].size(); ++i) (*product)[view][i] *= shares[view][i];
  }
}

}  // namespace

model::LinearImage Photograph(const model::LightField& light_field, const Eigen::ArrayXXd& weights,
                              const model::Camera* falloff, const Vignetting* vignetting,
                              kernels::Kernels<float>* kernels, int threads) {
  CheckLightField(light_field);
  const Eigen::ArrayXXd present = PresentWeights(light_field, weights);
  const bool is_vignetted = vignetting != nullptr && IsOffAperture(light_field);
  // A view with no rays at the principal point may pass rays of other pixels.
  const Eigen::ArrayXXd seen =
      is_vignetted
          ? PresentWeights(light_field, Eigen::ArrayXXd::Ones(weights.rows(), weights.cols()))
          : present;
  std::vector<std::vector<float>> share_of_rays;
  if (falloff != nullptr && light_field.grid) {
    share_of_rays = FalloffOfViews(light_field, *falloff, present, seen, threads);
  }
  // Forming the photograph uses the splat that the rays were estimated with.
  const kernels::Splat splat =
      light_field.origin.splat == "nearest" ? kernels::Splat::kNearest : kernels::Splat::kBilinear;
  const kernels::BlockGeometry whole =
      BlockOf(light_field, {0, 0, light_field.s_count, light_field.t_count}, seen);
  std::vector<float> bundle;  // for each pixel, where its rays have weights of their own
  if (is_vignetted) {
    const std::vector<std::vector<float>> passed =
        PassedByViews(light_field, *vignetting, seen, threads);
    bundle = BundleOf(light_field, passed, NewFormer(whole, splat, {}, kernels, threads));
    MultiplyInto(passed, &share_of_rays);
  }

  const ImageFormer form = NewFormer(whole, splat, std::move(share_of_rays), kernels, threads);
  model::LinearImage photograph{light_field.s_count, light_field.t_count, light_field.channels, {}};
  for (int channel = 0; channel < light_field.channels; ++channel) {
    std::vector<float> pixels =
        form(light_field.values.data() + light_field.ViewStart(channel, 0, 0));
    for (std::size_t i = 0; i < bundle.size(); ++i) pixels[i] /= bundle[i];
    if (light_field.channels == 1) {
      photograph.values = std::move(pixels);
      break;
    }
    photograph.values.resize(pixels.size() * Index(light_field.channels));
    for (std::size_t i = 0; i < pixels.size(); ++i) {
      photograph.values[i * Index(light_field.channels) + Index(channel)] = pixels[i];
    }
  }
  return photograph;
}

}  // namespace thicklens::estimator
