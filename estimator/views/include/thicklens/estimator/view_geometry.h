#ifndef THICKLENS_ESTIMATOR_VIEW_GEOMETRY_H_
#define THICKLENS_ESTIMATOR_VIEW_GEOMETRY_H_

#include <Eigen/Core>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <vector>

#include "thicklens/base/export.h"
#include "thicklens/estimator/disparity_map.h"
#include "thicklens/kernels/row_warper.h"
#include "thicklens/kernels/view_warp.h"
#include "thicklens/model/scene.h"

namespace thicklens::estimator {

// Whether a sample of a view shows a point of the centre view.
enum class Visibility : std::uint8_t {
  kVisible,   // the sample shows a point of the centre view
  kOccluded,  // no point of the centre view is visible here; disparity and source are of the
              // background beside it
};

// The content of a view: one disparity for each of its samples.
struct ViewDisparity {
  int width_px = 0;                    // width, px
  int height_px = 0;                   // height, px
  std::vector<float> disparity;        // in the unit of the DisparityMap
  std::vector<Visibility> visibility;  // one per sample
  // Displacement from the sample to its source in the centre view, px: its source is at sample +
  // (source_x, source_y). For kVisible the displacement is disparity * (a step.x, b step.y). For
  // kOccluded it leads to the background: either the source of the sample that shows the
  // background, or a pixel of the centre view. Rounding may place this position outside of the
  // image; readers clamp it.
  std::vector<float> source_x, source_y;
  // Samples whose pixels two surfaces share, by index. The members above describe the surface at
  // the sample's middle.
  std::vector<kernels::BoundarySample> boundary;
};

// A ViewDisparity in less memory (a third, where few samples are hidden or mixed). The displacement
// to the source of a visible sample follows from its disparity.
struct CompactView {
  using Occluded = kernels::OccludedSample;  // a sample that shows the background
  using Boundary = kernels::BoundarySample;  // a sample that two surfaces share
  int width_px = 0;                          // width, px
  int height_px = 0;                         // height, px
  Eigen::Vector2d shift{0, 0};               // px per unit of disparity
  std::vector<float> disparity;              // NaN: hidden
  std::vector<Occluded> occluded;            // sorted by index
  std::vector<Boundary> boundary;            // sorted by index

