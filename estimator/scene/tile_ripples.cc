#include "estimator/scene/tile_ripples.h"

#include <algorithm>
#include <cmath>
#include <complex>
#include <limits>
#include <numeric>
#include <opencv2/core.hpp>
#include <optional>

#include "thicklens/base/cancel.h"
#include "thicklens/base/index.h"
#include "thicklens/base/parallel.h"

namespace thicklens::estimator {
namespace {

constexpr double kPi = 3.14159265358979323846;
constexpr std::array<int, 3> kSizesPx = {32, 64, 128};
// Where the blur is not known, larger tiles would be looked at for any.
constexpr int kLargestUnstatedPx = 64;
// Below, the mean of the tile and the window dominate; above, hardly any photograph has content.
constexpr double kMinRadius = 1.6, kMaxFrequency = 0.44;
// Periods per view step up to which samples are the aperture.
constexpr double kMaxOfSampling = 0.55;
// Edge of a tile over the width of the blur: fewer do not resolve the ripples. Larger tiles are
// for the blur that smaller ones hardly resolve. Where the map states the blur, that of a tile is
// well below the largest one that is tried.
constexpr double kMinWidths = 3, kWellResolved = 5, kMinStatedWidths = 4.2;
// The disparities about the stated one that are tried.
constexpr double kMinShare = 0.6, kMaxShare = 1.45, kMoreWidthPx = 4;
// Share of the stated disparity that decides which frequencies are used.
constexpr double kUsedShare = 1.2;
constexpr double kClippedLight = 0.98;
constexpr double kDarkest = 0.003;
// Power of a tile over that of the noise, at its lower frequencies.
constexpr double kMinTexture = 6;
constexpr double kTextureFrequency = 0.23, kMinTextureFrequency = 0.06, kTextureLobes = 1.6;
constexpr std::size_t kMaxTilesOfSize = 96, kMaxUnstatedTiles = 48;
constexpr int kPartsAlong = 4;
// Exponent of the power of photographs.
constexpr double kExponent = 2.2;
constexpr double kCellPx = 0.2;  // of the table of disparities, width of the blur

constexpr std::size_t kSmooth = 7, kUnknowns = kSmooth + 1;  // the last one is that of the noise
using Unknowns = std::array<double, kUnknowns>;
constexpr double kNoiseSpread = 0.2;
constexpr Unknowns kSpread = {100, 6, 6, 3, 3, 6, 6, kNoiseSpread};
// Neighbouring frequencies of a windowed tile are correlated. Of each two only one is used, and
// these still count less.
constexpr double kPerDegree = 1.2;
constexpr int kFirstSteps = 8, kSteps = 3;
constexpr std::size_t kMinFrequencies = 40;

struct Frequency {
  int x = 0, y = 0;
  double square = 0;  // the larger coordinate
  std::array<double, kSmooth> smooth{};
};

std::vector<double> WindowOf(int size) {
  std::vector<double> line(Index(size));
  double squares = 0;
  for (int i = 0; i < size; ++i) {
    line[Index(i)] = 0.5 - 0.5 * std::cos(2 * kPi * (i + 0.5) / size);
    squares += line[Index(i)] * line[Index(i)];
  }
  for (double& value : line) value /= std::sqrt(squares);  // white noise keeps its variance
  return line;
}

}  // namespace

// The frequencies of one size of tile, of one half plane, by ascending coordinate.
struct TileRipples::Frequencies {
  explicit Frequencies(int size) : size_px(size), window(WindowOf(size)) {
    constexpr double kUnit = 0.16;  // cycles per px, at which the logarithm is 0
    for (int y = -size / 2 + 1; y < size / 2; ++y) {
      for (int x = 0; x < size / 2; ++x) {
        if ((x == 0 && y <= 0) || (x + y) % 2 != 0) continue;
        const double radius = std::hypot(x, y);
        if (radius < kMinRadius || radius > kMaxFrequency * size) continue;
        const double angle = 2 * std::atan2(y, x);
        const double level = std::log(radius / (kUnit * size));
        const double square = std::pow(radius / (1.6 * kUnit * size), 2);
        all.push_back({x,
                       y,
                       1.0 * std::max(x, std::abs(y)),
                       {1, level, square, std::cos(angle), std::sin(angle), level * std::cos(angle),
                        level * std::sin(angle)}});
      }
    }
    std::stable_sort(all.begin(), all.end(),
                     [](const Frequency& a, const Frequency& b) { return a.square < b.square; });
  }
  // The number of those that an aperture of this disparity represents.
  std::size_t Used(double disparity) const {
    const double most = disparity > 0 ? kMaxOfSampling * size_px / disparity : size_px;
    return static_cast<std::size_t>(
        std::upper_bound(all.begin(), all.end(), most,
                         [](double value, const Frequency& f) { return value < f.square; }) -
        all.begin());
  }
  int size_px;
  std::vector<double> window;
  std::vector<Frequency> all;
};

// K for the frequencies of one size of tile, by disparity.
class TileRipples::Shapes {
 public:
  // `cell`: distance of the disparities of the table, from `least` to `most`.
  Shapes(RippleAperture aperture, const Frequencies& frequencies, const Eigen::ArrayXXd& weights,
         const Eigen::Vector2d& step, const Eigen::Vector2d& sigma_steps, double cell_size,
         double least, double most, int threads)
      : cell_(cell_size),
        first_(static_cast<int>(std::floor(std::max(0.0, least) / cell_size))),
        table_(Index(static_cast<int>(std::ceil(most / cell_size)) - first_ + 2)) {
    const int half = frequencies.size_px / 2, wide = frequencies.size_px + 1;
    const auto at = [half, wide](int x, int y) { return Index((y + half) * wide + x + half); };
    std::vector<double> content(Index(wide) * Index(wide));
    for (int y = -half; y <= half; ++y) {
      for (int x = -half; x <= half; ++x)
        content[at(x, y)] = std::pow(std::max(0.3, 1.0 * x * x + 1.0 * y * y), -kExponent / 2);
    }
    content[at(0, 0)] *= 0.25;  // the mean of a tile is subtracted
    ParallelFor(static_cast<int>(table_.size()), threads, [&](int cell) {
      ThrowIfCancelled();
      const double disparity = (first_ + cell) * cell_;
      // Hermitian: the half plane of x >= -1 is sufficient.
      std::vector<double> product(content.size());
      const Phases phases(weights.rows(), half, disparity * step.y() / (2 * half));
      for (int x = -2; x <= half; ++x) {
        const Transfer transfer(aperture, weights, sigma_steps,
                                disparity * step.x() * x / (2 * half));
        for (int y = -half; y <= half; ++y) {
          product[at(x, y)] =
              content[at(x, y)] * transfer.At(disparity * step.y() * y / (2 * half), phases.Of(y));
        }
      }
      // A Hann window spreads a power over its neighbours, a sixth to each side.
      const auto spread = [](double a, double b, double c) { return b * 2 / 3 + (a + c) / 6; };
      std::vector<double> across(content.size());
      for (int y = -half; y <= half; ++y) {
        for (int x = -1; x < half; ++x)
          across[at(x, y)] =
              spread(product[at(x - 1, y)], product[at(x, y)], product[at(x + 1, y)]);
      }
      std::vector<double>& shape = table_[Index(cell)];
      shape.reserve(frequencies.all.size());
      for (const Frequency& f : frequencies.all) {
        shape.push_back(
            spread(across[at(f.x, f.y - 1)], across[at(f.x, f.y)], across[at(f.x, f.y + 1)]));
      }
    });
  }

