// ImageWarper warps an image to other views.
#include <fmt/format.h>

#include <Eigen/Core>
#include <cstddef>

#include "thicklens/base/cancel.h"
#include "thicklens/base/error.h"
#include "thicklens/base/index.h"
#include "thicklens/estimator/view_geometry.h"

namespace thicklens::estimator {
namespace {

// A pixel whose disparity differs by more than this, px per view step, is not of the sample's
// surface.
constexpr double kSamePointPx = 0.3;

void CheckImage(const model::LinearImage& image) {
  if (image.width_px < 1 || image.height_px < 1 || image.channels < 1 ||
      image.values.size() !=
          Index(image.width_px) * Index(image.height_px) * Index(image.channels)) {
    throw Error(
        fmt::format("image: {} values for {}x{} px in {} channels: the count must be the product "
                    "of these numbers, and not 0",
                    image.values.size(), image.width_px, image.height_px, image.channels));
  }
}

void CheckSameSize(const char* what, int width_px, int height_px, const DisparityMap& map) {
  if (width_px == map.width_px && height_px == map.height_px) return;
  throw Error(
      fmt::format("{} has {}x{} px, but the disparity has {}x{} px: the sizes must be equal", what,
                  width_px, height_px, map.width_px, map.height_px));
}

// Throws Error if the sizes differ.
kernels::SurfaceImage SurfacesOf(const model::LinearImage& image, const DisparityMap& map) {
  CheckImage(image);
  CheckSameSize("the image", image.width_px, image.height_px, map);
  return {image.width_px, image.height_px,
          image.channels, &image.values,
          &map.disparity, static_cast<float>(kSamePointPx / map.step.cwiseAbs().maxCoeff())};
}

}  // namespace

ImageWarper::ImageWarper(const model::LinearImage& image, const DisparityMap& map)
    : map_(map), channels_(image.channels), rows_(SurfacesOf(image, map)) {}

model::LinearImage ImageWarper::Warp(const ViewDisparity& view) const {
  CheckSameSize("the view", view.width_px, view.height_px, map_);
  const std::size_t width = Index(map_.width_px);
  model::LinearImage warped{map_.width_px, map_.height_px, channels_, {}};
  warped.values.resize(map_.disparity.size() * Index(channels_));
  kernels::RowWarper::Places places(map_.width_px);
  for (int y = 0; y < map_.height_px; ++y) {
    ThrowIfCancelled();
    const std::size_t first = Index(y) * width;
    rows_.Warp(y, view.disparity.data() + first, view.source_x.data() + first,
               view.source_y.data() + first, &places,
               warped.values.data() + first * Index(channels_));
  }
  rows_.Mix(view.boundary, warped.values.data());
  return warped;
}

void ImageWarper::Warp(const CompactView& view, model::LinearImage* warped) const {
  CheckSameSize("the view", view.width_px, view.height_px, map_);
  const std::size_t width = Index(map_.width_px);
  warped->width_px = map_.width_px;
  warped->height_px = map_.height_px;
  warped->channels = channels_;
  warped->values.resize(map_.disparity.size() * Index(channels_));
  kernels::RowWarper::Places places(map_.width_px);
  std::vector<float> disparity(width), source_x(width), source_y(width);
  auto occluded = view.occluded.begin();
  for (int y = 0; y < map_.height_px; ++y) {
    ThrowIfCancelled();
    const std::size_t first = Index(y) * width;
    for (std::size_t x = 0; x < width; ++x) {
      disparity[x] = view.disparity[first + x];
      source_x[x] = static_cast<float>(view.shift.x() * disparity[x]);
      source_y[x] = static_cast<float>(view.shift.y() * disparity[x]);
    }
    for (; occluded != view.occluded.end() && Index(occluded->index) < first + width; ++occluded) {
      const std::size_t x = Index(occluded->index) - first;
      disparity[x] = occluded->disparity;
      source_x[x] = occluded->source_x;
      source_y[x] = occluded->source_y;
    }
    rows_.Warp(y, disparity.data(), source_x.data(), source_y.data(), &places,
               warped->values.data() + first * Index(channels_));
  }
  rows_.Mix(view.boundary, warped->values.data());
}

model::LinearImage WarpImage(const model::LinearImage& image, const DisparityMap& map,
                             const ViewDisparity& view) {
  return ImageWarper(image, map).Warp(view);
}

}  // namespace thicklens::estimator
