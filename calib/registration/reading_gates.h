#ifndef THICKLENS_CALIB_REGISTRATION_READING_GATES_H_
#define THICKLENS_CALIB_REGISTRATION_READING_GATES_H_

#include <optional>
#include <string>
#include <vector>

#include "thicklens/calib/calibration.h"
#include "thicklens/calib/focus_sweep.h"
#include "thicklens/calib/image_scale.h"

namespace thicklens::calib {

// Whether the target, stated to be an edge, is nothing but one straight edge. It shows no image
// scale: it registers seldom, and wherever along itself it happens to.
bool IsLoneEdge(const FocusSweep& sweep, std::size_t used, std::size_t registered,
                const ScaleLaw& law);
// Then only the reference is left, and the law says what takes its place.
void ForgetScales(const FocusSweep& sweep, std::vector<ScaleSample>* samples, ScaleLaw* law);

// What to do where most of the used frames could not be registered and no law was found, though the
// target has a scale to measure; else empty. What `structure` shows is named before what was not
// looked for.
std::string RegistrationAdvice(const FocusSweep& sweep, const std::vector<FrameMeasurement>& frames,
                               const std::vector<std::size_t>& used, const ScaleLaw& law,
                               const FrameStructureFinding& structure);

// Of a sweep without an offset: why the law gave none either, and what to do.
std::string ReasonOfUnknownOffset(const ScaleLaw& law);

// Why the image scales of the used frames forbid any result, or nothing: the readings run the other
// way or are in no order at all, or one picture was repeated for all of them.
std::optional<std::string> ReasonAgainstScales(const FocusSweep& sweep,
                                               const std::vector<FrameMeasurement>& frames,
                                               const std::vector<std::size_t>& used,
                                               const ScaleLaw& law);

// Names the frames whose reading contradicts their image scale, with the amount, and those whose
// picture stands at another reading too: sets their `rejection`.
void RejectWrongReadings(const FocusSweep& sweep, const std::vector<ScaleSample>& samples,
                         const ScaleLaw& law, std::vector<FrameMeasurement>* frames);

// Where the others follow a law, a frame that does not register to the reference is of no use: sets
// its `rejection`, which names bands of the light where there are any.
void RejectUnregistered(const std::vector<ScaleSample>& samples,
                        const std::vector<std::size_t>& used, std::size_t reference,
                        const ScaleLaw& law, const FrameStructureFinding& structure,
                        std::vector<FrameMeasurement>* frames);

// From one frame on all readings are off by as much: a clamp that slipped, a table moved by a row.
struct Slip {
  std::size_t frame = 0;  // the first, in the order of the readings
  model::Estimate jump_mm;
};
// The jump that the image scales show best beside a smooth law, if it lies beyond six standard
// deviations and explains a good part of the scatter.
std::optional<Slip> FindSlip(std::vector<ScaleSample> samples, const ScaleLaw& law);

}  // namespace thicklens::calib

#endif  // THICKLENS_CALIB_REGISTRATION_READING_GATES_H_