  // The mean over disparities that are `range` apart at most.
  std::vector<double> At(double disparity, double range) const {
    constexpr std::array<double, 4> kParts = {-0.375, -0.125, 0.125, 0.375};
    std::vector<double> shape(table_.front().size(), 0.0);
    for (const double part : kParts) {
      const double cell = std::clamp(std::abs(disparity + part * range) / cell_ - first_, 0.0,
                                     static_cast<double>(table_.size()) - 1.001);
      const auto below = static_cast<std::size_t>(cell);
      const double share = cell - static_cast<double>(below);
      const std::vector<double>&a = table_[below], &b = table_[below + 1];
      for (std::size_t i = 0; i < shape.size(); ++i)
        shape[i] += ((1 - share) * a[i] + share * b[i]) / kParts.size();
    }
    return shape;
  }

 private:
  // The phases of the rows of views at each frequency down.
  class Phases {
   public:
    Phases(Eigen::Index rows, int half, double per_view)
        : rows_(static_cast<std::size_t>(rows)), half_(half) {
      const double middle = static_cast<double>(rows - 1) / 2;
      for (int y = -half; y <= half; ++y) {
        for (std::size_t l = 0; l < rows_; ++l) {
          all_.push_back(
              std::polar(1.0, 2 * kPi * per_view * y * (static_cast<double>(l) - middle)));
        }
      }
    }
    const std::complex<double>* Of(int y) const { return &all_[Index(y + half_) * rows_]; }

