#ifndef THICKLENS_CALIB_REGISTRATION_SCALE_CAUSES_H_
#define THICKLENS_CALIB_REGISTRATION_SCALE_CAUSES_H_

#include <optional>
#include <string>
#include <vector>

#include "calib/registration/blur_slope.h"
#include "thicklens/calib/diagnosis.h"
#include "thicklens/calib/focus_sweep.h"
#include "thicklens/calib/image_scale.h"

namespace thicklens::calib {

// Causes of the way in which the image scale goes with the readings.
inline constexpr char kTargetMoves[] = "the target moves as stated";
inline constexpr char kZeroIsWrong[] = "the target moves as stated, but offset_mm is wrong";
inline constexpr char kReversedReadings[] = "the readings run the other way";
inline constexpr char kLensMoves[] = "the lens or the sensor moves, not the target";

// A unit in which the readings may be, though they are taken for millimetres.
struct ReadingUnit {
  const char* name;  // "inches"
  double millimetres;
};

// The laws that the image scales were compared with, each on the same samples: chi^2 of the
// scales, of the bench zero where it is given, and of the blur ratio that the law asks for.
struct ScaleCauses {
  Diagnosis diagnosis;
  std::optional<BlurSlope> blur_slope;
  // Of the best law of each kind.
  double reference_depth_mm = 0;          // of the target at the reference, as the readings have it
  double lens_zero_mm = 0;                // reading at which a scale linear in the reading is 0
  double inverse_zero_mm = 0;             // reading at which 1/scale is 0
  double chi2_lens = 0, chi2_target = 0;  // of the scales alone
  // The unit that explains the scales and the blur, if one does and millimetres do not.
  std::optional<ReadingUnit> unit;
  std::vector<ReadingUnit> other_units;  // that explain them as well as that one

  // Whether readings in millimetres of a target that moves as stated explain what is seen.
  bool ReadingsMayBeRight() const {
    return diagnosis.Names(kTargetMoves) || diagnosis.Names(kZeroIsWrong);
  }
};

// Compares the causes. The samples must follow one law, as stated or reversed (`law.kind`).
ScaleCauses CompareScaleCauses(const std::vector<ScaleSample>& samples, const FocusSweep& sweep);

// The refusal where the causes forbid any result: the lens moves, or the readings run the other
// way. Where both explain the scales, both are named with what would tell them apart. Else nothing.
std::optional<std::string> ReasonOfScaleCauses(const FocusSweep& sweep, const ScaleLaw& law,
                                               const ScaleCauses& causes);

// A question about the unit of the readings where the law puts every frame so near that no image,
// or one larger than the target, would form, and the blur does not say that it is so. With the unit
// that fits, where one does; else empty.
std::string UnitAdvice(const FocusSweep& sweep, const std::vector<FrameMeasurement>& frames,
                       const ScaleLaw& law, const ScaleCauses& causes);

// "With readings in inches it is at about 300 mm and the blur ratio about 0.45"; empty where no
// unit explains what millimetres do not.
std::string UnitThatFits(const FocusSweep& sweep, const ScaleCauses& causes);

// The warning where the scale stays the same although the given bench zero lets it change.
std::string ConstantScaleWarning(const FocusSweep& sweep, const std::vector<ScaleSample>& samples);

}  // namespace thicklens::calib

#endif  // THICKLENS_CALIB_REGISTRATION_SCALE_CAUSES_H_
