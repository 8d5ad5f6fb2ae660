#include "model/base/random_draws.h"

#include <cmath>

namespace thicklens {
namespace {

std::mt19937_64 SeededEngine(std::uint64_t seed, RandomDraws::Purpose purpose, std::uint32_t item) {
  std::seed_seq sequence{static_cast<std::uint32_t>(seed), static_cast<std::uint32_t>(seed >> 32),
                         static_cast<std::uint32_t>(purpose), item};
  return std::mt19937_64(sequence);
}

// ln(k!) for an integer k >= 0. From 10 on it is Stirling's series, whose first omitted term is
// below 1e-10 there. std::lgamma is not used, because it writes a global variable and so is not
// thread-safe.
double LogFactorial(double k) {
  static constexpr double kTable[10] = {0,
                                        0,
                                        0.693147180559945309,
                                        1.791759469228055001,
                                        3.178053830347945620,
                                        4.787491742782045994,
                                        6.579251212010100995,
                                        8.525161361065414300,
                                        10.60460290274525023,
                                        12.80182748008146961};
  if (k < 10) return kTable[static_cast<int>(k)];
  constexpr double kHalfLogTwoPi = 0.918938533204672742;
  const double inverse = 1 / k;
  const double square = inverse * inverse;
  return (k + 0.5) * std::log(k) - k + kHalfLogTwoPi +
         inverse * (1.0 / 12 - square * (1.0 / 360 - square * (1.0 / 1260 - square / 1680)));
}

}  // namespace

RandomDraws::RandomDraws(std::uint64_t seed, Purpose purpose, std::uint32_t item)
    : engine_(SeededEngine(seed, purpose, item)) {}

double RandomDraws::Uniform() { return static_cast<double>(engine_() >> 11) * 0x1p-53; }

// Marsaglia's polar method [L5] gives two independent normal numbers from a point that is uniform
// in the unit disc.
double RandomDraws::Normal() {
  if (has_spare_) {
    has_spare_ = false;
    return spare_normal_;
  }
  double x, y, square;
  do {
    x = 2 * Uniform() - 1;
    y = 2 * Uniform() - 1;
    square = x * x + y * y;
  } while (!(square < 1) || square == 0);
  const double scale = std::sqrt(-2 * std::log(square) / square);
  spare_normal_ = scale * y;
  has_spare_ = true;
  return scale * x;
}

double RandomDraws::Poisson(double mean) {
  if (!(mean > 0)) return 0;
  if (mean < 10) {
    // Waiting times: the draw is the largest number of uniform factors whose product still exceeds
    // exp(-mean).
    const double limit = std::exp(-mean);
    double count = 0;
    double product = Uniform();
    while (product > limit) {
      ++count;
      product *= Uniform();
    }
    return count;
  }
  // Transformed rejection with squeeze, the algorithm PTRS of W. Hoermann, "The transformed
  // rejection method for generating Poisson random variables" (1993), valid for mean >= 10.
  const double b = 0.931 + 2.53 * std::sqrt(mean);
  const double a = -0.059 + 0.02483 * b;
  const double inverse_alpha = 1.1239 + 1.1328 / (b - 3.4);
  const double v_r = 0.9277 - 3.6224 / (b - 2);
  for (;;) {
    const double u = Uniform() - 0.5;
    const double v = Uniform();
    const double us = 0.5 - std::abs(u);
    const double k = std::floor((2 * a / us + b) * u + mean + 0.43);
    if (us >= 0.07 && v <= v_r) return k;
    if (k < 0 || (us < 0.013 && v > us)) continue;
    if (std::log(v * inverse_alpha / (a / (us * us) + b)) <=
        k * std::log(mean) - mean - LogFactorial(k)) {
      return k;
    }
  }
}

}  // namespace thicklens
