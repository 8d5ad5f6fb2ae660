// BiCGStab of ViennaCL, the paper's third solver: a solver for comparison, only in builds with
// THICKLENS_WITH_VIENNACL.
#define VIENNACL_WITH_OPENCL

#include <algorithm>
#include <cstddef>
#include <exception>
#include <memory>
#include <mutex>
#include <string>
#include <vector>
#include <viennacl/compressed_matrix.hpp>
#include <viennacl/linalg/bicgstab.hpp>
#include <viennacl/vector.hpp>

#include "estimator/blocks/iterative_solver.h"
#include "estimator/blocks/linear_solver_kinds.h"
#include "thicklens/base/error.h"
#include "thicklens/kernels/device.h"

namespace thicklens::estimator {
namespace {

using kernels::CsrMatrix;

// ViennaCL has one queue and one program of each kind for the whole process.
std::mutex& OneAtATime() {
  static std::mutex mutex;
  return mutex;
}

// Runs an action that moves objects of ViennaCL to the device and back.
template <typename Action>
auto OnDevice(const char* step, const Action& action) {
  const std::lock_guard<std::mutex> lock(OneAtATime());
  try {
    return action();
  } catch (const Interrupted&) {
    throw;
  } catch (const std::exception& e) {
    throw Error(std::string("ViennaCL: the ") + step + " failed: " + e.what());
  }
}

class ViennaClMethod : public IterativeMethod {
 public:
  ~ViennaClMethod() override {
    const std::lock_guard<std::mutex> lock(OneAtATime());
    matrix_.reset();
  }

  std::string device() const override {
    return OnDevice("device",
                    [] { return "viennacl on opencl: " + viennacl::ocl::current_device().name(); });
  }

  // The first use allocates the device's runtime and programs; this solve is the first use.
  double BytesOf(const CsrMatrix<double>& matrix) const override {
    static std::once_flag once;
    std::call_once(once, [] { ViennaClMethod().SolveOnce(); });
    constexpr double kPerEntry = sizeof(double) + sizeof(unsigned);
    return kPerEntry * static_cast<double>(matrix.entries());
  }

  void SetMatrix(const CsrMatrix<double>& matrix) override {
    OnDevice("matrix", [&] {
      const std::vector<unsigned> start(matrix.row_start.begin(), matrix.row_start.end());
      const std::vector<unsigned> column(matrix.column.begin(), matrix.column.end());
      matrix_ = std::make_unique<viennacl::compressed_matrix<double>>();
      matrix_->set(start.data(), column.data(), matrix.value.data(),
                   static_cast<std::size_t>(matrix.rows), static_cast<std::size_t>(matrix.columns),
                   matrix.value.size());
    });
  }

  std::vector<double> Run(const std::vector<double>& b, double tolerance, int max_iterations,
                          int* iterations) override {
    return OnDevice("solution", [&] {
      viennacl::vector<double> right(b.size());
      viennacl::fast_copy(b, right);
      const viennacl::linalg::bicgstab_tag tag(tolerance, static_cast<std::size_t>(max_iterations));
      tag.iters(0);
      const viennacl::vector<double> solution = viennacl::linalg::solve(*matrix_, right, tag);
      *iterations += std::max(1, static_cast<int>(tag.iters()));
      std::vector<double> x(b.size());
      viennacl::fast_copy(solution, x);
      return x;
    });
  }

 private:
  void SolveOnce() {
    constexpr int kRows = 16;
    CsrMatrix<double> matrix;
    matrix.rows = matrix.columns = kRows;
    matrix.row_start = {0};
    for (int row = 0; row < kRows; ++row) {
      matrix.column.push_back(row);
      matrix.value.push_back(1 + 0.1 * row);
      matrix.row_start.push_back(row + 1);
    }
    SetMatrix(matrix);
    int iterations = 0;
    Run(std::vector<double>(kRows, 1.0), 1e-3, kRows, &iterations);
  }

  std::unique_ptr<viennacl::compressed_matrix<double>> matrix_;
};

// ViennaCL opens a device whether its driver works or not. Devices are therefore tried in child
// processes first. Later it would be too late for the whole process: a child of a process that uses
// OpenCL waits for threads that it does not have.
void RequireDevice() {
  static std::once_flag once;
  std::call_once(once,
                 [] { kernels::OpenBackend(kernels::ParseDeviceRequest("opencl"), nullptr); });
}

}  // namespace

std::unique_ptr<LinearSolver> NewViennaClSolver(const LinearSolverLimits& limits) {
  RequireDevice();
  return std::make_unique<IterativeSolver>(std::make_unique<ViennaClMethod>(), limits);
}

}  // namespace thicklens::estimator
