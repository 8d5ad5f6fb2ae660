#include "calib/registration/shift_registration.h"

#include <algorithm>
#include <cmath>

#include "calib/registration/coarse_registration.h"
#include "calib/registration/tile_map.h"
#include "calib/registration/tile_pass.h"

namespace thicklens::calib {
namespace {

constexpr double kMinShiftInformation = 0.1;
constexpr double kMinAgreement = 0.6;
constexpr double kMaxShiftSigmaPx = 0.3;
constexpr int kMinFieldPx = 60;
constexpr double kLargestBlurPart = 0.06;  // sigma of blur, relative to the field
constexpr int kCoarserRounds = 4;
constexpr double kClosePx = 0.2;    // shrunk pixels
constexpr double kCloseBlur = 0.3;  // relative difference of a variance

// p_frame = centre + shift + scale R (p_reference - centre).
FrameMap MapOf(const Registration& registration, cv::Point2d centre) {
  const double c = std::cos(registration.rotation_rad), s = std::sin(registration.rotation_rad);
  FrameMap map;
  map.centre = Eigen::Vector2d(centre.x, centre.y);
  map.linear << c, -s, s, c;
  map.linear *= registration.scale;
  map.offset = map.centre + registration.shift_px - map.linear * map.centre;
  return map;
}

// Applies a small rotation about the centre and a small shift to the registration.
void Follow(const RigidDisplacement& step, Registration* registration) {
  const Eigen::Vector2d before = registration->shift_px;
  registration->shift_px +=
      step.shift_px + step.turn_rad * Eigen::Vector2d(-before.y(), before.x());
  registration->rotation_rad += step.turn_rad;
}

}  // namespace

bool IsScaleInvariant(const cv::Mat& image) {
  const ImageInformation information = InformationOf(image);
  return !(information.scale > kMinScaleInformation) &&
         information.worst_shift > kMinShiftInformation;
}

std::optional<Registration> RegisterShift(const cv::Mat& reference, const cv::Mat& frame,
                                          double scale, cv::Point2d centre) {
  const std::optional<FrameMap> coarse = ShiftCoarsely(reference, frame, scale, centre);
  if (!coarse) return std::nullopt;
  Registration found;
  found.scale = found.scale_x = found.scale_y = scale;
  found.shift_px = coarse->linear * coarse->centre + coarse->offset - coarse->centre;
  const cv::Rect2d shared = SharedField(*coarse, reference.size(), frame.size());
  const double field_px = std::min(shared.width, shared.height);
  if (!(field_px >= kMinFieldPx)) return std::nullopt;
  // The first passes use half resolution. They bring the map close, and determine the difference of
  // the blurs.
  const int finest = TileFactor(std::max(shared.width, shared.height), 0);
  const int coarser = std::max(finest, std::min(2 * finest, TileFactor(field_px, 1e9)));
  const double most_px2 = std::pow(kLargestBlurPart * field_px, 2);
  double variance_px2 = 0;
  for (int round = 0; round < kCoarserRounds; ++round) {
    const auto pass = MeasureTiles(reference, frame, MapOf(found, centre), coarser, variance_px2);
    if (!pass) return std::nullopt;
    const double before_px2 = variance_px2;
    if (pass->added_variance_px2)
      variance_px2 = std::clamp(*pass->added_variance_px2, -most_px2, most_px2);
    const auto step = FitRigid(pass->shifts);
    if (step) Follow(*step, &found);
    const bool is_close =
        step &&
        step->shift_px.norm() + 0.7 * field_px * std::abs(step->turn_rad) < kClosePx * coarser;
    if (is_close && std::abs(variance_px2 - before_px2) < kCloseBlur * (1 + std::abs(variance_px2)))
      break;
  }
  const int factor =
      std::clamp(TileFactor(field_px, std::sqrt(std::abs(variance_px2))), finest, coarser);
  const auto pass = MeasureTiles(reference, frame, MapOf(found, centre), factor, variance_px2);
  if (!pass || !(pass->agreement > kMinAgreement)) return std::nullopt;
  const auto step = FitRigid(pass->shifts);
  if (!step || !(step->shift_covariance_px2.trace() < 2 * kMaxShiftSigmaPx * kMaxShiftSigmaPx))
    return std::nullopt;
  Follow(*step, &found);
  return found;
}

}  // namespace thicklens::calib
