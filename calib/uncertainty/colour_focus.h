#ifndef THICKLENS_CALIB_UNCERTAINTY_COLOUR_FOCUS_H_
#define THICKLENS_CALIB_UNCERTAINTY_COLOUR_FOCUS_H_

#include <string>
#include <vector>

#include "thicklens/calib/calibration.h"
#include "thicklens/model/thick_lens.h"

namespace thicklens::calib {

// [D178] kappa of a colour for the sensor where it is. The fit of a colour takes D, and with it
// K = f1 D/f2, from the zf of that colour and the focal length of the camera. The sensor has one D
// for all colours, and it is the focal length that differs: kappa K is what the frames show, so
// that kappa is the fitted one times K(zf of the colour)/K(zf of grey).
model::Estimate RatioOfColour(const model::Estimate& fitted, double colour_focus_mm,
                              double grey_focus_mm, const model::ThickLens& lens);

// Whether the colours come into focus at different depths, or have different blur ratios, beyond
// their errors: chi^2 of three values about their mean above 16, whose probability for equal
// colours is 3e-4 for each of the two.
bool ColoursDiffer(const std::vector<ChannelFocus>& channels);

// The in-focus object distances of colours that differ, in words; empty if they do not.
std::string ColoursInWords(const Calibration& calibration);

// Takes kappa from colours that differ, and adds what they leave open. The blur of grey is a
// mixture of the blurs of its colours, which no single shape describes, so that a fit of grey gives
// a kappa that is too small: kappa is moved to the mean of the colours, weighted as in grey, with
// the errors of both. zf is that of a grey target in grey frames [D198]: its part is what lacks to
// the mean of the colours, as it does where the target is coloured. The focal length may be that of
// any of the colours, so that d1 has a part for their root mean square about zf, weighted as in
// grey. `focus_moves`: the lens or the sensor moves, not the target. The sensor is then measured,
// and zf follows from the focal length and has the part of the colours.
void FollowColours(const model::ThickLens& lens, bool focus_moves, Calibration* calibration);

}  // namespace thicklens::calib

#endif  // THICKLENS_CALIB_UNCERTAINTY_COLOUR_FOCUS_H_
