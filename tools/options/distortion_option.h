#ifndef THICKLENS_TOOLS_OPTIONS_DISTORTION_OPTION_H_
#define THICKLENS_TOOLS_OPTIONS_DISTORTION_OPTION_H_

#include <string>

namespace thicklens::tools {

// The value of --distortion for images that are undistorted already.
inline constexpr char kUndistorted[] = "none";

// Returns the file of the value FILE or FILE:CAMERA of --distortion; empty for none and no value.
std::string FileOfDistortion(const std::string& value);

}  // namespace thicklens::tools

#endif  // THICKLENS_TOOLS_OPTIONS_DISTORTION_OPTION_H_