   private:
    std::size_t rows_;
    int half_;
    std::vector<std::complex<double>> all_;
  };
  // abs(T)^2 along one column of frequencies, in periods per view step.
  class Transfer {
   public:
    Transfer(RippleAperture aperture, const Eigen::ArrayXXd& weights,
             const Eigen::Vector2d& sigma_steps, double across)
        : aperture_(aperture), sigma_(sigma_steps), across_(across) {
      if (aperture != RippleAperture::kSampled) return;
      rows_.resize(Index(static_cast<int>(weights.rows())));
      for (Eigen::Index k = 0; k < weights.cols(); ++k) {
        const auto phase = std::polar(
            1.0, 2 * kPi * across *
                     (static_cast<double>(k) - static_cast<double>(weights.cols() - 1) / 2));
        for (Eigen::Index l = 0; l < weights.rows(); ++l)
          rows_[static_cast<std::size_t>(l)] += weights(l, k) * phase;
      }
    }
    double At(double down, const std::complex<double>* phases) const {
      switch (aperture_) {
        case RippleAperture::kSampled: {
          double real = 0, imaginary = 0;
          for (std::size_t l = 0; l < rows_.size(); ++l) {
            real += rows_[l].real() * phases[l].real() - rows_[l].imag() * phases[l].imag();
            imaginary += rows_[l].real() * phases[l].imag() + rows_[l].imag() * phases[l].real();
          }
          return real * real + imaginary * imaginary;
        }
        case RippleAperture::kSquare: {
          const double sinc = Sinc(std::sqrt(12.0) * sigma_.x() * across_) *
                              Sinc(std::sqrt(12.0) * sigma_.y() * down);
          return sinc * sinc;
        }
        case RippleAperture::kDisc:
          break;
      }
      // The radius is twice the standard deviation of an axis.
      const double at = 4 * kPi * std::hypot(sigma_.x() * across_, sigma_.y() * down);
      if (at < 1e-6) return 1;
      return std::pow(2 * std::cyl_bessel_j(1.0, at) / at, 2);
    }

   private:
    static double Sinc(double x) { return std::abs(x) < 1e-9 ? 1 : std::sin(kPi * x) / (kPi * x); }
    RippleAperture aperture_;
    Eigen::Vector2d sigma_;
    double across_;
    std::vector<std::complex<double>> rows_;
  };

  double cell_;
  int first_;
  std::vector<std::vector<double>> table_;
};

namespace {

// Solves A x = b for a symmetric positive definite A, of which the lower half is given.
void Solve(std::array<Unknowns, kUnknowns>* matrix, Unknowns* x) {
  std::array<Unknowns, kUnknowns>& a = *matrix;
  for (std::size_t j = 0; j < kUnknowns; ++j) {
    for (std::size_t k = 0; k < j; ++k) a[j][j] -= a[j][k] * a[j][k];
    a[j][j] = std::sqrt(std::max(a[j][j], 1e-12));
    for (std::size_t i = j + 1; i < kUnknowns; ++i) {
      for (std::size_t k = 0; k < j; ++k) a[i][j] -= a[i][k] * a[j][k];
      a[i][j] /= a[j][j];
    }
  }
  for (std::size_t i = 0; i < kUnknowns; ++i) {
    for (std::size_t k = 0; k < i; ++k) (*x)[i] -= a[i][k] * (*x)[k];
    (*x)[i] /= a[i][i];
  }
  for (std::size_t i = kUnknowns; i-- > 0;) {
    for (std::size_t k = i + 1; k < kUnknowns; ++k) (*x)[i] -= a[k][i] * (*x)[k];
    (*x)[i] /= a[i][i];
  }
}

// Minus the logarithm of the likelihood of a tile's powers at its first frequencies, with the
// smooth part that suits them.
class SmoothFit {
 public:
  SmoothFit(const std::vector<Frequency>& frequencies, const std::vector<double>& power,
            double noise_power)
      : frequencies_(frequencies), power_(power), noise_power_(noise_power) {}

