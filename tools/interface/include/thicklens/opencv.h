#ifndef THICKLENS_OPENCV_H_
#define THICKLENS_OPENCV_H_

// Conversion of OpenCV's matrices. The umbrella header does not include this file, so that only
// programs that use OpenCV need its headers.
#include <opencv2/core/mat.hpp>
#include <optional>
#include <string>

#include "thicklens/base/export.h"
#include "thicklens/calib/focus_sweep.h"
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

// The sweep as the library thicklens::calib measures it, with a reader of its frames. Throws Error
// if the description takes its floor from the calibration of another camera.
THICKLENS_EXPORT calib::FocusSweep FocusSweepOf(const Sweep& sweep);

}  // namespace thicklens

#endif  // THICKLENS_OPENCV_H_
