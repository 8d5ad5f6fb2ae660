// The view of a problem that a program's own solver gets.
#include <fmt/format.h>

#include <utility>

#include "thicklens/base/error.h"
#include "thicklens/estimator/estimate_input.h"
#include "thicklens/estimator/render.h"
#include "thicklens/solver.h"
#include "tools/interface/run_scope.h"

namespace thicklens {

Problem::Problem(std::shared_ptr<const estimator::EstimateInput> input) : input_(std::move(input)) {
  if (input_ == nullptr) throw Error("problem: an input is expected, found null");
}

int Problem::width_px() const { return input_->image.width_px; }
int Problem::height_px() const { return input_->image.height_px; }
int Problem::channels() const { return input_->image.channels; }
int Problem::u_count() const { return static_cast<int>(input_->weights.cols()); }
int Problem::v_count() const { return static_cast<int>(input_->weights.rows()); }
const model::LinearImage& Problem::photograph() const { return input_->image; }
const std::vector<float>& Problem::disparity() const { return input_->disparity.disparity; }
Eigen::Vector2d Problem::disparity_step() const { return input_->disparity.step; }
const Eigen::ArrayXXd& Problem::weights() const { return input_->weights; }
const std::optional<Camera>& Problem::camera() const { return input_->camera; }
const std::optional<model::LightFieldGrid>& Problem::grid() const { return input_->grid; }

LightField Problem::WarpToViews(const RunControl& run) const {
  const RunScope scope(run);
  return estimator::WarpedLightField(*input_, falloff_, run.threads);
}

LightField Problem::WarpToViews(const model::LinearImage& image, const RunControl& run) const {
  if (image.width_px != width_px() || image.height_px != height_px() ||
      image.channels != channels()) {
    throw Error(fmt::format("image: {}x{} px in {} channel(s) are expected, found {}x{} in {}",
                            width_px(), height_px(), channels(), image.width_px, image.height_px,
                            image.channels));
  }
  const RunScope scope(run);
  estimator::EstimateInput input = *input_;
  input.image = image;
  return estimator::WarpedLightField(input, falloff_, run.threads);
}

model::LinearImage Problem::Photograph(const LightField& light_field, const RunControl& run) const {
  const RunScope scope(run);
  const Camera* const falloff = falloff_ && input_->camera ? &input_->camera_of_falloff() : nullptr;
  return estimator::Photograph(light_field, input_->weights, falloff, nullptr, nullptr,
                               run.threads);
}

Solver::~Solver() = default;

}  // namespace thicklens
