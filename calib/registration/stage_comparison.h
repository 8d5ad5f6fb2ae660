#ifndef THICKLENS_CALIB_REGISTRATION_STAGE_COMPARISON_H_
#define THICKLENS_CALIB_REGISTRATION_STAGE_COMPARISON_H_

#include <Eigen/Core>
#include <cstddef>
#include <string>
#include <vector>

#include "calib/registration/image_scale.h"
#include "thicklens/calib/focus_sweep.h"
#include "thicklens/calib/stage_errors.h"

namespace thicklens::calib {

// Evidence of one quantity of the frames about the readings' errors.
struct ReadingEvidence {
  std::vector<std::size_t> frames;  // indices into the sweep
  Eigen::VectorXd values;           // 1/scale, or the blur variance on the target
  Eigen::VectorXd sigmas;           // standard deviations of `values`
  // True: `values` is a parabola in the right reading (the blur on the target, whatever target and
  // lens). False: the right reading is a parabola in `values` (1/scale of a real lens).
  bool is_parabola_in_reading = false;
};

// The evidence of the measured scales.
ReadingEvidence EvidenceOfScales(const std::vector<ScaleSample>& samples);

// Standard deviation of a reading that the evidence shows of one frame, the median, in mm; infinite
// where it shows none.
double ReadingErrorOf(const ReadingEvidence& evidence, const FocusSweep& sweep);

// A pattern of the readings' errors that the evidence does not exclude.
struct ReadingPattern {
  std::string cause;         // in words
  Eigen::VectorXd error_mm;  // written minus right reading for each frame of the sweep
};

// The outcome of the comparison.
struct StageComparison {
  StageErrors errors;
  // Error of the readings of each frame of the sweep, written minus right reading, by which they
  // are to be corrected, mm; 0 without an error of the stage.
  Eigen::VectorXd error_mm;
  // Errors of the readings with each amplitude changed by twice its standard deviation, up and
  // down.
  std::vector<Eigen::VectorXd> changed_mm;
  // Patterns that the frames do not distinguish. The readings are then not to be corrected.
  std::vector<ReadingPattern> open;
  // Whether a jump at one place of the bench is among the causes, alone or among others.
  bool may_be_jump = false;
};

// The direction from which each position was approached in the order of the frames: true where the
// readings fall. Single frames against the direction of a run have wrong readings, and take that of
// their neighbours. All frames have one direction where the readings only rise or only fall.
std::vector<bool> ApproachedFalling(const Eigen::VectorXd& readings_mm);

// Compares the possible causes of the readings' errors by their likelihood [D145]: none, backlash,
// lost steps in the order of the frames, a jump at one place of the bench, a periodic error, and a
// bend that is no error of a stage. The errors of the single readings have an unknown standard
// deviation and long tails (Student), so that wrong rows decide nothing. Each parameter costs
// ln(frames), and the choice of a place or period 2 ln(number of choices). A cause is named where
// it wins by kDecisiveOdds against none and against every other; causes that win less are named
// together. Where they mean the same correction, it is taken; otherwise none is. Errors of several
// kinds are found one after the other, the largest first.
StageComparison CompareStageErrors(const ReadingEvidence& evidence, const FocusSweep& sweep);

// Whether the measured scales contradict a change of the readings that other evidence asks for: the
// scatter of the readings about a parabola in 1/scale grows, n ln(rss after/rss before) > 2. A blur
// that processing or aberrations bend may look like a periodic error of the stage. Both lists have
// the readings of each frame of the sweep in mm.
bool ScalesContradict(const std::vector<ScaleSample>& samples, const Eigen::VectorXd& before_mm,
                      const Eigen::VectorXd& after_mm);

// Difference of the costs, 2 ln(odds), that decides between two causes: odds of 20 to 1; and
// between a cause and none: odds of 150 to 1, because most stages are good.
inline constexpr double kDecisiveOdds = 6, kDecisiveAgainstNone = 10;

}  // namespace thicklens::calib

#endif  // THICKLENS_CALIB_REGISTRATION_STAGE_COMPARISON_H_
