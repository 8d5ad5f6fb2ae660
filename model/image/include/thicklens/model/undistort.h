#ifndef THICKLENS_MODEL_UNDISTORT_H_
#define THICKLENS_MODEL_UNDISTORT_H_

#include <cstddef>

#include "thicklens/base/export.h"
#include "thicklens/model/lens_distortion.h"
#include "thicklens/model/light_field.h"
#include "thicklens/model/scene.h"

namespace thicklens::model {

// How a value between pixels is found.
enum class Resampling {
  kLanczos,  // Lanczos's kernel of 8 x 8 px, for light: it keeps fine detail nearly as it is
  kNearest,  // the nearest pixel, for depths: it invents no value between two surfaces
};

// Undistorts a rectangle of an image: the pixel (x, y) of `out` is the pixel (part.x + x, part.y +
// y) of an image of the same size, camera matrix and field that a lens without distortion would
// have made. `values` are the pixels of the whole image, row by row, of the size of `distortion`,
// with `channels` (1 to 4) numbers each; `out` has room for the rectangle. A pixel that the image
// does not show gets `without_source`. Returns the number of these pixels. Throws Error unless the
// distortion is valid and the image has fewer than 32767 px along each side.
THICKLENS_EXPORT std::size_t UndistortInto(const LensDistortion& distortion, const float* values,
                                           int channels, const PixelRect& part,
                                           Resampling resampling, float without_source, float* out);

// Returns the undistorted image, in linear light. The distortion is scaled to its size. A pixel
// without a source is 0; `without_source`, if not null, gets their number. Throws Error as
// UndistortInto and LensDistortion::ScaledTo do.
THICKLENS_EXPORT LinearImage Undistorted(const LinearImage& image, const LensDistortion& distortion,
                                         std::size_t* without_source = nullptr);

// Gives each pixel of an undistorted image that has no source the value of the first pixel with one
// on its line to the principal point, so that no edge appears where the photograph ends. The
// distortion must have the size of the image.
THICKLENS_EXPORT void ContinueBeyondSource(const LensDistortion& distortion, LinearImage* image);

// Returns a large rectangle inside `within` all of whose pixels have a source, found by moving the
// border with the largest share of pixels without one inwards. Its width is 0 if there is none.
THICKLENS_EXPORT PixelRect RegionWithSource(const LensDistortion& distortion,
                                            const PixelRect& within);

}  // namespace thicklens::model

#endif  // THICKLENS_MODEL_UNDISTORT_H_
