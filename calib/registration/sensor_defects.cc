#include "calib/registration/sensor_defects.h"

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>
#include <opencv2/imgproc.hpp>
#include <utility>

#include "calib/registration/frame_map.h"
#include "calib/sharpness/edge_pixels.h"
#include "thicklens/base/cancel.h"
#include "thicklens/base/parallel.h"

namespace thicklens::calib {
namespace {

constexpr std::size_t kFramesOfGroup = 5, kMinOfGroup = 2;
constexpr double kFineInnerPx = 1, kFineOuterPx = 3;  // band of the fine structure
constexpr double kCandidateSigmas = 4.5;              // in each group
constexpr double kMinFine = 0.006;                    // ln, of the fine structure of a candidate
constexpr int kBorderPx = 4;          // smoothing and prediction lack the surroundings of these
constexpr int kJoinPx = 4;            // parts of one speck are at most so far apart
constexpr double kLargestPart = 0.1;  // of the field that candidates may cover
constexpr int kMaxCandidates = 300;
constexpr int kAroundPx = 12;  // surroundings of a candidate that are compared with it
constexpr int kGrownPx = 8;    // reach of a speck beyond its candidate
constexpr double kSpeckSigmas = 6, kMinSpeck = 0.03;
constexpr double kSameInBoth = 0.4;  // least part of a speck that each group shows
constexpr double kEdgeSigmas = 2.5, kMinEdge = 0.006;  // where a speck ends
constexpr double kOpaque = 0.3;                        // a speck that lets through less is filled
constexpr double kBrightest = 1.6;                     // and so is one that is brighter
constexpr int kFewPixels = 4;
constexpr int kProofRounds = 3;
constexpr double kUnknownBlurPx2 = 100;  // added variance, where it was not measured
constexpr int kLargestCropPx = 384;
constexpr double kLineSigmas = 6, kMinLine = 0.002, kLineBandPx = 3, kClippedSigmas = 4;

// A candidate with its surroundings, in the frame.
struct Suspect {
  cv::Rect box;                // the candidate and kAroundPx around it
  cv::Mat candidate;           // CV_8U, not 0: candidate, filled
  cv::Mat surroundings;        // CV_8U, not 0: neither this candidate nor another one
  cv::Mat found;               // CV_32F, ln of the structure
  double sigma = 0;            // of `found` in the surroundings, smoothed
  double peak = 0, limit = 1;  // largest value of `found`, smoothed, and the required one
  bool proved = false;
  cv::Mat speck;  // CV_8U, pixels that the speck covers
};

// ln of a frame over the prediction from the reference, at a suspect.
struct Comparison {
  bool covered = false;
  cv::Mat residual;     // CV_32F
  double variance = 1;  // in the surroundings
};

double RobustDeviation(const cv::Mat& values, double* middle) {
  *middle = Quantile(values, 0.5);
  cv::Mat off = cv::abs(values - *middle);
  return std::max(1e-6, 1.4826 * Quantile(off, 0.5));
}

cv::Mat FineOf(const cv::Mat& logs) {
  return Smoothed(logs, kFineInnerPx) - Smoothed(logs, kFineOuterPx);
}

class DefectFinder {
 public:
  DefectFinder(const FramePlaces& places, std::size_t reference,
               const std::vector<double>& sharpness, int threads)
      : places_(places), reference_(reference), sharpness_(sharpness), threads_(threads) {}

  SensorDefects Run() {
    if (!ChooseGroups()) {
      result_.message = "too few frames could be registered";
      return std::move(result_);
    }
    MeanLogs();
    result_.log_gain = cv::Mat::zeros(logs_[0].size(), CV_32F);
    result_.filled = cv::Mat::zeros(logs_[0].size(), CV_8U);
    result_.done = true;
    result_.message = "examined";
    cv::Mat candidates = Candidates();
    cv::Mat even;  // not 0: outside the candidates
    cv::dilate(candidates, even, cv::Mat::ones(2 * kJoinPx + 1, 2 * kJoinPx + 1, CV_8U));
    even = even == 0;
    result_.column_deviation = FindLines(0, even);
    result_.row_deviation = FindLines(1, even);
    if (result_.column_deviation > 0 || result_.row_deviation > 0) candidates = Candidates();
    FindSuspects(candidates);
    if (suspects_.empty()) return std::move(result_);
    for (int round = 0; round < kProofRounds && !suspects_.empty(); ++round) {
      Prove();
      DropInnocent();
    }
    Keep();
    return std::move(result_);
  }

