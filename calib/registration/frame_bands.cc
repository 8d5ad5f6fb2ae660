#include "calib/registration/frame_bands.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <map>
#include <numeric>
#include <opencv2/core.hpp>

#include "thicklens/base/cancel.h"
#include "thicklens/base/parallel.h"
#include "thicklens/base/pi.h"
#include "thicklens/base/statistics.h"

namespace thicklens::calib {
namespace {

constexpr std::size_t kMinBandFrames = 5;
constexpr double kSuspiciousAnisotropy = 10;  // ratio of variances, above chance and usual targets
constexpr double kDarkestMean = 1e-4;         // relative to full scale
constexpr int kMaxLines = 512;                // of a profile; finer bands are averaged
constexpr double kTaperedShare = 0.15;        // of the lines' length, at each end
constexpr double kMinSharedLength = 0.3;      // share of a line that all frames must show
constexpr double kSharpestKernel = 0.6;       // grid steps: sigma of a sampled Gaussian
constexpr double kKernelReach = 3.5;          // sigmas
constexpr int kBandRounds = 4;                // of the means of the frames and the ridge
constexpr int kSmoothDegree = 4;              // of shading along an axis
// A finding needs this ratio of the deviation to that of the other axis, as it is and relative to
// the profile of the target, which errors of place and blur are proportional to.
constexpr double kMinBandRatio = 2.5;
constexpr double kMinDeviation = 0.004;  // ln; less does not move a scale or a blur
// Errors of place and blur are alike in neighbouring frames, bands are not.
constexpr double kLargestLikeness = 0.75;
constexpr double kSamePeriod = 0.12, kMinAlikeShare = 0.6;

double PositiveLog(double light) { return std::log(std::max(light, kDarkestMean)); }

std::vector<double> LogMeans(const cv::Mat& grey, BandAxis axis) {
  cv::Mat means;
  cv::reduce(grey, means, axis == BandAxis::kRows ? 1 : 0, cv::REDUCE_AVG, CV_64F);
  std::vector<double> logs(means.total());
  for (std::size_t i = 0; i < logs.size(); ++i)
    logs[i] = PositiveLog(means.at<double>(static_cast<int>(i)));
  return logs;
}

// The values without their polynomial of that degree.
Eigen::VectorXd WithoutPolynomial(const Eigen::VectorXd& values, int degree) {
  const Eigen::Index n = values.size();
  Eigen::MatrixXd design(n, degree + 1);
  for (Eigen::Index i = 0; i < n; ++i) {
    const double u = 2 * (static_cast<double>(i) + 0.5) / static_cast<double>(n) - 1;
    for (int k = 0; k <= degree; ++k) design(i, k) = std::pow(u, k);
  }
  return values - design * design.colPivHouseholderQr().solve(values);
}

double Deviation(const Eigen::VectorXd& values) {
  return values.size() == 0 ? 0
                            : std::sqrt(values.squaredNorm() / static_cast<double>(values.size()));
}

// A place along one axis of a frame and of the target: p = centre + shift + scale (q - centre).
struct LinePlace {
  double scale = 1, shift_px = 0, centre_px = 0;
  double OnTarget(double p) const { return centre_px + (p - centre_px - shift_px) / scale; }
  double InFrame(double q) const { return centre_px + shift_px + scale * (q - centre_px); }
};

LinePlace PlaceAlong(const ScaleSample* sample, cv::Point2d centre, bool down) {
  LinePlace place;
  place.centre_px = down ? centre.y : centre.x;
  if (sample == nullptr) return place;
  place.scale = sample->scale;
  place.shift_px = down ? sample->registration.shift_px.y() : sample->registration.shift_px.x();
  return place;
}

// Linear interpolation; false outside.
bool At(const std::vector<double>& profile, double place, double* value) {
  const double below = std::floor(place);
  if (!(below >= 0 && below + 1 < static_cast<double>(profile.size()))) return false;
  const auto i = static_cast<std::size_t>(below);
  *value = profile[i] + (place - below) * (profile[i + 1] - profile[i]);
  return true;
}

// The difference of a frame's profile to the other's at the same places of the target.
Eigen::VectorXd Difference(const std::vector<double>& one, const LinePlace& place,
                           const std::vector<double>& other, const LinePlace& other_place) {
  std::vector<double> found;
  for (std::size_t i = 0; i < one.size(); ++i) {
    double value = 0;
    if (At(other, other_place.InFrame(place.OnTarget(static_cast<double>(i))), &value))
      found.push_back(one[i] - value);
  }
  return WithoutPolynomial(
      Eigen::Map<const Eigen::VectorXd>(found.data(), static_cast<Eigen::Index>(found.size())), 2);
}

double VarianceOf(const Eigen::VectorXd& values) {
  return values.squaredNorm() / std::max(1.0, static_cast<double>(values.size()));
}

}  // namespace

LightProfiles ProfilesOf(const cv::Mat& grey) {
  return {LogMeans(grey, BandAxis::kRows), LogMeans(grey, BandAxis::kColumns)};
}

std::optional<BandAxis> SuspectedBands(const std::vector<const LightProfiles*>& profiles,
                                       const std::vector<const ScaleSample*>& samples,
                                       cv::Point2d centre) {
  if (profiles.size() < kMinBandFrames) return std::nullopt;
  const std::size_t n = profiles.size();
  const auto rows = static_cast<Eigen::Index>(profiles.front()->rows.size());
  const auto columns = static_cast<Eigen::Index>(profiles.front()->columns.size());
  std::vector<double> of_rows, of_columns, ratios;
  Eigen::VectorXd mean_rows = Eigen::VectorXd::Zero(rows);
  Eigen::VectorXd mean_columns = Eigen::VectorXd::Zero(columns);
  const auto sample = [&](std::size_t i) { return samples.empty() ? nullptr : samples[i]; };
  for (std::size_t i = 0; i < n; ++i) {
    mean_rows += Eigen::Map<const Eigen::VectorXd>(profiles[i]->rows.data(), rows) / double(n);
    mean_columns +=
        Eigen::Map<const Eigen::VectorXd>(profiles[i]->columns.data(), columns) / double(n);
    if (i == 0) continue;
    if (!samples.empty() && (sample(i) == nullptr || sample(i - 1) == nullptr)) continue;
    of_rows.push_back(
        VarianceOf(Difference(profiles[i]->rows, PlaceAlong(sample(i), centre, true),
                              profiles[i - 1]->rows, PlaceAlong(sample(i - 1), centre, true))));
    of_columns.push_back(
        VarianceOf(Difference(profiles[i]->columns, PlaceAlong(sample(i), centre, false),
                              profiles[i - 1]->columns, PlaceAlong(sample(i - 1), centre, false))));
    // A line of n pixels has the mean of n independent parts of the target.
    ratios.push_back(of_rows.back() * static_cast<double>(columns) /
                     std::max(of_columns.back() * static_cast<double>(rows), 1e-30));
  }
  if (ratios.size() + 1 < kMinBandFrames) return std::nullopt;
  const double ratio = Median(ratios);
  if (ratio <= kSuspiciousAnisotropy && ratio >= 1 / kSuspiciousAnisotropy) return std::nullopt;
  const BandAxis axis = ratio > 1 ? BandAxis::kRows : BandAxis::kColumns;
  // Bands that are independent in each frame average out of the mean, a target with lines remains.
  const double differences = Median(axis == BandAxis::kRows ? of_rows : of_columns);
  if (!(std::sqrt(0.5 * differences) > kMinDeviation)) return std::nullopt;
  const double of_bands = 3 * 0.5 * differences / static_cast<double>(n);
  const double target_rows = VarianceOf(WithoutPolynomial(mean_rows, 2)) * double(columns);
  const double target_columns = VarianceOf(WithoutPolynomial(mean_columns, 2)) * double(rows);
  const bool is_striped =
      axis == BandAxis::kRows
          ? target_rows - of_bands * double(columns) > kSuspiciousAnisotropy * target_columns
          : target_columns - of_bands * double(rows) > kSuspiciousAnisotropy * target_rows;
  if (is_striped) return std::nullopt;
  return axis;
}

cv::Mat WithEvenLines(const cv::Mat& grey, BandAxis axis) {
  const bool are_rows = axis == BandAxis::kRows;
  cv::Mat means;
  cv::reduce(grey, means, are_rows ? 1 : 0, cv::REDUCE_AVG, CV_32F);
  means = cv::max(means, kDarkestMean);
  const cv::Mat spread =
      cv::repeat(means, are_rows ? 1 : grey.rows, are_rows ? grey.cols : 1) / cv::mean(grey)[0];
  return grey / spread;
}

namespace {

// One axis of MeasureBands.
class BandFit {
 public:
  BandFit(const FramePlaces& places, BandAxis axis, int threads)
      : places_(places), axis_(axis), threads_(threads) {}

