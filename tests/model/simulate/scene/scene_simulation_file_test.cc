#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <string>
#include <utility>
#include <vector>

#include "support/error_message.h"
#include "support/temporary_folder.h"
#include "thicklens/base/yaml_reader.h"
#include "thicklens/model/camera_file.h"
#include "thicklens/model/scene_simulator.h"

namespace thicklens::model {
namespace {

using ::testing::HasSubstr;
using thicklens::testing::ErrorOf;
using thicklens::testing::TemporaryFolder;

const char kHead[] =
    "schema: thicklens/simulate-scene/1\n"
    "camera: camera.yaml\n";
const char kTruth[] = "truth: {focus_depth_mm: 300, blur_ratio: 0.4}\n";
const char kLayers[] = "layers:\n- {plane: {depth_mm: 310}, texture: {kind: dead-leaves}}\n";

class SceneSimulationFileTest : public ::testing::Test {
 protected:
  void SetUp() override { PutCamera(""); }

  void PutCamera(const std::string& calibration) {
    folder_.Put("camera.yaml",
                "schema: thicklens/camera/2\n"
                "name: macro\n"
                "lens: {front_focal_length_mm: 50, rear_focal_length_mm: 50, "
                "lens_thickness_mm: 0, aperture_radius_mm: 9}\n"
                "sensor: {width_px: 640, height_px: 481, pixel_pitch_mm: 0.0045, "
                "principal_point_px: [321.5, 240], transfer: srgb}\n"
                "psf: disc\n" +
                    calibration);
  }

  SceneSimulationOptions Read(const std::string& text) const {
    return ReadSceneSimulation(folder_.Put("scene.yaml", text));
  }
  std::string MessageOf(const std::string& text) const {
    return ErrorOf([&] { Read(text); });
  }

