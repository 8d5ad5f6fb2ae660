#include "registration.h"

#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <cmath>
#include <opencv2/imgproc.hpp>

#include "coarse_registration.h"
#include "tile_map.h"
#include "tile_phases.h"

namespace thicklens::calib {
namespace {

constexpr double kMaxAnisotropy = 0.015;
constexpr double kMinAgreement = 0.6;
constexpr double kMaxDisagreement = 0.015;  // of scale, between the shrunk pictures and the tiles
constexpr double kMaxScaleSigma = 3e-3;
// What the method itself may be wrong by, measured on simulated pictures of known scale.
constexpr double kScaleBias = 1e-5;
// Larger fields are shrunk to this: more pixels would cost time and tell nothing more of the scale.
constexpr int kLargestFieldPx = 640;
constexpr int kSmallestFieldPx = 96;  // that a field is shrunk to
constexpr int kLeastFieldPx = 60;     // that can be registered at all
constexpr int kTilesAcross = 4;
constexpr double kTilePart = 0.36;  // of the field's shorter side
// A picture blurred by this many shrunk pixels holds nothing that shrinking loses.
constexpr double kBlurPerShrunkPixel = 1.3;
constexpr double kLargestBlurPart = 0.06;  // sigma of blur, of the field
constexpr int kCoarserRounds = 3;
constexpr double kClosePx = 0.5;    // of shrunk pixels
constexpr double kCloseBlur = 0.3;  // relative, of a variance
constexpr double kSignificant = 4;  // of a cubic term, in its standard deviations

// Sides of tiles, which have fast transforms.
int TileSize(int field_px) {
  static constexpr std::array<int, 18> kSizes = {24, 30, 32, 36,  40,  48,  54,  60,  64,
                                                 72, 80, 96, 108, 120, 128, 144, 160, 180};
  int size = kSizes[0];
  for (const int candidate : kSizes) {
    if (candidate <= kTilePart * field_px) size = candidate;
  }
  return size;
}

// The added blur of the softer picture is put on the sharper one: else what a window cuts off
// differs between the two, and looks like a shift.
void MatchBlur(double variance_px2, cv::Mat* reference, cv::Mat* frame) {
  const double sigma_px = std::sqrt(std::abs(variance_px2));
  if (!(sigma_px > 0.3)) return;
  cv::Mat* sharper = variance_px2 > 0 ? reference : frame;
  cv::GaussianBlur(*sharper, *sharper, cv::Size(), sigma_px, sigma_px, cv::BORDER_REPLICATE);
}

struct Pass {
  std::optional<DisplacementField> field;  // in px of full resolution
  double agreement = 0;
  std::optional<double> added_variance_px2;  // what the frame's blur has over the reference's
};

// The tiles' shifts with the frame shrunk by `factor` and the blur matched.
std::optional<Pass> MeasureTiles(const cv::Mat& reference, const cv::Mat& frame,
                                 const FrameMap& map, int factor, double variance_px2) {
  const cv::Rect2d shared = SharedField(map, reference.size(), frame.size());
  const double blur_px = std::sqrt(std::abs(variance_px2)) / factor;
  const cv::Rect whole(0, 0, frame.cols / factor, frame.rows / factor);
  const int left = static_cast<int>(std::ceil((shared.x + 0.5) / factor));
  const int top = static_cast<int>(std::ceil((shared.y + 0.5) / factor));
  const cv::Rect field =
      cv::Rect(left, top, static_cast<int>((shared.x + shared.width + 0.5) / factor) - left,
               static_cast<int>((shared.y + shared.height + 0.5) / factor) - top) &
      whole;
  const int size = TileSize(std::min(field.width, field.height));
  if (std::min(field.width, field.height) < size + kTilesAcross) return std::nullopt;
  // What lies around the field is blurred into it.
  const int margin = static_cast<int>(std::ceil(3 * blur_px));
  const cv::Rect region = cv::Rect(field.x - margin, field.y - margin, field.width + 2 * margin,
                                   field.height + 2 * margin) &
                          whole;
  cv::Mat expected = InFrameGeometry(reference, map, factor, region);
  cv::Mat seen = Shrunk(frame, factor)(region);
  MatchBlur(variance_px2 / (factor * factor), &expected, &seen);

  TilePhases phases(size);
  for (int j = 0; j < kTilesAcross; ++j) {
    for (int i = 0; i < kTilesAcross; ++i) {
      const cv::Point corner(field.x + (field.width - size) * i / (kTilesAcross - 1),
                             field.y + (field.height - size) * j / (kTilesAcross - 1));
      phases.Add(expected, seen, corner - region.tl());
    }
  }
  std::vector<TileShift> shifts = phases.Solve();
  for (TileShift& tile : shifts) {
    const Eigen::Vector2d shrunk = tile.centre_px + Eigen::Vector2d(region.x, region.y);
    tile.centre_px = (factor * (shrunk.array() + 0.5) - 0.5).matrix() - map.centre;
    tile.shift_px *= factor;
    tile.information /= factor * factor;
  }
  Pass pass;
  pass.field = FitDisplacement(shifts, phases.weight_variance_px2() * factor * factor);
  pass.agreement = phases.agreement();
  // What was matched before is added.
  if (phases.added_variance_px2())
    pass.added_variance_px2 = variance_px2 + *phases.added_variance_px2() * factor * factor;
  return pass;
}

// The map followed by shift + linear (p - centre) + cubic |p - centre|^2 (p - centre).
FrameMap Followed(const FrameMap& map, const Eigen::Vector2d& shift_px,
                  const Eigen::Matrix2d& linear, double cubic) {
  FrameMap result = map;
  result.linear += linear * map.linear;
  result.offset += shift_px + linear * (map.offset - map.centre);
  result.cubic += cubic;
  return result;
}

// What an affine map alone takes of the displacement: the stretch that stands for the cubic term.
Eigen::Matrix2d AffinePart(const DisplacementField& field) {
  return field.linear - field.stretch_cubic_covariance / field.cubic_variance * field.cubic *
                            Eigen::Matrix2d::Identity();
}

bool IsBent(const DisplacementField& field) {
  return field.cubic * field.cubic > kSignificant * kSignificant * field.cubic_variance;
}

// The map with the displacement, the cubic term only where it is more than an error.
FrameMap Corrected(const FrameMap& map, const DisplacementField& field) {
  return IsBent(field) ? Followed(map, field.shift_px, field.linear, field.cubic)
                       : Followed(map, field.shift_px, AffinePart(field), 0);
}

// How far the affine part of the displacement reaches at the corners of the field.
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

int Factor(double field_px, double blur_px) {
  const int size = static_cast<int>(std::ceil(field_px / kLargestFieldPx));
  const int blur = static_cast<int>(blur_px / kBlurPerShrunkPixel);
  const int most = std::max(1, static_cast<int>(field_px / kSmallestFieldPx));
  return std::clamp(std::max(size, blur), 1, most);
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

std::optional<FreeRegistration> RegisterFreely(const cv::Mat& reference, const cv::Mat& frame,
                                               double expected_scale, cv::Point2d centre) {
  const std::optional<FrameMap> coarse = RegisterCoarsely(reference, frame, expected_scale, centre);
  if (!coarse) return std::nullopt;
  FrameMap map = *coarse;
  const cv::Rect2d shared = SharedField(map, reference.size(), frame.size());
  const double field_px = std::min(shared.width, shared.height);
  if (!(field_px >= kLeastFieldPx)) return std::nullopt;
  const double longer_px = std::max(shared.width, shared.height);
  // Half resolution first: it brings the map close, and says how the blurs differ.
  const int finest = Factor(longer_px, 0);
  const int coarser = std::max(finest, std::min(2 * finest, Factor(field_px, 1e9)));
  const double most_px2 = std::pow(kLargestBlurPart * field_px, 2);
  double variance_px2 = 0;
  for (int round = 0; round < kCoarserRounds; ++round) {
    const auto pass = MeasureTiles(reference, frame, map, coarser, variance_px2);
    if (!pass) return std::nullopt;
    const double before_px2 = variance_px2;
    if (pass->added_variance_px2)
      variance_px2 = std::clamp(*pass->added_variance_px2, -most_px2, most_px2);
    if (pass->field) map = Corrected(map, *pass->field);
    const bool is_close = pass->field && Largest(*pass->field, field_px) < kClosePx * coarser;
    if (is_close && std::abs(variance_px2 - before_px2) < kCloseBlur * (1 + std::abs(variance_px2)))
      break;
  }
  const int factor =
      std::clamp(Factor(field_px, std::sqrt(std::abs(variance_px2))), finest, coarser);
  const auto pass = MeasureTiles(reference, frame, map, factor, variance_px2);
  if (!pass || !pass->field || !(pass->agreement > kMinAgreement)) return std::nullopt;
  const DisplacementField& field = *pass->field;
  const double alone = Scale(Corrected(map, field));
  if (!(std::abs(alone / Scale(*coarse) - 1) < kMaxDisagreement)) return std::nullopt;
  FreeRegistration result;
  result.free = Describe(Followed(map, field.shift_px, field.linear, 0));
  Registration& free = result.free;
  if (!(std::abs(free.scale_x / free.scale_y - 1) < kMaxAnisotropy)) return std::nullopt;
  free.scale_sigma = free.scale * std::hypot(std::sqrt(field.stretch_variance), kScaleBias);
  free.cubic = map.cubic + field.cubic;
  free.cubic_sigma = std::sqrt(field.cubic_variance);
  result.scale_per_cubic = -free.scale * field.stretch_cubic_covariance / field.cubic_variance;
  if (!(result.WithCubic(0, 0).scale_sigma < kMaxScaleSigma * free.scale)) return std::nullopt;
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
