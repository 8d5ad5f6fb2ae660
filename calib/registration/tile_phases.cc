#include "calib/registration/tile_phases.h"

#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <opencv2/core.hpp>

#include "thicklens/base/pi.h"

namespace thicklens::calib {
namespace {

// Below this limit a slope of the illumination has an effect; above the next one the interpolation
// has.
constexpr double kLowestCyclesPerTile = 2.2;
constexpr double kHighestFrequency = 0.2;  // cycles per px
constexpr double kMinCoherence = 0.1;      // minimum coherence of a frequency that counts
constexpr double kBlurCoherence = 0.2;  // minimum coherence of a frequency that determines the blur
// Variance of a phase, rad^2, in addition to the part that follows from the coherence.
constexpr double kPhaseVariance = 1e-3;
// Part of the power of agreeing frequencies that the window and the interpolation leave open.
constexpr double kAgreementError = 1e-3;
// Frequencies count for the blur up to this value of 2 pi^2 sigma^2 k^2, where sigma is the blur
// that the smoother image got.
constexpr double kLargestExponent = 1.5;
constexpr int kMinRings = 4;
// All of the frequencies contain what the window cut off, where a tile has fewer.
constexpr int kMinBlurFrequencies = 24;
constexpr int kBlurRounds = 4;
constexpr double kMaxLogRatio = 5;           // of the amplitudes in a tile
constexpr double kMinTileCondition = 1e-10;  // of the normal equations of a tile's blur
constexpr float kLargestSine = 0.9F;         // sine of the remaining phase
constexpr int kMinFrequencies = 12;
// Maximum radii of the first rounds, in cycles per px. Their phases are small.
constexpr float kFirstRounds[] = {0.06F, 0.12F, 0.24F};

// The frequencies of a transform share their noise, and the amplitude of the texture, through the
// Hann window: by 2/3 with the next ones along an axis and by 1/6 with those behind them. The
// variance of a sum over them is (1 + 2 (4/9 + 1/36))^2 times that of independent ones.
constexpr double kSharedByNeighbours = 3.780;

}  // namespace

struct TilePhases::Turns {
  std::vector<float> column_cosine, column_sine, row_cosine, row_sine;

  Turns(int size, const Eigen::Vector2d& shift_px) {
    for (int i = 0; i < size; ++i) {
      const double k = 2 * kPi * (i <= size / 2 ? i : i - size) / size;
      column_cosine.push_back(static_cast<float>(std::cos(k * shift_px.x())));
      column_sine.push_back(static_cast<float>(std::sin(k * shift_px.x())));
      row_cosine.push_back(static_cast<float>(std::cos(k * shift_px.y())));
      row_sine.push_back(static_cast<float>(std::sin(k * shift_px.y())));
    }
  }

