// The camera and the confidence of a depth map.
#include "thicklens/depth_fit.h"

#include <fmt/format.h>

#include <Eigen/LU>
#include <cmath>
#include <cstddef>
#include <utility>

#include "thicklens/base/input_file.h"
#include "thicklens/base/yaml_reader.h"
#include "thicklens/io/depth_io.h"
#include "tools/interface/validation.h"

namespace thicklens {
namespace {

constexpr char kDepthCameraSchema[] = "thicklens/depth-camera/1";
constexpr int kLargestSide = 100000;

std::vector<double> NumbersOf(const YamlNode& node) {
  std::vector<double> numbers;
  for (const YamlNode& element : node.Elements()) numbers.push_back(element.Number());
  return numbers;
}

model::LensDistortion LensOf(const YamlNode& node) {
  node.RequireKeys(
      {"width_px", "height_px", "focal_length_px", "principal_point_px", "model", "coefficients"});
  model::LensDistortion lens;
  lens.width_px = node.At("width_px").Integer(1, kLargestSide);
  lens.height_px = node.At("height_px").Integer(1, kLargestSide);
  const auto focal = node.At("focal_length_px").ElementsExactly(2);
  const auto centre = node.At("principal_point_px").ElementsExactly(2);
  lens.focal_length_px = {focal[0].PositiveNumber(), focal[1].PositiveNumber()};
  lens.principal_point_px = {centre[0].Number(), centre[1].Number()};
  if (const auto model = node.Find("model")) {
    if (model->OneOf({"opencv", "fisheye"}) == "fisheye")
      lens.model = model::DistortionModel::kFisheye;
  }
  lens.coefficients = {0, 0, 0, 0};
  if (const auto coefficients = node.Find("coefficients"))
    lens.coefficients = NumbersOf(*coefficients);
  std::string why;
  if (!lens.IsValid(&why)) throw node.ErrorHere(why);
  return lens;
}

}  // namespace

bool DepthCamera::IsValid(std::string* why) const {
  std::string reason;
  if (!depth_lens.IsValid(&reason)) return checks::Fail(why, "depth_lens", reason);
  if (!photo_lens.IsValid(&reason)) return checks::Fail(why, "photo_lens", reason);
  if (!translation_mm.allFinite()) {
    return checks::Fail(why, "translation_mm", "three finite numbers are expected");
  }
  // Files state rotations with few digits.
  constexpr double kRounding = 1e-3;
  const Eigen::Matrix3d off = rotation * rotation.transpose() - Eigen::Matrix3d::Identity();
  if (!(off.cwiseAbs().maxCoeff() < kRounding) || !(rotation.determinant() > 0)) {
    return checks::Fail(why, "rotation",
                        "a rotation is expected: three rows of length 1 at right angles, with "
                        "determinant 1");
  }
  return true;
}

DepthCamera ReadDepthCamera(const std::string& path) {
  const YamlNode root = YamlNode::LoadFile(path);
  root.RequireSchema(kDepthCameraSchema);
  root.RequireKeys({"schema", "depth", "photo", "rotation", "translation_mm"});
  DepthCamera camera;
  camera.source = path;
  camera.depth_lens = LensOf(root.At("depth"));
  camera.photo_lens = LensOf(root.At("photo"));
  const auto rotation = root.At("rotation").ElementsExactly(9);
  for (int n = 0; n < 9; ++n)
    camera.rotation(n / 3, n % 3) = rotation[static_cast<std::size_t>(n)].Number();
  const auto translation = root.At("translation_mm").ElementsExactly(3);
  for (int n = 0; n < 3; ++n)
    camera.translation_mm(n) = translation[static_cast<std::size_t>(n)].Number();
  std::string why;
  if (!camera.IsValid(&why)) throw root.ErrorHere(why);
  return camera;
}

bool DepthFit::IsValid(std::string* why) const {
  if (!(min_confidence >= 0 && min_confidence <= 1)) {
    return checks::Unexpected(why, "min_confidence", "a number from 0 to 1", min_confidence);
  }
  if (!checks::OneOf(why, "samples", DepthSamples::kCorner, samples)) return false;
  if (part && (part->width < 1 || part->height < 1)) {
    return checks::Fail(why, "part",
                        fmt::format("a width and a height of at least 1 px are expected, found {} "
                                    "and {}",
                                    part->width, part->height));
  }
  if (part && camera != nullptr) {
    return checks::Fail(why, "part",
                        "the camera of the map states which part of the photograph it shows: only "
                        "one of them can be given");
  }
  std::string reason;
  return camera == nullptr || camera->IsValid(&reason) || checks::Fail(why, "camera", reason);
}

void ReadDepthConfidence(const std::string& path, std::optional<double> full_scale,
                         DepthMap* depth) {
  if (full_scale && !(*full_scale > 0 && std::isfinite(*full_scale))) {
    throw OptionError(
        "full_scale",
        fmt::format("full_scale: a finite number > 0 is expected, found {}", *full_scale));
  }
  io::DepthFile file = io::ReadDepthFile(path);
  model::RawDepthMap& map = file.map;
  if (map.width_px != depth->width_px || map.height_px != depth->height_px) {
    throw Error(fmt::format(
        "{}: it is {}x{} px, but the depth map {} whose confidence it states is "
        "{}x{} px: the sizes must be equal",
        path, map.width_px, map.height_px, depth->source, depth->width_px, depth->height_px));
  }
  const double scale = full_scale.value_or(map.largest_of_type.value_or(1));
  for (float& value : map.values) {
    if (std::isnan(value)) {
      value = 0;
      continue;
    }
    const double confidence = static_cast<double>(value) / scale;
    if (!(confidence >= 0 && confidence <= 1)) {
      throw Error(
          fmt::format("{}: a confidence from 0 to {:g} is expected, found {:g}; another full "
                      "scale must be stated",
                      path, scale, value));
    }
    value = static_cast<float>(confidence);
  }
  model::FlipDepth(depth->flip, map.width_px, &map.values);
  depth->confidence = std::move(map.values);
}

}  // namespace thicklens