  // Returns the entry of a sample that must be hidden.
  THICKLENS_EXPORT const Occluded& OccludedAt(std::size_t index) const;
};

// Sets `view`; its memory is reused where it is large enough.
THICKLENS_EXPORT void Expand(const CompactView& compact, ViewDisparity* view);

// Renders the disparity into the view at (a, b) steps. (0, 0) gives the map itself. Throws Error if
// the map has holes or a wrong count of values, or if (a, b) is not finite.
//
// Surfaces. Every 2 x 2 cell of centre pixels whose disparities d differ by at most 0.2 px per view
// step is drawn as two triangles with vertices at (x - a d, y - b d). Every pixel of the other
// cells is drawn as a square of +-0.5 px. The nearest surface is kept. Px per view step refers to
// the larger of the two steps.
//
// Hidden samples. Samples that nothing covers are hidden; this includes samples beyond the border
// of the centre image. At the disparity D, the ray of such a sample x passes over the centre view's
// pixel at x + D (a step.x, b step.y). The pixels are inspected in whole px of the larger
// component. From near to far, the last pixel in front of which the ray passes belongs to the edge
// behind which the ray is occluded from the centre. The background of the sample is that pixel's
// surface (to 0.3 px per view step). Pixels without two neighbours of their own surface are
// ignored. The samples in both directions along the displacement are searched for the first covered
// one. The closer one that shows this surface becomes its source; if neither shows it, the pixel
// itself does. If the ray passes in front of no pixel, the farther of the two samples (or the only
// one) becomes its source; if there is none, the closest covered sample in any direction; if
// nothing of the image is in the view, the centre view's own sample.
//
// Boundary samples. So far a sample shows the surface at its middle, but at the edge of a surface
// its pixel shows two surfaces. With (x, y) the source of the sample on a surface of disparity D,
// that surface covers this share of the pixel:
//
//   sum over the four pixels q around (x, y) that are of the surface (|D_q - D| <= 0.3 px per view
//   step) of (1 - |x - q_x|) (1 - |y - q_y|).
//
// This is the overlap of two squares of the size of a pixel; the border of the map is repeated. A
// sample is `mixed` where a pixel at a jump lands less than 1 px beside it on both axes. If that
// pixel is nearer than the sample's surface, the sample is mixed with the pixel's surface, by that
// surface's share. If that pixel is of the sample's surface (to 0.3 px per view step), the sample
// is mixed with the background, by the remaining share. The background is what the first suitable
// one of the eight samples around (sides before corners) shows that is farther. In this order: a
// visible sample whose surface the centre view also has here; a visible sample, at its own source;
// an occluded sample, by its displacement to a source if that also leads to its surface from here,
// and at its own source if it does not. An occluded sample that shares its pixel with no nearer
// surface is mixed with the visible share of its own surface. Of several shares the largest counts,
// and of equal shares the nearer; shares less than 0.01 are ignored. Derived here [D91].
THICKLENS_EXPORT ViewDisparity RenderDisparity(const DisparityMap& map, double a, double b);

struct SupportedPixels;  // defined in hole_filler.h

// RenderDisparity for many views of one map: data that all views need is computed once. Several
// threads may render at the same time.
class THICKLENS_EXPORT DisparityRenderer {
 public:
  // Throws Error if the map has holes or a wrong count of values. The map is kept by reference and
  // must outlive the renderer.
  explicit DisparityRenderer(const DisparityMap& map);
  explicit DisparityRenderer(const DisparityMap&& map) = delete;

  // Renders the view at (a, b) steps, as RenderDisparity does. Throws Error if (a, b) is not
  // finite.
  ViewDisparity Render(double a, double b) const;
  // Renders the same view in less memory.
  CompactView RenderCompact(double a, double b) const;

 private:
  const DisparityMap& map_;
  std::vector<char> is_surface_;  // 1: the cell below and to the right of the pixel has no jump
  std::vector<int> alone_;        // indices of the pixels at a jump, which are drawn as squares
  std::shared_ptr<const SupportedPixels> supported_;
};

// Returns the image warped to that view by its depth (with the blurred photograph:
// depth-image-based rendering, DIBR). A sample is bicubic (Catmull-Rom) where all 16 taps agree
// with its disparity to 0.3 px per view step. Otherwise it is bilinear from the taps that agree,
// renormalised. Hidden samples take the value of their background source. The share of the other
// surface in boundary samples is bilinear. Throws Error if the sizes of image, map and view differ.
THICKLENS_EXPORT model::LinearImage WarpImage(const model::LinearImage& image,
                                              const DisparityMap& map, const ViewDisparity& view);

// WarpImage for many views of one image: data that all views need is computed once. Several
// threads may warp at the same time.
class THICKLENS_EXPORT ImageWarper {
 public:
  // The map is kept by reference and must outlive the warper; the image is copied. Throws Error if
  // the sizes of image and map differ.
  ImageWarper(const model::LinearImage& image, const DisparityMap& map);
  ImageWarper(const model::LinearImage& image, const DisparityMap&& map) = delete;

  // Warps the image to a view, as WarpImage does.
  model::LinearImage Warp(const ViewDisparity& view) const;
  // Warps into `warped`, whose memory is reused where it is large enough.
  void Warp(const CompactView& view, model::LinearImage* warped) const;

 private:
  const DisparityMap& map_;
  const int channels_;
  kernels::RowWarper rows_;
};

}  // namespace thicklens::estimator

#endif  // THICKLENS_ESTIMATOR_VIEW_GEOMETRY_H_
