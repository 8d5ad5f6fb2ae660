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
#include "thicklens/estimator/disparity_map.h"
#include "thicklens/io/image_file.h"
#include "thicklens/io/image_io.h"
#include "thicklens/io/light_field_io.h"
#include "thicklens/model/light_field_file.h"
#include "thicklens/model/quantised_levels.h"
#include "thicklens/model/scene.h"
#include "tools/io/light_field_camera.h"
#include "tools/io/plain_tiff.h"

namespace thicklens::io {
namespace {

namespace fs = std::filesystem;

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
  if (is_whole) return model::ToLinear(ToEncodedImage(image), frame.transfer);
  model::LinearImage light{image.cols, image.rows, image.channels(), {}};
  light.values.reserve(image.total() * static_cast<std::size_t>(image.channels()));
  ForEachValue<float>(image, [&](float value) { light.values.push_back(value); });
  return light;
}

// Returns whether whole numbers can hold the light: neither clipped highlights nor what a prior
// left below black.
bool IsWithinScale(const std::vector<float>& light) {
  const auto [least, most] = std::minmax_element(light.begin(), light.end());
  return *least >= 0 && *most <= 1;
}

// Throws Error unless the disparities are those of the stated views.
void RequireFitting(const std::string& path, const estimator::SceneForm& scene) {
  const model::LightField& frame = scene.frame;
  const Eigen::Vector2d& step = scene.disparity.step;
  Eigen::Vector2d stated(1, 1);
  if (frame.grid) stated = estimator::DisparityOnGrid(*frame.grid, {1e9F}, 1, 1).step;
  constexpr double kRounding = 1e-9;
  if (!((step - stated).norm() <= kRounding * stated.norm())) {
    throw Error(fmt::format(
        "{}: scene.disparity_step is [{:g}, {:g}]: {} make it [{:g}, {:g}]", path, step.x(),
        step.y(), frame.grid ? "the camera and the steps between views" : "views without a camera",
        stated.x(), stated.y()));
  }
  const int size_px = std::max(frame.s_count, frame.t_count);
  const double px_per_unit = step.cwiseAbs().maxCoeff();
  for (const float value : scene.disparity.disparity) {
    if (std::abs(static_cast<double>(value)) * px_per_unit <= size_px) continue;
    throw Error(fmt::format(
        "{}: a disparity is {:.4g} px per view step: it must be within the {} px of a view",
        PathIn(frame.source, model::kSceneDisparityFile), value * px_per_unit, size_px));
  }
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
  RequireFitting(path, scene);
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
  const bool is_whole = IsWithinScale(scene.radiance.values);
  planes.radiance_bits = is_whole ? 16 : 32;
  folder->WriteWith(
      model::kSceneRadianceFile, [&](const std::string& path, const std::string& shown) {
        if (!is_whole) return WriteFloatTiff(scene.radiance, path, shown);
        const model::EncodedImage encoded =
            model::ToEncoded(scene.radiance, model::QuantisedLevels(frame.transfer, 16));
        WriteWholeTiff(encoded.values, frame.s_count, frame.t_count, frame.channels, path, shown);
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
