#include "thicklens/model/light_field.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "thicklens/base/error.h"
#include "thicklens/base/validity.h"
#include "thicklens/model/light_field_description.h"

namespace thicklens::model {
namespace {

constexpr double kWeightSumTolerance = 1e-6;

// Returns the error of the weights, or an empty text if they are valid.
std::string WeightComplaint(const LightField& light_field) {
  const Eigen::ArrayXXd& weights = light_field.weights;
  if (weights.rows() != light_field.v_count || weights.cols() != light_field.u_count) {
    return fmt::format(
        "weights: {} rows of {} numbers for {}x{} views: one row is needed for each v, with one "
        "number for each u",
        weights.rows(), weights.cols(), light_field.u_count, light_field.v_count);
  }
  for (Eigen::Index l = 0; l < weights.rows(); ++l) {
    for (Eigen::Index k = 0; k < weights.cols(); ++k) {
      if (!(weights(l, k) >= 0) || !std::isfinite(weights(l, k))) {
        return fmt::format("weights: the weight of view ({}, {}) is {}: it must be finite and >= 0",
                           k, l, weights(l, k));
      }
    }
  }
  if (!(std::abs(weights.sum() - 1) <= kWeightSumTolerance)) {
    return fmt::format("weights: their sum is {}: it must be 1", weights.sum());
  }
  return "";
}

// Returns the error of the grid and the camera, or an empty text if they are valid.
std::string GridComplaint(const LightField& light_field) {
  if (light_field.grid.has_value() != light_field.camera.has_value()) {
    return light_field.grid
               ? "grid: a grid is given without a camera: both or neither must be given"
               : "camera: a camera is given without a grid: both or neither must be given";
  }
  if (!light_field.grid) return "";
  const LightFieldGrid& grid = *light_field.grid;
  std::string why;
  if (!grid.IsValid(&why)) return "grid: " + why;
  if (grid.s_count != light_field.s_count || grid.t_count != light_field.t_count ||
      grid.u_count != light_field.u_count || grid.v_count != light_field.v_count) {
    return fmt::format(
        "grid: it has {}x{} views of {}x{} samples, but the light field has {}x{} views of {}x{} "
        "samples: the counts must be equal",
        grid.u_count, grid.v_count, grid.s_count, grid.t_count, light_field.u_count,
        light_field.v_count, light_field.s_count, light_field.t_count);
  }
  const Sensor& sensor = light_field.camera->sensor;
  if (sensor.width_px != light_field.s_count || sensor.height_px != light_field.t_count) {
    return fmt::format(
        "camera: its sensor has {}x{} px, but a view has {}x{} px: the sizes must be equal",
        sensor.width_px, sensor.height_px, light_field.s_count, light_field.t_count);
  }
  return "";
}

// Returns the error of all members but the values, or an empty text if they are valid.
std::string DescriptionComplaint(const LightField& light_field) {
  const struct {
    const char* name;
    int value;
  } counts[] = {{"s_count", light_field.s_count},
                {"t_count", light_field.t_count},
                {"u_count", light_field.u_count},
                {"v_count", light_field.v_count}};
  for (const auto& count : counts) {
    if (count.value < 1) return fmt::format("{} is {}: it must be >= 1", count.name, count.value);
  }
  if (light_field.channels < 1) {
    return fmt::format("channels is {}: it must be >= 1", light_field.channels);
  }
  const auto views = static_cast<std::size_t>(light_field.u_count * light_field.v_count);
  if (!light_field.present.empty()) {
    if (light_field.present.size() != views) {
      return fmt::format(
          "present: {} entries for {} views: there must be one entry for each view, or none at all",
          light_field.present.size(), views);
    }
    if (std::none_of(light_field.present.begin(), light_field.present.end(),
                     [](bool there) { return there; })) {
      return "present: no view is present: at least one is needed";
    }
  }
  if (!light_field.landing_step_px.allFinite()) {
    return fmt::format("landing_step_px is ({}, {}): it must be finite",
                       light_field.landing_step_px.x(), light_field.landing_step_px.y());
  }
  const std::string weights = WeightComplaint(light_field);
  return weights.empty() ? GridComplaint(light_field) : weights;
}

std::string Complaint(const LightField& light_field) {
  std::string of_description = DescriptionComplaint(light_field);
  if (!of_description.empty()) return of_description;
  const std::size_t expected = light_field.ViewStart(light_field.channels, 0, 0);
  if (light_field.values.size() != expected) {
    return fmt::format(
        "values: {} values for {}x{} views of {}x{} samples in {} channels: {} are needed",
        light_field.values.size(), light_field.u_count, light_field.v_count, light_field.s_count,
        light_field.t_count, light_field.channels, expected);
  }
  return "";
}

void RequireView(const LightField& light_field, int k, int l) {
  if (k >= 0 && k < light_field.u_count && l >= 0 && l < light_field.v_count) return;
  throw Error(fmt::format("view ({}, {}) does not exist: u must be from 0 to {}, v from 0 to {}", k,
                          l, light_field.u_count - 1, light_field.v_count - 1));
}

// Index of the first of the `inner` central views of `all`.
int FirstInner(const char* name, int inner, int all) {
  if (inner < 1 || inner > all || (all - inner) % 2 != 0) {
    throw Error(
        fmt::format("{} inner views in {} of {}: the count must be from 1 to {}, and {} like the "
                    "count of all views, so that the middle stays the same",
                    inner, name, all, all, all % 2 == 0 ? "even" : "odd"));
  }
  return (all - inner) / 2;
}

// Throws Error if the rectangle is empty or not inside. `what` is the name in the message.
void RequireInside(const std::string& what, const PixelRect& rect, int width_px, int height_px) {
  // The differences cannot overflow once the corner is inside.
  const bool inside = rect.x >= 0 && rect.y >= 0 && rect.width >= 1 && rect.height >= 1 &&
                      rect.x < width_px && rect.y < height_px && rect.width <= width_px - rect.x &&
                      rect.height <= height_px - rect.y;
  if (inside) return;
  const bool may_fit =
      rect.width >= 1 && rect.height >= 1 && rect.width <= width_px && rect.height <= height_px;
  const std::string right =
      may_fit ? fmt::format("with this size, x must be from 0 to {} and y from 0 to {}",
                            width_px - rect.width, height_px - rect.height)
              : fmt::format("its width must be from 1 to {} and its height from 1 to {}", width_px,
                            height_px);
  throw Error(fmt::format(
      "the rectangle {},{},{},{} (x, y, width, height) is not inside the {} of {}x{} px: {}",
      rect.x, rect.y, rect.width, rect.height, what, width_px, height_px, right));
}

// Cuts the rectangle out of rows of `width_px` pixels of `channels` values each.
template <typename T>
std::vector<T> CutOut(const std::vector<T>& values, int width_px, int channels,
                      const PixelRect& rect) {
  std::vector<T> cut;
  const auto run = static_cast<std::ptrdiff_t>(rect.width) * channels;
  cut.reserve(static_cast<std::size_t>(run) * static_cast<std::size_t>(rect.height));
  for (int y = rect.y; y < rect.y + rect.height; ++y) {
    const auto first =
        values.begin() + (static_cast<std::ptrdiff_t>(y) * width_px + rect.x) * channels;
    cut.insert(cut.end(), first, first + run);
  }
  return cut;
}

}  // namespace

bool LightField::IsValid(std::string* why) const {
  std::string complaint = Complaint(*this);
  if (complaint.empty()) return true;
  return Fail(why, std::move(complaint));
}

bool IsValidDescription(const LightField& light_field, std::string* why) {
  std::string complaint = DescriptionComplaint(light_field);
  return complaint.empty() || Fail(why, std::move(complaint));
}

LightField MakeLightField(int s_count, int t_count, int u_count, int v_count, int channels) {
  LightField light_field;
  light_field.s_count = s_count;
  light_field.t_count = t_count;
  light_field.u_count = u_count;
  light_field.v_count = v_count;
  light_field.channels = channels;
  if (s_count >= 1 && t_count >= 1 && u_count >= 1 && v_count >= 1 && channels >= 1) {
    light_field.weights = ApertureWeights(ApertureShape::kUniform, u_count, v_count);
    light_field.values.assign(light_field.ViewStart(channels, 0, 0), 0.0F);
  }
  std::string why;
  if (!light_field.IsValid(&why)) throw Error("light field: " + why);
  return light_field;
}

LightField DescriptionOf(const LightField& light_field) {
  LightField description;
  description.s_count = light_field.s_count;
  description.t_count = light_field.t_count;
  description.u_count = light_field.u_count;
  description.v_count = light_field.v_count;
  description.channels = light_field.channels;
  description.weights = light_field.weights;
  description.present = light_field.present;
  description.landing_step_px = light_field.landing_step_px;
  description.transfer = light_field.transfer;
  description.colour_profile = light_field.colour_profile;
  description.grid = light_field.grid;
  description.camera = light_field.camera;
  description.origin = light_field.origin;
  description.source = light_field.source;
  return description;
}

LinearImage ViewImage(const LightField& light_field, int k, int l) {
  RequireView(light_field, k, l);
  LinearImage image{light_field.s_count, light_field.t_count, light_field.channels, {}};
  const std::size_t pixels = light_field.view_size();
  const auto channels = static_cast<std::size_t>(light_field.channels);
  image.values.resize(pixels * channels);
  for (int channel = 0; channel < light_field.channels; ++channel) {
    const float* plane = light_field.values.data() + light_field.ViewStart(channel, k, l);
    float* value = image.values.data() + channel;
    for (std::size_t i = 0; i < pixels; ++i) value[i * channels] = plane[i];
  }
  return image;
}

void SetView(LightField* light_field, int k, int l, const LinearImage& image) {
  RequireView(*light_field, k, l);
  const std::size_t pixels = light_field->view_size();
  const auto channels = static_cast<std::size_t>(light_field->channels);
  if (image.width_px != light_field->s_count || image.height_px != light_field->t_count ||
      image.channels != light_field->channels || image.values.size() != pixels * channels) {
    throw Error(
        fmt::format("view ({}, {}): the image has {}x{} px in {} channels, but the light field "
                    "has views of {}x{} px in {} channels: these must be equal",
                    k, l, image.width_px, image.height_px, image.channels, light_field->s_count,
                    light_field->t_count, light_field->channels));
  }
  for (int channel = 0; channel < light_field->channels; ++channel) {
    float* plane = light_field->values.data() + light_field->ViewStart(channel, k, l);
    const float* value = image.values.data() + channel;
    for (std::size_t i = 0; i < pixels; ++i) plane[i] = value[i * channels];
  }
  if (light_field->present.empty()) return;
  light_field->present[static_cast<std::size_t>(l * light_field->u_count + k)] = true;
}

LightField InnerViews(const LightField& light_field, int u_count, int v_count) {
  const int first_k = FirstInner("u", u_count, light_field.u_count);
  const int first_l = FirstInner("v", v_count, light_field.v_count);
  LightField inner = DescriptionOf(light_field);
  inner.u_count = u_count;
  inner.v_count = v_count;
  if (inner.grid) {
    inner.grid->u_count = u_count;
    inner.grid->v_count = v_count;
  }
  inner.weights = light_field.weights.block(first_l, first_k, v_count, u_count);
  if (!(inner.weights.sum() > 0)) {
    throw Error(
        fmt::format("the {}x{} inner views all have the weight 0: at least one weight must be > 0",
                    u_count, v_count));
  }
  inner.weights /= inner.weights.sum();
  inner.present.clear();
  if (!light_field.present.empty()) {
    for (int l = 0; l < v_count; ++l) {
      for (int k = 0; k < u_count; ++k)
        inner.present.push_back(light_field.IsPresent(first_k + k, first_l + l));
    }
  }
  if (light_field.values.empty()) return inner;  // a description
  inner.values.reserve(inner.ViewStart(inner.channels, 0, 0));
  for (int channel = 0; channel < inner.channels; ++channel) {
    for (int l = 0; l < v_count; ++l) {
      const auto first =
          light_field.values.begin() +
          static_cast<std::ptrdiff_t>(light_field.ViewStart(channel, first_k, first_l + l));
      const auto run = static_cast<std::ptrdiff_t>(inner.view_size()) * u_count;
      inner.values.insert(inner.values.end(), first, first + run);
    }
  }
  return inner;
}

LightField CropViews(const LightField& light_field, const PixelRect& rect) {
  RequireInside("views", rect, light_field.s_count, light_field.t_count);
  LightField cropped = DescriptionOf(light_field);
  cropped.s_count = rect.width;
  cropped.t_count = rect.height;
  if (cropped.grid) {
    cropped.grid->s_count = rect.width;
    cropped.grid->t_count = rect.height;
    cropped.grid->st_origin_index -= Eigen::Vector2d(rect.x, rect.y);
  }
  if (cropped.camera) cropped.camera = CropCamera(*light_field.camera, rect);
  if (light_field.values.empty()) return cropped;  // a description
  cropped.values.reserve(cropped.ViewStart(cropped.channels, 0, 0));
  const int planes = light_field.channels * light_field.u_count * light_field.v_count;
  for (int plane = 0; plane < planes; ++plane) {
    for (int t = rect.y; t < rect.y + rect.height; ++t) {
      const auto first =
          light_field.values.begin() +
          static_cast<std::ptrdiff_t>(static_cast<std::size_t>(plane) * light_field.view_size()) +
          static_cast<std::ptrdiff_t>(t) * light_field.s_count + rect.x;
      cropped.values.insert(cropped.values.end(), first, first + rect.width);
    }
  }
  return cropped;
}

LinearImage CropImage(const LinearImage& image, const PixelRect& rect) {
  RequireInside("image", rect, image.width_px, image.height_px);
  return {rect.width, rect.height, image.channels,
          CutOut(image.values, image.width_px, image.channels, rect)};
}

EncodedImage CropImage(const EncodedImage& image, const PixelRect& rect) {
  RequireInside("image", rect, image.width_px, image.height_px);
  return {rect.width, rect.height, image.channels, image.bits,
          CutOut(image.values, image.width_px, image.channels, rect)};
}

RawDepthMap CropDepth(const RawDepthMap& map, const PixelRect& rect) {
  RequireInside("depth map", rect, map.width_px, map.height_px);
  return {rect.width, rect.height, CutOut(map.values, map.width_px, 1, rect), map.integer,
          map.largest_of_type};
}

Camera CropCamera(const Camera& camera, const PixelRect& rect) {
  RequireInside("sensor", rect, camera.sensor.width_px, camera.sensor.height_px);
  Camera cropped = camera;
  if (camera.distortion) {
    cropped.distortion =
        camera.distortion->ScaledTo(camera.sensor.width_px, camera.sensor.height_px)
            .OfPart(rect.x, rect.y, rect.width, rect.height);
  }
  cropped.sensor.width_px = rect.width;
  cropped.sensor.height_px = rect.height;
  cropped.sensor.principal_point_px -= Eigen::Vector2d(rect.x, rect.y);
  return cropped;
}

}  // namespace thicklens::model
