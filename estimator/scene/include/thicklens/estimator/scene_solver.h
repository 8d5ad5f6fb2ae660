#ifndef THICKLENS_ESTIMATOR_SCENE_SOLVER_H_
#define THICKLENS_ESTIMATOR_SCENE_SOLVER_H_

#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "thicklens/base/export.h"
#include "thicklens/estimator/estimate_input.h"
#include "thicklens/estimator/ray_confidence.h"
#include "thicklens/estimator/solver_run.h"

namespace thicklens::estimator {

// The assumption about the radiance of a scene.
enum class Prior {
  kRidge,           // it is near the photograph
  kGradient,        // it is smooth: squared differences of neighbours
  kTotalVariation,  // it is smooth between edges: absolute differences, colours together
  kPatches,  // as kTotalVariation; also its patches of 8 x 8 px consist of few waves, and relief is
             // shaded
};
THICKLENS_EXPORT Prior PriorFromName(
    const std::string& name);  // "ridge", "gradient", "tv", "patches"; throws Error for other names
// Name of the prior: "ridge", "gradient", "tv" or "patches".
THICKLENS_EXPORT std::string PriorName(Prior prior);

// Returns the tolerance below which little is gained: 1e-4 for total variation and patches, 1e-3
// for the others.
THICKLENS_EXPORT double UsualTolerance(Prior prior);

// How the strength of the prior is chosen.
enum class StrengthRule {
  kAuto,   // from the photograph's noise
  kGcv,    // generalised cross-validation
  kGiven,  // SceneOptions::strength
};

// The options of EstimateScene.
struct SceneOptions {
  Prior prior = Prior::kTotalVariation;              // assumption about the radiance
  StrengthRule strength_rule = StrengthRule::kAuto;  // how its strength is chosen
  // Strength of the prior in its own unit (see EstimateScene): finite and > 0 for kGiven; the other
  // rules do not use it, and it is finite and >= 0.
  double strength = 0;
  // Relative residual at which conjugate gradients stop, > 0, < 1. Absent: UsualTolerance.
  std::optional<double> tolerance;
  // Maximum number of conjugate-gradient iterations, for all solves of one strength together; >= 1.
  int max_iterations = 200;
  bool double_precision = false;  // compute in double
  // Compare encoded values, as the eye and the metrics do. False: the mean slope s is used
  // everywhere.
  bool slope_weights = true;
  bool disocclusion_weights =
      true;  // reduce the weight of pixels that show points hidden from the centre view
  // Interpolate bicubically between the pixels of a surface, far from its edges. False: linear, as
  // in EstimateFunctional.
  bool cubic = true;
  bool falloff = true;  // use the irradiance of [S12] if there is a camera
  int least_bands = 1;  // minimum number of bands, >= 1
  // The aperture of the photograph over that of the views, >= 0, <= 1: H sees every disparity as
  // that share of it. 0: the photograph is the centre view, equally sharp at all depths, and with
  // kAuto it is that without a prior.
  double photo_aperture = 1;

