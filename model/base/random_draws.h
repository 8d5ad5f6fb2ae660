#ifndef THICKLENS_MODEL_BASE_RANDOM_DRAWS_H_
#define THICKLENS_MODEL_BASE_RANDOM_DRAWS_H_

#include <cstdint>
#include <random>

#include "thicklens/base/export.h"

namespace thicklens {

// Seeded random draws with the same sequence under every standard library. The standard specifies
// std::mt19937_64 and std::seed_seq completely, but not the distributions of <random>.
class THICKLENS_EXPORT RandomDraws {  // the library of model uses it as well
 public:
  // Purpose of the draws. Each purpose has its own stream, so that switching one effect on or off
  // does not change the draws of the others.
  enum class Purpose : std::uint32_t {
    kTexture = 1,
    kBench = 2,
    kLamp = 3,
    kDrift = 4,
    kSensor = 5,
    kEncodedNoise = 6,
    kReadout = 7,
    kSpecks = 8,
    kBands = 9
  };

  // `item` is the index of the frame, so that a frame does not depend on the frames before it.
  RandomDraws(std::uint64_t seed, Purpose purpose, std::uint32_t item);

  double Uniform();  // in [0, 1), 53 bits
  double Normal();   // mean 0, variance 1
  // A draw of the Poisson distribution, exact at every mean. A mean <= 0 gives 0.
  double Poisson(double mean);

 private:
  std::mt19937_64 engine_;
  double spare_normal_ = 0;
  bool has_spare_ = false;
};

}  // namespace thicklens

#endif  // THICKLENS_MODEL_BASE_RANDOM_DRAWS_H_
