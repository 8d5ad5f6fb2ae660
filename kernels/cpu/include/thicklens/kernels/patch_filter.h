#ifndef THICKLENS_KERNELS_PATCH_FILTER_H_
#define THICKLENS_KERNELS_PATCH_FILTER_H_

#include <vector>

#include "thicklens/base/export.h"

namespace thicklens::kernels {

// Removes noise from an image under the assumption that its patches are sums of few cosines [L13]
// (sliding DCT, Yaroslavsky 1996; Guleryuz 2007). Each patch of 8 x 8 px, at every position, is
// expanded in orthonormal cosines. All coefficients except the mean are set to 0 where they are not
// above `threshold` in magnitude. Each pixel becomes the mean over its patches, weighted by
// 1/(coefficients left), which is about the inverse of their noise. Three channels are treated as
// colours: their sum and two differences, orthonormal, are filtered. With any other number, each
// channel is filtered separately.
//
// Images are planar. `threshold` >= 0 is in their unit; at 3 sigma nearly all white noise of
// standard deviation sigma is removed. An image narrower or lower than 8 px is returned unchanged.
// The result does not depend on the number of threads, and a row of it depends only on the 7 rows
// above and below.
template <typename Real>
THICKLENS_EXPORT std::vector<Real> FilterPatches(int width_px, int height_px, int channels,
                                                 const std::vector<Real>& image, double threshold,
                                                 int threads);

}  // namespace thicklens::kernels

#endif  // THICKLENS_KERNELS_PATCH_FILTER_H_
