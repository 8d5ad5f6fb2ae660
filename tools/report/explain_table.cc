#include "tools/report/explain_table.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "thicklens/base/printable_text.h"
#include "thicklens/model/thick_lens.h"

namespace thicklens::tools {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr double kDepthOfFieldRadiiPx[] = {0.5, 1};

// r_defocus, mm on the sensor: [S25], [S26]; for a point at infinity their limit r (D - f2)/f2,
// from c(z) = f1 D/(f2 z) - (D - f2)/f2. D is measured from the rear principal plane.
double RadiusMm(const model::ThickLens& lens, double image_distance_mm, double depth_mm) {
  if (std::isfinite(depth_mm)) return model::BlurRadiusMm(lens, image_distance_mm, depth_mm);
  const double rear_distance_mm = image_distance_mm - lens.lens_thickness_mm;
  return lens.aperture_radius_mm * std::abs(rear_distance_mm / lens.rear_focal_length_mm - 1);
}

// |m| = f1 D/(f2 z); 0 at infinity.
double Magnification(const model::ThickLens& lens, double image_distance_mm, double depth_mm) {
  if (!std::isfinite(depth_mm)) return 0;
  return std::abs(model::ChiefRayMagnification(lens, image_distance_mm, depth_mm));
}

// Standard deviation of kappa r |c(z)|/p from those of kappa and d1: where c(z) is small, at focus,
// it is the plane of focus that counts. With the covariance of the two where the camera file has
// it.
double DefocusErrorPx(const model::Camera& camera, const Explanation& known, const DepthRow& row,
                      double depth_mm) {
  const double by_ratio_px = row.blur_radius_px;
  const double step_mm = 1e-6 * known.image_distance_mm;
  const double moved_mm = RadiusMm(camera.lens, known.image_distance_mm + step_mm, depth_mm);
  const double by_distance_px_per_mm =
      known.blur_ratio * (moved_mm - row.blur_radius_mm) / step_mm / camera.sensor.pixel_pitch_mm;
  double covariance = 0;
  const auto& order = camera.calibration->covariance_order;
  const auto distance = std::find(order.begin(), order.end(), "image_distance_mm");
  const auto ratio = std::find(order.begin(), order.end(), "blur_ratio");
  if (distance != order.end() && ratio != order.end())
    covariance = camera.calibration->covariance(distance - order.begin(), ratio - order.begin());
  const double variance = std::pow(by_ratio_px * known.blur_ratio_sigma, 2) +
                          std::pow(by_distance_px_per_mm * known.image_distance_sigma_mm, 2) +
                          2 * by_ratio_px * by_distance_px_per_mm * covariance;
  return std::sqrt(std::max(0.0, variance));
}

DepthRow RowAt(const model::Camera& camera, const Explanation& known, double depth_mm) {
  const double pitch_mm = camera.sensor.pixel_pitch_mm;
  const model::ThickLens thin = model::ThinCounterpart(camera.lens);
  DepthRow row;
  row.depth_mm = depth_mm;
  row.blur_radius_mm = RadiusMm(camera.lens, known.image_distance_mm, depth_mm);
  row.blur_radius_px = row.blur_radius_mm / pitch_mm;
  row.defocus_sigma_px = known.blur_ratio * row.blur_radius_px;
  row.defocus_sigma_error_px = DefocusErrorPx(camera, known, row, depth_mm);
  row.sigma_px = std::hypot(row.defocus_sigma_px, known.blur_floor_px.value_or(0));
  row.magnification = Magnification(camera.lens, known.image_distance_mm, depth_mm);
  row.thin_blur_radius_px = RadiusMm(thin, known.image_distance_mm, depth_mm) / pitch_mm;
  row.thin_magnification = Magnification(thin, known.image_distance_mm, depth_mm);
  return row;
}

double FarthestCornerPx(const model::Sensor& sensor) {
  const Eigen::Vector2d last_px(sensor.width_px - 1, sensor.height_px - 1);
  const Eigen::Vector2d& centre_px = sensor.principal_point_px;
  return centre_px.cwiseAbs().cwiseMax((last_px - centre_px).cwiseAbs()).norm();
}

// c(z) is f1 D/(f2 z) - (D - f2)/f2, of the thin lens d1/z - (d1 - f1)/f1, and both are 1 at z =
// f1: they part by |b| (1 - f1/z), b = D/f2 - d1/f1. Derived here [D8].
double ThinUpToMm(const model::Camera& camera, double image_distance_mm) {
  const model::ThickLens& lens = camera.lens;
  const double rear_distance_mm = image_distance_mm - lens.lens_thickness_mm;
  const double apart = std::abs(rear_distance_mm / lens.rear_focal_length_mm -
                                image_distance_mm / lens.front_focal_length_mm);
  const double limit = kThinTolerancePx * camera.sensor.pixel_pitch_mm / lens.aperture_radius_mm;
  return apart <= limit ? kInfinity : lens.front_focal_length_mm / (1 - limit / apart);
}

// The thin lens's magnification at the same d1 is d1/z, the thick one's f1 D/(f2 z): their ratio is
// the same at every depth.
ThinComparison CompareWithThin(const model::Camera& camera, double image_distance_mm) {
  const model::ThickLens& lens = camera.lens;
  const model::ThickLens thin = model::ThinCounterpart(lens);
  ThinComparison comparison;
  comparison.same_lens =
      lens.front_focal_length_mm == lens.rear_focal_length_mm && lens.lens_thickness_mm == 0;
  if (image_distance_mm >= thin.rear_focal_length_mm)
    comparison.focus_depth_mm = model::FocusDepthMm(thin, image_distance_mm);
  comparison.scale_ratio = model::ChiefRayMagnification(thin, image_distance_mm, 1) /
                           model::ChiefRayMagnification(lens, image_distance_mm, 1);
  comparison.alike_up_to_mm = ThinUpToMm(camera, image_distance_mm);
  comparison.corner_shift_px = (comparison.scale_ratio - 1) * FarthestCornerPx(camera.sensor);
  return comparison;
}

std::string DepthText(double depth_mm) {
  return std::isfinite(depth_mm) ? fmt::format("{:.6g}", depth_mm) : "infinity";
}

std::string HeadText(const Explanation& known) {
  const auto with_sigma = [](double value, double sigma) {
    return sigma > 0 ? fmt::format("{:.6g} +- {:.2g}", value, sigma) : fmt::format("{:.6g}", value);
  };
  return fmt::format(
      "camera {}\n"
      "image distance d1  {} mm\n"
      "plane of focus zf  {} mm\n"
      "blur ratio         {}\n"
      "blur floor         {}\n\n",
      PrintableUtf8(known.camera_name),
      with_sigma(known.image_distance_mm, known.image_distance_sigma_mm),
      DepthText(known.focus_depth_mm), with_sigma(known.blur_ratio, known.blur_ratio_sigma),
      known.blur_floor_px ? fmt::format("{:.4g} px", *known.blur_floor_px)
                          : "unknown, taken as 0 below");
}

std::string TableText(const Explanation& known) {
  const bool has_error = known.blur_ratio_sigma > 0;
  std::string text = fmt::format(
      "{0:>10} {1:>12} {1:>12} {2:>20} {3:>10} {4:>14} {5:>13}\n{6:>10} {6:>12} {7:>12} {7:>20} "
      "{7:>10} {8:>14} {7:>13}\n",
      "depth", "blur radius", "defocus sigma", "sigma", "magnification", "thin: radius", "mm", "px",
      "");
  for (const DepthRow& row : known.rows) {
    std::string defocus = fmt::format("{:.4f}", row.defocus_sigma_px);
    if (has_error) defocus += fmt::format(" +- {:.4f}", row.defocus_sigma_error_px);
    text += fmt::format("{:>10} {:>12.5f} {:>12.4f} {:>20} {:>10.4f} {:>14.6f} {:>13.4f}\n",
                        DepthText(row.depth_mm), row.blur_radius_mm, row.blur_radius_px, defocus,
                        row.sigma_px, row.magnification, row.thin_blur_radius_px);
  }
  return text +
         "sigma: per axis, of defocus and lens floor together, without the pixel's own box\n\n";
}

std::string DepthOfFieldText(const Explanation& known) {
  std::string text;
  for (const DepthOfFieldRow& row : known.depth_of_field) {
    text += fmt::format("blur radius up to {:.1f} px: from {} to {} mm\n", row.blur_radius_px,
                        DepthText(row.near_mm), DepthText(row.far_mm));
  }
  return text + fmt::format(
                    "hyperfocal distance: {:.6g} mm (infinity is blurred by a radius of 1 px)\n"
                    "working f-number: {:.4g}\n\n",
                    known.hyperfocal_mm, known.working_f_number);
}

std::string ThinText(const Explanation& known) {
  const ThinComparison& thin = known.thin;
  if (thin.same_lens) return "thick against thin: this lens is a thin one (f1 = f2, thickness 0)\n";
  return fmt::format(
      "thick against thin (f1 = f2 = the front focal length, thickness 0)\n"
      "  same plane of focus: blur and picture positions are the same; only cos(beta), the fall "
      "of\n"
      "  brightness toward the corners, differs, because the image distance does\n"
      "  same image distance: plane of focus {}; picture scale {:+.4f} %, which is {:+.3f} px at "
      "the\n"
      "  farthest corner; its blur radius is in the last column\n"
      "  with that image distance, the blur of thin is within {} px of that of thick up to {} "
      "mm{}\n",
      thin.focus_depth_mm ? "at " + DepthText(*thin.focus_depth_mm) + " mm"
                          : "nowhere (the sensor is nearer than the focal length)",
      100 * (thin.scale_ratio - 1), thin.corner_shift_px, kThinTolerancePx,
      DepthText(thin.alike_up_to_mm),
      thin.alike_up_to_mm < 1.1 * known.front_focal_length_mm
          ? ",\n  just beyond the front focal length: nowhere, that is"
          : "");
}

nlohmann::json Number(double value) {
  return std::isfinite(value) ? nlohmann::json(value) : nlohmann::json(nullptr);
}

nlohmann::json RowJson(const DepthRow& row) {
  return {{"depth_mm", Number(row.depth_mm)},
          {"blur_radius_mm", row.blur_radius_mm},
          {"blur_radius_px", row.blur_radius_px},
          {"defocus_sigma_px",
           {{"value", row.defocus_sigma_px}, {"sigma", row.defocus_sigma_error_px}}},
          {"sigma_px", row.sigma_px},
          {"magnification", row.magnification},
          {"thin_blur_radius_px", row.thin_blur_radius_px},
          {"thin_magnification", row.thin_magnification}};
}

}  // namespace

