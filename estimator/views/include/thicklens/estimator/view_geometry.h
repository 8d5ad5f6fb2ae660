#ifndef THICKLENS_ESTIMATOR_VIEW_GEOMETRY_H_
#define THICKLENS_ESTIMATOR_VIEW_GEOMETRY_H_

#include <Eigen/Core>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <vector>

#include "thicklens/kernels/view_warp.h"
#include "thicklens/model/light_field_grid.h"
#include "thicklens/model/scene.h"

namespace thicklens::estimator {

// The depth of a picture in the only form that the rays of its light field need: the displacement
// of each scene point between views.
struct DisparityMap {
  int width_px = 0;
  int height_px = 0;
  // One number a pixel, near positive: what stands at sample x of the centre view stands at
  // x - disparity * (a step.x, b step.y) in the view (a, b). NaN marks a hole.
  std::vector<float> disparity;
  // Per view in u and v. (1, 1) where the disparity is in px per view step; steps of the grid in mm
  // where it is in px per mm.
  Eigen::Vector2d step{1, 1};
};

// From depths to the samples of a grid [D16]: disparity * step = -m, m of model::SlopeOnGrid.
// Throws Error unless every depth is beyond the UV plane (where nearer is larger).
DisparityMap DisparityOnGrid(const model::LightFieldGrid& grid, const std::vector<float>& depth_mm,
                             int width_px, int height_px);
// A map that says px per view step: scale * value + offset; NaN and infinities are holes, and so is
// 0 in an integer map. Throws Error if all are holes.
DisparityMap DisparityFromMap(const model::RawDepthMap& map, double scale, double offset_px);

// The disparity on that grid of what is infinitely far, in the unit of DisparityOnGrid.
double DisparityAtInfinity(const model::LightFieldGrid& grid);

enum class Seen : std::uint8_t {
  kSeen,    // a point of the centre view
  kHidden,  // not seen from the centre; disparity and source are those of the background beside it
};

// What a view sees: one disparity for each of its samples.
struct ViewDisparity {
  int width_px = 0;
  int height_px = 0;
  std::vector<float> disparity;  // in the unit of the DisparityMap
  std::vector<Seen> seen;
  // Where in the centre view the sample's source is, px: sample + (source_x, source_y). For kSeen
  // the displacement is disparity * (a step.x, b step.y); for kHidden it leads to the background:
  // the source of the sample that shows it, or a pixel of the centre view.
  // May lead outside of the picture by rounding; readers cut it.
  std::vector<float> source_x, source_y;
  // Samples whose pixels two surfaces share, by index: above is what has the sample's middle.
  std::vector<kernels::MixedSample> mixed;
};

// ViewDisparity in less memory (a third, where few samples are hidden or mixed): the way to the
// source of what is seen follows from its disparity.
struct CompactView {
  using Hidden = kernels::HiddenSample;
  using Mixed = kernels::MixedSample;
  int width_px = 0;
  int height_px = 0;
  Eigen::Vector2d shift{0, 0};   // px per unit of disparity
  std::vector<float> disparity;  // NaN: hidden
  std::vector<Hidden> hidden;    // by index
  std::vector<Mixed> mixed;      // by index

