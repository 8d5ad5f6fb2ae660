#ifndef THICKLENS_ESTIMATOR_RESAMPLE_DEPTH_H_
#define THICKLENS_ESTIMATOR_RESAMPLE_DEPTH_H_

#include <Eigen/Core>
#include <vector>

#include "thicklens/base/export.h"
#include "thicklens/model/scene.h"

namespace thicklens::estimator {

// A depth map of its own size, in numbers that are linear in 1/z: a disparity, or an inverse depth.
struct DepthSampling {
  int width_px = 0, height_px = 0;  // size, px of the map
  std::vector<float> values;        // row by row; NaN marks a hole
  std::vector<float> confidence;    // 0 to 1 per value; empty: equal for all
};

// Where the samples of a map lie in the photograph: sample (i, j) at first_px + (i, j) step_px, px
// of the photograph, where (0, 0) is the centre of the top-left pixel.
struct MapPlacement {
  Eigen::Vector2d first_px{0, 0};  // of the map's first sample
  Eigen::Vector2d step_px{1, 1};   // from sample to sample, > 0
};
// The placement of a map of width_px x height_px px that shows the rectangle of the photograph
// whose top-left pixel is `corner_px` and whose size is `size_px`, px: the areas coincide, so that
// (i + 0.5) step = x + 0.5 - corner for any factor, whole or not.
THICKLENS_EXPORT MapPlacement PlaceOn(const Eigen::Vector2d& corner_px,
                                      const Eigen::Vector2d& size_px, int width_px, int height_px);

// A map in the pixels of the photograph.
struct ResampledDepth {
  std::vector<float> values;      // one per pixel; NaN marks a hole
  std::vector<float> confidence;  // likewise; empty if the samples had none
  // Share of the pixels that lie between two surfaces of the map, and the share whose surface the
  // photograph changed.
  double between_share = 0, moved_share = 0;
  std::size_t mixed_samples = 0;  // values between two surfaces, which were given to the nearer one
};

// Brings the map to the pixels of the photograph [D186].
//
// Neighbouring samples belong to one surface if they differ by little, or as much as the samples
// beside them. Within a surface a pixel's value is interpolated linearly. Between two surfaces it
// is extrapolated along one of them, so that no value appears between them. The surface is the one
// whose samples have the larger bilinear weight, unless the photograph contradicts: the light of
// the pixel is compared with the means of the pixels of both surfaces around it, which puts the
// edge where the light is halfway between them, as the blur of an edge leaves it [D187]. A sample
// between two surfaces, as averaging leaves it, is given to the nearer one before. A pixel most of
// whose weight is holes is a hole.
//
// Where samples are closer together than pixels, a pixel gets the surface that fills most of it,
// and the mean of that surface's samples. Pixels beyond the map are holes. The weights of samples
// are multiplied by their confidence; a confidence of 0 makes a hole. The result does not depend on
// the number of threads. Throws Error if the sizes do not fit or a step is not > 0.
THICKLENS_EXPORT ResampledDepth ResampleDepth(const DepthSampling& map,
                                              const model::LinearImage& photo,
                                              const MapPlacement& placement, int threads);

// How well the edges of the map agree with those of the photograph: the mean, over the pixels
// between two surfaces, of the logarithm of how much likelier the light of a pixel is on its own
// surface than on the other one [D188], by square tiles of the photograph. Tiles without such
// pixels have a count of 0.
struct EdgeAgreement {
  std::vector<double> sums;         // of the logarithms, by tile, row by row
  std::vector<std::size_t> counts;  // of pixels
};
// Measures the agreement of a placed map with the photograph. Throws like ResampleDepth.
THICKLENS_EXPORT EdgeAgreement AgreementOf(const DepthSampling& map,
                                           const model::LinearImage& photo,
                                           const MapPlacement& placement, int threads);
// Returns the number of standard errors by which `second` agrees better than `first`, from the
// scatter of the tiles; 0 if fewer than eight tiles show an edge in both.
THICKLENS_EXPORT double SigmaBetter(const EdgeAgreement& first, const EdgeAgreement& second);

}  // namespace thicklens::estimator

#endif  // THICKLENS_ESTIMATOR_RESAMPLE_DEPTH_H_
