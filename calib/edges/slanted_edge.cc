#include "thicklens/calib/slanted_edge.h"

#include <fmt/format.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <complex>

#include "calib/edges/edge_spread.h"
#include "thicklens/base/cancel.h"
#include "thicklens/base/error.h"
#include "thicklens/base/pi.h"
#include "thicklens/base/statistics.h"

namespace thicklens::calib {
namespace {

constexpr double kBinPx = 0.25;  // fourfold oversampling
constexpr double kFrequencyStep = 0.01;
constexpr int kFrequencies = 101;       // up to 1 cycle per px
constexpr double kSegmentPx = 8;        // length of the edge whose place is measured at a time
constexpr double kWidestStripPx = 160;  // on each side
constexpr double kMinSegments = 4;
constexpr double kFlatPart = 0.6;   // of the Tukey window
constexpr double kEmptyBins = 0.1;  // share of the bins next to the edge that may be empty
constexpr double kMinSignal = 6;    // contrast over noise of the mean of a plateau's strip
constexpr double kSignificant = 4;  // standard deviations of a slope of the light
constexpr int kCandidates = 16;
constexpr double kClippedShare = 0.2;  // of the bright side at full scale
constexpr double kFullScale = 0.995;   // in linear light

double Sinc(double x) {
  const double t = kPi * x;
  return std::abs(t) < 1e-6 ? 1 : std::sin(t) / t;
}

struct Pixel {
  double across = 0, along = 0;  // px from the middle of the edge, along its normal and itself
  double value = 0;
};

// a + b across + c along, fitted to one side of the edge.
struct Plane {
  Eigen::Vector3d terms{0, 0, 0};
  double noise_sigma = 0;  // of a pixel
  double At(const Pixel& p) const { return terms[0] + terms[1] * p.across + terms[2] * p.along; }
};

class EdgeTransfer {
 public:
  EdgeTransfer(const cv::Mat& grey, const EdgeFeature& feature) : grey_(grey), feature_(feature) {}

  SlantedEdgeResult Run() {
    if (feature_.half_length_px < kMinSegments * kSegmentPx / 2)
      return Refused(fmt::format("the edge is {:.0f} px long, but {:.0f} px are needed",
                                 2 * feature_.half_length_px, kMinSegments * kSegmentPx));
    strip_px_ = std::min(feature_.half_width_px, kWidestStripPx);
    Gather();
    if (pixels_.size() < 200) return Refused("the edge has too few pixels");
    if (!FitLevels()) return Refused("the two sides of the edge do not differ beyond their noise");
    for (int round = 0; round < 4; ++round) {
      ThrowIfCancelled();
      Bin();
      if (!MoveLine()) return Refused("the place of the edge could not be followed along it");
      if (round == 0) NarrowStrip();
    }
    if (!FitLevels()) return Refused("the two sides of the edge do not differ beyond their noise");
    Bin();
    if (const double empty = EmptyShare(); empty > kEmptyBins) {
      return Refused(fmt::format(
          "the edge runs along the pixels, or at an angle that the pixels repeat: {:.0f} % of the "
          "quarter pixels next to it have no pixel; an angle of 3 to 10 degrees is right",
          100 * empty));
    }
    if (WidthPx() > 0.5 * strip_px_)
      return Refused(
          fmt::format("the blur of the edge, {:.1f} px from 10 to 90 %, is too wide for "
                      "the {:.0f} px on each side of it",
                      WidthPx(), strip_px_));
    Transform();
    return std::move(result_);
  }

 private:
  SlantedEdgeResult Refused(const std::string& why) {
    SlantedEdgeResult refused;
    refused.message = why;
    return refused;
  }

  Eigen::Vector2d Normal() const {
    return {std::cos(feature_.angle_rad), std::sin(feature_.angle_rad)};
  }

  void Gather() {
    pixels_.clear();
    const Eigen::Vector2d normal = Normal();
    const double reach = std::hypot(strip_px_, feature_.half_length_px) + 1;
    const Eigen::Vector2d& at = feature_.centre_px;
    const int x0 = std::max(0, static_cast<int>(at.x() - reach));
    const int x1 = std::min(grey_.cols - 1, static_cast<int>(at.x() + reach));
    const int y0 = std::max(0, static_cast<int>(at.y() - reach));
    const int y1 = std::min(grey_.rows - 1, static_cast<int>(at.y() + reach));
    for (int y = y0; y <= y1; ++y) {
      for (int x = x0; x <= x1; ++x) {
        const Eigen::Vector2d from = Eigen::Vector2d(x, y) - at;
        const double across = normal.dot(from);
        const double along = normal.x() * from.y() - normal.y() * from.x();
        if (std::abs(across) > strip_px_ || std::abs(along) > feature_.half_length_px) continue;
        pixels_.push_back({across, along, static_cast<double>(grey_.at<float>(y, x))});
      }
    }
  }

