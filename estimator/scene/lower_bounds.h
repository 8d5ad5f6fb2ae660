#ifndef THICKLENS_ESTIMATOR_SCENE_LOWER_BOUNDS_H_
#define THICKLENS_ESTIMATOR_SCENE_LOWER_BOUNDS_H_

#include <cstddef>
#include <cstdint>
#include <vector>

namespace thicklens::estimator {

// Which values of an image are lower bounds of the light: those of clipped highlights [D181]. One
// per value, interleaved like the image: 1, or 0 for a value that is data. Empty: all are data.
using ClippedValues = std::vector<std::uint8_t>;

// Returns the indices of the bounds in the planes of the rows [from, to), ascending.
std::vector<std::size_t> BoundsInPlanes(const ClippedValues& clipped, int width_px, int channels,
                                        int from, int to);

// Returns those of the image at half its size (HalfSize): the mean of four values is a lower bound
// if one of them is.
ClippedValues HalfSize(const ClippedValues& clipped, int width_px, int height_px, int channels);

ClippedValues CutRows(const ClippedValues& clipped, int width_px, int channels, int from, int to);

// Returns for each pixel whether one of its channels is a lower bound.
ClippedValues InAnyChannel(const ClippedValues& clipped, int channels);

}  // namespace thicklens::estimator

#endif  // THICKLENS_ESTIMATOR_SCENE_LOWER_BOUNDS_H_
