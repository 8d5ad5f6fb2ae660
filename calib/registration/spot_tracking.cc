#include "calib/registration/spot_tracking.h"

#include <fmt/format.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <map>
#include <set>
#include <string>
#include <utility>

#include "calib/registration/scale_tracking.h"
#include "thicklens/base/cancel.h"
#include "thicklens/base/statistics.h"

namespace thicklens::calib {
namespace {

constexpr std::size_t kMinOfFrame = 6;  // points of a frame with a blur
constexpr std::size_t kMinFrames = 5;   // frames with a blur
constexpr int kPasses = 8;
constexpr double kSettled = 0.005;    // relative change of the window
constexpr double kOutlier = 5;        // robust standard deviations of the points
constexpr double kFirstWindow = 0.3;  // of the spacing, within which a point is sought
constexpr double kBoxPx2 = 1.0 / 12;  // variance of the pixel
constexpr double kNearFullScale = 0.995;
constexpr double kMayClip = 0.7;     // light from which a common largest value is a clipping
constexpr double kScaleBias = 1e-5;  // relative, of the centroids of sampled points
constexpr int kManyAlike = 4;        // pixels with the largest value

// Map from the reference to a frame: p = c + t + (a, -b; b, a) q + cubic |.|^2 (.), where q is the
// place in the reference, less the centre c, and (.) is its image by the similarity.
struct SpotMap {
  double a = 1, b = 0, tx = 0, ty = 0, cubic = 0;

  cv::Point2d At(const cv::Point2d& from_centre) const {
    const double x = a * from_centre.x - b * from_centre.y;
    const double y = b * from_centre.x + a * from_centre.y;
    const double bend = 1 + cubic * (x * x + y * y);
    return {tx + bend * x, ty + bend * y};
  }
};

struct FittedMap {
  SpotMap map;
  double scale_sigma = 0, cubic_sigma = 0;
  double scale_per_cubic = 0;  // as in FreeRegistration
};

// Least squares over pairs of points; those that deviate by more than kOutlier robust standard
// deviations are left out in further rounds.
std::optional<FittedMap> FitMap(const std::vector<cv::Point2d>& from,
                                const std::vector<cv::Point2d>& to) {
  std::vector<bool> kept(from.size(), true);
  FittedMap fitted;
  for (int round = 0; round < 3; ++round) {
    const auto n = std::count(kept.begin(), kept.end(), true);
    if (n < static_cast<std::ptrdiff_t>(kMinOfFrame)) return std::nullopt;
    Eigen::MatrixXd design(2 * n, 5);
    Eigen::VectorXd values(2 * n);
    Eigen::Index row = 0;
    const double scale3 = std::pow(std::hypot(fitted.map.a, fitted.map.b), 3);
    for (std::size_t i = 0; i < from.size(); ++i) {
      if (!kept[i]) continue;
      const double x = from[i].x, y = from[i].y;
      const double third = scale3 * (x * x + y * y);
      design.row(row) << x, -y, 1, 0, third * x;
      design.row(row + 1) << y, x, 0, 1, third * y;
      values[row] = to[i].x;
      values[row + 1] = to[i].y;
      row += 2;
    }
    const Eigen::ColPivHouseholderQR<Eigen::MatrixXd> qr(design);
    if (qr.rank() < 5) return std::nullopt;
    const Eigen::VectorXd c = qr.solve(values);
    fitted.map = {c[0], c[1], c[2], c[3], c[4]};
    const double variance = (values - design * c).squaredNorm() / static_cast<double>(2 * n - 5);
    const Eigen::MatrixXd covariance = variance * (design.transpose() * design).inverse();
    fitted.scale_sigma = std::sqrt(covariance(0, 0));
    fitted.cubic_sigma = std::sqrt(covariance(4, 4));
    fitted.scale_per_cubic = -covariance(0, 4) / covariance(4, 4);
    std::vector<double> deviations;
    for (std::size_t i = 0; i < from.size(); ++i)
      deviations.push_back(cv::norm(fitted.map.At(from[i]) - to[i]));
    // The median of the length of a two-dimensional Gaussian error is 1.18 sigma.
    const double limit = kOutlier * std::max(1e-3, Median(deviations) / 1.18);
    for (std::size_t i = 0; i < from.size(); ++i) kept[i] = deviations[i] < limit;
  }
  return fitted;
}

// Many pixels with the largest value of a bright frame were clipped there.
double ClipLight(const cv::Mat& grey) {
  double highest = 0;
  cv::minMaxLoc(grey, nullptr, &highest);
  if (highest > kMayClip && cv::countNonZero(grey >= highest * (1 - 1e-6)) >= kManyAlike)
    return highest * (1 - 1e-6);
  return kNearFullScale;
}

class Follower {
 public:
  Follower(const FocusSweep& sweep, const SpotPattern& pattern)
      : sweep_(sweep), pattern_(pattern), centre_(RegionCentre(sweep)) {
    for (const cv::Point2d& spot : pattern.centres_px) from_.push_back(spot - centre_);
  }