  // Distance from the line, which is a parabola along the edge.
  double Distance(const Pixel& p) const {
    const double t = p.along / feature_.half_length_px;
    const double slope = (line_[1] + 2 * line_[2] * t) / feature_.half_length_px;
    return (p.across - line_[0] - line_[1] * t - line_[2] * t * t) / std::sqrt(1 + slope * slope);
  }

  // The levels of both sides, from the outer parts of the strip. A slope of the light counts where
  // it is significant; otherwise it would only add noise.
  bool FitLevels() {
    for (const int side : {0, 1}) {
      std::vector<const Pixel*> outer;
      for (const Pixel& p : pixels_) {
        const double distance = side == 0 ? -Distance(p) : Distance(p);
        if (distance > 0.6 * strip_px_) outer.push_back(&p);
      }
      if (outer.size() < 20) return false;
      levels_[side] = FitPlane(outer);
    }
    const double contrast = levels_[1].terms[0] - levels_[0].terms[0];
    const double noise = std::max(levels_[0].noise_sigma, levels_[1].noise_sigma);
    return contrast > 0 &&
           contrast > kMinSignal * noise / std::sqrt(static_cast<double>(pixels_.size()) / 10);
  }

  static Plane FitPlane(const std::vector<const Pixel*>& pixels) {
    const auto n = static_cast<Eigen::Index>(pixels.size());
    Eigen::MatrixXd design(n, 3);
    Eigen::VectorXd values(n);
    for (Eigen::Index i = 0; i < n; ++i) {
      const Pixel& p = *pixels[static_cast<std::size_t>(i)];
      design.row(i) << 1, p.across, p.along;
      values[i] = p.value;
    }
    Plane plane;
    const double mean = values.mean();
    const Eigen::LDLT<Eigen::MatrixXd> normal(design.transpose() * design);
    plane.terms = normal.solve(design.transpose() * values);
    const double variance = (values - design * plane.terms).squaredNorm() /
                            static_cast<double>(std::max<Eigen::Index>(n - 3, 1));
    const Eigen::MatrixXd covariance = variance * normal.solve(Eigen::MatrixXd::Identity(3, 3));
    plane.noise_sigma = std::sqrt(variance);
    const bool is_level = std::abs(plane.terms[1]) < kSignificant * std::sqrt(covariance(1, 1)) &&
                          std::abs(plane.terms[2]) < kSignificant * std::sqrt(covariance(2, 2));
    if (is_level) plane.terms = {mean, 0, 0};
    return plane;
  }

  double LevelOf(const Pixel& p) const {
    const double dark = levels_[0].At(p), bright = levels_[1].At(p);
    return bright > dark ? (p.value - dark) / (bright - dark) : 0;
  }

  void Bin() {
    half_ = static_cast<int>(strip_px_ / kBinPx);
    const auto bins = static_cast<std::size_t>(2 * half_ + 1);
    level_.assign(bins, 0);
    count_.assign(bins, 0);
    for (const Pixel& p : pixels_) {
      const int bin = static_cast<int>(std::lround(Distance(p) / kBinPx)) + half_;
      if (bin < 0 || bin > 2 * half_) continue;
      level_[static_cast<std::size_t>(bin)] += LevelOf(p);
      ++count_[static_cast<std::size_t>(bin)];
    }
    for (std::size_t i = 0; i < bins; ++i) {
      if (count_[i] > 0) level_[i] /= count_[i];
    }
    FillEmptyBins();
  }

