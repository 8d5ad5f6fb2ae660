#ifndef THICKLENS_ESTIMATOR_SCENE_SCENE_VIEWS_H_
#define THICKLENS_ESTIMATOR_SCENE_SCENE_VIEWS_H_

#include "estimator/scene/scene_band_run.h"
#include "thicklens/base/iteration_progress.h"
#include "thicklens/estimator/scene_solver.h"
#include "thicklens/kernels/device.h"

namespace thicklens::estimator {

// Makes all views of one radiance and passes each to the sink. Their disparity is rendered on the
// processor; the radiance is read on the backend (null: on the processor).
void ShowInAllViews(const EstimateInput& input, const SolvedScene& solved, int threads,
                    kernels::Backend* backend, IterationProgress* progress,
                    const SceneViewSink& sink);

}  // namespace thicklens::estimator

#endif  // THICKLENS_ESTIMATOR_SCENE_SCENE_VIEWS_H_
