#ifndef THICKLENS_KERNELS_KERNELS_H_
#define THICKLENS_KERNELS_KERNELS_H_

#include <cstddef>
#include <cstdint>
#include <memory>
#include <vector>

#include "thicklens/base/export.h"
#include "thicklens/kernels/sparse.h"
#include "thicklens/kernels/splat.h"

namespace thicklens::kernels {

// The rays and pixels of one block of an image, as plain numbers. One step of s or t is one pixel.
//
// A ray (s, t) of view (k, l) lands at (s + s_shift[k] + s_fraction[k], t + t_shift[l] +
// t_fraction[l]), with fractions in [-1/2, 1/2). The nearest pixel is (s + s_shift[k], t +
// t_shift[l]). The rays of a block are those that land nearest to its pixels, and their numbers
// follow the pixels: ray (l * u_count + k) * pixels + y * width_px + x is the sample s = first_x +
// x - s_shift[k], t = first_y + y - t_shift[l]. It exists if that is a sample of the light field.
// Blocks therefore share no ray.
struct BlockGeometry {
  int first_x = 0, first_y = 0;                // first pixel of the block in the image
  int width_px = 0, height_px = 0;             // size of the block, px
  int s_count = 0, t_count = 0;                // sizes of the whole light field
  int u_count = 0, v_count = 0;                // numbers of views
  std::vector<int> s_shift, t_shift;           // per u, per v
  std::vector<double> s_fraction, t_fraction;  // per u, per v
  std::vector<double> view_weight;             // at v * u_count + u; >= 0

  // Number of pixels of the block.
  int pixels() const { return width_px * height_px; }
  // Number of views, U V.
  int views() const { return u_count * v_count; }
  // Number of rays of the block, with those that do not exist.
  int rays() const { return pixels() * views(); }
  // Returns whether the ray of view (k, l) that lands nearest to pixel (x, y) of the block is a
  // sample of the light field.
  bool Exists(int k, int l, int x, int y) const {
    const int s = first_x + x - s_shift[static_cast<std::size_t>(k)];
    const int t = first_y + y - t_shift[static_cast<std::size_t>(l)];
    return s >= 0 && s < s_count && t >= 0 && t < t_count;
  }
};

// Number of slots of a pixel in FindRays, an upper bound of its rays.
inline int RaySlots(const BlockGeometry& block, Splat splat) {
  return block.views() * (splat == Splat::kNearest ? 1 : 4);
}

// The computations of the estimator that a device can do. FindRays to FormImage are pure
// functions of their arguments; StartWhole, AddBlock and FinishWhole accumulate a light field. The
// plain C++ reference (NewReference) is the specification; the results of a device differ from it
// only by rounding. An object is used by one thread at a time; Clone makes one for another thread.
// Throws Error for arguments whose sizes do not fit, and for errors of the device.
template <typename Real>
class THICKLENS_EXPORT Kernels {
 public:
  virtual ~Kernels() = default;
  // Makes an object on the same device for another thread.
  virtual std::unique_ptr<Kernels> Clone() const = 0;

  // First half of H: the rays that land on each pixel of the block. Element slot * pixels + pixel
  // is a ray's number or -1. The slots are view-major. Within a view, kBilinear has the (y, x) taps
  // 0 and 1: tap 0 is the ray nearest to the pixel, and tap 1 is its neighbour on the side from
  // which a share arrives (none if the fraction is 0). Rays that do not exist are left out.
  virtual std::vector<std::int32_t> FindRays(const BlockGeometry& block, Splat splat) = 0;

  // Second half of H of [M10]: the weight of each ray found. H0 is the view weight times the share
  // of the splat. Rows are divided by their sums (W = 1/(H0 1), for the samples that exist; a row
  // of sum 0 remains 0) and then multiplied by `irradiance` (one number per ray of the block;
  // empty: 1).
  virtual EllMatrix<Real> WeightRays(const BlockGeometry& block, Splat splat,
                                     const std::vector<std::int32_t>& rays,
                                     const std::vector<Real>& irradiance) = 0;

  // The derivation mask of each ray in the warp form [M18], [D111]: (D L)(i, k) = L(i + m, k + 1) -
  // L(i, k), with m in samples per view step and linear interpolation between samples. There are
  // two rows per ray: first those of all rays for the step in u (m is slope_u), then those for the
  // step in v. A row is empty if the slope is NaN, if there is no next view, or if a tap with a
  // weight does not exist or is outside of the block. There are 3 slots: the ray itself (-1) and
  // the two taps.
  virtual EllMatrix<Real> WarpDifferences(const BlockGeometry& block,
                                          const std::vector<Real>& slope_u,
                                          const std::vector<Real>& slope_v) = 0;

  // The derivation mask of each ray as six explicit finite differences of the second derivative
  // [M20] along the rays of its scene point, (m d/ds + d/du)^2 and the same in t and v:
  //   (G L) = m^2 L_ss + 2 m L_su + L_uu + n^2 L_tt + 2 n L_tv + L_vv.
  // The differences are central with step 1; L_su uses the four diagonal neighbours over 4. A
  // neighbour that does not exist or is outside of the block is replaced by the ray itself, so that
  // a constant light field has G L = 0 everywhere. A row is empty if slope_u or slope_v is NaN. The
  // matrix is not symmetric where the slopes differ from ray to ray. It has 17 slots.
  virtual EllMatrix<Real> SixTermMasks(const BlockGeometry& block, const std::vector<Real>& slope_u,
                                       const std::vector<Real>& slope_v) = 0;

  // Return A x and A^T x.
  virtual std::vector<Real> Multiply(const CsrMatrix<Real>& a, const std::vector<Real>& x) = 0;
  // Returns A^T x.
  virtual std::vector<Real> MultiplyTransposed(const CsrMatrix<Real>& a,
                                               const std::vector<Real>& x) = 0;

  // Adds scale * A^T A to `values` at the entries of `pattern`, which must include all entries of
  // A^T A.
  virtual void AddNormalProduct(const CsrMatrix<Real>& a, Real scale, const CsrPattern& pattern,
                                std::vector<Real>* values) = 0;

  // Returns the image of a light field of one channel. `views` has sample (s, t) of view (k, l) at
  // (l * u_count + k) * t_count * s_count + t * s_count + s. Every pixel of the block `whole`
  // (usually the whole image) is the sum with the weights of WeightRays without irradiance. The
  // pixels are at y * width_px + x.
  virtual std::vector<Real> FormImage(const BlockGeometry& whole, Splat splat,
                                      const std::vector<Real>& views) = 0;

  // Starts a whole light field to which blocks are added; it is kept in the memory of the device.
  virtual void StartWhole(int s_count, int t_count, int u_count, int v_count, int channels) = 0;
  // Adds the rays of a block (in its numbering) to channel `channel`; rays that do not exist are
  // left out. The sum is kept in float.
  virtual void AddBlock(const BlockGeometry& block, int channel, const std::vector<Real>& rays) = 0;
  // Returns the light field, with samples at ((channel * v_count + v) * u_count + u) * t_count *
  // s_count + t * s_count + s.
  virtual std::vector<float> FinishWhole() = 0;
};

// Returns the specification in plain C++.
template <typename Real>
THICKLENS_EXPORT std::unique_ptr<Kernels<Real>> NewReference();

}  // namespace thicklens::kernels

#endif  // THICKLENS_KERNELS_KERNELS_H_
