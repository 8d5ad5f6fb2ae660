#include "thicklens/calib/calibration.h"

namespace thicklens::calib {

std::string OutcomeName(Outcome outcome) {
  switch (outcome) {
    case Outcome::kOk:
      return "ok";
    case Outcome::kPartial:
      return "partial";
    default:
      return "refused";
  }
}

}  // namespace thicklens::calib
