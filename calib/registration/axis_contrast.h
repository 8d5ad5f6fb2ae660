#ifndef THICKLENS_CALIB_REGISTRATION_AXIS_CONTRAST_H_
#define THICKLENS_CALIB_REGISTRATION_AXIS_CONTRAST_H_

#include <functional>
#include <opencv2/core/mat.hpp>
#include <optional>
#include <vector>

#include "calib/registration/image_scale.h"
#include "thicklens/model/camera.h"

namespace thicklens::calib {

// Change of ln(contrast of the slopes along x over that along y) from one end of the sweep to the
// other. Blur that is the same in all directions changes it alike on both sides of focus, whatever
// the texture, but an astigmatic lens changes it in opposite directions. std::nullopt where too few
// frames were registered. `read_grey` gives the linear grey light of a frame, CV_32F.
std::optional<model::Estimate> ChangeOfAxisContrast(
    const std::vector<ScaleSample>& samples, const std::function<cv::Mat(std::size_t)>& read_grey);

// Whether such a change shows an astigmatic lens.
bool ShowsAstigmatism(const std::optional<model::Estimate>& change_of_axis_contrast);

}  // namespace thicklens::calib

#endif  // THICKLENS_CALIB_REGISTRATION_AXIS_CONTRAST_H_