  // Of a sample that is hidden.
  const Hidden& HiddenAt(std::size_t index) const;
};

// Sets `view`, in the memory that it has where that is enough.
void Expand(const CompactView& compact, ViewDisparity* view);

// The disparity rendered into the view at (a, b) steps: every 2 x 2 cell of centre pixels whose
// disparities differ by at most .2 px per view step is two triangles at (x - a d, y - b d), and
// every pixel of the other cells a square of +-.5 px; the nearest wins. Px per view step are those
// of the larger of the two steps. Samples that nothing covers are hidden, those beyond the border
// of the centre picture as well. The ray of such a sample x goes over the centre view's pixel at
// x + D (a step.x, b step.y) at the disparity D, from near to far, looked at in whole px of the
// larger part: the last pixel before which it passes belongs to the edge behind which it is hidden
// from the centre, and that pixel's surface (to .3 px per view step) stands behind. Pixels of whose
// surface there are no two beside them do not count. The samples walk both ways along the
// displacement to the first covered sample and take the closer one that shows this surface; where
// neither does, the pixel itself. A ray that passes before none takes the farther of the two, or
// the only one; where there is none, the closest in any direction; where nothing of the picture is
// in the view, the centre view's own sample. (0, 0) gives the map itself. Throws Error if the map
// has holes.
// So far a sample shows what its middle does. At the edge of a surface its pixel shows two: with
// (x, y) its source on a surface of disparity D, that one covers of it the share
//   sum over the four pixels q around (x, y) that are of the surface (|D_q - D| <= .3 px per view
//   step) of (1 - |x - q_x|) (1 - |y - q_y|),
// the area on which squares of the size of a pixel overlap; the border of the map is repeated.
// Where a pixel at a jump lands less than 1 px beside a sample both ways, the sample is `mixed`:
// with that pixel's surface, by its share, if it is nearer than what the sample shows; with what is
// behind, by what is left, if it is of the surface that the sample shows (to .3 px per view step).
// Behind is what the first of the eight samples around (sides before corners) shows that is
// farther: one that is seen and whose surface the centre view has here as well; else one that is
// seen, at its own source; else one that is hidden, by its way to a source where that leads to its
// surface from here as well, else at its own source. A hidden sample that nothing nearer shares has
// the share of its own surface that is seen after all. Of several the largest share counts, of the
// same the nearer; less than .01 does not. Derived here [D91].
ViewDisparity RenderDisparity(const DisparityMap& map, double a, double b);

struct SupportedPixels;  // hole_filler.h

// RenderDisparity for many views of one map: what all of them need is found once. Read by many
// threads.
class DisparityRenderer {
 public:
  // The map must outlive it. Throws Error if it has holes.
  explicit DisparityRenderer(const DisparityMap& map);
  explicit DisparityRenderer(const DisparityMap&& map) = delete;

  ViewDisparity Render(double a, double b) const;
  CompactView RenderCompact(double a, double b) const;

 private:
  const DisparityMap& map_;
  std::vector<char> is_surface_;  // of the cell below and to the right of each pixel: no jump
  std::vector<int> alone_;        // indices of the pixels at a jump, which are squares
  std::shared_ptr<const SupportedPixels> supported_;
};

// The picture warped to that view by its depth (with the blurred photograph: depth-image-based
// rendering, DIBR). Bicubic (Catmull-Rom) where all 16 taps agree with the sample's disparity to
// .3 px per view step, else bilinear from the taps that do, renormalised; hidden samples take their
// background source's value; of mixed samples the share of the other surface is bilinear.
model::LinearPicture WarpPicture(const model::LinearPicture& picture, const DisparityMap& map,
                                 const ViewDisparity& view);

// WarpPicture for many views of one picture: what all of them need is found once. Read by many
// threads.
class PictureWarper {
 public:
  // The map must outlive it.
  PictureWarper(const model::LinearPicture& picture, const DisparityMap& map);
  PictureWarper(const model::LinearPicture& picture, const DisparityMap&& map) = delete;

  model::LinearPicture Warp(const ViewDisparity& view) const;
  // To a picture whose memory is taken again where it has enough.
  void Warp(const CompactView& view, model::LinearPicture* warped) const;

 private:
  struct Range {
    float lowest, highest;
  };
  struct TapRow;

  void MixIn(const std::vector<kernels::MixedSample>& mixed, model::LinearPicture* warped) const;
  void CopyPixels(const model::LinearPicture& picture);
  void FindRanges();
  void WarpRow(const TapRow& row, float* warped) const;
  template <int kChannels>
  void WarpRow(const TapRow& row, float* warped) const;
  template <int kChannels>
  void WarpRowAvx2(const TapRow& row, float* warped) const;
  template <int kChannels>
  void WarpRowOf(const TapRow& row, float* warped) const;
  void Bilinear(int x0, int y0, float fraction_x, float fraction_y, float disparity,
                float* value) const;
  bool Agrees(float tap_disparity, float disparity) const {
    return std::abs(tap_disparity - disparity) <= tolerance_;
  }
  const float* Tap(int x, int y) const;

  const DisparityMap& map_;
  const int channels_;
  const float tolerance_;      // in the unit of the map; infinite where the steps are 0
  std::vector<float> pixels_;  // fours of channels, a plane each, with their borders repeated
  std::vector<Range> ranges_;  // of the disparities of the 16 taps of each pixel
};

}  // namespace thicklens::estimator

#endif  // THICKLENS_ESTIMATOR_VIEW_GEOMETRY_H_
