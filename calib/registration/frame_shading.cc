#include "calib/registration/frame_shading.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>
#include <utility>
#include <vector>

#include "calib/registration/frame_map.h"
#include "calib/sharpness/edge_pixels.h"
#include "thicklens/base/cancel.h"
#include "thicklens/base/parallel.h"
#include "thicklens/base/statistics.h"

namespace thicklens::calib {
namespace {

constexpr std::size_t kMaxShadingFrames = 16, kMinShadingFrames = 5;
constexpr int kShrunkSidePx = 48;    // shorter side of the shrunk frames
constexpr double kShrunkBlurPx = 1;  // of the shrunk frames; the blur of a lens hardly adds to it
constexpr int kMarginPx = 2;         // of the shrunk frames: the smoothing lacks its surroundings
constexpr int kShadingTerms = 13;
constexpr int kTermsOfFrame = 3;   // gain and slope
constexpr int kTilesOfTarget = 4;  // along each axis, for the jackknife
constexpr int kShadingRounds = 4;
constexpr double kCauchyOfShading = 2;  // width of the robust weight, in standard deviations
constexpr double kShadingSigmas = 5;
constexpr double kMinShading = 0.04;  // ln; less does not move a scale by its error
// Prior standard deviation of a term, and the number of shrunk pixels that share their errors.
constexpr double kPriorOfTerm = 2, kSharedPixels = 12;
constexpr double kMinPixels = 300;
// Largest standard deviation of the corner, ln, at which the field counts as determined.
constexpr double kKnownShading = 0.5;

using Terms = Eigen::Matrix<double, kShadingTerms, 1>;

Terms TermsAt(const Eigen::Vector2d& u) {
  const double x = u.x(), y = u.y(), x2 = x * x, y2 = y * y, r2 = x2 + y2;
  Terms terms;
  terms << x2, x * y, y2, x2 * x, x2 * y, x * y2, y2 * y, x2 * x2, x2 * x * y, x2 * y2, x * y2 * y,
      y2 * y2, r2 * r2 * r2;
  return terms;
}

bool SampleShrunk(const cv::Mat& image, const Eigen::Vector2d& at, double* value) {
  const int x = static_cast<int>(std::floor(at.x())), y = static_cast<int>(std::floor(at.y()));
  if (x < kMarginPx || y < kMarginPx || x + 1 >= image.cols - kMarginPx ||
      y + 1 >= image.rows - kMarginPx)
    return false;
  const double a = at.x() - x, b = at.y() - y;
  const auto* upper = image.ptr<float>(y) + x;
  const auto* lower = image.ptr<float>(y + 1) + x;
  *value = (1 - b) * ((1 - a) * upper[0] + a * upper[1]) + b * ((1 - a) * lower[0] + a * lower[1]);
  return true;
}

// One point of the target in one frame.
struct Seen {
  int frame;  // of the chosen ones
  double log_light;
  Eigen::Vector2d u;
  Terms terms;
  double weight;
};
struct TargetPoint {
  int tile;
  std::vector<Seen> seen;
};

class ShadingFit {
 public:
  ShadingFit(const FramePlaces& places, int threads) : places_(places), threads_(threads) {}

  FrameShading Run() {
    Choose();
    if (chosen_.size() < kMinShadingFrames) {
      result_.message = "too few frames could be registered";
      return result_;
    }
    Collect();
    if (static_cast<double>(points_.size()) < kMinPixels) {
      result_.message = "the frames share too little of the target";
      return result_;
    }
    Solve();
    return result_;
  }

 private:
  void Choose() {
    std::vector<const ScaleSample*> order;
    for (const ScaleSample& sample : places_.samples) {
      if (!sample.scale_is_from_reading) order.push_back(&sample);
    }
    std::stable_sort(order.begin(), order.end(), [](const ScaleSample* a, const ScaleSample* b) {
      return a->scale < b->scale;
    });
    const std::size_t count = std::min(order.size(), kMaxShadingFrames);
    for (std::size_t i = 0; i < count; ++i)
      chosen_.push_back(order[count == 1 ? 0 : i * (order.size() - 1) / (count - 1)]);
  }

