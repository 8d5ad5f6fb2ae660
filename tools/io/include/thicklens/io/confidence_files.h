#ifndef THICKLENS_IO_CONFIDENCE_FILES_H_
#define THICKLENS_IO_CONFIDENCE_FILES_H_

#include <vector>

#include "thicklens/base/export.h"
#include "thicklens/estimator/ray_confidence.h"
#include "thicklens/io/light_field_io.h"

namespace thicklens::io {

// Writes the confidence of all rays, view by view.
THICKLENS_EXPORT void WriteConfidence(const std::vector<estimator::Confidence>& of_rays,
                                      int u_count, int width_px, int height_px,
                                      LightFieldWriter* writer);

}  // namespace thicklens::io

#endif  // THICKLENS_IO_CONFIDENCE_FILES_H_
