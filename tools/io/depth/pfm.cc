// Depth maps in PFM files, and what the scale of their header does.
#include <fmt/format.h>

#include <cmath>
#include <opencv2/core.hpp>

#include "thicklens/base/cancel.h"
#include "thicklens/base/error.h"
#include "tools/io/depth/depth_readers.h"
#include "tools/io/pnm_pixels.h"

namespace thicklens::io {

double PfmFactor(double magnitude, PfmScale scale, DepthFile* file) {
  if (magnitude == 1) return 1;
  // Headers round 1/255 to few digits.
  constexpr double kMiddlebury = 1.0 / 255, kRounding = 0.01;
  const bool is_middlebury = std::abs(magnitude / kMiddlebury - 1) <= kRounding;
  const bool is_applied =
      scale == PfmScale::kApplied || (scale == PfmScale::kByRule && !is_middlebury);
  file->notes.push_back(fmt::format(
      "The header's scale {:g} is {}.", magnitude,
      is_applied ? "applied to the values"
      : scale == PfmScale::kByRule
          ? "about 1/255, as in the Middlebury benchmark, whose values are px without it, and is "
            "not applied"
          : "not applied"));
  return is_applied ? magnitude : 1;
}

float PfmValue(double factor, float stored) {
  // The product would change the bits of a NaN.
  return factor == 1 ? stored : static_cast<float>(factor * stored);
}

DepthFile DecodePfmDepth(const std::string& bytes, const std::string& name, PfmScale scale) {
  DecodedImage decoded;
  try {
    decoded = DecodePfmImage(bytes);
  } catch (const Interrupted&) {
    throw;
  } catch (const Error& error) {
    throw Error(fmt::format("{}: broken PFM: {}", name, error.what()));
  }
  DepthFile file;
  file.map.width_px = decoded.pixels.cols;
  file.map.height_px = decoded.pixels.rows;
  const double factor = PfmFactor(decoded.facts.value_scale, scale, &file);
  file.map.values.reserve(decoded.pixels.total());
  for (int y = 0; y < decoded.pixels.rows; ++y) {
    ThrowIfCancelled();
    const auto* row = decoded.pixels.ptr<float>(y);
    for (int x = 0; x < decoded.pixels.cols; ++x)
      file.map.values.push_back(PfmValue(factor, row[x]));
  }
  file.description = fmt::format("PFM, {} x {} px, {}", decoded.pixels.cols, decoded.pixels.rows,
                                 decoded.facts.sample_type);
  return file;
}

std::string EncodePfm(const model::RawDepthMap& map) {
  return EncodePfmImage(
      cv::Mat(map.height_px, map.width_px, CV_32F,
              const_cast<float*>(map.values.data())));  // NOLINT: they are only read
}

}  // namespace thicklens::io
