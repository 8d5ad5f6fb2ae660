#include "thicklens/compare.h"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "thicklens/base/error.h"
#include "thicklens/estimator/compare.h"
#include "thicklens/estimator/estimate_input.h"
#include "thicklens/io/aperture_statement.h"
#include "thicklens/model/encoded_values.h"
#include "tools/interface/problem.h"
#include "tools/interface/run_scope.h"
#include "tools/interface/validation.h"
#include "tools/interface/with_file_context.h"

namespace thicklens {
namespace {

ImageScores ScoresOf(const estimator::ImageScores& scores) {
  return {scores.psnr_db, scores.ssim, scores.delta_e94_mean, scores.macade_standin};
}
std::optional<ImageScores> ScoresOf(const std::optional<estimator::ImageScores>& scores) {
  if (!scores) return std::nullopt;
  return ScoresOf(*scores);
}

std::string NameOr(const std::string& source, const char* otherwise) {
  return source.empty() ? otherwise : source;
}

// The baseline's photograph in the channels of the reference, without alpha.
model::LinearImage PhotographFor(const Image& photo, const LightField& reference) {
  const std::string name = NameOr(photo.source(), "photograph");
  if (photo.channels() == 1 && reference.channels == 3) {
    throw Error(fmt::format(
        "{}: a photograph in colour is expected because the views are in colour; it is grey",
        name));
  }
  model::LinearImage light = photo.ToLight(reference.transfer);
  if (reference.channels == 1) return model::ToGrey(light);
  if (light.channels != 4) return light;
  model::LinearImage opaque{light.width_px, light.height_px, 3, {}};
  opaque.values.reserve(light.values.size() / 4 * 3);
  for (std::size_t i = 0; i < light.values.size(); ++i) {
    if (i % 4 != 3) opaque.values.push_back(light.values[i]);
  }
  return opaque;
}

estimator::DibrInput DibrOf(Baseline baseline, const LightField& reference, RunScope* run) {
  const std::string photo_name = NameOr(baseline.photo.source(), "photograph");
  estimator::DibrInput dibr;
  dibr.photograph = PhotographFor(baseline.photo, reference);
  baseline.photo = Image();
  if (dibr.photograph.width_px != reference.s_count ||
      dibr.photograph.height_px != reference.t_count) {
    throw Error(fmt::format("{}: it is {}x{} px, the views are {}x{} px: the sizes must be equal",
                            photo_name, dibr.photograph.width_px, dibr.photograph.height_px,
                            reference.s_count, reference.t_count));
  }
  // Views hold radiance, but a photograph does not: its fall-off would count as an error of the
  // warp.
  if (reference.camera && baseline.remove_falloff) {
    dibr.photograph = estimator::WithoutFalloff(dibr.photograph, *reference.grid, *reference.camera,
                                                reference.weights, run->threads());
  }
  PreparedDepth prepared =
      PrepareDepth(baseline.depth, dibr.photograph, reference.camera ? &*reference.camera : nullptr,
                   reference.grid ? &*reference.grid : nullptr, run);
  if (prepared.holes > 0) {
    run->Warn(fmt::format("{}: {} holes are filled from the surfaces beside them",
                          NameOr(baseline.depth.source, "depth"), prepared.holes));
  }
  dibr.disparity = std::move(prepared.disparity);
  return dibr;
}

// Takes the inner views unless the counts are those already.
void TakeInnerViews(int u_count, int v_count, const char* which, LightField* light_field,
                    RunScope* run) {
  const int all_u = light_field->u_count;
  const int all_v = light_field->v_count;
  if (all_u == u_count && all_v == v_count) return;
  const std::string name = NameOr(light_field->source, which);
  *light_field =
      WithFileContext(name, [&] { return model::InnerViews(*light_field, u_count, v_count); });
  run->Warn(fmt::format("{}: the inner {}x{} of its {}x{} views are compared", name, u_count,
                        v_count, all_u, all_v));
}

}  // namespace

ImageScores CompareImages(const Image& reference, const Image& other,
                          const CompareOptions& options) {
  checks::RequireValid(options);
  if (options.baseline) throw OptionError("baseline", "baseline: is for light fields");
  // Their errors name the image themselves.
  const model::EncodedImage& of_reference = reference.encoded();
  const model::EncodedImage& of_other = other.encoded();
  return WithFileContext(NameOr(other.source(), "image"), [&] {
    return ScoresOf(estimator::CompareImages(model::EncodedValuesOf(of_reference),
                                             model::EncodedValuesOf(of_other), options.border_px));
  });
}

LightFieldScores CompareLightFields(LightField reference, LightField other, CompareOptions options,
                                    const RunControl& control) {
  checks::RequireValid(control);
  checks::RequireValid(options);
  checks::RequireValidInput(NameOr(reference.source, "reference"), reference);
  checks::RequireValidInput(NameOr(other.source, "other"), other);
  RunScope run(control);
  if (!reference.source.empty() && !other.source.empty()) {
    if (const auto warning =
            io::DifferentApertures(reference.source, reference, other.source, other)) {
      run.Warn(*warning);
    }
  }
  const int u_count = std::min(reference.u_count, other.u_count);
  const int v_count = std::min(reference.v_count, other.v_count);
  TakeInnerViews(u_count, v_count, "reference", &reference, &run);
  TakeInnerViews(u_count, v_count, "other", &other, &run);
  std::optional<estimator::DibrInput> dibr;
  if (options.baseline) {
    dibr = DibrOf(std::move(*options.baseline), reference, &run);
    options.baseline.reset();
  }
  const estimator::LightFieldScores found =
      WithFileContext(NameOr(other.source, "light field"), [&] {
        return estimator::CompareLightFields(reference, other, options.border_px, dibr,
                                             control.threads);
      });
  LightFieldScores scores;
  scores.u_count = reference.u_count;
  scores.v_count = reference.v_count;
  scores.width_px = reference.s_count;
  scores.height_px = reference.t_count;
  scores.mean = ScoresOf(found.mean);
  scores.centre = ScoresOf(found.centre);
  scores.corner = ScoresOf(found.corner);
  scores.dibr_mean = ScoresOf(found.dibr_mean);
  scores.dibr_centre = ScoresOf(found.dibr_centre);
  scores.dibr_corner = ScoresOf(found.dibr_corner);
  for (const estimator::ViewScores& view : found.views) {
    scores.views.push_back({view.u, view.v, ScoresOf(view.scores), ScoresOf(view.dibr)});
  }
  scores.notices = run.notices();
  return scores;
}

std::string LightFieldScores::BriefReport() const {
  std::string text = fmt::format("{} views: PSNR {:.2f} dB, SSIM {:.4f}, dE94 {:.3f}", views.size(),
                                 mean.psnr_db, mean.ssim, mean.delta_e94_mean);
  if (dibr_mean) text += fmt::format("; warping alone: PSNR {:.2f} dB", dibr_mean->psnr_db);
  return text;
}

}  // namespace thicklens
