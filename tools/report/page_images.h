#ifndef THICKLENS_TOOLS_REPORT_PAGE_IMAGES_H_
#define THICKLENS_TOOLS_REPORT_PAGE_IMAGES_H_

#include <array>
#include <cstdint>
#include <opencv2/core/mat.hpp>
#include <string>
#include <utility>
#include <vector>

#include "thicklens/model/scene.h"

namespace thicklens::tools {

// Images as a page shows them: cv::Mat of 8 bit, 1 or 3 (RGB) channels, encoded by sRGB.

// Shrinks larger images to the longest edge, in linear light.
cv::Mat ShownImage(const model::LinearImage& image, int longest_edge_px);
// Converts an image as stored by its file, 8 or 16 bit, 1, 3 or 4 channels; alpha is left out.
cv::Mat ShownImage(const cv::Mat& stored);

// Returns mid grey + gain * (image - reference); both have one size and number of channels.
cv::Mat AmplifiedDifference(const cv::Mat& image, const cv::Mat& reference, double gain);
// Returns the power of two, 1 to 32, that makes differences fill the range up to their largest
// hundredth.
int GainForDifferences(const std::vector<std::pair<cv::Mat, cv::Mat>>& pairs);

// A colour map whose lightness rises evenly, from dark blue through green to yellow (after
// matplotlib's viridis); `position` is clamped to [0, 1].
std::array<std::uint8_t, 3> MapColour(double position);
// "#rrggbb".
std::string MapColourCss(double position);

struct ColourRange {
  double lo = 0, hi = 1;
  bool bright_is_low = false;

  double Position(double value) const;
};
// Shows a map in colours; NaN is hatched grey. Larger maps are shrunk by leaving samples out, since
// a mean of two depths is not a depth of the scene.
cv::Mat ColourMapped(const std::vector<float>& values, int width_px, int height_px,
                     const ColourRange& range, int longest_edge_px);

// Shows a signed map in greys: mid grey is 0, white is `range` and more, black is -range and less.
// Larger maps are shrunk by leaving samples out, so that noise keeps its amplitude.
cv::Mat GreyMapped(const std::vector<float>& values, int width_px, int height_px, double range,
                   int longest_edge_px);

enum class Packing {
  kExact,  // PNG
  kSmall,  // JPEG of quality 90, if the image is large enough for it to pay
};
// Returns an <img> with its image inside, for a place `place_px` wide. A narrower image is enlarged
// at most four times and keeps crisp pixels (class "crisp").
std::string EmbeddedImage(const cv::Mat& shown, const std::string& alt, Packing packing,
                          int place_px);

std::string Base64(const std::vector<unsigned char>& bytes);

}  // namespace thicklens::tools

#endif  // THICKLENS_TOOLS_REPORT_PAGE_IMAGES_H_