 private:
  // The most blurred frames, divided into those of smaller and of larger scale.
  bool ChooseGroups() {
    std::vector<const ScaleSample*> order;
    for (const ScaleSample& sample : places_.samples) {
      if (sample.frame == reference_ || sample.scale_is_from_reading) continue;
      order.push_back(&sample);
    }
    std::stable_sort(order.begin(), order.end(), [this](const auto* a, const auto* b) {
      return sharpness_[a->frame] < sharpness_[b->frame];
    });
    // At least a half of the frames is never used: they are too sharp.
    order.resize(std::min(order.size() / 2, 2 * kFramesOfGroup));
    std::stable_sort(order.begin(), order.end(),
                     [](const auto* a, const auto* b) { return a->scale < b->scale; });
    for (std::size_t i = 0; i < order.size(); ++i)
      groups_[i < order.size() / 2 ? 0 : 1].push_back(order[i]);
    return std::min(groups_[0].size(), groups_[1].size()) >= kMinOfGroup;
  }

  void MeanLogs() {
    ParallelFor(2, threads_, [&](int g) {
      const auto group = static_cast<std::size_t>(g);
      for (const ScaleSample* sample : groups_[group]) {
        ThrowIfCancelled();
        const cv::Mat logs = LogOfLight(places_.read_grey(sample->frame));
        if (logs_[group].empty()) {
          logs_[group] = logs;
        } else {
          logs_[group] += logs;
        }
      }
      logs_[group] /= static_cast<double>(groups_[group].size());
    });
  }

  // Columns (axis 0) or rows (axis 1) whose deviation from their neighbours is the same in both
  // groups, while that of one group at other places is not that of the other. Removes them from the
  // mean logs.
  double FindLines(int axis, const cv::Mat& even) {
    constexpr int kFirstShift = 7, kLastShift = 40;
    std::array<Eigen::VectorXd, 2> profiles;
    for (std::size_t g = 0; g < 2; ++g) {
      cv::Mat smooth, inside, sums, counts, means;
      const cv::Size across = axis == 0 ? cv::Size(0, 1) : cv::Size(1, 0);
      cv::GaussianBlur(logs_[g], smooth, across, kLineBandPx, kLineBandPx, cv::BORDER_REFLECT_101);
      const cv::Mat rest = logs_[g] - smooth;
      double middle = 0;
      const double limit = kClippedSigmas * RobustDeviation(rest, &middle);
      cv::Mat(cv::min(cv::max(rest, -limit), limit)).copyTo(inside, even);
      cv::reduce(inside, sums, axis, cv::REDUCE_SUM, CV_64F);
      cv::reduce(even, counts, axis, cv::REDUCE_SUM, CV_64F);
      cv::divide(sums, cv::max(counts / 255, 1), means);
      means = means.reshape(1, 1);
      profiles[g] = Eigen::Map<const Eigen::VectorXd>(means.ptr<double>(), means.cols);
    }
    const Eigen::Index n = profiles[0].size();
    if (n < 4 * kLastShift) return 0;
    // The outermost lines lack neighbours.
    const auto product = [&](Eigen::Index shift) {
      const Eigen::Index count = n - 2 * kLastShift;
      return profiles[0]
                 .segment(kLastShift, count)
                 .dot(profiles[1].segment(kLastShift + shift, count)) /
             static_cast<double>(count);
    };
    double mean = 0, squares = 0;
    int shifts = 0;
    for (int shift = kFirstShift; shift <= kLastShift; ++shift) {
      for (const int sign : {-1, 1}) {
        const double value = product(sign * shift);
        mean += value;
        squares += value * value;
        ++shifts;
      }
    }
    mean /= shifts;
    const double sigma = std::sqrt(std::max(0.0, squares / shifts - mean * mean));
    const double variance = product(0) - mean;
    if (!(variance > kLineSigmas * sigma) || !(variance > kMinLine * kMinLine)) return 0;
    const Eigen::VectorXd both = 0.5 * (profiles[0] + profiles[1]);
    const double share = std::min(1.0, variance * static_cast<double>(n) / both.squaredNorm());
    cv::Mat line(1, static_cast<int>(n), CV_32F);
    for (Eigen::Index i = 0; i < n; ++i)
      line.at<float>(static_cast<int>(i)) = static_cast<float>(share * both[i]);
    const cv::Size size = logs_[0].size();
    const cv::Mat lines = axis == 0
                              ? cv::repeat(line, size.height, 1)
                              : cv::repeat(line.reshape(1, static_cast<int>(n)), 1, size.width);
    result_.log_gain += lines;
    for (cv::Mat& logs : logs_) logs -= lines;
    return std::sqrt(variance);
  }

