#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <limits>

#include "calib/edges/edge_profile.h"
#include "calib/edges/step_fit.h"
#include "calib/edges/step_search.h"

namespace thicklens::calib {
namespace {

constexpr int kMinPixels = 100;
constexpr int kMaxPixels = 16000;
// Minimum angle between two edges that count as crossing.
constexpr double kMinAngleRad = 0.9;

enum Parameter {
  kX,
  kY,
  kTurn,                    // turn of the normal of the more vertical edge
  kSecondTurn = kTurn + 1,  // turn of the other normal, from a right angle to the first
  kVariance,
  kSecondVariance,
  kMean,
  kHalf = kMean + 3,
  kParameters = kHalf + 3
};

// Model of the grey values around an X corner (derived here, [D84]):
//   I = A + B [S1(d1) S2(d2) + 4 c E1'(d1) E2'(d2) + 2 c^2 E1''(d1) E2''(d2)], S = 2 E - 1.
// A (mean) and B (half the contrast) are planes, d the distances from the edges, E their profiles.
// The product holds for edges at a right angle and blurs that separate; c = n1.n2 (sigma^2 + 1/12)
// is the covariance, px^2, of blur and pixel along the two normals. For Gaussians dI/dc is the
// derivative of I with respect to d1 and d2. Two orders in c are good to 1e-3 B within 15 degrees
// of a right angle. A disc does not separate; the pixels where both of its profiles rise are
// therefore left out.
class CornerModel : public StepModel<kParameters> {
 public:
  using StepModel::StepModel;

  bool operator()(const double* p, double* residuals, double* jacobian) const {
    const double angle1 = strip_.normal_rad + p[kTurn];
    const double angle2 = strip_.normal_rad + CV_PI / 2 + p[kSecondTurn];
    const double c1 = std::cos(angle1), s1 = std::sin(angle1);
    const double c2 = std::cos(angle2), s2 = std::sin(angle2);
    const EdgeProfile profile1(psf_, std::min(p[kVariance], LargestVariance()), floor_px_, angle1);
    const EdgeProfile profile2(psf_, std::min(p[kSecondVariance], LargestVariance()), floor_px_,
                               angle2);
    const double covariance_px2 =
        (c1 * c2 + s1 * s2) * ((p[kVariance] + p[kSecondVariance]) / 2 + 1.0 / 12);
    const auto n = static_cast<Eigen::Index>(pixels_.size());
    Eigen::Map<Eigen::MatrixXd> j = AsMatrix(jacobian);
    for (Eigen::Index i = 0; i < n; ++i) {
      const auto pixel = static_cast<std::size_t>(i);
      const double x = pixels_.x_px[pixel] - p[kX], y = pixels_.y_px[pixel] - p[kY];
      const EdgeProfile::Value e1 = profile1.At(x * c1 + y * s1);
      const EdgeProfile::Value e2 = profile2.At(x * c2 + y * s2);
      const double step1 = 2 * e1.level - 1, step2 = 2 * e2.level - 1;
      const double u = pixels_.x_px[pixel] * PlaneScale(), v = pixels_.y_px[pixel] * PlaneScale();
      const double half = p[kHalf] + p[kHalf + 1] * u + p[kHalf + 2] * v;
      // E'' is twice the derivative with respect to the variance.
      const double pattern =
          step1 * step2 + 4 * covariance_px2 * e1.slope * e2.slope +
          8 * covariance_px2 * covariance_px2 * e1.per_variance * e2.per_variance;
      residuals[i] = p[kMean] + p[kMean + 1] * u + p[kMean + 2] * v + half * pattern -
                     pixels_.grey[pixel] / unit_;
      if (jacobian == nullptr) continue;
      const double by1 = 2 * half * e1.slope * step2, by2 = 2 * half * e2.slope * step1;
      j(i, kX) = -by1 * c1 - by2 * c2;
      j(i, kY) = -by1 * s1 - by2 * s2;
      j(i, kTurn) = by1 * (y * c1 - x * s1);
      j(i, kSecondTurn) = by2 * (y * c2 - x * s2);
      j(i, kVariance) = 2 * half * e1.per_variance * step2;
      j(i, kSecondVariance) = 2 * half * e2.per_variance * step1;
      j(i, kMean) = 1;
      j(i, kMean + 1) = u;
      j(i, kMean + 2) = v;
      j(i, kHalf) = pattern;
      j(i, kHalf + 1) = pattern * u;
      j(i, kHalf + 2) = pattern * v;
    }
    return true;
  }

 private:
  double PlaneScale() const { return 1 / strip_.half_width_px; }
};

class CornerFit : StepSearch<CornerModel> {
 public:
  using StepSearch::StepSearch;

  std::optional<EdgeSpreadFit> Run() {
    parameters_.setZero();
    if (!(feature_.half_width_px >= 4) || !Seed()) return std::nullopt;
    for (int round = 0; round < 2; ++round) {
      const double sigma_px = LargerSigma();
      if (!(feature_.half_width_px >= LeastHalfWidthPx(sigma_px))) return std::nullopt;
      if (!Gather(StripHalfWidthPx(sigma_px), psf_ == model::Psf::kDisc)) return std::nullopt;
      Solve();
      if (!IsPlausible()) return std::nullopt;
    }
    return Result();
  }

 private:
  double LargerSigma() const {
    return SigmaOf(std::max(parameters_[kVariance], parameters_[kSecondVariance]));
  }

