#ifndef THICKLENS_MODEL_LIGHT_FIELD_H_
#define THICKLENS_MODEL_LIGHT_FIELD_H_

#include <Eigen/Core>
#include <cstddef>
#include <optional>
#include <string>
#include <vector>

#include "thicklens/model/camera.h"
#include "thicklens/model/light_field_grid.h"
#include "thicklens/model/scene.h"
#include "thicklens/model/transfer_curve.h"

namespace thicklens::model {

// Where a light field came from. Fields that do not apply are empty.
struct LightFieldOrigin {
  // "scene", "blocks", "functional", "grid", "simulated", "imported", "dibr"
  std::string method;
  std::string block_solver, stencil, splat, device;
  std::optional<int> block_px;
  std::optional<double> gamma, ridge;
  std::optional<double> seconds, relative_residual, rcond_min;
  std::vector<std::string> effects;  // of image formation that were on: "defocus", "falloff"
  std::string version, date;
  std::string prior;  // of the scene's radiance: "ridge", "gradient", "tv", "patches"
  std::optional<double> strength, noise_sigma;  // of that prior; of the photograph's stored values
  std::optional<int> iterations;
};

// U x V views of S x T samples in linear light.
//
// A view (k, l) is seen from the aperture position a = k - (U-1)/2 steps to the right and
// b = l - (V-1)/2 steps down. What the centre view (a = b = 0) shows at x stands at x - a d in it,
// d the disparity of the scene point in px per view step (near positive).
//
// With a grid, the steps are those of a camera (mm), and a disparity follows from a depth. Without
// one, the light field is relative: its steps are the scene's own, one unit of disparity is one px
// per view step, and there is no camera and no irradiance fall-off.
struct LightField {
  int s_count = 0, t_count = 0, u_count = 0, v_count = 0;
  int channels = 0;  // 1 (grey), 3 (RGB), or any number of bands
  // Radiance, 1 at full scale; may leave [0, 1]. One plane a channel and view:
  // ((channel * V + l) * U + k) * T * S + j * S + i.
  std::vector<float> values;
  // V x U: the share of each view in the photograph that the light field belongs to, sum 1.
  Eigen::ArrayXXd weights;
  // V * U, l * U + k: false where a view is not known (its values are 0). Empty: all are.
  std::vector<bool> present;
  // q, per axis: px that a ray lands beside its sample, per view step. 0 with ST in the plane of
  // focus, and for relative light fields.
  Eigen::Vector2d landing_step_px{0, 0};
  TransferCurve transfer = TransferCurve::Srgb();  // for storing views
  std::optional<LightFieldGrid> grid;
  std::optional<Camera> camera;  // present if and only if `grid` is
  LightFieldOrigin origin;

  std::size_t view_size() const {
    return static_cast<std::size_t>(s_count) * static_cast<std::size_t>(t_count);
  }
  std::size_t ViewStart(int channel, int k, int l) const {
    return ((static_cast<std::size_t>(channel) * static_cast<std::size_t>(v_count) +
             static_cast<std::size_t>(l)) *
                static_cast<std::size_t>(u_count) +
            static_cast<std::size_t>(k)) *
           view_size();
  }
  bool IsPresent(int k, int l) const {
    return present.empty() || present[static_cast<std::size_t>(l * u_count + k)];
  }
  double u_offset(int k) const { return k - (u_count - 1) / 2.0; }
  double v_offset(int l) const { return l - (v_count - 1) / 2.0; }

  // True if sizes, weights and presence fit; else `why` names field and value.
  bool IsValid(std::string* why) const;
};

// An empty light field (values 0, uniform weights) of the given sizes.
LightField MakeLightField(int s_count, int t_count, int u_count, int v_count, int channels);

// A light field without its values, which may be large. InnerViews and CropViews take one, too, and
// then give one.
LightField DescriptionOf(const LightField& light_field);

// One view as a picture, channels interleaved, and back. Throws Error for a view outside.
LinearPicture ViewPicture(const LightField& light_field, int k, int l);
// A view that is set is present.
void SetView(LightField* light_field, int k, int l, const LinearPicture& picture);

// The u x v views in the middle; their weights are scaled to sum 1. Throws Error unless the counts
// are at most, and of the parity of, those that there are (else the middle would move).
LightField InnerViews(const LightField& light_field, int u_count, int v_count);

// A rectangle of every view. The camera's principal point moves with it. Throws Error if it leaves
// the views.
struct PixelRect {
  int x = 0, y = 0, width = 0, height = 0;
};
LightField CropViews(const LightField& light_field, const PixelRect& rect);
LinearPicture CropPicture(const LinearPicture& picture, const PixelRect& rect);
StoredPicture CropPicture(const StoredPicture& picture, const PixelRect& rect);
RawDepthMap CropDepth(const RawDepthMap& map, const PixelRect& rect);
// The same camera with only that rectangle of its sensor.
Camera CropCamera(const Camera& camera, const PixelRect& rect);

}  // namespace thicklens::model

#endif  // THICKLENS_MODEL_LIGHT_FIELD_H_
