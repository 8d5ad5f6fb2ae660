#include <Eigen/Dense>
#include <algorithm>
#include <cmath>

#include "calib/edges/edge_profile.h"
#include "calib/edges/step_fit.h"
#include "calib/edges/step_search.h"

namespace thicklens::calib {
namespace {

constexpr int kMinPixels = 60;
constexpr int kSeedPixels = 1500;
constexpr int kMaxPixels = 16000;
// A sag beyond this part of the edge's length is a curve, not an edge that distortion has bent.
constexpr double kLargestSag = 0.02;

enum Parameter {
  kShift,
  kTurn,
  kSag,
  kVariance,
  kDark,
  kRise = kDark + 3,
  kDarkBowl = kRise + 3,
  kRiseBowl,
  kParameters
};

// Model of the grey values of the pixels in a strip (derived here, [D83]):
//   I = D + C E(d), d = x cos a + y sin a - shift - sag b, b = t^2/T^2 - 1/3.
// t is the coordinate along the edge, T half its length, E the profile for the direction a and the
// variance of the blur. D (dark) and C (bright minus dark) are each a plane in x and y. For an edge
// that is long relative to its frame they also contain a multiple of b + d^2/T^2, because with a
// lens that darkens towards its corners both fall off with the square of the distance from the
// axis. Without that term, the fit bends the edge to follow the levels, and takes the bow for blur:
// a part of sigma^2 that grows with the fourth power of T. An edge shorter than the width of the
// strip cannot separate d^2 from blur; its levels bend only along the edge.
class EdgeModel : public StepModel<kParameters> {
 public:
  using StepModel::StepModel;

  bool operator()(const double* p, double* residuals, double* jacobian) const {
    const double angle = strip_.normal_rad + p[kTurn];
    const double c = std::cos(angle), s = std::sin(angle);
    const EdgeProfile profile(psf_, std::min(p[kVariance], LargestVariance()), floor_px_, angle);
    const auto n = static_cast<Eigen::Index>(pixels_.size());
    Eigen::Map<Eigen::MatrixXd> j = AsMatrix(jacobian);
    for (Eigen::Index i = 0; i < n; ++i) {
      const auto pixel = static_cast<std::size_t>(i);
      const double x = pixels_.x_px[pixel], y = pixels_.y_px[pixel];
      const double along = y * c - x * s;
      const double bow = Bow(along);
      const EdgeProfile::Value e = profile.At(x * c + y * s - p[kShift] - p[kSag] * bow);
      const double u = x * PlaneScale(), v = y * PlaneScale();
      const double bowl = Bowl(bow, x * c + y * s);
      const double rise = Rise(p, u, v, bowl);
      residuals[i] = Dark(p, u, v, bowl) + rise * e.level - pixels_.grey[pixel] / unit_;
      if (jacobian == nullptr) continue;
      j(i, kShift) = -rise * e.slope;
      j(i, kTurn) = rise * e.slope * along;
      j(i, kSag) = -rise * e.slope * bow;
      j(i, kVariance) = rise * e.per_variance;
      j(i, kDark) = 1;
      j(i, kDark + 1) = u;
      j(i, kDark + 2) = v;
      j(i, kRise) = e.level;
      j(i, kRise + 1) = e.level * u;
      j(i, kRise + 2) = e.level * v;
      j(i, kDarkBowl) = bowl;
      j(i, kRiseBowl) = e.level * bowl;
    }
    return true;
  }

  // Distance of one pixel from the edge, px, and its level between dark and bright.
  Eigen::Vector2d Normalised(const double* p, std::size_t pixel) const {
    const double angle = strip_.normal_rad + p[kTurn];
    const double c = std::cos(angle), s = std::sin(angle);
    const double x = pixels_.x_px[pixel], y = pixels_.y_px[pixel];
    const double u = x * PlaneScale(), v = y * PlaneScale();
    const double bow = Bow(y * c - x * s), bowl = Bowl(bow, x * c + y * s);
    return {x * c + y * s - p[kShift] - p[kSag] * bow,
            (pixels_.grey[pixel] / unit_ - Dark(p, u, v, bowl)) / Rise(p, u, v, bowl)};
  }