  void FillEmptyBins() {
    const auto bins = static_cast<int>(level_.size());
    int last = -1;
    for (int i = 0; i < bins; ++i) {
      if (count_[static_cast<std::size_t>(i)] == 0) continue;
      for (int k = last + 1; k < i; ++k) {
        const double t = last < 0 ? 1 : static_cast<double>(k - last) / (i - last);
        const double from = level_[static_cast<std::size_t>(last < 0 ? i : last)];
        level_[static_cast<std::size_t>(k)] =
            from + t * (level_[static_cast<std::size_t>(i)] - from);
      }
      last = i;
    }
    for (int k = last + 1; k < bins && last >= 0; ++k)
      level_[static_cast<std::size_t>(k)] = level_[static_cast<std::size_t>(last)];
  }

  double EmptyShare() const {
    const int reach = std::min(half_, static_cast<int>(4 / kBinPx));
    int empty = 0;
    for (int i = -reach; i <= reach; ++i) {
      if (count_[static_cast<std::size_t>(i + half_)] == 0) ++empty;
    }
    return static_cast<double>(empty) / (2 * reach + 1);
  }

  // The mean of the bins within a pixel, for slopes and widths, on which noise must not act.
  double SmoothLevel(double distance) const {
    const double at = distance / kBinPx + half_;
    double sum = 0, weights = 0;
    for (int i = static_cast<int>(std::floor(at)) - 2; i <= static_cast<int>(at) + 3; ++i) {
      const int bin = std::clamp(i, 0, 2 * half_);
      const double weight = std::max(0.0, 1 - std::abs(i - at) / 3);
      sum += weight * level_[static_cast<std::size_t>(bin)];
      weights += weight;
    }
    return sum / weights;
  }

  // 10 to 90 % of the step, px.
  double WidthPx() const {
    double from = -strip_px_, to = strip_px_;
    for (double d = 0; d > -strip_px_; d -= kBinPx) {
      if (SmoothLevel(d) < 0.1) {
        from = d;
        break;
      }
    }
    for (double d = 0; d < strip_px_; d += kBinPx) {
      if (SmoothLevel(d) > 0.9) {
        to = d;
        break;
      }
    }
    return to - from;
  }

  // Pixels far beyond the blur bring noise alone.
  void NarrowStrip() {
    const double enough_px = 4 * WidthPx() + 10;
    if (!(enough_px < strip_px_)) return;
    strip_px_ = enough_px;
    Gather();
    FitLevels();
    Bin();
  }

  // The displacement of each segment against the mean edge, by least squares; then a parabola
  // through them moves the line.
  bool MoveLine() {
    const int segments = static_cast<int>(2 * feature_.half_length_px / kSegmentPx);
    std::vector<Eigen::Vector2d> sums(static_cast<std::size_t>(segments), {0, 0});
    const double reach = std::min(strip_px_ - 1, 2 * WidthPx() + 3);
    for (const Pixel& p : pixels_) {
      const double distance = Distance(p);
      if (std::abs(distance) > reach) continue;
      const int segment = std::clamp(
          static_cast<int>((p.along + feature_.half_length_px) / kSegmentPx), 0, segments - 1);
      const double slope = SmoothLevel(distance + 0.5) - SmoothLevel(distance - 0.5);
      // I = E(d - shift), therefore E(d) - I = shift E'.
      sums[static_cast<std::size_t>(segment)] +=
          Eigen::Vector2d(slope * (LevelAt(distance) - LevelOf(p)), slope * slope);
    }
    Eigen::Matrix3d normal = Eigen::Matrix3d::Zero();
    Eigen::Vector3d right = Eigen::Vector3d::Zero();
    int seen = 0;
    for (int s = 0; s < segments; ++s) {
      const Eigen::Vector2d& sum = sums[static_cast<std::size_t>(s)];
      if (!(sum.y() > 0)) continue;
      const double t = ((s + 0.5) * kSegmentPx / feature_.half_length_px) - 1;
      const Eigen::Vector3d row(1, t, t * t);
      const double shift = std::clamp(sum.x() / sum.y(), -2.0, 2.0);
      normal += sum.y() * row * row.transpose();
      right += sum.y() * shift * row;
      ++seen;
    }
    if (seen < kMinSegments) return false;
    const Eigen::Vector3d move = normal.ldlt().solve(right);
    if (!move.allFinite()) return false;
    line_ += move;
    return std::abs(line_[0]) < strip_px_ / 2 && std::abs(line_[1]) < strip_px_ / 2;
  }

  double LevelAt(double distance) const {
    const double at = distance / kBinPx + half_;
    const int below = std::clamp(static_cast<int>(std::floor(at)), 0, 2 * half_ - 1);
    const double t = std::clamp(at - below, 0.0, 1.0);
    return (1 - t) * level_[static_cast<std::size_t>(below)] +
           t * level_[static_cast<std::size_t>(below + 1)];
  }