  TemporaryFolder folder_;
};

TEST_F(SceneSimulationFileTest, ReadsEveryField) {
  const SceneSimulationOptions options =
      Read(std::string(kHead) +
           "truth: {focus_depth_mm: 300, blur_ratio: 0.4, blur_floor_px: 0.6}\n"
           "size_px: [400, 301]\n"
           "layers:\n"
           "- name: wall\n"
           "  plane: {depth_mm: 310, slope: [0.5, -0.25]}\n"
           "  texture: {kind: image, image: wall.png, feature_size_px: 500}\n"
           "- plane: {depth_mm: 290}\n"
           "  outline: {centre_px: [10, 20.5], size_px: [30, 40]}\n"
           "  texture: {kind: dead-leaves, colour: [0.1, 0.2, 0.3], contrast: 0.7,\n"
           "            saturation: 0.9, feature_size_px: 3}\n"
           "- plane: {depth_mm: 291}\n"
           "  outline: {centre_mm: [-1, 2], radius_mm: 1.5}\n"
           "  texture: {kind: sine, angle_deg: 30, contrast: 0.2, feature_size_px: 9}\n"
           "- plane: {depth_mm: 292}\n"
           "  outline: {centre_px: [1, 2], radius_px: 15}\n"
           "  texture: {kind: uniform, colour: [1, 0, 0]}\n"
           "- plane: {depth_mm: 293}\n"
           "  outline: {centre_mm: [1, 2], size_mm: [3, 4]}\n"
           "  texture: {kind: noise, saturation: 0}\n"
           "  gloss: [{depth_mm: 320, centre_px: [5, 6.5], sigma_px: 2.5, strength: 0.75}]\n"
           "effects: [defocus, occlusion, falloff]\n"
           "without: [falloff]\n"
           "tolerance: 0.1px\n"
           "wavelength_nm: 633\n"
           "full_well_electrons: 12000\n"
           "read_noise_electrons: 5\n"
           "rays_per_pixel: 100\n"
           "sampling_error_grey_levels: 0.05\n"
           "noise_sigma_grey_levels: 1.5\n"
           "bits: 16\n"
           "views: [9, 3]\n"
           "seed: 77\n");
  EXPECT_NEAR(options.camera.image_distance_mm(), 60, 1e-12);
  EXPECT_EQ(options.camera.blur_ratio(), 0.4);
  EXPECT_EQ(options.camera.calibration->blur_floor_px->value, 0.6);
  EXPECT_EQ(options.camera.psf, Psf::kDisc);
  EXPECT_EQ(options.camera.sensor.width_px, 400);
  EXPECT_EQ(options.camera.sensor.height_px, 301);
  EXPECT_EQ(options.camera.sensor.principal_point_px, Eigen::Vector2d(201.5, 150));
  EXPECT_EQ(options.effects.base, EffectSelectionOptions::Base::kGiven);
  EXPECT_EQ(options.effects.given,
            EffectSet({Effect::kDefocus, Effect::kOcclusion, Effect::kFalloff}));
  EXPECT_EQ(options.effects.without, EffectSet({Effect::kFalloff}));
  EXPECT_EQ(options.effects.tolerance.px.value(), 0.1);
  EXPECT_DOUBLE_EQ(options.wavelength_mm, 633e-6);
  EXPECT_EQ(options.full_well_electrons, 12000);
  EXPECT_EQ(options.read_noise_electrons, 5);
  EXPECT_EQ(options.rays_per_pixel, 100);
  EXPECT_EQ(options.sampling_error_grey_levels, 0.05);
  EXPECT_EQ(options.noise_sigma_grey_levels, 1.5);
  EXPECT_EQ(options.bits, 16);
  EXPECT_EQ(options.u_count, 9);
  EXPECT_EQ(options.v_count, 3);
  EXPECT_EQ(options.seed, 77u);

  using Shape = OutlineOptions::Shape;
  using Unit = OutlineOptions::Unit;
  ASSERT_EQ(options.layers.size(), 5u);
  const SceneLayer& wall = options.layers[0];
  EXPECT_EQ(wall.name, "wall");
  EXPECT_EQ(wall.plane.depth_mm, 310);
  EXPECT_EQ(wall.plane.slope, Eigen::Vector2d(0.5, -0.25));
  EXPECT_EQ(wall.outline.shape, Shape::kWhole);
  EXPECT_EQ(wall.texture.kind, TextureKind::kImage);
  EXPECT_EQ(wall.texture.image_path, folder_ / "wall.png");
  EXPECT_EQ(wall.texture.feature_size_px, 500);
  const SceneLayer& leaves = options.layers[1];
  EXPECT_EQ(leaves.outline.shape, Shape::kRectangle);
  EXPECT_EQ(leaves.outline.unit, Unit::kPx);
  EXPECT_EQ(leaves.outline.centre, Eigen::Vector2d(10, 20.5));
  EXPECT_EQ(leaves.outline.size, Eigen::Vector2d(30, 40));
  EXPECT_EQ(leaves.texture.colour, Eigen::Vector3d(0.1, 0.2, 0.3));
  EXPECT_EQ(leaves.texture.contrast, 0.7);
  EXPECT_EQ(leaves.texture.saturation, 0.9);
  EXPECT_EQ(leaves.texture.feature_size_px, 3);
  const SceneLayer& sine = options.layers[2];
  EXPECT_EQ(sine.outline.shape, Shape::kDisc);
  EXPECT_EQ(sine.outline.unit, Unit::kMm);
  EXPECT_EQ(sine.outline.centre, Eigen::Vector2d(-1, 2));
  EXPECT_EQ(sine.outline.radius, 1.5);
  EXPECT_EQ(sine.texture.kind, TextureKind::kSine);
  EXPECT_EQ(sine.texture.angle_deg, 30);
  EXPECT_EQ(options.layers[3].outline.unit, Unit::kPx);
  EXPECT_EQ(options.layers[3].outline.radius, 15);
  EXPECT_EQ(options.layers[3].texture.kind, TextureKind::kUniform);
  EXPECT_EQ(options.layers[4].outline.unit, Unit::kMm);
  EXPECT_EQ(options.layers[4].outline.size, Eigen::Vector2d(3, 4));
  EXPECT_EQ(options.layers[4].texture.kind, TextureKind::kNoise);
  EXPECT_TRUE(wall.gloss.empty());
  ASSERT_EQ(options.layers[4].gloss.size(), 1u);
  const GlossOptions& gloss = options.layers[4].gloss[0];
  EXPECT_EQ(gloss.depth_mm, 320);
  EXPECT_EQ(gloss.centre_px, Eigen::Vector2d(5, 6.5));
  EXPECT_EQ(gloss.sigma_px, 2.5);
  EXPECT_EQ(gloss.strength, 0.75);
}

TEST_F(SceneSimulationFileTest, WhatIsLeftOutHasTheDefaultsOfTheOptions) {
  const SceneSimulationOptions options = Read(std::string(kHead) + kTruth + kLayers);
  const SceneSimulationOptions defaults;
  const SceneLayer layer;
  EXPECT_EQ(options.camera.sensor.width_px, 640);
  EXPECT_EQ(options.camera.sensor.principal_point_px, Eigen::Vector2d(321.5, 240));
  EXPECT_FALSE(options.camera.calibration->blur_floor_px);
  EXPECT_EQ(options.effects.base, EffectSelectionOptions::Base::kAuto);
  EXPECT_EQ(options.effects.without, EffectSet());
  EXPECT_EQ(options.effects.tolerance.grey_levels, defaults.effects.tolerance.grey_levels);
  EXPECT_EQ(options.wavelength_mm, defaults.wavelength_mm);
  EXPECT_EQ(options.rays_per_pixel, defaults.rays_per_pixel);
  EXPECT_EQ(options.sampling_error_grey_levels, defaults.sampling_error_grey_levels);
  EXPECT_EQ(options.noise_sigma_grey_levels, 0);
  EXPECT_EQ(options.bits, 8);
  EXPECT_EQ(options.u_count, defaults.u_count);
  EXPECT_EQ(options.v_count, defaults.v_count);
  EXPECT_EQ(options.seed, 1u);
  ASSERT_EQ(options.layers.size(), 1u);
  EXPECT_EQ(options.layers[0].plane.slope, Eigen::Vector2d(0, 0));
  EXPECT_EQ(options.layers[0].texture.colour, layer.texture.colour);
  EXPECT_EQ(options.layers[0].texture.contrast, layer.texture.contrast);
}

TEST_F(SceneSimulationFileTest, TruthReplacesWhatItNamesInTheCalibration) {
  PutCamera(
      "calibration:\n"
      "  image_distance_mm: {value: 59, sigma: 0.1}\n"
      "  blur_ratio: {value: 0.3, sigma: 0.01}\n"
      "  blur_floor_px: {value: 0.7, sigma: 0.01}\n"
      "  covariance: {order: [image_distance_mm], rows: [[0.01]]}\n"
      "  evidence: {method: fit, frames_used: 7}\n");
  const SceneSimulationOptions kept = Read(std::string(kHead) + kLayers);
  EXPECT_EQ(kept.camera.image_distance_mm(), 59);
  EXPECT_EQ(kept.camera.calibration->evidence.method, "fit");
  const SceneSimulationOptions replaced =
      Read(std::string(kHead) + "truth: {blur_ratio: 0.5}\n" + kLayers);
  EXPECT_EQ(replaced.camera.image_distance_mm(), 59);
  EXPECT_EQ(replaced.camera.blur_ratio(), 0.5);
  EXPECT_EQ(replaced.camera.calibration->blur_floor_px->value, 0.7);
  EXPECT_EQ(replaced.camera.calibration->evidence.method, "simulated");
  EXPECT_TRUE(replaced.camera.calibration->covariance_order.empty());
  // The output of `simulate image` can be read.
  const Camera again = ParseCamera(CameraToYaml(replaced.camera), "camera.yaml");
  EXPECT_EQ(again.blur_ratio(), 0.5);
}

TEST_F(SceneSimulationFileTest, EveryKindOfTextureHasItsName) {
  const std::pair<const char*, TextureKind> kinds[] = {{"uniform", TextureKind::kUniform},
                                                       {"sine", TextureKind::kSine},
                                                       {"edge", TextureKind::kEdge},
                                                       {"siemens-star", TextureKind::kSiemensStar},
                                                       {"checkerboard", TextureKind::kCheckerboard},
                                                       {"dead-leaves", TextureKind::kDeadLeaves},
                                                       {"noise", TextureKind::kNoise}};
  for (const auto& [name, kind] : kinds) {
    const auto options =
        Read(std::string(kHead) + kTruth +
             "layers: [{plane: {depth_mm: 310}, texture: {kind: " + name + "}}]\n");
    EXPECT_EQ(options.layers[0].texture.kind, kind);
    EXPECT_EQ(TextureKindName(kind), name);
  }
}

TEST_F(SceneSimulationFileTest, LayersMayHaveAMaskOrADepthMap) {
  const SceneSimulationOptions options =
      Read(std::string(kHead) + kTruth +
           "layers:\n"
           "- {depth: {map: maps/hill.png, kind: range, unit: cm}, texture: {kind: noise}}\n"
           "- {plane: {depth_mm: 310}, outline: {mask: card.png}, texture: {kind: noise}}\n");
  ASSERT_TRUE(options.layers[0].depth.has_value());
  EXPECT_EQ(options.layers[0].depth->map_path, folder_ / "maps/hill.png");
  EXPECT_EQ(options.layers[0].depth->convention.kind, DepthKind::kRange);
  EXPECT_EQ(options.layers[0].depth->convention.unit_mm, 10);
  EXPECT_FALSE(options.layers[1].depth.has_value());
  EXPECT_EQ(options.layers[1].outline.shape, OutlineOptions::Shape::kMask);
  EXPECT_EQ(options.layers[1].outline.unit, OutlineOptions::Unit::kPx);
  EXPECT_EQ(options.layers[1].outline.mask_path, folder_ / "card.png");
}

TEST_F(SceneSimulationFileTest, ErrorsHaveTheirPlaceInTheFile) {
  const std::string head = std::string(kHead) + kTruth;
  const auto layer = [&](const std::string& text) { return head + "layers: [{" + text + "}]\n"; };
  const std::string plane = "plane: {depth_mm: 310}, ";
  const std::string leaves = ", texture: {kind: dead-leaves}";
  const std::pair<std::string, const char*> cases[] = {
      {"schema: thicklens/simulate-sweep/1\n", "thicklens/simulate-scene/1"},
      {head + kLayers + "sed: 3\n", "scene.yaml:6:1: unknown key 'sed'; did you mean 'seed'"},
      {head, "'layers' is missing"},
      {head + "layers: []\n", "layers: none of the 0 is without an outline"},
      {head + "layers: 3\n", "layers"},
      {kHead + std::string(kLayers), "image_distance_mm is missing"},
      {kHead + std::string("truth: {focus_depth_mm: 300}\n") + kLayers, "blur_ratio is missing"},
      {kHead + std::string("truth: {focus_depth_mm: 30, blur_ratio: 0.4}\n") + kLayers,
       "truth.focus_depth_mm: must be above the lens's front_focal_length_mm 50, found 30"},
      {kHead + std::string("truth: {focus_depth_m: 0.3}\n") + kLayers, "wrong unit"},
      {head + "size_px: [641, 10]\n" + kLayers, "from 1 to 640"},
      {layer("texture: {kind: noise}"), "'plane' is missing"},
      {layer("depth: {map: a.pfm, kind: z}" + leaves), "'unit' is missing"},
      {layer("depth: {map: a.pfm, unit: mm}" + leaves), "'kind' is missing"},
      {layer("depth: {map: a.pfm, kind: disparity, unit: mm}" + leaves), "z, range"},
      {layer("depth: {map: a.pfm, kind: z, unit: px}" + leaves), "mm, cm, m, tum5000"},
      {layer(plane + "depth: {map: a.pfm, kind: z, unit: mm}" + leaves),
       "layers[0].plane: the layer also has 'depth': either 'plane' or 'depth' is expected, not "
       "both"},
      {layer("depth: {map: a.pfm, kind: z, unit: mm}, outline: {mask: a.png}" + leaves),
       "a layer with a depth map, which covers the whole image"},
      {layer("plane: {depth_mm: 310}"), "'texture' is missing"},
      {layer("plane: {depth_mm: 0}" + leaves), "layers[0].plane.depth_mm"},
      {layer("plane: {depth_mm: 3, slope: [1]}" + leaves), "a list of 2"},
      {layer(plane + "texture: {kind: leaves}"), "dead-leaves"},
      {layer(plane + "texture: {kind: noise, angle_deg: 3}"), "unknown key 'angle_deg'"},
      {layer(plane + "texture: {kind: uniform, contrast: 1}"), "unknown key 'contrast'"},
      {layer(plane + "texture: {kind: image}"), "'image' is missing"},
      {layer(plane + "texture: {kind: image, image: a.png, colour: [1, 1, 1]}"),
       "unknown key 'colour'"},
      {layer(plane + "texture: {kind: noise, colour: [1, 1]}"), "a list of 3"},
      {layer(plane + "texture: {kind: noise, contrast: 2}"), "texture.contrast is 2"},
      {layer(plane + "gloss: [{centre_px: [1, 1], sigma_px: 2, strength: 1}]" + leaves),
       "layers[0].gloss[0]: 'depth_mm' is missing"},
      {layer(plane + "gloss: [{depth_mm: 320, centre_px: [1, 1], sigma_px: 0, strength: 1}]" +
             leaves),
       "layers[0].gloss[0].sigma_px"},
      {layer(plane + "outline: {size_px: [3, 4]}" + leaves), "'centre_px' is missing"},
      {layer(plane + "outline: {centre_px: [3, 4]}" + leaves),
       "exactly one of size_px (a rectangle) and radius_px (a disc) is expected, found none"},
      {layer(plane + "outline: {centre_mm: [3, 4], size_mm: [1, 1], radius_mm: 2}" + leaves),
       "found both"},
      {layer(plane + "outline: {centre_mm: [3, 4], radius_px: 2}" + leaves),
       "outline.radius_px: the outline is given in mm: this key must be radius_mm"},
      {layer(plane + "outline: {centre_px: [3, 4], size_mm: [2, 2]}" + leaves),
       "outline.size_mm: the outline is given in px: this key must be size_px"},
      {layer(plane + "outline: {mask: a.png, centre_px: [3, 4]}" + leaves),
       "unknown key 'centre_px'"},
      {layer(plane + "outline: {mask: a.png}" + leaves), "none of the 1 is without an outline"},
      {layer(plane + "outline: {centre_px: [3, 4], radius_px: 2}" + leaves),
       "none of the 1 is without an outline"},
      {head + kLayers + "bits: 12\n", "bits is 12: it must be 8 or 16"},
      {head + kLayers + "views: [5]\n", "a list of 2"},
      {head + kLayers + "views: [5, 200]\n", "views is 5x200"},
      {head + kLayers + "rays_per_pixel: 2\n", "rays_per_pixel is 2"},
      {head + kLayers + "effects: some\n", "auto, all, none"},
      {head + kLayers + "effects: [bokeh]\n", "effect \"bokeh\" is unknown"},
      {head + kLayers + "without: [bokeh]\n", "effect \"bokeh\" is unknown"},
      {head + kLayers + "tolerance: 3\n", "0.5gl or 0.1px"},
      {head + kLayers + "wavelength_nm: 0\n", "wavelength_nm"},
      {head + kLayers + "read_noise_electrons: 3\n", "full_well_electrons > 0"},
  };
  for (const auto& [text, reported] : cases) {
    EXPECT_THAT(MessageOf(text), HasSubstr(reported)) << text;
    EXPECT_EQ(MessageOf(text).find('\n'), std::string::npos);
  }
}

TEST_F(SceneSimulationFileTest, TruthIsWrittenInFull) {
  SceneTruth truth;
  truth.image_distance_mm = 60.25;
  truth.focus_depth_mm = 300;
  truth.blur_ratio = 0.45;
  truth.blur_floor_px = 0.1;
  truth.nearest_depth_mm = 290.5;
  truth.farthest_depth_mm = 310;
  truth.largest_blur_sigma_px = 1.0 / 3;
  truth.effects = {{"defocus", "pixel-box"}, {{"falloff", 0.125}}};
  truth.seed = 18446744073709551615u;
  const YamlNode root = YamlNode::Parse(SceneTruthToYaml(truth), "truth.yaml");
  root.RequireSchema("thicklens/scene-truth/1");
  EXPECT_EQ(root.At("image_distance_mm").Number(), 60.25);
  EXPECT_EQ(root.At("focus_depth_mm").Number(), 300);
  EXPECT_EQ(root.At("blur_ratio").Number(), 0.45);
  EXPECT_EQ(root.At("blur_floor_px").Number(), 0.1);
  EXPECT_EQ(root.At("nearest_depth_mm").Number(), 290.5);
  EXPECT_EQ(root.At("farthest_depth_mm").Number(), 310);
  EXPECT_EQ(root.At("largest_blur_sigma_px").Number(), 1.0 / 3);
  ASSERT_EQ(root.At("effects").Elements().size(), 2U);
  EXPECT_EQ(root.At("effects").Elements()[1].Text(), "pixel-box");
  EXPECT_EQ(root.At("left_out_grey_levels").At("falloff").Number(), 0.125);
  EXPECT_EQ(root.At("seed").Text(), "18446744073709551615");
}

// They can be read and started, and no light of theirs is cut off.
TEST(ShippedScenesTest, AllCanBeReadAndStarted) {
  const auto folder = std::filesystem::path(THICKLENS_SOURCE_DIR) / "configs" / "scenes";
  int count = 0;
  for (const auto& entry : std::filesystem::directory_iterator(folder)) {
    if (entry.path().extension() != ".yaml") continue;
    SceneSimulationOptions options = ReadSceneSimulation(entry.path().string());
    EXPECT_EQ(options.camera.sensor.width_px % 16, 0);
    EXPECT_EQ(options.camera.sensor.height_px % 16, 0);
    const SceneSimulator simulator(options, {});
    const LinearImage view = simulator.RenderView({0, 0}, {0, {}});
    std::size_t clipped = 0;
    for (const float light : view.values) clipped += light > 1 ? 1 : 0;
    EXPECT_LT(clipped, view.values.size() / 500) << entry.path();
    EXPECT_LT(simulator.Truth(simulator.RenderDepth()).largest_blur_sigma_px, 3.01);
    ++count;
  }
  EXPECT_GE(count, 2);
}

}  // namespace
}  // namespace thicklens::model
