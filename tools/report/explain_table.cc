#include "tools/report/explain_table.h"

#include <fmt/format.h>

#include <cmath>
#include <limits>

#include "thicklens/base/printable_text.h"
#include "tools/report/distortion_words.h"

namespace thicklens::tools {
namespace {

std::string DepthText(double depth_mm) {
  return std::isfinite(depth_mm) ? fmt::format("{:.6g}", depth_mm) : "infinity";
}

std::string DepthWithUnit(double depth_mm) {
  return DepthText(depth_mm) + (std::isfinite(depth_mm) ? " mm" : "");
}

std::string HeadText(const model::Explanation& known) {
  const auto with_sigma = [](double value, double sigma) {
    return sigma > 0 ? fmt::format("{:.6g} +- {:.2g}", value, sigma) : fmt::format("{:.6g}", value);
  };
  return fmt::format(
      "camera {}\n"
      "image distance d1            {} mm\n"
      "in-focus object distance zf  {}\n"
      "blur ratio kappa             {}\n"
      "blur floor                   {}\n{}\n",
      PrintableUtf8(known.camera_name),
      with_sigma(known.image_distance_mm, known.image_distance_sigma_mm),
      DepthWithUnit(known.focus_depth_mm), with_sigma(known.blur_ratio, known.blur_ratio_sigma),
      known.blur_floor_px ? fmt::format("{:.4g} px", *known.blur_floor_px)
                          : "unknown, assumed to be 0 below",
      known.distortion
          ? fmt::format("lens distortion              {}; images are undistorted first\n",
                        DistortionWords(*known.distortion))
          : "");
}

// The column of the thin lens is left out if the lens is thin: it would repeat the blur radius.
std::string TableText(const model::Explanation& known) {
  const bool has_error = known.blur_ratio_sigma > 0;
  const bool has_thin = !known.thin.same_lens;
  std::string text = fmt::format(
      "{0:>10} {1:>12} {1:>12} {2:>20} {3:>10} {4:>14}{5}\n{6:>10} {6:>12} {7:>12} {7:>20} {7:>10}"
      "{8}\n",
      "depth", "blur radius", "defocus sigma", "sigma", "magnification",
      has_thin ? fmt::format(" {:>13}", "thin: radius") : "", "mm", "px",
      has_thin ? fmt::format("{:>29}", "px") : "");
  for (const model::DepthRow& row : known.rows) {
    std::string defocus = fmt::format("{:.4f}", row.defocus_sigma_px);
    if (has_error) defocus += fmt::format(" +- {:.4f}", row.defocus_sigma_error_px);
    text += fmt::format("{:>10} {:>12.5f} {:>12.4f} {:>20} {:>10.4f} {:>14.6f}",
                        DepthText(row.depth_mm), row.blur_radius_mm, row.blur_radius_px, defocus,
                        row.sigma_px, row.magnification);
    if (has_thin) text += fmt::format(" {:>13.4f}", row.thin_blur_radius_px);
    text += '\n';
  }
  return text +
         "sigma: per axis, of defocus and blur floor together, without the box of the pixel\n\n";
}

std::string DepthOfFieldText(const model::Explanation& known) {
  std::string text;
  for (const model::DepthOfFieldRow& row : known.depth_of_field) {
    text += fmt::format("depth of field (blur radius up to {:.1f} px): from {} to {}\n",
                        row.blur_radius_px, DepthWithUnit(row.near_mm), DepthWithUnit(row.far_mm));
  }
  return text + fmt::format(
                    "hyperfocal distance: {:.6g} mm (infinity is blurred by a radius of 1 px)\n"
                    "working f-number: {:.4g}\n\n",
                    known.hyperfocal_mm, known.working_f_number);
}

std::string ThinText(const model::Explanation& known) {
  const model::ThinComparison& thin = known.thin;
  if (thin.same_lens) return "thick against thin: this lens is thin (f1 = f2, thickness 0)\n";
  return fmt::format(
      "thick against thin (f1 = f2 = the front focal length, thickness 0)\n"
      "  same plane of focus: blur and image positions are the same; only cos(beta), the "
      "fall-off\n  toward the corners, differs, because the image distance differs\n"
      "  same image distance: plane of focus {}; image scale {:+.4f} %, which is {:+.3f} px at "
      "the\n"
      "  farthest corner; its blur radius is in the last column\n"
      "  with that image distance, the blur of thin is within {} px of that of thick up to {}{}\n",
      thin.focus_depth_mm ? "at " + DepthWithUnit(*thin.focus_depth_mm)
                          : "nowhere (the sensor is nearer than the focal length)",
      100 * (thin.scale_ratio - 1), thin.corner_shift_px, model::kThinTolerancePx,
      DepthWithUnit(thin.alike_up_to_mm),
      thin.alike_up_to_mm < 1.1 * known.front_focal_length_mm
          ? ",\n  which is just beyond the front focal length, so nowhere"
          : "");
}

nlohmann::json Number(double value) {
  return std::isfinite(value) ? nlohmann::json(value) : nlohmann::json(nullptr);
}

nlohmann::json RowJson(const model::DepthRow& row) {
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

std::string ExplanationText(const model::Explanation& explanation) {
  return HeadText(explanation) + TableText(explanation) + DepthOfFieldText(explanation) +
         ThinText(explanation);
}

nlohmann::json ExplanationJson(const model::Explanation& explanation) {
  const model::ThinComparison& thin = explanation.thin;
  nlohmann::json json = {
      {"status", "ok"},
      {"reason", ""},
      {"camera", PrintableUtf8(explanation.camera_name)},
      {"image_distance_mm",
       {{"value", explanation.image_distance_mm}, {"sigma", explanation.image_distance_sigma_mm}}},
      {"focus_depth_mm", Number(explanation.focus_depth_mm)},
      {"blur_ratio", {{"value", explanation.blur_ratio}, {"sigma", explanation.blur_ratio_sigma}}},
      {"blur_floor_px",
       Number(explanation.blur_floor_px.value_or(std::numeric_limits<double>::infinity()))},
      {"depths", nlohmann::json::array()},
      {"depth_of_field", nlohmann::json::array()},
      {"thin_counterpart",
       {{"same_lens", thin.same_lens},
        {"focus_depth_mm",
         Number(thin.focus_depth_mm.value_or(std::numeric_limits<double>::infinity()))},
        {"scale_ratio", thin.scale_ratio},
        {"corner_shift_px", thin.corner_shift_px},
        {"alike_up_to_mm", Number(thin.alike_up_to_mm)}}},
      {"distortion", DistortionJson(explanation.distortion)},
      {"hyperfocal_mm", explanation.hyperfocal_mm},
      {"working_f_number", explanation.working_f_number}};
  for (const model::DepthRow& row : explanation.rows) json["depths"].push_back(RowJson(row));
  for (const model::DepthOfFieldRow& row : explanation.depth_of_field) {
    json["depth_of_field"].push_back({{"blur_radius_px", row.blur_radius_px},
                                      {"near_mm", Number(row.near_mm)},
                                      {"far_mm", Number(row.far_mm)}});
  }
  return json;
}

}  // namespace thicklens::tools
