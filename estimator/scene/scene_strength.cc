#include "estimator/scene/scene_strength.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <map>
#include <numeric>
#include <random>

namespace thicklens::estimator {
namespace {

constexpr unsigned kProbeSeed = 1;
constexpr double kProbeTolerance = 1e-2;  // its error is far below that of one probe
// This factor counters too weak a prior, to which plain cross-validation (a factor of 1) is prone:
// Kim and Gu 2004.
constexpr double kTraceFactor = 1.4;
constexpr int kFarthestStep = 6;  // in factors of 2 from the start

template <typename Real>
std::vector<Real> Probe(std::size_t count) {
  std::mt19937 engine(kProbeSeed);
  std::vector<Real> probe(count);
  for (Real& value : probe) value = (engine() & 1U) != 0 ? Real(1) : Real(-1);
  return probe;
}

}  // namespace

double ValidationScore(double misfit, double trace) {
  const double left = 1 - kTraceFactor * trace;
  return left > 0 ? misfit / (left * left) : std::numeric_limits<double>::infinity();
}

template <typename Real>
std::vector<Real> ProbedTrace(const DataTerm<Real>& data, const RadianceLimits& limits,
                              SceneSystem<Real>* system, int* iterations) {
  const std::vector<Real> probe = Probe<Real>(data.pixels());
  CgLimits cg;
  cg.tolerance = kProbeTolerance;
  cg.max_iterations = limits.max_iterations;
  cg.on_iteration = limits.on_iteration;
  std::vector<Real> answer, shown(data.pixels());
  *iterations += system->SolveWhitened(probe, cg, &answer).iterations;
  data.projection.apply(answer.data(), 1, shown.data());
  for (std::size_t i = 0; i < probe.size(); ++i) {
    shown[i] *= probe[i] * std::sqrt(data.weight[i]);
  }
  return shown;
}

template <typename Real>
double CrossValidation(const DataTerm<Real>& data, const std::vector<Real>& radiance,
                       const RadianceLimits& limits, SceneSystem<Real>* system, int* iterations) {
  const std::vector<Real> of_pixels = ProbedTrace(data, limits, system, iterations);
  const double trace = std::accumulate(of_pixels.begin(), of_pixels.end(), 0.0);
  return ValidationScore(system->DataMisfit(radiance) / static_cast<double>(radiance.size()),
                         trace / static_cast<double>(data.pixels()));
}

template <typename Real>
StrengthSearch SearchStrength(Prior prior, double start, const DataTerm<Real>& data,
                              const std::vector<Real>& slope_squared, const RadianceLimits& limits,
                              SceneSystem<Real>* system, std::vector<Real>* radiance) {
  StrengthSearch search;
  std::map<int, double> scores;
  const auto score = [&](int step) {
    const auto known = scores.find(step);
    if (known != scores.end()) return known->second;
    search.iterations +=
        SolveRadiance(prior, start * std::exp2(step), data, slope_squared, limits, system, radiance)
            .iterations;
    return scores[step] = CrossValidation(data, *radiance, limits, system, &search.iterations);
  };
  int best = 0;
  const int way = score(1) < score(0) ? 1 : -1;
  while (std::abs(best) < kFarthestStep && score(best + way) < score(best)) best += way;
  const double below = score(best - 1);
  const double above = score(best + 1);
  // The vertex of the parabola through three points of which the middle one is the lowest.
  const double bend = below - 2 * score(best) + above;
  const double offset =
      bend > 0 && std::isfinite(bend) ? std::clamp(0.5 * (below - above) / bend, -1.0, 1.0) : 0;
  search.strength = start * std::exp2(best + offset);
  return search;
}

template std::vector<float> ProbedTrace(const DataTerm<float>&, const RadianceLimits&,
                                        SceneSystem<float>*, int*);
template std::vector<double> ProbedTrace(const DataTerm<double>&, const RadianceLimits&,
                                         SceneSystem<double>*, int*);
template double CrossValidation(const DataTerm<float>&, const std::vector<float>&,
                                const RadianceLimits&, SceneSystem<float>*, int*);
template double CrossValidation(const DataTerm<double>&, const std::vector<double>&,
                                const RadianceLimits&, SceneSystem<double>*, int*);
template StrengthSearch SearchStrength(Prior, double, const DataTerm<float>&,
                                       const std::vector<float>&, const RadianceLimits&,
                                       SceneSystem<float>*, std::vector<float>*);
template StrengthSearch SearchStrength(Prior, double, const DataTerm<double>&,
                                       const std::vector<double>&, const RadianceLimits&,
                                       SceneSystem<double>*, std::vector<double>*);

}  // namespace thicklens::estimator
