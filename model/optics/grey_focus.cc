#include "thicklens/model/grey_focus.h"

namespace thicklens::model {

double GreyFocusDepthMm(const LensAberrations& aberrations, double focus_depth_mm) {
  double displacement = 0;
  for (int colour = 0; colour < 3; ++colour)
    displacement += kGreyWeights[colour] * ColourDisplacement(aberrations, focus_depth_mm, colour);
  return displacement == 0 ? focus_depth_mm : 1 / (1 / focus_depth_mm + displacement);
}

}  // namespace thicklens::model
