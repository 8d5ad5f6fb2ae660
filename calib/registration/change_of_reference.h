#ifndef THICKLENS_CALIB_REGISTRATION_CHANGE_OF_REFERENCE_H_
#define THICKLENS_CALIB_REGISTRATION_CHANGE_OF_REFERENCE_H_

#include <vector>

#include "calib/registration/image_scale.h"

namespace thicklens::calib {

// Converts registrations to one frame into registrations to another frame, whose own registration
// to the first one is `base`. Derived here [D58]: p = c + t_i + s_i R_i (p_0 - c) for the frame and
// for the new reference r gives scale s_i/s_r, rotation R_i R_r^-1, shift t_i - (s_i/s_r) R_i
// R_r^-1 t_r.
void ReferTo(Registration base, std::vector<ScaleSample>* samples);

}  // namespace thicklens::calib

#endif  // THICKLENS_CALIB_REGISTRATION_CHANGE_OF_REFERENCE_H_
