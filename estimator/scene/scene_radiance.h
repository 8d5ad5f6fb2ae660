#ifndef THICKLENS_ESTIMATOR_SCENE_SCENE_RADIANCE_H_
#define THICKLENS_ESTIMATOR_SCENE_SCENE_RADIANCE_H_

#include <cstddef>
#include <utility>
#include <vector>

#include "estimator/base/iteration_progress.h"
#include "estimator/projection/scene_projection.h"
#include "estimator/scene/scene_bands.h"
#include "estimator/scene/scene_data.h"
#include "estimator/scene/scene_memory.h"
#include "estimator/scene/scene_priors.h"
#include "estimator/scene/scene_system.h"
#include "thicklens/estimator/scene_solver.h"

namespace thicklens::estimator {

// What is assumed of the noise where the photograph does not tell it, in stored values.
constexpr double kUsualNoise = 1.0 / 255;
// Of a noiseless photograph: no model of its rays is better than the rounding of 8 bits.
constexpr double kLeastNoise = 0.29 / 255;

// Of the transfer curve at the smoothed intensity.
double MeanSlope(const model::LinearPicture& photograph, const model::TransferCurve& transfer,
                 const std::vector<SceneBand>& bands);

// The radiance of one band of a photograph, in one precision.
template <typename Real>
class SceneRadiance {
 public:
  // What all bands have in common, kept by reference.
  struct Run {
    const EstimateInput& input;
    const SceneOptions& options;
    kernels::Backend* backend = nullptr;
    int threads = 1;
    double noise_sigma = 0;   // of stored values
    double relief_slope = 0;  // of the whole depth; for patches
    double mean_slope = 0;    // over the whole photograph; for options without slope weights
    int last_iteration = 0;   // for the progress: of this band and those before it
    IterationProgress* progress = nullptr;
    bool confidence = false;  // is asked for
    bool fan = false;         // is to be kept
  };
  explicit SceneRadiance(const Run& run) : run_(run) {}

  // Where the iteration starts: the estimate at half the size, but of small pictures. Before
  // Prepare, so that H of both sizes is never held at once; without it the photograph is the start.
  // Returns the seconds that it took without those for H.
  double FindStart(const model::LinearPicture& photograph, const DisparityMap& disparity);
  // H, I and the weights, from the rows of the band: the photograph without fall-off, and the
  // disparity of its pixels, which must live as long.
  void Prepare(const model::LinearPicture& photograph, const DisparityMap& disparity,
               const SceneBand& band);
  // Of all rows that are solved for; and about those of the band's result alone.
  ProjectionBytes projection_bytes() const { return BytesOfRows(0, projection_.height_px); }
  ProjectionBytes result_projection_bytes() const { return BytesOfRows(first_row(), last_row()); }
  SignalSum Signal() const;

  // The views of the photograph's rays, if they were to be kept; they are no longer after it.
  ViewFan TakeFan() { return std::exchange(projection_.fan, {}); }

  // Sets what the summary tells of the solution, and of the band's result.
  model::LinearPicture Solve(SceneSummary* summary);
  // Adds the rows of the band's result to those of the bands above.
  void AddMaps(SceneMaps* maps) const;
  void AddConfidence(std::vector<Confidence>* of_points) const;  // where it was asked for

 private:
  // The band's result in the rows that are solved for.
  int first_row() const { return band_.first - band_.from; }
  int last_row() const { return band_.last - band_.from; }
  ProjectionBytes BytesOfRows(int first, int last) const;
  std::size_t PixelOfRow(int row) const;
  void AddRows(const std::vector<float>& plane, std::vector<float>* to) const;
  std::vector<Real> SlopeSquared(const model::LinearPicture& photograph) const;
  void FillShares(SceneSummary* summary) const;

  const Run run_;
  SceneBand band_;
  const DisparityMap* disparity_ = nullptr;
  SceneProjection<Real> projection_;
  DataTerm<Real> data_;
  std::vector<Real> slope_squared_;
  StoredResidual residual_;
  model::LinearPicture start_;
};

}  // namespace thicklens::estimator

#endif  // THICKLENS_ESTIMATOR_SCENE_SCENE_RADIANCE_H_