  // Measures a frame from where its neighbour in the order of the readings showed the points.
  // `sigma_px` is the neighbour's and becomes the frame's.
  std::optional<SpotFrame> Measure(std::size_t frame, const cv::Mat& grey, SpotMap* map,
                                   double* sigma_px) {
    SpotWindow window;
    window.sign = pattern_.are_bright ? 1 : -1;
    window.clip_light = pattern_.are_bright ? ClipLight(grey) : 1e30;
    // The first pass looks for the points in a window as wide as their distance allows.
    window.sigma_px = std::max(*sigma_px, kFirstWindow * pattern_.spacing_px / SpotWindow::kRadius);
    std::optional<FittedMap> fitted;
    std::vector<SpotMoments> moments;
    for (int pass = 0; pass < kPasses; ++pass) {
      ThrowIfCancelled();
      moments = MomentsWith(grey, *map, window);
      if (const auto found = FitMap(Starts(moments), Centres(moments))) {
        fitted = found;
        *map = found->map;
      }
      const std::optional<double> next_px = MedianSigma(moments);
      if (pass == 0) {
        window.sigma_px = next_px ? std::min(*next_px, window.sigma_px) : *sigma_px;
        continue;
      }
      if (!next_px) break;
      const bool is_settled = std::abs(*next_px / window.sigma_px - 1) < kSettled;
      if (is_settled) break;
      window.sigma_px = *next_px;
    }
    if (!fitted) return std::nullopt;
    last_ = moments;
    SpotFrame result;
    result.frame = frame;
    result.registration = RegistrationOf(*fitted);
    result.variance_px2 = MeanVariance(moments);
    std::map<SpotFault, int> faults;
    for (const SpotMoments& of : moments) {
      if (of.fault == SpotFault::kNone) continue;
      ++faults[of.fault];
      ++left_out_[of.fault];
    }
    if (!result.variance_px2) {
      std::vector<std::string> reasons;
      for (const auto& [fault, count] : faults)
        reasons.push_back(fmt::format("{} {}", count, SpotFaultInWords(fault)));
      result.without_variance = fmt::format("fewer than {} of its {} points can be measured: {}",
                                            kMinOfFrame, moments.size(), fmt::join(reasons, ", "));
    }
    if (result.variance_px2) *sigma_px = std::sqrt(result.variance_px2->value + kBoxPx2);
    return result;
  }

  // Takes the places that were measured last for those of the reference. Points without a place
  // there are given up.
  void TakePlaces() {
    std::vector<cv::Point2d> measured;
    for (const SpotMoments& of : last_) {
      if (HasPlace(of.fault)) measured.push_back(of.centre_px - centre_);
    }
    if (measured.size() < kMinOfFrame) return;
    from_ = std::move(measured);
    left_out_.clear();
    used_.clear();
    measured_ = deviating_ = 0;
  }

  void Describe(SpotFinding* finding) const {
    finding->are_bright = pattern_.are_bright;
    finding->found = static_cast<int>(pattern_.centres_px.size());
    finding->used = static_cast<int>(used_.size());
    finding->measured = measured_;
    for (const auto& [fault, count] : left_out_)
      finding->left_out.emplace_back(SpotFaultInWords(fault), count);
    if (deviating_ > 0)
      finding->left_out.emplace_back("unlike the other points of the frame", deviating_);
  }

