#ifndef THICKLENS_CALIB_REGISTRATION_SCALE_TRACKING_H_
#define THICKLENS_CALIB_REGISTRATION_SCALE_TRACKING_H_

#include <functional>
#include <opencv2/core/mat.hpp>
#include <optional>
#include <vector>

#include "calib/registration/image_scale.h"
#include "calib/registration/registration.h"
#include "thicklens/calib/focus_sweep.h"

namespace thicklens::calib {

// Registers the frames of a sweep to one reference, from the nearest readings outward. The law
// found so far predicts the start of the next registration, so that a periodic target does not
// cause an error of one period. Where that fails (a wrong reading), a ladder of scales is tried.
// `known_offset_mm`, the bench offset if it is given, defines the first prediction. `read_grey`
// returns the linear grey light of a frame (CV_32F) and is called from several threads; `tick` is
// called once for each frame except the reference, from several threads, too. The radial distortion
// that the frames show together is removed from the scales, and its uncertainty is added to their
// errors.
//
// On a target that looks the same at every scale (IsScaleInvariant; the edge estimator handles a
// knife edge) the scales are taken from the readings and only shifts are measured. If no offset is
// known either, only the reference is returned. All samples of such a target have
// `scale_is_from_reading` set.
std::vector<ScaleSample> TrackScale(const FocusSweep& sweep,
                                    const std::function<cv::Mat(std::size_t)>& read_grey,
                                    const std::vector<std::size_t>& frames, std::size_t reference,
                                    std::optional<double> known_offset_mm, int threads,
                                    const std::function<void()>& tick);

// All frames share the radial distortion, so that together they determine it better than each one.
// Removes what they show from the scales, weighted against the expectation of a usual lens, and
// adds its uncertainty to their errors. There is one registration for each sample.
void TakeOutDistortion(double corner_px, const std::vector<FreeRegistration>& registrations,
                       std::vector<ScaleSample>* samples);

// The part of a fitted distortion of that standard deviation, px^-2, that is removed.
double PartOfDistortion(double corner_px, double sigma);

// Pixel of the region of interest on the optical axis, and the distance of the farthest corner from
// it.
cv::Point2d RegionCentre(const FocusSweep& sweep);
double RegionCornerRadiusPx(const FocusSweep& sweep);

}  // namespace thicklens::calib

#endif  // THICKLENS_CALIB_REGISTRATION_SCALE_TRACKING_H_