  // Pixels that stand out of the fine structure of both groups, CV_8U.
  cv::Mat Candidates() const {
    cv::Mat candidates;
    std::array<cv::Mat, 2> fine;
    for (std::size_t g = 0; g < 2; ++g) {
      fine[g] = FineOf(logs_[g]);
      double middle = 0;
      const double limit = std::max(kMinFine, kCandidateSigmas * RobustDeviation(fine[g], &middle));
      const cv::Mat outside = cv::abs(fine[g]) > limit;
      candidates = candidates.empty() ? outside : cv::Mat(candidates & outside);
    }
    candidates &= fine[0].mul(fine[1]) > 0;
    const cv::Rect inner(kBorderPx, kBorderPx, candidates.cols - 2 * kBorderPx,
                         candidates.rows - 2 * kBorderPx);
    cv::Mat inside = cv::Mat::zeros(candidates.size(), CV_8U);
    candidates(inner).copyTo(inside(inner));
    return inside;
  }

  void FindSuspects(const cv::Mat& candidates) {
    for (cv::Mat& logs : logs_) logs.release();
    const double area = cv::countNonZero(candidates);
    if (area == 0) return;
    if (area > kLargestPart * static_cast<double>(candidates.total())) {
      result_.message =
          "the target is not blurred enough to distinguish its detail from that of the frame";
      return;
    }
    cv::Mat joined, labels, statistics, centroids;
    const cv::Mat disc =
        cv::getStructuringElement(cv::MORPH_ELLIPSE, cv::Size(2 * kJoinPx + 1, 2 * kJoinPx + 1));
    cv::morphologyEx(candidates, joined, cv::MORPH_CLOSE, disc);
    std::vector<std::vector<cv::Point>> outlines;
    cv::findContours(joined, outlines, cv::RETR_EXTERNAL, cv::CHAIN_APPROX_NONE);
    joined.setTo(0);
    cv::drawContours(joined, outlines, -1, 255, cv::FILLED);
    const int count =
        cv::connectedComponentsWithStats(joined, labels, statistics, centroids, 8, CV_32S);
    if (count - 1 > kMaxCandidates) {
      result_.message = "more places differ than specks could be distinguished from the target";
      return;
    }
    cv::Mat grown;
    cv::dilate(joined, grown, cv::Mat::ones(2 * kGrownPx - 3, 2 * kGrownPx - 3, CV_8U));
    const cv::Rect whole(0, 0, joined.cols, joined.rows);
    for (int label = 1; label < count; ++label) {
      const cv::Rect box(statistics.at<int>(label, cv::CC_STAT_LEFT),
                         statistics.at<int>(label, cv::CC_STAT_TOP),
                         statistics.at<int>(label, cv::CC_STAT_WIDTH),
                         statistics.at<int>(label, cv::CC_STAT_HEIGHT));
      if (std::max(box.width, box.height) > std::min(whole.width, whole.height) / 3) continue;
      Suspect suspect;
      suspect.box = cv::Rect(box.x - kAroundPx, box.y - kAroundPx, box.width + 2 * kAroundPx,
                             box.height + 2 * kAroundPx) &
                    whole;
      suspect.candidate = labels(suspect.box) == label;
      suspect.surroundings = grown(suspect.box) == 0;
      if (cv::countNonZero(suspect.surroundings) < 50) continue;
      suspects_.push_back(std::move(suspect));
    }
  }

