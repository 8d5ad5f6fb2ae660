#ifndef THICKLENS_MODEL_SIMULATE_SWEEP_EDGE_SPREAD_H_
#define THICKLENS_MODEL_SIMULATE_SWEEP_EDGE_SPREAD_H_

#include <vector>

#include "thicklens/model/pupil_law.h"

namespace thicklens::model {

// Edge spread: the profile across a straight step from 0 to 1 behind a Gaussian, a uniform disc and
// the pixel box, as a function of the signed distance from the edge along its normal.
//
// The projection of the pixel box on the normal is a trapezoid: the convolution of two boxes of the
// widths a = |cos(angle)| and b = |sin(angle)|. The edge spread is therefore a second difference of
// the second antiderivative F of the step behind the other blurs (derived here, [D32]):
//   E(d) = [F(d + (a+b)/2) - F(d + (a-b)/2) - F(d - (a-b)/2) + F(d - (a+b)/2)]/(a b).
// F has a closed form for a Gaussian alone and for a disc alone, but not for both together. In that
// case E is the Fourier series of a periodic edge, tabulated and read by cubic interpolation. The
// error is below 1e-8 for angles with b above 1e-5, and 1e-6 at the kinks of an edge that only the
// pixel blurs. With a disc, a Gaussian below 0.004 px other than 0 causes an error up to 2e-5.
class EdgeSpread {
 public:
  // `angle_rad` is the angle of the normal from the pixel grid's x axis. Without the pixel box, E
  // is the blurred step itself; without any blur it is 1/2 on the edge.
  EdgeSpread(double angle_rad, double gaussian_sigma_px, double disc_radius_px,
             bool pixel_box = true);
  // Constructs the edge spread of a Gaussian and a defocus blur of the profile's shape, tabulated.
  // The profile is not owned. The light of a disc without a Gaussian is a sum of rings, each with
  // its F in closed form; the error is below 1e-5.
  EdgeSpread(double angle_rad, double gaussian_sigma_px, const PupilProfile& profile,
             double defocus_sigma_px, bool pixel_box);

  double At(double distance_px) const;
  // Distance beyond which E is 0 or 1 to rounding.
  double reach_px() const { return reach_px_; }

 private:
  double SecondAntiderivative(double x) const;
  double BlurredStep(double x) const;
  void SetBoxes(double angle_rad);
  double DefocusTransferAt(double fx, double fy) const;
  void Tabulate(double angle_rad);

  double sigma_px_;
  double radius_px_ = 0;
  const PupilProfile* profile_ = nullptr;
  double defocus_sigma_px_ = 0;
  bool pixel_box_;
  double wide_box_px_ = 1;
  double narrow_box_px_ = 0;
  double reach_px_ = 0;
  double table_step_px_ = 0;
  std::vector<double> table_;  // E from -reach - 2 steps on; empty where F has a closed form
};

}  // namespace thicklens::model

#endif  // THICKLENS_MODEL_SIMULATE_SWEEP_EDGE_SPREAD_H_
