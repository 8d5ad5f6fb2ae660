#ifndef THICKLENS_CALIB_DIAGNOSIS_H_
#define THICKLENS_CALIB_DIAGNOSIS_H_

#include <cstddef>
#include <optional>
#include <string>
#include <vector>

#include "thicklens/model/camera.h"

namespace thicklens::calib {

// One cause that may be behind a symptom, and how well it explains the samples.
struct CauseFit {
  std::string cause;  // "the lens moves", in the words of docs/reasons.md
  // Of the samples, with the cause's own parameters at their best; what is known of lenses (blur
  // ratio, distortion) is one sample more.
  double chi2 = 0;
};

// A symptom with the causes that were compared. Only what explains the samples better than every
// other cause by kDecisive, and better than no cause at all by as much, is named alone.
struct Diagnosis {
  static constexpr double kDecisive = 16;  // of chi^2: four standard deviations

  std::string symptom;
  double chi2_of_none = 0;       // of the samples if there were no cause
  std::vector<CauseFit> causes;  // sorted by SortCauses: the best first
  std::size_t named = 0;         // how many of them, from the first on, cannot be told apart
  std::string separates;         // what would tell those apart

  // Whether the cause is named, and whether it is the only one.
  bool Names(const std::string& cause) const;
  bool NamesOnly(const std::string& cause) const;
};

// Sorts the causes and counts those to be named: none where the best one is not significant, else
// all within kDecisive of it.
void SortCauses(Diagnosis* diagnosis);

// Where a sweep is sharpest: the peak of the normalised sharpness against the reading. It needs no
// camera, no bench zero and no direction.
struct SharpestReading {
  bool done = false;
  std::string message = "not run";
  model::Estimate reading_mm;
  int frames_used = 0;
  // Index into the frames of the sharpest one by itself, whether there is a peak or not.
  int sharpest_frame = -1;
};

// What of a frame's picture stays where it is on the sensor while the target changes its size, or
// belongs to the light and not to the target. Each is there only where it could be measured.
struct FrameStructureFinding {
  // What matters to registrations. Of the logarithm: what less does to a scale is below its errors.
  static constexpr double kLeastVignetting = 0.1;
  static constexpr double kLeastBands = 0.01, kLeastFixed = 0.002;
  static constexpr double kSignificant = 4;  // standard deviations

  bool measured = false;
  // ln of the light at the region's corner over that at its centre, fixed to the frame: negative
  // where the corners are darker.
  std::optional<model::Estimate> vignetting;
  // Relative standard deviation of brightness from row to row that is another one in each frame, if
  // it exceeds what goes from column to column; or the other way round.
  std::optional<model::Estimate> bands;
  bool bands_are_columns = false;
  // Relative standard deviation of fine structure that stays in place (dust, hot pixels, overlays).
  std::optional<model::Estimate> fixed_structure;

  // Beyond four standard deviations, and large enough to matter to registrations.
  bool HasVignetting() const;
  bool HasBands() const;
  bool HasFixedStructure() const;
};

}  // namespace thicklens::calib

#endif  // THICKLENS_CALIB_DIAGNOSIS_H_
