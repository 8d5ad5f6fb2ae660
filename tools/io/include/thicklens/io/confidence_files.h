#ifndef THICKLENS_IO_CONFIDENCE_FILES_H_
#define THICKLENS_IO_CONFIDENCE_FILES_H_

#include <string>
#include <vector>

#include "thicklens/base/export.h"
#include "thicklens/estimator/ray_confidence.h"
#include "thicklens/io/light_field_io.h"

namespace thicklens::io {

// Writes the confidence of all rays, view by view.
THICKLENS_EXPORT void WriteConfidence(const std::vector<estimator::Confidence>& of_rays,
                                      int u_count, int width_px, int height_px,
                                      LightFieldWriter* writer);

// Reads the confidence of all rays of a light field's folder: one byte per ray, view by view (index
// l * U + k), row by row; empty if the folder has none. The rays of a view that is missing, and has
// no confidence, are kFilledIn. `threads`: 0 means one per core. Throws Error that names the folder
// or the file that is missing, cannot be read, is no grey image of 8 bits or has another size than
// the views.
THICKLENS_EXPORT std::vector<estimator::Confidence> ReadConfidence(const std::string& folder,
                                                                   int threads);

}  // namespace thicklens::io

#endif  // THICKLENS_IO_CONFIDENCE_FILES_H_
