#ifndef THICKLENS_ESTIMATOR_BLOCKS_BLOCK_SYSTEM_H_
#define THICKLENS_ESTIMATOR_BLOCKS_BLOCK_SYSTEM_H_

#include <cstddef>
#include <utility>
#include <vector>

#include "thicklens/estimator/block_solver.h"
#include "thicklens/estimator/block_store.h"
#include "thicklens/kernels/kernels.h"
#include "thicklens/model/light_field.h"

namespace thicklens::estimator {

// Data that the blocks of one photograph share: where the rays of each view land, what they see,
// and the prior. Many threads read it.
class RayField {
 public:
  // `falloff` has no effect without a camera.
  RayField(const EstimateInput& input, bool falloff, int threads);

  const EstimateInput& input() const { return input_; }
  int u_count() const { return static_cast<int>(input_.weights.cols()); }
  int v_count() const { return static_cast<int>(input_.weights.rows()); }
  // The photograph warped to every view. It is radiance: the fall-off is divided out.
  const model::LightField& prior() const { return prior_; }
  model::LightField TakePrior() && { return std::move(prior_); }

  kernels::BlockGeometry Block(int x, int y, int width_px, int height_px) const;

  // Slope m of each ray of the block, samples per view step, in u and in v. With `cut_occluded` the
  // slope is NaN where the next view does not show the scene point of the ray: rays of two points
  // are not linked.
  struct Slopes {
    std::vector<double> u, v;
  };
  Slopes SlopesOf(const kernels::BlockGeometry& block, bool cut_occluded) const;

  // Relative irradiance of each ray of the block; empty without fall-off.
  std::vector<double> IrradianceOf(const kernels::BlockGeometry& block) const;

  // All of the data above and the input, to distinguish runs; valid as long as this object.
  std::vector<BlockRun::Data> Data() const;

 private:
  const EstimateInput& input_;
  // Disparity of each view's samples. It is declared before prior_, which is made together with it.
  std::vector<std::vector<float>> disparity_;
  std::vector<std::vector<float>> irradiance_;  // for each view's samples; empty without fall-off
  model::LightField prior_;
};

// The linear system of one block, [M21] with a ridge.
struct BlockSystem {
  kernels::BlockGeometry block;
  kernels::CsrMatrix<double> matrix;             // H^T H - gamma G + mu Id
  std::vector<std::vector<double>> right_sides;  // H^T I + mu L0, one for each channel
  std::vector<std::vector<double>> starts;       // L0, one for each channel
};
// Makes the system of a block. Unknowns that are no rays of the light field get the equation x = 0.
BlockSystem MakeBlockSystem(const RayField& rays, const kernels::BlockGeometry& block,
                            const BlockOptions& options, double ridge,
                            kernels::Kernels<double>* kernels);

}  // namespace thicklens::estimator

#endif  // THICKLENS_ESTIMATOR_BLOCKS_BLOCK_SYSTEM_H_
