#ifndef THICKLENS_KERNELS_SPLAT_H_
#define THICKLENS_KERNELS_SPLAT_H_

namespace thicklens::kernels {

// The unit impulse g of [M16] that distributes a ray from its landing point to the pixels.
enum class Splat {
  kNearest,   // all of it to the nearest pixel, floor(position + 1/2)
  kBilinear,  // shared by the two nearest pixels of each axis, by distance
};

}  // namespace thicklens::kernels

#endif  // THICKLENS_KERNELS_SPLAT_H_
