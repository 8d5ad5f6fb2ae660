#ifndef THICKLENS_TOOLS_OPTIONS_EMBEDDED_DEPTH_H_
#define THICKLENS_TOOLS_OPTIONS_EMBEDDED_DEPTH_H_

#include <string>
#include <vector>

#include "thicklens/depth.h"
#include "thicklens/run.h"
#include "tools/options/estimate_options.h"
#include "tools/options/light_field_options.h"

namespace thicklens::tools {

// The names of the depth options that were given, apart from --depth-kind.
std::vector<std::string> GivenDepthOptions(const DepthOptions& options);

// Throws UsageError if an option states what the depth map inside `path` states itself: it names
// both. A --depth-kind that agrees is accepted.
void RefuseOtherMeaning(const DepthOptions& options, const DepthMap& inside);

// The kind of a map in words: "inverse depth (1/z)".
std::string KindInWords(model::DepthKind kind);

// Names the command that takes a depth map out of a photograph in the messages of ReadDepth and
// ReadEmbeddedDepth. `other_way` is what else the user of this command can do to use the map
// inside: "DEPTH left out"; empty: nothing.
RunControl DepthRun(const std::string& other_way = "");

// Returns the depth map inside the photograph of `estimate`, in its own size. Throws Error
// if there is none, with what was looked for and found, and UsageError if the options contradict it
// or the camera is missing that it needs.
DepthMap DepthInsidePhoto(const EstimateOptions& options, int width_px, int height_px);

}  // namespace thicklens::tools

#endif  // THICKLENS_TOOLS_OPTIONS_EMBEDDED_DEPTH_H_
