#include <fmt/format.h>

#include <limits>
#include <optional>
#include <string>
#include <vector>

#include "model/schema/effect_yaml.h"
#include "model/schema/renamed_keys.h"
#include "model/schema/sweep_grid.h"
#include "model/schema/yaml_fields.h"
#include "model/simulate/simulated_camera.h"
#include "thicklens/base/yaml_reader.h"
#include "thicklens/model/camera_file.h"
#include "thicklens/model/sweep_simulator.h"

namespace thicklens::model {
namespace {

constexpr char kSchema[] = "thicklens/simulate-sweep/1";

// The truth of the simulation is the camera's calibration with the values of `truth` in place of
// its own.
void ReadTruth(const YamlNode& node, Camera* camera) {
  node.RequireKeys({"focus_depth_mm", "image_distance_mm", "blur_ratio", "blur_floor_px"});
  if (!camera->calibration) {
    camera->calibration.emplace();
    camera->calibration->evidence.method = "assumed";
  }
  CameraCalibration& calibration = *camera->calibration;
  const auto distance = node.Find("image_distance_mm");
  if (distance && node.Find("focus_depth_mm")) {
    throw distance->ErrorHere("focus_depth_mm states the same quantity: give only one of them");
  }
  if (distance) calibration.image_distance_mm = Estimate{distance->PositiveNumber(), 0};
  ReadTruthValues(node, camera->lens, &calibration);
}

TargetKind ReadKind(const YamlNode& node, std::vector<std::string>* notices) {
  return ReadNamed<TargetKind>(
      node,
      {TargetKind::kDeadLeaves, TargetKind::kPinkNoise, TargetKind::kWhiteNoise,
       TargetKind::kCheckerboard, TargetKind::kSiemensStar, TargetKind::kImage, TargetKind::kGrid,
       TargetKind::kPrintedEdge, TargetKind::kKnifeEdge, TargetKind::kMesh,
       TargetKind::kGroundGlass, TargetKind::kPinholes, TargetKind::kBeads},
      TargetKindName, RenamedImage(), notices);
}

ReliefPartOptions ReadReliefPart(const YamlNode& node) {
  node.RequireKeys({"shape", "centre_mm", "size_mm", "height_mm"});
  ReliefPartOptions part;
  const std::string shape = node.At("shape").OneOf({"rectangle", "disc", "gear"});
  if (shape == "disc") part.shape = ReliefPartOptions::Shape::kDisc;
  if (shape == "gear") part.shape = ReliefPartOptions::Shape::kGear;
  if (const auto centre = node.Find("centre_mm")) part.centre_mm = ReadPair(*centre);
  part.size_mm = ReadPair(node.At("size_mm"));
  part.height_mm = node.At("height_mm").PositiveNumber();
  return part;
}

TargetOptions ReadTarget(const YamlNode& node, std::vector<std::string>* notices) {
  node.RequireKeys({"kind", "contrast", "feature_size_mm", "edge_angle_deg", "ink_sigma_mm",
                    "tilt_deg", "spacing_mm", "relief", "image", "grid"},
                   {RenamedImage()});
  TargetOptions target;
  const YamlNode kind = node.At("kind");
  target.kind = ReadKind(kind, notices);
  ReadNumber(node, "contrast", &target.contrast);
  ReadNumber(node, "feature_size_mm", &target.feature_size_mm);
  ReadNumber(node, "edge_angle_deg", &target.edge_angle_deg);
  ReadNumber(node, "ink_sigma_mm", &target.ink_sigma_mm);
  ReadNumber(node, "tilt_deg", &target.tilt_deg);
  ReadNumber(node, "spacing_mm", &target.spacing_mm);
  if (const auto relief = node.Find("relief")) {
    for (const YamlNode& part : relief->Elements()) target.relief.push_back(ReadReliefPart(part));
  }
  if (const auto image = node.Find(RenamedImage(), notices)) {
    if (target.kind != TargetKind::kImage) {
      throw image->ErrorHere("this key is only for a target of the kind 'image', found kind '" +
                             TargetKindName(target.kind) + "'");
    }
    target.image_path = node.ResolvePath(image->Text());
  } else if (target.kind == TargetKind::kImage) {
    throw kind.ErrorHere("the kind 'image' requires the image's path in target.image");
  }
  if (const auto grid = node.Find("grid")) {
    if (target.kind != TargetKind::kGrid) {
      throw grid->ErrorHere("this key is only for a target of the kind 'grid', found kind '" +
                            TargetKindName(target.kind) + "'");
    }
    target.grid = ReadTargetGrid(*grid);
  } else if (target.kind == TargetKind::kGrid) {
    throw kind.ErrorHere(
        "the kind 'grid' requires target.grid (pattern, columns, rows, square_mm)");
  }
  return target;
}

void ReadStage(const YamlNode& node, StageOptions* stage) {
  node.RequireKeys({"there_and_back", "backlash_mm", "screw_error_mm", "screw_period_mm",
                    "screw_phase_deg", "slip_mm", "slip_from_frame", "resolution_mm",
                    "lead_error"});
  if (const auto back = node.Find("there_and_back")) stage->there_and_back = back->Boolean();
  ReadNumber(node, "backlash_mm", &stage->backlash_mm);
  ReadNumber(node, "screw_error_mm", &stage->screw_error_mm);
  ReadNumber(node, "screw_period_mm", &stage->screw_period_mm);
  ReadNumber(node, "screw_phase_deg", &stage->screw_phase_deg);
  ReadNumber(node, "slip_mm", &stage->slip_mm);
  if (const auto from = node.Find("slip_from_frame"))
    stage->slip_from_frame = from->Integer(0, 100000);
  ReadNumber(node, "resolution_mm", &stage->resolution_mm);
  ReadNumber(node, "lead_error", &stage->lead_error);
}

void ReadBench(const YamlNode& node, SweepSimulationOptions* options) {
  node.RequireKeys({"moves", "first_depth_mm", "first_image_distance_mm", "step_mm", "frames",
                    "offset_mm", "direction", "reading_sigma_mm", "counts_per_mm", "stage"});
  if (const auto moves = node.Find("moves")) {
    options->moves = ReadNamed<SweepMotion>(
        *moves,
        {SweepMotion::kTarget, SweepMotion::kCamera, SweepMotion::kLens, SweepMotion::kSensor},
        SweepMotionName);
  }
  const bool moves_focus = MovesFocus(options->moves);
  const char* other = moves_focus ? "first_depth_mm" : "first_image_distance_mm";
  if (const auto unused = node.Find(other)) {
    throw unused->ErrorHere(fmt::format(
        "this key does not apply where the {} moves: {} is expected",
        SweepMotionName(options->moves),
        moves_focus ? "first_image_distance_mm (the target stays in the plane of focus that truth "
                      "states)"
                    : "first_depth_mm"));
  }
  if (moves_focus)
    options->first_image_distance_mm = node.At("first_image_distance_mm").PositiveNumber();
  else
    options->first_depth_mm = node.At("first_depth_mm").PositiveNumber();
  options->step_mm = node.At("step_mm").Number();
  options->frame_count = node.At("frames").Integer(1, 100000);
  ReadNumber(node, "offset_mm", &options->bench_offset_mm);
  ReadNumber(node, "reading_sigma_mm", &options->reading_sigma_mm);
  if (const auto counts = node.Find("counts_per_mm"))
    options->counts_per_mm = counts->PositiveNumber();
  if (const auto stage = node.Find("stage")) ReadStage(*stage, &options->stage);
  if (const auto direction = node.Find("direction")) {
    options->direction = direction->OneOf({"away", "toward"}) == "away" ? BenchDirection::kAway
                                                                        : BenchDirection::kToward;
  }
}

void ReadLight(const YamlNode& node, SweepSimulationOptions* options) {
  node.RequireKeys({"level", "lamp_falloff", "flicker", "exposure_drift_stops"});
  ReadNumber(node, "level", &options->light_level);
  ReadNumber(node, "flicker", &options->flicker);
  ReadNumber(node, "exposure_drift_stops", &options->exposure_drift_stops);
  if (const auto falloff = node.Find("lamp_falloff")) options->lamp_falloff = falloff->Boolean();
}

void ReadNoise(const YamlNode& node, SweepSimulationOptions* options) {
  node.RequireKeys({"full_well_electrons", "read_noise_electrons"});
  ReadNumber(node, "full_well_electrons", &options->full_well_electrons);
  ReadNumber(node, "read_noise_electrons", &options->read_noise_electrons);
}

void ReadFixedToFrame(const YamlNode& node, SweepSimulationOptions* options) {
  node.RequireKeys({"corner_stops", "specks", "speck_depth", "speck_radius_px"});
  ReadNumber(node, "corner_stops", &options->corner_stops);
  if (const auto specks = node.Find("specks")) options->speck_count = specks->Integer(0, 10000);
  ReadNumber(node, "speck_depth", &options->speck_depth);
  ReadNumber(node, "speck_radius_px", &options->speck_radius_px);
}

void ReadBands(const YamlNode& node, SweepSimulationOptions* options) {
  node.RequireKeys({"amplitude", "period_px", "wave", "along"});
  ReadNumber(node, "amplitude", &options->band_amplitude);
  ReadNumber(node, "period_px", &options->band_period_px);
  if (const auto wave = node.Find("wave"))
    options->bands_are_square = wave->OneOf({"sine", "square"}) == "square";
  if (const auto along = node.Find("along"))
    options->bands_are_columns = along->OneOf({"rows", "columns"}) == "columns";
}

}  // namespace

SweepSimulationOptions ReadSweepSimulation(const std::string& path) {
  const YamlNode root = YamlNode::LoadFile(path);
  root.RequireSchema(kSchema);
  root.RequireKeys({"schema", "camera", "truth", "size_px", "target", "bench", "light",
                    "drift_sigma_px", "noise", "fixed_to_frame", "aberrations", "aperture", "bands",
                    "bits", "pupil_law", "effects", "without", "seed"});
  SweepSimulationOptions options;
  options.camera = ReadCamera(root.ResolvePath(root.At("camera").Text()));
  TakeOutDistortion(&options.camera, &options.notices);
  if (const auto truth = root.Find("truth")) ReadTruth(*truth, &options.camera);
  if (const auto size = root.Find("size_px")) options.camera = ReadCrop(*size, options.camera);
  options.target = ReadTarget(root.At("target"), &options.notices);
  ReadBench(root.At("bench"), &options);
  if (const auto light = root.Find("light")) ReadLight(*light, &options);
  ReadNumber(root, "drift_sigma_px", &options.drift_sigma_px);
  if (const auto noise = root.Find("noise")) ReadNoise(*noise, &options);
  if (const auto fixed = root.Find("fixed_to_frame")) ReadFixedToFrame(*fixed, &options);
  if (const auto lens = root.Find("aberrations")) options.aberrations = ReadAberrations(*lens);
  if (const auto aperture = root.Find("aperture")) options.aperture = ReadAperture(*aperture);
  if (const auto bands = root.Find("bands")) ReadBands(*bands, &options);
  if (const auto bits = root.Find("bits")) options.bits = bits->Integer(8, 16);
  if (const auto law = root.Find("pupil_law")) {
    options.pupil_law = ReadNamed(*law, AllPupilLaws(), PupilLawName);
  }
  ReadEffectSelectionOptions(root, &options.effects);
  if (const auto seed = root.Find("seed")) {
    options.seed = static_cast<std::uint64_t>(seed->Integer(0, std::numeric_limits<int>::max()));
  }
  std::string why;
  if (!options.IsValid(&why)) throw root.ErrorHere(why);
  return options;
}

}  // namespace thicklens::model
