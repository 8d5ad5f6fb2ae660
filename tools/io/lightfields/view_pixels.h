#ifndef THICKLENS_TOOLS_IO_LIGHTFIELDS_VIEW_PIXELS_H_
#define THICKLENS_TOOLS_IO_LIGHTFIELDS_VIEW_PIXELS_H_

#include <opencv2/core/mat.hpp>
#include <string>

#include "thicklens/io/image_file.h"
#include "thicklens/model/scene.h"
#include "thicklens/model/transfer_curve.h"

namespace thicklens::io {

// Reads an image of 8 or 16 bits as light, without its alpha channel.
model::LinearImage ReadPngView(const std::string& path, const model::TransferCurve& transfer);

// The light of pixels as they were decoded, without an alpha channel: floats are linear, integers
// are sRGB unless the file states that they are linear. Throws Error that begins with `name`.
model::LinearImage LightOfPixels(const cv::Mat& pixels, const ImageFacts& facts,
                                 const std::string& name);
// Reads a file of any kind as LightOfPixels does.
model::LinearImage ReadLightOfFile(const std::string& path);

}  // namespace thicklens::io

#endif  // THICKLENS_TOOLS_IO_LIGHTFIELDS_VIEW_PIXELS_H_
