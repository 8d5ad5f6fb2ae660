#include "calib/registration/tile_pass.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <opencv2/imgproc.hpp>

#include "calib/registration/place_blur.h"

namespace thicklens::calib {
namespace {

// Larger fields are shrunk to this size. More pixels would cost time without more information on
// the scale.
constexpr int kLargestFieldPx = 640;
constexpr int kSmallestFieldPx = 96;  // minimum size to which a field is shrunk
constexpr int kTilesAcross = 4;
constexpr double kTilePart = 0.36;  // relative to the field's shorter side
// An image blurred by this many shrunk pixels contains no detail that shrinking loses.
constexpr double kBlurPerShrunkPixel = 1.3;

// Side of a tile, chosen among sizes with fast transforms.
int TileSize(int field_px) {
  static constexpr std::array<int, 18> kSizes = {24, 30, 32, 36,  40,  48,  54,  60,  64,
                                                 72, 80, 96, 108, 120, 128, 144, 160, 180};
  int size = kSizes[0];
  for (const int candidate : kSizes) {
    if (candidate <= kTilePart * field_px) size = candidate;
  }
  return size;
}

constexpr double kMinMatchedPx = 0.3;  // standard deviation of a blur that is matched

// Applies the added blur of the more blurred image to the sharper one. Otherwise the parts that a
// window cuts off would differ between the two, and look like a shift.
void MatchBlur(double variance_px2, cv::Mat* reference, cv::Mat* frame) {
  const double sigma_px = std::sqrt(std::abs(variance_px2));
  if (!(sigma_px > kMinMatchedPx)) return;
  cv::Mat* sharper = variance_px2 > 0 ? reference : frame;
  cv::GaussianBlur(*sharper, *sharper, cv::Size(), sigma_px, sigma_px, cv::BORDER_REPLICATE);
}

// Gives every point of the reference the blur that it lacks at its place.
void MatchBlur(PlaceBlur blur, cv::Mat* reference, cv::Mat* frame) {
  double too_much_px2 = std::max(0.0, -blur.Least(reference->size()));
  if (too_much_px2 < kMinMatchedPx * kMinMatchedPx) too_much_px2 = 0;  // it counts as 0
  blur.at_centre_px2 += too_much_px2;
  MatchBlur(-too_much_px2, reference, frame);
  *reference = SpreadByPlace(*reference, blur);
}

// Mean square of the distance from `centre`, over all tiles with the weight of their windows, px^2.
double MeanSquareRadius(const TileLayout& layout, const Eigen::Vector2d& centre,
                        double weight_variance_px2) {
  double sum = 0;
  for (const cv::Point& corner : layout.corners) {
    const Eigen::Vector2d middle =
        Eigen::Vector2d(corner.x, corner.y).array() + 0.5 * (layout.size_px - 1);
    sum += (middle - centre).squaredNorm() + 2 * weight_variance_px2;
  }
  return sum / static_cast<double>(layout.corners.size());
}

}  // namespace

std::optional<TileLayout> LayOutTiles(const FrameMap& map, cv::Size reference, cv::Size frame,
                                      int factor) {
  const cv::Rect2d shared = SharedField(map, reference, frame);
  const cv::Rect whole(0, 0, frame.width / factor, frame.height / factor);
  const int left = static_cast<int>(std::ceil((shared.x + 0.5) / factor));
  const int top = static_cast<int>(std::ceil((shared.y + 0.5) / factor));
  TileLayout layout;
  layout.field =
      cv::Rect(left, top, static_cast<int>((shared.x + shared.width + 0.5) / factor) - left,
               static_cast<int>((shared.y + shared.height + 0.5) / factor) - top) &
      whole;
  const cv::Rect& field = layout.field;
  layout.size_px = TileSize(std::min(field.width, field.height));
  if (std::min(field.width, field.height) < layout.size_px + kTilesAcross) return std::nullopt;
  for (int j = 0; j < kTilesAcross; ++j) {
    for (int i = 0; i < kTilesAcross; ++i) {
      layout.corners.emplace_back(
          field.x + (field.width - layout.size_px) * i / (kTilesAcross - 1),
          field.y + (field.height - layout.size_px) * j / (kTilesAcross - 1));
    }
  }
  return layout;
}

std::optional<TilePass> MeasureTiles(const cv::Mat& reference, const cv::Mat& frame,
                                     const FrameMap& map, int factor, double variance_px2,
                                     const std::optional<KnownBlurField>& known) {
  const auto layout = LayOutTiles(map, reference.size(), frame.size(), factor);
  if (!layout) return std::nullopt;
  const cv::Rect& field = layout->field;
  const cv::Rect whole(0, 0, frame.cols / factor, frame.rows / factor);
  double largest_px2 = std::abs(variance_px2) / (factor * factor);
  if (known) {
    // The corners of the field may be blurred by more than its mean.
    const Eigen::Vector2d centre = (map.centre.array() + 0.5) / factor - 0.5;
    for (const cv::Point& corner : {field.tl(), field.br(), cv::Point(field.x, field.br().y),
                                    cv::Point(field.br().x, field.y)}) {
      largest_px2 = std::max(largest_px2,
                             std::abs(variance_px2) / (factor * factor) +
                                 (std::abs(known->curvature) + std::abs(known->astigmatism)) *
                                     (Eigen::Vector2d(corner.x, corner.y) - centre).squaredNorm());
    }
    // A blur wider than the tiles is no law that the frames have shown.
    if (!(largest_px2 < 0.25 * layout->size_px * layout->size_px)) return std::nullopt;
  }
  const double blur_px = std::sqrt(largest_px2);
  // The margin contains the surroundings, because the blur moves their light into the field.
  const int margin = static_cast<int>(std::ceil(3 * blur_px));
  const cv::Rect region = cv::Rect(field.x - margin, field.y - margin, field.width + 2 * margin,
                                   field.height + 2 * margin) &
                          whole;
  cv::Mat expected = InFrameGeometry(reference, map, factor, region);
  cv::Mat seen = Shrunk(frame, factor)(region);
  TilePhases phases(layout->size_px);
  const double mean_px2 = variance_px2 / (factor * factor);
  if (known) {
    const Eigen::Vector2d centre = (map.centre.array() + 0.5) / factor - 0.5;
    PlaceBlur blur;
    blur.centre_px = centre - Eigen::Vector2d(region.x, region.y);
    blur.curvature = known->curvature;
    blur.astigmatism = known->astigmatism;
    blur.at_centre_px2 =
        mean_px2 -
        known->curvature * MeanSquareRadius(*layout, centre, phases.weight_variance_px2());
    MatchBlur(blur, &expected, &seen);
  } else {
    MatchBlur(mean_px2, &expected, &seen);
  }
  for (const cv::Point& corner : layout->corners) phases.Add(expected, seen, corner - region.tl());
  TilePass pass;
  pass.shifts = phases.Solve();
  for (TileShift& tile : pass.shifts) {
    const Eigen::Vector2d shrunk = tile.centre_px + Eigen::Vector2d(region.x, region.y);
    tile.centre_px = (factor * (shrunk.array() + 0.5) - 0.5).matrix() - map.centre;
    tile.shift_px *= factor;
    tile.information /= factor * factor;
  }
  const double factor2 = factor * factor;
  pass.blurs = phases.Blurs(variance_px2 / factor2);
  for (TileBlur& tile : pass.blurs) {
    const Eigen::Vector2d shrunk = tile.centre_px + Eigen::Vector2d(region.x, region.y);
    tile.centre_px = (factor * (shrunk.array() + 0.5) - 0.5).matrix() - map.centre;
    tile.added_px2 *= factor2;
    tile.information /= factor2 * factor2;
  }
  pass.texture = phases.PowerOfTexture(variance_px2 / factor2);
  pass.texture.log_frequency -= std::log(factor);
  if (pass.texture.exponent) pass.texture.exponent->log_frequency -= std::log(factor);
  pass.weight_variance_px2 = phases.weight_variance_px2() * factor * factor;
  pass.agreement = phases.agreement();
  // The blur matched before is added.
  if (phases.added_variance_px2())
    pass.added_variance_px2 = variance_px2 + *phases.added_variance_px2() * factor * factor;
  return pass;
}

int TileFactor(double field_px, double blur_px) {
  const int size = static_cast<int>(std::ceil(field_px / kLargestFieldPx));
  const int blur = static_cast<int>(blur_px / kBlurPerShrunkPixel);
  const int most = std::max(1, static_cast<int>(field_px / kSmallestFieldPx));
  return std::clamp(std::max(size, blur), 1, most);
}

}  // namespace thicklens::calib