  // False: `message` says why.
  bool Run(std::string* message) {
    if (!Place()) {
      *message = "too few frames could be registered";
      return false;
    }
    if (!ReadProfiles()) {
      *message = "the frames share too little of the target";
      return false;
    }
    Solve();
    *message = "measured";
    return true;
  }

  // Median over the frames of the deviation over the lines, ln.
  double deviation() const { return Median(Deviations()); }
  std::vector<double> Deviations() const {
    std::vector<double> found;
    for (const Eigen::VectorXd& band : bands_) found.push_back(Deviation(band));
    return found;
  }
  double target_deviation() const {
    return Deviation(WithoutPolynomial(target_, kSmoothDegree).eval());
  }

  // Median correlation of the bands of neighbouring frames at the same places of the target.
  double Likeness() const {
    std::vector<double> found;
    for (std::size_t k = 1; k < order_.size(); ++k) {
      const std::size_t i = order_[k], j = order_[k - 1];
      double own = 0, other = 0, both = 0;
      const std::vector<double> neighbour(bands_[j].begin(), bands_[j].end());
      for (Eigen::Index y = 0; y < bands_[i].size(); ++y) {
        const double at = (Along(j).InFrame(Along(i).OnTarget(Middle(y))) + 0.5) / factor_ - 0.5;
        double value = 0;
        if (!At(neighbour, at, &value)) continue;
        own += bands_[i][y] * bands_[i][y];
        other += value * value;
        both += bands_[i][y] * value;
      }
      if (own > 0 && other > 0) found.push_back(both / std::sqrt(own * other));
    }
    return found.empty() ? 1 : Median(found);
  }