 private:
  std::vector<SpotMoments> MomentsWith(const cv::Mat& grey, const SpotMap& map,
                                       const SpotWindow& window) const {
    std::vector<cv::Point2d> places;
    for (const cv::Point2d& spot : from_) places.push_back(centre_ + map.At(spot));
    std::vector<SpotMoments> moments;
    for (std::size_t i = 0; i < places.size(); ++i) {
      std::vector<cv::Point2d> others;
      for (std::size_t j = 0; j < places.size(); ++j) {
        if (j != i && cv::norm(places[j] - places[i]) < 20 * window.sigma_px + 10)
          others.push_back(places[j]);
      }
      moments.push_back(MeasureSpot(grey, places[i], others, window, sweep_.camera.psf));
    }
    return moments;
  }

  std::vector<cv::Point2d> Starts(const std::vector<SpotMoments>& moments) const {
    std::vector<cv::Point2d> starts;
    for (std::size_t i = 0; i < moments.size(); ++i) {
      if (HasPlace(moments[i].fault)) starts.push_back(from_[i]);
    }
    return starts;
  }
  std::vector<cv::Point2d> Centres(const std::vector<SpotMoments>& moments) const {
    std::vector<cv::Point2d> centres;
    for (const SpotMoments& of : moments) {
      if (HasPlace(of.fault)) centres.push_back(of.centre_px - centre_);
    }
    return centres;
  }

  static std::optional<double> MedianSigma(const std::vector<SpotMoments>& moments) {
    std::vector<double> variances;
    for (const SpotMoments& of : moments) {
      if (of.fault == SpotFault::kNone) variances.push_back(of.variance_px2);
    }
    if (variances.size() < kMinOfFrame) return std::nullopt;
    return std::sqrt(std::max(0.1, Median(variances)));
  }

  std::optional<model::Estimate> MeanVariance(const std::vector<SpotMoments>& moments) {
    std::vector<double> variances;
    for (const SpotMoments& of : moments) {
      if (of.fault == SpotFault::kNone) variances.push_back(of.variance_px2);
    }
    if (variances.size() < kMinOfFrame) return std::nullopt;
    const double median = Median(variances);
    std::vector<double> deviations;
    for (const double v : variances) deviations.push_back(std::abs(v - median));
    const double limit = kOutlier * 1.4826 * std::max(Median(deviations), 1e-6);
    double sum = 0, squares = 0, noise2 = 0;
    int count = 0;
    for (std::size_t i = 0; i < moments.size(); ++i) {
      if (moments[i].fault != SpotFault::kNone) continue;
      if (std::abs(moments[i].variance_px2 - median) > limit) {
        ++deviating_;
        continue;
      }
      sum += moments[i].variance_px2;
      squares += std::pow(moments[i].variance_px2 - median, 2);
      noise2 += std::pow(moments[i].variance_sigma_px2, 2);
      ++count;
      used_.insert(i);
    }
    if (count < static_cast<int>(kMinOfFrame)) return std::nullopt;
    measured_ += count;
    const double scatter = std::sqrt(squares / (count - 1) / count);
    return model::Estimate{sum / count - kBoxPx2, std::max(scatter, std::sqrt(noise2) / count)};
  }

  static FreeRegistration RegistrationOf(const FittedMap& fitted) {
    FreeRegistration registration;
    Registration& free = registration.free;
    free.scale = std::hypot(fitted.map.a, fitted.map.b);
    free.scale_sigma = free.scale * std::hypot(fitted.scale_sigma / free.scale, kScaleBias);
    free.scale_x = free.scale_y = free.scale;
    free.rotation_rad = std::atan2(fitted.map.b, fitted.map.a);
    free.shift_px = {fitted.map.tx, fitted.map.ty};
    free.cubic = fitted.map.cubic;
    free.cubic_sigma = fitted.cubic_sigma;
    registration.scale_per_cubic = fitted.scale_per_cubic;
    return registration;
  }