 private:
  double Bow(double along) const {
    const double t = along / strip_.half_length_px;
    return t * t - 1.0 / 3;
  }
  double Bowl(double bow, double across) const {
    if (!strip_.is_long) return 0;
    if (strip_.half_length_px < strip_.half_width_px) return bow;
    const double d = across / strip_.half_length_px;
    return bow + d * d;
  }
  static double Dark(const double* p, double u, double v, double bowl) {
    return p[kDark] + p[kDark + 1] * u + p[kDark + 2] * v + p[kDarkBowl] * bowl;
  }
  static double Rise(const double* p, double u, double v, double bowl) {
    return p[kRise] + p[kRise + 1] * u + p[kRise + 2] * v + p[kRiseBowl] * bowl;
  }
  double PlaneScale() const { return 1 / std::max(strip_.half_width_px, strip_.half_length_px); }
};

// Fits repeatedly, each time in a strip that suits the result of the previous fit.
class EdgeFit : StepSearch<EdgeModel> {
 public:
  using StepSearch::StepSearch;

  std::optional<EdgeSpreadFit> Run(bool want_profile) {
    if (!EndsAreInside() || !Seed()) return std::nullopt;
    // The second round, in the right width, moves the blur by less than its error. The third round
    // uses all pixels.
    for (const int most : {2 * kSeedPixels, kMaxPixels}) {
      const double sigma_px = SigmaOf(parameters_[kVariance]);
      if (!(feature_.half_width_px >= LeastHalfWidthPx(sigma_px))) return std::nullopt;
      if (!Gather(std::min(feature_.half_width_px, StripHalfWidthPx(sigma_px)), most)) {
        return std::nullopt;
      }
      Solve();
      if (!IsPlausible()) return std::nullopt;
    }
    return Result(want_profile);
  }

 private:
  // The sub-pixel ends may lie on the far sides of the outermost pixels.
  bool EndsAreInside() const {
    const Eigen::Vector2d along(-std::sin(feature_.angle_rad), std::cos(feature_.angle_rad));
    for (const double sign : {-1.0, 1.0}) {
      const Eigen::Vector2d end = feature_.centre_px + sign * feature_.half_length_px * along;
      if (!(end.x() >= -1 && end.y() >= -1 && end.x() <= grey_.cols && end.y() <= grey_.rows)) {
        return false;
      }
    }
    return feature_.half_width_px >= 2 && feature_.half_length_px >= 2;
  }

  bool Gather(double half_width_px, int most) {
    // The shift and the turn found so far define the new middle line. The levels are linear and
    // need no start value.
    const double angle = feature_.angle_rad + parameters_[kTurn];
    feature_.centre_px += parameters_[kShift] * Eigen::Vector2d(std::cos(angle), std::sin(angle));
    feature_.angle_rad = angle;
    parameters_[kShift] = parameters_[kTurn] = 0;
    strip_ = {feature_.centre_px, angle, half_width_px, feature_.half_length_px};
    // The bow of a shorter edge is at most a sixteenth of the largest possible bow, and a bend of
    // its levels may come from a texture.
    strip_.is_long = 4 * feature_.half_length_px >= std::min(grey_.cols, grey_.rows);
    pixels_ = GatherPixels(grey_, strip_, most);
    return pixels_.size() >= kMinPixels && pixels_.coverage > 0.5 && StartLevels();
  }

  // Computes the means of the two sides. Returns whether they are finite and differ.
  bool StartLevels() {
    const double c = std::cos(strip_.normal_rad), s = std::sin(strip_.normal_rad);
    const auto means = MeansOfSides([&](double x, double y) {
      const double d = x * c + y * s;
      return std::abs(d) < strip_.half_width_px / 2 ? -1 : d > 0 ? 1 : 0;
    });
    if (!means) return false;
    const double dark = (*means)[0], rise = (*means)[1] - dark;
    if (!(rise > 0)) return false;
    unit_ = rise / 200;
    parameters_.segment<kParameters - kDark>(kDark).setZero();
    parameters_[kDark] = dark / unit_;
    parameters_[kRise] = rise / unit_;
    return true;
  }

