#ifndef THICKLENS_CALIB_REGISTRATION_SCALE_CAUSES_H_
#define THICKLENS_CALIB_REGISTRATION_SCALE_CAUSES_H_

#include <optional>
#include <string>
#include <vector>

#include "calib/registration/blur_slope.h"
#include "calib/registration/image_scale.h"
#include "thicklens/calib/diagnosis.h"
#include "thicklens/calib/focus_sweep.h"

namespace thicklens::calib {

// Causes of the dependence of the image scale on the readings.
inline constexpr char kTargetMoves[] = "the target moves as stated";
inline constexpr char kZeroIsWrong[] = "the target moves as stated, but offset_mm is wrong";
inline constexpr char kReversedReadings[] = "the readings run the other way";
inline constexpr char kLensMoves[] = "the lens or the sensor moves, not the target";
// Compared where the camera file states the lens by an objective and the target as stated fails.
inline constexpr char kObjectiveIsWrong[] = "the data of the objective are wrong";

// A possible unit of readings that were assumed to be in millimetres.
struct ReadingUnit {
  const char* name;  // "inches"
  double millimetres;
};

// Comparison of the laws for the image scale, each on the same samples. chi^2 includes the scales,
// the bench offset where it is given, and the blur ratio that the law requires.
struct ScaleCauses {
  Diagnosis diagnosis;
  std::optional<BlurSlope> blur_slope;
  // The following values belong to the best law of each kind.
  double reference_depth_mm = 0;  // depth of the target at the reference, according to the readings
  double lens_zero_mm = 0;        // reading at which a scale linear in the reading is 0
  double inverse_zero_mm = 0;     // reading at which 1/scale is 0
  double chi2_lens = 0, chi2_target = 0;  // chi^2 of the scales alone
  // The unit that explains the scales and the blur, if there is one and millimetres do not explain
  // them.
  std::optional<ReadingUnit> unit;
  std::vector<ReadingUnit> other_units;  // units that explain them as well as `unit`
  // The magnification that the blur fits, where kObjectiveIsWrong was compared.
  std::optional<double> fitting_magnification;

  // Whether readings in millimetres of a target that moves as stated explain the observations.
  bool ReadingsMayBeRight() const {
    return diagnosis.Names(kTargetMoves) || diagnosis.Names(kZeroIsWrong);
  }
};

// The magnification at which an objective of this numerical aperture, with the usual blur ratio,
// has a blur that grows by so many px of sigma per mm of the reading. From [D131] with f1/(zf - f1)
// = M and r = zf tan(asin NA): sigma = kappa M tan(asin NA)/p |z - zf|. Neither the tube lens nor
// the bench offset matters.
double MagnificationOfBlur(const model::Objective& objective, double pixel_pitch_mm,
                           double blur_px_per_mm);

// Compares the causes. The samples must follow one law, as stated or reversed (`law.kind`).
ScaleCauses CompareScaleCauses(const std::vector<ScaleSample>& samples, const FocusSweep& sweep);

// The refusal where the causes forbid any result: the lens moves, or the readings run the other
// way. If both explain the scales, the text names both and an observation that separates them.
// Otherwise returns std::nullopt.
std::optional<std::string> ReasonOfScaleCauses(const FocusSweep& sweep, const ScaleModel& law,
                                               const ScaleCauses& causes);

// A question about the unit of the readings. It is asked where the law places a frame so near that
// no image would form, or where the blur shows another unit, which the text then names. Otherwise
// it is empty: an image larger than its target is nothing unusual.
std::string UnitAdvice(const FocusSweep& sweep, const std::vector<FrameMeasurement>& frames,
                       const ScaleModel& law, const ScaleCauses& causes);

// "With readings in inches it is at about 300 mm and the blur ratio about 0.45". The text is empty
// where no unit explains what millimetres do not.
std::string UnitThatFits(const FocusSweep& sweep, const ScaleCauses& causes);

// The warning where the scale is constant although it should change according to the given bench
// offset.
std::string ConstantScaleWarning(const FocusSweep& sweep, const std::vector<ScaleSample>& samples);

}  // namespace thicklens::calib

#endif  // THICKLENS_CALIB_REGISTRATION_SCALE_CAUSES_H_