  // The common period; std::nullopt: there is none.
  std::optional<double> PeriodPx() const {
    std::vector<double> periods;
    for (const Eigen::VectorXd& band : bands_) {
      const Eigen::VectorXd rest = WithoutPolynomial(band, 2);
      const auto n = static_cast<double>(rest.size());
      double most = 0, best = 0;
      for (double cycles = 1.5; cycles < 0.45 * n; cycles += 0.25) {
        double c = 0, s = 0;
        for (Eigen::Index y = 0; y < rest.size(); ++y) {
          const double phase = 2 * kPi * cycles * static_cast<double>(y) / n;
          c += rest[y] * std::cos(phase);
          s += rest[y] * std::sin(phase);
        }
        if (c * c + s * s > most) {
          most = c * c + s * s;
          best = n * factor_ / cycles;
        }
      }
      if (best > 0) periods.push_back(best);
    }
    if (periods.empty()) return std::nullopt;
    const double middle = Median(periods);
    const auto alike = std::count_if(periods.begin(), periods.end(), [&](double period) {
      return std::abs(std::log(period / middle)) < kSamePeriod;
    });
    if (static_cast<double>(alike) < kMinAlikeShare * static_cast<double>(bands_.size()))
      return std::nullopt;
    return middle;
  }

  // ln of the gain of each line of frame `index` of places.used, in full resolution.
  std::vector<double> LogGain(std::size_t index) const {
    const Eigen::VectorXd band = bands_[index] - common_;
    const std::vector<double> coarse(band.begin(), band.end());
    std::vector<double> fine(static_cast<std::size_t>(lines_));
    const auto last = static_cast<double>(coarse.size() - 1);
    for (int y = 0; y < lines_; ++y) {
      const double at = std::clamp((y + 0.5) / factor_ - 0.5, 0.0, last - 1e-9);
      At(coarse, at, &fine[static_cast<std::size_t>(y)]);
    }
    return fine;
  }

