#ifndef THICKLENS_ESTIMATOR_SRC_LANES_H_
#define THICKLENS_ESTIMATOR_SRC_LANES_H_

#include <cstddef>

namespace thicklens::estimator {

// Numbers that hot loops take together. What is computed with them becomes the vector instructions
// of the function that it is inlined into.
constexpr std::size_t kLanes = 8;
typedef float Lanes __attribute__((vector_size(kLanes * sizeof(float))));

inline __attribute__((always_inline)) void Load(const float* from, Lanes* to) {
  __builtin_memcpy(to, from, sizeof(Lanes));
}
inline __attribute__((always_inline)) void Store(const Lanes& from, float* to) {
  __builtin_memcpy(to, &from, sizeof(Lanes));
}

}  // namespace thicklens::estimator

#endif  // THICKLENS_ESTIMATOR_SRC_LANES_H_
