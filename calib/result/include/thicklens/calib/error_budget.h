#ifndef THICKLENS_CALIB_ERROR_BUDGET_H_
#define THICKLENS_CALIB_ERROR_BUDGET_H_

#include <string>
#include <vector>

#include "thicklens/base/export.h"
#include "thicklens/calib/calibration.h"

namespace thicklens::calib {

// Name of the statistical term that frames and readings cause.
inline constexpr char kNoiseTerm[] = "noise and readings";
// Name of the statistical term that the error of the bench offset causes.
inline constexpr char kOffsetTerm[] = "bench offset";

// One source of the error of the results: a statistical one, or a systematic part.
struct ErrorTerm {
  std::string name;             // kNoiseTerm, kOffsetTerm or the name of the SystematicPart
  bool is_statistical = false;  // false: a systematic part
  // Half of the width of the interval that the term alone causes: 1.96 standard deviations of a
  // statistical term.
  double focus_depth_mm = 0;     // of zf, mm
  double image_distance_mm = 0;  // of d1, mm
  double blur_ratio = 0;         // of kappa
  // [D164] What these errors do to the defocus that the results predict at the outer frames of the
  // sweep, as a part of it. By this number the terms are compared.
  double effect = 0;
  std::string remedy;  // action that makes the term smaller, or "no remedy: ..."
};

// Returns the terms of the error of zf, d1 and kappa, the largest effect first. It is empty where
// neither the plane of focus nor the blur ratio was found.
THICKLENS_EXPORT std::vector<ErrorTerm> ErrorTerms(const Calibration& calibration);

// Whether nothing at the bench makes a term smaller.
THICKLENS_EXPORT bool HasNoRemedy(const ErrorTerm& term);

// Returns the name of a term as a sentence has it: "the blur floor", "noise and readings",
// "lens.front_focal_length_mm".
THICKLENS_EXPORT std::string TermInWords(const std::string& name);

// Returns the largest term and its remedy in one sentence; empty if there is no error.
THICKLENS_EXPORT std::string LargestErrorInWords(const std::vector<ErrorTerm>& terms);

// Returns half of the width of the interval of a result that holds the truth in 95 % of the cases:
// the longer side of the systematic interval, and 1.96 standard deviations.
THICKLENS_EXPORT double HalfWidth(const Result& result);

// Sets the numbers of frames that are used, rejected and left out. A frame that is in no fit and
// that no check rejected gets a reason.
THICKLENS_EXPORT void CountFrames(Calibration* calibration);

}  // namespace thicklens::calib

#endif  // THICKLENS_CALIB_ERROR_BUDGET_H_
