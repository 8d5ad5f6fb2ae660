#include "kernels/opencl/device_choice.h"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <tuple>

#include "thicklens/base/error.h"

namespace thicklens::kernels {
namespace {

constexpr std::size_t kMaxDigits = 3;

bool IsSimulator(const DeviceDescription& device) {
  std::string names = device.platform_name + " " + device.name;
  std::transform(names.begin(), names.end(), names.begin(),
                 [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  return names.find("oclgrind") != std::string::npos ||
         names.find("simulator") != std::string::npos || names.find("emulat") != std::string::npos;
}

int TypeScore(const std::string& type) {
  if (type == "gpu") return 3;
  if (type == "accelerator") return 2;
  return type == "cpu" ? 1 : 0;
}

std::tuple<bool, bool, int> Score(const DeviceDescription& device) {
  return {!IsSimulator(device), device.has_double, TypeScore(device.type)};
}

bool Allows(const DeviceRequest& request, const DeviceDescription& device) {
  return (request.platform < 0 || request.platform == device.platform) &&
         (request.device < 0 || request.device == device.device);
}

std::string NameOf(const DeviceDescription& device) {
  return fmt::format("opencl:{}:{}", device.platform, device.device);
}

std::string ListOf(const std::vector<DeviceDescription>& devices) {
  std::string list;
  for (const DeviceDescription& device : devices) {
    list += fmt::format("{}{} ({})", list.empty() ? "" : ", ", NameOf(device), device.name);
  }
  return list.empty() ? "none" : list;
}

// Reads the whole number from `begin` to `end`; returns false for any other text.
bool ReadIndex(const std::string& text, std::size_t begin, std::size_t end, int* index) {
  if (end <= begin || end - begin > kMaxDigits) return false;
  *index = 0;
  for (std::size_t i = begin; i < end; ++i) {
    if (text[i] < '0' || text[i] > '9') return false;
    *index = 10 * *index + (text[i] - '0');
  }
  return true;
}

}  // namespace

DeviceRequest ParseDeviceRequest(const std::string& text) {
  using Kind = DeviceRequest::Kind;
  if (text == "auto") return {Kind::kAuto, -1, -1};
  if (text == "cpu") return {Kind::kCpu, -1, -1};
  const std::string opencl = "opencl";
  if (text == opencl) return {Kind::kOpenCl, -1, -1};
  if (text.rfind(opencl + ":", 0) == 0) {
    DeviceRequest request{Kind::kOpenCl, -1, -1};
    const std::size_t begin = opencl.size() + 1;
    const std::size_t colon = text.find(':', begin);
    const std::size_t end = std::min(colon, text.size());
    if (ReadIndex(text, begin, end, &request.platform) &&
        (colon == std::string::npos || ReadIndex(text, colon + 1, text.size(), &request.device))) {
      return request;
    }
  }
  throw Error(
      fmt::format("device '{}' is unknown: it must be auto, cpu, opencl, opencl:PLATFORM or "
                  "opencl:PLATFORM:DEVICE, with indices from 0 as `thicklens doctor` lists them",
                  text));
}

std::string RequestText(const DeviceRequest& request) {
  if (request.kind == DeviceRequest::Kind::kAuto) return "auto";
  if (request.kind == DeviceRequest::Kind::kCpu) return "cpu";
  if (request.platform < 0) return "opencl";
  if (request.device < 0) return fmt::format("opencl:{}", request.platform);
  return fmt::format("opencl:{}:{}", request.platform, request.device);
}

std::vector<DeviceDescription> Candidates(const DeviceSurvey& survey, const DeviceRequest& request,
                                          std::vector<std::string>* problems) {
  std::vector<DeviceDescription> candidates;
  bool any_allowed = false;
  for (const DeviceDescription& device : survey.devices) {
    if (!Allows(request, device)) continue;
    any_allowed = true;
    if (device.problem.empty()) {
      candidates.push_back(device);
    } else {
      problems->push_back(
          fmt::format("device {} ({}): {}", NameOf(device), device.name, device.problem));
    }
  }
  if (!any_allowed && !survey.devices.empty()) {
    problems->push_back("there is no such device; the devices are: " + ListOf(survey.devices));
  }
  std::stable_sort(candidates.begin(), candidates.end(),
                   [](const auto& a, const auto& b) { return Score(a) > Score(b); });
  return candidates;
}

}  // namespace thicklens::kernels
