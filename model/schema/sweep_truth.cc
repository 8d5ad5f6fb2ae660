// Reader and writer of the file with the parameters of a simulated sweep.
#include <utility>

#include "model/schema/effect_yaml.h"
#include "model/schema/yaml_fields.h"
#include "model/schema/yaml_writer.h"
#include "thicklens/base/yaml_reader.h"
#include "thicklens/model/grey_focus.h"
#include "thicklens/model/pupil_law.h"
#include "thicklens/model/sweep_file.h"

namespace thicklens::model {
namespace {

constexpr char kTruthSchema[] = "thicklens/sweep-truth/1";

void WriteAberrations(const LensAberrations& aberrations, YamlWriter* out) {
  const auto& colour_mm = aberrations.axial_colour_mm;
  if (!aberrations.DisplaceFocus() && aberrations.distortion == 0 && !colour_mm) return;
  out->BeginMap("aberrations");
  for (const auto& [name, value] :
       {std::pair("field_curvature_mm", aberrations.field_curvature_mm),
        std::pair("field_astigmatism_mm", aberrations.field_astigmatism_mm),
        std::pair("astigmatism_mm", aberrations.astigmatism_mm),
        std::pair("distortion", aberrations.distortion)}) {
    if (value != 0) out->Number(name, value);
  }
  if (colour_mm) {
    out->BeginListInLine("axial_colour_mm");
    for (const double zf_mm : *colour_mm) out->Element(zf_mm);
    out->EndList();
  }
  out->EndMap();
}

}  // namespace

SweepTruth ReadSweepTruth(const std::string& path) {
  const YamlNode root = YamlNode::LoadFile(path);
  root.RequireSchema(kTruthSchema);
  root.RequireKeys({"schema",
                    "image_distance_mm",
                    "focus_depth_mm",
                    "grey_focus_depth_mm",
                    "blur_ratio",
                    "blur_floor_px",
                    "bench_offset_mm",
                    "moves",
                    "tilt_deg",
                    "relief_mm",
                    "corner_stops",
                    "specks",
                    "aberrations",
                    "aperture",
                    "counts_per_mm",
                    "band_amplitude",
                    "exposure_drift_stops",
                    "pupil_law",
                    "effects",
                    "left_out_grey_levels",
                    "frames"});
  SweepTruth truth;
  truth.image_distance_mm = root.At("image_distance_mm").PositiveNumber();
  truth.focus_depth_mm = root.At("focus_depth_mm").PositiveNumber();
  truth.blur_ratio = root.At("blur_ratio").NonNegativeNumber();
  truth.blur_floor_px = root.At("blur_floor_px").NonNegativeNumber();
  truth.bench_offset_mm = root.At("bench_offset_mm").Number();
  if (const auto moves = root.Find("moves")) {
    truth.moves = ReadNamed<SweepMotion>(
        *moves,
        {SweepMotion::kTarget, SweepMotion::kCamera, SweepMotion::kLens, SweepMotion::kSensor},
        SweepMotionName);
  }
  if (const auto tilt = root.Find("tilt_deg")) truth.tilt_deg = tilt->Number();
  if (const auto relief = root.Find("relief_mm")) {
    for (const YamlNode& height : relief->Elements()) truth.relief_mm.push_back(height.Number());
  }
  if (const auto stops = root.Find("corner_stops")) truth.corner_stops = stops->Number();
  if (const auto specks = root.Find("specks")) truth.specks = specks->Integer(0, 10000);
  if (const auto lens = root.Find("aberrations")) truth.aberrations = ReadAberrations(*lens);
  if (const auto aperture = root.Find("aperture")) truth.aperture = ReadAperture(*aperture);
  if (const auto counts = root.Find("counts_per_mm"))
    truth.counts_per_mm = counts->PositiveNumber();
  if (const auto bands = root.Find("band_amplitude")) truth.band_amplitude = bands->Number();
  if (const auto drift = root.Find("exposure_drift_stops"))
    truth.exposure_drift_stops = drift->Number();
  if (const auto law = root.Find("pupil_law")) {
    truth.pupil_law = PupilLawName(ReadNamed(*law, AllPupilLaws(), PupilLawName));
  }
  for (const YamlNode& node : root.At("frames").Elements()) {
    node.RequireKeys({"image", "depth_mm", "reading_mm", "blur_sigma_px", "image_distance_mm"});
    truth.frames.push_back({node.At("image").Text(), node.At("depth_mm").Number(),
                            node.At("reading_mm").Number(),
                            node.At("blur_sigma_px").NonNegativeNumber()});
    if (const auto distance = node.Find("image_distance_mm"))
      truth.frames.back().image_distance_mm = distance->PositiveNumber();
  }
  return truth;
}

std::string SweepTruthToYaml(const SweepTruth& truth) {
  YamlWriter out(kTruthSchema);
  out.Number("image_distance_mm", truth.image_distance_mm);
  out.Number("focus_depth_mm", truth.focus_depth_mm);
  // This value follows from the aberrations: it is written and not read.
  if (truth.aberrations.axial_colour_mm) {
    out.Number("grey_focus_depth_mm", GreyFocusDepthMm(truth.aberrations, truth.focus_depth_mm));
  }
  out.Number("blur_ratio", truth.blur_ratio);
  out.Number("blur_floor_px", truth.blur_floor_px);
  out.Number("bench_offset_mm", truth.bench_offset_mm);
  if (truth.moves != SweepMotion::kTarget) out.Text("moves", SweepMotionName(truth.moves));
  if (truth.tilt_deg != 0) out.Number("tilt_deg", truth.tilt_deg);
  if (!truth.relief_mm.empty()) {
    out.BeginListInLine("relief_mm");
    for (const double height_mm : truth.relief_mm) out.Element(height_mm);
    out.EndList();
  }
  if (truth.corner_stops != 0) out.Number("corner_stops", truth.corner_stops);
  if (truth.specks != 0) out.Number("specks", truth.specks);
  WriteAberrations(truth.aberrations, &out);
  if (!truth.aperture.IsRound()) {
    out.BeginMap("aperture");
    out.Number("blades", truth.aperture.blades);
    out.Number("rotation_deg", truth.aperture.rotation_deg);
    out.Number("roundness", truth.aperture.roundness);
    out.EndMap();
  }
  if (truth.counts_per_mm > 0) out.Number("counts_per_mm", truth.counts_per_mm);
  if (truth.band_amplitude != 0) out.Number("band_amplitude", truth.band_amplitude);
  if (truth.exposure_drift_stops != 0)
    out.Number("exposure_drift_stops", truth.exposure_drift_stops);
  out.TextIfAny("pupil_law", truth.pupil_law);
  WriteEffects(truth.effects, &out);
  out.BeginList("frames");
  for (const SweepTruth::Frame& frame : truth.frames) {
    out.BeginMapInLine();
    out.Text("image", frame.image);
    out.Number("depth_mm", frame.depth_mm);
    out.Number("reading_mm", frame.reading_mm);
    out.Number("blur_sigma_px", frame.blur_sigma_px);
    if (MovesFocus(truth.moves)) out.Number("image_distance_mm", frame.image_distance_mm);
    out.EndMap();
  }
  out.EndList();
  return out.Finish();
}

}  // namespace thicklens::model