std::vector<double> InverselySpacedDepthsMm(const DepthRange& range, int count) {
  std::vector<double> depths;
  for (int i = 0; i < count; ++i) {
    const double t = static_cast<double>(i) / (count - 1);
    depths.push_back(1 / ((1 - t) / range.near_mm + t / range.far_mm));
  }
  // Rounding shall not move the ends, nor make infinity of them or out of it.
  depths.front() = range.near_mm;
  depths.back() = range.far_mm;
  return depths;
}

Explanation ExplainCamera(const model::Camera& camera, const DepthRange& range, int count) {
  Explanation known;
  known.camera_name = camera.name;
  known.image_distance_mm = camera.image_distance_mm();
  known.front_focal_length_mm = camera.lens.front_focal_length_mm;
  known.blur_ratio = camera.blur_ratio();
  known.image_distance_sigma_mm = camera.calibration->image_distance_mm->sigma;
  known.blur_ratio_sigma = camera.calibration->blur_ratio->sigma;
  known.focus_depth_mm = camera.focus_depth_mm();
  if (camera.calibration->blur_floor_px)
    known.blur_floor_px = camera.calibration->blur_floor_px->value;
  for (const double depth_mm : InverselySpacedDepthsMm(range, count))
    known.rows.push_back(RowAt(camera, known, depth_mm));
  for (const double radius_px : kDepthOfFieldRadiiPx) {
    const model::DepthOfField field = model::DepthOfFieldMm(
        camera.lens, known.image_distance_mm, radius_px * camera.sensor.pixel_pitch_mm);
    known.depth_of_field.push_back({radius_px, field.near_mm, field.far_mm});
  }
  known.thin = CompareWithThin(camera, known.image_distance_mm);
  // From r f1/(zf - f1) = 1 px, the limit of r K |1/z - 1/zf| for z to infinity.
  known.hyperfocal_mm = camera.lens.front_focal_length_mm *
                        (1 + camera.lens.aperture_radius_mm / camera.sensor.pixel_pitch_mm);
  // The aperture's image lies in the rear principal plane, of the aperture's own size.
  known.working_f_number = (known.image_distance_mm - camera.lens.lens_thickness_mm) /
                           (2 * camera.lens.aperture_radius_mm);
  return known;
}