  void Collect() {
    std::vector<cv::Mat> logs(chosen_.size());
    cv::Size size;
    ParallelFor(static_cast<int>(chosen_.size()), threads_, [&](int i) {
      const auto index = static_cast<std::size_t>(i);
      const cv::Mat grey = places_.read_grey(chosen_[index]->frame);
      const int factor = std::max(1, std::min(grey.cols, grey.rows) / kShrunkSidePx);
      logs[index] = LogOfLight(Smoothed(Shrunk(grey, factor), kShrunkBlurPx));
      if (i != 0) return;
      factor_ = factor;
      size = grey.size();
    });
    result_.centre_px = Eigen::Vector2d(places_.centre.x, places_.centre.y);
    result_.unit_px = std::hypot(std::max(places_.centre.x, size.width - 1 - places_.centre.x),
                                 std::max(places_.centre.y, size.height - 1 - places_.centre.y));
    size_ = size;
    std::vector<FrameMap> maps;
    for (const ScaleSample* sample : chosen_)
      maps.push_back(MapOf(sample->registration, places_.centre));
    const cv::Size shrunk = logs.front().size();
    for (int y = 0; y < shrunk.height; ++y) {
      ThrowIfCancelled();
      for (int x = 0; x < shrunk.width; ++x) {
        const Eigen::Vector2d q = factor_ * Eigen::Vector2d(x + 0.5, y + 0.5).array() - 0.5;
        TargetPoint point{(y * kTilesOfTarget / shrunk.height) * kTilesOfTarget +
                              x * kTilesOfTarget / shrunk.width,
                          {}};
        for (std::size_t i = 0; i < maps.size(); ++i) {
          const Eigen::Vector2d p = maps[i].linear * q + maps[i].offset;
          double value = 0;
          if (!SampleShrunk(logs[i], ((p.array() + 0.5) / factor_ - 0.5).matrix(), &value))
            continue;
          const Eigen::Vector2d u = (p - result_.centre_px) / result_.unit_px;
          point.seen.push_back({static_cast<int>(i), value, u, TermsAt(u), 1});
        }
        if (point.seen.size() >= 2) points_.push_back(std::move(point));
      }
    }
  }

  // Row of the gain of a frame; negative for the first one, to which the others are relative.
  static int RowOf(int frame) { return kShadingTerms + kTermsOfFrame * (frame - 1); }

  struct Equations {
    Eigen::MatrixXd normal;
    Eigen::VectorXd right;
  };

  Eigen::Index Size() const {
    return kShadingTerms + kTermsOfFrame * (static_cast<Eigen::Index>(chosen_.size()) - 1);
  }

  // Adds the normal equations of one point without the value of the target there:
  // sum w x x^T - (sum w x)(sum w x)^T/sum w. Only the lower triangle is filled.
  void Add(const TargetPoint& point, Equations* to) const {
    Eigen::VectorXd mean = Eigen::VectorXd::Zero(Size());
    double total = 0, light = 0;
    for (const Seen& seen : point.seen) {
      const double w = seen.weight;
      const Eigen::Vector3d own(1, seen.u.x(), seen.u.y());
      to->normal.topLeftCorner<kShadingTerms, kShadingTerms>() +=
          w * seen.terms * seen.terms.transpose();
      to->right.head<kShadingTerms>() += w * seen.log_light * seen.terms;
      mean.head<kShadingTerms>() += w * seen.terms;
      if (seen.frame > 0) {
        const int row = RowOf(seen.frame);
        to->normal.block<kTermsOfFrame, kShadingTerms>(row, 0) += w * own * seen.terms.transpose();
        to->normal.block<kTermsOfFrame, kTermsOfFrame>(row, row) += w * own * own.transpose();
        to->right.segment<kTermsOfFrame>(row) += w * seen.log_light * own;
        mean.segment<kTermsOfFrame>(row) += w * own;
      }
      total += w;
      light += w * seen.log_light;
    }
    if (!(total > 0)) return;
    to->normal.selfadjointView<Eigen::Lower>().rankUpdate(mean, -1 / total);
    to->right -= light / total * mean;
  }

  static Eigen::LDLT<Eigen::MatrixXd> Factor(const Equations& equations, double variance) {
    Eigen::MatrixXd normal = equations.normal.selfadjointView<Eigen::Lower>();
    const double prior = kSharedPixels * variance / (kPriorOfTerm * kPriorOfTerm);
    normal.diagonal().head<kShadingTerms>().array() += prior;
    normal.diagonal().array() += 1e-12 * normal.diagonal().maxCoeff();
    return normal.ldlt();
  }

  double ModelOf(const Seen& seen, const Eigen::VectorXd& answer) const {
    double value = answer.head<kShadingTerms>().dot(seen.terms);
    if (seen.frame > 0)
      value += answer.segment<kTermsOfFrame>(RowOf(seen.frame))
                   .dot(Eigen::Vector3d(1, seen.u.x(), seen.u.y()));
    return value;
  }

  // Sets the weights by the residuals; returns their variance.
  double Reweight(const Eigen::VectorXd& answer) {
    std::vector<double> rests;
    for (TargetPoint& point : points_) {
      double total = 0, mean = 0;
      for (const Seen& seen : point.seen) {
        total += seen.weight;
        mean += seen.weight * (seen.log_light - ModelOf(seen, answer));
      }
      for (const Seen& seen : point.seen)
        rests.push_back(seen.log_light - ModelOf(seen, answer) - mean / total);
    }
    std::vector<double> sizes;
    for (const double rest : rests) sizes.push_back(std::abs(rest));
    const double sigma = std::max(1e-5, 1.4826 * Median(sizes));
    std::size_t k = 0;
    for (TargetPoint& point : points_) {
      for (Seen& seen : point.seen)
        seen.weight = 1 / (1 + std::pow(rests[k++] / (kCauchyOfShading * sigma), 2));
    }
    return sigma * sigma;
  }

