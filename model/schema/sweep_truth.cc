// Reader and writer of the file with the parameters of a simulated sweep.
#include <yaml-cpp/yaml.h>

#include "model/schema/effect_yaml.h"
#include "thicklens/base/yaml_reader.h"
#include "thicklens/model/pupil_law.h"
#include "thicklens/model/sweep_file.h"

namespace thicklens::model {
namespace {

constexpr char kTruthSchema[] = "thicklens/sweep-truth/1";

std::string ReadPupilLawName(const YamlNode& node) {
  std::vector<std::string> names;
  for (const PupilLaw law : AllPupilLaws()) names.push_back(PupilLawName(law));
  return node.OneOf(names);
}

}  // namespace

SweepTruth ReadSweepTruth(const std::string& path) {
  const YamlNode root = YamlNode::LoadFile(path);
  root.RequireSchema(kTruthSchema);
  root.RequireKeys({"schema", "image_distance_mm", "focus_depth_mm", "blur_ratio", "blur_floor_px",
                    "bench_offset_mm", "tilt_deg", "pupil_law", "effects", "left_out_grey_levels",
                    "frames"});
  SweepTruth truth;
  truth.image_distance_mm = root.At("image_distance_mm").PositiveNumber();
  truth.focus_depth_mm = root.At("focus_depth_mm").PositiveNumber();
  truth.blur_ratio = root.At("blur_ratio").NonNegativeNumber();
  truth.blur_floor_px = root.At("blur_floor_px").NonNegativeNumber();
  truth.bench_offset_mm = root.At("bench_offset_mm").Number();
  if (const auto tilt = root.Find("tilt_deg")) truth.tilt_deg = tilt->Number();
  if (const auto law = root.Find("pupil_law")) truth.pupil_law = ReadPupilLawName(*law);
  for (const YamlNode& node : root.At("frames").Elements()) {
    node.RequireKeys({"image", "depth_mm", "reading_mm", "blur_sigma_px"});
    truth.frames.push_back({node.At("image").Text(), node.At("depth_mm").Number(),
                            node.At("reading_mm").Number(),
                            node.At("blur_sigma_px").NonNegativeNumber()});
  }
  return truth;
}

std::string SweepTruthToYaml(const SweepTruth& truth) {
  YAML::Emitter out;
  const auto number = [&](const char* key, double value) {
    out << YAML::Key << key << YAML::Value << YamlNumber(value);
  };
  out << YAML::BeginMap << YAML::Key << "schema" << YAML::Value << kTruthSchema;
  number("image_distance_mm", truth.image_distance_mm);
  number("focus_depth_mm", truth.focus_depth_mm);
  number("blur_ratio", truth.blur_ratio);
  number("blur_floor_px", truth.blur_floor_px);
  number("bench_offset_mm", truth.bench_offset_mm);
  if (truth.tilt_deg != 0) number("tilt_deg", truth.tilt_deg);
  if (!truth.pupil_law.empty()) out << YAML::Key << "pupil_law" << YAML::Value << truth.pupil_law;
  EmitEffects(truth.effects, &out);
  out << YAML::Key << "frames" << YAML::Value << YAML::BeginSeq;
  for (const SweepTruth::Frame& frame : truth.frames) {
    out << YAML::Flow << YAML::BeginMap << YAML::Key << "image" << YAML::Value << frame.image;
    number("depth_mm", frame.depth_mm);
    number("reading_mm", frame.reading_mm);
    number("blur_sigma_px", frame.blur_sigma_px);
    out << YAML::EndMap;
  }
  out << YAML::EndSeq << YAML::EndMap;
  return std::string(out.c_str()) + "\n";
}

}  // namespace thicklens::model
