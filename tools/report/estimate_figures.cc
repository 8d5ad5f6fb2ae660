#include "tools/report/estimate_figures.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "thicklens/base/cancel.h"
#include "thicklens/estimator/estimate_checks.h"
#include "tools/report/page_figures.h"
#include "tools/report/page_images.h"
#include "tools/report/page_style.h"

namespace thicklens::tools {
namespace {

constexpr int kMapPx = 890;
constexpr int kMosaicPx = 1780;
constexpr int kMosaicGapPx = 2;
constexpr double kLevelsOfFigure = 255;

// The confidence of a pixel; if several apply, the last one here counts.
enum class Confidence : std::size_t { kSeen, kPartlyVisible, kBlurred, kFilledIn };
struct ConfidenceLook {
  const char* words;
  std::array<std::uint8_t, 3> colour;
};
const std::array<ConfidenceLook, 4>& ConfidenceLooks() {
  static const std::array<ConfidenceLook, 4> looks = {{
      {"seen: the centre view shows everything that the aperture sees", {150, 150, 150}},
      {"partly seen: some rays come past an edge or the border", {240, 178, 58}},
      {"too blurred for fine detail", {66, 135, 245}},
      {"filled in: most rays come past an edge or the border", {217, 48, 37}},
  }};
  return looks;
}

Confidence ConfidenceOf(float occluded_fraction, float blur_sigma_px) {
  constexpr float kVisibleFraction = 0.01F, kFilledShare = 0.5F;
  if (occluded_fraction > kFilledShare) return Confidence::kFilledIn;
  if (blur_sigma_px > static_cast<float>(estimator::kUnresolvedBlurSigmaPx)) {
    return Confidence::kBlurred;
  }
  return occluded_fraction > kVisibleFraction ? Confidence::kPartlyVisible : Confidence::kSeen;
}

std::string Css(const std::array<std::uint8_t, 3>& colour) {
  return fmt::format("#{:02x}{:02x}{:02x}", colour[0], colour[1], colour[2]);
}

// Returns the residual that the map shows as white (or black, if negative), in encoded values: a
// round number of grey levels that 99 of 100 pixels do not exceed.
double ResidualRange(const std::vector<float>& residual) {
  std::vector<float> sizes;
  sizes.reserve(residual.size());
  for (const float value : residual) sizes.push_back(std::abs(value));
  const auto at = sizes.begin() + static_cast<std::ptrdiff_t>((sizes.size() - 1) * 99 / 100);
  std::nth_element(sizes.begin(), at, sizes.end());
  for (const double levels : {1, 2, 5, 10, 20, 50, 100}) {
    if (kLevelsOfFigure * static_cast<double>(*at) <= levels) return levels / kLevelsOfFigure;
  }
  return 1;
}

// The photograph in dim grey, tinted by the confidence of each pixel.
cv::Mat ConfidenceMap(const LightFieldPageInput& input, const std::vector<Confidence>& known) {
  constexpr double kTint = 0.6;
  const int width_px = input.light_field->s_count, height_px = input.light_field->t_count;
  model::LinearImage photo{width_px, height_px, 1, {}};
  if (input.photo) {
    photo = model::ToGrey(*input.photo);
  } else {
    photo.values.assign(known.size(), 0.2F);
  }
  const cv::Mat grey = ShownImage(photo, kMapPx);
  cv::Mat shown(grey.size(), CV_8UC3);
  for (int y = 0; y < shown.rows; ++y) {
    ThrowIfCancelled();
    const int from_y = static_cast<int>((y + 0.5) * height_px / shown.rows);
    for (int x = 0; x < shown.cols; ++x) {
      const int from_x = static_cast<int>((x + 0.5) * width_px / shown.cols);
      const Confidence pixel =
          known[static_cast<std::size_t>(from_y) * static_cast<std::size_t>(width_px) +
                static_cast<std::size_t>(from_x)];
      const auto& colour = ConfidenceLooks()[static_cast<std::size_t>(pixel)].colour;
      for (int c = 0; c < 3; ++c) {
        shown.ptr<std::uint8_t>(y)[3 * x + c] =
            static_cast<std::uint8_t>(std::lround(kTint * colour[static_cast<std::size_t>(c)] +
                                                  (1 - kTint) * grey.ptr<std::uint8_t>(y)[x]));
      }
    }
  }
  return shown;
}

std::string ConfidenceLegend(const std::vector<Confidence>& known) {
  std::string items;
  for (std::size_t i = 0; i < ConfidenceLooks().size(); ++i) {
    const auto count = std::count(known.begin(), known.end(), static_cast<Confidence>(i));
    items += fmt::format("<li><i style=\"background: {}\"></i>{} ({:.1f} %)</li>\n",
                         Css(ConfidenceLooks()[i].colour), ConfidenceLooks()[i].words,
                         100.0 * static_cast<double>(count) / static_cast<double>(known.size()));
  }
  return "<ul class=\"legend\">\n" + items + "</ul>\n";
}

}  // namespace

std::string ResidualFigure(const LightFieldPageInput& input) {
  if (input.maps == nullptr || input.maps->residual.empty()) return "";
  const model::LightField& light_field = *input.light_field;
  const double range = ResidualRange(input.maps->residual);
  const cv::Mat shown =
      GreyMapped(input.maps->residual, light_field.s_count, light_field.t_count, range, kMapPx);
  const std::string scale =
      ColourScale("residual", -kLevelsOfFigure * range, kLevelsOfFigure * range,
                  "grey levels of 255", [range](double levels) {
                    const cv::Mat shown_value =
                        GreyMapped({static_cast<float>(levels / kLevelsOfFigure)}, 1, 1, range, 1);
                    const std::uint8_t grey = shown_value.at<std::uint8_t>(0, 0);
                    return Css({grey, grey, grey});
                  });
  std::string caption =
      "The photograph computed from the light field minus the real photograph, in encoded values "
      "(mean of the channels). Grey means no difference, bright means that the estimate is too "
      "bright. Only noise should remain; visible outlines or patches mean that the depth or the "
      "blur is wrong. A blur that is too narrow fits as well and does not show here.";
  if (input.estimate && input.estimate->residual_rms && input.estimate->noise_sigma) {
    caption += fmt::format(
        " Its rms is {:.2f} grey levels, the noise of the photograph {:.2f} per "
        "channel.",
        kLevelsOfFigure * *input.estimate->residual_rms,
        kLevelsOfFigure * *input.estimate->noise_sigma);
  }
  return Figure(
      fmt::format("<div class=\"images\" style=\"--columns: 1\"><div>{}{}</div></div>\n",
                  EmbeddedImage(shown, "Residual of the photograph", Packing::kExact, PlacePx(1)),
                  scale),
      "Residual of the photograph", caption);
}

std::string ConfidenceFigure(const LightFieldPageInput& input) {
  if (input.maps == nullptr || input.maps->occluded_fraction.empty()) return "";
  const estimator::SceneMaps& maps = *input.maps;
  std::vector<Confidence> known;
  known.reserve(maps.occluded_fraction.size());
  for (std::size_t i = 0; i < maps.occluded_fraction.size(); ++i) {
    known.push_back(ConfidenceOf(maps.occluded_fraction[i], maps.blur_sigma_px[i]));
  }
  const cv::Mat map = ConfidenceMap(input, known);
  return Figure(
      Grid(1, Cell(EmbeddedImage(map, "Confidence of the estimate", Packing::kSmall, PlacePx(1)),
                   "")) +
          ConfidenceLegend(known),
      "Confidence of the estimate",
      fmt::format("Shares refer to the photograph's pixels, those of the summary to all rays of "
                  "the views. Areas that the centre view does not show are filled from the "
                  "background beside them. Where the blur has a sigma of more than {:g} px, the "
                  "photograph contains at most a twentieth of details finer than 8 px.",
                  estimator::kUnresolvedBlurSigmaPx));
}

std::string MosaicFigure(const LightFieldPageInput& input) {
  const model::LightField& light_field = *input.light_field;
  // Each view is shrunk first, so that a large light field is not kept twice.
  const int view_px =
      std::max(1, kMosaicPx / std::max(light_field.u_count, light_field.v_count) - kMosaicGapPx);
  cv::Mat mosaic;
  for (int l = 0; l < light_field.v_count; ++l) {
    for (int k = 0; k < light_field.u_count; ++k) {
      if (!light_field.IsPresent(k, l)) continue;
      const cv::Mat shown = ShownImage(model::ViewImage(light_field, k, l), view_px);
      const int across_px = shown.cols + kMosaicGapPx, down_px = shown.rows + kMosaicGapPx;
      if (mosaic.empty()) {
        mosaic = cv::Mat::zeros(light_field.v_count * down_px - kMosaicGapPx,
                                light_field.u_count * across_px - kMosaicGapPx, shown.type());
      }
      shown.copyTo(mosaic(cv::Rect(k * across_px, l * down_px, shown.cols, shown.rows)));
    }
  }
  return Figure(
      Grid(1, Cell(EmbeddedImage(mosaic, "Mosaic of the views", Packing::kSmall, PlacePx(1)), "")),
      "The views",
      fmt::format("All {} × {} views side by side, each as a pinhole at that place of the aperture "
                  "would see the scene: u counts from left to right, v from top to bottom. From "
                  "left to right, points nearer than the plane of focus move left, and farther "
                  "ones move right. Every view should be sharp at all depths.",
                  light_field.u_count, light_field.v_count));
}

std::string EstimateFigureStyle() {
  return R"(.legend { list-style: none; padding: 0; margin: 10px 0 0; font-size: 14px; }
.legend i { display: inline-block; width: 14px; height: 14px; margin-right: 8px;
  border-radius: 2px; vertical-align: -2px; }
)";
}

}  // namespace thicklens::tools
