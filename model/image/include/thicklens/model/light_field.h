#ifndef THICKLENS_MODEL_LIGHT_FIELD_H_
#define THICKLENS_MODEL_LIGHT_FIELD_H_

#include <Eigen/Core>
#include <cstddef>
#include <optional>
#include <string>
#include <vector>

#include "thicklens/base/export.h"
#include "thicklens/model/camera.h"
#include "thicklens/model/light_field_grid.h"
#include "thicklens/model/scene.h"
#include "thicklens/model/transfer_curve.h"

namespace thicklens::model {

// Origin of a light field. Fields that do not apply are empty.
struct LightFieldOrigin {
  // "scene", "blocks", "functional", "grid", "simulated", "imported", "dibr"
  std::string method;
  // Names of the choices of the solver and of the device that computed.
  std::string block_solver, stencil, splat, device;
  std::optional<int> block_px;         // edge of a block, px
  std::optional<double> gamma, ridge;  // weights of smoothness (gamma) and of the ridge (mu)
  // Time of the estimate, the relative residual of its system, and the smallest reciprocal
  // condition number of its blocks.
  std::optional<double> seconds, relative_residual, rcond_min;
  // Names of the effects of image formation that were on, e.g. "defocus", "falloff".
  std::vector<std::string> effects;
  std::string version, date;  // version of thicklens; ISO 8601
  std::string prior;          // prior of the scene's radiance: "ridge", "gradient", "tv", "patches"
  // Strength of that prior; noise of the encoded values of the photograph.
  std::optional<double> strength, noise_sigma;
  std::optional<int> iterations;  // of an iterative solver
};

// A light field of U x V views of S x T samples in linear light. It owns all its data.
//
// The viewpoint of the view (k, l) is the aperture position a = k - (U-1)/2 steps to the right and
// b = l - (V-1)/2 steps down. A scene point at x in the centre view (a = b = 0) is at x - a d in
// the view, where d is its disparity in px per view step (near positive).
//
// A light field with a grid has the steps of a camera (mm), and a disparity follows from a depth. A
// light field without a grid is relative: its steps are those of the scene, one unit of disparity
// is one px per view step, and there is no camera and no irradiance fall-off.
struct LightField {
  // Numbers of samples per view across (S) and down (T), and of views across (U) and down (V).
  int s_count = 0, t_count = 0, u_count = 0, v_count = 0;
  int channels = 0;  // 1 (grey), 3 (RGB), or any number of bands
  // Radiance, 1 at full scale; values may be outside [0, 1]. There is one plane for each channel
  // and view. The index of the sample (i, j) is ((channel * V + l) * U + k) * T * S + j * S + i.
  std::vector<float> values;
  // V x U: the share of each view in the photograph of this light field; the sum is 1.
  Eigen::ArrayXXd weights;
  // V * U entries, index l * U + k: false if the view is unknown (its values are 0). Empty: all
  // views are known.
  std::vector<bool> present;
  // q, per axis: offset of a ray's landing point from its sample, px per view step. It is 0 if ST
  // is in the plane of focus, and for relative light fields.
  Eigen::Vector2d landing_step_px{0, 0};
  TransferCurve transfer = TransferCurve::Srgb();  // for storing views
  // The ICC profile of stored views, whose curve is `transfer`: the bytes of the photograph's.
  // Empty: none. Linear light has its primaries.
  std::string colour_profile;
  std::optional<LightFieldGrid> grid;  // planes and steps, mm; absent: the light field is relative
  std::optional<Camera> camera;        // present if and only if `grid` is present
  LightFieldOrigin origin;             // how the light field was made
  std::string source;  // the folder that it was read from; messages name it; not written to files

  // The number of samples of one channel of a view, S T.
  std::size_t view_size() const {
    return static_cast<std::size_t>(s_count) * static_cast<std::size_t>(t_count);
  }
  // Index in `values` of the sample (0, 0) of a channel of the view (k, l).
  std::size_t ViewStart(int channel, int k, int l) const {
    return ((static_cast<std::size_t>(channel) * static_cast<std::size_t>(v_count) +
             static_cast<std::size_t>(l)) *
                static_cast<std::size_t>(u_count) +
            static_cast<std::size_t>(k)) *
           view_size();
  }
  // Returns whether the view (k, l) is known.
  bool IsPresent(int k, int l) const {
    return present.empty() || present[static_cast<std::size_t>(l * u_count + k)];
  }
  // View steps to the right from the centre view: a = k - (U-1)/2.
  double u_offset(int k) const { return k - (u_count - 1) / 2.0; }
  // View steps down from the centre view: b = l - (V-1)/2.
  double v_offset(int l) const { return l - (v_count - 1) / 2.0; }

  // Returns true if the sizes, the weights, `present`, the grid and the camera agree. Otherwise
  // `why`, if not null, gets the field and the value.
  THICKLENS_EXPORT bool IsValid(std::string* why) const;
};

// A light field of the given sizes with all values 0, uniform weights and no grid. Throws Error
// unless all sizes are >= 1.
THICKLENS_EXPORT LightField MakeLightField(int s_count, int t_count, int u_count, int v_count,
                                           int channels);

// Copy of a light field without its values, which may be large. InnerViews and CropViews also
// accept such a description and then return one.
THICKLENS_EXPORT LightField DescriptionOf(const LightField& light_field);

// Copy of one view as an image of S x T px, channels interleaved. Throws Error if the view does not
// exist.
THICKLENS_EXPORT LinearImage ViewImage(const LightField& light_field, int k, int l);
// Replaces one view and marks it as present. Throws Error if the view does not exist or the size or
// the channels of the image differ.
THICKLENS_EXPORT void SetView(LightField* light_field, int k, int l, const LinearImage& image);

// The central u x v views, with weights scaled to the sum 1. Throws Error unless each count is from
// 1 to the present one and of the same parity (otherwise the middle would move), and unless the
// views have some weight.
THICKLENS_EXPORT LightField InnerViews(const LightField& light_field, int u_count, int v_count);

// A rectangle of pixels, px; (x, y) is its top-left pixel.
struct PixelRect {
  int x = 0, y = 0, width = 0, height = 0;  // position of the top-left pixel, and size, px
};
// The rectangle `rect` of every view, of an image or of a depth map. The principal point of the
// camera and the origin of the grid move with the rectangle. Each function throws Error if `rect`
// is empty or not inside.
THICKLENS_EXPORT LightField CropViews(const LightField& light_field, const PixelRect& rect);
// Returns the rectangle of an image. Throws Error if `rect` is empty or not inside.
THICKLENS_EXPORT LinearImage CropImage(const LinearImage& image, const PixelRect& rect);
THICKLENS_EXPORT EncodedImage CropImage(const EncodedImage& image, const PixelRect& rect);
// Returns the rectangle of a depth map. Throws Error if `rect` is empty or not inside.
THICKLENS_EXPORT RawDepthMap CropDepth(const RawDepthMap& map, const PixelRect& rect);
// Copy of the camera whose sensor is only the rectangle `rect` of the sensor. Throws Error if
// `rect` is empty or not inside the sensor.
THICKLENS_EXPORT Camera CropCamera(const Camera& camera, const PixelRect& rect);

}  // namespace thicklens::model

#endif  // THICKLENS_MODEL_LIGHT_FIELD_H_
