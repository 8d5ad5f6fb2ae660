#include "tools/report/calibration_text.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdlib>
#include <limits>
#include <utility>

#include "tools/report/rounding.h"

namespace thicklens::tools {
namespace {

using model::Estimate;

// Returns whether a value differs from zero by more than its error explains.
bool IsSeen(const Estimate& estimate) { return std::abs(estimate.value) > 2 * estimate.sigma; }

std::string Signed(const Estimate& estimate, const std::string& unit) {
  return SignedWithError(estimate.value, estimate.sigma, unit);
}

std::string TiltLine(const Estimate& tilt, const char* axis, const char* positive,
                     const char* negative) {
  return fmt::format("tilt about the {} axis {} ({})", axis, Signed(tilt, "deg"),
                     !IsSeen(tilt)    ? "not significant"
                     : tilt.value > 0 ? positive
                                      : negative);
}

std::string ClusterLine(const std::vector<calib::DepthCluster>& clusters) {
  std::vector<std::string> depths;
  depths.reserve(clusters.size());
  for (const calib::DepthCluster& cluster : clusters)
    depths.push_back(
        fmt::format("{} ({} tile{})",
                    WithError(cluster.focus_depth_mm.value, cluster.focus_depth_mm.sigma, "mm"),
                    cluster.tiles, cluster.tiles == 1 ? "" : "s"));
  return fmt::format("parts of the field are in focus at {} different readings: zf = {}",
                     clusters.size(), fmt::join(depths, ", "));
}

// The range of kappa over the parts of the field, and whether it is more than their errors explain.
std::string RatioLine(const calib::FieldMap& field) {
  Estimate least{std::numeric_limits<double>::infinity(), 0}, most{0, 0};
  double sum = 0, weights = 0, squares = 0;
  int parts = 0;
  for (const calib::FieldTile& tile : field.tiles) {
    if (!tile.done || !(tile.blur_ratio.sigma > 0)) continue;
    if (tile.blur_ratio.value < least.value) least = tile.blur_ratio;
    if (tile.blur_ratio.value > most.value) most = tile.blur_ratio;
    const double weight = 1 / (tile.blur_ratio.sigma * tile.blur_ratio.sigma);
    sum += weight * tile.blur_ratio.value;
    squares += weight * tile.blur_ratio.value * tile.blur_ratio.value;
    weights += weight;
    ++parts;
  }
  if (parts < 2) return "";
  const double chi2_per_dof = (squares - sum * sum / weights) / (parts - 1);
  constexpr double kBeyondErrors = 4;
  const auto text = [](const Estimate& ratio) {
    return fmt::format("{} +- {}", RoundedTo(ratio.value, ratio.sigma), RoundedSigma(ratio.sigma));
  };
  return fmt::format("kappa of the parts from {} to {}, {} than their errors explain", text(least),
                     text(most), chi2_per_dof > kBeyondErrors ? "more" : "not more");
}

}  // namespace

std::string ScaleKindName(calib::ScaleKind kind) {
  switch (kind) {
    case calib::ScaleKind::kInverseDepth:
      return "inverse-depth";
    case calib::ScaleKind::kConstant:
      return "constant";
    case calib::ScaleKind::kReversed:
      return "reversed";
    case calib::ScaleKind::kMovingFocus:
      return "moving-focus";
    case calib::ScaleKind::kUnknown:
      break;
  }
  return "unknown";
}

std::string ScaleKindWords(calib::ScaleKind kind) {
  switch (kind) {
    case calib::ScaleKind::kInverseDepth:
      return "as 1/z: a camera whose pupil does not move";
    case calib::ScaleKind::kConstant:
      return "constant: the lens is telecentric, the sensor moves, the frames were aligned, or one "
             "image was repeated";
    case calib::ScaleKind::kReversed:
      return "as 1/z with reversed readings: check the direction of the scale, and whether the "
             "target moved and not the lens";
    case calib::ScaleKind::kMovingFocus:
      return "as the distance from the lens to the sensor changes it";
    case calib::ScaleKind::kUnknown:
      break;
  }
  return "unknown";
}

std::vector<std::string> FieldLines(const calib::FieldMap& field) {
  std::vector<std::string> lines;
  if (!field.done) return lines;
  if (field.tilt_right_deg)
    lines.push_back(TiltLine(*field.tilt_right_deg, "vertical", "the target's right side is nearer",
                             "the target's left side is nearer"));
  if (field.tilt_down_deg)
    lines.push_back(TiltLine(*field.tilt_down_deg, "horizontal", "the target's bottom is nearer",
                             "the target's top is nearer"));
  if (field.curvature_mm)
    lines.push_back(fmt::format("curvature {} from the centre to the outermost part",
                                Signed(*field.curvature_mm, "mm")));
  if (field.astigmatism_mm)
    lines.push_back(fmt::format("astigmatism {}, horizontal blur against vertical",
                                Signed(*field.astigmatism_mm, "mm")));
  if (field.field_astigmatism_mm)
    lines.push_back(
        fmt::format("field astigmatism {} in the corner, sagittal focus against "
                    "tangential (blur along the tangent against the radius)",
                    Signed(*field.field_astigmatism_mm, "mm")));
  if (field.clusters.size() > 1) lines.push_back(ClusterLine(field.clusters));
  if (std::string line = RatioLine(field); !line.empty()) lines.push_back(std::move(line));
  return lines;
}

std::string ChannelLine(const std::vector<calib::ChannelFocus>& channels) {
  std::vector<std::string> parts;
  for (const calib::ChannelFocus& channel : channels) {
    if (!channel.done) {
      parts.push_back(fmt::format("{} none ({})", channel.name, channel.message));
      continue;
    }
    const Estimate &focus = channel.focus_depth_mm, &ratio = channel.blur_ratio;
    parts.push_back(fmt::format(
        "{} {}{}", channel.name, WithError(focus.value, focus.sigma, "mm"),
        ratio.sigma > 0 ? fmt::format(" (kappa {} +- {})", RoundedTo(ratio.value, ratio.sigma),
                                      RoundedSigma(ratio.sigma))
                        : ""));
  }
  return fmt::format("{}", fmt::join(parts, ", "));
}

// The sides share no frame, so their errors are independent except for the bench offset, which
// shifts both alike: the hypotenuse is the upper bound.
std::optional<Estimate> SidesApartMm(const calib::Calibration& calibration) {
  const calib::SideFit& nearer = calibration.diagnostics.nearer;
  const calib::SideFit& farther = calibration.diagnostics.farther;
  if (!nearer.done || !farther.done) return std::nullopt;
  return Estimate{farther.focus_depth_mm.value - nearer.focus_depth_mm.value,
                  std::hypot(nearer.focus_depth_mm.sigma, farther.focus_depth_mm.sigma)};
}

std::string SidesLine(const calib::Calibration& calibration) {
  const auto side = [](const char* name, const calib::SideFit& fit) {
    return fit.done
               ? fmt::format("{} side zf {}", name,
                             WithError(fit.focus_depth_mm.value, fit.focus_depth_mm.sigma, "mm"))
               : fmt::format("{} side none, {}", name, fit.message);
  };
  std::string line = side("near", calibration.diagnostics.nearer) + "; " +
                     side("far", calibration.diagnostics.farther);
  if (const auto apart = SidesApartMm(calibration))
    line += fmt::format("; apart {}", Signed(*apart, "mm"));
  return line;
}

std::string ShapeLine(const calib::FocusSweep& sweep, const calib::BlurFit& blur) {
  if (!blur.done || !blur.gaussian_misfit || !blur.disc_misfit) return "";
  const bool disc = blur.better_psf == model::Psf::kDisc;
  const bool neither_fits =
      std::min(*blur.gaussian_misfit, *blur.disc_misfit) >= calib::kLargestMisfitOfShape;
  if (neither_fits) {
    return fmt::format(
        "neither a Gaussian nor a disc fits the frames (misfit {:.3g} and {:.3g}, 1 is expected)",
        *blur.gaussian_misfit, *blur.disc_misfit);
  }
  std::string line =
      fmt::format("a {} describes the frames better than a {} (misfit {:.3g} against {:.3g})",
                  disc ? "disc" : "Gaussian", disc ? "Gaussian" : "disc",
                  disc ? *blur.disc_misfit : *blur.gaussian_misfit,
                  disc ? *blur.gaussian_misfit : *blur.disc_misfit);
  if (blur.better_psf != sweep.camera.psf)
    line += fmt::format("; the camera file states {}", model::PsfName(sweep.camera.psf));
  return line;
}

std::string MagnificationLine(const calib::Calibration& calibration) {
  if (!calibration.diagnostics.magnification) return "";
  const calib::MagnificationCheck& check = *calibration.diagnostics.magnification;
  const Estimate& d1 = check.image_distance_mm;
  std::string line =
      fmt::format("the target's period of {:.6g} mm is {:.5g} px in the image: d1 = {}",
                  check.period_mm, check.period_px, WithError(d1.value, d1.sigma, "mm"));
  if (calibration.summary.image_distance_mm &&
      std::isfinite(calibration.summary.image_distance_mm->value)) {
    const double apart = d1.value / calibration.summary.image_distance_mm->value - 1;
    line += fmt::format(", {:+.2f} % from that of the focus fit", 100 * apart);
  }
  return line;
}

std::string DistortionLine(const calib::ScaleModel& scale) {
  if (!scale.distortion_at_corner) return "";
  const Estimate percent{100 * scale.distortion_at_corner->value,
                         100 * scale.distortion_at_corner->sigma};
  return fmt::format("radial distortion {} of the image height at the corner ({})",
                     Signed(percent, "%"),
                     !IsSeen(percent)    ? "not significant"
                     : percent.value > 0 ? "pincushion"
                                         : "barrel");
}

std::string OutcomeLine(const calib::Calibration& calibration, const std::string& camera_file) {
  const std::string& reason = calibration.summary.reason;
  switch (calibration.summary.outcome) {
    case calib::Outcome::kOk:
      return "calibrated";
    case calib::Outcome::kPartial:
      return fmt::format("partly calibrated: {}; the other results are {}", reason,
                         camera_file.empty() ? "determined" : "in " + camera_file);
    default:
      return "refused: " + reason;
  }
}

std::string WithNamesForKeys(std::string text) {
  for (const auto& [key, name] : {std::pair("image_distance_mm", "the image distance d1"),
                                  std::pair("focus_depth_mm", "the in-focus object distance zf"),
                                  std::pair("blur_ratio", "the blur ratio kappa"),
                                  std::pair("blur_floor_px", "the blur floor"),
                                  std::pair("bench_offset_mm", "the bench offset")}) {
    for (std::size_t at = text.find(key); at != std::string::npos; at = text.find(key, at))
      text.replace(at, std::char_traits<char>::length(key), name);
  }
  return text;
}

std::string OutsideLine(const calib::BlurFit& blur) {
  if (!(blur.outside_mm > 0)) return "";
  return fmt::format("the focus lies {:.2g} mm outside the sweep and is extrapolated",
                     blur.outside_mm);
}

std::string WorstKnownLine(const calib::BlurFit& blur) {
  constexpr double kWorthReporting = 0.5;
  if (blur.weak_direction.empty() || std::abs(blur.weak_correlation) < kWorthReporting) return "";
  return "least certain: " + WithNamesForKeys(blur.weak_direction);
}

std::string WidenedLine(const calib::BlurFit& blur) {
  constexpr double kWorthReporting = 2;
  // If there are few frames, chance alone reaches this, and the fit does not widen its errors for
  // chance.
  constexpr double kBeyondChance = 3.5;
  constexpr int kManyFrames = 20;
  if (!blur.done || !(blur.chi2_per_dof > kWorthReporting)) return "";
  const bool widened = blur.chi2_per_dof > kBeyondChance || blur.frames_used >= kManyFrames;
  return fmt::format("the residuals of the frames exceed their errors (chi2/dof {:.3g}){}",
                     blur.chi2_per_dof, widened ? "; the errors were widened accordingly" : "");
}

std::string PartRange(const Eigen::Vector2d& range) {
  if (!range.allFinite()) return "-";
  const double largest = range.cwiseAbs().maxCoeff();
  if (!(largest > 5e-6)) return "0";  // too small to show in any of the units
  return fmt::format("{} .. {}", SignedRoundedTo(range.x(), largest),
                     SignedRoundedTo(range.y(), largest));
}

}  // namespace thicklens::tools
