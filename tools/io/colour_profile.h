#ifndef THICKLENS_TOOLS_IO_COLOUR_PROFILE_H_
#define THICKLENS_TOOLS_IO_COLOUR_PROFILE_H_

#include <opencv2/core/mat.hpp>

#include "thicklens/io/image_file.h"

namespace thicklens::io {

// Sets `facts->transfer` to the curve of `facts->icc_profile`, if the profile describes these
// channels by one curve for all of them that StatedTransfer has. A profile outranks what else a
// file states of its transfer, which is then removed.
void TakeProfileTransfer(ImageFacts* facts);

// Converts a photograph of 8 or 16 bits, RGB(A) or grey, whose profile has no such curve (tables of
// colours, the dot gain of print) to sRGB, 16 bits, by relative colorimetry, and removes the
// profile. Does nothing to others. Throws Error if the profile cannot be used.
void ConvertFromProfile(ImageFacts* facts, cv::Mat* photograph);

}  // namespace thicklens::io

#endif  // THICKLENS_TOOLS_IO_COLOUR_PROFILE_H_