  // Position of half the step.
  double MiddlePx() const {
    double best = 0, least = 2;
    for (double d = -strip_px_ / 2; d <= strip_px_ / 2; d += kBinPx) {
      const double off = std::abs(SmoothLevel(d) - 0.5);
      if (off < least) {
        least = off;
        best = d;
      }
    }
    return best;
  }

  // [D171] The line spread is the difference L_k = E_{k+1} - E_k of bins of the width b, whose
  // transform is H(f) sinc(b f) sinc(b f): one factor from the mean over a bin, the other from the
  // difference. With the window w, F = sum_k w_k L_k e^{-i a k}, a = 2 pi f b, is by parts a sum
  // over the bins, F = sum_k E_k (w_{k-1} e^{i a} - w_k) e^{-i a k}. The variance of the modulus
  // squared follows, and is subtracted: noise v_k of the bins adds sum_k v_k |w_{k-1} e^{i a} -
  // w_k|^2.
  void Transform() {
    const double middle = MiddlePx();
    const double reach =
        std::min(strip_px_ - std::abs(middle) - kBinPx, std::max(4 * WidthPx() + 4, 8.0));
    const int bins = static_cast<int>(level_.size());
    std::vector<double> window(level_.size(), 0);
    for (int k = 0; k + 1 < bins; ++k) {
      const double x = std::abs((k + 0.5 - half_) * kBinPx - middle) / reach;
      if (x >= 1) continue;
      window[static_cast<std::size_t>(k)] =
          x < kFlatPart ? 1 : 0.5 + 0.5 * std::cos(kPi * (x - kFlatPart) / (1 - kFlatPart));
    }
    const double contrast = levels_[1].terms[0] - levels_[0].terms[0];
    result_.curve.frequency_per_px = TransferFrequencies();
    double zero = 1;
    for (const double frequency : result_.curve.frequency_per_px) {
      const double a = 2 * kPi * frequency * kBinPx;
      const std::complex<double> turn(std::cos(a), std::sin(a));
      std::complex<double> sum = 0;
      double variance = 0;
      for (int k = 0; k < bins; ++k) {
        const auto bin = static_cast<std::size_t>(k);
        const double before = k > 0 ? window[bin - 1] : 0;
        const std::complex<double> weight = before * turn - window[bin];
        sum += level_[bin] * weight * std::polar(1.0, -a * k);
        variance += BinVariance(bin, contrast) * std::norm(weight);
      }
      if (frequency == 0) zero = std::abs(sum);
      const double correction = zero * Sinc(kBinPx * frequency) * Sinc(kBinPx * frequency);
      const double power = std::norm(sum) - variance;
      const double modulus = std::copysign(std::sqrt(std::abs(power)), power);
      // Half of the variance is along the value.
      const double sigma = std::sqrt(variance / 2);
      result_.curve.transfer.push_back(frequency == 0 ? 1 : modulus / correction);
      result_.curve.sigma.push_back(frequency == 0 ? 0 : sigma / correction);
    }
    Describe(contrast, middle);
  }

  double BinVariance(std::size_t bin, double contrast) const {
    const double level = std::clamp(level_[bin], 0.0, 1.0);
    const double dark = levels_[0].noise_sigma, bright = levels_[1].noise_sigma;
    const double variance = (1 - level) * dark * dark + level * bright * bright;
    return variance / (contrast * contrast) / std::max(count_[bin], 1);
  }

  void Describe(double contrast, double middle) {
    result_.done = true;
    result_.message = "done";
    result_.mtf50 = FrequencyAtLevel(result_.curve, 0.5);
    result_.mtf10 = FrequencyAtLevel(result_.curve, 0.1);
    result_.centre_px = feature_.centre_px + (line_[0] + middle) * Normal();
    result_.normal_deg =
        (feature_.angle_rad - std::atan(line_[1] / feature_.half_length_px)) * 180 / kPi;
    result_.normal_deg = std::remainder(result_.normal_deg, 360);
    result_.length_px = 2 * feature_.half_length_px;
    result_.contrast = contrast;
    result_.noise_sigma = std::max(levels_[0].noise_sigma, levels_[1].noise_sigma);
    result_.is_clipped = IsClipped();
    for (std::size_t i = 0; i < level_.size(); ++i) {
      if (count_[i] == 0) continue;
      result_.distance_px.push_back((static_cast<double>(i) - half_) * kBinPx - middle);
      result_.level.push_back(level_[i]);
    }
  }

