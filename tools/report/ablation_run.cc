#include "tools/report/ablation_run.h"

#include <cstddef>
#include <optional>

#include "thicklens/base/cancel.h"
#include "thicklens/base/error.h"
#include "thicklens/base/memory_available.h"
#include "thicklens/base/printable_text.h"
#include "thicklens/calib/calibrate.h"
#include "thicklens/estimator/compare.h"
#include "thicklens/estimator/estimate_input.h"
#include "thicklens/estimator/solve.h"
#include "thicklens/io/scene_pixels.h"
#include "thicklens/io/simulated_sweep.h"
#include "thicklens/model/light_field_grid.h"

namespace thicklens::tools {
namespace {

using model::Effect;

// The mean PSNR over the views of an estimate by the scene solver.
double PsnrDbOfEstimate(const model::SceneToEstimate& scene, int threads) {
  estimator::EstimateInput input;
  const int u_count = scene.truth.u_count, v_count = scene.truth.v_count;
  input.camera = scene.camera;
  input.transfer = scene.camera.sensor.transfer;
  input.image = model::ToLinear(scene.photograph, input.transfer);
  input.grid = model::DefaultGrid(scene.camera, u_count, v_count);
  input.weights =
      model::ApertureWeights(model::ApertureShapeOf(scene.camera.psf), u_count, v_count);
  input.disparity = estimator::DisparityOnGrid(*input.grid, scene.depth.values,
                                               scene.depth.width_px, scene.depth.height_px);
  if (!scene.on.Has(Effect::kThickness))
    input.falloff_camera = model::ThinLensEquivalent(scene.camera);
  const bool falloff = scene.on.Has(Effect::kFalloff);
  model::LightField estimate;
  if (scene.on.Has(Effect::kDefocus)) {
    estimator::SceneOptions options;
    options.falloff = falloff;
    estimator::SolverRun run;
    run.threads = threads;
    run.memory_limit_mib = UsualMemoryLimitMib();
    run.progress = [&scene](int, int) { scene.tell(); };
    estimate = estimator::Solve(input, options, run, nullptr);
  } else {
    estimate = estimator::WarpedLightField(input, falloff, threads);
  }
  return estimator::CompareLightFields(scene.truth, estimate, 0, std::nullopt, threads)
      .mean.psnr_db;
}

model::SweepCalibration CalibrationOf(const model::SweepToCalibrate& simulated, bool unknown_offset,
                                      int threads) {
  model::Camera camera = simulated.simulator.camera();
  camera.calibration.reset();
  calib::FocusSweep sweep = calib::MakeFocusSweep(
      io::DescribeSweep(simulated.options, simulated.simulator, unknown_offset), camera);
  sweep.read_frame = [&simulated](std::size_t i) {
    return io::AsFile(simulated.stored_frame(static_cast<int>(i)));
  };
  calib::CalibrationOptions options;
  options.map_field = false;
  options.threads = threads;
  options.progress = [&simulated](int, int) { simulated.tell(); };
  const calib::Calibration calibration = calib::Calibrate(sweep, options);
  if (!calibration.summary.image_distance_mm || !calibration.summary.blur_ratio) {
    return {std::nullopt, calibration.summary.reason};
  }
  return {model::CalibratedValues{calibration.summary.image_distance_mm->value,
                                  calibration.summary.image_distance_mm->sigma,
                                  calibration.summary.blur_ratio->value,
                                  calibration.summary.blur_ratio->sigma},
          ""};
}

}  // namespace

model::AblationRun AblationRunWith(const CommonOptions& common, ProgressLine* progress) {
  return {common.threads, [progress](int done, int total) {
            ThrowIfCancelled();
            progress->Show(done, total);
          }};
}

model::SceneAblation AblateSceneOf(const model::SceneSimulationOptions& scene,
                                   const model::AblationRun& run) {
  const auto estimate = [&run](const model::SceneToEstimate& simulated) {
    return PsnrDbOfEstimate(simulated, run.threads);
  };
  return model::AblateScene(scene, io::ReadScenePixels(scene), estimate, run);
}

model::SweepAblation AblateSweepOf(const std::string& path,
                                   const model::SweepSimulationOptions& sweep, bool unknown_offset,
                                   const model::AblationRun& run) {
  const model::LinearImage target_image = io::ReadTargetImage(sweep.target);
  const auto calibrate = [&](const model::SweepToCalibrate& simulated) {
    return CalibrationOf(simulated, unknown_offset, run.threads);
  };
  try {
    return model::AblateSweep(sweep, target_image, calibrate, run);
  } catch (const Interrupted&) {
    throw;
  } catch (const Error& error) {
    throw Error(PrintableUtf8(path) + ": " + error.what());
  }
}

}  // namespace thicklens::tools
