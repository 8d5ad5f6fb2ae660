#include "thicklens/render.h"

#include <fmt/format.h>

#include <algorithm>
#include <limits>
#include <utility>

#include "thicklens/base/error.h"
#include "thicklens/estimator/aperture_weights.h"
#include "thicklens/estimator/render.h"
#include "thicklens/kernels/device.h"
#include "thicklens/model/effect_impact.h"
#include "tools/interface/effects_choice.h"
#include "tools/interface/run_scope.h"
#include "tools/interface/validation.h"

namespace thicklens {
namespace {

Image ImageOf(model::LinearImage image, const LightField& light_field) {
  if (image.channels != 1 && image.channels != 3) {
    throw Error(fmt::format("light field: 1 or 3 channels are expected, found {}", image.channels));
  }
  return Image::FromLight(image.width_px, image.height_px,
                          image.channels == 1 ? ChannelOrder::kGrey : ChannelOrder::kRgb,
                          std::move(image.values), light_field.transfer);
}

// Which effects of a photograph of the light field are taken into account. Occlusion is contained
// in the views.
model::EffectSelection SelectEffects(const EffectSelection& selection,
                                     const LightField& light_field) {
  const EffectSet of_views = {Effect::kDefocus, Effect::kApertureShape};
  EffectSet of_model =
      light_field.camera ? of_views.With({Effect::kThickness, Effect::kFalloff}) : of_views;
  if (estimator::IsOffAperture(light_field)) of_model.Add(Effect::kVignetting);
  RequireEffectsOf(selection, of_model);
  if (!light_field.camera) return DecideWithoutCamera(selection, of_model);
  model::EffectSelectionOptions choice = ChoiceOf(selection);
  choice.kept = of_views;
  model::EffectConditions conditions;
  conditions.camera = *light_field.camera;
  if (light_field.grid) conditions.planes = light_field.grid->planes;
  // Views do not state their depths: any depth from half of that of the plane of focus on.
  constexpr double kFarMm = 1e6;
  const double near_mm = std::min(light_field.camera->focus_depth_mm(), kFarMm) / 2;
  model::EffectSelection decision =
      model::SelectEffects(choice, conditions,
                           model::PlacesBetween(*light_field.camera, near_mm,
                                                std::numeric_limits<double>::infinity(), false),
                           of_model);
  // Without defocus a pixel has one ray.
  if (!decision.on.Has(Effect::kDefocus)) decision.on.Remove(Effect::kVignetting);
  return decision;
}

Eigen::ArrayXXd WeightsOf(const RenderAperture& aperture, const LightField& light_field) {
  if (aperture.radius) return estimator::WeightsForRadius(light_field, *aperture.radius);
  if (!aperture.shape) return light_field.weights;
  return model::ApertureWeights(*aperture.shape, light_field.u_count, light_field.v_count);
}

Eigen::ArrayXXd PhotographWeights(const RenderAperture& aperture, const LightField& light_field,
                                  const EffectSet& on) {
  for (const Effect effect : {Effect::kDefocus, Effect::kApertureShape}) {
    if ((!aperture.radius && !aperture.shape) || on.Has(effect)) continue;
    throw OptionError("aperture", fmt::format("aperture: needs the effect {}, which is left out",
                                              model::EffectName(effect)));
  }
  if (!on.Has(Effect::kDefocus)) return estimator::WeightsForRadius(light_field, 0);
  if (!on.Has(Effect::kApertureShape)) {
    return model::ApertureWeights(model::ApertureShape::kGaussian, light_field.u_count,
                                  light_field.v_count);
  }
  return WeightsOf(aperture, light_field);
}

// The aperture of PhotographWeights where a ray crosses it between the views.
estimator::Vignetting VignettingOf(const RenderAperture& aperture, const LightField& light_field,
                                   const EffectSet& on) {
  if (!on.Has(Effect::kApertureShape)) return {model::ApertureShape::kGaussian, {}};
  if (aperture.shape) return {*aperture.shape, {}};
  const std::optional<model::ApertureShape> own = estimator::ShapeOfWeights(light_field);
  if (own) return {*own, aperture.radius};
  throw Error(
      "light field: its UV plane lies off the aperture, and its weights are those of no shape, so "
      "that nothing is known of the aperture between the views: state a shape, or leave the effect "
      "vignetting out");
}

void WarnOfShiftedPupil(const LightField& light_field, RunScope* run) {
  constexpr double kMuch = 0.4;
  const double shift = estimator::MaxPupilShift(light_field);
  if (!(shift > kMuch)) return;
  run->Warn(fmt::format(
      "with the UV plane at {:g} mm the rays of the outermost pixels cross the aperture beside its "
      "middle, by {:.2g} of the half-width that the views cover: part of their light is missing, "
      "and what is out of focus there is displaced and not blurred enough",
      light_field.grid->planes.uv_depth_mm, shift));
}

}  // namespace

Image RenderPhotograph(const LightField& light_field, const PhotographOptions& options,
                       const RunControl& control, std::vector<std::string>* effects_on) {
  checks::RequireValid(control);
  checks::RequireValid(options);
  RunScope run(control);
  std::string notice;
  const auto backend = kernels::OpenBackend(kernels::ParseDeviceRequest(options.device), &notice,
                                            [] { ThrowIfCancelled(); });
  if (!notice.empty()) run.Warn(notice);
  // The processor is faster without the kernels.
  const auto kernels = backend->is_opencl() ? backend->NewFloat() : nullptr;
  const EffectSet on = SelectEffects(options.effects, light_field).on;
  if (effects_on != nullptr) *effects_on = on.Names();
  std::optional<Camera> falloff;
  if (on.Has(Effect::kFalloff)) {
    falloff = on.Has(Effect::kThickness) ? *light_field.camera
                                         : model::ThinLensEquivalent(*light_field.camera);
  }
  std::optional<estimator::Vignetting> vignetting;
  // An aperture of no size is one view.
  if (on.Has(Effect::kVignetting) && options.aperture.radius.value_or(1) > 0) {
    vignetting = VignettingOf(options.aperture, light_field, on);
    WarnOfShiftedPupil(light_field, &run);
  }
  return ImageOf(
      estimator::Photograph(light_field, PhotographWeights(options.aperture, light_field, on),
                            falloff ? &*falloff : nullptr, vignetting ? &*vignetting : nullptr,
                            kernels.get(), control.threads),
      light_field);
}

Image Refocus(const LightField& light_field, const FocusOptions& options,
              const RunControl& control) {
  checks::RequireValid(control);
  checks::RequireValid(options);
  const RunScope run(control);
  Eigen::Vector2d disparity_px;
  if (options.depth_mm) {
    if (!light_field.camera) {
      throw OptionError("depth_mm",
                        "depth_mm: the light field has no camera, so that millimetres "
                        "mean nothing; disparity_px states the focus without one");
    }
    disparity_px = estimator::DisparityAtDepthPx(light_field, *options.depth_mm);
  } else {
    // The disparity along v is that along u times the ratio of the view steps.
    disparity_px = {*options.disparity_px, *options.disparity_px};
    if (light_field.grid && light_field.grid->u_step_mm != 0) {
      disparity_px.y() *= light_field.grid->v_step_mm / light_field.grid->u_step_mm;
    }
  }
  return ImageOf(estimator::Refocus(light_field, disparity_px.x(), disparity_px.y(),
                                    WeightsOf(options.aperture, light_field), control.threads),
                 light_field);
}

Image RenderMosaic(const LightField& light_field, int gap_px) {
  return ImageOf(estimator::Mosaic(light_field, gap_px), light_field);
}
Image RenderEpipolarRow(const LightField& light_field, int t, int l, int repeat_px) {
  return ImageOf(estimator::EpipolarRow(light_field, t, l, repeat_px), light_field);
}
Image RenderEpipolarColumn(const LightField& light_field, int s, int k, int repeat_px) {
  return ImageOf(estimator::EpipolarColumn(light_field, s, k, repeat_px), light_field);
}

}  // namespace thicklens
