#ifndef THICKLENS_CALIB_SLANTED_EDGE_H_
#define THICKLENS_CALIB_SLANTED_EDGE_H_

#include <Eigen/Core>
#include <opencv2/core/mat.hpp>
#include <optional>
#include <string>
#include <vector>

#include "thicklens/base/export.h"
#include "thicklens/model/camera.h"

namespace thicklens::calib {

// A modulation transfer function (MTF): the contrast of a sine pattern in the image over its
// contrast in the light, against frequency. It includes the box of the pixel.
struct ModulationTransfer {
  std::vector<double> frequency_per_px;  // cycles per px, from 0 in equal steps
  std::vector<double> transfer;          // dimensionless, 1 at frequency 0
  std::vector<double> sigma;             // standard deviation of `transfer`; empty: not known
};

// The frequencies of all curves here: 0 to 1 cycles per px in steps of 0.01. The sensor samples up
// to 0.5 cycles per px without aliasing.
THICKLENS_EXPORT std::vector<double> TransferFrequencies();

// The lowest frequency, cycles per px, at which the curve falls below a level in (0, 1), and its
// standard deviation by that of the curve; absent: it does not fall below it.
THICKLENS_EXPORT std::optional<model::Estimate> FrequencyAtLevel(const ModulationTransfer& curve,
                                                                 double level);

// The MTF of one slanted edge.
struct SlantedEdgeResult {
  bool done = false;                            // true if the MTF was measured
  std::string message = "not run";              // how it ended; without a result, the reason
  ModulationTransfer curve;                     // along the normal of the edge
  std::optional<model::Estimate> mtf50, mtf10;  // cycles per px at 50 % and at 10 % contrast
  Eigen::Vector2d centre_px{0, 0};              // middle of the edge
  double normal_deg = 0;    // direction of the normal, dark to bright, from the x axis toward y
  double length_px = 0;     // length of the edge that was used
  double contrast = 0;      // step in the unit of the image
  double noise_sigma = 0;   // noise of a pixel on the plateaus, in the unit of the image
  bool is_clipped = false;  // a part of the bright side is at full scale, 1
  // The edge spread function: distance from the edge, px, and level from 0 (dark) to 1 (bright).
  std::vector<double> distance_px, level;
};

// Measures the MTF across the clearest straight edge of `grey` (CV_32F, linear light; a region that
// shows one edge with an even area on each side) after ISO 12233 [L22]: the edge's line, which may
// have a bend, is found to a small part of a pixel; the pixels are averaged in bins of a quarter of
// a pixel over their distance from it; the difference of neighbouring bins, in a Tukey window, is
// transformed. Corrected are the finite difference and the width of the bins, each by 1/sinc(f/4)
// [D171], the noise, which adds its own power to the squared modulus, and light that changes evenly
// along each side. The result is a message if there is no such edge, if its direction is one in
// which the pixels do not sample all bins, or if it is shorter than its blur. Throws Interrupted
// after a request to stop.
THICKLENS_EXPORT SlantedEdgeResult MeasureSlantedEdge(const cv::Mat& grey);

// Measures all straight edges of `grey` likewise, at most `most`, the clearest first; those without
// a result are left out.
THICKLENS_EXPORT std::vector<SlantedEdgeResult> MeasureSlantedEdges(const cv::Mat& grey, int most);

// The weighted mean of the curves, by their errors. Throws Error unless there is one.
THICKLENS_EXPORT ModulationTransfer MeanCurve(const std::vector<SlantedEdgeResult>& edges);

}  // namespace thicklens::calib

#endif  // THICKLENS_CALIB_SLANTED_EDGE_H_
