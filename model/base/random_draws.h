#ifndef THICKLENS_MODEL_BASE_RANDOM_DRAWS_H_
#define THICKLENS_MODEL_BASE_RANDOM_DRAWS_H_

#include <cstdint>
#include <random>

namespace thicklens {

// Seeded draws whose sequence is the same with every standard library: the distributions of
// <random> are left to the implementation, std::mt19937_64 and std::seed_seq are not.
class RandomDraws {
 public:
  // What the draws are for. Each purpose has a stream of its own, so that switching one effect on
  // or off leaves the others' draws as they were.
  enum class Purpose : std::uint32_t {
    kTexture = 1,
    kBench = 2,
    kLamp = 3,
    kDrift = 4,
    kSensor = 5,
    kStoredNoise = 6,
    kReadout = 7
  };

  // `item` is the frame's index, so that a frame does not depend on which were drawn before.
  RandomDraws(std::uint64_t seed, Purpose purpose, std::uint32_t item);

  double Uniform();  // in [0, 1), 53 bits
  double Normal();   // mean 0, variance 1
  // Poisson distributed, exact at every mean. A mean <= 0 gives 0.
  double Poisson(double mean);

 private:
  std::mt19937_64 engine_;
  double spare_normal_ = 0;
  bool has_spare_ = false;
};

}  // namespace thicklens

#endif  // THICKLENS_MODEL_BASE_RANDOM_DRAWS_H_