  // Many pixels at full scale are pixels whose light was cut off.
  bool IsClipped() const {
    std::size_t full = 0, bright = 0;
    for (const Pixel& p : pixels_) {
      if (Distance(p) < strip_px_ / 2) continue;
      ++bright;
      if (p.value >= kFullScale) ++full;
    }
    return static_cast<double>(full) > kClippedShare * static_cast<double>(bright);
  }

  const cv::Mat& grey_;
  EdgeFeature feature_;
  double strip_px_ = 0;
  std::vector<Pixel> pixels_;
  Plane levels_[2];                // dark, bright
  Eigen::Vector3d line_{0, 0, 0};  // offset of the line, px, in powers of along/half length
  int half_ = 0;                   // bins on each side of the middle one
  std::vector<double> level_;      // edge spread
  std::vector<int> count_;         // pixels of each bin
  SlantedEdgeResult result_;
};

}  // namespace

std::vector<double> TransferFrequencies() {
  std::vector<double> frequencies;
  for (int i = 0; i < kFrequencies; ++i) frequencies.push_back(i * kFrequencyStep);
  return frequencies;
}

std::optional<model::Estimate> FrequencyAtLevel(const ModulationTransfer& curve, double level) {
  for (std::size_t i = 1; i < curve.transfer.size(); ++i) {
    const double above = curve.transfer[i - 1], below = curve.transfer[i];
    if (!(above >= level) || !(below < level)) continue;
    const double step = curve.frequency_per_px[i] - curve.frequency_per_px[i - 1];
    const double t = (above - level) / (above - below);
    const double sigma =
        curve.sigma.empty() ? 0 : (1 - t) * curve.sigma[i - 1] + t * curve.sigma[i];
    return model::Estimate{curve.frequency_per_px[i - 1] + t * step,
                           sigma * step / (above - below)};
  }
  return std::nullopt;
}

std::vector<SlantedEdgeResult> MeasureSlantedEdges(const cv::Mat& grey, int most) {
  if (grey.type() != CV_32F) throw Error("slanted edge: an image of floats is expected");
  std::vector<SlantedEdgeResult> results;
  for (const EdgeFeature& feature : FindEdges(grey, kCandidates)) {
    if (feature.kind != EdgeFeature::Kind::kEdge) continue;
    if (static_cast<int>(results.size()) >= most) break;
    SlantedEdgeResult found = EdgeTransfer(grey, feature).Run();
    if (found.done) results.push_back(std::move(found));
  }
  return results;
}

SlantedEdgeResult MeasureSlantedEdge(const cv::Mat& grey) {
  if (grey.type() != CV_32F) throw Error("slanted edge: an image of floats is expected");
  SlantedEdgeResult last;
  last.message = "the region shows no straight edge with an even area on each side";
  for (const EdgeFeature& feature : FindEdges(grey, kCandidates)) {
    if (feature.kind != EdgeFeature::Kind::kEdge) continue;
    SlantedEdgeResult found = EdgeTransfer(grey, feature).Run();
    if (found.done) return found;
    // The reason of the clearest edge counts.
    if (last.length_px == 0) {
      last = std::move(found);
      last.length_px = 2 * feature.half_length_px;
    }
  }
  return last;
}

ModulationTransfer MeanCurve(const std::vector<SlantedEdgeResult>& edges) {
  if (edges.empty()) throw Error("mean of transfer curves: at least one is expected, found none");
  ModulationTransfer mean;
  mean.frequency_per_px = edges.front().curve.frequency_per_px;
  for (std::size_t i = 0; i < mean.frequency_per_px.size(); ++i) {
    double sum = 0, weights = 0;
    for (const SlantedEdgeResult& edge : edges) {
      const double sigma = std::max(edge.curve.sigma[i], 1e-6);
      sum += edge.curve.transfer[i] / (sigma * sigma);
      weights += 1 / (sigma * sigma);
    }
    mean.transfer.push_back(sum / weights);
    mean.sigma.push_back(i == 0 ? 0 : 1 / std::sqrt(weights));
  }
  return mean;
}

}  // namespace thicklens::calib
