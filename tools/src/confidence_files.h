#ifndef THICKLENS_TOOLS_CONFIDENCE_FILES_H_
#define THICKLENS_TOOLS_CONFIDENCE_FILES_H_

#include <vector>

#include "light_field_io.h"
#include "thicklens/estimator/ray_confidence.h"

namespace thicklens::tools {

// Writes the confidence of all rays, view by view.
void WriteConfidence(const std::vector<estimator::Confidence>& of_rays, int u_count, int width_px,
                     int height_px, LightFieldWriter* writer);

// Writes the confidence of an estimate whose solver does not report it; it depends on the depth
// alone.
void WriteConfidence(const estimator::EstimateInput& input, int threads, LightFieldWriter* writer);

}  // namespace thicklens::tools

#endif  // THICKLENS_TOOLS_CONFIDENCE_FILES_H_