  void Solve() {
    constexpr int kTiles = kTilesOfTarget * kTilesOfTarget;
    std::vector<Equations> tiles;
    Eigen::VectorXd answer;
    double variance = 1e-4;
    Equations all;
    for (int round = 0; round < kShadingRounds; ++round) {
      ThrowIfCancelled();
      tiles.assign(kTiles, {Eigen::MatrixXd::Zero(Size(), Size()), Eigen::VectorXd::Zero(Size())});
      ParallelFor(kTiles, threads_, [&](int tile) {
        for (const TargetPoint& point : points_) {
          if (point.tile == tile) Add(point, &tiles[static_cast<std::size_t>(tile)]);
        }
      });
      all = {Eigen::MatrixXd::Zero(Size(), Size()), Eigen::VectorXd::Zero(Size())};
      for (const Equations& tile : tiles) {
        all.normal += tile.normal;
        all.right += tile.right;
      }
      answer = Factor(all, variance).solve(all.right);
      if (round + 1 < kShadingRounds) variance = Reweight(answer);
    }
    std::vector<Terms> without;
    for (const Equations& tile : tiles) {
      const Equations rest{all.normal - tile.normal, all.right - tile.right};
      without.emplace_back(Factor(rest, variance).solve(rest.right).head<kShadingTerms>());
    }
    // Where the target hardly moves, all parts of it agree that there is no shading; the prior then
    // gives the error.
    const Eigen::MatrixXd unit = Eigen::MatrixXd::Identity(Size(), kShadingTerms);
    const Eigen::MatrixXd formal =
        kSharedPixels * variance * Factor(all, variance).solve(unit).topRows(kShadingTerms);
    Describe(answer.head<kShadingTerms>(), without, formal);
  }

  void Describe(const Terms& terms, const std::vector<Terms>& without,
                const Eigen::MatrixXd& formal) {
    result_.terms = terms;
    const auto estimate = [&](const Terms& at) {
      double mean = 0, squares = 0;
      const auto count = static_cast<double>(without.size());
      for (const Terms& one : without) mean += one.dot(at) / count;
      for (const Terms& one : without) squares += std::pow(one.dot(at) - mean, 2);
      return model::Estimate{
          terms.dot(at), std::sqrt(std::max((count - 1) / count * squares, at.dot(formal * at)))};
    };
    const double right = size_.width - 1, bottom = size_.height - 1;
    const auto terms_at = [&](double x, double y) {
      return TermsAt((Eigen::Vector2d(x, y) - result_.centre_px) / result_.unit_px);
    };
    Terms corner = Terms::Zero();
    for (const double x : {0.0, right / 2, right}) {
      for (const double y : {0.0, bottom / 2, bottom}) {
        const Terms here = terms_at(x, y);
        if (x != right / 2 && y != bottom / 2) corner += 0.25 * here;
        const model::Estimate value = estimate(here);
        const bool is_there =
            std::abs(value.value) > std::max(kShadingSigmas * value.sigma, kMinShading);
        result_.is_significant |= is_there;
        result_.largest = std::max(result_.largest, std::abs(value.value));
      }
    }
    model::Estimate at_corner = estimate(corner);
    if (!(at_corner.sigma < kKnownShading)) {
      result_.is_significant = false;
      result_.message =
          "the image scale changes too little to distinguish shading of the frame from that of the "
          "target";
      return;
    }
    at_corner.value /= std::log(2.0);
    at_corner.sigma /= std::log(2.0);
    result_.corner_stops = at_corner;
    result_.done = true;
    result_.message = "fitted";
  }

  const FramePlaces& places_;
  const int threads_;
  FrameShading result_;
  std::vector<const ScaleSample*> chosen_;
  std::vector<TargetPoint> points_;
  int factor_ = 1;
  cv::Size size_;
};

}  // namespace

FrameShading MeasureShading(const FramePlaces& places, int threads) {
  return ShadingFit(places, threads).Run();
}

cv::Mat LogOfShading(const FrameShading& shading, cv::Size size) {
  cv::Mat logs(size, CV_32F);
  const Terms terms = shading.terms;
  for (int y = 0; y < size.height; ++y) {
    ThrowIfCancelled();
    auto* row = logs.ptr<float>(y);
    for (int x = 0; x < size.width; ++x) {
      const Eigen::Vector2d u = (Eigen::Vector2d(x, y) - shading.centre_px) / shading.unit_px;
      row[x] = static_cast<float>(terms.dot(TermsAt(u)));
    }
  }
  return logs;
}

}  // namespace thicklens::calib