  // The kernel that turns the reference, in the geometry of the frame, into the frame: the mean of
  // the transfer function over the directions, within a crop around the middle of the shared field.
  static cv::Mat KernelBetween(const cv::Mat& reference, const cv::Mat& frame, const FrameMap& map,
                               const cv::Rect2d& shared, double added_variance_px2) {
    const int side = std::min(kLargestCropPx,
                              static_cast<int>(std::min(shared.width, shared.height)) / 2 * 2 - 2);
    if (side < 48) return {};
    const cv::Rect crop(static_cast<int>(shared.x + 0.5 * (shared.width - side)),
                        static_cast<int>(shared.y + 0.5 * (shared.height - side)), side, side);
    cv::Mat window;
    cv::createHanningWindow(window, crop.size(), CV_32F);
    std::array<cv::Mat, 2> spectra;
    for (std::size_t i = 0; i < 2; ++i) {
      cv::Mat part = i == 0 ? InFrameGeometry(reference, map, 1, crop) : frame(crop).clone();
      part /= cv::mean(part)[0];
      part = (part - 1).mul(window);
      cv::dft(part, spectra[i], cv::DFT_COMPLEX_OUTPUT);
    }
    const auto radius_of = [side](int x, int y) {
      return std::hypot(x <= side / 2 ? x : x - side, y <= side / 2 ? y : y - side);
    };
    std::vector<double> cross(static_cast<std::size_t>(side) + 2, 0), power(cross.size(), 0);
    for (int y = 0; y < side; ++y) {
      const auto* r = spectra[0].ptr<cv::Vec2f>(y);
      const auto* f = spectra[1].ptr<cv::Vec2f>(y);
      for (int x = 0; x < side; ++x) {
        const auto ring = static_cast<std::size_t>(std::lround(radius_of(x, y)));
        cross[ring] += static_cast<double>(f[x][0] * r[x][0] + f[x][1] * r[x][1]);
        power[ring] += static_cast<double>(r[x][0] * r[x][0] + r[x][1] * r[x][1]);
      }
    }
    std::vector<double> transfer(cross.size(), 0);
    for (std::size_t ring = 0; ring < cross.size(); ++ring)
      transfer[ring] = power[ring] > 0 ? cross[ring] / power[ring] : 0;
    // The mean was subtracted, and the window's own width spoils its neighbours.
    transfer[0] = transfer[1] = transfer[2];
    cv::Mat filter(side, side, CV_32FC2);
    for (int y = 0; y < side; ++y) {
      auto* row = filter.ptr<cv::Vec2f>(y);
      for (int x = 0; x < side; ++x) {
        const double radius = radius_of(x, y);
        const auto ring = static_cast<std::size_t>(radius);
        const double part = radius - std::floor(radius);
        row[x] = cv::Vec2f(
            static_cast<float>((1 - part) * transfer[ring] + part * transfer[ring + 1]), 0);
      }
    }
    cv::Mat response;
    cv::dft(filter, response, cv::DFT_INVERSE | cv::DFT_SCALE | cv::DFT_REAL_OUTPUT);
    const int reach = std::clamp(
        static_cast<int>(std::ceil(3.5 * std::sqrt(std::max(1.0, added_variance_px2)))) + 2, 4,
        side / 4);
    cv::Mat kernel(2 * reach + 1, 2 * reach + 1, CV_32F);
    for (int y = -reach; y <= reach; ++y) {
      for (int x = -reach; x <= reach; ++x)
        kernel.at<float>(y + reach, x + reach) =
            response.at<float>((y + side) % side, (x + side) % side);
    }
    return kernel / cv::sum(kernel)[0];
  }

