#ifndef THICKLENS_CALIB_STAGE_ERRORS_H_
#define THICKLENS_CALIB_STAGE_ERRORS_H_

#include <optional>
#include <string>
#include <vector>

#include "thicklens/base/export.h"
#include "thicklens/model/camera.h"

namespace thicklens::calib {

// A periodic error of the readings, as of a lead screw: the written reading is too large by
// amplitude sin(2 pi reading/period + phase).
struct PeriodicError {
  model::Estimate amplitude_mm;  // mm of the reading, >= 0
  model::Estimate period_mm;     // in the readings; at equal steps a shorter one looks the same
  double phase_deg = 0;          // at reading 0, -180 to 180
};

// Systematic errors of the stage's readings, found from the image scale and the blur of the frames
// [D146]. The readings are corrected for those that are present.
struct StageErrors {
  bool compared = false;            // true if the causes were compared
  std::string message = "not run";  // how it ended; if nothing was compared, the reason

  // The reading of a position approached by falling readings minus that of the same position
  // approached by rising ones.
  std::optional<model::Estimate> backlash_mm;
  std::optional<PeriodicError> periodic;  // present if there is a periodic error
  // Lost steps or a slipped clamp: added to the readings from a frame on, in the order of the
  // frames, in a sweep whose readings do not only rise or only fall.
  std::optional<model::Estimate> slip_mm;
  int slip_from_frame = -1;  // the first such frame
  // Causes that explain the readings as well as those that are present, or, if none is present,
  // those that the frames do not distinguish: in words.
  std::vector<std::string> also_possible;

  // Whether the readings were corrected.
  bool Corrected() const { return backlash_mm || periodic || slip_mm; }
  // Text of one sentence for each error that was found; empty if there is none.
  THICKLENS_EXPORT std::string InWords() const;
};

}  // namespace thicklens::calib

#endif  // THICKLENS_CALIB_STAGE_ERRORS_H_
