#include "thicklens/kernels/device.h"

#include <fmt/format.h>

#include <functional>
#include <mutex>
#include <optional>
#include <utility>

#include "kernels/opencl/device_choice.h"
#include "kernels/opencl/device_survey.h"
#include "kernels/opencl/opencl_device.h"
#include "kernels/opencl/opencl_program.h"
#include "thicklens/base/error.h"
#include "thicklens/kernels/kernels.h"
#include "thicklens/kernels/radiance_steps.h"
#include "thicklens/kernels/view_warp.h"

namespace thicklens::kernels {
namespace {

class ReferenceBackend : public Backend {
 public:
  bool is_opencl() const override { return false; }
  bool has_double() const override { return true; }
  std::string name() const override { return "cpu"; }
  std::string description() const override { return "C++ on the processor, without OpenCL"; }
  std::unique_ptr<Kernels<float>> NewFloat() override { return NewReference<float>(); }
  std::unique_ptr<Kernels<double>> NewDouble() override { return NewReference<double>(); }
  std::unique_ptr<RadianceSteps<float>> NewSteps(const DataTerm<float>& data) override {
    return NewCpuRadianceSteps(data);
  }
  std::unique_ptr<RadianceSteps<double>> NewSteps(const DataTerm<double>& data) override {
    return NewCpuRadianceSteps(data);
  }
  std::unique_ptr<ViewWarp> NewWarp(const SurfaceImage& image) override {
    return NewReferenceWarp(image);
  }
};

class OpenClBackend : public Backend {
 public:
  explicit OpenClBackend(std::shared_ptr<const OpenClDevice> device) : device_(std::move(device)) {}

  bool is_opencl() const override { return true; }
  bool has_double() const override { return device_->has_double; }
  std::string name() const override { return device_->name; }
  std::string description() const override { return device_->description; }
  std::unique_ptr<Kernels<float>> NewFloat() override {
    return NewOpenClKernels<float>(device_, Built("float", &float_program_));
  }
  std::unique_ptr<Kernels<double>> NewDouble() override {
    return NewOpenClKernels<double>(device_, Built("double", &double_program_));
  }
  std::unique_ptr<RadianceSteps<float>> NewSteps(const DataTerm<float>& data) override {
    return NewOpenClSteps(device_, Built("float", &float_program_), data);
  }
  std::unique_ptr<RadianceSteps<double>> NewSteps(const DataTerm<double>& data) override {
    return NewOpenClSteps(device_, Built("double", &double_program_), data);
  }
  std::unique_ptr<ViewWarp> NewWarp(const SurfaceImage& image) override {
    return NewOpenClWarp(device_, Built("float", &float_program_), image);
  }

 private:
  // Returns a copy of the handle; the program itself is built once.
  cl::Program Built(const std::string& real, std::optional<cl::Program>* program) {
    const std::lock_guard<std::mutex> lock(mutex_);
    if (!*program) *program = BuildKernels(*device_, real);
    return **program;
  }

  const std::shared_ptr<const OpenClDevice> device_;
  std::mutex mutex_;
  std::optional<cl::Program> float_program_, double_program_;
};

// Returns the best device that works, or null and the reasons in `problems`.
std::shared_ptr<Backend> OpenBestDevice(const DeviceRequest& request, const StopCheck& stop,
                                        std::vector<std::string>* problems) {
  const DeviceSurvey& survey = SurveyDevices(false, stop);
  *problems = survey.problems;
  for (const DeviceDescription& device : Candidates(survey, request, problems)) {
    const std::string problem = TryDeviceOnce(device.platform, device.device, stop);
    if (!problem.empty()) {
      problems->push_back(problem);
      continue;
    }
    try {
      return std::make_shared<OpenClBackend>(OpenOpenClDevice(device.platform, device.device));
    } catch (const Interrupted&) {
      throw;
    } catch (const Error& error) {
      problems->emplace_back(error.what());
    }
  }
  if (problems->empty()) problems->emplace_back("OpenCL lists no device");
  return nullptr;
}

}  // namespace

std::shared_ptr<Backend> OpenBackend(const DeviceRequest& request, std::string* notice,
                                     const std::function<void()>& stop) {
  if (notice != nullptr) notice->clear();
  if (request.kind == DeviceRequest::Kind::kCpu) return std::make_shared<ReferenceBackend>();

  // One call at a time: the child processes must end before OpenCL is in use.
  static std::mutex mutex;
  const std::lock_guard<std::mutex> lock(mutex);
  std::vector<std::string> problems;
  std::shared_ptr<Backend> backend;
  try {
    backend = OpenBestDevice(request, stop, &problems);
  } catch (const Interrupted&) {
    throw;
  } catch (const Error& error) {  // no child process could be started
    problems.emplace_back(error.what());
  }
  if (backend != nullptr) return backend;
  const std::string why = fmt::format("{}", fmt::join(problems, "; "));
  if (request.kind == DeviceRequest::Kind::kOpenCl) {
    throw Error(fmt::format("device '{}' cannot be used: {} (the device cpu does not need OpenCL)",
                            RequestText(request), why));
  }
  if (notice != nullptr) {
    *notice = "no OpenCL device can be used, so the C++ code on the processor is used: " + why;
  }
  return std::make_shared<ReferenceBackend>();
}

}  // namespace thicklens::kernels
