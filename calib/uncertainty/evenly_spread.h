#ifndef THICKLENS_CALIB_UNCERTAINTY_EVENLY_SPREAD_H_
#define THICKLENS_CALIB_UNCERTAINTY_EVENLY_SPREAD_H_

#include <cstddef>
#include <vector>

namespace thicklens::calib {

// Returns at most `most` of the indices below `count`, in order. They are every n-th index, counted
// from `kept`, which is always included (`kept` < `count`).
inline std::vector<std::size_t> EvenlySpread(std::size_t count, std::size_t kept,
                                             std::size_t most) {
  const std::size_t step = (count + most - 1) / most;
  std::vector<std::size_t> spread;
  for (std::size_t i = kept % step; i < count; i += step) spread.push_back(i);
  return spread;
}

}  // namespace thicklens::calib

#endif  // THICKLENS_CALIB_UNCERTAINTY_EVENLY_SPREAD_H_
