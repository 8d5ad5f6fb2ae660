#include "calib/registration/radial_distortion.h"

#include <algorithm>
#include <cmath>

#include "thicklens/base/statistics.h"

namespace thicklens::calib {
namespace {

constexpr std::size_t kMinSamples = 5;
constexpr int kBlocks = 8;  // blocks of the jackknife
constexpr int kRounds = 20;
constexpr double kDefined = 16;     // sum of squares of the responses over that of their errors
constexpr double kCauchyWidth = 2;  // in standard deviations

using Term = ProportionalTerm;

double Distance(const Term& term, double k) {
  return (term.value - k * term.response) / term.sigma;
}

// k and its standard deviation, from robust weights; std::nullopt where no term determines it.
std::optional<model::Estimate> Solve(const std::vector<Term>& terms) {
  // The start is the median over the frames, each with the weight of its information.
  std::vector<std::pair<double, double>> slopes;
  double total = 0;
  for (const Term& t : terms) {
    if (t.response == 0) continue;
    const double weight = std::abs(t.response) / t.sigma;
    slopes.emplace_back(t.value / t.response, weight);
    total += weight;
  }
  if (slopes.empty()) return std::nullopt;
  std::sort(slopes.begin(), slopes.end());
  double k = slopes.back().first, sum = 0;
  for (const auto& [slope, weight] : slopes) {
    sum += weight;
    if (!(sum >= total / 2)) continue;
    k = slope;
    break;
  }
  double spread = 1, information = 0;
  for (int round = 0; round < kRounds; ++round) {
    std::vector<double> distances;
    for (const Term& t : terms) distances.push_back(std::abs(Distance(t, k)));
    spread = std::max(1.0, 1.4826 * Median(distances));
    double right = 0;
    information = 0;
    for (const Term& t : terms) {
      const double d = Distance(t, k) / (kCauchyWidth * spread);
      const double weight = 1 / (1 + d * d) / (t.sigma * t.sigma);
      right += weight * t.response * t.value;
      information += weight * t.response * t.response;
    }
    if (!(information > 0)) return std::nullopt;
    k = right / information;
  }
  return model::Estimate{k, spread / std::sqrt(information)};
}

// Frames of nearly equal scale share the errors of the reference. Each run of them is left out
// once.
double JackknifeSigma(std::vector<Term> terms) {
  std::sort(terms.begin(), terms.end(),
            [](const Term& a, const Term& b) { return a.response < b.response; });
  const auto n = static_cast<int>(terms.size());
  const int blocks = std::min(kBlocks, n);
  std::vector<double> values;
  for (int block = 0; block < blocks; ++block) {
    std::vector<Term> rest;
    for (int i = 0; i < n; ++i) {
      if (i * blocks / n != block) rest.push_back(terms[static_cast<std::size_t>(i)]);
    }
    if (const auto without = Solve(rest)) values.push_back(without->value);
  }
  double mean = 0, sum = 0;
  const auto count = static_cast<double>(values.size());
  for (const double value : values) mean += value / count;
  for (const double value : values) sum += (value - mean) * (value - mean);
  return count > 1 ? std::sqrt((count - 1) / count * sum) : 0;
}

}  // namespace

double CubicPerDistortion(double scale) { return 1 - 1 / (scale * scale); }

std::optional<model::Estimate> FitProportion(const std::vector<ProportionalTerm>& terms) {
  if (terms.size() < kMinSamples) return std::nullopt;
  auto result = Solve(terms);
  if (result) result->sigma = std::max(result->sigma, JackknifeSigma(terms));
  return result;
}

bool ExceedErrors(const std::vector<model::Estimate>& responses) {
  double squares = 0, errors = 0;
  for (const model::Estimate& response : responses) {
    squares += response.value * response.value;
    errors += response.sigma * response.sigma;
  }
  return squares > kDefined * errors;
}

std::optional<model::Estimate> FitRadialDistortion(const std::vector<ScaleSample>& samples) {
  std::vector<Term> terms;
  for (const ScaleSample& s : samples) {
    const double response = CubicPerDistortion(s.scale);
    if (s.registration.cubic_sigma > 0 && response != 0)
      terms.push_back({response, s.registration.cubic, s.registration.cubic_sigma});
  }
  // Where the scales differ by no more than their own errors, the response consists of these
  // errors.
  std::vector<model::Estimate> responses;
  for (const ScaleSample& s : samples) {
    responses.push_back(
        {CubicPerDistortion(s.scale), 2 * s.registration.scale_sigma / std::pow(s.scale, 3)});
  }
  if (!ExceedErrors(responses)) return std::nullopt;
  return FitProportion(terms);
}

}  // namespace thicklens::calib