std::string ExplanationText(const Explanation& explanation) {
  return HeadText(explanation) + TableText(explanation) + DepthOfFieldText(explanation) +
         ThinText(explanation);
}

nlohmann::json ExplanationJson(const Explanation& explanation) {
  const ThinComparison& thin = explanation.thin;
  nlohmann::json json = {
      {"status", "ok"},
      {"reason", ""},
      {"camera", PrintableUtf8(explanation.camera_name)},
      {"image_distance_mm",
       {{"value", explanation.image_distance_mm}, {"sigma", explanation.image_distance_sigma_mm}}},
      {"focus_depth_mm", Number(explanation.focus_depth_mm)},
      {"blur_ratio", {{"value", explanation.blur_ratio}, {"sigma", explanation.blur_ratio_sigma}}},
      {"blur_floor_px", Number(explanation.blur_floor_px.value_or(kInfinity))},
      {"depths", nlohmann::json::array()},
      {"depth_of_field", nlohmann::json::array()},
      {"thin_counterpart",
       {{"same_lens", thin.same_lens},
        {"focus_depth_mm", Number(thin.focus_depth_mm.value_or(kInfinity))},
        {"scale_ratio", thin.scale_ratio},
        {"corner_shift_px", thin.corner_shift_px},
        {"alike_up_to_mm", Number(thin.alike_up_to_mm)}}},
      {"hyperfocal_mm", explanation.hyperfocal_mm},
      {"working_f_number", explanation.working_f_number}};
  for (const DepthRow& row : explanation.rows) json["depths"].push_back(RowJson(row));
  for (const DepthOfFieldRow& row : explanation.depth_of_field) {
    json["depth_of_field"].push_back({{"blur_radius_px", row.blur_radius_px},
                                      {"near_mm", Number(row.near_mm)},
                                      {"far_mm", Number(row.far_mm)}});
  }
  return json;
}

}  // namespace thicklens::tools
