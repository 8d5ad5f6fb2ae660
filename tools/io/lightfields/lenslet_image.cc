// Images of square lenslets: N x N neighbouring pixels are one point of the scene, seen from N x N
// places. ESLF files of the Lytro Illum (lightfields.stanford.edu) have 14 x 14; pixel (s, t) of a
// lenslet belongs to the view in column s, row t, and an alpha channel is 0 where a view is empty
// (LFReadESLF.m of the Light Field Toolbox for Matlab). The raw image of a plenoptic camera, whose
// lenslets are hexagonal or do not have a whole number of pixels, must be decoded first.
#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <cstring>
#include <filesystem>
#include <memory>

#include "thicklens/base/cancel.h"
#include "thicklens/base/error.h"
#include "thicklens/base/input_file.h"
#include "thicklens/io/image_file.h"
#include "tools/io/lightfields/image_tiles.h"
#include "tools/io/lightfields/layout.h"
#include "tools/io/lightfields/view_grid.h"
#include "tools/io/lightfields/view_pixels.h"

namespace thicklens::io {

namespace fs = std::filesystem;

bool IsNamedEslf(const std::string& path) {
  std::string name = fs::path(path).stem().string();
  std::transform(name.begin(), name.end(), name.begin(),
                 [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  return name.find("eslf") != std::string::npos;
}

namespace {

constexpr int kLytroPx = 14;
constexpr int kMaxLensletPx = 100;

// The pixels (k, l) of all lenslets.
cv::Mat ViewOfLenslets(const cv::Mat& pixels, AxisCounts lenslet, int k, int l) {
  cv::Mat view(pixels.rows / lenslet.down, pixels.cols / lenslet.across, pixels.type());
  const std::size_t size = pixels.elemSize();
  for (int y = 0; y < view.rows; ++y) {
    ThrowIfCancelled();
    const auto* from = pixels.ptr(y * lenslet.down + l);
    auto* to = view.ptr(y);
    for (int x = 0; x < view.cols; ++x) {
      std::memcpy(to + static_cast<std::size_t>(x) * size,
                  from + static_cast<std::size_t>(x * lenslet.across + k) * size, size);
    }
  }
  return view;
}

// Whether alpha, the last channel, is 0 in all pixels of a view.
bool IsEmptyByAlpha(const cv::Mat& view) {
  const int channels = view.channels();
  cv::Mat values;
  view.convertTo(values, CV_32F);
  for (int y = 0; y < values.rows; ++y) {
    const auto* row = values.ptr<float>(y);
    for (int x = 0; x < values.cols; ++x) {
      if (row[static_cast<std::ptrdiff_t>(x) * channels + channels - 1] != 0) return false;
    }
  }
  return true;
}

void LeaveOutEmptyViews(const cv::Mat& pixels, AxisCounts lenslet, ViewSource* source) {
  const bool has_alpha = pixels.channels() == 2 || pixels.channels() == 4;
  if (!has_alpha) return;
  model::LightField& frame = source->frame;
  std::vector<std::string> empty;
  std::vector<bool> present;
  for (int l = 0; l < frame.v_count; ++l) {
    for (int k = 0; k < frame.u_count; ++k) {
      const bool is_empty = IsEmptyByAlpha(ViewOfLenslets(pixels, lenslet, k, l));
      present.push_back(!is_empty);
      if (is_empty) {
        frame.weights(l, k) = 0;
        empty.push_back(fmt::format("view ({}, {})", k, l));
      }
    }
  }
  if (empty.empty() || empty.size() == present.size()) return;
  frame.present = present;
  frame.weights /= frame.weights.sum();
  source->details.push_back(
      fmt::format("left out because the alpha channel is 0: {}", Listed(empty)));
}

// The pixels of a lenslet: as the options state, 14 in ESLF files, or as the image shows them.
AxisCounts LensletOf(const LayoutInput& input, const cv::Mat& pixels, std::string* how) {
  const LightFieldReading& reading = *input.reading;
  if (input.is_forced && reading.layout_u > 0) return {reading.layout_u, reading.layout_v};
  if (reading.grid > 0) return {reading.grid, reading.grid};
  const bool is_lytro =
      IsNamedEslf(input.path) && pixels.cols % kLytroPx == 0 && pixels.rows % kLytroPx == 0;
  if (is_lytro) return {kLytroPx, kLytroPx};
  const int pitch = LensletPitchOf(pixels);
  if (pitch > 0 && pixels.cols % pitch == 0 && pixels.rows % pitch == 0) {
    *how = "the lenslets' size is that of the steps in the image";
    return {pitch, pitch};
  }
  throw Error(fmt::format(
      "{}: {} x {} px are no whole number of lenslets of {} x {} px, and the image shows no other "
      "size: the option layout must state how many pixels a lenslet has: lenslets:14x14 (numbers "
      "that divide both sides: {})",
      input.path, pixels.cols, pixels.rows, kLytroPx, kLytroPx,
      CommonDivisors(pixels.cols, pixels.rows)));
}

}  // namespace

std::optional<ViewSource> OpenLensletImage(const LayoutInput& input) {
  if (!input.is_forced && !IsNamedEslf(input.path)) return std::nullopt;
  ReportInput(input.path);
  const auto image = std::make_shared<const DecodedImage>(ReadImageData(input.path));
  const cv::Mat& pixels = image->pixels;
  std::string how;
  const AxisCounts lenslet = LensletOf(input, pixels, &how);
  if (lenslet.across < 1 || lenslet.down < 1 || lenslet.across > kMaxLensletPx ||
      lenslet.down > kMaxLensletPx || lenslet.across > pixels.cols || lenslet.down > pixels.rows) {
    throw Error(fmt::format(
        "{}: lenslets of 1 to {} px that fit into {} x {} px are expected, "
        "found {} x {}",
        input.path, kMaxLensletPx, pixels.cols, pixels.rows, lenslet.across, lenslet.down));
  }
  ViewSource source;
  source.kind = fmt::format("an image of lenslets of {} x {} px", lenslet.across, lenslet.down);
  source.frame = FullFrame(lenslet.across, lenslet.down);
  if (!how.empty()) source.details.push_back(how);
  const int edge = std::max(lenslet.across, lenslet.down);
  if (edge > 1) source.plain_disparity_px = 1.0 / edge;
  const int pitch = how.empty() ? LensletPitchOf(pixels) : 0;
  if (pitch > 0 && (pitch != lenslet.across || pitch != lenslet.down)) {
    source.doubt =
        fmt::format("the image has steps at every {} px, as lenslets of {} x {} px have them",
                    pitch, pitch, pitch);
    // The blocks of JPEG have 8 px.
    constexpr int kJpegBlockPx = 8;
    if (pitch != kJpegBlockPx) {
      source.notices.push_back(
          fmt::format("{}: lenslets of {} x {} px are read, but {}; the option layout states "
                      "another size: lenslets:{}x{}",
                      input.path, lenslet.across, lenslet.down, source.doubt, pitch, pitch));
    }
  }
  const int rest_x = pixels.cols % lenslet.across;
  const int rest_y = pixels.rows % lenslet.down;
  if (rest_x > 0 || rest_y > 0) {
    source.notices.push_back(
        fmt::format("{}: the last {} column(s) and {} row(s) of pixels are no whole lenslets of {} "
                    "x {} px and are left out; the size of the lenslets may be wrong",
                    input.path, rest_x, rest_y, lenslet.across, lenslet.down));
  }
  LeaveOutEmptyViews(pixels, lenslet, &source);
  source.read = [image, lenslet, path = input.path](int k, int l) {
    return LightOfPixels(ViewOfLenslets(image->pixels, lenslet, k, l), image->facts, path);
  };
  return source;
}

}  // namespace thicklens::io