  // Compares one frame with the corrected reference at every suspect.
  // `kernel` is measured if it is empty.
  std::vector<Comparison> Compare(const ScaleSample& sample, const cv::Mat& reference,
                                  cv::Mat* kernel) const {
    std::vector<Comparison> comparisons(suspects_.size());
    const cv::Mat grey = Corrected(places_.read_grey(sample.frame), lines_only_);
    const FrameMap map = MapOf(sample.registration, places_.centre);
    if (kernel->empty()) {
      *kernel = KernelBetween(reference, grey, map, SharedField(map, reference.size(), grey.size()),
                              sample.registration.added_variance_px2.value_or(kUnknownBlurPx2));
    }
    if (kernel->empty()) return comparisons;
    const int reach = kernel->cols / 2;
    const Eigen::Matrix2d inverse = map.linear.inverse();
    for (std::size_t k = 0; k < suspects_.size(); ++k) {
      ThrowIfCancelled();
      const Suspect& suspect = suspects_[k];
      const cv::Rect wide(suspect.box.x - reach, suspect.box.y - reach,
                          suspect.box.width + 2 * reach, suspect.box.height + 2 * reach);
      // Beyond the reference its last pixels are repeated. The error shows in the surroundings.
      bool covered = true;
      for (const cv::Point& p : {suspect.box.tl(), suspect.box.br()}) {
        const Eigen::Vector2d q = inverse * (Eigen::Vector2d(p.x, p.y) - map.offset);
        covered &=
            q.x() > -1 && q.y() > -1 && q.x() < reference.cols + 1 && q.y() < reference.rows + 1;
      }
      if (!covered) continue;
      cv::Mat predicted;
      cv::filter2D(InFrameGeometry(reference, map, 1, wide), predicted, CV_32F, *kernel);
      predicted = predicted(cv::Rect(reach, reach, suspect.box.width, suspect.box.height));
      cv::Mat residual = LogOfLight(grey(suspect.box)) - LogOfLight(predicted);
      FitPlaneAround(suspect.surroundings, &residual);
      cv::Scalar mean, deviation;
      cv::meanStdDev(residual, mean, deviation, suspect.surroundings);
      comparisons[k] = {true, residual, std::max(1e-8, deviation[0] * deviation[0])};
    }
    return comparisons;
  }

  // Subtracts the plane that fits the surroundings.
  static void FitPlaneAround(const cv::Mat& surroundings, cv::Mat* residual) {
    Eigen::Matrix3d normal = Eigen::Matrix3d::Zero();
    Eigen::Vector3d right = Eigen::Vector3d::Zero();
    for (int y = 0; y < residual->rows; ++y) {
      for (int x = 0; x < residual->cols; ++x) {
        if (surroundings.at<uchar>(y, x) == 0) continue;
        const Eigen::Vector3d at(1, x, y);
        normal += at * at.transpose();
        right += static_cast<double>(residual->at<float>(y, x)) * at;
      }
    }
    const Eigen::Vector3d plane = normal.ldlt().solve(right);
    for (int y = 0; y < residual->rows; ++y) {
      auto* row = residual->ptr<float>(y);
      for (int x = 0; x < residual->cols; ++x)
        row[x] -= static_cast<float>(plane.dot(Eigen::Vector3d(1, x, y)));
    }
  }

  static cv::Mat Corrected(const cv::Mat& grey, const cv::Mat& log_gain) {
    if (log_gain.empty()) return grey;
    cv::Mat inverse;
    cv::exp(-log_gain, inverse);
    return grey.mul(inverse);
  }

