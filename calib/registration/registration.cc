#include "calib/registration/registration.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>

#include "calib/registration/coarse_registration.h"
#include "calib/registration/tile_map.h"
#include "calib/registration/tile_pass.h"
#include "thicklens/base/cancel.h"

namespace thicklens::calib {
namespace {

constexpr double kMaxAnisotropy = 0.015;
constexpr double kMinAgreement = 0.6;
// Maximum relative difference of scale between the shrunk images and the tiles.
constexpr double kMaxDisagreement = 0.015;
constexpr double kMaxScaleSigma = 3e-3;
// Error of the method itself, measured on simulated images of known scale.
constexpr double kScaleBias = 1e-5;
constexpr int kMinFieldPx = 60;            // minimum shared field for a registration
constexpr double kLargestBlurPart = 0.06;  // sigma of blur, relative to the field
constexpr int kCoarserRounds = 3;
constexpr double kClosePx = 0.5;    // shrunk pixels
constexpr double kCloseBlur = 0.3;  // relative difference of a variance
constexpr double kSignificant = 4;  // standard deviations of a cubic term

// The map followed by shift + linear (p - centre) + cubic |p - centre|^2 (p - centre).
FrameMap Followed(const FrameMap& map, const Eigen::Vector2d& shift_px,
                  const Eigen::Matrix2d& linear, double cubic) {
  FrameMap result = map;
  result.linear += linear * map.linear;
  result.offset += shift_px + linear * (map.offset - map.centre);
  result.cubic += cubic;
  return result;
}

// The displacement that an affine map alone describes: it includes the stretch equivalent to the
// cubic term.
Eigen::Matrix2d AffinePart(const DisplacementField& field) {
  return field.linear - field.stretch_cubic_covariance / field.cubic_variance * field.cubic *
                            Eigen::Matrix2d::Identity();
}

bool IsBent(const DisplacementField& field) {
  return field.cubic * field.cubic > kSignificant * kSignificant * field.cubic_variance;
}

// The map with the displacement. The cubic term is included only where it is significant.
FrameMap Corrected(const FrameMap& map, const DisplacementField& field) {
  return IsBent(field) ? Followed(map, field.shift_px, field.linear, field.cubic)
                       : Followed(map, field.shift_px, AffinePart(field), 0);
}

// Maximum of the affine part of the displacement at the corners of the field.
double Largest(const DisplacementField& field, double field_px) {
  return field.shift_px.norm() + 0.7 * field_px * AffinePart(field).norm();
}

double Scale(const FrameMap& map) { return std::sqrt(map.linear.determinant()); }

Registration Describe(const FrameMap& map) {
  Registration result;
  result.scale = Scale(map);
  result.scale_x = map.linear.col(0).norm();
  result.scale_y = map.linear.col(1).norm();
  result.rotation_rad = std::atan2(map.linear(1, 0) - map.linear(0, 1), map.linear.trace());
  result.shift_px = map.linear * map.centre + map.offset - map.centre;
  return result;
}

}  // namespace

Registration FreeRegistration::WithCubic(double cubic, double cubic_sigma) const {
  Registration result = free;
  const double change = scale_per_cubic * (free.cubic - cubic) / free.scale;
  result.scale *= 1 + change;
  result.scale_x *= 1 + change;
  result.scale_y *= 1 + change;
  const double variance = std::pow(free.scale_sigma, 2) -
                          std::pow(scale_per_cubic * free.cubic_sigma, 2) +
                          std::pow(scale_per_cubic * cubic_sigma, 2);
  result.scale_sigma = std::sqrt(std::max(variance, std::pow(kScaleBias * free.scale, 2)));
  return result;
}

FreeRegistration DescribeFreely(const FrameMap& map, const DisplacementField& field) {
  FreeRegistration result;
  result.free = Describe(Followed(map, field.shift_px, field.linear, 0));
  Registration& free = result.free;
  free.scale_sigma = free.scale * std::hypot(std::sqrt(field.stretch_variance), kScaleBias);
  free.cubic = map.cubic + field.cubic;
  free.cubic_sigma = std::sqrt(field.cubic_variance);
  result.scale_per_cubic = -free.scale * field.stretch_cubic_covariance / field.cubic_variance;
  return result;
}

int FactorOfPass(const cv::Rect2d& shared, double added_variance_px2) {
  const double field_px = std::min(shared.width, shared.height);
  const int finest = TileFactor(std::max(shared.width, shared.height), 0);
  const int coarser = std::max(finest, std::min(2 * finest, TileFactor(field_px, 1e9)));
  return std::clamp(TileFactor(field_px, std::sqrt(std::abs(added_variance_px2))), finest, coarser);
}

namespace {

// The pass that determines the result. `scale` is what the map must agree with.
std::optional<FreeRegistration> LastPass(const cv::Mat& reference, const cv::Mat& frame,
                                         const FrameMap& map, double scale, double variance_px2,
                                         const std::optional<KnownBlurField>& known) {
  ThrowIfCancelled();
  const cv::Rect2d shared = SharedField(map, reference.size(), frame.size());
  const auto pass =
      MeasureTiles(reference, frame, map, FactorOfPass(shared, variance_px2), variance_px2, known);
  if (!pass || !(pass->agreement > kMinAgreement)) return std::nullopt;
  const auto fitted = FitDisplacement(pass->shifts, pass->weight_variance_px2);
  if (!fitted) return std::nullopt;
  const FrameMap corrected = Corrected(map, *fitted);
  if (!(std::abs(Scale(corrected) / scale - 1) < kMaxDisagreement)) return std::nullopt;
  FreeRegistration result = DescribeFreely(map, *fitted);
  Registration& free = result.free;
  if (!(std::abs(free.scale_x / free.scale_y - 1) < kMaxAnisotropy)) return std::nullopt;
  free.added_variance_px2 = pass->added_variance_px2;
  result.blur = {FitBlurField(pass->blurs), pass->texture};
  result.map = corrected;
  if (!(result.WithCubic(0, 0).scale_sigma < kMaxScaleSigma * free.scale)) return std::nullopt;
  return result;
}

}  // namespace

std::optional<FreeRegistration> RegisterFreely(const cv::Mat& reference, const cv::Mat& frame,
                                               double expected_scale, cv::Point2d centre) {
  const std::optional<FrameMap> coarse = RegisterCoarsely(reference, frame, expected_scale, centre);
  if (!coarse) return std::nullopt;
  FrameMap map = *coarse;
  const cv::Rect2d shared = SharedField(map, reference.size(), frame.size());
  const double field_px = std::min(shared.width, shared.height);
  if (!(field_px >= kMinFieldPx)) return std::nullopt;
  const double longer_px = std::max(shared.width, shared.height);
  // The first passes use half resolution. They bring the map close, and determine the difference of
  // the blurs.
  const int finest = TileFactor(longer_px, 0);
  const int coarser = std::max(finest, std::min(2 * finest, TileFactor(field_px, 1e9)));
  const double most_px2 = std::pow(kLargestBlurPart * field_px, 2);
  double variance_px2 = 0;
  for (int round = 0; round < kCoarserRounds; ++round) {
    ThrowIfCancelled();
    const auto pass = MeasureTiles(reference, frame, map, coarser, variance_px2);
    if (!pass) return std::nullopt;
    const auto field = FitDisplacement(pass->shifts, pass->weight_variance_px2);
    const double before_px2 = variance_px2;
    if (pass->added_variance_px2)
      variance_px2 = std::clamp(*pass->added_variance_px2, -most_px2, most_px2);
    if (field) map = Corrected(map, *field);
    const bool is_close = field && Largest(*field, field_px) < kClosePx * coarser;
    if (is_close && std::abs(variance_px2 - before_px2) < kCloseBlur * (1 + std::abs(variance_px2)))
      break;
  }
  return LastPass(reference, frame, map, Scale(*coarse), variance_px2, std::nullopt);
}

std::optional<FreeRegistration> RegisterWithBlur(const cv::Mat& reference, const cv::Mat& frame,
                                                 const FreeRegistration& first,
                                                 const KnownBlurField& known) {
  auto result = LastPass(reference, frame, first.map, Scale(first.map),
                         first.free.added_variance_px2.value_or(0), known);
  // The power of the texture assumes one blur of the reference.
  if (result) result->blur.texture = first.blur.texture;
  return result;
}

std::optional<Registration> Register(const cv::Mat& reference, const cv::Mat& frame,
                                     double expected_scale, cv::Point2d centre) {
  const auto result = RegisterFreely(reference, frame, expected_scale, centre);
  if (!result) return std::nullopt;
  const bool is_bent = std::abs(result->free.cubic) > kSignificant * result->free.cubic_sigma;
  return is_bent ? result->free : result->WithCubic(0, 0);
}

}  // namespace thicklens::calib
