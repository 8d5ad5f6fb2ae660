#ifndef THICKLENS_SOLVER_H_
#define THICKLENS_SOLVER_H_

#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <variant>
#include <vector>

#include "thicklens/base/export.h"
#include "thicklens/camera.h"
#include "thicklens/image.h"
#include "thicklens/light_field.h"
#include "thicklens/run.h"

namespace thicklens::estimator {
struct EstimateInput;
class BlockStore;
}  // namespace thicklens::estimator

namespace thicklens {

// ---- The solvers of the library. Each has its own struct, so that no option of one solver can be
// given to another and be ignored.

// The assumption about the radiance of the scene.
enum class Prior {
  kRidge,           // the radiance is near the photograph
  kGradient,        // squared differences of neighbours are small
  kTotalVariation,  // absolute differences of neighbours are small, colours together
  kPatches,         // kTotalVariation, and patches of 8 x 8 px consist of few waves
};
// How the strength of the prior is chosen.
enum class StrengthRule {
  kAuto,   // from the photograph's noise
  kGcv,    // generalised cross-validation
  kGiven,  // SceneSolver::strength
};

// The aperture through which the photograph was taken.
enum class PhotoKind {
  kAuto,      // measured from the photograph [D179]; the stated one where it does not show it
  kCaptured,  // that of camera and views: points are blurred by their depth
  kSharp,     // a pinhole: the photograph is the centre view, sharp at all depths
};

// The radiance of the scene's points for the whole image at once [D101]; the default.
struct SceneSolver {
  Prior prior = Prior::kTotalVariation;              // assumption about the radiance
  StrengthRule strength_rule = StrengthRule::kAuto;  // how its strength is chosen
  double strength = 0;  // only for kGiven: finite, > 0, in the prior's own unit
  // Relative residual at which conjugate gradients stop, 0 < tolerance < 1; absent: 1e-4 for total
  // variation and patches, 1e-3 for the others.
  std::optional<double> tolerance;
  int max_iterations = 200;       // 1 to 1000000, for all solves together
  bool double_precision = false;  // compute in double
  // Also look whether the photograph asks for a narrower blur or another plane of focus [D109]. The
  // light field is the same with and without.
  bool check_blur = false;
  PhotoKind photo = PhotoKind::kAuto;  // how wide the photograph's aperture was

  // Returns whether all members are in their range. Otherwise `why`, if not null, gets the field,
  // the value and the constraint.
  THICKLENS_EXPORT bool IsValid(std::string* why) const;
};

// The paper's functional |H L - I|^2 + gamma |D L|^2 + mu |L - L0|^2, block by block [M19], [D112].
struct BlockSolver {
  // The solver of the linear system of one block.
  enum class Linear {
    kDefault,   // kUmfpack if the build has it, otherwise kEigen
    kUmfpack,   // unsymmetric multifrontal LU (the paper's choice)
    kCholmod,   // supernodal Cholesky; not for kPaper
    kEigen,     // simplicial Cholesky, or LU for kPaper
    kCg,        // conjugate gradients; not for kPaper
    kBicgstab,  // stabilised biconjugate gradients
    // BiCGStab of ViennaCL on an OpenCL device.
    kViennaCl
  };
  // The discretisation of the smoothness [M18], [M20].
  enum class Stencil {
    kWarp,   // D L = L(i + m, k + 1) - L(i, k)
    kPaper,  // the paper's six explicit differences; not symmetric where the depth varies
  };
  // Which pixels a ray reaches [M16]: the two nearest of each axis, by distance (kBilinear), or the
  // nearest one (kNearest).
  enum class Splat { kBilinear, kNearest };
  Linear linear = Linear::kDefault;  // solves the system of each block
  Stencil stencil = Stencil::kWarp;  // discretisation of the smoothness
  Splat splat = Splat::kBilinear;    // which pixels a ray reaches
  double gamma = 1;                  // finite, > 0
  std::optional<double> ridge;       // mu, finite, >= 0; absent: 0.01/(U V)
  std::optional<int> block_px;  // edge of a block, 1 to 100000; absent: 16, or what memory allows
  // Only for the iterative kCg, kBicgstab and kViennaCl: 0 < tolerance < 1, iterations 1 to
  // 1000000 for one channel of a block; absent: 1e-6 and 1000.
  std::optional<double> tolerance;
  std::optional<int> max_iterations;  // see tolerance
  // Keeps solved blocks, so that another run can go on from them. Not part of the result.
  std::shared_ptr<estimator::BlockStore> store;

  // Returns whether all members are in their range and fit each other. Otherwise `why`, if not
  // null, gets the field, the value and the constraint.
  THICKLENS_EXPORT bool IsValid(std::string* why) const;
};

// Minimises the functional of BlockSolver for the whole image, on the rays of scene points [D115].
struct FunctionalSolver {
  double gamma = 1;               // finite, > 0
  std::optional<double> ridge;    // mu, finite, > 0; absent: 0.01/(U V)
  double tolerance = 1e-3;        // 0 < tolerance < 1
  int max_iterations = 1000;      // 1 to 1000000, for each channel
  bool double_precision = false;  // compute in double

