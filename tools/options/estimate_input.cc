#include "tools/options/estimate_input.h"

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <optional>
#include <string>
#include <utility>

#include "thicklens/base/error.h"
#include "thicklens/estimator/depth_noise.h"
#include "thicklens/estimator/estimate_checks.h"
#include "thicklens/io/depth_io.h"
#include "thicklens/io/image_io.h"
#include "thicklens/model/camera_file.h"
#include "thicklens/model/light_field.h"
#include "tools/options/command_frame.h"
#include "tools/options/exif_check.h"
#include "tools/options/light_field_effects.h"
#include "tools/options/option_values.h"
#include "tools/options/with_file_context.h"

namespace thicklens::tools {
namespace {

model::EncodedImage ReadPhoto(const std::string& path) {
  const model::EncodedImage image = io::ToEncodedImage(io::ReadImageFile(path));
  if (image.channels == 4) spdlog::warn("{}: its alpha channel is ignored", path);
  return io::WithoutAlpha(image);
}

// Returns the camera of an image, which may be a part of its sensor, restricted to the crop.
std::optional<model::Camera> CameraFor(const EstimateOptions& options, int width_px, int height_px,
                                       const std::optional<model::PixelRect>& crop,
                                       nlohmann::json* exif) {
  if (options.camera_path.empty()) return std::nullopt;
  model::Camera camera = model::ReadCamera(options.camera_path);
  if (!options.transfer.empty())
    camera.sensor.transfer = model::TransferCurve::FromName(options.transfer);
  ReportAssumedFields(camera);
  *exif =
      RequireSameCamera(options.image_path, options.camera_path, camera,
                        {width_px, height_px, !options.sensor_origin.empty()}, options.ignore_exif);
  if (!options.sensor_origin.empty()) {
    const auto origin = SplitPixels("--sensor-origin", options.sensor_origin, ',', "X,Y");
    if (origin.size() != 2) {
      throw UsageError(
          fmt::format("--sensor-origin: X,Y is expected, found '{}'", options.sensor_origin));
    }
    const model::PixelRect part{origin[0], origin[1], width_px, height_px};
    camera = WithFileContext("--sensor-origin: " + options.camera_path,
                             [&] { return model::CropCamera(camera, part); });
  } else if (camera.sensor.width_px != width_px || camera.sensor.height_px != height_px) {
    throw Error(
        fmt::format("{}: the image is {}x{} px, the sensor of {} has {}x{} px: they must be "
                    "equal, or --sensor-origin must state which part of the sensor the image is",
                    options.image_path, width_px, height_px, options.camera_path,
                    camera.sensor.width_px, camera.sensor.height_px));
  }
  return crop ? model::CropCamera(camera, *crop) : camera;
}

// UV lies on the aperture, where each view has one transmission; ST lies in the plane of focus
// unless a depth is given.
model::LightFieldGrid GridFor(const EstimateOptions& options, const model::Camera& camera,
                              const Eigen::ArrayXXd& weights) {
  const model::ApertureSamples samples =
      model::SampleAperture(weights, camera.blur_ratio(), camera.lens.aperture_radius_mm);
  const double st_depth_mm = options.st_depth_mm.value_or(camera.focus_depth_mm());
  if (std::isinf(st_depth_mm)) {
    throw Error(
        fmt::format("{}: the camera is focused at infinity, where no ST plane can lie: "
                    "--st-depth-mm must give its depth",
                    options.camera_path));
  }
  return model::GridOnPlanes(camera, {0, st_depth_mm}, samples);
}

// Crops image and depth alike. If only one of them has the crop's size, it was cropped before.
void CutToCrop(const EstimateOptions& options, const std::optional<model::PixelRect>& crop,
               model::EncodedImage* image, model::RawDepthMap* map) {
  if (!crop) return;
  const auto was_cut = [&](int width_px, int height_px, const std::string& path) {
    const bool cut = width_px == crop->width && height_px == crop->height &&
                     (image->width_px != map->width_px || image->height_px != map->height_px);
    if (cut) spdlog::warn("{}: has the size of --crop already and is not cropped", path);
    return cut;
  };
  const bool cut_image = !was_cut(image->width_px, image->height_px, options.image_path);
  const bool cut_map = !was_cut(map->width_px, map->height_px, options.depth_path);
  if (cut_image) {
    *image = WithFileContext("--crop: " + options.image_path,
                             [&] { return model::CropImage(*image, *crop); });
  }
  if (cut_map) {
    *map = WithFileContext("--crop: " + options.depth_path,
                           [&] { return model::CropDepth(*map, *crop); });
  }
}

// Warns of a median depth far from the focused one: it is possible, but more often the unit is
// wrong.
void ReportUnlikelyDepth(const EstimateOptions& options, const model::Camera& camera,
                         const model::DepthStatistics& depth) {
  constexpr double kDefault = 4;
  const double focus_depth_mm = camera.focus_depth_mm();
  if (std::isinf(focus_depth_mm)) return;  // every depth is far from infinity
  if (depth.median_mm <= kDefault * focus_depth_mm &&
      depth.median_mm >= focus_depth_mm / kDefault) {
    return;
  }
  spdlog::warn(
      "{}: the median depth is {:.6g} mm, but the camera is focused at {:.6g} mm; is --depth-unit "
      "right?",
      options.depth_path, depth.median_mm, focus_depth_mm);
}

// Returns how light became encoded values. If nothing states it, sRGB is assumed and reported.
model::TransferCurve TransferFor(const EstimateOptions& options,
                                 const std::optional<model::Camera>& camera) {
  if (camera) return camera->sensor.transfer;
  if (!options.transfer.empty()) return model::TransferCurve::FromName(options.transfer);
  spdlog::info("{}: encoded values are assumed to be sRGB (--transfer)", options.image_path);
  return model::TransferCurve::Srgb();
}

void CheckViewCounts(const Eigen::ArrayXXd& weights) {
  if (weights.size() < 2) {
    throw Error(
        "--views: 1x1 is not a light field: one view is the image itself; at least two views are "
        "expected, e.g. 3x3");
  }
  for (const auto& [count, axis] :
       {std::pair{weights.cols(), "u (across)"}, std::pair{weights.rows(), "v (down)"}}) {
    if (count == 1)
      spdlog::warn("--views: one view along {}: no blur is modelled in that direction", axis);
  }
}

// A disparity as large as the image does not occur in a scene.
void CheckDisparities(const EstimateOptions& options, const estimator::DisparityMap& map) {
  const auto [low_px, high_px] = DisparityRangePx(map);
  const int size_px = std::max(map.width_px, map.height_px);
  if (std::max(std::abs(low_px), std::abs(high_px)) <= size_px) return;
  throw Error(
      fmt::format("{}: disparities from {:.4g} to {:.4g} px per view step, but they must be within "
                  "the {} px of the image; {}",
                  options.depth_path, low_px, high_px, size_px,
                  options.depth.kind == "disparity"
                      ? "are --disparity-scale and --disparity-offset right?"
                      : "are --depth-unit, and the camera's aperture and focus, right?"));
}

void SmoothNoisyDepth(const EstimateOptions& options, PreparedEstimate* prepared) {
  estimator::DisparityMap& disparity = prepared->input.disparity;
  prepared->depth_noise_px = estimator::DepthNoisePx(disparity);
  if (options.keep_depth_noise || !prepared->depth_noise_px ||
      !(*prepared->depth_noise_px > estimator::kSmoothedNoisePx)) {
    return;
  }
  estimator::SmoothedDepth smoothed =
      estimator::SmoothDepth(disparity, *prepared->depth_noise_px, options.common.threads);
  disparity = std::move(smoothed.map);
  prepared->depth_noise_left_px = smoothed.noise_left_px;
}

}  // namespace

std::pair<double, double> DisparityRangePx(const estimator::DisparityMap& map) {
  const auto [least, most] = std::minmax_element(map.disparity.begin(), map.disparity.end());
  const double step = map.step.x() != 0 ? map.step.x() : map.step.y();
  return std::minmax({static_cast<double>(*least) * step, static_cast<double>(*most) * step});
}

PreparedEstimate PrepareEstimate(const EstimateOptions& options) {
  const auto crop = CropRect(options.crop);
  model::EncodedImage stored = ReadPhoto(options.image_path);
  model::RawDepthMap map = io::ReadDepthMap(options.depth_path);
  const int full_width_px = std::max(stored.width_px, map.width_px);
  const int full_height_px = std::max(stored.height_px, map.height_px);
  CutToCrop(options, crop, &stored, &map);
  if (map.width_px != stored.width_px || map.height_px != stored.height_px) {
    throw Error(fmt::format("{}: it is {}x{} px, the image {} is {}x{} px: the sizes must be equal",
                            options.depth_path, map.width_px, map.height_px, options.image_path,
                            stored.width_px, stored.height_px));
  }
  PreparedEstimate prepared;
  estimator::EstimateInput& input = prepared.input;
  input.camera = CameraFor(options, full_width_px, full_height_px, crop, &prepared.exif);
  input.transfer = TransferFor(options, input.camera);
  input.image = model::ToLinear(stored, input.transfer);
  prepared.aperture = ApertureFor(options, input.camera ? &*input.camera : nullptr);
  input.weights = prepared.aperture.weights;
  CheckViewCounts(input.weights);
  if (input.camera) {
    input.grid = GridFor(options, *input.camera, input.weights);
    WarnOfOtherSteps(options, prepared.aperture, *input.grid, *input.camera);
  }
  prepared.depth =
      PrepareDepth(map, options.depth_path, options.depth, input.image,
                   input.camera ? &*input.camera : nullptr, input.grid ? &*input.grid : nullptr);
  input.disparity = std::move(prepared.depth.disparity);
  if (prepared.depth.depth && options.depth.kind != "disparity") {
    ReportUnlikelyDepth(options, *input.camera, *prepared.depth.depth);
  }
  CheckDisparities(options, input.disparity);
  SmoothNoisyDepth(options, &prepared);
  prepared.effects = DecideEstimateEffects(options, input.camera, prepared.depth.depth);
  if (input.camera && !prepared.effects.on.Has(model::Effect::kThickness)) {
    input.falloff_camera = model::ThinLensEquivalent(*input.camera);
  }
  if (input.grid) {
    const bool falloff = prepared.effects.on.Has(model::Effect::kFalloff);
    prepared.aperture_blur = estimator::MeasureApertureBlur(
        *input.grid, *input.camera, input.weights, falloff ? &input.camera_of_falloff() : nullptr);
  }
  return prepared;
}

}  // namespace thicklens::tools
