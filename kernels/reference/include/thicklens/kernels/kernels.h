#ifndef THICKLENS_KERNELS_KERNELS_H_
#define THICKLENS_KERNELS_KERNELS_H_

#include <cstddef>
#include <cstdint>
#include <memory>
#include <vector>

#include "thicklens/kernels/sparse.h"

namespace thicklens::kernels {

// The unit impulse g of [M16] that carries a ray from where it lands to the pixels.
enum class Splat {
  kNearest,   // all of it to the nearest pixel, floor(position + 1/2)
  kBilinear,  // shared by the two nearest pixels of each axis, by distance
};

// The rays and pixels of one block of a picture, in plain numbers. One step of s or t is one pixel.
//
// A ray (s, t) of view (k, l) lands at (s + s_shift[k] + s_fraction[k],
// t + t_shift[l] + t_fraction[l]), fractions in [-1/2, 1/2): nearest to the pixel
// (s + s_shift[k], t + t_shift[l]). The rays of a block are those that land nearest to its pixels,
// and are numbered by them: ray (l * u_count + k) * pixels + y * width_px + x stands for the sample
// s = first_x + x - s_shift[k], t = first_y + y - t_shift[l], and exists if that is a sample of the
// light field. So blocks share no ray.
struct BlockGeometry {
  int first_x = 0, first_y = 0;  // the block's first pixel in the picture
  int width_px = 0, height_px = 0;
  int s_count = 0, t_count = 0;  // of the whole light field
  int u_count = 0, v_count = 0;
  std::vector<int> s_shift, t_shift;           // per u, per v
  std::vector<double> s_fraction, t_fraction;  // per u, per v
  std::vector<double> view_weight;             // v * u_count + u; >= 0

  int pixels() const { return width_px * height_px; }
  int views() const { return u_count * v_count; }
  int rays() const { return pixels() * views(); }
  bool Exists(int k, int l, int x, int y) const {
    const int s = first_x + x - s_shift[static_cast<std::size_t>(k)];
    const int t = first_y + y - t_shift[static_cast<std::size_t>(l)];
    return s >= 0 && s < s_count && t >= 0 && t < t_count;
  }
};

// Slots a pixel has in FindRays: its rays are at most these.
inline int RaySlots(const BlockGeometry& block, Splat splat) {
  return block.views() * (splat == Splat::kNearest ? 1 : 4);
}

// The computations of the estimator that a device can do. Every method is a pure function of its
// arguments. The plain C++ twin (NewReference) is the specification; a device's results differ from
// it by rounding alone. An object is used by one thread at a time; Clone gives one for another.
// Throws Error for arguments whose sizes do not fit, and for what the device reports.
template <typename Real>
class Kernels {
 public:
  virtual ~Kernels() = default;
  virtual std::unique_ptr<Kernels> Clone() const = 0;

  // H, first half: the rays that land on each pixel of the block. Slot * pixels + pixel holds a
  // ray's number or -1. Slots: view-major, and within a view for kBilinear (y, x) taps 0 and 1:
  // tap 0 is the ray nearest to the pixel, tap 1 its neighbour on the side from which a share
  // arrives (none if the fraction is 0). Rays that do not exist are left out.
  virtual std::vector<std::int32_t> FindRays(const BlockGeometry& block, Splat splat) = 0;

  // H of [M10], second half: the weight of each ray found. H0 = view weight times the share of the
  // splat; rows are divided by their sums (W = 1/(H0 1), for the samples that exist; a row of sum 0
  // stays 0) and then multiplied by `irradiance` (one number a ray of the block; empty: 1).
  virtual EllMatrix<Real> WeighRays(const BlockGeometry& block, Splat splat,
                                    const std::vector<std::int32_t>& rays,
                                    const std::vector<Real>& irradiance) = 0;

  // The derivation mask of each ray in the warp form [M18], [D111]: (D L)(i, k) = L(i + m, k + 1) -
  // L(i, k), m in samples per view step, linear interpolation between samples. Rows: first one a
  // ray for the step in u (its m in slope_u), then one a ray for the step in v. A row is empty
  // where the slope is NaN, where there is no next view, and where a tap that has weight does not
  // exist or is outside of the block. 3 slots: the ray itself (-1), the two taps.
  virtual EllMatrix<Real> WarpDifferences(const BlockGeometry& block,
                                          const std::vector<Real>& slope_u,
                                          const std::vector<Real>& slope_v) = 0;

  // The derivation mask of each ray as six explicit finite differences of the second derivative
  // [M20] along the rays of its scene point, (m d/ds + d/du)^2 and the same in t and v:
  //   (G L) = m^2 L_ss + 2 m L_su + L_uu + n^2 L_tt + 2 n L_tv + L_vv,
  // central differences with step 1, L_su by the four diagonal neighbours over 4. A neighbour that
  // does not exist or is outside of the block is replaced by the ray itself, so that a constant
  // light field has G L = 0 everywhere. Empty where slope_u or slope_v is NaN. Not symmetric where
  // the slopes differ from ray to ray. Slots: 17.
  virtual EllMatrix<Real> SixTermMasks(const BlockGeometry& block, const std::vector<Real>& slope_u,
                                       const std::vector<Real>& slope_v) = 0;

  // A x and A^T x.
  virtual std::vector<Real> Multiply(const CsrMatrix<Real>& a, const std::vector<Real>& x) = 0;
  virtual std::vector<Real> MultiplyTransposed(const CsrMatrix<Real>& a,
                                               const std::vector<Real>& x) = 0;

  // values += scale * A^T A at the entries of `pattern`, which must hold all of A^T A's.
  virtual void AddNormalProduct(const CsrMatrix<Real>& a, Real scale, const CsrPattern& pattern,
                                std::vector<Real>* values) = 0;

  // The picture of a light field, one channel: views (l * u_count + k) * t_count * s_count +
  // t * s_count + s, gathered at every pixel of the block `whole` (usually the whole picture) with
  // the weights of WeighRays without irradiance. Pixels at y * width_px + x.
  virtual std::vector<Real> FormPicture(const BlockGeometry& whole, Splat splat,
                                        const std::vector<Real>& views) = 0;

  // The whole light field that blocks are added to, kept where the device has it.
  virtual void StartWhole(int s_count, int t_count, int u_count, int v_count, int channels) = 0;
  // Adds the rays of a block (in its numbering) to channel `channel`; those that do not exist are
  // left out. The sum is kept in float.
  virtual void AddBlock(const BlockGeometry& block, int channel, const std::vector<Real>& rays) = 0;
  // ((channel * v_count + v) * u_count + u) * t_count * s_count + t * s_count + s.
  virtual std::vector<float> FinishWhole() = 0;
};

// The specification, in plain C++.
template <typename Real>
std::unique_ptr<Kernels<Real>> NewReference();

}  // namespace thicklens::kernels

#endif  // THICKLENS_KERNELS_KERNELS_H_
