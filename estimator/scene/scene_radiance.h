#ifndef THICKLENS_ESTIMATOR_SCENE_SCENE_RADIANCE_H_
#define THICKLENS_ESTIMATOR_SCENE_SCENE_RADIANCE_H_

#include <cstddef>
#include <optional>
#include <utility>
#include <vector>

#include "estimator/projection/scene_projection.h"
#include "estimator/scene/scene_bands.h"
#include "estimator/scene/scene_data.h"
#include "estimator/scene/scene_memory.h"
#include "estimator/scene/scene_priors.h"
#include "estimator/scene/scene_system.h"
#include "thicklens/base/iteration_progress.h"
#include "thicklens/estimator/scene_solver.h"

namespace thicklens::estimator {

// Noise that is assumed where it cannot be measured in the photograph, in encoded values.
constexpr double kDefaultNoise = 1.0 / 255;
// Minimum noise, used for a noiseless photograph: no model of its rays is better than the rounding
// of 8 bits.
constexpr double kMinNoise = 0.29 / 255;

// Returns the mean slope of the transfer curve at the smoothed intensity.
double MeanSlope(const model::LinearImage& photograph, const model::TransferCurve& transfer,
                 const std::vector<SceneBand>& bands);

// The radiance of one band of a photograph, in one precision.
template <typename Real>
class SceneRadiance {
 public:
  // Data that all bands share, kept by reference.
  struct Run {
    const EstimateInput& input;
    const SceneOptions& options;
    kernels::Backend* backend = nullptr;
    std::optional<double> memory_limit_mib = std::nullopt;
    int threads = 1;
    double noise_sigma = 0;  // of encoded values
    double guide_slope = 0;  // of the whole depth; for patches
    double mean_slope = 0;   // over the whole photograph; for options without slope weights
    int last_iteration = 0;  // value of the progress after this band
    IterationProgress* progress = nullptr;
    bool confidence = false;  // true: AddConfidence is used
    bool bundle = false;      // true: the bundle is kept
  };
  explicit SceneRadiance(const Run& run) : run_(run) {}

  // Finds the start of the iteration: the estimate at half the size, unless the image is small. It
  // must be called before Prepare, so that H of both sizes is never held at once; if it is not
  // called, the photograph is the start. Returns the seconds that it took without those for H.
  double FindStart(const model::LinearImage& photograph, const DisparityMap& disparity,
                   const SceneBand& band);
  // Makes H, I and the weights from the rows of the band: the photograph without fall-off, and the
  // disparity of its pixels, which must outlive this object.
  void Prepare(const model::LinearImage& photograph, const DisparityMap& disparity,
               const SceneBand& band);
  // Memory of H for all rows that are solved for, and approximately for the band's result alone.
  ProjectionBytes projection_bytes() const { return BytesOfRows(0, projection_.height_px); }
  ProjectionBytes result_projection_bytes() const { return BytesOfRows(first_row(), last_row()); }
  SignalSum Signal() const;

  // Returns the views of the photograph's rays, if they were kept, and removes them here.
  AngularBundle TakeBundle() { return std::exchange(projection_.bundle, {}); }

  // Sets the members of the summary that describe the solution and the band's result.
  model::LinearImage Solve(SceneSummary* summary);
  // Appends the rows of the band's result to those of the bands above.
  void AddMaps(SceneMaps* maps) const;
  void AddConfidence(std::vector<Confidence>* of_points) const;  // only if requested

 private:
  // Position of the band's result in the rows that are solved for.
  int first_row() const { return band_.first - band_.from; }
  int last_row() const { return band_.last - band_.from; }
  ProjectionBytes BytesOfRows(int first, int last) const;
  std::size_t PixelOfRow(int row) const;
  void AddRows(const std::vector<float>& plane, std::vector<float>* to) const;
  std::vector<Real> SlopeSquared(const model::LinearImage& photograph) const;
  void FillShares(SceneSummary* summary) const;

  const Run run_;
  SceneBand band_;
  const DisparityMap* disparity_ = nullptr;
  SceneProjection<Real> projection_;
  DataTerm<Real> data_;
  std::vector<Real> slope_squared_;
  EncodedResidual residual_;
  model::LinearImage start_;
};

}  // namespace thicklens::estimator

#endif  // THICKLENS_ESTIMATOR_SCENE_SCENE_RADIANCE_H_
