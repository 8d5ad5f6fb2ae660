#ifndef THICKLENS_TOOLS_OPTIONS_EXIF_CHECK_H_
#define THICKLENS_TOOLS_OPTIONS_EXIF_CHECK_H_

#include <nlohmann/json.hpp>
#include <string>

#include "thicklens/model/camera.h"
#include "tools/interface/exif_comparison.h"

namespace thicklens::tools {

// A calibration holds for one lens at one setting. A photograph's EXIF is therefore compared with
// the camera file.

using ExifFinding = ExifComparison;
using ExifVerdict = ExifComparison::Verdict;
std::string ExifVerdictName(ExifVerdict verdict);  // "agrees", "undecided", "contradicts"

// Reads the photograph's EXIF and compares it. Warns about undecided values. Throws Error with both
// values of everything that contradicts the camera; with `ignore` it reports them instead. It is
// silent without EXIF. Returns the part of --json about EXIF.
nlohmann::json RequireSameCamera(const std::string& photo_path, const std::string& camera_path,
                                 const model::Camera& camera, const PhotoSize& size, bool ignore);

}  // namespace thicklens::tools

#endif  // THICKLENS_TOOLS_OPTIONS_EXIF_CHECK_H_