  bool Gather(double arm_px, bool without_core) {
    feature_.centre_px += Eigen::Vector2d(parameters_[kX], parameters_[kY]);
    feature_.angle_rad += parameters_[kTurn];
    parameters_[kSecondTurn] -= parameters_[kTurn];
    parameters_[kX] = parameters_[kY] = parameters_[kTurn] = 0;
    const double half_px = std::min(feature_.half_width_px, 60.0);
    strip_ = {feature_.centre_px, feature_.angle_rad, half_px, half_px, arm_px};
    pixels_ = GatherPixels(grey_, strip_, kMaxPixels);
    if (without_core) DropCore();
    return pixels_.size() >= kMinPixels && pixels_.coverage > 0.9 && StartLevels();
  }

  void DropCore() {
    const double angle1 = strip_.normal_rad, angle2 = angle1 + CV_PI / 2 + parameters_[kSecondTurn];
    const EdgeProfile first(psf_, parameters_[kVariance], floor_px_, angle1);
    const EdgeProfile second(psf_, parameters_[kSecondVariance], floor_px_, angle2);
    const auto rises = [](double level) { return level > 0.005 && level < 0.995; };
    FeaturePixels kept;
    kept.cells = pixels_.cells;
    kept.coverage = pixels_.coverage;
    bool last_kept = false;
    for (std::size_t i = 0; i < pixels_.size(); ++i) {
      const double x = pixels_.x_px[i], y = pixels_.y_px[i];
      const bool is_core = rises(first.At(x * std::cos(angle1) + y * std::sin(angle1)).level) &&
                           rises(second.At(x * std::cos(angle2) + y * std::sin(angle2)).level);
      if (!is_core) {
        kept.x_px.push_back(x);
        kept.y_px.push_back(y);
        kept.grey.push_back(pixels_.grey[i]);
        kept.cell.push_back(pixels_.cell[i]);
        kept.next_to_last.push_back(last_kept ? pixels_.next_to_last[i] : '\0');
      }
      last_kept = !is_core;
    }
    pixels_ = std::move(kept);
  }

  // The side is the sign of d1 d2 in the frame of the first normal; the second normal is nearly at
  // a right angle to it.
  bool StartLevels() {
    const double c = std::cos(strip_.normal_rad), s = std::sin(strip_.normal_rad);
    const auto means = MeansOfSides(
        [&](double x, double y) { return (x * c + y * s) * (y * c - x * s) > 0 ? 1 : 0; });
    if (!means) return false;
    const double low = (*means)[0], high = (*means)[1];
    if (!(std::abs(high - low) > 0)) return false;
    unit_ = std::abs(high - low) / 200;
    parameters_.segment<6>(kMean).setZero();
    parameters_[kMean] = (high + low) / 2 / unit_;
    parameters_[kHalf] = (high - low) / 2 / unit_;
    return true;
  }

  bool Seed() {
    if (!Gather(std::numeric_limits<double>::infinity(), false)) return false;
    return SolveFromSeveral(
        feature_.half_width_px,
        [this](double variance_px2) {
          parameters_[kVariance] = parameters_[kSecondVariance] = variance_px2;
        },
        [this] { return IsPlausible(); });
  }

  bool IsPlausible() const {
    const double width_px = feature_.half_width_px;
    const double between_rad = CV_PI / 2 + parameters_[kSecondTurn] - parameters_[kTurn];
    return parameters_.allFinite() && std::hypot(parameters_[kX], parameters_[kY]) < width_px &&
           between_rad > kMinAngleRad && between_rad < CV_PI - kMinAngleRad &&
           std::min(parameters_[kVariance], parameters_[kSecondVariance]) > -1 &&
           LargerSigma() < width_px;
  }

  std::optional<EdgeSpreadFit> Result() const {
    const Ending end = AtTheEnd();
    std::vector<double> bright(pixels_.size());
    const double sign = parameters_[kHalf] > 0 ? 1 : -1;
    for (std::size_t i = 0; i < pixels_.size(); ++i) {
      // The Jacobian's column of the half contrast is the pattern, from -1 to 1.
      bright[i] = (1 + sign * end.jacobian(static_cast<Eigen::Index>(i), kHalf)) / 2;
    }
    const auto judgement = Judge(end, bright, 2 * std::abs(parameters_[kHalf]));
    if (!judgement) return std::nullopt;
    BlurSigma first = BlurOf(kVariance, judgement->covariance);
    BlurSigma second = BlurOf(kSecondVariance, judgement->covariance);
    if (!IsDetermined(first) || !IsDetermined(second)) return std::nullopt;

    EdgeSpreadFit fit;
    fit.feature = feature_;
    fit.feature.centre_px += Eigen::Vector2d(parameters_[kX], parameters_[kY]);
    double angle1 = strip_.normal_rad + parameters_[kTurn];
    double angle2 = strip_.normal_rad + CV_PI / 2 + parameters_[kSecondTurn];
    if (std::abs(std::cos(angle2)) > std::abs(std::cos(angle1))) {
      std::swap(first, second);
      std::swap(angle1, angle2);
    }
    // The normal of a corner has no sense of direction.
    fit.feature.angle_rad = std::remainder(angle1, CV_PI);
    fit.across_x = first;
    fit.across_y = second;
    fit.chi2_per_dof = judgement->quality.chi2_per_dof;
    return fit;
  }
};

}  // namespace

std::optional<EdgeSpreadFit> FitCorner(const cv::Mat& grey, const EdgeFeature& feature,
                                       model::Psf psf, double floor_px) {
  return CornerFit(grey, feature, psf, floor_px).Run();
}

}  // namespace thicklens::calib
