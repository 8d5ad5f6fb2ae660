#ifndef THICKLENS_KERNELS_RADIANCE_STEPS_H_
#define THICKLENS_KERNELS_RADIANCE_STEPS_H_

#include <cstddef>
#include <functional>
#include <memory>
#include <vector>

#include "thicklens/base/export.h"
#include "thicklens/kernels/image_filter.h"

namespace thicklens::kernels {

// A linear map H between images of one size. Images are planar: one plane per channel, rows top to
// bottom. The results are set, not added to.
template <typename Real>
struct ImageMap {
  std::function<void(const Real* x, int channels, Real* y)> apply;             // computes y = H x
  std::function<void(const Real* y, int channels, Real* x)> apply_transposed;  // computes x = H^T y
};

// The map H as numbers, for a device: the sum of the products (down across), but at the pixels that
// have a row, that row only. The pointers are not owned; they are used only during the construction
// of a RadianceSteps.
template <typename Real>
struct FilteredMap {
  // A filter along rows, followed by one along columns.
  struct Product {
    const VaryingFilter<Real>* across = nullptr;  // applied first
    const VaryingFilter<Real>* down = nullptr;    // applied to the result of `across`
  };
  std::vector<Product> products;                // none: every pixel has a row
  const PixelBlockedCsr<Real>* rows = nullptr;  // rows of single pixels
};

// The data term that all systems of one photograph share: sum_x W(x) |H r - I|^2, with the same
// weights in all channels. Where the photograph is only a lower bound of the light, the residual
// counts below it only: W(x) max(0, I - H r)^2 [D181].
template <typename Real>
struct DataTerm {
  int width_px = 0, height_px = 0, channels = 0;  // of the photograph
  ImageMap<Real> projection;                      // the map H
  FilteredMap<Real> filters;                      // H as numbers; only for a device
  std::vector<Real> photograph;                   // photograph I, planar
  std::vector<Real> weight;                       // weight W, one plane
  std::vector<Real> row_norm2;  // sum_j H_ij^2 of each pixel i: small if the pixel is a mean of
                                // many
  // Indices into `photograph` of the values that are lower bounds, ascending; empty: none. They
  // exist for the steps on the processor only.
  std::vector<std::size_t> bounds;
  int threads = 1;  // number of threads, >= 1

  // Number of pixels of one plane.
  std::size_t pixels() const {
    return static_cast<std::size_t>(width_px) * static_cast<std::size_t>(height_px);
  }
};

// A quadratic prior: sum_p gradient_weight(p) |grad r(p)|^2 + tikhonov_weight(p) |r(p) -
// target(p)|^2. The gradient grad consists of the two forward differences; differences beyond the
// image are 0. All channels have the same weights.
template <typename Real>
struct QuadraticPrior {
  std::vector<Real> gradient_weight;  // one plane; empty: 0
  std::vector<Real> tikhonov_weight;  // one plane, > 0
  bool target_is_photograph = false;  // true: `target` is the photograph
  std::vector<Real> target = {};  // used unless target_is_photograph; planar, with the number of
                                  // channels of the solution; empty: 0
};

// The total variation prior: strength sum_p (g + eps^2)^(1/2) + tikhonov_weight |r|^2, where g is
// the sum over channels and both differences of s^2 |dr|^2.
template <typename Real>
struct TotalVariation {
  const std::vector<Real>* slope_squared = nullptr;   // s^2, one plane
  double strength = 0, eps = 0, tikhonov_weight = 0;  // the constants of the prior, >= 0
};

// Sums over the residual r = b - (H^T W H + P) x, all channels together.
struct ResidualSums {
  double squared = 0;         // value of |r|^2
  double preconditioned = 0;  // value of r . M^-1 r
  double with_previous = 0;   // value of r . M^-1 (previous r)
};

// The steps of conjugate gradients for (H^T W H + P) x = b [D106], where P is the matrix of the
// prior, b = H^T W I + tikhonov_weight target, and M = diag(H^T W H) (approximately) + diag(P). The
// vectors stay where they are computed. Sums are added in double (on a device without double, from
// sums in float over some hundred pixels), in a fixed order. An object is used by one thread at a
// time. Order of calls: a prior, Start, and for each step UpdateResidual, UpdateDirection,
// ApplyNormalOperator, UpdateSolution. A prior may be set at any time and applies from the next
// UpdateResidual on. Throws Error for errors of a device.
template <typename Real>
class THICKLENS_EXPORT RadianceSteps {
 public:
  virtual ~RadianceSteps() = default;

  // Sets a quadratic prior.
  virtual void SetPrior(const QuadraticPrior<Real>& prior) = 0;
  // Stores s^2 and the numbers. The prior does not change until ReweightVariation.
  virtual void SetVariation(const TotalVariation<Real>& variation) = 0;
  // Sets the prior to the quadratic that touches the total variation from above at x [D105]:
  // strength/2 g/(g(x) + eps^2)^(1/2) up to a constant.
  virtual void ReweightVariation() = 0;

  // Sets x, for all channels of the photograph, and discards previous directions.
  virtual void Start(const std::vector<Real>& x) = 0;
  // Starts like Start, for another photograph of one plane.
  virtual void StartFor(const std::vector<Real>& photograph, const std::vector<Real>& x) = 0;
  virtual double SquaredRightSide() = 0;  // returns |b|^2

  virtual ResidualSums UpdateResidual() = 0;        // r = b - (H^T W H + P) x
  virtual double UpdateDirection(double beta) = 0;  // p = M^-1 r + beta p; returns p . r
  virtual double ApplyNormalOperator() = 0;         // returns p . (H^T W H + P) p
  // Returns the step along p to the minimum on that line, from p . r and p . (H^T W H + P) p. With
  // bounds, H^T W H has the weights of those values only that counted at x; the function along p is
  // then a parabola in pieces, whose minimum is found [D181].
  virtual double StepLength(double steepness, double curvature) { return steepness / curvature; }
  virtual void UpdateSolution(double step) = 0;  // x += step p

  virtual std::vector<Real> Radiance() = 0;  // returns x

  // Return H x and H^T y, for any number of planes up to the photograph's number of channels.
  virtual std::vector<Real> Project(const std::vector<Real>& x) = 0;
  // Returns H^T y; see Project.
  virtual std::vector<Real> ProjectTransposed(const std::vector<Real>& y) = 0;
};

// Returns the C++ implementation for the processor, which is the specification. `data` is kept by
// reference. The result does not depend on the number of threads.
template <typename Real>
THICKLENS_EXPORT std::unique_ptr<RadianceSteps<Real>> NewCpuRadianceSteps(
    const DataTerm<Real>& data);

}  // namespace thicklens::kernels

#endif  // THICKLENS_KERNELS_RADIANCE_STEPS_H_
