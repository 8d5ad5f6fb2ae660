#ifndef THICKLENS_ESTIMATOR_BLOCK_SOLVER_H_
#define THICKLENS_ESTIMATOR_BLOCK_SOLVER_H_

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "thicklens/base/export.h"
#include "thicklens/estimator/estimate_input.h"
#include "thicklens/estimator/solver_run.h"
#include "thicklens/kernels/splat.h"
#include "thicklens/model/light_field.h"

namespace thicklens::estimator {

// The solver of the linear system of one block.
enum class BlockSolver {
  kUmfpack,  // unsymmetric multifrontal LU (the paper's choice); GPL
  kCholmod,  // supernodal Cholesky; GPL
  kEigen,    // simplicial Cholesky, or LU for the six-term stencil; always built in
  // Iterative solvers, for comparison. They have no factor, so the residual alone judges the
  // answer.
  kCg,        // conjugate gradients of Eigen with a diagonal preconditioner; not for kSource
  kBicgstab,  // BiCGSTAB of Eigen, likewise (the paper's biconjugate gradients)
  kViennaCl,  // BiCGStab of ViennaCL on an OpenCL device; builds with THICKLENS_WITH_VIENNACL
};
// The names are "umfpack", "cholmod", "eigen", "cg", "bicgstab" and "viennacl". Throws Error for
// another name.
THICKLENS_EXPORT BlockSolver BlockSolverFromName(const std::string& name);
// Name of the solver, as BlockSolverFromName accepts it.
THICKLENS_EXPORT std::string BlockSolverName(BlockSolver solver);
THICKLENS_EXPORT bool IsBuiltIn(BlockSolver solver);  // whether this build has it
// The solvers that this build has, in the order of the enumeration.
THICKLENS_EXPORT std::vector<BlockSolver> BuiltInBlockSolvers();
// Returns whether the solver iterates and thus has no factor.
THICKLENS_EXPORT bool IsIterative(BlockSolver solver);
// KUmfpack if this build has it, otherwise kEigen.
THICKLENS_EXPORT BlockSolver DefaultBlockSolver();

// The discretisation of the smoothness over the rays of one scene point.
enum class Stencil {
  kWarp,    // D L = L(i + m, k + 1) - L(i, k); -G = D^T D
  kSource,  // G as six explicit finite differences; not symmetric where the depth varies
};
// The names are "warp" and "source". Throws Error for another name.
THICKLENS_EXPORT Stencil StencilFromName(const std::string& name);
// Name of the discretisation: "warp" or "source".
THICKLENS_EXPORT std::string StencilName(Stencil stencil);

// The options of EstimateByBlocks.
struct BlockOptions {
  BlockSolver solver = DefaultBlockSolver();         // solves the system of each block
  Stencil stencil = Stencil::kWarp;                  // discretisation of the smoothness
  kernels::Splat splat = kernels::Splat::kBilinear;  // which pixels a ray reaches
  double gamma = 1;                                  // > 0
  std::optional<double> ridge;                       // mu, >= 0; default 1e-2/(U V)
  // Edge of the square blocks, px, >= 1. Default: 16, or the largest edge that the memory limit of
  // the run allows.
  std::optional<int> block_px;
  double rcond_min = 1e-12;  // smallest rcond that is accepted of direct solvers, >= 0, < 1
  // Limits of iterative solvers: the relative residual of a block at which they stop, > 0, < 1, and
  // the maximum number of iterations for one channel of a block, >= 1.
  double tolerance = 1e-6;
  int max_iterations = 1000;  // see tolerance
  bool falloff = true;        // applies the irradiance of [S12] if there is a camera

  // Returns false, and the reason in `why` (may be null), if a member is not in its range.
  THICKLENS_EXPORT bool IsValid(std::string* why) const;
};

// How one block was solved.
struct BlockReport {
  int x = 0, y = 0, width_px = 0, height_px = 0;  // top-left pixel, and size, px
  int unknowns = 0;                               // number of rays that are solved for
  std::int64_t entries = 0;                       // stored entries of the system's matrix
  // The solver's own estimate from the diagonal of its factor; absent for iterative solvers.
  std::optional<double> rcond;
  int iterations = 0;            // maximum over the channels
  double relative_residual = 0;  // |N x - b|/|b|, recomputed; the maximum over the channels
};

// Findings of the block solver besides the light field.
struct BlockDiagnostics {
  int block_px = 0;             // edge of the blocks, px
  int blocks_from_store = 0;    // number of blocks that came from the store; the others were solved
  double gamma = 0, ridge = 0;  // gamma and mu
};

// The predicted memory has a margin: it is what the process held before, the light field, and for
// each thread a block as large as the most demanding of a few analysed blocks.
struct BlockSummary : SolverResult, BlockDiagnostics {
  int iterations = 0;               // iterative solvers: the maximum over the blocks
  std::optional<double> rcond_min;  // minimum over the blocks; absent for iterative solvers
  std::vector<BlockReport> blocks;  // row by row
};

// Estimates the light field of one photograph block by block; each block is solved on its own:
//   (H^T H - gamma G + mu Id) L = H^T I + mu L0. [D112]
// The solution minimises |H L - I|^2 + gamma |D L|^2 + mu |L - L0|^2, where L0 is the photograph
// warped by its depth. This is [M19] with a ridge. [M21] has no ridge; without one the system is
// singular, or so nearly singular that its solution is noise although its residual is perfect: see
// BlockOptions::rcond_min.
//
// The channels share the factor of each block. Blocks share no ray, and the smoothness links that
// leave a block are lost. The result does not depend on the number of threads. An iterative solver
// that does not converge leaves what it has reached: see `converged`.
//
// The systems are made on the backend of the run; a store of the run keeps the blocks. `summary`
// may be null. Throws Error for options and inputs that do not fit, for a block whose factor is
// singular or whose rcond is below the limit (the message names the block), for iterations that end
// with a relative residual of 10 or more, and for a memory limit that blocks of
// BlockOptions::block_px, or without it the smallest blocks, exceed.
THICKLENS_EXPORT model::LightField EstimateByBlocks(const EstimateInput& input,
                                                    const BlockOptions& options,
                                                    const SolverRun& run, BlockSummary* summary);

}  // namespace thicklens::estimator

#endif  // THICKLENS_ESTIMATOR_BLOCK_SOLVER_H_
