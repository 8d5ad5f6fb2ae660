#ifndef THICKLENS_MODEL_GROWING_SWEEP_H_
#define THICKLENS_MODEL_GROWING_SWEEP_H_

#include <string>
#include <vector>

#include "thicklens/base/export.h"
#include "thicklens/model/sweep_file.h"

namespace thicklens::model {

// A sweep whose images and readings are still being written.
struct GrowingSweep {
  SweepFile sweep;                           // of the images that have a reading
  std::vector<std::string> without_reading;  // images that have none
};

// As SweepFromFolder, for some images of a folder: rows of other images, and images without a row,
// are left out and are no errors. Throws Error for a table that cannot be read, and for two
// readings of one image.
THICKLENS_EXPORT GrowingSweep SweepOfImages(
    const std::string& folder, const std::vector<std::string>& images, const std::string& table,
    const std::string& camera_path, const SweepReading& reading, std::vector<std::string>* notices);

}  // namespace thicklens::model

#endif  // THICKLENS_MODEL_GROWING_SWEEP_H_