 private:
  bool Down() const { return axis_ == BandAxis::kRows; }
  // Centre of a line of a profile, px of the frame.
  double Middle(Eigen::Index line) const {
    return factor_ * (static_cast<double>(line) + 0.5) - 0.5;
  }
  const LinePlace& Along(std::size_t i) const { return along_[i]; }

  double ReadingOf(std::size_t frame) const { return places_.sweep.frames[frame].reading_mm; }

  // Places of the frames on the target; those of frames without a registration by the others.
  bool Place() {
    std::map<std::size_t, const ScaleSample*> registered;
    for (const ScaleSample& sample : places_.samples) {
      if (!sample.scale_is_from_reading) registered[sample.frame] = &sample;
    }
    std::vector<const ScaleSample*> known;
    for (const std::size_t frame : places_.used) {
      if (const auto found = registered.find(frame); found != registered.end())
        known.push_back(found->second);
    }
    if (known.size() < kMinBandFrames) return false;
    std::stable_sort(known.begin(), known.end(), [](const ScaleSample* a, const ScaleSample* b) {
      return a->reading_mm < b->reading_mm;
    });
    for (const std::size_t frame : places_.used) {
      const auto found = registered.find(frame);
      along_.push_back(
          PlaceAlong(found == registered.end() ? nullptr : found->second, places_.centre, Down()));
      across_.push_back(
          PlaceAlong(found == registered.end() ? nullptr : found->second, places_.centre, !Down()));
      if (found == registered.end()) {
        along_.back().scale = across_.back().scale =
            1 /
            Interpolated(known, ReadingOf(frame), [](const ScaleSample& s) { return 1 / s.scale; });
      }
      variance_px2_.push_back(found != registered.end() &&
                                      found->second->registration.added_variance_px2
                                  ? *found->second->registration.added_variance_px2
                                  : Interpolated(known, ReadingOf(frame), [](const ScaleSample& s) {
                                      return s.registration.added_variance_px2.value_or(0);
                                    }));
    }
    order_.resize(places_.used.size());
    std::iota(order_.begin(), order_.end(), std::size_t{0});
    std::stable_sort(order_.begin(), order_.end(), [this](std::size_t a, std::size_t b) {
      return ReadingOf(places_.used[a]) < ReadingOf(places_.used[b]);
    });
    return true;
  }

  template <typename Value>
  static double Interpolated(const std::vector<const ScaleSample*>& known, double reading_mm,
                             const Value& value) {
    const auto after = std::find_if(known.begin(), known.end(), [&](const ScaleSample* s) {
      return s->reading_mm >= reading_mm;
    });
    if (after == known.begin()) return value(*known.front());
    if (after == known.end()) return value(*known.back());
    const ScaleSample &high = **after, &low = **(after - 1);
    const double part = (reading_mm - low.reading_mm) / (high.reading_mm - low.reading_mm);
    return value(low) + part * (value(high) - value(low));
  }

  bool ReadProfiles() {
    const std::size_t n = places_.used.size();
    profiles_.resize(n);
    bool is_shared = true;
    ParallelFor(static_cast<int>(n), threads_, [&](int at) {
      const auto i = static_cast<std::size_t>(at);
      cv::Mat grey = places_.read_grey(places_.used[i]);
      if (!Down()) cv::transpose(grey, grey);
      const std::optional<std::pair<double, double>> shared = Shared(grey.cols);
      if (i == 0) {
        lines_ = grey.rows;
        is_shared = shared.has_value();
      }
      if (!shared) return;
      const int factor = std::max(1, (grey.rows + kMaxLines - 1) / kMaxLines);
      if (i == 0) factor_ = factor;
      profiles_[i] = Profile(grey, across_[i], *shared, factor);
    });
    return is_shared;
  }