  // The tolerance, or UsualTolerance of the prior if it is absent.
  double tolerance_or_usual() const { return tolerance.value_or(UsualTolerance(prior)); }
  // Returns false, and the reason in `why` (may be null), if a member is not in its range.
  THICKLENS_EXPORT bool IsValid(std::string* why) const;
};

// Findings of the scene solver besides the light field.
struct SceneDiagnostics {
  Prior prior = Prior::kTotalVariation;  // the prior of the estimate
  double strength = 0;                   // its strength, in its own unit
  double noise_sigma = 0;                // of encoded values in [0, 1], as found in the photograph
  int reweightings = 0;  // of total variation: one per iteration, after the first few
  // The share of the photograph's pixels that have a row of their own in H (occlusions, steep
  // surfaces), and the share of the aperture's rays that show points hidden from the centre view.
  double row_share = 0, occluded_fraction = 0;
  // Rms over the photograph of (H r - I), in encoded values; noise alone would give about
  // noise_sigma.
  double residual_rms = 0;
  // Number of parts in which the image was solved, from top to bottom. The iterations and the
  // relative residual are the maximum over the parts.
  int bands = 1;
  // The share of the photograph's values that are lower bounds, and the largest light of r, 1 at
  // full scale.
  double clipped_share = 0, brightest = 0;
};

// Convergence and residual are those of the last system; the device is that of the iterations.
struct SceneSummary : SolverResult, SceneDiagnostics {
  int iterations = 0;  // conjugate-gradient iterations at full size, for all strengths together
};

// The estimate and maps of its quality. All have the size of the image except the last.
struct SceneMaps {
  model::LinearImage radiance;  // radiance of the scene's points, as the centre view shows them
  std::vector<Confidence> of_points;     // confidence of the same points; empty if it is not wanted
  std::vector<float> residual;           // H r - I in encoded values, the channels' mean
  std::vector<float> occluded_fraction;  // share of the aperture that sees a pixel past an edge
  std::vector<float> blur_sigma_px;      // blur of the photograph, by the depth
  // Confidence of all rays, view by view, row by row; empty if a sink gets the views.
  std::vector<Confidence> confidence;
};

// Estimates the whole light field of one image. The unknown is the radiance r of the points that
// the centre view shows, assumed equal toward the whole aperture: no view dependence can be
// recovered from a sum over the aperture. r is then shown in each view by its depth. r minimises
//
//   sum_x W(x) |H r - I|^2 + prior,
//
// where the residual of a clipped value counts only below it (EstimateInput::clipped, [D181]), so
// that r may be brighter than full scale. Such a photograph is solved on the processor.
// W = s^2/(1 + (20 h)^2), where s is the slope of the transfer curve at the smoothed intensity
// (errors of encoded values count) and h the share of the aperture that sees past an edge. H is
// that of SceneProjection. Derived here [D101]. Priors:
//
//   ridge      mu sum s^2 |r - I|^2; a hundredth of it at pixels with a clipped value
//   gradient   eta sum s^2 |grad r|^2 + 1e-6 |r|^2
//   tv         lambda sum_p (sum over channels and both differences of s^2 |dr|^2 + eps^2)^(1/2)
//              + 1e-6 |r|^2, eps = 0.004, by reweighted least squares; the weights are renewed in
//              every iteration (nonlinear conjugate gradients).
//   patches    tv; then, without the shading of the depth's relief as far as it explains r, tv once
//              more, up to half as strong where H r explains I; then
//              0.15 (255 sigma)^0.8 sum s^2 |r - v|^2, where v is that r without the waves of its
//              patches that noise can make (see SolveWithPatches). The strength and kGcv refer to
//              the tv.
//
// Strengths for a noise of sigma in encoded values (at least that of the rounding of 8 bits):
//
//   kAuto      mu = 0.2 sigma^2/var(s (I - H I)), eta = 0.125 sigma^2/var(s grad I), both
//              variances without their noise; lambda = 1e-3 (255 sigma)^1.5
//   kGcv       the minimum of generalised cross-validation near that, the trace times 1.4
//
// The iteration starts from the estimate at half the size. It is computed on the backend of the
// run, and the views go to its sink if there is one. The result does not depend on the number of
// threads. `summary` and `maps` receive the results; both may be null. Throws Error for options and
// inputs that do not fit, for a memory limit that is too low, and for errors of a device.
//
// Bands use the noise and the strength of the whole photograph (kAuto samples parts of it, kGcv
// uses the band in the middle). Each band is solved with enough rows around it that no seam is
// visible: the differences due to bands are within those that the tolerance permits.
THICKLENS_EXPORT model::LightField EstimateScene(const EstimateInput& input,
                                                 const SceneOptions& options, const SolverRun& run,
                                                 SceneSummary* summary, SceneMaps* maps = nullptr);

// Receives the views one by one as they are made: each once, in any order, from several threads at
// the same time. An exception that it throws ends the estimate.
struct SceneViewSink {
  // `confidence` is empty unless wants_confidence is set.
  std::function<void(int k, int l, const model::LinearImage& view,
                     const std::vector<Confidence>& confidence)>
      take;
  double bytes = 0;              // memory that the sink needs per view while it processes it
  bool wants_confidence = true;  // the sink uses `confidence`, or that of the points in the maps
  // False: no view is made, and `take` is not called. The scene is in the maps.
  bool wants_views = true;
};

// Returns the standard deviation of the noise of encoded values in [0, 1], quantisation included
// [D97]. For each 16 x 16 block with a mean of 12/255 to 243/255 it takes the rms of (p00 - p10 -
// p01 + p11)/2, and of these the 25th percentile. Absent if there is no such block. Blocks with
// values that `clipped` marks, as in EstimateInput, are left out: clipping hides their noise.
THICKLENS_EXPORT std::optional<double> EncodedNoiseSigma(
    const model::LinearImage& image, const model::TransferCurve& transfer,
    const std::vector<std::uint8_t>& clipped = {});

}  // namespace thicklens::estimator

#endif  // THICKLENS_ESTIMATOR_SCENE_SOLVER_H_