  // Returns whether all members are in their range. Otherwise `why`, if not null, gets the field,
  // the value and the constraint.
  THICKLENS_EXPORT bool IsValid(std::string* why) const;
};
// Minimises that functional for the whole image, on the two-plane grid of BlockSolver [D113].
struct GridSolver : FunctionalSolver {};

// ---- Solvers of a program.

// The input of a solver: the photograph in linear light, its disparity without holes and
// smoothed, the weights of the views and, with a camera, the grid. Immutable; copies are cheap.
class THICKLENS_EXPORT Problem {
 public:
  // Makes the problem of an input. Throws Error if it is null.
  explicit Problem(std::shared_ptr<const estimator::EstimateInput> input);

  // Width of the photograph and of each view, px.
  int width_px() const;
  // Height of the photograph and of each view, px.
  int height_px() const;
  // Number of channels of the photograph.
  int channels() const;
  // Number of views across.
  int u_count() const;
  // Number of views down.
  int v_count() const;
  const model::LinearImage& photograph() const;  // linear light, 1 at full scale
  const std::vector<float>& disparity() const;   // one per pixel; near points are larger
  Eigen::Vector2d disparity_step() const;        // times this: px per view step along u and v
  const Eigen::ArrayXXd& weights() const;        // V x U, sum 1
  // The calibrated camera; absent: the light field is relative.
  const std::optional<Camera>& camera() const;
  // Planes and steps, mm from Ap; present if the camera is.
  const std::optional<model::LightFieldGrid>& grid() const;
  bool falloff() const { return falloff_; }  // whether the photograph contains the fall-off [S12]
  // States whether the photograph contains the fall-off [S12].
  void set_falloff(bool falloff) { falloff_ = falloff; }

  // The photograph, or another image of its size, warped to every view by the disparity. It is the
  // light field of a scene without blur, and the usual start of a solver. Throws Error if the size
  // or the channels differ from the photograph's.
  LightField WarpToViews(const RunControl& run) const;
  LightField WarpToViews(const model::LinearImage& image, const RunControl& run) const;
  // The photograph that the aperture would take of the light field: H L, linear light.
  model::LinearImage Photograph(const LightField& light_field, const RunControl& run) const;

  const estimator::EstimateInput& input() const { return *input_; }  // for the library's solvers

 private:
  std::shared_ptr<const estimator::EstimateInput> input_;
  bool falloff_ = true;
};

// How a solver ended. Whatever it claims is computed again from its answer.
struct SolverSummary {
  std::string message = "not run";                                 // how it ended, one line
  std::optional<int> iterations;                                   // absent: a direct solver
  bool converged = false;                                          // direct solvers: true
  std::optional<double> relative_residual;                         // |A x - b|/|b| of the solution
  std::optional<double> rcond_min;                                 // direct solvers
  double setup_seconds = 0, solve_seconds = 0, views_seconds = 0;  // times of the parts, s
  double predicted_memory_mib = 0;                                 // of the whole process
  std::string device = "cpu";                                      // that computed
};

// The interface of every solver: problem, options, summary, in this order. The options of a solver
// are its own members. A solver does not change while it solves, and may solve several problems at
// once.
class THICKLENS_EXPORT Solver {
 public:
  virtual ~Solver();
  virtual std::string Name() const = 0;  // stored as the method of the light field
  // Returns whether the solver's own options are valid. Otherwise `why`, if not null, gets the
  // field, the value and the constraint.
  virtual bool IsValid(std::string* why) const;
  // Returns the light field of the problem: its views, weights and grid must be those of
  // problem.WarpToViews(). Throws Error for problems that it cannot solve. It reports progress by
  // `run`, and ends by Interrupted soon after a cancellation (ThrowIfCancelled).
  virtual LightField Solve(const Problem& problem, const RunControl& run,
                           SolverSummary* summary) const = 0;
};

// The library's solvers with their options.
using SolverOptions = std::variant<SceneSolver, BlockSolver, FunctionalSolver, GridSolver>;

// Chooses a solver when the problem is known. `seconds` is the time since the call began.
struct SolverChoice {
  SolverOptions solver;        // the chosen solver
  std::string device = "cpu";  // as EstimateOptions::device
};
// A function that is called once, when the problem is known.
using SolverChooser = std::function<SolverChoice(const Problem& problem, double seconds)>;

// One of the library's solvers, a program's own (not null), or a function that chooses one of the
// library's.
using AnySolver = std::variant<SceneSolver, BlockSolver, FunctionalSolver, GridSolver,
                               std::shared_ptr<const Solver>, SolverChooser>;
// "scene", "blocks", "functional", "grid", the name of the program's own, or "chosen".
THICKLENS_EXPORT std::string SolverName(const AnySolver& solver);

}  // namespace thicklens

#endif  // THICKLENS_SOLVER_H_
