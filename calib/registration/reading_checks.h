#ifndef THICKLENS_CALIB_REGISTRATION_READING_CHECKS_H_
#define THICKLENS_CALIB_REGISTRATION_READING_CHECKS_H_

#include <optional>
#include <string>
#include <vector>

#include "calib/registration/image_scale.h"
#include "thicklens/calib/calibration.h"
#include "thicklens/calib/focus_sweep.h"

namespace thicklens::calib {

// Whether the target, stated to be an edge, is only one straight edge. Such a target shows no image
// scale: it registers rarely, and at an arbitrary position along itself.
bool IsLoneEdge(const FocusSweep& sweep, std::size_t used, std::size_t registered,
                const ScaleModel& law);
// Removes all samples but the reference, for a single edge, and updates the message of the law.
void ForgetScales(const FocusSweep& sweep, std::vector<ScaleSample>* samples, ScaleModel* law);

// Advice for a sweep of which most used frames could not be registered and no law was found,
// although its target has a measurable scale; otherwise the text is empty. Structure that
// `structure` contains is named before causes that were not looked for.
std::string RegistrationAdvice(const FocusSweep& sweep, const std::vector<FrameMeasurement>& frames,
                               const std::vector<std::size_t>& used, const ScaleModel& law,
                               const FrameStructureFinding& structure);

// Why the law did not give an offset for a sweep that states none, and the remedy.
std::string ReasonOfUnknownOffset(const ScaleModel& law);

// Why the image scales of the used frames forbid any result: the readings run the other way or have
// no order at all, or one image was repeated for all of them. Otherwise std::nullopt.
std::optional<std::string> ReasonAgainstScales(const std::vector<FrameMeasurement>& frames,
                                               const std::vector<std::size_t>& used,
                                               const ScaleModel& law);

// Sets the `rejection` of the frames whose reading contradicts their image scale, with the amount,
// and of those whose image occurs at another reading, too.
void RejectWrongReadings(const FocusSweep& sweep, const std::vector<ScaleSample>& samples,
                         const ScaleModel& law, std::vector<FrameMeasurement>* frames);

// If the other frames follow a law, sets the `rejection` of every frame that does not register to
// the reference. The text names bands of the light where there are any.
void RejectUnregistered(const std::vector<ScaleSample>& samples,
                        const std::vector<std::size_t>& used, std::size_t reference,
                        const ScaleModel& law, const FrameStructureFinding& structure,
                        std::vector<FrameMeasurement>* frames);

// A constant offset of all readings from one frame on: a clamp that slipped, or a table shifted by
// a row.
struct ReadingStep {
  std::size_t frame = 0;  // the first such frame in the order of the readings
  model::Estimate jump_mm;
};
// Finds the jump that the image scales show best in addition to a smooth law. Returns it if it lies
// beyond six standard deviations and explains a large part of the scatter.
std::optional<ReadingStep> FindReadingStep(std::vector<ScaleSample> samples, const ScaleModel& law);

}  // namespace thicklens::calib

#endif  // THICKLENS_CALIB_REGISTRATION_READING_CHECKS_H_
