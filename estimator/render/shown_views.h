#ifndef THICKLENS_ESTIMATOR_RENDER_SHOWN_VIEWS_H_
#define THICKLENS_ESTIMATOR_RENDER_SHOWN_VIEWS_H_

#include <Eigen/Core>

#include "thicklens/model/light_field.h"

namespace thicklens::estimator {

void CheckLightField(const model::LightField& light_field);  // throws Error

// Returns the weights with 0 for absent views. Throws Error if they do not fit or none is above 0.
Eigen::ArrayXXd PresentWeights(const model::LightField& light_field,
                               const Eigen::ArrayXXd& weights);

model::LinearImage BlackImage(int width_px, int height_px, int channels);

}  // namespace thicklens::estimator

#endif  // THICKLENS_ESTIMATOR_RENDER_SHOWN_VIEWS_H_