  double Cost(const std::vector<double>& shape, std::size_t used) {
    if (!is_started_) {
      double signal = 0, expected = 1e-300;
      for (std::size_t i = 0; i < used; ++i) {
        signal += std::max(0.0, power_[i] - noise_power_);
        expected += shape[i];
      }
      theta_[0] = std::log(std::max(1e-12, signal / expected));
    }
    for (int step = is_started_ ? kSteps : kFirstSteps; step > 0; --step) Improve(shape, used);
    is_started_ = true;
    double cost = 0;
    const double noise = noise_power_ * std::exp(theta_[kSmooth]);
    for (std::size_t i = 0; i < used; ++i) {
      const double expected = shape[i] * Smooth(i) + noise;
      cost += power_[i] / expected + std::log(expected);
    }
    cost /= kPerDegree;
    for (std::size_t i = 0; i < kUnknowns; ++i)
      cost += theta_[i] * theta_[i] / (2 * kSpread[i] * kSpread[i]);
    return cost;
  }

 private:
  double Smooth(std::size_t i) const {
    double exponent = 0;
    for (std::size_t b = 0; b < kSmooth; ++b) exponent += frequencies_[i].smooth[b] * theta_[b];
    return std::exp(std::min(exponent, 60.0));
  }
  // One step of Fisher scoring.
  void Improve(const std::vector<double>& shape, std::size_t used) {
    std::array<Unknowns, kUnknowns> matrix{};
    Unknowns step{};
    const double noise = noise_power_ * std::exp(theta_[kSmooth]);
    for (std::size_t i = 0; i < used; ++i) {
      const double signal = shape[i] * Smooth(i), expected = signal + noise;
      Unknowns slope;
      for (std::size_t b = 0; b < kSmooth; ++b)
        slope[b] = signal / expected * frequencies_[i].smooth[b];
      slope[kSmooth] = noise / expected;
      const double residual = (power_[i] - expected) / expected / kPerDegree;
      for (std::size_t a = 0; a < kUnknowns; ++a) {
        step[a] += residual * slope[a];
        for (std::size_t b = 0; b <= a; ++b) matrix[a][b] += slope[a] * slope[b] / kPerDegree;
      }
    }
    for (std::size_t a = 0; a < kUnknowns; ++a) {
      const double precision = 1 / (kSpread[a] * kSpread[a]);
      step[a] -= precision * theta_[a];
      matrix[a][a] += precision;
    }
    Solve(&matrix, &step);
    double largest = 1;
    for (const double value : step) largest = std::max(largest, std::abs(value));
    for (std::size_t a = 0; a < kUnknowns; ++a) theta_[a] += step[a] / largest;
  }

