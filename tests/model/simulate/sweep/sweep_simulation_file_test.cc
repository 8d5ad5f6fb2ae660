#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <string>
#include <utility>

#include "thicklens/base/error.h"
#include "thicklens/base/output_file.h"
#include "thicklens/model/sweep_simulator.h"

namespace thicklens::model {
namespace {

using ::testing::HasSubstr;

class SweepSimulationFileTest : public ::testing::Test {
 protected:
  void SetUp() override {
    const auto* test = ::testing::UnitTest::GetInstance()->current_test_info();
    folder_ = std::filesystem::path(::testing::TempDir()) /
              (std::string("sweep_simulation_") + test->name());
    std::filesystem::create_directories(folder_);
    WriteFileAtomically((folder_ / "camera.yaml").string(),
                        "schema: thicklens/camera/2\n"
                        "name: macro\n"
                        "lens: {front_focal_length_mm: 50, rear_focal_length_mm: 50, "
                        "lens_thickness_mm: 0, aperture_radius_mm: 9}\n"
                        "sensor: {width_px: 640, height_px: 481, pixel_pitch_mm: 0.0045, "
                        "principal_point_px: [319.5, 240], transfer: srgb}\n"
                        "psf: disc\n");
  }
  void TearDown() override { std::filesystem::remove_all(folder_); }

  SweepSimulationOptions Read(const std::string& text) const {
    const std::string path = (folder_ / "sweep.yaml").string();
    WriteFileAtomically(path, text);
    return ReadSweepSimulation(path);
  }

  std::string MessageOf(const std::string& text) const {
    try {
      Read(text);
    } catch (const Error& error) {
      return error.what();
    }
    return "no error";
  }

