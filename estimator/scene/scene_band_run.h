#ifndef THICKLENS_ESTIMATOR_SCENE_SCENE_BAND_RUN_H_
#define THICKLENS_ESTIMATOR_SCENE_SCENE_BAND_RUN_H_

#include <optional>
#include <vector>

#include "estimator/scene/scene_bands.h"
#include "estimator/scene/scene_memory.h"
#include "estimator/scene/scene_radiance.h"
#include "thicklens/base/iteration_progress.h"
#include "thicklens/estimator/scene_solver.h"

namespace thicklens::estimator {

struct SolvedScene {
  model::LinearImage radiance;
  std::vector<Confidence> of_points;  // confidence of the points of the centre view, if requested
  AngularBundle bundle;               // views that were already rendered; may be empty
};

// Solves for the radiance of a photograph in as few bands as the memory allows, one after the
// other.
template <typename Real>
class SceneBandRun {
 public:
  // All arguments are kept by reference. `iterations` is the part of the progress for the bands.
  SceneBandRun(const EstimateInput& input, const SceneOptions& options, const SolverRun& run,
               const SceneMemory& memory, int reach_px, int iterations, IterationProgress* progress,
               SceneSummary* summary);

  // Solves for `photograph`, the input's without its fall-off. Sets the solution's members of the
  // summary and adds the times. Throws Error if the memory limit is too low for the lowest bands.
  SolvedScene Solve(const model::LinearImage& photograph, bool wants_confidence, SceneMaps* maps);

 private:
  using Radiance = SceneRadiance<Real>;
  struct Sample {
    SignalSum signal;
    ProjectionBytes per_pixel;
  };

  int BandsFor(const ProjectionBytes& per_pixel) const;
  double MostBytes(int count, const ProjectionBytes& per_pixel) const;
  const Sample& TakenSample(const model::LinearImage& photograph);
  double StrengthFor(const model::LinearImage& photograph, const std::vector<SceneBand>& bands);
  typename Radiance::Run RunFor(const SceneOptions& options) const;
  enum class Start { kNone, kFound };
  // Returns the seconds of the iterations at half the size, if they are requested. Only one
  // radiance may be in use at a time, because it reads the band's disparity from this object.
  double Prepare(const model::LinearImage& photograph, const SceneBand& band, Start start,
                 Radiance* radiance);
  // Absent if one of the bands exceeds the memory limit.
  std::optional<SolvedScene> SolveIn(int count, const model::LinearImage& photograph,
                                     bool wants_confidence, SceneMaps* maps);
  bool Fits(const SceneBand& band, const Radiance& radiance);
  bool IsWithinLimit(double bytes) const;
  // Returns the predicted memory: the needed `bytes`, or more if freed memory may stay with the
  // process.
  double PredictedMib(double bytes, int rows, const ProjectionBytes& projection,
                      double kept_bundle_bytes) const;
  // Returns whether the views of the photograph's rays are those of the light field, in a single
  // band.
  bool MayKeepBundle(int bands) const;

  const EstimateInput& input_;
  const SceneOptions& options_;
  const SolverRun& run_;
  const SceneMemory& memory_;
  const int reach_px_, iterations_;
  IterationProgress* progress_;
  SceneSummary* summary_;
  DisparityMap band_disparity_;  // unused if the band is the whole input
  double guide_slope_ = 0;       // for patches
  double mean_slope_ = 0;
  ProjectionBytes per_pixel_;  // largest known value
  std::optional<Sample> sample_;
  int search_iterations_ = 0;
};

}  // namespace thicklens::estimator

#endif  // THICKLENS_ESTIMATOR_SCENE_SCENE_BAND_RUN_H_
