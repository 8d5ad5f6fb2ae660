#ifndef THICKLENS_CALIB_RESPONSE_RESPONSE_SUMS_H_
#define THICKLENS_CALIB_RESPONSE_RESPONSE_SUMS_H_

#include <cstddef>
#include <map>
#include <optional>
#include <utility>

#include "thicklens/model/camera.h"

namespace thicklens::calib {

// The sums of a weighted regression through the origin, numerator sum w x y and denominator
// sum w x^2, kept apart by the part of the field and by the frame. The value is their ratio.
class ResponseSums {
 public:
  void Add(int part, std::size_t frame, double product, double square);

  // The slope. Its sigma combines a jackknife over the parts with the scatter of the frames: errors
  // of a part of the texture are common to all frames, those of a frame to all parts. Nothing for
  // fewer than 4 parts or 3 frames.
  std::optional<model::Estimate> Slope() const;

 private:
  using Sums = std::pair<double, double>;  // of products and of squares
  std::map<int, Sums> parts_;
  std::map<std::size_t, Sums> frames_;
};

}  // namespace thicklens::calib

#endif  // THICKLENS_CALIB_RESPONSE_RESPONSE_SUMS_H_
