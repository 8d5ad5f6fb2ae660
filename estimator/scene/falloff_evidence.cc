#include "thicklens/estimator/falloff_evidence.h"

#include <fmt/format.h>

#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <vector>

#include "estimator/scene/lower_bounds.h"
#include "estimator/views/input_checks.h"
#include "estimator/views/ray_irradiance.h"
#include "thicklens/base/cancel.h"
#include "thicklens/base/error.h"
#include "thicklens/base/index.h"
#include "thicklens/base/parallel.h"
#include "thicklens/base/run_cost.h"

namespace thicklens::estimator {
namespace {

constexpr double kPi = 3.14159265358979323846;
// Number of blocks along the longer side, and the fewest that are fitted.
constexpr int kBlocksAlong = 12;
constexpr int kMinBlocks = 24;
// Blocks that are clipped in part, or so dark that black level and noise make their logarithm, say
// nothing; nor do those that the camera predicts to be black.
constexpr double kMaxClippedShare = 0.01, kMaxDarkShare = 0.1;
constexpr double kDarkest = 2e-3;
// Exponents of the scene's power spectrum that are tried, how usual they are, and the variances of
// single blocks over that of the lowest frequency.
constexpr std::array<double, 5> kExponents = {1, 1.75, 2.5, 3.25, 4};
constexpr double kUsualExponent = 2.5, kExponentSpread = 0.9;
constexpr std::array<double, 3> kNuggets = {1e-6, 3e-4, 1e-2};
// Modes of frequencies up to this, in half waves per image, by which the Gaussian field is judged.
constexpr int kLowModes = 3;
// A fall-off that leaves more than this in the corners is within what a scene does anyway.
constexpr double kMaxDarkest = 1 / 1.1;
// A block's mean is not known better than this, in the logarithm.
constexpr double kMinError = 2e-3;
// Neither the law of the fall-off nor the correction in a camera is exact to more than this.
constexpr double kLawError = 0.12;
// The verdict: agreement in standard deviations, and twice the logarithm of the odds.
constexpr double kAgrees = 2.5, kOdds = 9;

// The blocks of an image: the logarithms of their mean light and of the fall-off, and their places.
struct Blocks {
  int across = 0, down = 0;
  std::vector<int> x, y;
  Eigen::VectorXd light, falloff;
};

double GreyAt(const model::LinearImage& image, std::size_t pixel) {
  const std::size_t first = pixel * Index(image.channels);
  if (image.channels == 3) {
    return 0.2126 * static_cast<double>(image.values[first]) +
           0.7152 * static_cast<double>(image.values[first + 1]) +
           0.0722 * static_cast<double>(image.values[first + 2]);
  }
  double sum = 0;
  for (std::size_t c = 0; c < Index(image.channels); ++c)
    sum += static_cast<double>(image.values[first + c]);
  return sum / image.channels;
}

Blocks BlocksOf(const EstimateInput& input, const std::vector<float>& falloff) {
  const model::LinearImage& image = input.image;
  const ClippedValues clipped = InAnyChannel(input.clipped, image.channels);
  const int longer = std::max(image.width_px, image.height_px);
  const auto count = [&](int size_px) {
    return std::max(1, static_cast<int>(std::lround(1.0 * kBlocksAlong * size_px / longer)));
  };
  Blocks blocks;
  blocks.across = std::min(image.width_px, count(image.width_px));
  blocks.down = std::min(image.height_px, count(image.height_px));
  std::vector<double> light, predicted;
  for (int j = 0; j < blocks.down; ++j) {
    ThrowIfCancelled();
    const int y0 = j * image.height_px / blocks.down, y1 = (j + 1) * image.height_px / blocks.down;
    for (int i = 0; i < blocks.across; ++i) {
      const int x0 = i * image.width_px / blocks.across;
      const int x1 = (i + 1) * image.width_px / blocks.across;
      double sum = 0, sum_of_falloff = 0, lost = 0, dark = 0;
      for (int y = y0; y < y1; ++y) {
        for (int x = x0; x < x1; ++x) {
          const std::size_t pixel = Index(y) * Index(image.width_px) + Index(x);
          const double grey = GreyAt(image, pixel);
          sum += grey;
          if (grey < kDarkest) dark += 1;
          sum_of_falloff += static_cast<double>(falloff[pixel]);
          if (!clipped.empty() && clipped[pixel] != 0) lost += 1;
        }
      }
      const double pixels = static_cast<double>(y1 - y0) * (x1 - x0);
      if (lost > kMaxClippedShare * pixels || dark > kMaxDarkShare * pixels) continue;
      if (!(sum > 0) || !(sum_of_falloff > 0)) continue;
      blocks.x.push_back(i);
      blocks.y.push_back(j);
      light.push_back(std::log(sum / pixels));
      predicted.push_back(std::log(sum_of_falloff / pixels));
    }
  }
  blocks.light = Eigen::Map<Eigen::VectorXd>(light.data(), static_cast<Eigen::Index>(light.size()));
  blocks.falloff =
      Eigen::Map<Eigen::VectorXd>(predicted.data(), static_cast<Eigen::Index>(predicted.size()));
  return blocks;
}

// The cosine modes of the grid of blocks, at the blocks that are used, except the constant one, and
// their frequencies in half waves along the longer side.
struct Modes {
  Eigen::MatrixXd values;  // blocks x modes
  Eigen::VectorXd frequency;
};

Modes ModesOf(const Blocks& blocks) {
  const auto used = static_cast<Eigen::Index>(blocks.x.size());
  const double longer = std::max(blocks.across, blocks.down);
  const auto wave = [](int mode, int at, int count) {
    return (mode == 0 ? std::sqrt(1.0 / count) : std::sqrt(2.0 / count)) *
           std::cos(kPi * mode * (at + 0.5) / count);
  };
  const Eigen::Index count = static_cast<Eigen::Index>(blocks.across) * blocks.down - 1;
  Modes modes{Eigen::MatrixXd(used, count), Eigen::VectorXd(count)};
  Eigen::Index mode = 0;
  for (int j = 0; j < blocks.down; ++j) {
    for (int i = 0; i < blocks.across; ++i) {
      if (i == 0 && j == 0) continue;
      modes.frequency[mode] = std::hypot(i * longer / blocks.across, j * longer / blocks.down);
      for (Eigen::Index b = 0; b < used; ++b) {
        modes.values(b, mode) = wave(i, blocks.x[static_cast<std::size_t>(b)], blocks.across) *
                                wave(j, blocks.y[static_cast<std::size_t>(b)], blocks.down);
      }
      ++mode;
    }
  }
  return modes;
}

// The fit for one law of the scene's power.
struct LawFit {
  double share = 0, variance = 0, log_likelihood = 0;
};

// `of_modes`: the covariance of the blocks by the modes of that power.
LawFit FitLaw(const Blocks& blocks, const Modes& modes, const Eigen::VectorXd& power,
              const Eigen::MatrixXd& of_modes, double nugget) {
  const Eigen::Index used = blocks.light.size();
  Eigen::MatrixXd covariance = of_modes;
  covariance.diagonal().array() += nugget;
  const Eigen::LLT<Eigen::MatrixXd> factor(covariance);
  Eigen::MatrixXd design(used, 2);
  design.col(0).setOnes();
  design.col(1) = blocks.falloff;
  factor.matrixL().solveInPlace(design);
  Eigen::VectorXd light = blocks.light;
  factor.matrixL().solveInPlace(light);
  const Eigen::Matrix2d normal = design.transpose() * design;
  const Eigen::Matrix2d inverse = normal.inverse();
  const Eigen::Vector2d fit = inverse * (design.transpose() * light);
  const auto degrees = static_cast<double>(used - 2);
  const double squares = (light - design * fit).squaredNorm();
  const double scale =
      std::max(squares / degrees, kMinError * kMinError / (power.maxCoeff() + nugget));
  // The Gaussian field must hold where it decides: at the low frequencies.
  const Eigen::VectorXd residual =
      blocks.light - Eigen::VectorXd::Constant(used, fit[0]) - fit[1] * blocks.falloff;
  double low = 0, count = 0;
  for (Eigen::Index mode = 0; mode < power.size(); ++mode) {
    if (modes.frequency[mode] > kLowModes) continue;
    const double amplitude = modes.values.col(mode).dot(residual);
    low += amplitude * amplitude / (scale * (power[mode] + nugget));
    count += 1;
  }
  LawFit law;
  law.share = fit[1];
  law.variance = scale * inverse(1, 1) * std::max(1.0, low / std::max(1.0, count - 1));
  const double log_root = factor.matrixLLT().diagonal().array().log().sum();
  law.log_likelihood =
      -degrees / 2 * std::log(scale) - log_root - std::log(normal.determinant()) / 2;
  return law;
}

// Averages the fits for all laws by how likely they are.
void FitShare(const Blocks& blocks, FalloffEvidence* evidence) {
  const Modes modes = ModesOf(blocks);
  std::vector<LawFit> laws;
  double best = 0;
  for (const double exponent : kExponents) {
    ThrowIfCancelled();
    const Eigen::VectorXd power = modes.frequency.array().pow(-exponent);
    const Eigen::MatrixXd of_modes = modes.values * power.asDiagonal() * modes.values.transpose();
    const double off = (exponent - kUsualExponent) / kExponentSpread;
    for (const double nugget : kNuggets) {
      LawFit law = FitLaw(blocks, modes, power, of_modes, nugget);
      law.log_likelihood -= off * off / 2;
      if (laws.empty() || law.log_likelihood > best) {
        best = law.log_likelihood;
        evidence->exponent = exponent;
      }
      laws.push_back(law);
    }
  }
  double sum = 0, share = 0, square = 0, variance = 0;
  for (const LawFit& law : laws) {
    const double weight = std::exp(law.log_likelihood - best);
    sum += weight;
    share += weight * law.share;
    square += weight * law.share * law.share;
    variance += weight * law.variance;
  }
  evidence->share = share / sum;
  evidence->sigma =
      std::sqrt(variance / sum + std::max(0.0, square / sum - evidence->share * evidence->share));
}

void Judge(FalloffEvidence* evidence) {
  using Verdict = FalloffEvidence::Verdict;
  const double sigma = std::hypot(evidence->sigma, kLawError);
  const double from_none = evidence->share / sigma, from_whole = (evidence->share - 1) / sigma;
  const double odds = from_none * from_none - from_whole * from_whole;
  evidence->verdict = Verdict::kUndecided;
  if (odds >= kOdds && from_whole >= -kAgrees && from_whole <= kAgrees) {
    evidence->verdict = Verdict::kShown;
  } else if (odds <= -kOdds && std::abs(from_none) <= kAgrees) {
    evidence->verdict = Verdict::kNotShown;
  }
  const std::string measured =
      fmt::format("{:.2f} +- {:.2f} of the predicted fall-off", evidence->share, evidence->sigma);
  switch (evidence->verdict) {
    case Verdict::kShown:
      evidence->message = "the photograph shows " + measured;
      break;
    case Verdict::kNotShown:
      evidence->message =
          "the photograph shows " + measured + ": it was corrected for it, or never had it";
      break;
    case Verdict::kUndecided:
      evidence->message =
          std::abs(from_none) > kAgrees && std::abs(from_whole) > kAgrees
              ? "the photograph shows " + measured + ", which is neither all of it nor none"
              : "the brightness of the scene hides whether the photograph has the fall-off (" +
                    measured + ")";
      break;
  }
}

}  // namespace

FalloffEvidence TestFalloff(const EstimateInput& input, int threads) {
  CheckInput(input);
  if (!input.grid) throw Error("fall-off: the input has no camera, which predicts it");
  const auto start = Clock::now();
  const std::vector<float> falloff =
      FalloffOfImage(*input.grid, input.camera_of_falloff(), input.weights, input.image.width_px,
                     input.image.height_px, ResolveThreads(threads));
  FalloffEvidence evidence;
  evidence.darkest = static_cast<double>(*std::min_element(falloff.begin(), falloff.end()));
  if (evidence.darkest > kMaxDarkest) {
    evidence.message = "the predicted fall-off is too small to be seen in a photograph";
    evidence.seconds = SecondsSince(start);
    return evidence;
  }
  const Blocks blocks = BlocksOf(input, falloff);
  evidence.blocks = static_cast<int>(blocks.x.size());
  if (evidence.blocks < kMinBlocks) {
    evidence.message = fmt::format(
        "only {} parts of the photograph are neither clipped nor black: they do not show whether "
        "it has the fall-off",
        evidence.blocks);
  } else if (blocks.falloff.maxCoeff() - blocks.falloff.minCoeff() < kMinError) {
    evidence.message = "the predicted fall-off is the same in all parts that can be compared";
  } else {
    FitShare(blocks, &evidence);
    Judge(&evidence);
  }
  evidence.seconds = SecondsSince(start);
  return evidence;
}

std::string FalloffVerdictName(FalloffEvidence::Verdict verdict) {
  switch (verdict) {
    case FalloffEvidence::Verdict::kShown:
      return "shown";
    case FalloffEvidence::Verdict::kNotShown:
      return "not shown";
    case FalloffEvidence::Verdict::kUndecided:
      break;
  }
  return "undecided";
}

}  // namespace thicklens::estimator
