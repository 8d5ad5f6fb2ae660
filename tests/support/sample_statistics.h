#ifndef THICKLENS_TESTS_SUPPORT_SAMPLE_STATISTICS_H_
#define THICKLENS_TESTS_SUPPORT_SAMPLE_STATISTICS_H_

#include <vector>

namespace thicklens::testing {

// The value below which a part `fraction` of the sample lies, linear between its members; NaN of
// an empty sample.
double Quantile(std::vector<double> sample, double fraction);
double Median(const std::vector<double>& sample);

double RootMeanSquare(const std::vector<double>& sample);

// Standard deviation about zero out of the median of |values|, for a sample with outliers: for a
// Gaussian of mean 0 the median of |x| is 0.6745 sigma.
double RobustSigmaAboutZero(std::vector<double> sample);

// Two-sided p-value of the exact binomial test: the probability, if each of `trials` succeeds with
// `probability` (above 0, below 1), of an outcome that is no more likely than `successes`.
double BinomialTestP(int successes, int trials, double probability);

}  // namespace thicklens::testing

#endif  // THICKLENS_TESTS_SUPPORT_SAMPLE_STATISTICS_H_
