#include "estimator/scene/photo_tiles.h"

#include <algorithm>
#include <cmath>
#include <complex>
#include <cstddef>
#include <limits>
#include <opencv2/core.hpp>

#include "estimator/scene/encoding_slope.h"
#include "thicklens/base/cancel.h"
#include "thicklens/base/index.h"
#include "thicklens/base/parallel.h"

namespace thicklens::estimator {
namespace {

constexpr double kPi = 3.14159265358979323846;
// Frequencies below are dominated by the tile's mean and the window.
constexpr double kMinRadius = 1.5;
// A tile shows one depth if its blur differs by no more than this, px and share.
constexpr double kBlurRangePx = 0.35, kBlurRangeShare = 0.25;
constexpr double kMaxClippedShare = 0.01;  // of the pixels of a tile
// A tile whose views are so far apart that fewer bins represent the aperture shows nothing of it.
constexpr int kMinBins = 9;
// Power of a tile over that of the noise, averaged over its lower rings, above which it has
// texture.
constexpr double kMinTexture = 6;
constexpr int kTextureRings = 6;
// Samples of an aperture `d` px apart represent frequencies up to about 1/(2 d); beyond, a sampled
// and a continuous aperture differ.
constexpr double kMaxOfSampling = 0.55;

// Returns the bin of a frequency of the half plane, or -1.
int BinOf(int kx, int ky) {
  const double radius = std::hypot(kx, ky);
  const int ring = static_cast<int>(std::floor(radius - kMinRadius));
  if (radius < kMinRadius || ring >= kTileRings) return -1;
  const double angle = std::atan2(std::abs(ky), std::abs(kx));
  const int sector = angle < kPi / 10 ? 0 : angle > kPi / 2 - kPi / 10 ? 1 : 2;
  return sector * kTileRings + ring;
}

template <typename Use>
void ForFrequencies(const Use& use) {
  for (int ky = -kTilePx / 2 + 1; ky < kTilePx / 2; ++ky) {
    for (int kx = 0; kx < kTilePx / 2; ++kx) {
      if (kx == 0 && ky <= 0) continue;
      const int bin = BinOf(kx, ky);
      if (bin >= 0) use(kx, ky, Index(bin));
    }
  }
}

const std::vector<double>& Window() {
  static const std::vector<double> window = [] {
    std::vector<double> line(kTilePx);
    double squares = 0;
    for (int i = 0; i < kTilePx; ++i) {
      line[Index(i)] = 0.5 - 0.5 * std::cos(2 * kPi * (i + 0.5) / kTilePx);
      squares += line[Index(i)] * line[Index(i)];
    }
    for (double& value : line) value /= std::sqrt(squares);  // white noise keeps its variance
    return line;
  }();
  return window;
}

}  // namespace

const std::array<TileBin, kTileBins>& TileBinsOf() {
  static const std::array<TileBin, kTileBins> bins = [] {
    std::array<TileBin, kTileBins> all{};
    ForFrequencies([&](int kx, int ky, std::size_t bin) {
      all[bin].count += 1;
      all[bin].radius += std::hypot(kx, ky);
    });
    for (TileBin& bin : all) {
      if (bin.count > 0) bin.radius /= bin.count;
    }
    return all;
  }();
  return bins;
}

double RmsOf(const TileDisparity& disparity) {
  double sum = 0;
  for (const double value : disparity) sum += value * value;
  return std::sqrt(sum / kTileDisparities);
}

std::optional<TileDisparity> DisparityOfTile(const DisparityMap& map, int x, int y, double spread) {
  std::vector<float> values;
  values.reserve(Index(kTilePx) * Index(kTilePx) / 4);
  // The window leaves little of the border.
  constexpr int kBorder = 4;
  for (int j = kBorder; j < kTilePx - kBorder; j += 2) {
    const auto row = map.disparity.begin() +
                     static_cast<std::ptrdiff_t>(Index(y + j) * Index(map.width_px) + Index(x));
    for (int i = kBorder; i < kTilePx - kBorder; i += 2) values.push_back(row[i]);
  }
  std::sort(values.begin(), values.end());
  const auto at = [&values](double share) {
    return static_cast<double>(
        values[static_cast<std::size_t>(share * static_cast<double>(values.size() - 1) + 0.5)]);
  };
  TileDisparity parts{};
  for (int i = 0; i < kTileDisparities; ++i) parts[Index(i)] = at((i + 0.5) / kTileDisparities);
  const double range_px = (at(0.95) - at(0.05)) * spread;
  if (range_px > kBlurRangePx + kBlurRangeShare * RmsOf(parts) * spread) return std::nullopt;
  return parts;
}

std::vector<PhotoTile> TilesOf(const model::LinearImage& grey, const DisparityMap& map,
                               const model::TransferCurve& transfer, double noise_sigma,
                               double spread, int stride_px, int threads) {
  const int across = (grey.width_px - kTilePx) / stride_px + 1;
  const int down = (grey.height_px - kTilePx) / stride_px + 1;
  if (grey.width_px < kTilePx || grey.height_px < kTilePx) return {};
  std::vector<std::vector<PhotoTile>> rows(Index(down));
  const double largest_step = map.step.cwiseAbs().maxCoeff();
  const double clipped_light = transfer.Decode(kClippedValue);
  const std::vector<double>& window = Window();
  ParallelFor(down, threads, [&](int row) {
    ThrowIfCancelled();
    cv::Mat_<double> values(kTilePx, kTilePx);
    cv::Mat_<std::complex<double>> spectrum;
    for (int column = 0; column < across; ++column) {
      PhotoTile tile;
      tile.x = column * stride_px;
      tile.y = row * stride_px;
      const std::optional<TileDisparity> disparity = DisparityOfTile(map, tile.x, tile.y, spread);
      if (!disparity) continue;
      tile.disparity = *disparity;
      double mean = 0, weights = 0;
      int clipped = 0;
      for (int j = 0; j < kTilePx; ++j) {
        for (int i = 0; i < kTilePx; ++i) {
          const double light = static_cast<double>(grey.at(tile.x + i, tile.y + j, 0));
          values(j, i) = light;
          const double weight = window[Index(i)] * window[Index(j)];
          mean += weight * light;
          weights += weight;
          if (light >= clipped_light) ++clipped;
        }
      }
      if (clipped > kMaxClippedShare * kTilePx * kTilePx) continue;
      mean /= weights;
      const double light = std::clamp(mean, transfer.Decode(kDarkest), 1.0);
      constexpr double kStep = 1e-3;
      const double slope =
          (transfer.Encode(light * (1 + kStep)) - transfer.Encode(light * (1 - kStep))) /
          (2 * kStep * light);
      for (int j = 0; j < kTilePx; ++j) {
        for (int i = 0; i < kTilePx; ++i) {
          values(j, i) = (values(j, i) - mean) * slope * window[Index(i)] * window[Index(j)];
        }
      }
      cv::dft(values, spectrum, cv::DFT_COMPLEX_OUTPUT);
      ForFrequencies([&](int kx, int ky, std::size_t bin) {
        tile.power[bin] += std::norm(spectrum((ky + kTilePx) % kTilePx, kx));
      });
      const auto& bins = TileBinsOf();
      const double most_radius =
          kMaxOfSampling * kTilePx / std::max(1e-9, RmsOf(tile.disparity) * largest_step);
      double texture = 0, count = 0;
      for (std::size_t bin = 0; bin < kTileBins; ++bin) {
        tile.is_used[bin] = bins[bin].count > 0 && bins[bin].radius <= most_radius;
        if (static_cast<int>(bin) % kTileRings < kTextureRings) {
          texture += tile.power[bin];
          count += bins[bin].count;
        }
        if (bins[bin].count > 0) tile.power[bin] /= bins[bin].count;
      }
      if (std::count(tile.is_used.begin(), tile.is_used.end(), true) < kMinBins) continue;
      if (texture / count > kMinTexture * noise_sigma * noise_sigma)
        rows[Index(row)].push_back(tile);
    }
  });
  std::vector<PhotoTile> tiles;
  for (const auto& row : rows) tiles.insert(tiles.end(), row.begin(), row.end());
  return tiles;
}

namespace {

// Content that a common blur leaves less of than exp(-this) is left out.
constexpr double kNothingLeft = 30;

// Returns the standard deviation of the positions on an axis, in view steps.
double StepsOf(const Eigen::ArrayXd& weights) {
  double sum = 0;
  for (Eigen::Index k = 0; k < weights.size(); ++k) {
    const double offset = static_cast<double>(k) - static_cast<double>(weights.size() - 1) / 2;
    sum += weights[k] * offset * offset;
  }
  return std::sqrt(sum);
}

}  // namespace

ExpectedSpectra::ExpectedSpectra(Aperture aperture, const Eigen::ArrayXXd& weights,
                                 const Eigen::Vector2d& step, double largest, int threads) {
  constexpr double kCellPx = 0.06;
  const double largest_step = std::max(1e-12, step.cwiseAbs().maxCoeff());
  cell_ = kCellPx / largest_step;
  table_.resize(Index(static_cast<int>(std::ceil(largest / cell_)) + 2));
  const auto u_count = static_cast<int>(weights.cols()), v_count = static_cast<int>(weights.rows());
  const auto& bins = TileBinsOf();
  constexpr int kHalf = kTilePx / 2, kWide = kTilePx + 1;
  using Plane = std::array<double, kWide * kWide>;
  const Eigen::Vector2d sigma_steps(StepsOf(weights.colwise().sum().transpose()),
                                    StepsOf(weights.rowwise().sum()));
  // The radiance before sampling: the pixels repeat what lies beyond their frequencies.
  const auto content = [](int kx, int ky, double decay, double exponent) {
    double sum = 0;
    for (int j = -1; j <= 1; ++j) {
      for (int i = -1; i <= 1; ++i) {
        const double x = kx + i * kTilePx, y = ky + j * kTilePx;
        const double squared = std::max(1.0, x * x + y * y);
        if (decay * squared < kNothingLeft)
          sum += std::pow(squared, -exponent / 2) * std::exp(-decay * squared);
      }
    }
    return sum;
  };
  std::vector<std::array<Plane, kExponents.size()>> contents(kCommonBlursPx.size());
  const auto at = [](int kx, int ky) { return Index((ky + kHalf) * kWide + kx + kHalf); };
  for (std::size_t blur = 0; blur < kCommonBlursPx.size(); ++blur) {
    const double decay = std::pow(2 * kPi * kCommonBlursPx[blur] / kTilePx, 2);
    for (std::size_t exponent = 0; exponent < kExponents.size(); ++exponent) {
      for (int ky = -kHalf; ky <= kHalf; ++ky) {
        for (int kx = -kHalf; kx <= kHalf; ++kx)
          contents[blur][exponent][at(kx, ky)] = content(kx, ky, decay, kExponents[exponent]);
      }
    }
  }
  ParallelFor(static_cast<int>(table_.size()), threads, [&](int cell) {
    const double disparity = cell * cell_;
    Plane transfer{}, product{}, across{};
    for (int kx = -kHalf; kx <= kHalf; ++kx) {
      std::vector<std::complex<double>> rows(Index(v_count));
      for (int k = 0; k < u_count; ++k) {
        const auto phase = std::polar(
            1.0, 2 * kPi * kx / kTilePx * disparity * step.x() * (k - (u_count - 1) / 2.0));
        for (int l = 0; l < v_count; ++l) rows[Index(l)] += weights(l, k) * phase;
      }
      for (int ky = -kHalf; ky <= kHalf; ++ky) {
        std::complex<double> sum = 0;
        for (int l = 0; l < v_count; ++l) {
          sum += rows[Index(l)] * std::polar(1.0, 2 * kPi * ky / kTilePx * disparity * step.y() *
                                                      (l - (v_count - 1) / 2.0));
        }
        transfer[at(kx, ky)] = aperture == Aperture::kSampled
                                   ? std::norm(sum)
                                   : std::exp(-std::pow(2 * kPi / kTilePx * disparity, 2) *
                                              (std::pow(kx * step.x() * sigma_steps.x(), 2) +
                                               std::pow(ky * step.y() * sigma_steps.y(), 2)));
      }
    }
    for (std::size_t blur = 0; blur < kCommonBlursPx.size(); ++blur) {
      for (std::size_t exponent = 0; exponent < kExponents.size(); ++exponent) {
        for (std::size_t i = 0; i < product.size(); ++i)
          product[i] = transfer[i] * contents[blur][exponent][i];
        product[at(0, 0)] *= 0.25;  // the mean of a tile is subtracted
        // A Hann window spreads a power over its neighbours, a sixth to each side.
        const auto spread = [](double a, double b, double c) { return b * 2 / 3 + (a + c) / 6; };
        for (int ky = -kHalf; ky <= kHalf; ++ky) {
          for (int kx = -1; kx < kHalf; ++kx) {
            across[at(kx, ky)] =
                spread(product[at(kx - 1, ky)], product[at(kx, ky)], product[at(kx + 1, ky)]);
          }
        }
        Bins& shape = table_[Index(cell)][blur][exponent];
        ForFrequencies([&](int kx, int ky, std::size_t bin) {
          shape[bin] += spread(across[at(kx, ky - 1)], across[at(kx, ky)], across[at(kx, ky + 1)]);
        });
        for (std::size_t bin = 0; bin < kTileBins; ++bin) {
          if (bins[bin].count > 0) shape[bin] /= bins[bin].count;
        }
      }
    }
  });
}

ExpectedSpectra::Shapes ExpectedSpectra::At(const TileDisparity& disparity, double share) const {
  Shapes shapes{};
  for (const double part : disparity) {
    const double at =
        std::min(share * std::abs(part) / cell_, static_cast<double>(table_.size()) - 1.001);
    const auto cell = static_cast<std::size_t>(at);
    const double above = (at - static_cast<double>(cell)) / kTileDisparities;
    const double below = 1.0 / kTileDisparities - above;
    for (std::size_t blur = 0; blur < kCommonBlursPx.size(); ++blur) {
      for (std::size_t exponent = 0; exponent < kExponents.size(); ++exponent) {
        Bins& shape = shapes[blur][exponent];
        const Bins& first = table_[cell][blur][exponent];
        const Bins& second = table_[cell + 1][blur][exponent];
        for (std::size_t bin = 0; bin < kTileBins; ++bin)
          shape[bin] += first[bin] * below + second[bin] * above;
      }
    }
  }
  return shapes;
}

namespace {

// How usual the exponents are: those of photographs are near 2.
constexpr double kUsualExponent = 2.2, kExponentSpread = 1;
constexpr std::array<double, 3> kNoiseShares = {1.1, 0.45, 0.1};
// Neighbouring frequencies of a windowed tile are correlated: so many of them count as one.
constexpr double kFrequenciesPerDegree = 2;
constexpr int kAmplitudeSteps = 4;

// Minimises over A >= 0 the sum of n (P/m + ln m), m = A g + noise, of one sector. Returns the sum.
double FitAmplitude(const double* power, const double* shape, const double* count, int bins,
                    double noise) {
  double pg = 0, gg = 1e-300;
  for (int i = 0; i < bins; ++i) {
    pg += count[i] * std::max(0.0, power[i] - noise) * shape[i];
    gg += count[i] * shape[i] * shape[i];
  }
  double amplitude = std::max(pg / gg, 1e-12);
  for (int step = 0; step < kAmplitudeSteps; ++step) {
    double up = 0, down = 1e-300;
    for (int i = 0; i < bins; ++i) {
      const double inverse = 1 / (amplitude * shape[i] + noise);
      const double weight = count[i] * shape[i] * inverse;
      up += weight * power[i] * inverse;
      down += weight;
    }
    amplitude *= up / down;
  }
  double sum = 0;
  for (int i = 0; i < bins; ++i) {
    const double expected = amplitude * shape[i] + noise;
    sum += count[i] * (power[i] / expected + std::log(expected));
  }
  return sum;
}

}  // namespace

TileFit FitTile(const PhotoTile& tile, const ExpectedSpectra::Shapes& shapes, double noise_power) {
  const auto& bins = TileBinsOf();
  TileFit fit;
  fit.cost.fill(std::numeric_limits<double>::infinity());
  std::array<double, kTileBins> power{}, count{}, shape{};
  std::array<std::size_t, kTileBins> from_bin{};
  std::array<int, kTileSectors + 1> begin{};
  int used = 0;
  double degrees = 0, least = 0;
  for (int sector = 0; sector < kTileSectors; ++sector) {
    begin[Index(sector)] = used;
    for (int ring = 0; ring < kTileRings; ++ring) {
      const std::size_t bin = Index(sector * kTileRings + ring);
      if (!tile.is_used[bin]) continue;
      power[Index(used)] = tile.power[bin];
      count[Index(used)] = bins[bin].count / kFrequenciesPerDegree;
      from_bin[Index(used)] = bin;
      degrees += 1;
      least += count[Index(used)] * (1 + std::log(std::max(tile.power[bin], 1e-30)));
      ++used;
    }
  }
  begin[kTileSectors] = used;
  for (std::size_t blur = 0; blur < kCommonBlursPx.size(); ++blur) {
    for (std::size_t exponent = 0; exponent < kExponents.size(); ++exponent) {
      for (std::size_t i = 0; i < Index(used); ++i) shape[i] = shapes[blur][exponent][from_bin[i]];
      const double off = (kExponents[exponent] - kUsualExponent) / kExponentSpread;
      for (const double share : kNoiseShares) {
        double cost = off * off / 2;
        for (int sector = 0; sector < kTileSectors; ++sector) {
          const int from = begin[Index(sector)];
          cost += FitAmplitude(&power[Index(from)], &shape[Index(from)], &count[Index(from)],
                               begin[Index(sector) + 1] - from, share * noise_power);
        }
        fit.cost[blur] = std::min(fit.cost[blur], cost);
      }
    }
  }
  const double best = *std::min_element(fit.cost.begin(), fit.cost.end());
  fit.overdispersion = std::max(1.0, 2 * (best - least) / std::max(1.0, degrees - 5));
  return fit;
}

}  // namespace thicklens::estimator
