#include "support/sample_statistics.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>

namespace thicklens::testing {

double Quantile(std::vector<double> sample, double fraction) {
  if (sample.empty()) return std::numeric_limits<double>::quiet_NaN();
  std::sort(sample.begin(), sample.end());
  const double place = fraction * static_cast<double>(sample.size() - 1);
  const auto below = static_cast<std::size_t>(place);
  const std::size_t above = std::min(below + 1, sample.size() - 1);
  return sample[below] + (place - static_cast<double>(below)) * (sample[above] - sample[below]);
}

double Median(const std::vector<double>& sample) { return Quantile(sample, 0.5); }

double RootMeanSquare(const std::vector<double>& sample) {
  double sum = 0;
  for (const double value : sample) sum += value * value;
  return std::sqrt(sum / static_cast<double>(sample.size()));
}

double RobustSigmaAboutZero(std::vector<double> sample) {
  for (double& value : sample) value = std::abs(value);
  return 1.4826 * Median(sample);
}

double BinomialTestP(int successes, int trials, double probability) {
  const auto log_likelihood = [&](int k) {
    return std::lgamma(trials + 1.0) - std::lgamma(k + 1.0) - std::lgamma(trials - k + 1.0) +
           k * std::log(probability) + (trials - k) * std::log1p(-probability);
  };
  // Equally likely outcomes may differ by rounding.
  const double limit = log_likelihood(successes) + 1e-7;
  double p = 0;
  for (int k = 0; k <= trials; ++k) {
    if (log_likelihood(k) <= limit) p += std::exp(log_likelihood(k));
  }
  return std::min(p, 1.0);
}

}  // namespace thicklens::testing
