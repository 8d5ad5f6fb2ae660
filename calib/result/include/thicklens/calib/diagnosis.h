#ifndef THICKLENS_CALIB_DIAGNOSIS_H_
#define THICKLENS_CALIB_DIAGNOSIS_H_

#include <cstddef>
#include <optional>
#include <string>
#include <vector>

#include "thicklens/base/export.h"
#include "thicklens/model/camera.h"

namespace thicklens::calib {

// One possible cause of a symptom, and how well it explains the samples.
struct CauseFit {
  std::string cause;  // "the lens moves", in the words of docs/reasons.md
  // chi^2 of the samples with the best values of the cause's own parameters. Prior knowledge of
  // lenses (blur ratio, distortion) counts as one more sample.
  double chi2 = 0;
};

// A symptom with the causes that were compared. A cause is named alone only if it explains the
// samples better by kDecisive than every other cause, and by as much better than no cause at all.
struct Diagnosis {
  static constexpr double kDecisive = 16;  // difference of chi^2: four standard deviations

  std::string symptom;           // what was observed, in words
  double chi2_of_none = 0;       // chi^2 of the samples if there were no cause
  std::vector<CauseFit> causes;  // sorted by SortCauses: the best first
  std::size_t named = 0;         // number of causes, from the first, that cannot be distinguished
  std::string separates;         // observation that would distinguish these causes

  // Whether the cause is named, and whether it is the only named one.
  THICKLENS_EXPORT bool Names(const std::string& cause) const;
  // Returns whether the cause is the only named one.
  THICKLENS_EXPORT bool NamesOnly(const std::string& cause) const;
};

// Sorts the causes and counts those to be named: none where the best one is not significant;
// otherwise all within kDecisive of it.
THICKLENS_EXPORT void SortCauses(Diagnosis* diagnosis);

// The reading at which a sweep is sharpest: the peak of the normalised sharpness against the
// reading. It needs no camera, no bench offset and no direction.
struct SharpestReading {
  bool done = false;                // true if a peak was found
  std::string message = "not run";  // how it ended; without a result, the reason
  model::Estimate reading_mm;       // reading at the peak
  int frames_used = 0;              // number of frames in the peak
  // Index into the frames of the sharpest single frame, whether there is a peak or not.
  int sharpest_frame = -1;
};

// Structure of the frames that stays in place on the sensor while the target changes its size, or
// that belongs to the light and not to the target. Each value is present only where it could be
// measured.
struct FrameStructureFinding {
  // Limits, as differences of the logarithm of the light, above which the structure matters to
  // registrations: the effect of less on an image scale is below the scale's errors.
  static constexpr double kMinVignetting = 0.1;
  static constexpr double kMinBands = 0.01, kMinFixed = 0.002;  // for bands and fixed_structure
  static constexpr double kSignificant = 4;                     // standard deviations

  bool measured = false;  // true if the frames were examined
  // ln of the light at the region's corner over that at its centre, fixed to the frame: negative
  // where the corners are darker.
  std::optional<model::Estimate> vignetting;
  // Relative standard deviation of the brightness between rows, in a pattern that differs from
  // frame to frame, if it exceeds the deviation between columns; or the other way round.
  std::optional<model::Estimate> bands;
  bool bands_are_columns = false;  // true: `bands` is between columns
  // Relative standard deviation of fine structure that stays in place (dust, hot pixels, overlays).
  std::optional<model::Estimate> fixed_structure;

  // Whether the structure exceeds four standard deviations and is large enough to matter to
  // registrations.
  THICKLENS_EXPORT bool HasVignetting() const;
  // As HasVignetting, for bands.
  THICKLENS_EXPORT bool HasBands() const;
  // As HasVignetting, for fixed structure.
  THICKLENS_EXPORT bool HasFixedStructure() const;
};

}  // namespace thicklens::calib

#endif  // THICKLENS_CALIB_DIAGNOSIS_H_
