#include "thicklens/render.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "thicklens/base/error.h"
#include "thicklens/estimator/aperture_weights.h"
#include "thicklens/estimator/render.h"
#include "thicklens/io/aperture_statement.h"
#include "thicklens/kernels/device.h"
#include "thicklens/kernels/kernels.h"
#include "thicklens/model/effect_impact.h"
#include "tools/interface/effects_choice.h"
#include "tools/interface/run_scope.h"
#include "tools/interface/validation.h"

namespace thicklens {
namespace {

std::string LightFieldName(const LightField& light_field) {
  return light_field.source.empty() ? "light field" : light_field.source;
}

Image ImageOf(model::LinearImage image, const LightField& light_field) {
  if (image.channels != 1 && image.channels != 3) {
    throw Error(fmt::format("{}: 1 or 3 channels are expected, found {}",
                            LightFieldName(light_field), image.channels));
  }
  Image result =
      Image::FromLight(image.width_px, image.height_px,
                       image.channels == 1 ? ChannelOrder::kGrey : ChannelOrder::kRgb,
                       std::move(image.values), light_field.transfer, light_field.source);
  result.SetColourProfile(light_field.colour_profile);
  return result;
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
  // Views do not state their depths: every depth from half of the in-focus object distance on is
  // possible. The impact of defocus and aperture shape is therefore not reported.
  constexpr double kFarMm = 1e6;
  const double near_mm = std::min(light_field.camera->focus_depth_mm(), kFarMm) / 2;
  model::EffectSelection decision =
      model::SelectEffects(choice, conditions,
                           model::PlacesBetween(*light_field.camera, near_mm,
                                                std::numeric_limits<double>::infinity(), false),
                           of_model);
  // Views from which an estimate did not divide the fall-off out have the brightness of their
  // photograph. Simulated views are radiance.
  const model::LightFieldOrigin& origin = light_field.origin;
  const std::vector<std::string>& modelled = origin.effects;
  const bool keeps_falloff =
      origin.method != "simulated" && origin.method != "imported" && !modelled.empty() &&
      std::find(modelled.begin(), modelled.end(), model::EffectName(Effect::kFalloff)) ==
          modelled.end();
  if (keeps_falloff && selection.base == EffectSelection::Base::kAuto)
    decision.on.Remove(Effect::kFalloff);
  // Without defocus each pixel has one ray.
  if (!decision.on.Has(Effect::kDefocus)) decision.on.Remove(Effect::kVignetting);
  decision.findings.erase(std::remove_if(decision.findings.begin(), decision.findings.end(),
                                         [&](const model::LargestEffectImpact& finding) {
                                           return of_views.Has(finding.effect);
                                         }),
                          decision.findings.end());
  return decision;
}

Eigen::ArrayXXd WeightsOf(const RenderAperture& aperture, const LightField& light_field,
                          RenderSummary* summary) {
  if (aperture.radius) return estimator::WeightsForRadius(light_field, *aperture.radius);
  if (!aperture.shape) {
    const bool is_stated = light_field.source.empty() || io::StatesAperture(light_field.source);
    summary->aperture_shape = is_stated ? "own" : "uniform";
    summary->aperture_from = is_stated ? "light-field" : "assumed";
    return light_field.weights;
  }
  summary->aperture_shape = model::ApertureShapeName(*aperture.shape);
  summary->aperture_from = "option";
  return model::ApertureWeights(*aperture.shape, light_field.u_count, light_field.v_count);
}

Eigen::ArrayXXd PhotographWeights(const RenderAperture& aperture, const LightField& light_field,
                                  const EffectSet& on, RenderSummary* summary) {
  for (const Effect effect : {Effect::kDefocus, Effect::kApertureShape}) {
    if ((!aperture.radius && !aperture.shape) || on.Has(effect)) continue;
    throw OptionError("aperture",
                      fmt::format("aperture: this statement needs the effect {}, which is left out",
                                  model::EffectName(effect)));
  }
  if (!on.Has(Effect::kDefocus)) {
    summary->aperture_shape = "pinhole";
    return estimator::WeightsForRadius(light_field, 0);
  }
  if (!on.Has(Effect::kApertureShape)) {
    summary->aperture_shape = "gaussian";
    return model::ApertureWeights(model::ApertureShape::kGaussian, light_field.u_count,
                                  light_field.v_count);
  }
  return WeightsOf(aperture, light_field, summary);
}

// The transmission of the aperture of PhotographWeights for rays that cross it between the views.
estimator::Vignetting VignettingOf(const RenderAperture& aperture, const LightField& light_field,
                                   const EffectSet& on, const RunScope& run) {
  if (!on.Has(Effect::kApertureShape)) return {model::ApertureShape::kGaussian, {}};
  if (aperture.shape) return {*aperture.shape, {}};
  const std::optional<model::ApertureShape> own = estimator::ShapeOfWeights(light_field);
  if (own) return {*own, aperture.radius};
  const std::string give =
      aperture.radius ? "" : fmt::format("give {}, or ", run.Option("aperture.shape"));
  throw Error(fmt::format(
      "{}: its UV plane lies off the aperture and its weights belong to no known shape, so that "
      "the aperture between the views is unknown: {}leave out the effect vignetting ({})",
      LightFieldName(light_field), give, run.Option("effects.without")));
}

// Light that the views do not contain cannot be restored by weights.
void WarnOfShiftedPupil(const LightField& light_field, RunScope* run) {
  constexpr double kMuch = 0.4;
  const double shift = estimator::MaxPupilShift(light_field);
  if (!(shift > kMuch)) return;
  run->Warn(fmt::format(
      "with the UV plane at {:g} mm the rays of the outermost pixels cross the aperture off its "
      "middle, by {:.2g} of the half-width that the views cover: part of their light is missing, "
      "and out-of-focus parts are displaced and not blurred enough",
      light_field.grid->planes.uv_depth_mm, shift));
}

// Views that are shifted by more than their size show nothing.
void RequireDisparityInside(const LightField& light_field, const FocusOptions& options,
                            const Eigen::Vector2d& disparity_px, const RunScope& run) {
  const int size_px = std::max(light_field.s_count, light_field.t_count);
  if ((disparity_px.array().abs() <= size_px).all()) return;
  const std::string focus =
      options.depth_mm ? fmt::format("{} {} mm", run.Option("depth_mm"), *options.depth_mm)
                       : fmt::format("{} {}", run.Option("disparity_px"), *options.disparity_px);
  throw Error(fmt::format(
      "{}: the disparity in focus is ({:.4g}, {:.4g}) px per view step, but it must be within the "
      "{} px of the views of {}",
      focus, disparity_px.x(), disparity_px.y(), size_px, LightFieldName(light_field)));
}

// Returns the disparity in focus, px per view step along u and v.
Eigen::Vector2d DisparityInFocus(const LightField& light_field, const FocusOptions& options,
                                 const RunScope& run) {
  Eigen::Vector2d disparity_px;
  if (options.depth_mm) {
    if (!light_field.camera) {
      throw Error(
          fmt::format("{} {} mm: {} has no camera, so that depths in mm are unknown; give {}",
                      run.Option("depth_mm"), *options.depth_mm, LightFieldName(light_field),
                      run.Option("disparity_px")));
    }
    disparity_px = estimator::DisparityAtDepthPx(light_field, *options.depth_mm);
  } else {
    // The disparity along v is the disparity along u times the ratio of the view steps.
    disparity_px = {*options.disparity_px, *options.disparity_px};
    if (light_field.grid && light_field.grid->u_step_mm != 0) {
      disparity_px.y() *= light_field.grid->v_step_mm / light_field.grid->u_step_mm;
    }
  }
  RequireDisparityInside(light_field, options, disparity_px, run);
  return disparity_px;
}

}  // namespace

Image RenderPhotograph(const LightField& light_field, const PhotographOptions& options,
                       const RunControl& control, RenderSummary* summary) {
  checks::RequireValid(control);
  checks::RequireValid(options);
  checks::RequireValidInput(LightFieldName(light_field), light_field);
  RunScope run(control);
  std::string notice;
  const auto backend = kernels::OpenBackend(kernels::ParseDeviceRequest(options.device), &notice,
                                            [] { ThrowIfCancelled(); });
  if (!notice.empty()) run.Warn(notice);
  // On the processor, rendering is faster without the kernels.
  const auto kernels = backend->is_opencl() ? backend->NewFloat() : nullptr;
  RenderSummary found;
  found.device = backend->name();
  found.device_description = backend->description();
  found.effects = SelectEffects(options.effects, light_field);
  const EffectSet& on = found.effects.on;
  std::optional<Camera> falloff;
  if (on.Has(Effect::kFalloff)) {
    falloff = on.Has(Effect::kThickness) ? *light_field.camera
                                         : model::ThinLensEquivalent(*light_field.camera);
  }
  std::optional<estimator::Vignetting> vignetting;
  // An aperture of radius 0 is a single view.
  if (on.Has(Effect::kVignetting) && options.aperture.radius.value_or(1) > 0) {
    vignetting = VignettingOf(options.aperture, light_field, on, run);
    WarnOfShiftedPupil(light_field, &run);
  }
  Image image =
      ImageOf(estimator::Photograph(
                  light_field, PhotographWeights(options.aperture, light_field, on, &found),
                  falloff ? &*falloff : nullptr, vignetting ? &*vignetting : nullptr, kernels.get(),
                  control.threads),
              light_field);
  found.notices = run.notices();
  if (summary != nullptr) *summary = std::move(found);
  return image;
}

Image Refocus(const LightField& light_field, const FocusOptions& options, const RunControl& control,
              RenderSummary* summary) {
  checks::RequireValid(control);
  checks::RequireValid(options);
  checks::RequireValidInput(LightFieldName(light_field), light_field);
  const RunScope run(control);
  RenderSummary found;
  found.disparity_px = DisparityInFocus(light_field, options, run);
  Image image =
      ImageOf(estimator::Refocus(light_field, found.disparity_px.x(), found.disparity_px.y(),
                                 WeightsOf(options.aperture, light_field, &found), control.threads),
              light_field);
  if (summary != nullptr) *summary = std::move(found);
  return image;
}

Image Refocus(const SceneForm& scene, const FocusOptions& options, const RunControl& control,
              RenderSummary* summary) {
  checks::RequireValid(control);
  checks::RequireValid(options);
  checks::RequireValidInput(LightFieldName(scene.frame), scene);
  const RunScope run(control);
  RenderSummary found;
  found.disparity_px = DisparityInFocus(scene.frame, options, run);
  // Both axes state the same depth; the longer step states it better.
  const Eigen::Vector2d& step = scene.disparity.step;
  const bool along_u = std::abs(step.x()) >= std::abs(step.y());
  const double px = along_u ? found.disparity_px.x() : found.disparity_px.y();
  const double px_per_unit = along_u ? step.x() : step.y();
  Image image = ImageOf(
      estimator::RefocusScene(scene, px_per_unit != 0 ? px / px_per_unit : 0,
                              WeightsOf(options.aperture, scene.frame, &found), control.threads),
      scene.frame);
  if (summary != nullptr) *summary = std::move(found);
  return image;
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