  const std::vector<Frequency>& frequencies_;
  const std::vector<double>& power_;
  double noise_power_;
  Unknowns theta_{};
  bool is_started_ = false;
};

// Mean and range of the disparities in the middle of a tile; nothing where it shows several depths.
std::optional<RippleTile> TileAt(const DisparityMap& map, double step, int x, int y, int size_px,
                                 const RippleTileRules& rules) {
  // The window leaves little of the border.
  const int border = size_px / 8, stride = size_px / 16;
  std::vector<double> values;
  for (int j = border; j < size_px - border; j += stride) {
    for (int i = border; i < size_px - border; i += stride) {
      values.push_back(
          step *
          static_cast<double>(map.disparity[Index(y + j) * Index(map.width_px) + Index(x + i)]));
    }
  }
  std::sort(values.begin(), values.end());
  const auto at = [&values](double share) {
    return values[static_cast<std::size_t>(share * static_cast<double>(values.size() - 1) + 0.5)];
  };
  // Where nothing is known of the unit, a range has none either.
  RippleTile tile{x, y, size_px, 0, rules.by_blur ? (at(0.9) - at(0.1)) / 0.8 : 0};
  tile.disparity =
      std::accumulate(values.begin(), values.end(), 0.0) / static_cast<double>(values.size());
  if (at(0.97) - at(0.03) > rules.range + rules.range_share * std::abs(tile.disparity))
    return std::nullopt;
  return tile;
}

// The powers of a tile, the channels together, each scaled to encoded values; empty if a value is
// clipped.
std::vector<double> PowersOf(const RipplePhoto& photo, const model::TransferCurve& transfer,
                             const RippleTile& tile, const std::vector<double>& window,
                             const std::vector<Frequency>& frequencies) {
  const model::LinearImage& image = photo.image;
  const int size = tile.size_px, channels = std::min(image.channels, 3);
  const auto clipped_light = static_cast<float>(transfer.Decode(kClippedLight));
  cv::Mat_<double> values(size, size, 0.0);
  for (int c = 0; c < channels; ++c) {
    double mean = 0, weights = 0;
    for (int j = 0; j < size; ++j) {
      for (int i = 0; i < size; ++i) {
        const float light = image.at(tile.x + i, tile.y + j, c);
        if (light >= clipped_light) return {};
        if (!photo.clipped.empty() &&
            photo.clipped[(Index(tile.y + j) * Index(image.width_px) + Index(tile.x + i)) *
                              Index(image.channels) +
                          Index(c)] != 0)
          return {};
        const double weight = window[Index(i)] * window[Index(j)];
        mean += weight * static_cast<double>(light);
        weights += weight;
      }
    }
    mean /= weights;
    const double light = std::clamp(mean, kDarkest, 1.0);
    constexpr double kStep = 1e-3;
    const double slope =
        (transfer.Encode(light * (1 + kStep)) - transfer.Encode(light * (1 - kStep))) /
        (2 * kStep * light * channels);
    for (int j = 0; j < size; ++j) {
      for (int i = 0; i < size; ++i) {
        values(j, i) += (static_cast<double>(image.at(tile.x + i, tile.y + j, c)) - mean) * slope *
                        window[Index(i)] * window[Index(j)];
      }
    }
  }
  cv::Mat_<std::complex<double>> spectrum;
  cv::dft(values, spectrum, cv::DFT_COMPLEX_OUTPUT);
  std::vector<double> powers;
  powers.reserve(frequencies.size());
  for (const Frequency& f : frequencies)
    powers.push_back(std::norm(spectrum((f.y + size) % size, f.x)));
  return powers;
}

// The standard deviations of the aperture along both axes, in view steps.
Eigen::Vector2d SigmaSteps(const Eigen::ArrayXXd& weights) {
  const auto along = [](const Eigen::ArrayXd& line) {
    double sum = 0, mean = 0, squares = 0;
    for (Eigen::Index i = 0; i < line.size(); ++i) {
      sum += line[i];
      mean += line[i] * static_cast<double>(i);
      squares += line[i] * static_cast<double>(i) * static_cast<double>(i);
    }
    mean /= sum;
    return std::sqrt(std::max(0.0, squares / sum - mean * mean));
  };
  return {along(weights.colwise().sum().transpose()), along(weights.rowwise().sum())};
}

}  // namespace

TileRipples::TileRipples(const RipplePhoto& photo, const model::TransferCurve& transfer,
                         const Eigen::ArrayXXd& weights, const RippleTileRules& rules,
                         double noise_sigma, int threads)
    : weights_(weights),
      by_blur_(rules.by_blur),
      width_of_image_px_(photo.image.width_px),
      height_of_image_px_(photo.image.height_px),
      threads_(threads) {
  const double step = photo.disparity.step.cwiseAbs().maxCoeff();
  if (!(step > 0)) return;
  step_ = photo.disparity.step.cwiseAbs() / step;
  width_ = std::sqrt(12.0) * SigmaSteps(weights).cwiseProduct(step_).maxCoeff();
  if (!(width_ > 0)) return;
  // Noise of the mean of the channels.
  noise_power_ = noise_sigma * noise_sigma / std::min(photo.image.channels, 3);
  for (std::size_t size = 0; size < kSizesPx.size(); ++size) {
    const Frequencies frequencies(kSizesPx[size]);
    levels_[size] = LevelsOf(frequencies);
    FindTiles(photo, transfer, rules, frequencies, noise_power_, threads);
  }
}

// Levels are as close as the tile distinguishes blurs.
std::vector<double> TileRipples::LevelsOf(const Frequencies& frequencies) const {
  constexpr double kMinStepPx = 0.15, kOfSquare = 0.2;
  std::vector<double> levels;
  const double most = frequencies.size_px / kMinWidths;
  for (double width = 0; width <= most;
       width += std::max(kMinStepPx, kOfSquare * width * width / frequencies.size_px)) {
    if (frequencies.Used(width / width_) < kMinFrequencies) break;
    levels.push_back(width / width_);
  }
  return levels;
}

void TileRipples::FindTiles(const RipplePhoto& photo, const model::TransferCurve& transfer,
                            const RippleTileRules& rules, const Frequencies& frequencies,
                            double noise_power, int threads) {
  const int size = frequencies.size_px, stride = size / 2;
  if (!rules.by_blur && size > kLargestUnstatedPx) return;
  const int across = (photo.image.width_px - size) / stride + 1;
  const int down = (photo.image.height_px - size) / stride + 1;
  if (photo.image.width_px < size || photo.image.height_px < size) return;
  // The disparities of the reduced photograph are those of the photograph, their px are not.
  const double step = photo.disparity.step.cwiseAbs().maxCoeff();
  struct Found {
    RippleTile tile;
    std::vector<double> powers;
  };
  std::vector<std::vector<Found>> rows(Index(down));
  ParallelFor(down, threads, [&](int row) {
    ThrowIfCancelled();
    for (int column = 0; column < across; ++column) {
      const auto tile = TileAt(photo.disparity, step, column * stride, row * stride, size, rules);
      if (!tile) continue;
      const double width = width_ * std::abs(tile->disparity);
      if (rules.by_blur && (width > size / kMinStatedWidths ||
                            (size > kSizesPx[0] && width < size / 2 / kWellResolved)))
        continue;
      const double most_texture = rules.by_blur
                                      ? std::clamp(kTextureLobes / std::max(1e-9, width),
                                                   kMinTextureFrequency, kTextureFrequency)
                                      : kTextureFrequency;
      std::vector<double> powers =
          PowersOf(photo, transfer, *tile, frequencies.window, frequencies.all);
      if (powers.empty()) continue;
      double texture = 0, count = 0;
      for (std::size_t i = 0; i < powers.size(); ++i) {
        if (frequencies.all[i].square > most_texture * size) break;
        texture += powers[i];
        count += 1;
      }
      if (texture > kMinTexture * noise_power * count)
        rows[Index(row)].push_back({*tile, std::move(powers)});
    }
  });
  std::vector<Found> found;
  for (auto& row : rows) {
    for (Found& tile : row) found.push_back(std::move(tile));
  }
  const std::size_t kept =
      std::min(found.size(), rules.by_blur ? kMaxTilesOfSize : kMaxUnstatedTiles);
  for (std::size_t i = 0; i < kept; ++i) {
    Found& tile = found[i * found.size() / kept];
    tiles_.push_back(tile.tile);
    powers_.push_back(std::move(tile.powers));
  }
}

void TileRipples::Look(RippleAperture aperture) {
  evidence_.assign(tiles_.size(), {});
  const Eigen::Vector2d sigma = SigmaSteps(weights_);
  for (std::size_t size = 0; size < kSizesPx.size(); ++size) {
    const Frequencies frequencies(kSizesPx[size]);
    const std::vector<double>& levels = levels_[size];
    if (levels.empty()) continue;
    // Only what the tiles need is computed.
    double least = std::numeric_limits<double>::infinity(), most = 0, range = 0;
    for (const RippleTile& tile : tiles_) {
      if (tile.size_px != kSizesPx[size]) continue;
      const auto [first, last] = LevelsAbout(tile, levels);
      least = std::min(least, levels[first]);
      most = std::max(most, levels[last]);
      range = std::max(range, tile.range);
    }
    if (!(least <= most)) continue;
    const double cell = kCellPx / width_;
    const Shapes shapes(aperture, frequencies, weights_, step_, sigma, cell, least - range / 2,
                        most + range / 2, threads_);
    const Shapes of_none(aperture, frequencies, weights_, step_, sigma, cell, 0, 0, threads_);
    const std::vector<double> none = of_none.At(0, 0);
    ParallelFor(static_cast<int>(tiles_.size()), threads_, [&](int i) {
      const RippleTile& tile = tiles_[Index(i)];
      if (tile.size_px != kSizesPx[size]) return;
      ThrowIfCancelled();
      const std::vector<double>& power = powers_[Index(i)];
      SmoothFit with(frequencies.all, power, noise_power_);
      SmoothFit without(frequencies.all, power, noise_power_);
      TileEvidence& evidence = evidence_[Index(i)];
      const auto [first, last] = LevelsAbout(tile, levels);
      evidence.first = first;
      // Where no disparity is stated, each is compared by the frequencies that it has.
      std::size_t used = frequencies.Used(kUsedShare * std::abs(tile.disparity)), used_before = 0;
      double null_cost = 0;
      // Each fit begins where the last one ended, the one of the widest band first.
      for (std::size_t level = evidence.first; level <= last; ++level) {
        if (!by_blur_) used = frequencies.Used(levels[level]);
        if (used != used_before) null_cost = without.Cost(none, used);
        used_before = used;
        evidence.of_level.push_back(null_cost -
                                    with.Cost(shapes.At(levels[level], tile.range), used));
      }
    });
  }
}

std::pair<std::size_t, std::size_t> TileRipples::LevelsAbout(
    const RippleTile& tile, const std::vector<double>& levels) const {
  std::size_t first = 0, last = levels.size() - 1;
  if (!by_blur_) return {first, last};
  const double stated = std::abs(tile.disparity), more = kMoreWidthPx / width_;
  while (last > 1 && levels[last - 1] > kMaxShare * stated + more) --last;
  while (first + 1 < last && levels[first + 1] < kMinShare * stated - more) ++first;
  return {first, last};
}

double TileRipples::Of(std::size_t tile, double disparity) const {
  const auto size = std::find(kSizesPx.begin(), kSizesPx.end(), tiles_[tile].size_px);
  const std::vector<double>& levels = levels_[static_cast<std::size_t>(size - kSizesPx.begin())];
  const TileEvidence& evidence = evidence_[tile];
  const std::size_t count = evidence.of_level.size();
  const double at = std::abs(disparity);
  if (count < 2 || !std::isfinite(at)) return 0;
  if (at <= levels[evidence.first]) return evidence.of_level.front();
  if (at >= levels[evidence.first + count - 1])
    return by_blur_ ? evidence.of_level.back() : std::min(0.0, evidence.of_level.back());
  const auto above =
      static_cast<std::size_t>(std::upper_bound(levels.begin(), levels.end(), at) - levels.begin());
  const double share = (at - levels[above - 1]) / (levels[above] - levels[above - 1]);
  const std::size_t below = above - 1 - evidence.first;
  return (1 - share) * evidence.of_level[below] + share * evidence.of_level[below + 1];
}

double TileRipples::largest() const {
  double largest = 0;
  for (std::size_t size = 0; size < kSizes; ++size) {
    const bool is_used = by_blur_ || kSizesPx[size] <= kLargestUnstatedPx;
    if (is_used && !levels_[size].empty()) largest = std::max(largest, levels_[size].back());
  }
  return largest;
}

int TileRipples::PartOf(std::size_t tile) const {
  const RippleTile& at = tiles_[tile];
  return (at.y + at.size_px / 2) * kPartsAlong / height_of_image_px_ * kPartsAlong +
         (at.x + at.size_px / 2) * kPartsAlong / width_of_image_px_;
}

}  // namespace thicklens::estimator
