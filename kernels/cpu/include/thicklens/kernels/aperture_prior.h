#ifndef THICKLENS_KERNELS_APERTURE_PRIOR_H_
#define THICKLENS_KERNELS_APERTURE_PRIOR_H_

#include <cstddef>
#include <vector>

#include "thicklens/base/export.h"

namespace thicklens::kernels {

// A = gamma D^T D + mu over the U x V aperture samples of one scene point. D takes the differences
// of neighbouring samples across and down, with free ends. The eigenvectors of A are those of the
// discrete cosine transform (DCT-II), with the eigenvalues
//   gamma (4 sin^2(pi i/(2 U)) + 4 sin^2(pi j/(2 V))) + mu;
// derived here [D116]: a difference with free ends is one of a sequence that is mirrored at its
// ends.
template <typename Real>
class THICKLENS_EXPORT AperturePrior {
 public:
  // gamma >= 0, mu > 0. Throws Error for more than 64 samples along an axis.
  AperturePrior(int u_count, int v_count, double gamma, double mu);

  // Number of points processed together: counts and strides of planes are multiples of it.
  static constexpr std::size_t kPacket = 16;

  // Sets x = A^-1 x for every point of planes (row by row of the aperture) that are `stride`
  // numbers apart. The bits of the result do not depend on the number of threads.
  void ApplyInverse(std::size_t points, std::size_t stride, int threads, Real* planes);

 private:
  int u_count_, v_count_;
  std::vector<Real> across_, down_;        // transforms
  std::vector<Real> inverse_eigenvalues_;  // V x U
  std::vector<Real> work_;
};

}  // namespace thicklens::kernels

#endif  // THICKLENS_KERNELS_APERTURE_PRIOR_H_
