#include "calib/imaging/frame_placement.h"

#include <cmath>

#include "calib/registration/image_scale.h"
#include "thicklens/calib/blur_model.h"

namespace thicklens::calib {
namespace {

constexpr double kScalesAgree = 0.02;

}  // namespace

std::optional<double> ScaleOfFrame(const Calibration& calibration, std::size_t frame,
                                   model::BenchDirection direction) {
  const FrameMeasurement& measured = calibration.frames[frame];
  const ScaleModel& law = calibration.diagnostics.scale;
  if (measured.image_scale) return measured.image_scale;
  if (law.done) {
    const double depth_mm =
        law.line_zero_mm() + model::DirectionSign(direction) * measured.reading_mm;
    if (IsDepth(depth_mm)) return law.reference_depth_mm / depth_mm;
  }
  const auto reference = AlignmentReference(calibration);
  if (!reference || *reference == frame) return reference ? std::optional(1.0) : std::nullopt;
  const double reference_mm = calibration.frames[*reference].depth_mm;
  if (IsDepth(reference_mm) && IsDepth(measured.depth_mm)) return reference_mm / measured.depth_mm;
  return std::nullopt;
}

std::optional<std::size_t> AlignmentReference(const Calibration& calibration) {
  const int reference = calibration.diagnostics.scale.reference_frame;
  if (reference >= 0 && reference < static_cast<int>(calibration.frames.size()))
    return static_cast<std::size_t>(reference);
  std::optional<std::size_t> sharpest;
  for (std::size_t i = 0; i < calibration.frames.size(); ++i) {
    const FrameMeasurement& frame = calibration.frames[i];
    if (!frame.rejection.empty()) continue;
    if (!sharpest ||
        frame.normalised_edge_slope > calibration.frames[*sharpest].normalised_edge_slope)
      sharpest = i;
  }
  return sharpest;
}

std::optional<cv::Mat> PlaceFrame(const cv::Mat& reference, const cv::Mat& frame, double scale,
                                  cv::Point2d axis) {
  const auto found = Register(reference, frame, scale, axis);
  if (!found || std::abs(found->scale / scale - 1) > kScalesAgree) return std::nullopt;
  const double c = scale * std::cos(found->rotation_rad), s = scale * std::sin(found->rotation_rad);
  const double x = axis.x + found->shift_px.x() - c * axis.x + s * axis.y;
  const double y = axis.y + found->shift_px.y() - s * axis.x - c * axis.y;
  return cv::Mat(cv::Matx23d(c, -s, x, s, c, y));
}

}  // namespace thicklens::calib