  std::filesystem::path folder_;
};

const char kHead[] =
    "schema: thicklens/simulate-sweep/1\n"
    "camera: camera.yaml\n";
const char kTruth[] = "truth: {focus_depth_mm: 300, blur_ratio: 0.4, blur_floor_px: 0.6}\n";
const char kTarget[] = "target: {kind: dead-leaves}\n";
const char kBench[] = "bench: {first_depth_mm: 290, step_mm: 1, frames: 21}\n";

// The simulator's lens has no distortion, so that its frames must not be undistorted.
TEST_F(SweepSimulationFileTest, ADistortionOfTheCameraIsTakenOutAndReported) {
  const std::string text = std::string(kHead) + kTruth + kTarget + kBench;
  EXPECT_TRUE(Read(text).notices.empty());
  WriteFileAtomically((folder_ / "camera.yaml").string(),
                      "schema: thicklens/camera/2\n"
                      "name: macro\n"
                      "lens: {front_focal_length_mm: 50, rear_focal_length_mm: 50, "
                      "lens_thickness_mm: 0, aperture_radius_mm: 9, distortion: {model: opencv, "
                      "size_px: [640, 481], focal_length_px: [11111, 11111], principal_point_px: "
                      "[319.5, 240], coefficients: [10, 0, 0, 0]}}\n"
                      "sensor: {width_px: 640, height_px: 481, pixel_pitch_mm: 0.0045, "
                      "principal_point_px: [319.5, 240], transfer: srgb}\n");
  SweepSimulationOptions options = Read(text);
  EXPECT_FALSE(options.camera.distortion);
  ASSERT_EQ(options.notices.size(), 1U);
  EXPECT_THAT(options.notices[0], HasSubstr("lens.distortion is not simulated"));
  std::string why;
  EXPECT_TRUE(options.IsValid(&why)) << why;
  LensDistortion distortion;
  distortion.width_px = 640;
  distortion.height_px = 481;
  distortion.focal_length_px = {11111, 11111};
  distortion.principal_point_px = {319.5, 240};
  distortion.coefficients = {10, 0, 0, 0};
  options.camera.distortion = distortion;
  EXPECT_FALSE(options.IsValid(&why));
  EXPECT_THAT(why, HasSubstr("lens.distortion"));
}

TEST_F(SweepSimulationFileTest, ReadsAMovingLensOrSensor) {
  const std::string head = std::string(kHead) + kTruth + kTarget;
  EXPECT_EQ(Read(head + kBench).moves, SweepMotion::kTarget);
  const SweepSimulationOptions options =
      Read(head + "bench: {moves: lens, first_image_distance_mm: 59, step_mm: 0.1, frames: 21}\n");
  EXPECT_EQ(options.moves, SweepMotion::kLens);
  EXPECT_DOUBLE_EQ(options.ImageDistanceMm(2), 59.2);
  // The lens comes nearer to the target by what it moves away from the sensor.
  EXPECT_NEAR(options.DepthMm(2), 300 - (59.2 - options.camera.image_distance_mm()), 1e-9);
  EXPECT_THAT(
      MessageOf(head + "bench: {moves: sensor, first_depth_mm: 290, step_mm: 1, frames: 2}\n"),
      HasSubstr("first_image_distance_mm"));
  EXPECT_THAT(MessageOf(head + "bench: {first_image_distance_mm: 59, step_mm: 1, frames: 2}\n"),
              HasSubstr("does not apply where the target moves"));
  EXPECT_THAT(MessageOf(head + "bench: {moves: sensor, first_image_distance_mm: 9, step_mm: -1, "
                               "frames: 21}\n"),
              HasSubstr("image distances run from 9 to -11 mm"));
}

TEST_F(SweepSimulationFileTest, ReadsEveryField) {
  const SweepSimulationOptions options = Read(
      std::string(kHead) + kTruth +
      "size_px: [400, 301]\n"
      "target: {kind: image, image: scene.png, contrast: 0.7, feature_size_mm: 3,\n"
      "         edge_angle_deg: -4, ink_sigma_mm: 0.02}\n"
      "bench: {first_depth_mm: 310, step_mm: -1.5, frames: 12, offset_mm: 106.5,\n"
      "        direction: toward, reading_sigma_mm: 0.07,\n"
      "        stage: {there_and_back: true, backlash_mm: 0.4, screw_error_mm: 0.2,\n"
      "                screw_period_mm: 3, screw_phase_deg: 30, slip_mm: -0.5,\n"
      "                slip_from_frame: 7, resolution_mm: 0.25, lead_error: 0.01}}\n"
      "light: {level: 0.4, lamp_falloff: false, flicker: 0.02, exposure_drift_stops: -1}\n"
      "drift_sigma_px: 1.25\n"
      "fixed_to_frame: {corner_stops: -1.5, specks: 12, speck_depth: 0.6, speck_radius_px: 7}\n"
      "aberrations: {field_curvature_mm: -3, field_astigmatism_mm: 2.5, astigmatism_mm: 1.5,\n"
      "              distortion: -0.04, axial_colour_mm: [2.5, 0, -1]}\n"
      "bands: {amplitude: 0.15, period_px: 24.5, wave: square, along: columns}\n"
      "noise: {full_well_electrons: 9000, read_noise_electrons: 5}\n"
      "bits: 16\n"
      "seed: 77\n");
  EXPECT_EQ(options.aberrations.field_curvature_mm, -3);
  EXPECT_EQ(options.aberrations.field_astigmatism_mm, 2.5);
  EXPECT_EQ(options.aberrations.astigmatism_mm, 1.5);
  EXPECT_EQ(options.aberrations.distortion, -0.04);
  ASSERT_TRUE(options.aberrations.axial_colour_mm);
  EXPECT_EQ(*options.aberrations.axial_colour_mm, Eigen::Vector3d(2.5, 0, -1));
  EXPECT_EQ(options.corner_stops, -1.5);
  EXPECT_EQ(options.speck_count, 12);
  EXPECT_TRUE(options.stage.there_and_back);
  EXPECT_EQ(options.stage.backlash_mm, 0.4);
  EXPECT_EQ(options.stage.screw_error_mm, 0.2);
  EXPECT_EQ(options.stage.screw_period_mm, 3);
  EXPECT_EQ(options.stage.screw_phase_deg, 30);
  EXPECT_EQ(options.stage.slip_mm, -0.5);
  EXPECT_EQ(options.stage.slip_from_frame, 7);
  EXPECT_EQ(options.stage.resolution_mm, 0.25);
  EXPECT_EQ(options.stage.lead_error, 0.01);
  EXPECT_EQ(options.speck_depth, 0.6);
  EXPECT_EQ(options.speck_radius_px, 7);
  EXPECT_EQ(options.band_amplitude, 0.15);
  EXPECT_EQ(options.band_period_px, 24.5);
  EXPECT_TRUE(options.bands_are_square);
  EXPECT_TRUE(options.bands_are_columns);
  EXPECT_EQ(options.exposure_drift_stops, -1);
  EXPECT_NEAR(options.camera.image_distance_mm(), 60, 1e-12);
  EXPECT_EQ(options.camera.blur_ratio(), 0.4);
  EXPECT_EQ(options.camera.calibration->blur_floor_px->value, 0.6);
  EXPECT_EQ(options.camera.psf, Psf::kDisc);
  EXPECT_EQ(options.camera.sensor.width_px, 400);
  EXPECT_EQ(options.camera.sensor.height_px, 301);
  EXPECT_EQ(options.camera.sensor.principal_point_px.x(), 199.5);
  EXPECT_EQ(options.camera.sensor.principal_point_px.y(), 150);
  EXPECT_EQ(options.target.kind, TargetKind::kImage);
  EXPECT_EQ(options.target.image_path, (folder_ / "scene.png").string());
  EXPECT_EQ(options.target.contrast, 0.7);
  EXPECT_EQ(options.target.feature_size_mm, 3);
  EXPECT_EQ(options.target.edge_angle_deg, -4);
  EXPECT_EQ(options.target.ink_sigma_mm, 0.02);
  EXPECT_EQ(options.first_depth_mm, 310);
  EXPECT_EQ(options.step_mm, -1.5);
  EXPECT_EQ(options.frame_count, 12);
  EXPECT_EQ(options.bench_offset_mm, 106.5);
  EXPECT_EQ(options.direction, BenchDirection::kToward);
  EXPECT_EQ(options.reading_sigma_mm, 0.07);
  EXPECT_EQ(options.light_level, 0.4);
  EXPECT_FALSE(options.lamp_falloff);
  EXPECT_EQ(options.flicker, 0.02);
  EXPECT_EQ(options.drift_sigma_px, 1.25);
  EXPECT_EQ(options.full_well_electrons, 9000);
  EXPECT_EQ(options.read_noise_electrons, 5);
  EXPECT_EQ(options.bits, 16);
  EXPECT_EQ(options.seed, 77u);
}

TEST_F(SweepSimulationFileTest, WhatIsLeftOutHasTheDefaultsOfTheOptions) {
  const SweepSimulationOptions options = Read(std::string(kHead) + kTruth + kTarget + kBench);
  const SweepSimulationOptions defaults;
  EXPECT_EQ(options.camera.sensor.width_px, 640);
  EXPECT_EQ(options.target.contrast, defaults.target.contrast);
  EXPECT_EQ(options.light_level, defaults.light_level);
  EXPECT_EQ(options.lamp_falloff, defaults.lamp_falloff);
  EXPECT_EQ(options.full_well_electrons, 0);
  EXPECT_EQ(options.bits, 8);
  EXPECT_EQ(options.seed, 1u);
  EXPECT_EQ(options.direction, BenchDirection::kAway);
}

TEST_F(SweepSimulationFileTest, ImageDistanceMayStandForTheFocusDepth) {
  const SweepSimulationOptions options = Read(
      std::string(kHead) + "truth: {image_distance_mm: 60, blur_ratio: 0.4, blur_floor_px: 0.6}\n" +
      kTarget + kBench);
  EXPECT_NEAR(options.camera.focus_depth_mm(), 300, 1e-9);
}

TEST_F(SweepSimulationFileTest, EveryKindOfTargetHasItsName) {
  const std::pair<const char*, TargetKind> kinds[] = {{"dead-leaves", TargetKind::kDeadLeaves},
                                                      {"pink-noise", TargetKind::kPinkNoise},
                                                      {"white-noise", TargetKind::kWhiteNoise},
                                                      {"checkerboard", TargetKind::kCheckerboard},
                                                      {"siemens-star", TargetKind::kSiemensStar},
                                                      {"printed-edge", TargetKind::kPrintedEdge},
                                                      {"knife-edge", TargetKind::kKnifeEdge},
                                                      {"mesh", TargetKind::kMesh},
                                                      {"ground-glass", TargetKind::kGroundGlass},
                                                      {"pinholes", TargetKind::kPinholes},
                                                      {"beads", TargetKind::kBeads}};
  for (const auto& [name, kind] : kinds) {
    const auto options =
        Read(std::string(kHead) + kTruth + "target: {kind: " + name + "}\n" + kBench);
    EXPECT_EQ(options.target.kind, kind);
    EXPECT_EQ(TargetKindName(kind), name);
  }
}

TEST_F(SweepSimulationFileTest, PartsOfAReliefAreRead) {
  const auto options = Read(
      std::string(kHead) + kTruth +
      "target: {kind: beads, spacing_mm: 2, relief: [{shape: gear, size_mm: [3, 3], height_mm: "
      "2}, {shape: rectangle, centre_mm: [5, -1], size_mm: [2, 1], height_mm: 0.5}]}\n" +
      kBench);
  EXPECT_EQ(options.target.spacing_mm, 2);
  ASSERT_EQ(options.target.relief.size(), 2U);
  EXPECT_EQ(options.target.relief[0].shape, ReliefPartOptions::Shape::kGear);
  EXPECT_EQ(options.target.relief[0].height_mm, 2);
  EXPECT_EQ(options.target.relief[1].shape, ReliefPartOptions::Shape::kRectangle);
  EXPECT_EQ(options.target.relief[1].centre_mm, Eigen::Vector2d(5, -1));
  EXPECT_EQ(options.target.relief[1].size_mm, Eigen::Vector2d(2, 1));
}

TEST_F(SweepSimulationFileTest, ErrorsHaveTheirPlaceInTheFile) {
  const std::string head = kHead;
  const std::string rest = std::string(kTarget) + kBench;
  const std::pair<std::string, const char*> cases[] = {
      {"schema: thicklens/sweep/1\n", "thicklens/simulate-sweep/1"},
      {head + kTruth + rest + "sed: 3\n", "sweep.yaml:6:1: unknown key 'sed'; did you mean 'seed'"},
      {head + kTruth + kTarget + "bench: {first_depth_cm: 29, step_mm: 1, frames: 3}\n",
       "wrong unit: this field is 'first_depth_mm'"},
      {head + kTruth + kBench, "'target' is missing"},
      {head + kTruth + kTarget, "'bench' is missing"},
      {head + rest, "image_distance_mm is missing: a simulation needs its true value"},
      {head + "truth: {focus_depth_mm: 300, blur_ratio: 0.4}\n" + rest, "blur_floor_px is missing"},
      {head + "truth: {focus_depth_mm: 300, image_distance_mm: 60}\n" + rest,
       "truth.image_distance_mm: focus_depth_mm states the same"},
      {head + "truth: {focus_depth_mm: 30, blur_ratio: 0.4, blur_floor_px: 0}\n" + rest,
       "truth.focus_depth_mm: must be above the lens's front_focal_length_mm 50, found 30"},
      {head + kTruth + "size_px: [641, 10]\n" + rest, "from 1 to 640"},
      {head + kTruth + "size_px: [10]\n" + rest, "a list of 2"},
      {head + kTruth + "target: {kind: leaves}\n" + kBench, "dead-leaves"},
      {head + kTruth + "target: {kind: image}\n" + kBench, "requires the image's path"},
      {head + kTruth + "target: {kind: knife-edge, image: a.png}\n" + kBench,
       "only for a target of the kind 'image'"},
      {head + kTruth + rest + "noise: {read_noise_electrons: 3}\n", "needs noise.full_well"},
      {head + kTruth + rest + "fixed_to_frame: {corner_stops: -7}\n", "must be from -6 to 2"},
      {head + kTruth + rest + "aberrations: {distortion: -0.2}\n", "must be from -0.14 to 0.3"},
      {head + kTruth + rest + "aberrations: {axial_colour_mm: [1, 2]}\n", "a list of 3"},
      {head + kTruth + rest + "aberrations: {axial_colour_mm: [0, 0, -280]}\n", "in focus at 20"},
      {head + kTruth + kTarget +
           "bench: {first_depth_mm: 290, step_mm: 1, frames: 21, counts_per_mm: 100}\n",
       "bench.counts_per_mm is 100, but the target moves"},
      {head + kTruth + rest + "fixed_to_frame: {speck_depth: 2}\n", "must be from 0 to 1"},
      {head + kTruth + rest + "fixed_to_frame: {specks: -1}\n", "specks"},
      {head + kTruth + kTarget +
           "bench: {first_depth_mm: 290, step_mm: 1, frames: 21, stage: {slip_from_frame: 21}}\n",
       "slip_from_frame is 21: it must be from 0 to 20"},
      {head + kTruth + kTarget +
           "bench: {first_depth_mm: 290, step_mm: 1, frames: 21, stage: {screw_period_mm: 0}}\n",
       "must be finite and > 0"},
      {head + kTruth + rest + "bands: {amplitude: 2}\n", "must be from 0 to 1"},
      {head + kTruth + rest + "bands: {period_px: 1}\n", "must be from 2 to 1e6"},
      {head + kTruth + rest + "bands: {wave: triangle}\n", "square"},
      {head + kTruth + rest + "light: {exposure_drift_stops: 11}\n", "must be from -10 to 10"},
      {head + kTruth + rest + "bits: 12\n", "bits is 12: it must be 8 or 16"},
      {head + kTruth + rest + "light: {lamp_falloff: 1}\n", "true, false"},
  };
  for (const auto& [text, told] : cases) {
    EXPECT_THAT(MessageOf(text), HasSubstr(told)) << text;
    EXPECT_EQ(MessageOf(text).find('\n'), std::string::npos);
  }
}

TEST(ShippedSweepsTest, AllCanBeReadAndStarted) {
  const auto folder = std::filesystem::path(THICKLENS_SOURCE_DIR) / "configs" / "sweeps";
  int count = 0;
  for (const auto& entry : std::filesystem::directory_iterator(folder)) {
    if (entry.path().extension() != ".yaml") continue;
    SweepSimulationOptions options = ReadSweepSimulation(entry.path().string());
    // The brightest leaf of every frame stays below full scale.
    const double near_mm =
        std::min(options.first_depth_mm,
                 options.first_depth_mm + (options.frame_count - 1) * options.step_mm);
    EXPECT_LT(options.light_level * (1 + options.target.contrast) *
                  std::pow(options.camera.focus_depth_mm() / near_mm, 2),
              0.95)
        << entry.path();
    options.camera.sensor.width_px = 16;
    options.camera.sensor.height_px = 12;
    EXPECT_EQ(SweepSimulator(options, {}).truth().frames.size(),
              static_cast<std::size_t>(options.frame_count));
    ++count;
  }
  EXPECT_GE(count, 6);
}

}  // namespace
}  // namespace thicklens::model
