#include "tests/estimator/solver_inputs.h"

#include <random>
#include <vector>

#include "support/test_cameras.h"
#include "thicklens/estimator/disparity_map.h"

namespace thicklens::estimator::testing {

Eigen::ArrayXXd GaussianWeights(int u_count, int v_count) {
  return model::ApertureWeights(model::ApertureShape::kGaussian, u_count, v_count);
}

EstimateInput NoiseInput(int width_px, int height_px, int channels, const Eigen::ArrayXXd& weights,
                         const std::function<double(int x, int y)>& disparity, unsigned seed) {
  std::mt19937 engine(seed);
  std::uniform_real_distribution<float> uniform(0.1F, 0.9F);
  EstimateInput input;
  input.image = {width_px, height_px, channels, {}};
  for (int i = 0; i < width_px * height_px * channels; ++i) {
    input.image.values.push_back(uniform(engine));
  }
  input.disparity = {width_px, height_px, {}, {1, 1}};
  for (int y = 0; y < height_px; ++y) {
    for (int x = 0; x < width_px; ++x) {
      input.disparity.disparity.push_back(static_cast<float>(disparity(x, y)));
    }
  }
  input.weights = weights;
  return input;
}

EstimateInput WithSolverCamera(EstimateInput input, const model::LightFieldPlanes& planes,
                               const std::function<double(int x)>& depth_mm) {
  const int width_px = input.image.width_px, height_px = input.image.height_px;
  const model::Camera camera = thicklens::testing::SolverCamera(width_px, height_px);
  input.grid = model::GridOnPlanes(
      camera, planes,
      model::SampleAperture(input.weights, camera.blur_ratio(), camera.lens.aperture_radius_mm));
  input.camera = camera;
  std::vector<float> depths_mm;
  for (int y = 0; y < height_px; ++y) {
    for (int x = 0; x < width_px; ++x) depths_mm.push_back(static_cast<float>(depth_mm(x)));
  }
  input.disparity = DisparityOnGrid(*input.grid, depths_mm, width_px, height_px);
  return input;
}

}  // namespace thicklens::estimator::testing
