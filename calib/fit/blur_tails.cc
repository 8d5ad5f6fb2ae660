#include "calib/fit/blur_tails.h"

#include <algorithm>

#include "calib/fit/pupil_shapes.h"

namespace thicklens::calib {
namespace {

constexpr double kReach = 2;      // standard deviations
constexpr double kDoubtless = 4;  // standard deviations of tails that are beyond doubt

// Returns the tails of the known laws minus those that the family has already; nothing where such a
// blur is impossible.
std::optional<Eigen::Vector2d> ModelsLeft(model::Psf psf, const BlurFitResult& fit,
                                          const BlurEvidence& evidence) {
  const double kappa = fit.values[kBlurRatio], zf_mm = fit.values[kFocusDepth];
  const model::ThickLens& lens = evidence.setup.lens;
  if (evidence.spectrum < 0 || evidence.blur.variance_by_tails.size() == 0 || !(kappa > 0) ||
      !(zf_mm > lens.front_focal_length_mm)) {
    return std::nullopt;
  }
  const model::PupilOptics optics = model::PupilOpticsOf(lens, psf, kappa, zf_mm);
  if (!(optics.sigma_mm <= model::kWidestPupil * optics.image_distance_mm)) return std::nullopt;
  return Eigen::Vector2d(TailsOfPupilLaws(optics).array() - evidence.taken_tails);
}

}  // namespace

bool TakeTails(model::Psf psf, const BlurFitResult& fit, BlurEvidence* evidence) {
  const auto laws = ModelsLeft(psf, fit, *evidence);
  RelativeBlur& blur = evidence->blur;
  if (!laws || !(blur.tails.value > kDoubtless * blur.tails.sigma)) return false;
  const double taken = std::min(blur.tails.value, laws->y());
  if (!(taken > 0)) return false;
  evidence->taken_tails += taken;
  blur.tails.value -= taken;
  blur.variances_px2 += taken * blur.variance_by_tails;
  blur.covariance += blur.tails.sigma * blur.tails.sigma * blur.variance_by_tails *
                     blur.variance_by_tails.transpose();
  evidence->setup.estimators[static_cast<std::size_t>(evidence->spectrum)] =
      FitSamples(*evidence, blur, evidence->region);
  return true;
}

std::optional<Eigen::Vector2d> TailsLeft(model::Psf psf, const BlurFitResult& fit,
                                         const BlurEvidence& evidence) {
  const auto laws = ModelsLeft(psf, fit, evidence);
  if (!laws) return std::nullopt;
  const model::Estimate& tails = evidence.blur.tails;
  Eigen::Vector2d range(std::min(0.0, std::max(tails.value - kReach * tails.sigma, laws->x())),
                        std::max(0.0, std::min(tails.value + kReach * tails.sigma, laws->y())));
  // One step of a fit is too inaccurate for tails that are so large beyond doubt.
  if (tails.value < -kDoubtless * tails.sigma) range.x() = std::min(tails.value, laws->x());
  if (tails.value > kDoubtless * tails.sigma) range.y() = std::max(tails.value, laws->y());
  if (evidence.taken_tails > 0) range.y() = std::max(range.y(), laws->y());
  return range;
}

}  // namespace thicklens::calib
