#ifndef THICKLENS_KERNELS_PATCH_FILTER_H_
#define THICKLENS_KERNELS_PATCH_FILTER_H_

#include <vector>

namespace thicklens::kernels {

// Takes noise out of a picture by what its patches look like in few waves [L13] (sliding DCT,
// Yaroslavsky 1996; Guleryuz 2007): each patch of 8 x 8 px, wherever it lies, is expanded in
// orthonormal cosines, of which those not above `threshold` are set to 0, all but the mean; and of
// each pixel the mean over its patches is taken, weighted by 1/(cosines left), which is about the
// inverse of their noise. Three channels are taken as colours: their sum and two differences,
// orthonormal, are filtered; of other numbers each is filtered alone.
//
// Pictures are planar; `threshold` >= 0 is in their unit, and of white noise of deviation sigma
// hardly anything is left at 3 sigma. A picture narrower or lower than 8 px stays as it is. The
// result does not depend on the number of threads, and a row of it only on the 7 above and below.
template <typename Real>
std::vector<Real> FilterPatches(int width_px, int height_px, int channels,
                                const std::vector<Real>& picture, double threshold, int threads);

}  // namespace thicklens::kernels

#endif  // THICKLENS_KERNELS_PATCH_FILTER_H_
