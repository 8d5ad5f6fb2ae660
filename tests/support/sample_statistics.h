#ifndef THICKLENS_TESTS_SUPPORT_SAMPLE_STATISTICS_H_
#define THICKLENS_TESTS_SUPPORT_SAMPLE_STATISTICS_H_

#include <vector>

namespace thicklens::testing {

// The value below which a fraction `fraction` of the sample lies, interpolated linearly between its
// members. NaN for an empty sample.
double Quantile(std::vector<double> sample, double fraction);
double Median(const std::vector<double>& sample);

double RootMeanSquare(const std::vector<double>& sample);

// Standard deviation about zero computed from the median of |values|, for a sample with outliers:
// for a Gaussian of mean 0 the median of |x| is 0.6745 sigma.
double RobustSigmaAboutZero(std::vector<double> sample);

// Two-sided p-value of the exact binomial test: the probability of an outcome that is no more
// likely than `successes`, if each of `trials` succeeds with `probability` (above 0, below 1).
double BinomialTestP(int successes, int trials, double probability);

}  // namespace thicklens::testing

#endif  // THICKLENS_TESTS_SUPPORT_SAMPLE_STATISTICS_H_