  void Prove() {
    if (lines_only_.empty() && (result_.column_deviation > 0 || result_.row_deviation > 0))
      lines_only_ = result_.log_gain.clone();
    cv::Mat known =
        lines_only_.empty() ? cv::Mat::zeros(result_.log_gain.size(), CV_32F) : lines_only_.clone();
    for (const Suspect& suspect : suspects_) {
      if (!suspect.proved) continue;
      cv::Mat part = known(suspect.box);
      cv::add(part, suspect.found, part, suspect.speck);
    }
    const cv::Mat reference = Corrected(places_.read_grey(reference_), known);
    std::vector<std::pair<std::size_t, const ScaleSample*>> frames;
    for (std::size_t g = 0; g < 2; ++g) {
      for (const ScaleSample* sample : groups_[g]) frames.emplace_back(g, sample);
    }
    kernels_.resize(frames.size());
    std::vector<std::vector<Comparison>> all(frames.size());
    ParallelFor(static_cast<int>(frames.size()), threads_, [&](int i) {
      const auto index = static_cast<std::size_t>(i);
      all[index] = Compare(*frames[index].second, reference, &kernels_[index]);
    });
    ParallelFor(static_cast<int>(suspects_.size()), threads_, [&](int k) {
      const auto suspect = static_cast<std::size_t>(k);
      std::array<cv::Mat, 2> sums;
      std::array<double, 2> weights = {0, 0};
      for (std::size_t i = 0; i < frames.size(); ++i) {
        const Comparison& one = all[i][suspect];
        if (!one.covered) continue;
        const std::size_t g = frames[i].first;
        const cv::Mat weighted = one.residual / one.variance;
        sums[g] = sums[g].empty() ? weighted : cv::Mat(sums[g] + weighted);
        weights[g] += 1 / one.variance;
      }
      Judge(sums, weights, &suspects_[suspect]);
    });
  }

  // A speck is seen through its own blurred image in the reference, which leaves most of it. What
  // shows less than a half of what is required is none.
  void DropInnocent() {
    suspects_.erase(std::remove_if(suspects_.begin(), suspects_.end(),
                                   [](const Suspect& suspect) {
                                     return !suspect.proved && suspect.peak < 0.5 * suspect.limit;
                                   }),
                    suspects_.end());
    const bool any = std::any_of(suspects_.begin(), suspects_.end(),
                                 [](const Suspect& suspect) { return suspect.proved; });
    if (!any) suspects_.clear();
  }

  static void Judge(const std::array<cv::Mat, 2>& sums, const std::array<double, 2>& weights,
                    Suspect* suspect) {
    suspect->proved = false;
    suspect->peak = 0;
    if (!(weights[0] + weights[1] > 0)) return;
    suspect->found = cv::Mat::zeros(suspect->box.size(), CV_32F);
    for (std::size_t g = 0; g < 2; ++g) {
      if (weights[g] > 0) suspect->found += sums[g] / (weights[0] + weights[1]);
    }
    const cv::Mat smooth = Smoothed(suspect->found, kFineInnerPx);
    cv::Scalar mean, deviation;
    cv::meanStdDev(smooth, mean, deviation, suspect->surroundings);
    suspect->sigma = std::max(1e-5, deviation[0]);
    double& peak = suspect->peak;
    cv::Point at;
    cv::minMaxLoc(cv::abs(smooth), nullptr, &peak, nullptr, &at, suspect->candidate);
    suspect->limit = std::max(kSpeckSigmas * suspect->sigma, kMinSpeck);
    if (!(peak > suspect->limit)) return;
    const double sign = smooth.at<float>(at) > 0 ? 1 : -1;
    for (std::size_t g = 0; g < 2; ++g) {
      if (!(weights[g] > 0)) continue;
      const cv::Mat own = Smoothed(sums[g] / weights[g], kFineInnerPx);
      if (!(sign * static_cast<double>(own.at<float>(at)) > kSameInBoth * peak)) return;
    }
    suspect->proved = true;
    cv::Mat grown, labels;
    cv::dilate(
        suspect->candidate, grown,
        cv::getStructuringElement(cv::MORPH_ELLIPSE, cv::Size(2 * kGrownPx + 1, 2 * kGrownPx + 1)));
    const double limit = std::max(kEdgeSigmas * suspect->sigma, kMinEdge);
    const cv::Mat outside = (sign * smooth > limit) & grown;
    cv::connectedComponents(outside, labels, 8, CV_32S);
    suspect->speck = labels == labels.at<int>(at);
    cv::dilate(suspect->speck, suspect->speck, cv::Mat::ones(3, 3, CV_8U));
  }