  bool Seed() {
    parameters_.setZero();
    const double width_px = std::min(feature_.half_width_px, 48.0);
    if (!Gather(width_px, kSeedPixels)) return false;
    return SolveFromSeveral(
        width_px, [this](double variance_px2) { parameters_[kVariance] = variance_px2; },
        [this] { return IsPlausible(); });
  }

  bool IsPlausible() const {
    const double width_px = feature_.half_width_px;
    return parameters_.allFinite() && parameters_[kRise] > 0 && parameters_[kVariance] > -1 &&
           std::abs(parameters_[kShift]) < width_px && std::abs(parameters_[kTurn]) < 0.3 &&
           SigmaOf(parameters_[kVariance]) < width_px &&
           std::abs(parameters_[kSag]) < 0.1 + kLargestSag * 2 * feature_.half_length_px;
  }

  std::optional<EdgeSpreadFit> Result(bool want_profile) const {
    Ending end = AtTheEnd();
    if (!strip_.is_long) end.jacobian.conservativeResize(Eigen::NoChange, kDarkBowl);
    const EdgeModel model = ModelOfPixels();
    const EdgeProfile profile(psf_, parameters_[kVariance], floor_px_,
                              strip_.normal_rad + parameters_[kTurn]);
    std::vector<double> bright(pixels_.size());
    std::vector<Eigen::Vector2d> points(pixels_.size());
    for (std::size_t i = 0; i < pixels_.size(); ++i) {
      points[i] = model.Normalised(parameters_.data(), i);
      bright[i] = profile.At(points[i].x()).level;
    }
    const auto judgement = Judge(end, bright, parameters_[kRise]);
    if (!judgement) return std::nullopt;
    const BlurSigma blur = BlurOf(kVariance, judgement->covariance);
    if (!IsDetermined(blur)) return std::nullopt;

    EdgeSpreadFit fit;
    fit.feature = feature_;
    const double angle = strip_.normal_rad + parameters_[kTurn];
    fit.feature.angle_rad = std::remainder(angle, 2 * CV_PI);
    fit.feature.centre_px += (parameters_[kShift] - parameters_[kSag] / 3) *
                             Eigen::Vector2d(std::cos(angle), std::sin(angle));
    const bool is_across_x = std::abs(std::cos(angle)) >= std::abs(std::sin(angle));
    (is_across_x ? fit.across_x : fit.across_y) = blur;
    fit.chi2_per_dof = judgement->quality.chi2_per_dof;
    if (want_profile) FillProfile(points, profile, &fit);
    return fit;
  }

  // Fills the profile with means over a quarter pixel.
  void FillProfile(const std::vector<Eigen::Vector2d>& points, const EdgeProfile& profile,
                   EdgeSpreadFit* fit) const {
    constexpr double kBinPx = 0.25;
    const int half = static_cast<int>(strip_.half_width_px / kBinPx);
    const auto bins = static_cast<std::size_t>(2 * half + 1);
    std::vector<Eigen::Vector3d> sums(bins, Eigen::Vector3d::Zero());
    for (const Eigen::Vector2d& point : points) {
      const int bin = static_cast<int>(std::lround(point.x() / kBinPx)) + half;
      if (bin < 0 || bin > 2 * half) continue;
      sums[static_cast<std::size_t>(bin)] += Eigen::Vector3d(point.x(), point.y(), 1);
    }
    for (const Eigen::Vector3d& sum : sums) {
      if (!(sum.z() > 0)) continue;
      fit->distance_px.push_back(sum.x() / sum.z());
      fit->level.push_back(sum.y() / sum.z());
      fit->fitted.push_back(profile.At(sum.x() / sum.z()).level);
    }
  }
};

}  // namespace

std::optional<EdgeSpreadFit> FitEdge(const cv::Mat& grey, const EdgeFeature& feature,
                                     model::Psf psf, double floor_px, bool want_profile) {
  return EdgeFit(grey, feature, psf, floor_px).Run(want_profile);
}

}  // namespace thicklens::calib
