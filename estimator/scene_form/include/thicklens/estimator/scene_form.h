#ifndef THICKLENS_ESTIMATOR_SCENE_FORM_H_
#define THICKLENS_ESTIMATOR_SCENE_FORM_H_

#include <Eigen/Core>
#include <memory>
#include <string>
#include <vector>

#include "thicklens/base/export.h"
#include "thicklens/estimator/disparity_map.h"
#include "thicklens/estimator/ray_confidence.h"
#include "thicklens/model/light_field.h"
#include "thicklens/model/scene.h"

namespace thicklens::estimator {

// A light field as the scene that it shows: three planes instead of U x V views. It holds what
// EstimateScene found, and every view that it would make on the processor follows bit for bit.
// Points that the centre view does not show are no part of it: a view that would show them repeats
// the background beside them, as EstimateScene does.
struct SceneForm {
  // Sizes, weights, transfer curve, grid, camera and origin of the light field; without values, and
  // with all views present.
  model::LightField frame;
  model::LinearImage radiance;  // of the points of the centre view, S x T px, 1 at full scale
  DisparityMap disparity;       // of the same points, without holes
  std::vector<Confidence> confidence;  // of the same points, row by row; empty: unknown

  // Returns whether the sizes agree and all numbers are finite. Otherwise `why`, if not null, gets
  // the member, the value and the constraint.
  THICKLENS_EXPORT bool IsValid(std::string* why) const;
};

// Renders views and refocused images of one scene. Several threads may use an object at once.
class THICKLENS_EXPORT SceneRenderer {
 public:
  // The scene is kept by reference and must outlive the renderer. Throws Error if it is not valid.
  explicit SceneRenderer(const SceneForm& scene);
  explicit SceneRenderer(const SceneForm&& scene) = delete;
  ~SceneRenderer();
  SceneRenderer(SceneRenderer&&) noexcept;
  SceneRenderer& operator=(SceneRenderer&&) = delete;

  // The view a steps to the right and b steps down from the centre view; a and b are any numbers.
  // At u_offset(k), v_offset(l) it is the view (k, l). Throws Error if they are not finite.
  model::LinearImage View(double a, double b) const;
  // The confidence of each of its samples; empty if that of the scene is unknown.
  std::vector<Confidence> ViewConfidence(double a, double b) const;

 private:
  struct Parts;
  std::unique_ptr<const Parts> parts_;
};

// Returns the image with points of that disparity, in the unit of the scene's, in focus, seen
// through the views of these weights (V x U, >= 0, their sum > 0). Each view is rendered from the
// scene at its place in the image, so that its samples are interpolated once; Refocus of stored
// views [D98] interpolates them twice, and has no light beyond the borders of the views. The result
// does not depend on the number of threads. Throws Error for a scene that is not valid, for another
// disparity than a finite one, and for other weights.
THICKLENS_EXPORT model::LinearImage RefocusScene(const SceneForm& scene, double disparity,
                                                 const Eigen::ArrayXXd& weights, int threads);

// Returns all views. Throws Error if the scene is not valid.
THICKLENS_EXPORT model::LightField ViewsOf(const SceneForm& scene, int threads);

// Returns the confidence of all rays, view by view (index l * U + k), row by row; empty if that of
// the scene is unknown. Throws Error if the scene is not valid.
THICKLENS_EXPORT std::vector<Confidence> RayConfidenceOf(const SceneForm& scene, int threads);

// Returns the shares of the rays of all views. Along an axis with more than four views they are
// those of views at the four nodes of the Gauss-Legendre rule on both halves of the aperture. All
// shares are 0 if the confidence of the scene is unknown. Throws Error if the scene is not valid.
THICKLENS_EXPORT ConfidenceShares RaySharesOf(const SceneForm& scene, int threads);

}  // namespace thicklens::estimator

#endif  // THICKLENS_ESTIMATOR_SCENE_FORM_H_
