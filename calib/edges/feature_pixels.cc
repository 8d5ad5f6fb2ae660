#include "calib/edges/feature_pixels.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>

namespace thicklens::calib {
namespace {

constexpr double kCellPx = 4;
// Fitted levels within this distance of 0 or 1 count as plateau.
constexpr double kPlateau = 0.02;

// Narrows [low, high] to the range where |slope x + offset| <= bound.
void Narrow(double slope, double offset, double bound, double* low, double* high) {
  if (std::abs(slope) < 1e-12) {
    if (std::abs(offset) > bound) *high = *low - 1;
    return;
  }
  const double a = (-bound - offset) / slope, b = (bound - offset) / slope;
  *low = std::max(*low, std::min(a, b));
  *high = std::min(*high, std::max(a, b));
}

struct Sums {
  double count = 0, sum = 0, squares = 0;
  void Add(double value) {
    ++count;
    sum += value;
    squares += value * value;
  }
  double Variance() const {
    return count > 1 ? std::max(0.0, squares / count - sum * sum / (count * count)) : 0;
  }
};

// A camera clips at some grey value, which need not be its full scale. The values then are clipped
// at the largest one and lose their noise, independently of the fit.
bool IsClipped(const FeaturePixels& pixels, const std::vector<double>& bright) {
  const double largest = *std::max_element(pixels.grey.begin(), pixels.grey.end());
  Sums dark_steps, bright_steps;
  double at_largest = 0, bright_pixels = 0;
  for (std::size_t i = 0; i < pixels.size(); ++i) {
    const bool is_bright = bright[i] > 1 - kPlateau, is_dark = bright[i] < kPlateau;
    if (is_bright) ++bright_pixels;
    if (is_bright && pixels.grey[i] >= largest) ++at_largest;
    if (pixels.next_to_last[i] == 0) continue;
    const double step = pixels.grey[i] - pixels.grey[i - 1];
    if (is_bright && bright[i - 1] > 1 - kPlateau) bright_steps.Add(step);
    if (is_dark && bright[i - 1] < kPlateau) dark_steps.Add(step);
  }
  const double piled_up = bright_pixels > 0 ? at_largest / bright_pixels : 0;
  return (piled_up > 0.05 && largest >= 1 - 1e-6) ||
         (piled_up > 0.5 && bright_steps.Variance() < 0.1 * dark_steps.Variance());
}

}  // namespace

FeaturePixels GatherPixels(const cv::Mat& grey, const Strip& strip, int most) {
  const double c = std::cos(strip.normal_rad), s = std::sin(strip.normal_rad);
  const double width = strip.half_width_px, length = strip.half_length_px;
  const double cx = strip.centre_px.x(), cy = strip.centre_px.y();
  const double area = 4 * width * length;
  const int every = std::max(1, static_cast<int>(std::ceil(area / most)));
  const int columns = static_cast<int>(2 * width / kCellPx) + 1;
  const int rows = static_cast<int>(2 * length / kCellPx) + 1;

  FeaturePixels pixels;
  pixels.cells = columns * rows;
  double inside = 0;
  const double reach_y = std::abs(width * s) + std::abs(length * c);
  const int first_y = std::max(0, static_cast<int>(std::ceil(cy - reach_y)));
  const int last_y = std::min(grey.rows - 1, static_cast<int>(std::floor(cy + reach_y)));
  for (int iy = first_y; iy <= last_y; ++iy) {
    const double y = iy - cy;
    double low = -cx, high = grey.cols - 1 - cx;
    Narrow(c, y * s, width, &low, &high);
    Narrow(-s, y * c, length, &low, &high);
    const auto* row = grey.ptr<float>(iy);
    int last_x = -2;
    for (int ix = static_cast<int>(std::ceil(low + cx)); ix <= std::floor(high + cx); ++ix) {
      const double x = ix - cx;
      const double across = x * c + y * s, along = y * c - x * s;
      ++inside;
      const int piece = static_cast<int>((along + length) / kCellPx);
      if (piece % every != 0) continue;
      if (std::abs(across) > strip.arm_px && std::abs(along) > strip.arm_px) continue;
      if (!std::isfinite(row[ix])) return {};
      pixels.x_px.push_back(x);
      pixels.y_px.push_back(y);
      pixels.grey.push_back(row[ix]);
      pixels.cell.push_back(piece * columns + static_cast<int>((across + width) / kCellPx));
      pixels.next_to_last.push_back(last_x + 1 == ix ? 1 : 0);
      last_x = ix;
    }
  }
  pixels.coverage = area > 0 ? inside / area : 0;
  return pixels;
}

FitQuality JudgeFit(const FeaturePixels& pixels, const Eigen::VectorXd& residual,
                    const std::vector<double>& bright, int parameters) {
  FitQuality quality;
  const auto n = static_cast<double>(pixels.size());
  const double dof = std::max(1.0, n - parameters);
  const double variance = residual.squaredNorm() / dof;
  quality.residual_sigma = std::sqrt(variance);

  // A step, a slope and the wide structure of a plateau nearly vanish in the difference of two
  // neighbours, whose variance is twice that of the noise.
  const auto is_plateau = [&bright](std::size_t i) {
    return bright[i] < kPlateau || bright[i] > 1 - kPlateau;
  };
  double pairs = 0, squares = 0;
  std::vector<Sums> cells(static_cast<std::size_t>(pixels.cells));
  for (std::size_t i = 0; i < pixels.size(); ++i) {
    const double r = residual[static_cast<Eigen::Index>(i)];
    cells[static_cast<std::size_t>(pixels.cell[i])].Add(r);
    if (pixels.next_to_last[i] == 0 || !is_plateau(i) || !is_plateau(i - 1)) continue;
    const double difference = r - residual[static_cast<Eigen::Index>(i) - 1];
    ++pairs;
    squares += difference * difference;
  }
  const double noise_variance = pairs > 0 ? squares / (2 * pairs) : variance;
  quality.noise_sigma = std::sqrt(noise_variance);
  quality.chi2_per_dof = noise_variance > 0 ? variance / noise_variance : 1;

  // Independent noise of n pixels has sum^2/n = variance; the excess is shared by the pixels of the
  // cell.
  double full_cells = 0, ratio = 0, shared = 0;
  for (const Sums& cell : cells) {
    if (cell.count < 6) continue;
    ++full_cells;
    ratio += cell.sum * cell.sum / cell.count;
    shared += (cell.sum * cell.sum / cell.count - noise_variance) / cell.count;
  }
  if (full_cells > 0 && variance > 0) {
    quality.clumping = std::max(1.0, ratio / full_cells / variance);
    quality.structure_sigma = std::sqrt(std::max(0.0, shared / full_cells));
  }
  quality.clipped = IsClipped(pixels, bright);
  return quality;
}

bool IsStep(const FitQuality& quality, double contrast) {
  return !quality.clipped && quality.residual_sigma < 0.3 * contrast &&
         quality.structure_sigma < 0.025 * contrast;
}

Eigen::MatrixXd FitCovariance(const Eigen::MatrixXd& jacobian, const Eigen::VectorXd& residual,
                              double clumping) {
  const auto n = static_cast<double>(jacobian.rows());
  const auto p = static_cast<double>(jacobian.cols());
  const Eigen::VectorXd size = jacobian.colwise().norm();
  if (!(n > p) || !(size.minCoeff() > 0)) return {};
  const Eigen::MatrixXd scaled = jacobian * size.cwiseInverse().asDiagonal();
  const Eigen::LDLT<Eigen::MatrixXd> normal(scaled.transpose() * scaled);
  if (!(normal.rcond() > 1e-12)) return {};
  const Eigen::MatrixXd scores = residual.asDiagonal() * scaled;
  const Eigen::MatrixXd half = normal.solve(scores.transpose());
  const double factor = clumping * n / (n - p);
  const Eigen::VectorXd unit = size.cwiseInverse();
  return factor * (unit.asDiagonal() * (half * half.transpose()) * unit.asDiagonal());
}

}  // namespace thicklens::calib
