#ifndef THICKLENS_TOOLS_INTERFACE_FRAME_LIGHT_H_
#define THICKLENS_TOOLS_INTERFACE_FRAME_LIGHT_H_

#include <opencv2/core/mat.hpp>
#include <string>

#include "thicklens/camera.h"
#include "thicklens/image.h"
#include "thicklens/io/image_file.h"

namespace thicklens {

// Describes the sensor and the processing of a raw file, which must be the same for frames that are
// combined; empty: the file is none.
std::string SensorTextOf(const io::ImageFacts& facts);

// The linear light of a stored frame without alpha, CV_32F with 1 or 3 channels.
cv::Mat LightOf(const cv::Mat& stored, const TransferCurve& transfer);
// Its grey light, 0.2126 R + 0.7152 G + 0.0722 B.
cv::Mat GreyOf(const cv::Mat& light);

}  // namespace thicklens

#endif  // THICKLENS_TOOLS_INTERFACE_FRAME_LIGHT_H_
