#ifndef THICKLENS_CALIB_REGISTRATION_FRAME_SHADING_H_
#define THICKLENS_CALIB_REGISTRATION_FRAME_SHADING_H_

#include <Eigen/Core>
#include <opencv2/core/mat.hpp>
#include <optional>
#include <string>

#include "calib/registration/frame_structure.h"
#include "thicklens/model/camera.h"

namespace thicklens::calib {

// A smooth field of ln light that is fixed to the frame: terms . b(u), u = (p - centre)/unit, where
// b are the monomials of degree 2 to 4 and |u|^6. It is 0 at the centre.
struct FrameShading {
  bool done = false;                // true if the field was fitted
  std::string message = "not run";  // how it ended; without a result, the reason
  Eigen::VectorXd terms;
  Eigen::Vector2d centre_px{0, 0};
  double unit_px = 1;  // distance of the farthest corner from the centre
  // Mean of the four corners, in stops. Present where the field was fitted.
  std::optional<model::Estimate> corner_stops;
  // Whether the field differs from 0 at any corner or middle of a side by more than 5 standard
  // deviations and 0.04.
  bool is_significant = false;
  // Largest of these values, ln.
  double largest = 0;
};

// Distinguishes the shading of the frame from that of the target by their motion [D133]:
//   ln I_i(p) = t(q) + g_i + h_i . u + terms . b(u),
// where q is the place of p on the target, t the target, and g_i and h_i the gain and the slope of
// the light of frame i. The frames are shrunk so much that their blur does not matter. t is
// eliminated: only the differences between the frames that show a point of the target count.
// Outliers have less weight (Cauchy). The errors are from a jackknife over 16 parts of the target,
// because its detail causes errors that neighbours share. The slopes make a linear shading
// unobservable, which is harmless: it does not change the scale.
FrameShading MeasureShading(const FramePlaces& places, int threads);

// ln of the relative light at each pixel of a region of that size, CV_32F.
cv::Mat LogOfShading(const FrameShading& shading, cv::Size size);

}  // namespace thicklens::calib

#endif  // THICKLENS_CALIB_REGISTRATION_FRAME_SHADING_H_
