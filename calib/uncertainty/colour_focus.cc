#include "calib/uncertainty/colour_focus.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <utility>

#include "calib/uncertainty/systematic_advice.h"
#include "thicklens/model/grey_focus.h"

namespace thicklens::calib {
namespace {

constexpr std::size_t kColours = 3;
constexpr double kLargestChi2 = 16;  // of two degrees of freedom

bool AreMeasured(const std::vector<ChannelFocus>& channels) {
  return channels.size() == kColours &&
         std::all_of(channels.begin(), channels.end(),
                     [](const ChannelFocus& channel) { return channel.done; });
}

double Chi2(const std::vector<ChannelFocus>& channels, model::Estimate ChannelFocus::*value) {
  double weights = 0, mean = 0, chi2 = 0;
  for (const ChannelFocus& channel : channels) {
    const model::Estimate& of = channel.*value;
    const double weight = 1 / std::pow(std::max(of.sigma, 1e-12), 2);
    weights += weight;
    mean += weight * of.value;
  }
  mean /= weights;
  for (const ChannelFocus& channel : channels) {
    const model::Estimate& of = channel.*value;
    chi2 += std::pow((of.value - mean) / std::max(of.sigma, 1e-12), 2);
  }
  return chi2;
}

// Replaces kappa. Its error and its interval stay the same part of it, and the error of the new
// value is added as one that is independent of the others.
void MoveRatio(const model::Estimate& to, Calibration* calibration) {
  Result& ratio = *calibration->summary.blur_ratio;
  CalibrationDiagnostics& found = calibration->diagnostics;
  const double factor = to.value / ratio.value;
  ratio.value = to.value;
  ratio.sigma = std::hypot(factor * ratio.sigma, to.sigma);
  if (ratio.systematic) *ratio.systematic *= factor;
  for (SystematicPart& part : found.systematic_parts) part.blur_ratio *= factor;
  if (found.blur_slope_px_per_mm) {
    found.blur_slope_px_per_mm->value *= factor;
    found.blur_slope_px_per_mm->sigma *= factor;
  }
  const auto row =
      std::find(found.covariance_order.begin(), found.covariance_order.end(), "blur_ratio") -
      found.covariance_order.begin();
  if (row >= found.covariance.rows()) return;
  found.covariance.row(row) *= factor;
  found.covariance.col(row) *= factor;
  found.covariance(row, row) += to.sigma * to.sigma;
}

}  // namespace

model::Estimate RatioOfColour(const model::Estimate& fitted, double colour_focus_mm,
                              double grey_focus_mm, const model::ThickLens& lens) {
  const auto scale_mm = [&lens](double focus_mm) {
    return model::DefocusScaleMm(lens, model::ImageDistanceMm(lens, focus_mm));
  };
  const double factor = scale_mm(colour_focus_mm) / scale_mm(grey_focus_mm);
  return {factor * fitted.value, factor * fitted.sigma};
}

bool ColoursDiffer(const std::vector<ChannelFocus>& channels) {
  return AreMeasured(channels) && (Chi2(channels, &ChannelFocus::focus_depth_mm) > kLargestChi2 ||
                                   Chi2(channels, &ChannelFocus::blur_ratio) > kLargestChi2);
}

std::string ColoursInWords(const Calibration& calibration) {
  const std::vector<ChannelFocus>& channels = calibration.diagnostics.channels;
  if (!ColoursDiffer(channels)) return "";
  std::string colours;
  for (const ChannelFocus& channel : channels) {
    colours += fmt::format("{}{} at {:.2f} +- {:.2f} mm with the blur ratio {:.4f} +- {:.4f}",
                           colours.empty() ? "" : ", ", channel.name, channel.focus_depth_mm.value,
                           channel.focus_depth_mm.sigma, channel.blur_ratio.value,
                           channel.blur_ratio.sigma);
  }
  return fmt::format(
      "the colours come into focus differently: {}. The results are those of grey (0.2126 R + "
      "0.7152 G + 0.0722 B), whose 1/zf and kappa are the means of the colours'; the focal length "
      "is taken to be that of grey, and the interval of d1 allows that of each colour. The lens "
      "has axial "
      "colour, or parts of the target with different colours are at different depths",
      colours);
}

void FollowColours(const model::ThickLens& lens, bool focus_moves, Calibration* calibration) {
  const std::vector<ChannelFocus>& channels = calibration->diagnostics.channels;
  const auto& zf = calibration->summary.focus_depth_mm;
  const auto& ratio = calibration->summary.blur_ratio;
  if (!zf || !ratio || !ColoursDiffer(channels)) return;
  double squares_mm2 = 0, inverse_per_mm = 0, ratio_value = 0, ratio_variance = 0;
  for (std::size_t c = 0; c < kColours; ++c) {
    const double weight = model::kGreyWeights[c];
    const model::Estimate& focus = channels[c].focus_depth_mm;
    squares_mm2 += weight * (std::pow(focus.value - zf->value, 2) - std::pow(focus.sigma, 2));
    inverse_per_mm += weight / focus.value;
    ratio_value += weight * channels[c].blur_ratio.value;
    ratio_variance += std::pow(weight * channels[c].blur_ratio.sigma, 2);
  }
  MoveRatio({ratio_value, std::sqrt(ratio_variance)}, calibration);
  const double spread_mm = std::sqrt(std::max(0.0, squares_mm2));
  const double grey_move_mm = 1 / inverse_per_mm - zf->value;
  const auto distance_mm = [&](double move_mm) {
    const double nearest_mm = std::min(zf->value, 1.01 * lens.front_focal_length_mm);
    return model::ImageDistanceMm(lens, std::max(zf->value + move_mm, nearest_mm)) -
           model::ImageDistanceMm(lens, zf->value);
  };
  SystematicPart part;
  part.name = "axial colour";
  part.remedy =
      "calibrate frames of one colour: photograph the sweep in the light of that colour, or give "
      "one channel as grey frames";
  part.focus_depth_mm =
      focus_moves ? Eigen::Vector2d(-spread_mm, spread_mm)
                  : Eigen::Vector2d(std::min(0.0, grey_move_mm), std::max(0.0, grey_move_mm));
  part.image_distance_mm = {distance_mm(spread_mm), distance_mm(-spread_mm)};
  AddPart(std::move(part), calibration);
}

}  // namespace thicklens::calib
