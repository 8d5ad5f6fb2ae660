#ifndef THICKLENS_RENDER_H_
#define THICKLENS_RENDER_H_

#include <Eigen/Core>
#include <optional>
#include <string>
#include <vector>

#include "thicklens/base/export.h"
#include "thicklens/camera.h"
#include "thicklens/effects.h"
#include "thicklens/image.h"
#include "thicklens/light_field.h"
#include "thicklens/run.h"
#include "thicklens/scene_form.h"

namespace thicklens {

// The aperture of a rendered image: one of the two, or the light field's own weights.
struct RenderAperture {
  std::optional<model::ApertureShape> shape;  // weights of this shape; excludes a radius
  // Finite and >= 0. With a camera: mm, at most the captured radius [D23]; without: view steps.
  std::optional<double> radius;

  // Returns whether at most one member is set and the radius is in its range. Otherwise `why`, if
  // not null, gets the reason.
  THICKLENS_EXPORT bool IsValid(std::string* why) const;
};

// The options of RenderPhotograph.
struct PhotographOptions {
  RenderAperture aperture;  // the weights of the views
  EffectSelection effects;  // of the photograph
  // As EstimateOptions::device.
  std::string device = "auto";

  // Returns whether all members are valid. Otherwise `why`, if not null, gets the field, the value
  // and the constraint.
  THICKLENS_EXPORT bool IsValid(std::string* why) const;
};

// How an image was rendered.
struct RenderSummary {
  // "own" (the light field states weights), "uniform", "gaussian", "disc" or "pinhole"; empty: a
  // radius was given.
  std::string aperture_shape;
  // "option", "light-field" or "assumed"; empty: a radius was given, or the effects determine it.
  std::string aperture_from;
  Eigen::Vector2d disparity_px{0, 0};  // of Refocus: the disparity in focus, px per view step
  // Of RenderPhotograph. The effects have no finding for defocus and aperture shape, because views
  // do not state their depths; they have none at all without a camera.
  model::EffectSelection effects;
  std::string device, device_description;  // that rendered it: "cpu", "opencl:0:0"
  std::vector<Notice> notices;             // remarks on the call, in their order
};

// Each function returns linear light with the light field's transfer curve, ready for WriteImage.
// They throw OptionError, and Error for a light field that is not valid. `summary` may be null.

// The photograph that the whole aperture would take of the light field: `thicklens render
// --as-captured` [S12], [D23].
THICKLENS_EXPORT Image RenderPhotograph(const LightField& light_field,
                                        const PhotographOptions& options = {},
                                        const RunControl& run = {},
                                        RenderSummary* summary = nullptr);

// The options of Refocus.
struct FocusOptions {
  // Exactly one: the depth to focus at, mm from Ap, finite, > 0, with a camera; or a disparity, px
  // per view step along u, finite.
  std::optional<double> depth_mm, disparity_px;
  RenderAperture aperture;  // the weights of the views

  // Returns whether exactly one focus is stated and all members are valid. Otherwise `why`, if not
  // null, gets the field, the value and the constraint.
  THICKLENS_EXPORT bool IsValid(std::string* why) const;
};
// Shifts the views so that points at that depth coincide, and averages them [D98]. Throws Error for
// a depth without a camera, and for a disparity, px per view step, above the size of the views.
THICKLENS_EXPORT Image Refocus(const LightField& light_field, const FocusOptions& options,
                               const RunControl& run = {}, RenderSummary* summary = nullptr);
// Refocuses a light field that is stored as its scene. Each view is rendered where it is needed, so
// that its samples are interpolated once, and beyond the borders of the views as well.
THICKLENS_EXPORT Image Refocus(const SceneForm& scene, const FocusOptions& options,
                               const RunControl& run = {}, RenderSummary* summary = nullptr);

// All views side by side, (0, 0) at the top left, with `gap_px` >= 0 black pixels between them. The
// image may have 100000 px each way.
THICKLENS_EXPORT Image RenderMosaic(const LightField& light_field, int gap_px = 2);

// Row t of all views in the view row l, one above the other, or column s of all views in the view
// column k, side by side; each repeated `repeat_px` >= 1 times, to 100000 px at most.
THICKLENS_EXPORT Image RenderEpipolarRow(const LightField& light_field, int t, int l,
                                         int repeat_px = 8);
// Column s of all views in the view column k, side by side, each repeated `repeat_px` >= 1 times,
// to 100000 px at most.
THICKLENS_EXPORT Image RenderEpipolarColumn(const LightField& light_field, int s, int k,
                                            int repeat_px = 8);

}  // namespace thicklens

#endif  // THICKLENS_RENDER_H_
