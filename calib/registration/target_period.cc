#include "calib/registration/target_period.h"

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>
#include <complex>
#include <cstddef>
#include <initializer_list>
#include <opencv2/imgproc.hpp>
#include <utility>
#include <vector>

#include "calib/spectrum/line_spectrum.h"
#include "thicklens/base/cancel.h"

namespace thicklens::calib {
namespace {

using Complex = std::complex<double>;

constexpr int kLargestSide = 1024;  // px of the image in which a period is searched

// Reciprocal lattice: every line of the pattern is at m first + n second. A ruling has no second
// vector.
struct Lattice {
  Frequency first{0, 0};
  std::optional<Frequency> second;

  Frequency At(int m, int n) const {
    return second ? Frequency(m * first + n * *second) : Frequency(m * first);
  }
};

// Gauss reduction: the two shortest vectors that span the same lattice, the shorter one first.
void Reduce(Eigen::Vector2d* a, Eigen::Vector2d* b) {
  for (int i = 0; i < 20; ++i) {
    if (b->squaredNorm() < a->squaredNorm()) std::swap(*a, *b);
    const double k = std::round(a->dot(*b) / a->squaredNorm());
    if (k == 0) return;
    *b -= k * *a;
  }
}

std::optional<Lattice> FindLattice(const LineSpectrum& spectrum) {
  const auto strongest = spectrum.StrongestLine([](const Frequency&) { return true; });
  if (!strongest) return std::nullopt;
  Lattice lattice;
  lattice.first = spectrum.Fundamental(*strongest);
  const auto across = spectrum.StrongestLine([&](const Frequency& f) {
    const double sine = lattice.first.x() * f.y() - lattice.first.y() * f.x();
    return std::abs(sine) > 0.34 * lattice.first.norm() * f.norm();  // 20 degrees
  });
  if (across && spectrum.At(*across) > 0.01 * spectrum.At(*strongest)) {
    lattice.second = spectrum.Fundamental(*across);
    Reduce(&lattice.first, &*lattice.second);
  }
  return lattice;
}

// Amplitudes of one line under 3 x 3 Hann windows of half the frame each. Their phases are equal if
// the frequency is correct.
constexpr int kTiles = 3;
using Tiles = std::array<Complex, kTiles * kTiles>;

// Centre of a window, px, relative to the centre of the frame.
Eigen::Vector2d TilePlace(cv::Size size, int tile) {
  return {(tile % kTiles - 1) * 0.25 * size.width, (tile / kTiles - 1) * 0.25 * size.height};
}

Tiles TileAmplitudes(const cv::Mat& grey, const Frequency& f) {
  // The weights of one window times the wave, along an axis of `length` px.
  const auto wave = [](int length, double frequency, int tile) {
    std::vector<Complex> values(static_cast<std::size_t>(length));
    for (int i = 0; i < length; ++i) {
      const double place = i - 0.5 * (length - 1);
      const double t = (place - (tile - 1) * 0.25 * length) / (0.5 * length) + 0.5;
      values[static_cast<std::size_t>(i)] = std::polar(Hann(t), -2 * CV_PI * frequency * place);
    }
    return values;
  };
  Tiles amplitudes{};
  for (int i = 0; i < kTiles; ++i) {
    const auto along_x = wave(grey.cols, f.x(), i);
    std::vector<Complex> rows(static_cast<std::size_t>(grey.rows));
    for (int y = 0; y < grey.rows; ++y) {
      ThrowIfCancelled();
      const auto* row = grey.ptr<float>(y);
      double re = 0, im = 0;
      for (std::size_t x = 0; x < along_x.size(); ++x) {
        re += row[x] * along_x[x].real();
        im += row[x] * along_x[x].imag();
      }
      rows[static_cast<std::size_t>(y)] = {re, im};
    }
    for (int j = 0; j < kTiles; ++j) {
      const auto along_y = wave(grey.rows, f.y(), j);
      Complex sum = 0;
      for (std::size_t y = 0; y < rows.size(); ++y) sum += rows[y] * along_y[y];
      amplitudes[static_cast<std::size_t>(j * kTiles + i)] = sum;
    }
  }
  return amplitudes;
}

// The refined lattice, with the covariance of its two or four frequencies.
struct RefinedLattice {
  Lattice lattice;
  Eigen::MatrixXd covariance;
};

// [D67] For every line that stands out, the phase under each window is
//   c + 2 pi (m df1 + n df2) . r.
// It is linear in the errors of the frequencies, which are solved by least squares with weights
// |amplitude|^2. The residuals give the covariance.
std::optional<RefinedLattice> Refine(const cv::Mat& grey, const LineSpectrum& spectrum,
                                     Lattice lattice) {
  constexpr int kRounds = 4;
  constexpr double kWorstPhase = 0.35;  // rad rms; lines without a pattern have 1 and more
  RefinedLattice result;
  for (int round = 0; round < kRounds; ++round) {
    ThrowIfCancelled();
    const int highest = round == 0 ? 1 : 3;  // harmonics wait until their phases are unambiguous
    const int parameters = lattice.second ? 4 : 2;
    Eigen::MatrixXd normal = Eigen::MatrixXd::Zero(parameters, parameters);
    Eigen::VectorXd right = Eigen::VectorXd::Zero(parameters);
    double weighted_squares = 0, weights = 0;
    int observations = 0;
    const double strongest = spectrum.At(lattice.first);
    for (int m = 0; m <= highest; ++m) {
      for (int n = lattice.second ? -highest : 0; n <= (lattice.second ? highest : 0); ++n) {
        if (m == 0 && n <= 0) continue;
        if (round == 0 && std::abs(m) + std::abs(n) > 1) continue;
        const Frequency f = lattice.At(m, n);
        if (!spectrum.Resolves(f) || !(spectrum.At(f) > 1e-3 * strongest)) continue;
        const Tiles amplitudes = TileAmplitudes(grey, f);
        Complex sum = 0;
        for (const Complex& a : amplitudes) sum += std::abs(a) * a;
        // Phases relative to their mean, which is subtracted together with the mean place.
        std::array<double, kTiles * kTiles> phase{}, weight{};
        double total = 0, mean_phase = 0;
        Eigen::Vector2d mean_place(0, 0);
        for (std::size_t t = 0; t < amplitudes.size(); ++t) {
          phase[t] = std::arg(amplitudes[t] * std::conj(sum));
          weight[t] = std::norm(amplitudes[t]);
          total += weight[t];
          mean_phase += weight[t] * phase[t];
          mean_place += weight[t] * TilePlace(grey.size(), static_cast<int>(t));
        }
        mean_phase /= total;
        mean_place /= total;
        for (std::size_t t = 0; t < amplitudes.size(); ++t) {
          const Eigen::Vector2d place =
              2 * CV_PI * (TilePlace(grey.size(), static_cast<int>(t)) - mean_place);
          Eigen::VectorXd row(parameters);
          row.head<2>() = m * place;
          if (lattice.second) row.tail<2>() = n * place;
          normal += weight[t] * row * row.transpose();
          right += weight[t] * row * (phase[t] - mean_phase);
          weighted_squares += weight[t] * std::pow(phase[t] - mean_phase, 2);
          weights += weight[t];
        }
        observations += static_cast<int>(amplitudes.size()) - 1;
      }
    }
    const Eigen::LDLT<Eigen::MatrixXd> solver(normal);
    if (observations <= parameters || solver.info() != Eigen::Success || !solver.isPositive())
      return std::nullopt;
    const Eigen::VectorXd step = solver.solve(right);
    if (!step.allFinite()) return std::nullopt;
    lattice.first += step.head<2>();
    if (lattice.second) *lattice.second += step.tail<2>();
    const double left = std::max(0.0, weighted_squares - right.dot(step));
    if (std::sqrt(left / weights) > kWorstPhase) return std::nullopt;
    // Windows that overlap by half share about a quarter of their data: effectively four tiles of
    // nine are independent.
    const double scale = left / (observations - parameters) * (9.0 / 4);
    result.covariance = scale * solver.solve(Eigen::MatrixXd::Identity(parameters, parameters));
  }
  result.lattice = lattice;
  return result;
}

enum class Pattern { kGrid, kCheckerboard, kUnclear };

// A checkerboard becomes its negative when it is shifted by the sum of half of its two shortest
// periods. It therefore has no line at m + n even. A grid has (2, 0), (0, 2), and a dot grid also
// has (1, 1). A grid has almost no power in the odd lines off the axes, (2, 1), which a
// checkerboard has.
Pattern PatternOf(const LineSpectrum& spectrum, const Lattice& lattice) {
  const auto power = [&](std::initializer_list<std::pair<int, int>> lines) {
    double sum = 0;
    for (const auto& [m, n] : lines) {
      const Frequency f = lattice.At(m, n);
      if (!spectrum.Resolves(f)) continue;
      const cv::Point k = spectrum.IndexOf(f);
      const double here = spectrum.At(k.x, k.y);
      if (here > 3 * spectrum.Beside(k.x, k.y).largest) sum += here;
    }
    return sum;
  };
  const double even = power({{1, 1}, {1, -1}, {2, 0}, {0, 2}});
  const double odd = power({{2, 1}, {2, -1}, {1, 2}, {1, -2}});
  if (even > 2 * odd) return Pattern::kGrid;
  if (odd > 2 * even) return Pattern::kCheckerboard;
  return Pattern::kUnclear;
}

// Cell of the pattern's own lattice, px: f_i . a_j = 1 for i = j, otherwise 0.
struct Cell {
  Eigen::Vector2d a{0, 0}, b{0, 0};
  bool IsSquare() const {
    return std::abs(b.norm() / a.norm() - 1) < 0.03 &&
           std::abs(a.dot(b)) < 0.03 * a.norm() * b.norm();
  }
};

Cell CellOf(const Frequency& first, const Frequency& second) {
  Eigen::Matrix2d frequencies;
  frequencies << first.transpose(), second.transpose();
  const Eigen::Matrix2d inverse = frequencies.inverse();
  Cell cell{inverse.col(0), inverse.col(1)};
  Reduce(&cell.a, &cell.b);
  return cell;
}

double PeriodOf(const Lattice& lattice, bool is_square) {
  if (!lattice.second) return 1 / lattice.first.norm();
  const Cell cell = CellOf(lattice.first, *lattice.second);
  // The period of a square cell is the root of its area, so that both sides contribute.
  if (is_square) return std::sqrt(std::abs(cell.a.x() * cell.b.y() - cell.a.y() * cell.b.x()));
  return cell.a.norm();
}

std::optional<PeriodEstimate> MeasureIn(const cv::Mat& grey) {
  if (std::min(grey.cols, grey.rows) < 32) return std::nullopt;
  const LineSpectrum spectrum(grey);
  const auto lattice = FindLattice(spectrum);
  if (!lattice) return std::nullopt;
  const auto refined = Refine(grey, spectrum, *lattice);
  if (!refined) return std::nullopt;
  const Lattice& found = refined->lattice;
  const bool is_square = found.second && CellOf(found.first, *found.second).IsSquare();
  PeriodEstimate result;
  result.period_px = PeriodOf(found, is_square);
  Eigen::VectorXd slope(refined->covariance.rows());
  for (Eigen::Index i = 0; i < slope.size(); ++i) {
    const double step = 1e-6 * found.first.norm();
    Lattice moved = found;
    (i < 2 ? moved.first[i] : (*moved.second)[i - 2]) += step;
    slope[i] = (PeriodOf(moved, is_square) - result.period_px) / step;
  }
  result.sigma_px = std::sqrt(slope.dot(refined->covariance * slope));
  if (is_square) {
    const Pattern pattern = PatternOf(spectrum, found);
    if (pattern == Pattern::kUnclear) return std::nullopt;
    if (pattern == Pattern::kCheckerboard) {
      result.period_px *= std::sqrt(2);
      result.sigma_px *= std::sqrt(2);
    }
  }
  return result;
}

}  // namespace

std::optional<PeriodEstimate> MeasurePeriodPx(const cv::Mat& grey) {
  const int side = std::max(grey.cols, grey.rows);
  if (side <= kLargestSide) return MeasureIn(grey);
  // Fine patterns are searched in the middle at full resolution, which does not lose them. Patterns
  // with too few periods in the middle are searched in the whole frame, shrunk.
  const cv::Size part(std::min(grey.cols, kLargestSide), std::min(grey.rows, kLargestSide));
  const cv::Rect middle({(grey.cols - part.width) / 2, (grey.rows - part.height) / 2}, part);
  const auto fine = MeasureIn(grey(middle));
  if (fine && fine->period_px < kLargestSide / 12.0) return fine;
  const int shrink = (side + kLargestSide - 1) / kLargestSide;
  cv::Mat small;
  const cv::Rect whole(0, 0, grey.cols / shrink * shrink, grey.rows / shrink * shrink);
  cv::resize(grey(whole), small, whole.size() / shrink, 0, 0, cv::INTER_AREA);
  auto coarse = MeasureIn(small);
  if (!coarse) return fine;
  coarse->period_px *= shrink;
  coarse->sigma_px *= shrink;
  return coarse;
}

}  // namespace thicklens::calib
