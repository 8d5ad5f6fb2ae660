#ifndef THICKLENS_ESTIMATOR_SCENE_SOLVER_H_
#define THICKLENS_ESTIMATOR_SCENE_SOLVER_H_

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "thicklens/estimator/estimate_input.h"
#include "thicklens/estimator/ray_confidence.h"
#include "thicklens/kernels/device.h"

namespace thicklens::estimator {

// What is taken for granted about the radiance of a scene.
enum class Prior {
  kRidge,           // it is near the photograph
  kGradient,        // it is smooth: squared differences of neighbours
  kTotalVariation,  // it is smooth between edges: absolute differences, colours together
  kPatches,         // that, its patches of 8 x 8 px are made of few waves, and relief is shaded
};
Prior PriorFromName(const std::string& name);  // "ridge", "gradient", "tv", "patches"; throws Error
std::string PriorName(Prior prior);

// Below which little is gained: 1e-4 for total variation and patches, 1e-3 for the others.
double UsualTolerance(Prior prior);

enum class StrengthRule {
  kAuto,   // from the photograph's noise
  kGcv,    // generalised cross-validation
  kGiven,  // SceneOptions::strength
};

struct SceneOptions {
  Prior prior = Prior::kTotalVariation;
  StrengthRule strength_rule = StrengthRule::kAuto;
  double strength = 0;  // of the prior, in its own unit (see EstimateScene); only for kGiven, > 0
  // Relative residual at which conjugate gradients stop, > 0, < 1. Absent: UsualTolerance.
  std::optional<double> tolerance;
  // Of conjugate gradients, all solves for one strength together; >= 1.
  int max_iterations = 200;
  bool double_precision = false;
  // Compare stored values, as the eye and the metrics do. Off: the mean slope s everywhere.
  bool slope_weights = true;
  bool hidden_weights = true;  // trust pixels less that show what the centre view does not
  // Bicubic between the pixels of a surface, far from its edges. Off: linear, as in
  // EstimateFunctional.
  bool cubic = true;
  bool falloff = true;  // the irradiance of [S12], where there is a camera
  int threads = 0;      // 0: one per core
  // For the whole process. Where the picture as a whole takes more, it is solved in bands.
  std::optional<double> memory_limit_mib;
  int least_bands = 1;  // >= 1
  // Called from any thread, one at a time, for each iteration and each view, and now and then
  // between. May throw to stop.
  std::function<void(int done, int total)> progress;

  double tolerance_or_usual() const { return tolerance.value_or(UsualTolerance(prior)); }
  bool IsValid(std::string* why) const;
};

struct SceneSummary {
  std::string message = "not run";
  Prior prior = Prior::kTotalVariation;
  double strength = 0;
  double noise_sigma = 0;  // of stored values in [0, 1], as found in the photograph
  int iterations = 0;      // of conjugate gradients at full size, for all strengths together
  int reweightings = 0;    // of total variation: one an iteration, after the first few
  bool converged = false;  // the last system, to the tolerance
  // |A r - b|/|b| of the last system, recomputed from the answer.
  double relative_residual = 0;
  // Of the photograph's pixels, which have a row of their own in H (occlusions, steep surfaces),
  // and the share of the aperture's rays that show what the centre view does not.
  double row_share = 0, hidden_share = 0;
  // Rms over the photograph of (H r - I), in stored values; by noise alone it would be about
  // noise_sigma.
  double residual_rms = 0;
  double setup_seconds = 0, solve_seconds = 0, views_seconds = 0;
  double predicted_memory_mib = 0;
  int threads = 0;
  std::string device;  // of the iterations
  // The picture was solved in so many parts, from top to bottom. Of these the iterations and the
  // relative residual are the most.
  int bands = 1;
};

// What the estimate knows of itself; picture-sized but for the last.
struct SceneMaps {
  model::LinearPicture radiance;     // of the scene's points, as the centre view shows them
  std::vector<float> residual;       // H r - I in stored values, the channels' mean
  std::vector<float> hidden_share;   // of the aperture, that sees a pixel past an edge
  std::vector<float> blur_sigma_px;  // of the photograph, by the depth
  // Of all rays, view by view, row by row; only of EstimateScene.
  std::vector<Confidence> confidence;
};

// The light field of one picture as a whole: the radiance r of the points that the centre view
// shows, the same toward the whole aperture (no picture tells more: of view dependence nothing can
// be recovered from a sum over the aperture), then shown in each view by its depth. r minimises
//   sum_x W(x) |H r - I|^2 + prior,
// W = s^2/(1 + (20 h)^2): s the slope of the transfer curve at the smoothed intensity (errors of
// stored values count), h the share of the aperture that sees past an edge. Priors:
//   ridge      mu sum s^2 |r - I|^2
//   gradient   eta sum s^2 |grad r|^2 + 1e-6 |r|^2
//   tv         lambda sum_p (sum over channels and both differences of s^2 |dr|^2 + eps^2)^(1/2)
//              + 1e-6 |r|^2, eps = .004, by reweighted least squares, the weights renewed in
//              every iteration (nonlinear conjugate gradients).
//   patches    tv; then without the shading of the depth's relief, as far as it explains r: tv once
//              more, up to half as strong where H r explains I; then
//              .15 (255 sigma)^.8 sum s^2 |r - v|^2, v that r without the waves of its patches that
//              noise can make (see SolveWithPatches). strength and kGcv speak of the tv.
// Strengths for a noise of sigma in stored values (at least that of the rounding of 8 bits):
//   kAuto      mu = .2 sigma^2/var(s (I - H I)), eta = .125 sigma^2/var(s grad I), both variances
//              without their noise; lambda = 1e-3 (255 sigma)^1.5
//   kGcv       the minimum of generalised cross-validation near that, the trace times 1.4
// The iteration starts from the estimate at half the size.
// Derived here [D101]; H as in SceneProjection. The iterations are computed where the backend is
// (null: by C++ on the processor). Throws Error for options and inputs that do not fit, a memory
// limit that is too low, and what a device reports. The result does not depend on the number of
// threads.
//
// In bands the noise and the strength are those of the whole photograph (kAuto looks at a part of
// it, kGcv at the band in the middle), and each band is solved with rows around it, so many that
// no seam shows: what bands change is what the tolerance leaves open.
model::LightField EstimateScene(const EstimateInput& input, const SceneOptions& options,
                                SceneSummary* summary, SceneMaps* maps,
                                kernels::Backend* backend = nullptr);

// Takes the views one by one as they are made: each once, in any order, from several threads at the
// same time. May throw to stop.
struct SceneViewSink {
  // `confidence` is empty where it is not wanted.
  std::function<void(int k, int l, const model::LinearPicture& view,
                     const std::vector<Confidence>& confidence)>
      take;
  double bytes = 0;  // that it needs for one view while it has it
  bool wants_confidence = true;
};
// EstimateScene without ever holding all views; what comes back has none.
model::LightField EstimateSceneViews(const EstimateInput& input, const SceneOptions& options,
                                     const SceneViewSink& sink, SceneSummary* summary,
                                     SceneMaps* maps, kernels::Backend* backend = nullptr);

// Standard deviation of the noise of stored values in [0, 1], quantisation included [D97]: of 16 x
// 16 blocks with a mean of 12/255 to 243/255 the rms of (p00 - p10 - p01 + p11)/2, and of these the
// 25th percentile. Absent if no block is like that.
std::optional<double> StoredNoiseSigma(const model::LinearPicture& picture,
                                       const model::TransferCurve& transfer);

}  // namespace thicklens::estimator

#endif  // THICKLENS_ESTIMATOR_SCENE_SOLVER_H_
