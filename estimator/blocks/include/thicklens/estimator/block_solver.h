#ifndef THICKLENS_ESTIMATOR_BLOCK_SOLVER_H_
#define THICKLENS_ESTIMATOR_BLOCK_SOLVER_H_

#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "thicklens/estimator/estimate_input.h"
#include "thicklens/kernels/device.h"
#include "thicklens/kernels/kernels.h"
#include "thicklens/model/light_field.h"

namespace thicklens::estimator {

class BlockStore;

// What solves the linear system of one block.
enum class BlockSolver {
  kUmfpack,  // unsymmetric multifrontal LU (the source's choice); GPL
  kCholmod,  // supernodal Cholesky; GPL
  kEigen,    // simplicial Cholesky, or LU for the six-term stencil; always there
  // Iterative, for comparison: none has a factor, so that the residual alone judges the answer.
  kCg,        // conjugate gradients of Eigen, preconditioned by the diagonal; not for kSource
  kBicgstab,  // BiCGSTAB of Eigen, the same (what the source calls biconjugate gradients)
  kViennaCl,  // BiCGStab of ViennaCL on an OpenCL device; builds with THICKLENS_WITH_VIENNACL
};
// "umfpack", "cholmod", "eigen", "cg", "bicgstab", "viennacl"; throws
BlockSolver BlockSolverFromName(const std::string& name);
std::string BlockSolverName(BlockSolver solver);
bool IsBuiltIn(BlockSolver solver);  // whether this build has it
std::vector<BlockSolver> BuiltInBlockSolvers();
bool IsIterative(BlockSolver solver);
BlockSolver DefaultBlockSolver();

// How the smoothness over the rays of one scene point is discretised.
enum class Stencil {
  kWarp,    // D L = L(i + m, k + 1) - L(i, k); -G = D^T D
  kSource,  // G as six explicit finite differences; not symmetric where the depth varies
};
Stencil StencilFromName(const std::string& name);  // "warp", "source"; throws
std::string StencilName(Stencil stencil);

struct BlockOptions {
  BlockSolver solver = DefaultBlockSolver();
  Stencil stencil = Stencil::kWarp;
  kernels::Splat splat = kernels::Splat::kBilinear;
  double gamma = 1;             // > 0
  std::optional<double> ridge;  // mu, >= 0; default 1e-2/(U V)
  // Edge of the square blocks, px. Default: 16, or the largest that `memory_limit_mib` allows.
  std::optional<int> block_px;
  std::optional<double> memory_limit_mib;  // for the whole process
  double rcond_min = 1e-12;                // of direct solvers
  // Of iterative ones: the relative residual of a block at which they stop, > 0, < 1, and the most
  // iterations for a block's channel, >= 1.
  double tolerance = 1e-6;
  int max_iterations = 1000;
  bool falloff = true;  // the irradiance of [S12], where there is a camera
  int threads = 0;      // 0: one per core
  // Called from any thread, one at a time, as blocks are finished. May throw to stop.
  std::function<void(int done, int total)> progress;
  BlockStore* store = nullptr;  // where blocks are looked for and kept; none: they are not

  bool IsValid(std::string* why) const;
};

struct BlockReport {
  int x = 0, y = 0, width_px = 0, height_px = 0;
  int unknowns = 0;
  std::int64_t entries = 0;  // of the system
  // The solver's own estimate from its factor's diagonal; absent: it is iterative.
  std::optional<double> rcond;
  int iterations = 0;            // the most of the channels
  double relative_residual = 0;  // |N x - b|/|b| recomputed; the largest of the channels
};

struct EstimateSummary {
  std::string message = "not run";
  int block_px = 0;
  std::vector<BlockReport> blocks;
  int blocks_from_store = 0;  // of these; the others were solved
  double gamma = 0, ridge = 0;
  std::optional<double> rcond_min;  // over the blocks; absent: the solver is iterative
  double relative_residual = 0;     // the largest
  int iterations = 0;               // of iterative solvers, the most of a block
  bool converged = false;    // the largest residual is within the tolerance; direct solvers: always
  double setup_seconds = 0;  // geometry of the views, the prior, choice of the block size
  double solve_seconds = 0;
  // Most that the whole process is expected to hold, with a margin: what it held before, the light
  // field, and on each thread a block as large as the most demanding of a few that were analysed.
  double predicted_memory_mib = 0;
  int threads = 0;
  std::string device;
};

// The light field of one picture by blocks, each solved on its own:
//   (H^T H - gamma G + mu Id) L = H^T I + mu L0, [D112]
// the minimiser of |H L - I|^2 + gamma |D L|^2 + mu |L - L0|^2, L0 the picture warped by its depth:
// [M19] with a ridge. [M21] has no ridge; without one the system is singular or so nearly that its
// solution is noise, while its residual is perfect: see BlockOptions::rcond_min.
// Channels share each block's factor. Blocks share no ray; smoothness links that leave a block
// are lost. The result does not depend on the number of threads.
// An iterative solver that does not converge leaves what it has reached: see `converged`.
// Throws Error for options and inputs that do not fit, a block whose factor is singular or has an
// rcond below the limit (naming the block), and a memory limit that no block fits.
model::LightField EstimateByBlocks(const EstimateInput& input, const BlockOptions& options,
                                   kernels::Backend* backend, EstimateSummary* summary);

}  // namespace thicklens::estimator

#endif  // THICKLENS_ESTIMATOR_BLOCK_SOLVER_H_
