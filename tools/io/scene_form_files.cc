#include "thicklens/io/scene_form_files.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <opencv2/core/mat.hpp>
#include <system_error>
#include <utility>
#include <vector>

#include "thicklens/base/cancel.h"
#include "thicklens/base/error.h"
#include "thicklens/base/output_file.h"
#include "thicklens/io/image_file.h"
#include "thicklens/io/image_io.h"
#include "thicklens/io/light_field_io.h"
#include "thicklens/model/light_field_file.h"
#include "tools/io/light_field_camera.h"
#include "tools/io/plain_tiff.h"

namespace thicklens::io {
namespace {

namespace fs = std::filesystem;

// The light is rounded by at most this, 1 at full scale; otherwise it is stored as floats.
constexpr double kMaxRounding = 1e-5;
constexpr double kMaxWhole = 65535;

std::string PathIn(const std::string& folder, const char* name) {
  return (fs::path(folder) / name).string();
}

// Reads an image whose size and type are known. `what` names its values in messages.
cv::Mat ReadPlane(const std::string& path, const model::LightField& frame, int type,
                  const char* what) {
  cv::Mat image = DecodeImageFile(ReadWholeFile(path), path).pixels;
  if (image.cols != frame.s_count || image.rows != frame.t_count) {
    throw Error(fmt::format("{}: it has {}x{} px, lightfield.yaml states {}x{}", path, image.cols,
                            image.rows, frame.s_count, frame.t_count));
  }
  if (image.type() != type) {
    throw Error(fmt::format("{}: {} are expected, found {} channel(s) of {} bits{}", path, what,
                            image.channels(), 8 * image.elemSize1(),
                            image.depth() >= CV_32F ? ", float" : ""));
  }
  return image;
}

// Calls take(value) for all values of T, row by row.
template <typename T, typename Take>
void ForEachValue(const cv::Mat& image, const Take& take) {
  for (int y = 0; y < image.rows; ++y) {
    ThrowIfCancelled();
    const auto* const row = image.ptr<T>(y);
    const int count = image.cols * image.channels();
    for (int i = 0; i < count; ++i) take(row[i]);
  }
}

model::LinearImage ReadRadiance(const std::string& path, const model::LightField& frame,
                                const model::ScenePlanes& planes) {
  const bool is_whole = planes.radiance_bits == 16;
  const cv::Mat image =
      ReadPlane(path, frame, CV_MAKETYPE(is_whole ? CV_16U : CV_32F, frame.channels),
                is_whole ? "whole numbers of 16 bits in the channels of the light field"
                         : "floats in the channels of the light field");
  model::LinearImage light{image.cols, image.rows, image.channels(), {}};
  light.values.reserve(image.total() * static_cast<std::size_t>(image.channels()));
  if (is_whole) {
    ForEachValue<std::uint16_t>(image, [&](std::uint16_t value) {
      light.values.push_back(
          static_cast<float>(planes.radiance_offset + planes.radiance_scale * value));
    });
  } else {
    ForEachValue<float>(image, [&](float value) { light.values.push_back(value); });
  }
  return light;
}

// Returns whole numbers for the light and sets their meaning in `planes`; empty if these would
// differ too much from it.
std::vector<std::uint16_t> WholeNumbersOf(const std::vector<float>& light,
                                          model::ScenePlanes* planes) {
  const auto [least, most] = std::minmax_element(light.begin(), light.end());
  const double offset = static_cast<double>(*least);
  const double range = static_cast<double>(*most) - offset;
  if (!(range / kMaxWhole / 2 <= kMaxRounding)) return {};
  planes->radiance_bits = 16;
  planes->radiance_offset = offset;
  planes->radiance_scale = range > 0 ? range / kMaxWhole : kMaxRounding;
  std::vector<std::uint16_t> whole;
  whole.reserve(light.size());
  const double per_unit = 1 / planes->radiance_scale;
  for (const float value : light) {
    const double number = (static_cast<double>(value) - offset) * per_unit + 0.5;
    whole.push_back(static_cast<std::uint16_t>(std::min(number, kMaxWhole)));
  }
  return whole;
}

}  // namespace

bool IsSceneForm(const std::string& folder) {
  const std::string path = PathIn(folder, kLightFieldMarker);
  std::error_code ignored;
  return fs::exists(path, ignored) && model::ReadLightFieldDescription(path).scene.has_value();
}

estimator::SceneForm ReadSceneForm(const std::string& folder) {
  const std::string path = PathIn(folder, kLightFieldMarker);
  const model::LightFieldDescription description = model::ReadLightFieldDescription(path);
  if (!description.scene) {
    throw Error(fmt::format("{}: the light field is stored as views, and not as its scene", path));
  }
  const model::ScenePlanes& planes = *description.scene;
  estimator::SceneForm scene;
  scene.frame = description.light_field;
  scene.frame.source = folder;
  scene.frame.camera = CameraOfLightField(folder, description);
  const std::string radiance_path = PathIn(folder, model::kSceneRadianceFile);
  const std::string disparity_path = PathIn(folder, model::kSceneDisparityFile);
  scene.radiance = ReadRadiance(radiance_path, scene.frame, planes);
  const cv::Mat disparity =
      ReadPlane(disparity_path, scene.frame, CV_32FC1, "floats in one channel");
  scene.disparity = {disparity.cols, disparity.rows, {}, planes.disparity_step};
  scene.disparity.disparity.reserve(disparity.total());
  ForEachValue<float>(disparity, [&](float value) { scene.disparity.disparity.push_back(value); });
  if (description.has_confidence) {
    const cv::Mat confidence = ReadPlane(PathIn(folder, model::kSceneConfidenceFile), scene.frame,
                                         CV_8UC1, "bytes in one channel");
    scene.confidence.reserve(confidence.total());
    ForEachValue<std::uint8_t>(confidence,
                               [&](std::uint8_t value) { scene.confidence.push_back(value); });
  }
  if (planes.has_colour_profile) {
    scene.frame.colour_profile = ReadWholeFile(PathIn(folder, model::kSceneProfileFile));
  }
  std::string why;
  if (!scene.IsValid(&why)) throw Error(fmt::format("{}: {}", folder, why));
  return scene;
}

SceneViews OpenSceneViews(const std::string& folder) {
  struct Rendered {
    explicit Rendered(const std::string& path) : scene(ReadSceneForm(path)), renderer(scene) {}
    const estimator::SceneForm scene;
    const estimator::SceneRenderer renderer;
  };
  const auto rendered = std::make_shared<const Rendered>(folder);
  SceneViews views;
  views.frame = rendered->scene.frame;
  views.view = [rendered](int k, int l) {
    const model::LightField& frame = rendered->scene.frame;
    return rendered->renderer.View(frame.u_offset(k), frame.v_offset(l));
  };
  return views;
}

void WriteSceneForm(const estimator::SceneForm& scene, OutputFolder* folder) {
  std::string why;
  if (!scene.IsValid(&why)) throw Error("scene: " + why);
  const model::LightField& frame = scene.frame;
  if (frame.channels != 1 && frame.channels != 3) {
    throw Error(
        fmt::format("scene: channels is {}: image files have 1 (grey) or 3 (RGB)", frame.channels));
  }
  model::LightFieldDescription description;
  description.light_field = model::DescriptionOf(frame);
  description.has_confidence = !scene.confidence.empty();
  model::ScenePlanes& planes = description.scene.emplace();
  planes.disparity_step = scene.disparity.step;
  planes.has_colour_profile = !frame.colour_profile.empty();
  const std::vector<std::uint16_t> whole = WholeNumbersOf(scene.radiance.values, &planes);
  folder->WriteWith(
      model::kSceneRadianceFile, [&](const std::string& path, const std::string& shown) {
        if (whole.empty()) return WriteFloatTiff(scene.radiance, path, shown);
        WriteWholeTiff(whole, frame.s_count, frame.t_count, frame.channels, path, shown);
      });
  folder->WriteWith(
      model::kSceneDisparityFile, [&](const std::string& path, const std::string& shown) {
        WriteFloatTiff({frame.s_count, frame.t_count, 1, scene.disparity.disparity}, path, shown);
      });
  if (description.has_confidence) {
    folder->Write(model::kSceneConfidenceFile, EncodeBytesPng(scene.confidence, frame.s_count));
  }
  if (planes.has_colour_profile) folder->Write(model::kSceneProfileFile, frame.colour_profile);
  description.camera_file = WriteCameraOfLightField(frame, folder);
  folder->Write(kLightFieldMarker, model::LightFieldDescriptionToYaml(description));
}

}  // namespace thicklens::io
