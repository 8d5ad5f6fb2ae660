#ifndef THICKLENS_CALIB_EDGES_FEATURE_PIXELS_H_
#define THICKLENS_CALIB_EDGES_FEATURE_PIXELS_H_

#include <Eigen/Core>
#include <limits>
#include <opencv2/core/mat.hpp>
#include <vector>

namespace thicklens::calib {

// A rectangle across an edge: `half_width_px` along the normal of the edge, `half_length_px` along
// the edge.
struct Strip {
  Eigen::Vector2d centre_px{0, 0};
  double normal_rad = 0;
  double half_width_px = 0;
  double half_length_px = 0;
  // Pixels further than this from both middle lines are left out. They lie inside the squares of a
  // corner.
  double arm_px = std::numeric_limits<double>::infinity();
  bool is_long = false;  // an edge of at least half the frame's shorter side
};

// The pixels of a frame in a strip. Positions are relative to the centre of the strip.
struct FeaturePixels {
  std::vector<double> x_px, y_px, grey;
  std::vector<int> cell;           // index of the square of about 4 px x 4 px
  std::vector<char> next_to_last;  // whether it is the right neighbour of the previous pixel
  int cells = 0;
  double coverage = 0;  // the part of the strip that lies inside the frame

  std::size_t size() const { return grey.size(); }
};

// Gathers the pixels of a strip. If a strip has more than about `most` pixels, evenly distributed
// whole pieces of it are gathered, so that there are about `most` pixels.
FeaturePixels GatherPixels(const cv::Mat& grey, const Strip& strip, int most);

// How well a step describes its pixels. All sigmas are in the unit of the pixels.
struct FitQuality {
  double residual_sigma = 0;
  double noise_sigma = 0;      // noise of a pixel, from neighbours on the plateaus
  double structure_sigma = 0;  // part of the residual that neighbours share
  double clumping = 1;         // variance of cell means over that of as many independent pixels
  double chi2_per_dof = 0;
  bool clipped = false;  // the bright plateau is cut off
};
// Judges a fit. `bright` is the fitted level of each pixel, from 0 (dark) to 1 (bright).
FitQuality JudgeFit(const FeaturePixels& pixels, const Eigen::VectorXd& residual,
                    const std::vector<double>& bright, int parameters);

// Whether the residual of a step of this contrast is noise, and not a texture or a bend.
bool IsStep(const FitQuality& quality, double contrast);

// Covariance of the parameters of a least-squares fit whose noise may differ from pixel to pixel
// and may be shared by neighbours: (J^T J)^-1 (J^T diag(r^2) J) (J^T J)^-1 c n/(n - p), after White
// 1980 [L8]. c >= 1 is the clumping of the residual. The result is empty if a parameter is not
// determined.
Eigen::MatrixXd FitCovariance(const Eigen::MatrixXd& jacobian, const Eigen::VectorXd& residual,
                              double clumping);

}  // namespace thicklens::calib

#endif  // THICKLENS_CALIB_EDGES_FEATURE_PIXELS_H_
