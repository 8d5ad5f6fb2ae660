// PictureWarper warps an image to other views.
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

void CheckPicture(const model::LinearPicture& picture) {
  if (picture.width_px < 1 || picture.height_px < 1 || picture.channels < 1 ||
      picture.values.size() !=
          Index(picture.width_px) * Index(picture.height_px) * Index(picture.channels)) {
    throw Error(
        fmt::format("picture: {} values for {}x{} px in {} channels: the count must be the "
                    "product, and not 0",
                    picture.values.size(), picture.width_px, picture.height_px, picture.channels));
  }
}

void CheckSameSize(const char* what, int width_px, int height_px, const DisparityMap& map) {
  if (width_px == map.width_px && height_px == map.height_px) return;
  throw Error(fmt::format("{} is {}x{} px, the disparity {}x{} px: the sizes must be equal", what,
                          width_px, height_px, map.width_px, map.height_px));
}

// Throws Error if the sizes differ.
kernels::SurfacePicture SurfacesOf(const model::LinearPicture& picture, const DisparityMap& map) {
  CheckPicture(picture);
  CheckSameSize("the picture", picture.width_px, picture.height_px, map);
  return {picture.width_px, picture.height_px,
          picture.channels, &picture.values,
          &map.disparity,   static_cast<float>(kSamePointPx / map.step.cwiseAbs().maxCoeff())};
}

}  // namespace

PictureWarper::PictureWarper(const model::LinearPicture& picture, const DisparityMap& map)
    : map_(map), channels_(picture.channels), rows_(SurfacesOf(picture, map)) {}

model::LinearPicture PictureWarper::Warp(const ViewDisparity& view) const {
  CheckSameSize("the view", view.width_px, view.height_px, map_);
  const std::size_t width = Index(map_.width_px);
  model::LinearPicture warped{map_.width_px, map_.height_px, channels_, {}};
  warped.values.resize(map_.disparity.size() * Index(channels_));
  kernels::RowWarper::Places places(map_.width_px);
  for (int y = 0; y < map_.height_px; ++y) {
    ThrowIfCancelled();
    const std::size_t first = Index(y) * width;
    rows_.Warp(y, view.disparity.data() + first, view.source_x.data() + first,
               view.source_y.data() + first, &places,
               warped.values.data() + first * Index(channels_));
  }
  rows_.Mix(view.mixed, warped.values.data());
  return warped;
}

void PictureWarper::Warp(const CompactView& view, model::LinearPicture* warped) const {
  CheckSameSize("the view", view.width_px, view.height_px, map_);
  const std::size_t width = Index(map_.width_px);
  warped->width_px = map_.width_px;
  warped->height_px = map_.height_px;
  warped->channels = channels_;
  warped->values.resize(map_.disparity.size() * Index(channels_));
  kernels::RowWarper::Places places(map_.width_px);
  std::vector<float> disparity(width), source_x(width), source_y(width);
  auto hidden = view.hidden.begin();
  for (int y = 0; y < map_.height_px; ++y) {
    ThrowIfCancelled();
    const std::size_t first = Index(y) * width;
    for (std::size_t x = 0; x < width; ++x) {
      disparity[x] = view.disparity[first + x];
      source_x[x] = static_cast<float>(view.shift.x() * disparity[x]);
      source_y[x] = static_cast<float>(view.shift.y() * disparity[x]);
    }
    for (; hidden != view.hidden.end() && Index(hidden->index) < first + width; ++hidden) {
      const std::size_t x = Index(hidden->index) - first;
      disparity[x] = hidden->disparity;
      source_x[x] = hidden->source_x;
      source_y[x] = hidden->source_y;
    }
    rows_.Warp(y, disparity.data(), source_x.data(), source_y.data(), &places,
               warped->values.data() + first * Index(channels_));
  }
  rows_.Mix(view.mixed, warped->values.data());
}

model::LinearPicture WarpPicture(const model::LinearPicture& picture, const DisparityMap& map,
                                 const ViewDisparity& view) {
  return PictureWarper(picture, map).Warp(view);
}

}  // namespace thicklens::estimator
