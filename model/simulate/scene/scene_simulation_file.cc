#include <fmt/format.h>

#include <limits>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "model/schema/effect_yaml.h"
#include "model/schema/renamed_keys.h"
#include "model/schema/yaml_fields.h"
#include "model/schema/yaml_writer.h"
#include "model/simulate/simulated_camera.h"
#include "thicklens/base/yaml_reader.h"
#include "thicklens/model/camera_file.h"
#include "thicklens/model/scene_simulator.h"

namespace thicklens::model {
namespace {

constexpr char kSchema[] = "thicklens/simulate-scene/1";
constexpr char kTruthSchema[] = "thicklens/scene-truth/1";

// The truth of the simulation is the camera's calibration with the values of `truth` in place of
// its own. The evidence of the calibration no longer applies.
void ReadTruth(const YamlNode& node, Camera* camera) {
  node.RequireKeys({"focus_depth_mm", "blur_ratio", "blur_floor_px"});
  CameraCalibration truth;
  if (camera->calibration) {
    truth.image_distance_mm = camera->calibration->image_distance_mm;
    truth.blur_ratio = camera->calibration->blur_ratio;
    truth.blur_floor_px = camera->calibration->blur_floor_px;
  }
  ReadTruthValues(node, camera->lens, &truth);
  truth.evidence.method = "simulated";
  camera->calibration = std::move(truth);
}

PlaneOptions ReadPlane(const YamlNode& node) {
  node.RequireKeys({"depth_mm", "slope"});
  PlaneOptions plane;
  plane.depth_mm = node.At("depth_mm").PositiveNumber();
  if (const auto slope = node.Find("slope")) plane.slope = ReadPair(*slope);
  return plane;
}

DepthMapOptions ReadDepth(const YamlNode& node) {
  node.RequireKeys({"map", "kind", "unit"});
  DepthMapOptions depth;
  depth.map_path = node.ResolvePath(node.At("map").Text());
  depth.convention.kind = DepthKindFromName(node.At("kind").OneOf({"z", "range"}));
  depth.convention.unit_mm = DepthUnitMm(node.At("unit").OneOf({"mm", "cm", "m", "tum5000"}));
  return depth;
}

// A rectangle or a disc is in px of the image or in mm, as its keys say. A mask has no other keys.
OutlineOptions ReadOutline(const YamlNode& node) {
  OutlineOptions outline;
  if (const auto mask = node.Find("mask")) {
    node.RequireKeys({"mask"});
    outline.shape = OutlineOptions::Shape::kMask;
    outline.mask_path = node.ResolvePath(mask->Text());
    return outline;
  }
  node.RequireKeys(
      {"centre_px", "centre_mm", "size_px", "size_mm", "radius_px", "radius_mm", "mask"});
  const bool in_mm = node.Has("centre_mm");
  const std::string unit = in_mm ? "_mm" : "_px";
  const std::string other = in_mm ? "_px" : "_mm";
  for (const char* key : {"centre", "size", "radius"}) {
    if (const auto wrong = node.Find(key + other)) {
      throw wrong->ErrorHere(fmt::format("the outline is given in {}: this key must be {}{}",
                                         unit.substr(1), key, unit));
    }
  }
  outline.unit = in_mm ? OutlineOptions::Unit::kMm : OutlineOptions::Unit::kPx;
  outline.centre = ReadPair(node.At("centre" + unit));
  const auto size = node.Find("size" + unit);
  const auto radius = node.Find("radius" + unit);
  if (size.has_value() == radius.has_value()) {
    throw node.ErrorHere(fmt::format(
        "exactly one of size{0} (a rectangle) and radius{0} (a disc) is expected, found {1}", unit,
        size ? "both" : "none"));
  }
  if (size) {
    outline.shape = OutlineOptions::Shape::kRectangle;
    outline.size = ReadPair(*size);
  } else {
    outline.shape = OutlineOptions::Shape::kDisc;
    outline.radius = radius->PositiveNumber();
  }
  return outline;
}

TextureKind ReadKind(const YamlNode& node, std::vector<std::string>* notices) {
  return ReadNamed<TextureKind>(
      node,
      {TextureKind::kUniform, TextureKind::kSine, TextureKind::kEdge, TextureKind::kCheckerboard,
       TextureKind::kSiemensStar, TextureKind::kDeadLeaves, TextureKind::kNoise,
       TextureKind::kImage},
      TextureKindName, RenamedImage(), notices);
}

// Each kind accepts only the keys that apply to it.
std::vector<std::string> TextureKeys(TextureKind kind) {
  switch (kind) {
    case TextureKind::kUniform:
      return {"kind", "colour"};
    case TextureKind::kSine:
    case TextureKind::kEdge:
      return {"kind", "colour", "contrast", "feature_size_px", "angle_deg"};
    case TextureKind::kCheckerboard:
    case TextureKind::kSiemensStar:
      return {"kind", "colour", "contrast", "feature_size_px"};
    case TextureKind::kDeadLeaves:
    case TextureKind::kNoise:
      return {"kind", "colour", "contrast", "saturation", "feature_size_px"};
    case TextureKind::kImage:
      break;
  }
  return {"kind", "image", "feature_size_px"};
}

TextureOptions ReadTexture(const YamlNode& node, std::vector<std::string>* notices) {
  TextureOptions texture;
  texture.kind = ReadKind(node.At("kind"), notices);
  std::vector<RenamedWord> renamed;
  if (texture.kind == TextureKind::kImage) renamed.push_back(RenamedImage());
  node.RequireKeys(TextureKeys(texture.kind), renamed);
  if (const auto colour = node.Find("colour")) {
    const auto channels = colour->ElementsExactly(3);
    for (int c = 0; c < 3; ++c) {
      texture.colour(c) = channels[static_cast<std::size_t>(c)].Number();
    }
  }
  ReadNumber(node, "contrast", &texture.contrast);
  ReadNumber(node, "saturation", &texture.saturation);
  ReadNumber(node, "feature_size_px", &texture.feature_size_px);
  ReadNumber(node, "angle_deg", &texture.angle_deg);
  if (texture.kind == TextureKind::kImage) {
    const auto image = node.Find(RenamedImage(), notices);
    texture.image_path = node.ResolvePath(image ? image->Text() : node.At("image").Text());
  }
  return texture;
}

GlossOptions ReadGloss(const YamlNode& node) {
  node.RequireKeys({"depth_mm", "centre_px", "sigma_px", "strength"});
  return {node.At("depth_mm").PositiveNumber(), ReadPair(node.At("centre_px")),
          node.At("sigma_px").PositiveNumber(), node.At("strength").NonNegativeNumber()};
}

SceneLayer ReadLayer(const YamlNode& node, std::vector<std::string>* notices) {
  node.RequireKeys({"name", "plane", "depth", "outline", "texture", "gloss"});
  SceneLayer layer;
  if (const auto name = node.Find("name")) layer.name = name->Text();
  if (const auto depth = node.Find("depth")) {
    if (const auto plane = node.Find("plane")) {
      throw plane->ErrorHere(
          "the layer also has 'depth': either 'plane' or 'depth' is expected, not both");
    }
    layer.depth = ReadDepth(*depth);
  } else {
    layer.plane = ReadPlane(node.At("plane"));
  }
  if (const auto outline = node.Find("outline")) layer.outline = ReadOutline(*outline);
  layer.texture = ReadTexture(node.At("texture"), notices);
  if (const auto gloss = node.Find("gloss")) {
    for (const YamlNode& image : gloss->Elements()) layer.gloss.push_back(ReadGloss(image));
  }
  return layer;
}

}  // namespace

SceneSimulationOptions ReadSceneSimulation(const std::string& path) {
  const YamlNode root = YamlNode::LoadFile(path);
  root.RequireSchema(kSchema);
  root.RequireKeys({"schema", "camera", "truth", "size_px", "layers", "effects", "without",
                    "tolerance", "sampling_error_grey_levels", "rays_per_pixel", "wavelength_nm",
                    "full_well_electrons", "read_noise_electrons", "noise_sigma_grey_levels",
                    "bits", "views", "uv_depth_mm", "seed"});
  constexpr int kAny = std::numeric_limits<int>::max();  // IsValid checks the upper bound
  SceneSimulationOptions options;
  options.camera = ReadCamera(root.ResolvePath(root.At("camera").Text()));
  TakeOutDistortion(&options.camera, &options.notices);
  if (const auto truth = root.Find("truth")) ReadTruth(*truth, &options.camera);
  if (const auto size = root.Find("size_px")) options.camera = ReadCrop(*size, options.camera);
  for (const YamlNode& layer : root.At("layers").Elements()) {
    options.layers.push_back(ReadLayer(layer, &options.notices));
  }
  ReadEffectSelectionOptions(root, &options.effects);
  if (const auto rays = root.Find("rays_per_pixel"))
    options.rays_per_pixel = rays->Integer(1, kAny);
  if (const auto wavelength = root.Find("wavelength_nm")) {
    options.wavelength_mm = wavelength->PositiveNumber() * 1e-6;
  }
  ReadNumber(root, "sampling_error_grey_levels", &options.sampling_error_grey_levels);
  ReadNumber(root, "full_well_electrons", &options.full_well_electrons);
  ReadNumber(root, "read_noise_electrons", &options.read_noise_electrons);
  ReadNumber(root, "noise_sigma_grey_levels", &options.noise_sigma_grey_levels);
  if (const auto bits = root.Find("bits")) options.bits = bits->Integer(8, 16);
  if (const auto views = root.Find("views")) {
    const auto counts = views->ElementsExactly(2);
    options.u_count = counts[0].Integer(1, kAny);
    options.v_count = counts[1].Integer(1, kAny);
  }
  ReadNumber(root, "uv_depth_mm", &options.uv_depth_mm);
  if (const auto seed = root.Find("seed")) {
    options.seed = static_cast<std::uint64_t>(seed->Integer(0, kAny));
  }
  std::string why;
  if (!options.IsValid(&why)) throw root.ErrorHere(why);
  return options;
}

std::string SceneTruthToYaml(const SceneTruth& truth) {
  YamlWriter out(kTruthSchema);
  out.Number("image_distance_mm", truth.image_distance_mm);
  out.Number("focus_depth_mm", truth.focus_depth_mm);
  out.Number("blur_ratio", truth.blur_ratio);
  out.Number("blur_floor_px", truth.blur_floor_px);
  out.Number("nearest_depth_mm", truth.nearest_depth_mm);
  out.Number("farthest_depth_mm", truth.farthest_depth_mm);
  out.Number("largest_blur_sigma_px", truth.largest_blur_sigma_px);
  WriteEffects(truth.effects, &out);
  out.Number("sampling_error_grey_levels", truth.sampling_error_grey_levels);
  out.Text("seed", std::to_string(truth.seed));
  return out.Finish();
}

}  // namespace thicklens::model