  // The cross-spectrum with the shift removed.
  void At(const Frequency& k, const Bin& bin, float* real, float* imaginary) const {
    const auto i = static_cast<std::size_t>(k.column), j = static_cast<std::size_t>(k.row);
    const float c = column_cosine[i] * row_cosine[j] - column_sine[i] * row_sine[j];
    const float s = column_cosine[i] * row_sine[j] + column_sine[i] * row_cosine[j];
    *real = bin.real * c - bin.imaginary * s;
    *imaginary = bin.real * s + bin.imaginary * c;
  }
};

double TilePhases::Ring::Coherence() const {
  if (!(cross > 0)) return 0;
  return std::min(1.0, cross * cross / std::max(frame * reference, 1e-300));
}

TilePhases::TilePhases(int size_px) : size_px_(size_px) {
  double sum = 0;
  for (int i = 0; i < size_px; ++i) {
    const double t = (i + 0.5) / size_px - 0.5;
    const double w = std::pow(std::cos(kPi * t), 2);
    window_.push_back(static_cast<float>(w));
    sum += w * w;
    weight_variance_px2_ += std::pow(t * size_px, 2) * w * w;
  }
  weight_variance_px2_ /= sum;
  for (int row = 0; row < size_px; ++row) {
    const int j = row <= size_px / 2 ? row : row - size_px;
    for (int column = 0; column <= size_px / 2; ++column) {
      if (column == 0 && j < 0) continue;  // the other half of the plane
      const double radius = std::hypot(column, j);
      if (!(radius >= kLowestCyclesPerTile) || !(radius <= kHighestFrequency * size_px)) continue;
      frequencies_.push_back({row, column, static_cast<int>(radius),
                              static_cast<float>(column) / static_cast<float>(size_px),
                              static_cast<float>(j) / static_cast<float>(size_px)});
    }
  }
  std::stable_sort(frequencies_.begin(), frequencies_.end(),
                   [](const Frequency& a, const Frequency& b) { return a.ring < b.ring; });
}

void TilePhases::Add(const cv::Mat& reference, const cv::Mat& frame, cv::Point corner) {
  const auto size = static_cast<std::size_t>(size_px_);
  float mean_r = 0, mean_f = 0, total = 0;
  for (int y = 0; y < size_px_; ++y) {
    const float* r = reference.ptr<float>(corner.y + y) + corner.x;
    const float* f = frame.ptr<float>(corner.y + y) + corner.x;
    float row_r = 0, row_f = 0;
    for (std::size_t x = 0; x < size; ++x) {
      row_r += window_[x] * r[x];
      row_f += window_[x] * f[x];
    }
    const float w = window_[static_cast<std::size_t>(y)];
    mean_r += w * row_r;
    mean_f += w * row_f;
    total += w;
  }
  mean_r /= total * total;
  mean_f /= total * total;
  // One complex transform serves both images: the reference is its real part, the frame its
  // imaginary part.
  cv::Mat both(size_px_, size_px_, CV_32FC2);
  for (int y = 0; y < size_px_; ++y) {
    const float* r = reference.ptr<float>(corner.y + y) + corner.x;
    const float* f = frame.ptr<float>(corner.y + y) + corner.x;
    auto* out = both.ptr<cv::Vec2f>(y);
    const float wy = window_[static_cast<std::size_t>(y)];
    for (std::size_t x = 0; x < size; ++x) {
      const float w = wy * window_[x];
      out[x] = cv::Vec2f(w * (r[x] - mean_r), w * (f[x] - mean_f));
    }
  }
  cv::dft(both, both);
  Tile tile;
  tile.shift.centre_px =
      Eigen::Vector2d(corner.x + 0.5 * (size_px_ - 1), corner.y + 0.5 * (size_px_ - 1));
  tile.bins.reserve(frequencies_.size());
  for (const Frequency& k : frequencies_) {
    // R(k) = (Z(k) + conj Z(-k))/2, F(k) = (Z(k) - conj Z(-k))/(2 i).
    const cv::Vec2f& a = both.at<cv::Vec2f>(k.row, k.column);
    const cv::Vec2f& b =
        both.at<cv::Vec2f>((size_px_ - k.row) % size_px_, (size_px_ - k.column) % size_px_);
    const float r_real = 0.5F * (a[0] + b[0]), r_imaginary = 0.5F * (a[1] - b[1]);
    const float f_real = 0.5F * (a[1] + b[1]), f_imaginary = 0.5F * (b[0] - a[0]);
    const float reference_power = r_real * r_real + r_imaginary * r_imaginary;
    const float frame_power = f_real * f_real + f_imaginary * f_imaginary;
    const float modulus = std::sqrt(reference_power * frame_power) + 1e-30F;
    tile.bins.push_back({(f_real * r_real + f_imaginary * r_imaginary) / modulus,
                         (f_imaginary * r_real - f_real * r_imaginary) / modulus, frame_power,
                         reference_power, modulus});
  }
  tiles_.push_back(std::move(tile));
}

// One Gauss-Newton step of phase = -2 pi k.shift over the first `count` frequencies.
void TilePhases::Step(std::size_t count, Tile* tile) const {
  const Turns turns(size_px_, tile->shift.shift_px);
  float x = 0, y = 0, xx = 0, xy = 0, yy = 0, chi2 = 0;
  int used = 0;
  for (std::size_t i = 0; i < count; ++i) {
    const Frequency& k = frequencies_[i];
    const Bin& bin = tile->bins[i];
    if (!(bin.weight > 0)) continue;
    float real = 0, sine = 0;
    turns.At(k, bin, &real, &sine);
    if (!(real > 0) || !(std::abs(sine) < kLargestSine)) continue;
    const float left = -sine * (1 + sine * sine / 6);  // -asin, to third order
    const float wx = bin.weight * k.x, wy = bin.weight * k.y;
    xx += wx * k.x;
    xy += wx * k.y;
    yy += wy * k.y;
    x += wx * left;
    y += wy * left;
    chi2 += bin.weight * left * left;
    ++used;
  }
  tile->shift.information.setZero();
  if (used < kMinFrequencies) return;
  Eigen::Matrix2d information;
  information << static_cast<double>(xx), static_cast<double>(xy), static_cast<double>(xy),
      static_cast<double>(yy);
  information *= 4 * kPi * kPi;
  const Eigen::Vector2d right(2 * kPi * static_cast<double>(x), 2 * kPi * static_cast<double>(y));
  // The ridge keeps a direction without information unchanged.
  const Eigen::Matrix2d ridge = 1e-6 * (information.trace() + 1e-30) * Eigen::Matrix2d::Identity();
  tile->shift.shift_px += (information + ridge).inverse() * right;
  tile->shift.information = information / std::max(static_cast<double>(chi2) / (used - 2), 1e-6);
}

void TilePhases::SumRings() {
  rings_.assign(static_cast<std::size_t>(size_px_), Ring());
  for (const Tile& tile : tiles_) {
    const Turns turns(size_px_, tile.shift.shift_px);
    for (std::size_t i = 0; i < frequencies_.size(); ++i) {
      const Bin& bin = tile.bins[i];
      Ring& ring = rings_[static_cast<std::size_t>(frequencies_[i].ring)];
      float real = 0, sine = 0;
      turns.At(frequencies_[i], bin, &real, &sine);
      ring.count += 1;
      ring.cross += static_cast<double>(real * std::sqrt(bin.frame * bin.reference));
      ring.frame += static_cast<double>(bin.frame);
      ring.reference += static_cast<double>(bin.reference);
    }
  }
}

// For two spectra of coherence c^2, one of which is a filtered copy of the other with noise, a
// phase has the variance (1/c^2 - 1)/2 times the mean power over the power of the bin (derived here
// [D60]; small variances).
void TilePhases::WeightByErrors(Tile* tile) const {
  for (std::size_t i = 0; i < frequencies_.size(); ++i) {
    const Ring& ring = rings_[static_cast<std::size_t>(frequencies_[i].ring)];
    Bin& bin = tile->bins[i];
    const double coherence = ring.Coherence();
    bin.weight = 0;
    if (!(coherence > kMinCoherence)) continue;
    const double mean = std::sqrt(ring.frame * ring.reference) / ring.count;
    const double own =
        std::sqrt(static_cast<double>(bin.frame) * static_cast<double>(bin.reference));
    const double variance = 0.5 * (1 / coherence - 1) * mean / std::max(own, 1e-30);
    if (variance < 1) bin.weight = static_cast<float>(1 / (variance + kPhaseVariance));
  }
}

void TilePhases::Summarise() {
  double cross = 0, frame = 0, reference = 0;
  // ln |H| = -2 pi^2 V k^2 [D61], over the frequencies that agree well. The part of F that comes
  // from R is R H, so that noise and the parts that the window cut off do not count.
  double w = 0, wx = 0, wy = 0, wxx = 0, wxy = 0, wz = 0, wxz = 0;
  int count = 0;
  for (std::size_t i = 0; i < rings_.size(); ++i) {
    const Ring& ring = rings_[i];
    if (!(ring.count > 0)) continue;
    const double coherence = ring.Coherence();
    if (coherence > kBlurCoherence) {
      const double k = (static_cast<double>(i) + 0.5) / size_px_;
      const double weight = ring.count * coherence / (1.02 - coherence);
      const double x = -2 * kPi * kPi * k * k;
      const double y = std::log(ring.cross / ring.reference);
      const double z = std::log(ring.frame / ring.cross);
      w += weight;
      wx += weight * x;
      wy += weight * y;
      wz += weight * z;
      wxx += weight * x * x;
      wxy += weight * x * y;
      wxz += weight * x * z;
      ++count;
    }
    if (!(coherence > kMinCoherence)) continue;
    cross += ring.cross;
    frame += ring.frame;
    reference += ring.reference;
  }
  agreement_ = frame > 0 ? cross / std::sqrt(frame * reference) : 0;
  added_variance_px2_.reset();
  if (count < 2) return;
  const double xx = wxx - wx * wx / w;
  const double from_reference = (wxy - wx * wy / w) / xx;
  const double from_frame = (wxz - wx * wz / w) / xx;
  added_variance_px2_ = from_reference + from_frame > 0 ? from_reference : from_frame;
}

// Gauss-Newton for F = g exp(-2 pi^2 k.V k) R over the frequencies of a tile that agree, in ln g
// and V. The noise of a ring is what does not agree there.
std::vector<TileBlur> TilePhases::Blurs(double blur_px2) const {
  // The image that was blurred has less noise; its spectrum is the one that is divided by.
  const bool reference_is_smoother = blur_px2 >= 0;
  struct Entry {
    Eigen::Vector4d terms;
    double smooth, cross, other, weight;
  };
  std::vector<TileBlur> blurs;
  for (const Tile& tile : tiles_) {
    const Turns turns(size_px_, tile.shift.shift_px);
    std::vector<Entry> entries;
    for (std::size_t i = 0; i < frequencies_.size(); ++i) {
      const Frequency& k = frequencies_[i];
      const Bin& bin = tile.bins[i];
      const Ring& ring = rings_[static_cast<std::size_t>(k.ring)];
      const double coherence = ring.Coherence();
      const double x = static_cast<double>(k.x), y = static_cast<double>(k.y);
      if (!(coherence > kBlurCoherence) ||
          !(2 * kPi * kPi * std::abs(blur_px2) * (x * x + y * y) < kLargestExponent))
        continue;
      float real = 0, sine = 0;
      turns.At(k, bin, &real, &sine);
      const auto of_reference = static_cast<double>(bin.reference);
      const auto of_frame = static_cast<double>(bin.frame);
      const double power = (reference_is_smoother ? ring.frame : ring.reference) / ring.count;
      entries.push_back(
          {{1, -2 * kPi * kPi * x * x, -2 * kPi * kPi * y * y, -4 * kPi * kPi * x * y},
           reference_is_smoother ? of_reference : of_frame,
           static_cast<double>(real) * std::sqrt(of_frame * of_reference),
           reference_is_smoother ? of_frame : of_reference,
           1 / (power * (1 - coherence + kAgreementError))});
    }
    const auto used = static_cast<int>(entries.size());
    if (used < kMinBlurFrequencies) continue;
    Eigen::Vector4d solution = Eigen::Vector4d::Zero();
    Eigen::Matrix4d inverse;
    double squares = 0;
    bool is_defined = true;
    for (int round = 0; round < kBlurRounds && is_defined; ++round) {
      Eigen::Matrix4d normal = Eigen::Matrix4d::Zero();
      Eigen::Vector4d right = Eigen::Vector4d::Zero();
      squares = 0;
      for (const Entry& e : entries) {
        const double ratio =
            std::exp(std::clamp(e.terms.dot(solution), -kMaxLogRatio, kMaxLogRatio));
        normal += e.weight * e.smooth * ratio * ratio * e.terms * e.terms.transpose();
        right += e.weight * ratio * (e.cross - ratio * e.smooth) * e.terms;
        squares += e.weight * (e.other - 2 * ratio * e.cross + ratio * ratio * e.smooth);
      }
      const Eigen::SelfAdjointEigenSolver<Eigen::Matrix4d> eigen(normal);
      const Eigen::Vector4d values = eigen.eigenvalues();
      is_defined = values[0] > kMinTileCondition * values[3];
      if (!is_defined) break;
      inverse = eigen.eigenvectors() * values.cwiseInverse().asDiagonal() *
                eigen.eigenvectors().transpose();
      solution += inverse * right;
    }
    if (!is_defined || !solution.allFinite()) continue;
    // Half of the power that is left belongs to the phases.
    const double variance = std::max(1e-6, 0.5 * squares / (used - 4)) * kSharedByNeighbours;
    TileBlur blur;
    blur.centre_px = tile.shift.centre_px;
    blur.added_px2 = (reference_is_smoother ? 1 : -1) * solution.tail<3>();
    blur.information = (variance * inverse.bottomRightCorner<3, 3>()).inverse();
    if (blur.information.allFinite()) blurs.push_back(blur);
  }
  return blurs;
}

TexturePower TilePhases::PowerOfTexture(double blur_px2) const {
  const double blur_of_reference_px2 = std::max(0.0, blur_px2);
  TexturePower power;
  double all = 0, w = 0, wx = 0, wy = 0, wxx = 0, wxy = 0;
  int count = 0;
  for (std::size_t i = 0; i < rings_.size(); ++i) {
    const Ring& ring = rings_[i];
    if (!(ring.count > 0)) continue;
    const double coherence = ring.Coherence();
    if (!(coherence > kMinCoherence)) continue;
    const double variance = 0.5 * (1 / coherence - 1);
    if (!(variance < 1)) continue;
    const double k = (static_cast<double>(i) + 0.5) / size_px_;
    const double weight = ring.count * k * k / (variance + kPhaseVariance);
    const double x = std::log(k);
    all += weight;
    power.log_frequency += weight * x;
    const double exponent = 2 * kPi * kPi * blur_of_reference_px2 * k * k;
    if (!(exponent < kLargestExponent)) continue;
    const double y = std::log(ring.reference / ring.count) + 2 * exponent;
    w += weight;
    wx += weight * x;
    wy += weight * y;
    wxx += weight * x * x;
    wxy += weight * x * y;
    ++count;
  }
  if (all > 0) power.log_frequency /= all;
  if (count >= kMinRings) power.exponent = {{(wxy - wx * wy / w) / (wxx - wx * wx / w), wx / w}};
  return power;
}

double TilePhases::ExpectedInformation(
    const std::function<Powers(double frequency)>& powers) const {
  double sum = 0, weighted_variance = 0;
  int used = 0;
  for (const Frequency& k : frequencies_) {
    const double square = static_cast<double>(k.x) * static_cast<double>(k.x) +
                          static_cast<double>(k.y) * static_cast<double>(k.y);
    const Powers p = powers(std::sqrt(square));
    const double coherence =
        p.texture * p.texture / ((p.texture + p.frame_noise) * (p.texture + p.reference_noise));
    if (!(coherence > kMinCoherence)) continue;
    const double variance = 0.5 * (1 / coherence - 1);
    if (!(variance < 1)) continue;
    const double weight = 1 / (variance + kPhaseVariance);
    sum += weight * square / 2;  // along one axis
    weighted_variance += weight * variance;
    ++used;
  }
  if (used < kMinFrequencies) return 0;
  // The errors of the shifts are those of the phases, not those that the weights assume.
  return 4 * kPi * kPi * sum / std::max(weighted_variance / used, 1e-6) / kSharedByNeighbours;
}

std::vector<TileShift> TilePhases::Solve() {
  for (Tile& tile : tiles_) {
    for (const float limit : kFirstRounds) {
      std::size_t count = 0;
      while (count < frequencies_.size() &&
             static_cast<float>(frequencies_[count].ring) < limit * static_cast<float>(size_px_))
        ++count;
      Step(count, &tile);
    }
  }
  for (int round = 0; round < 2; ++round) {
    SumRings();
    for (Tile& tile : tiles_) {
      WeightByErrors(&tile);
      Step(frequencies_.size(), &tile);
    }
  }
  Summarise();
  std::vector<TileShift> shifts;
  for (const Tile& tile : tiles_) {
    if (tile.shift.information.trace() > 0) shifts.push_back(tile.shift);
  }
  return shifts;
}

}  // namespace thicklens::calib
