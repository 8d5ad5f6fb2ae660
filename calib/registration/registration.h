#ifndef THICKLENS_CALIB_REGISTRATION_REGISTRATION_H_
#define THICKLENS_CALIB_REGISTRATION_REGISTRATION_H_

#include <opencv2/core/mat.hpp>
#include <optional>

#include "calib/registration/blur_field.h"
#include "calib/registration/coarse_registration.h"
#include "calib/registration/image_scale.h"
#include "calib/registration/tile_map.h"
#include "calib/registration/tile_pass.h"

namespace thicklens::calib {

// A registration with a free cubic term. Its scale is that at the centre, and several times less
// certain than it would be for a known cubic term.
struct FreeRegistration {
  Registration free;
  // d scale/d cubic along the valley of the fit, px^2. The scale for a known cubic term c is
  // free.scale + scale_per_cubic (free.cubic - c).
  double scale_per_cubic = 0;
  BlurOverField blur;  // how the added blur changes over the field
  FrameMap map;        // of the affine part, or with the cubic term where it is significant

  // The registration for a cubic term that is known to be `cubic` with `cubic_sigma`. The measured
  // cubic term remains in the result.
  Registration WithCubic(double cubic, double cubic_sigma) const;
};

// The registration that a displacement beyond a map gives, with its errors. The added blur is open.
FreeRegistration DescribeFreely(const FrameMap& map, const DisplacementField& field);

// Factor by which the field that two frames share is shrunk in the last pass over its tiles, for a
// difference of their blurs, px^2.
int FactorOfPass(const cv::Rect2d& shared, double added_variance_px2);

// Registers as Register does, for callers that know the cubic term better than one pair of frames
// shows it. Throws Interrupted after a request to stop.
std::optional<FreeRegistration> RegisterFreely(const cv::Mat& reference, const cv::Mat& frame,
                                               double expected_scale, cv::Point2d centre);

// Registers once more from the map of `first`, with the blur over the field, which other frames
// determine better than one pair shows it: the reference is blurred as the frame is at every place.
// `blur.field` of the result is what is left beyond that field, and `blur.texture` is that of
// `first`.
std::optional<FreeRegistration> RegisterWithBlur(const cv::Mat& reference, const cv::Mat& frame,
                                                 const FreeRegistration& first,
                                                 const KnownBlurField& known);

}  // namespace thicklens::calib

#endif  // THICKLENS_CALIB_REGISTRATION_REGISTRATION_H_