  // The part of the lines, on the target, that all frames show.
  std::optional<std::pair<double, double>> Shared(int length) const {
    double low = -1e300, high = 1e300;
    for (const LinePlace& place : across_) {
      low = std::max(low, place.OnTarget(0));
      high = std::min(high, place.OnTarget(length - 1));
    }
    if (!(high - low > kMinSharedLength * length)) return std::nullopt;
    return std::pair(low, high);
  }

  static Eigen::VectorXd Profile(const cv::Mat& grey, const LinePlace& across,
                                 const std::pair<double, double>& shared, int factor) {
    cv::Mat weights(grey.cols, 1, CV_32F);
    double total = 0;
    for (int x = 0; x < grey.cols; ++x) {
      const double u = (across.OnTarget(x) - shared.first) / (shared.second - shared.first);
      const double from_end = std::min(u, 1 - u) / kTaperedShare;
      const double weight = from_end <= 0   ? 0
                            : from_end >= 1 ? 1
                                            : std::pow(std::sin(0.5 * kPi * from_end), 2);
      weights.at<float>(x) = static_cast<float>(weight);
      total += weight;
    }
    const cv::Mat means = grey * weights;
    Eigen::VectorXd profile(grey.rows / factor);
    for (Eigen::Index y = 0; y < profile.size(); ++y) {
      double sum = 0;
      for (int k = 0; k < factor; ++k)
        sum += static_cast<double>(means.at<float>(static_cast<int>(y) * factor + k));
      profile[y] = PositiveLog(sum / (total * factor));
    }
    return profile;
  }

  // The weights of the target's grid in the light of one line.
  struct Kernel {
    Eigen::Index first = 0;
    Eigen::VectorXd weights;
  };
  Kernel KernelOf(std::size_t i, Eigen::Index line) const {
    const double at = (Along(i).OnTarget(Middle(line)) - grid_first_) / factor_;
    const double scale = Along(i).scale;
    const double least = *std::min_element(variance_px2_.begin(), variance_px2_.end());
    const double sigma = std::max(
        kSharpestKernel,
        std::sqrt(std::max(0.0, variance_px2_[i] - std::min(least, 0.0))) / (scale * factor_));
    const auto reach = static_cast<Eigen::Index>(std::ceil(kKernelReach * sigma));
    const auto middle = static_cast<Eigen::Index>(std::lround(at));
    Kernel kernel;
    kernel.first = std::clamp<Eigen::Index>(middle - reach, 0, grid_ - 1);
    const Eigen::Index last = std::clamp<Eigen::Index>(middle + reach, 0, grid_ - 1);
    kernel.weights.resize(last - kernel.first + 1);
    for (Eigen::Index k = 0; k < kernel.weights.size(); ++k) {
      const double u = (static_cast<double>(kernel.first + k) - at) / sigma;
      kernel.weights[k] = std::exp(-0.5 * u * u);
    }
    kernel.weights /= kernel.weights.sum();
    return kernel;
  }

