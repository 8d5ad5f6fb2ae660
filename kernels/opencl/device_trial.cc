#include <fmt/format.h>

#include <cstddef>
#include <map>
#include <utility>
#include <vector>

#include "kernels/opencl/device_survey.h"
#include "kernels/opencl/opencl_program.h"
#include "kernels/opencl/opencl_use.h"
#include "thicklens/base/error.h"

namespace thicklens::kernels {
namespace {

constexpr int kTaps = 5;
constexpr std::size_t kSums = 1000;

const char kTrialSource[] = R"(
kernel void Trial(const int taps, global const REAL* x, global REAL* y) {
  const int i = (int)get_global_id(0);
  REAL sum = 0;
  for (int k = 0; k < taps; ++k) sum += (REAL)(k + 1) * x[i + k];
  y[i] = sum;
}
)";

// Computes y_i = sum_k (k + 1) x_{i+k} in whole numbers, whose sum is exact in any order.
template <typename Real>
std::vector<Real> RightSums(const std::vector<Real>& x) {
  std::vector<Real> y(kSums, Real{0});
  for (std::size_t i = 0; i < kSums; ++i) {
    for (std::size_t k = 0; k < kTaps; ++k) y[i] += static_cast<Real>(k + 1) * x[i + k];
  }
  return y;
}

template <typename Real>
void RunTrial(const OpenClDevice& device, const std::string& real) {
  std::vector<Real> x(kSums + kTaps);
  for (std::size_t i = 0; i < x.size(); ++i) x[i] = static_cast<Real>(i * i % 257) - Real{128};
  std::vector<Real> y(kSums, Real{-1});
  const cl::Program program = BuildProgram(device, {{"trial", kTrialSource}}, real);
  const cl::CommandQueue queue(device.context, device.device);
  const cl::Buffer in(device.context, CL_MEM_READ_ONLY, x.size() * sizeof(Real));
  const cl::Buffer out(device.context, CL_MEM_WRITE_ONLY, y.size() * sizeof(Real));
  cl::Kernel kernel(program, "Trial");
  kernel.setArg(0, cl_int{kTaps});
  kernel.setArg(1, in);
  kernel.setArg(2, out);
  queue.enqueueWriteBuffer(in, CL_TRUE, 0, x.size() * sizeof(Real), x.data());
  queue.enqueueNDRangeKernel(kernel, cl::NullRange, cl::NDRange(kSums));
  queue.enqueueReadBuffer(out, CL_TRUE, 0, y.size() * sizeof(Real), y.data());
  if (y != RightSums(x)) {
    throw Error(
        fmt::format("device {}: a small kernel in {} gives a wrong result", device.name, real));
  }
}

}  // namespace

std::string TryDevice(int platform, int device, const std::vector<EmbeddedFile>& files) {
  try {
    const auto opened = OpenOpenClDevice(platform, device);
    RunTrial<float>(*opened, "float");
    BuildProgram(*opened, files, "float");
    if (opened->has_double) {
      RunTrial<double>(*opened, "double");
      BuildProgram(*opened, files, "double");
    }
  } catch (const cl::Error& failure) {
    return fmt::format("device opencl:{}:{}: a small kernel cannot be run: {}: {}", platform,
                       device, failure.what(), OpenClErrorText(failure.err()));
  } catch (const Interrupted&) {
    throw;
  } catch (const Error& failure) {
    return failure.what();
  }
  return "";
}

std::string TryDeviceOnce(int platform, int device, const StopCheck& stop) {
  static std::map<std::pair<int, int>, std::string> results;
  const auto known = results.find({platform, device});
  if (known != results.end()) return known->second;
  std::string problem;
  if (IsOpenClInUse()) {
    problem = TryDevice(platform, device, EmbeddedKernelFiles());
  } else {
    const SubprocessOutcome outcome = RunInSubprocess(
        [&](const SubprocessReport& report) {
          report(TryDevice(platform, device, EmbeddedKernelFiles()));
        },
        kChildLimitS, stop);
    problem = OneLine(outcome.reported);
    if (!outcome.failure.empty()) {
      problem = fmt::format("device opencl:{}:{}: its driver {} while it ran a small kernel",
                            platform, device, outcome.failure);
    }
  }
  return results[{platform, device}] = problem;
}

}  // namespace thicklens::kernels
