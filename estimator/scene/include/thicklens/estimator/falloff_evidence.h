#ifndef THICKLENS_ESTIMATOR_FALLOFF_EVIDENCE_H_
#define THICKLENS_ESTIMATOR_FALLOFF_EVIDENCE_H_

#include <string>

#include "thicklens/base/export.h"
#include "thicklens/estimator/estimate_input.h"

namespace thicklens::estimator {

// Whether a photograph shows the irradiance fall-off [S12] that its camera predicts, or was already
// corrected for it, as phones and raw converters do.
//
// The logarithm of the light, averaged over blocks, is fitted by a constant plus `share` times the
// logarithm of the predicted fall-off [D183]. The scene is itself brighter here and darker there:
// its logarithm is taken as a random field whose power falls with frequency as a power law, whose
// exponent and size follow from the finer structure of the photograph. The error of the share is
// that of this field at the low frequencies of the fall-off.
struct FalloffEvidence {
  // Meaning of the share.
  enum class Verdict {
    kShown,      // it is consistent with 1 and far from 0
    kNotShown,   // it is consistent with 0 and far from 1: the photograph was corrected
    kUndecided,  // the scene's own brightness hides it, or neither agrees
  };
  Verdict verdict = Verdict::kUndecided;  // what the share says
  std::string message = "not run";        // how it ended, one line
  double share = 0, sigma = 0;            // measured share, and its standard deviation
  double darkest = 1;  // smallest value of the predicted fall-off, 1 at the principal point
  int blocks = 0;      // number of blocks that were used
  // Exponent of the scene's power spectrum that fits best: 2 for most photographs.
  double exponent = 0;
  double seconds = 0;  // time of the test
};

// Tests it. The input has a camera. Throws Error for inputs that do not fit. The result does not
// depend on the number of threads (0: one per core).
THICKLENS_EXPORT FalloffEvidence TestFalloff(const EstimateInput& input, int threads);

// Returns "shown", "not shown" or "undecided".
THICKLENS_EXPORT std::string FalloffVerdictName(FalloffEvidence::Verdict verdict);

}  // namespace thicklens::estimator

#endif  // THICKLENS_ESTIMATOR_FALLOFF_EVIDENCE_H_