  void Keep() {
    for (const Suspect& suspect : suspects_) {
      if (!suspect.proved) continue;
      double low = 0, high = 0;
      cv::minMaxLoc(suspect.found, &low, &high, nullptr, nullptr, suspect.speck);
      const double most = std::max(-low, high);
      const cv::Mat strong = (cv::abs(suspect.found) > 0.5 * most) & suspect.speck;
      cv::Mat filled = result_.filled(suspect.box);
      const int pixels = cv::countNonZero(strong);
      if (pixels <= kFewPixels) {
        result_.defective_px += pixels;
        const cv::Mat clear = (cv::abs(suspect.found) > 0.1 * most) & suspect.speck;
        filled.setTo(255, clear);
        continue;
      }
      ++result_.specks;
      result_.deepest_speck =
          std::max(result_.deepest_speck, std::max(1 - std::exp(low), std::exp(high) - 1));
      if (std::exp(low) < kOpaque || std::exp(high) > kBrightest) {
        filled.setTo(255, suspect.speck);
        continue;
      }
      cv::Mat gain = result_.log_gain(suspect.box);
      cv::add(gain, suspect.found, gain, suspect.speck);
      result_.divided_share += cv::countNonZero(suspect.speck);
    }
    result_.divided_share /= static_cast<double>(result_.filled.total());
    result_.filled_share =
        cv::countNonZero(result_.filled) / static_cast<double>(result_.filled.total());
  }

  const FramePlaces& places_;
  const std::size_t reference_;
  const std::vector<double>& sharpness_;
  const int threads_;
  SensorDefects result_;
  std::array<std::vector<const ScaleSample*>, 2> groups_;
  std::array<cv::Mat, 2> logs_;  // mean ln light of each group
  cv::Mat lines_only_;           // log gain of columns and rows; empty: none
  std::vector<Suspect> suspects_;
  std::vector<cv::Mat> kernels_;  // of the frames of both groups, from the first round on
};

}  // namespace

SensorDefects FindSensorDefects(const FramePlaces& places, std::size_t reference,
                                const std::vector<double>& sharpness, int threads) {
  return DefectFinder(places, reference, sharpness, threads).Run();
}

SensorDefects WithMore(const SensorDefects& before, const SensorDefects& more) {
  if (before.log_gain.empty()) return more;
  if (more.log_gain.empty() || !more.Any()) return before;
  SensorDefects both = before;
  // The matrices of `before` may be in use elsewhere: these are new ones.
  both.log_gain = cv::Mat();
  both.filled = cv::Mat();
  cv::add(before.log_gain, more.log_gain, both.log_gain);
  cv::bitwise_or(before.filled, more.filled, both.filled);
  both.column_deviation = std::max(before.column_deviation, more.column_deviation);
  both.row_deviation = std::max(before.row_deviation, more.row_deviation);
  both.defective_px = before.defective_px + more.defective_px;
  // Unequal columns and rows are weaker than the weakest speck.
  const cv::Mat divided = (cv::abs(both.log_gain) > kMinSpeck) & (both.filled == 0);
  cv::Mat labels, statistics, centroids;
  const int count = cv::connectedComponentsWithStats(divided | both.filled, labels, statistics,
                                                     centroids, 8, CV_32S);
  both.specks = 0;
  for (int label = 1; label < count; ++label)
    both.specks += statistics.at<int>(label, cv::CC_STAT_AREA) > kFewPixels;
  double low = 0, high = 0;
  cv::minMaxLoc(both.log_gain, &low, &high, nullptr, nullptr, both.filled == 0);
  both.deepest_speck = std::max(1 - std::exp(low), std::exp(high) - 1);
  const auto share = [&](const cv::Mat& mask) {
    return cv::countNonZero(mask) / static_cast<double>(mask.total());
  };
  both.divided_share = share(divided);
  both.filled_share = share(both.filled);
  return both;
}

}  // namespace thicklens::calib
