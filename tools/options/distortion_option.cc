#include "tools/options/distortion_option.h"

#include "thicklens/io/lens_distortion_file.h"

namespace thicklens::tools {

std::string FileOfDistortion(const std::string& value) {
  return value.empty() || value == kUndistorted ? "" : io::FileAndCamera(value).first;
}

}  // namespace thicklens::tools