  void Solve() {
    const std::size_t n = profiles_.size();
    double low = 1e300, high = -1e300;
    for (std::size_t i = 0; i < n; ++i) {
      low = std::min(low, Along(i).OnTarget(Middle(0)));
      high = std::max(high, Along(i).OnTarget(Middle(profiles_[i].size() - 1)));
    }
    grid_first_ = low;
    grid_ = static_cast<Eigen::Index>((high - low) / factor_) + 2;
    std::vector<std::vector<Kernel>> kernels(n);
    Eigen::MatrixXd normal = Eigen::MatrixXd::Zero(grid_, grid_);
    for (std::size_t i = 0; i < n; ++i) {
      ThrowIfCancelled();
      for (Eigen::Index y = 0; y < profiles_[i].size(); ++y) {
        kernels[i].push_back(KernelOf(i, y));
        const Kernel& kernel = kernels[i].back();
        const Eigen::Index size = kernel.weights.size();
        normal.block(kernel.first, kernel.first, size, size) +=
            kernel.weights * kernel.weights.transpose();
      }
    }
    std::vector<double> means;
    for (const Eigen::VectorXd& profile : profiles_) means.push_back(profile.mean());
    double ridge = 0.3;
    bands_ = profiles_;
    for (int round = 0; round < kBandRounds; ++round) {
      ThrowIfCancelled();
      Eigen::VectorXd right = Eigen::VectorXd::Zero(grid_);
      for (std::size_t i = 0; i < n; ++i) {
        for (Eigen::Index y = 0; y < profiles_[i].size(); ++y) {
          const Kernel& kernel = kernels[i][static_cast<std::size_t>(y)];
          right.segment(kernel.first, kernel.weights.size()) +=
              (profiles_[i][y] - means[i]) * kernel.weights;
        }
      }
      Eigen::MatrixXd damped = normal;
      damped.diagonal().array() += ridge;
      target_ = damped.ldlt().solve(right);
      std::vector<double> squares;
      for (std::size_t i = 0; i < n; ++i) {
        for (Eigen::Index y = 0; y < profiles_[i].size(); ++y) {
          const Kernel& kernel = kernels[i][static_cast<std::size_t>(y)];
          bands_[i][y] = profiles_[i][y] -
                         kernel.weights.dot(target_.segment(kernel.first, kernel.weights.size()));
        }
        means[i] = bands_[i].mean();
        bands_[i].array() -= means[i];
        squares.push_back(VarianceOf(bands_[i]));
      }
      ridge = std::clamp(Median(squares) / std::max(1e-12, VarianceOf(target_)), 0.01, 1.0);
    }
    Eigen::VectorXd common = Eigen::VectorXd::Zero(bands_.front().size());
    for (const Eigen::VectorXd& band : bands_) common += band / static_cast<double>(n);
    common_ = common - WithoutPolynomial(common, kSmoothDegree);
  }

  const FramePlaces& places_;
  const BandAxis axis_;
  const int threads_;
  std::vector<LinePlace> along_, across_;  // of places_.used: across the lines' order, along them
  std::vector<double> variance_px2_;       // blur beyond that of the reference, px^2 of the frame
  std::vector<std::size_t> order_;         // by the reading
  int lines_ = 0, factor_ = 1;
  std::vector<Eigen::VectorXd> profiles_, bands_;
  double grid_first_ = 0;
  Eigen::Index grid_ = 0;
  Eigen::VectorXd target_, common_;
};

}  // namespace

FrameBands MeasureBands(const FramePlaces& places, BandAxis axis, int threads) {
  FrameBands result;
  BandFit fit(places, axis, threads);
  if (!fit.Run(&result.message)) return result;
  BandFit other(places, axis == BandAxis::kRows ? BandAxis::kColumns : BandAxis::kRows, threads);
  if (!other.Run(&result.message)) return result;
  result.done = true;
  const std::vector<double> deviations = fit.Deviations();
  const double middle = Median(deviations);
  std::vector<double> off;
  for (const double deviation : deviations) off.push_back(std::abs(deviation - middle));
  result.deviation = {middle, 1.4826 * Median(off)};
  const double of_other = other.deviation();
  const double relative = middle / std::max(1e-9, fit.target_deviation());
  const double relative_of_other = of_other / std::max(1e-9, other.target_deviation());
  result.is_significant = middle > std::max(kMinDeviation, kMinBandRatio * of_other) &&
                          relative > kMinBandRatio * relative_of_other &&
                          fit.Likeness() < kLargestLikeness;
  result.period_px = fit.PeriodPx();
  result.log_gain.resize(places.sweep.frames.size());
  for (std::size_t i = 0; i < places.used.size(); ++i)
    result.log_gain[places.used[i]] = fit.LogGain(i);
  return result;
}

}  // namespace thicklens::calib
