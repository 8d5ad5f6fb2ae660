#ifndef THICKLENS_TOOLS_INTERFACE_CLIPPED_HIGHLIGHTS_H_
#define THICKLENS_TOOLS_INTERFACE_CLIPPED_HIGHLIGHTS_H_

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "thicklens/estimate.h"
#include "thicklens/image.h"
#include "tools/interface/run_scope.h"

namespace thicklens {

// Finds the clipped values of a photograph, without alpha, and sets `clipping` of the diagnostics.
// Returns an image of its size that is 1 at the clipped values and 0 elsewhere, which is to be
// undistorted and cropped like the photograph; absent: there are none.
std::optional<Image> ClippedPartsOf(const Image& photo, EstimateDiagnostics* diagnostics);

// Returns EstimateInput::clipped: the values to which a clipped one has contributed.
std::vector<std::uint8_t> MarksOf(const Image& clipped_parts);

// Sets share and levels of a whole photograph to those of the part of it that has these marks.
void LimitToMarks(const std::vector<std::uint8_t>& marks, PhotoClipping* clipping);

// Says what is clipped in the photograph `photo`, and what an estimate makes of it.
void ReportClipping(const std::string& photo, const EstimateOptions& options,
                    const PhotoClipping& clipping, RunScope* run);

}  // namespace thicklens

#endif  // THICKLENS_TOOLS_INTERFACE_CLIPPED_HIGHLIGHTS_H_