  const FocusSweep& sweep_;
  const SpotPattern& pattern_;
  cv::Point2d centre_;
  std::vector<cv::Point2d> from_;  // places in the reference, less the centre
  std::vector<SpotMoments> last_;  // of the last frame
  std::map<SpotFault, int> left_out_;
  std::set<std::size_t> used_;
  int deviating_ = 0, measured_ = 0;
};

}  // namespace

SpotTracks FollowSpots(const FocusSweep& sweep,
                       const std::function<cv::Mat(std::size_t)>& read_grey,
                       const std::vector<std::size_t>& frames, std::size_t reference,
                       const std::function<void()>& tick) {
  SpotTracks tracks;
  tracks.reference = reference;
  const SpotPattern pattern = FindSpots(read_grey(reference));
  if (!pattern.done) {
    tracks.finding.message = pattern.message;
    return tracks;
  }
  Follower follower(sweep, pattern);
  std::vector<std::size_t> order = frames;
  std::stable_sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) {
    return sweep.frames[a].reading_mm < sweep.frames[b].reading_mm;
  });
  const auto at = std::find(order.begin(), order.end(), reference);
  if (at == order.end()) {
    tracks.finding.message = "the sharpest frame was rejected";
    return tracks;
  }
  SpotMap start;
  double start_sigma_px = pattern.sigma_px;
  if (follower.Measure(reference, read_grey(reference), &start, &start_sigma_px)) {
    follower.TakePlaces();
    start = {};
  }
  double reference_variance_px2 = 0;
  const auto follow = [&](auto from, auto to) {
    SpotMap map = start;
    double sigma_px = start_sigma_px;
    for (auto it = from; it != to; ++it) {
      const SpotMap before = map;
      std::optional<SpotFrame> found = follower.Measure(*it, read_grey(*it), &map, &sigma_px);
      if (tick) tick();
      if (!found) {
        map = before;
        continue;
      }
      if (*it == reference) {
        start = map;
        start_sigma_px = sigma_px;
        if (found->variance_px2) reference_variance_px2 = found->variance_px2->value;
      }
      tracks.frames.push_back(*found);
    }
  };
  follow(at, order.end());
  follow(std::make_reverse_iterator(at), order.rend());
  follower.Describe(&tracks.finding);
  for (SpotFrame& frame : tracks.frames) {
    if (!frame.variance_px2) continue;
    const double scale = frame.registration->free.scale;
    frame.registration->free.added_variance_px2 =
        frame.variance_px2->value - scale * scale * reference_variance_px2;
  }
  const auto with_blur =
      std::count_if(tracks.frames.begin(), tracks.frames.end(),
                    [](const SpotFrame& frame) { return frame.variance_px2.has_value(); });
  tracks.finding.done = with_blur >= static_cast<std::ptrdiff_t>(kMinFrames);
  tracks.finding.message =
      tracks.finding.done
          ? "done"
          : fmt::format("{} frames show at least {} of the {} points clearly, but {} are needed",
                        with_blur, kMinOfFrame, pattern.centres_px.size(), kMinFrames);
  return tracks;
}

std::vector<ScaleSample> ScalesOfSpots(const FocusSweep& sweep, const SpotTracks& tracks) {
  std::vector<ScaleSample> samples;
  std::vector<FreeRegistration> registrations;
  for (const SpotFrame& frame : tracks.frames) {
    if (!frame.registration) continue;
    registrations.push_back(*frame.registration);
    samples.push_back({frame.frame, sweep.frames[frame.frame].reading_mm,
                       frame.registration->free.scale, frame.registration->WithCubic(0, 0), false});
  }
  TakeOutDistortion(RegionCornerRadiusPx(sweep), registrations, &samples);
  // The reference was mapped to itself.
  for (ScaleSample& sample : samples) {
    if (sample.frame == tracks.reference)
      sample = {sample.frame, sample.reading_mm, 1.0, {}, false};
  }
  return samples;
}

}  // namespace thicklens::calib
