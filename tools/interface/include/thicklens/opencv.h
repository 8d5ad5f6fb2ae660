#ifndef THICKLENS_OPENCV_H_
#define THICKLENS_OPENCV_H_

// Conversion of OpenCV's matrices. The umbrella header does not include this file, so that only
// programs that use OpenCV need its headers.
#include <opencv2/core/mat.hpp>
#include <optional>
#include <string>

#include "thicklens/base/export.h"
#include "thicklens/calib/focus_sweep.h"
#include "thicklens/depth.h"
#include "thicklens/image.h"
#include "thicklens/sweep.h"

namespace thicklens {

// Converts a matrix whose channels are in the stated order: cv::imread gives kBgr (or kGrey with
// IMREAD_GRAYSCALE). CV_8U and CV_16U become encoded values of 8 or 16 bits, CV_32F linear light.
// Throws Error if the matrix is empty, has another depth, or has other channels than `order`.
THICKLENS_EXPORT Image ImageFromMat(const cv::Mat& mat, ChannelOrder order,
                                    std::optional<TransferCurve> transfer = std::nullopt,
                                    const std::string& source = "");
// Converts an image to a matrix of its own memory with the channels in `order`: CV_8U, CV_16U or
// CV_32F. Throws Error if `order` has another number of channels than the image.
THICKLENS_EXPORT cv::Mat MatFromImage(const Image& image, ChannelOrder order);

// Converts a matrix of one channel to a depth map whose numbers have the stated meaning: CV_8U and
// CV_16U become a map of whole numbers (is_integer), in which 0 is a hole, CV_32F a map of floats.
// `source` names the map in messages. Throws OptionError if the meaning is not valid, and Error if
// the matrix is empty, has more than one channel or another depth.
THICKLENS_EXPORT DepthMap DepthMapFromMat(const cv::Mat& mat, const DepthMeaning& meaning,
                                          const std::string& source = "");
// Converts a depth map to a matrix of its own memory with one channel: CV_16U for a map of whole
// numbers, CV_32F for others. The values are those of the map, in its unit; the meaning is not part
// of the matrix. Throws OptionError if the map is not valid, and Error if a map of whole numbers
// has a value that is none from 0 to 65535.
THICKLENS_EXPORT cv::Mat MatFromDepthMap(const DepthMap& depth);

// The sweep as the library thicklens::calib measures it, with a reader of its frames. Throws Error
// if the description takes its floor from the calibration of another camera. Raw files are
// demosaiced, so that the frames have the sensor's pixels, whatever the description states of them.
THICKLENS_EXPORT calib::FocusSweep FocusSweepOf(const Sweep& sweep);

}  // namespace thicklens

#endif  // THICKLENS_OPENCV_H_
