#ifndef THICKLENS_KERNELS_RADIANCE_STEPS_H_
#define THICKLENS_KERNELS_RADIANCE_STEPS_H_

#include <cstddef>
#include <functional>
#include <memory>
#include <vector>

#include "thicklens/kernels/picture_filter.h"

namespace thicklens::kernels {

// A linear map H between pictures of one size. Pictures are planar: one plane a channel, rows top
// to bottom. Results are set, not added to.
template <typename Real>
struct PictureMap {
  std::function<void(const Real* x, int channels, Real* y)> apply;             // y = H x
  std::function<void(const Real* y, int channels, Real* x)> apply_transposed;  // x = H^T y
};

// The same map in numbers, which a device takes: the sum of the products (down across), and at the
// pixels that have a row, that row alone. The numbers are only looked at while a RadianceSteps is
// made.
template <typename Real>
struct FilteredMap {
  struct Product {
    const PixelFilter<Real>* across = nullptr;
    const PixelFilter<Real>* down = nullptr;
  };
  std::vector<Product> products;  // none: every pixel has a row
  const PixelRuns<Real>* rows = nullptr;
};

// What all systems of one photograph have in common: sum_x W(x) |H r - I|^2, all channels alike.
template <typename Real>
struct DataTerm {
  int width_px = 0, height_px = 0, channels = 0;
  PictureMap<Real> projection;    // H
  FilteredMap<Real> filters;      // H again; only for a device
  std::vector<Real> photograph;   // I, planar
  std::vector<Real> weight;       // W, one plane
  std::vector<Real> squared_row;  // sum_j H_ij^2 of each pixel i: how little it is a mean of many
  int threads = 1;

  std::size_t pixels() const {
    return static_cast<std::size_t>(width_px) * static_cast<std::size_t>(height_px);
  }
};

// A quadratic prior: sum_p smoothness(p) |grad r(p)|^2 + pull(p) |r(p) - target(p)|^2, grad the two
// forward differences, of which those that leave the picture are 0; all channels alike.
template <typename Real>
struct QuadraticPrior {
  std::vector<Real> smoothness;  // one plane; empty: 0
  std::vector<Real> pull;        // one plane, > 0
  bool target_is_photograph = false;
  std::vector<Real> target = {};  // else; planar, as many channels as are solved for. Empty: 0
};

// strength sum_p (g + eps^2)^(1/2) + pull |r|^2, g = sum over channels and both differences of
// s^2 |dr|^2.
template <typename Real>
struct TotalVariation {
  const std::vector<Real>* slope_squared = nullptr;  // s^2, one plane
  double strength = 0, eps = 0, pull = 0;
};

struct ResidualSums {
  double squared = 0;         // |r|^2
  double preconditioned = 0;  // r . M^-1 r
  double with_former = 0;     // r . M^-1 (what r was before)
};

// The steps of conjugate gradients for (H^T W H + P) x = b [D106], P the matrix of the prior,
// b = H^T W I + pull target, M = diag(H^T W H) (about) + diag(P). The vectors stay where they are
// computed; sums are added in double (on a device without it, from sums in float over some hundred
// pixels), in an order that never changes. An object is used by one thread at a time. Order of
// calls: a prior, Start, and for each step UpdateResidual, Turn, Curvature, Advance; a prior may be
// set at any time, and counts from the next UpdateResidual on. Throws Error for what a device
// reports.
template <typename Real>
class RadianceSteps {
 public:
  virtual ~RadianceSteps() = default;

  virtual void SetPrior(const QuadraticPrior<Real>& prior) = 0;
  // Takes s^2 and the numbers in; the prior remains what it is until TouchVariation.
  virtual void SetVariation(const TotalVariation<Real>& variation) = 0;
  // The prior is from now on the quadratic that touches the total variation from above at x [D105]:
  // strength/2 g/(g(x) + eps^2)^(1/2) up to a constant.
  virtual void TouchVariation() = 0;

  // x, and all of the photograph's channels. Directions before are forgotten.
  virtual void Start(const std::vector<Real>& x) = 0;
  // The same for another photograph, one plane.
  virtual void StartFor(const std::vector<Real>& photograph, const std::vector<Real>& x) = 0;
  virtual double SquaredRightSide() = 0;  // |b|^2

  virtual ResidualSums UpdateResidual() = 0;  // r = b - (H^T W H + P) x
  virtual double Turn(double beta) = 0;       // p = M^-1 r + beta p; p . r
  virtual double Curvature() = 0;             // p . (H^T W H + P) p
  virtual void Advance(double step) = 0;      // x += step p

  virtual std::vector<Real> Radiance() = 0;  // x

  // H x and H^T y, for any number of planes up to the photograph's channels.
  virtual std::vector<Real> Project(const std::vector<Real>& x) = 0;
  virtual std::vector<Real> ProjectTransposed(const std::vector<Real>& y) = 0;
};

// In C++ on the processor: the specification. `data` is kept by reference. The result does not
// depend on the number of threads.
template <typename Real>
std::unique_ptr<RadianceSteps<Real>> NewNativeSteps(const DataTerm<Real>& data);

}  // namespace thicklens::kernels

#endif  // THICKLENS_KERNELS_RADIANCE_STEPS_H_
