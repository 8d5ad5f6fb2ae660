#include "thicklens/model/light_field_file.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <filesystem>
#include <vector>

#include "model/schema/yaml_fields.h"
#include "model/schema/yaml_writer.h"
#include "thicklens/base/error.h"
#include "thicklens/base/input_file.h"
#include "thicklens/base/yaml_reader.h"

namespace thicklens::model {
namespace {

constexpr char kSchemaOfViews[] = "thicklens/light-field/1";
constexpr char kSchemaOfScene[] = "thicklens/light-field/2";
constexpr char kConfidenceFormat[] = "png";
constexpr char kDisparityIs[] = "px per view step, near positive";
constexpr int kMaxImageSizePx = 100000;
constexpr int kMaxViews = 1000;  // along u, and along v
constexpr int kMaxIterations = 1000000000;
constexpr double kWeightSumTolerance = 1e-6;

void ReadSizes(const YamlNode& root, LightField* light_field) {
  const auto views = root.At("views").ElementsExactly(2);
  light_field->u_count = views[0].Integer(1, kMaxViews);
  light_field->v_count = views[1].Integer(1, kMaxViews);
  const auto size = root.At("size").ElementsExactly(2);
  light_field->s_count = size[0].Integer(1, kMaxImageSizePx);
  light_field->t_count = size[1].Integer(1, kMaxImageSizePx);
  const YamlNode channels = root.At("channels");
  light_field->channels = channels.Integer(1, 3);
  if (light_field->channels == 2) throw channels.ErrorHere("must be 1 (grey) or 3 (RGB), found 2");
}

void ReadWeights(const YamlNode& node, LightField* light_field) {
  const auto rows = node.ElementsExactly(static_cast<std::size_t>(light_field->v_count));
  light_field->weights.resize(light_field->v_count, light_field->u_count);
  for (int l = 0; l < light_field->v_count; ++l) {
    const auto row = rows[static_cast<std::size_t>(l)].ElementsExactly(
        static_cast<std::size_t>(light_field->u_count));
    for (int k = 0; k < light_field->u_count; ++k)
      light_field->weights(l, k) = row[static_cast<std::size_t>(k)].NonNegativeNumber();
  }
  if (!(std::abs(light_field->weights.sum() - 1) <= kWeightSumTolerance)) {
    throw node.ErrorHere(
        fmt::format("the weights must have the sum 1, found {}", light_field->weights.sum()));
  }
}

void ReadMissingViews(const YamlNode& node, LightField* light_field) {
  const int views = light_field->u_count * light_field->v_count;
  light_field->present.assign(static_cast<std::size_t>(views), true);
  int missing = 0;
  for (const YamlNode& view : node.Elements()) {
    const auto place = view.ElementsExactly(2);
    const int k = place[0].Integer(0, light_field->u_count - 1);
    const int l = place[1].Integer(0, light_field->v_count - 1);
    const auto index = static_cast<std::size_t>(l * light_field->u_count + k);
    if (!light_field->present[index])
      throw view.ErrorHere(fmt::format("view ({}, {}) is listed twice", k, l));
    light_field->present[index] = false;
    ++missing;
  }
  if (missing == 0) light_field->present.clear();
  if (missing == views) throw node.ErrorHere("all views are missing: at least one is needed");
}

void ReadGrid(const YamlNode& root, LightField* light_field) {
  LightFieldGrid grid;
  grid.s_count = light_field->s_count;
  grid.t_count = light_field->t_count;
  grid.u_count = light_field->u_count;
  grid.v_count = light_field->v_count;
  const YamlNode planes = root.At("planes");
  planes.RequireKeys({"uv_depth_mm", "plane_spacing_mm"});
  grid.planes.uv_depth_mm = planes.At("uv_depth_mm").Number();
  grid.planes.plane_spacing_mm = planes.At("plane_spacing_mm").Number();
  const YamlNode steps = root.At("steps");
  steps.RequireKeys({"s_step_mm", "t_step_mm", "u_step_mm", "v_step_mm"});
  grid.s_step_mm = steps.At("s_step_mm").PositiveNumber();
  grid.t_step_mm = steps.At("t_step_mm").PositiveNumber();
  grid.u_step_mm = steps.At("u_step_mm").Number();
  grid.v_step_mm = steps.At("v_step_mm").Number();
  grid.st_origin_index = ReadPair(root.At("st_origin_index"));
  std::string why;
  if (!grid.IsValid(&why)) throw planes.ErrorHere(why);
  light_field->grid = grid;
}

// The camera and the keys that position the samples in front of it. Either all are present or none.
void ReadCameraAndGrid(const YamlNode& root, LightFieldDescription* description) {
  if (const auto camera = root.Find("camera")) {
    description->camera_file = camera->Text();
    // A light field from elsewhere must come with the files that it names; no other file is opened.
    const std::filesystem::path file = description->camera_file;
    const bool leads_out =
        file.is_absolute() || std::find(file.begin(), file.end(), "..") != file.end();
    if (leads_out) {
      throw camera->ErrorHere(fmt::format(
          "a file in the folder of the light field is expected, found '{}'", file.string()));
    }
    ReadGrid(root, &description->light_field);
    return;
  }
  for (const char* key : {"planes", "steps", "st_origin_index"}) {
    if (const auto node = root.Find(key))
      throw node->ErrorHere("this key requires a camera, but 'camera' is missing");
  }
}

std::string TextOrNothing(const YamlNode& node, const char* key) {
  const auto text = node.Find(key);
  return text ? text->Text() : std::string();
}

std::optional<double> NonNegativeOrNothing(const YamlNode& node, const char* key) {
  const auto number = node.Find(key);
  return number ? std::optional<double>(number->NonNegativeNumber()) : std::nullopt;
}

LightFieldOrigin ReadOrigin(const YamlNode& node) {
  node.RequireKeys({"method", "prior", "strength", "noise_sigma", "block_solver", "stencil",
                    "splat", "device", "block_px", "gamma", "ridge", "seconds", "iterations",
                    "relative_residual", "rcond_min", "effects", "version", "date"});
  LightFieldOrigin origin;
  origin.method = TextOrNothing(node, "method");
  origin.prior = TextOrNothing(node, "prior");
  origin.strength = NonNegativeOrNothing(node, "strength");
  origin.noise_sigma = NonNegativeOrNothing(node, "noise_sigma");
  origin.block_solver = TextOrNothing(node, "block_solver");
  origin.stencil = TextOrNothing(node, "stencil");
  origin.splat = TextOrNothing(node, "splat");
  origin.device = TextOrNothing(node, "device");
  if (const auto block = node.Find("block_px"))
    origin.block_px = block->Integer(1, kMaxImageSizePx);
  origin.gamma = NonNegativeOrNothing(node, "gamma");
  origin.ridge = NonNegativeOrNothing(node, "ridge");
  origin.seconds = NonNegativeOrNothing(node, "seconds");
  if (const auto iterations = node.Find("iterations"))
    origin.iterations = iterations->Integer(0, kMaxIterations);
  origin.relative_residual = NonNegativeOrNothing(node, "relative_residual");
  origin.rcond_min = NonNegativeOrNothing(node, "rcond_min");
  if (const auto effects = node.Find("effects")) {
    for (const YamlNode& effect : effects->Elements()) origin.effects.push_back(effect.Text());
  }
  origin.version = TextOrNothing(node, "version");
  origin.date = TextOrNothing(node, "date");
  return origin;
}

// How the values are stored of a light field of views.
void ReadViewFormats(const YamlNode& root, LightFieldDescription* description) {
  description->view_format = root.At("view_format").OneOf({"png", "tiff"});
  if (const auto format = root.Find("confidence_format")) {
    format->OneOf({kConfidenceFormat});
    description->has_confidence = true;
  }
  if (const auto missing = root.Find("missing_views"))
    ReadMissingViews(*missing, &description->light_field);
}

// How the values are stored of a light field that is kept as its scene.
void ReadScene(const YamlNode& node, LightFieldDescription* description) {
  node.RequireKeys(
      {"radiance", "radiance_bits", "disparity", "disparity_step", "confidence", "colour_profile"});
  ScenePlanes& planes = description->scene.emplace();
  node.At("radiance").OneOf({kSceneRadianceFile});
  planes.radiance_bits = node.At("radiance_bits").OneOf({"16", "32"}) == "16" ? 16 : 32;
  node.At("disparity").OneOf({kSceneDisparityFile});
  planes.disparity_step = ReadPair(node.At("disparity_step"));
  if (const auto confidence = node.Find("confidence")) {
    confidence->OneOf({kSceneConfidenceFile});
    description->has_confidence = true;
  }
  if (const auto profile = node.Find("colour_profile")) {
    profile->OneOf({kSceneProfileFile});
    planes.has_colour_profile = true;
  }
}

class DescriptionWriter {
 public:
  explicit DescriptionWriter(const LightFieldDescription& description)
      : description_(description), light_field_(description.light_field) {}

  std::string Write() {
    out_.List("views",
              {std::to_string(light_field_.u_count), std::to_string(light_field_.v_count)});
    out_.List("size", {std::to_string(light_field_.s_count), std::to_string(light_field_.t_count)});
    out_.Text("channels", std::to_string(light_field_.channels));
    if (description_.scene) {
      WriteScene(*description_.scene);
    } else {
      out_.Text("view_format", description_.view_format);
      if (description_.has_confidence) out_.Text("confidence_format", kConfidenceFormat);
    }
    out_.Text("transfer", light_field_.transfer.Name());
    out_.Text("disparity", kDisparityIs);
    Point("landing_step_px", light_field_.landing_step_px);
    WriteWeights();
    WriteMissingViews();
    if (!description_.camera_file.empty()) out_.Text("camera", description_.camera_file);
    if (light_field_.grid) WriteGrid(*light_field_.grid);
    WriteOrigin();
    return out_.Finish();
  }

 private:
  // Throws Error for a number that the reader would not accept.
  static double Checked(const char* key, double value) {
    if (!std::isfinite(value))
      throw Error(fmt::format("light field: {} is {}: it must be finite", key, value));
    return value;
  }

  void Number(const char* key, double value) { out_.Number(key, Checked(key, value)); }
  void NumberIfAny(const char* key, const std::optional<double>& value) {
    if (value) Number(key, *value);
  }
  void Point(const char* key, const Eigen::Vector2d& point) {
    out_.List(key, {YamlNumber(Checked(key, point.x())), YamlNumber(Checked(key, point.y()))});
  }

  void WriteScene(const ScenePlanes& planes) {
    out_.BeginMap("scene");
    out_.Text("radiance", kSceneRadianceFile);
    out_.Text("radiance_bits", std::to_string(planes.radiance_bits));
    out_.Text("disparity", kSceneDisparityFile);
    Point("disparity_step", planes.disparity_step);
    if (description_.has_confidence) out_.Text("confidence", kSceneConfidenceFile);
    if (planes.has_colour_profile) out_.Text("colour_profile", kSceneProfileFile);
    out_.EndMap();
  }

  void WriteWeights() {
    out_.BeginList("weights");
    for (Eigen::Index l = 0; l < light_field_.weights.rows(); ++l) {
      out_.BeginListInLine();
      for (Eigen::Index k = 0; k < light_field_.weights.cols(); ++k)
        out_.Element(Checked("weights", light_field_.weights(l, k)));
      out_.EndList();
    }
    out_.EndList();
  }

  void WriteMissingViews() {
    const auto& present = light_field_.present;
    if (std::all_of(present.begin(), present.end(), [](bool there) { return there; })) return;
    out_.BeginList("missing_views");
    for (int l = 0; l < light_field_.v_count; ++l) {
      for (int k = 0; k < light_field_.u_count; ++k) {
        if (light_field_.IsPresent(k, l)) continue;
        out_.Element({std::to_string(k), std::to_string(l)});
      }
    }
    out_.EndList();
  }

  void WriteGrid(const LightFieldGrid& grid) {
    out_.BeginMap("planes");
    Number("uv_depth_mm", grid.planes.uv_depth_mm);
    Number("plane_spacing_mm", grid.planes.plane_spacing_mm);
    out_.EndMap();
    out_.BeginMap("steps");
    Number("s_step_mm", grid.s_step_mm);
    Number("t_step_mm", grid.t_step_mm);
    Number("u_step_mm", grid.u_step_mm);
    Number("v_step_mm", grid.v_step_mm);
    out_.EndMap();
    Point("st_origin_index", grid.st_origin_index);
  }

  void WriteOrigin() {
    const LightFieldOrigin& origin = light_field_.origin;
    out_.BeginMap("origin");
    out_.TextIfAny("method", origin.method);
    out_.TextIfAny("prior", origin.prior);
    NumberIfAny("strength", origin.strength);
    NumberIfAny("noise_sigma", origin.noise_sigma);
    out_.TextIfAny("block_solver", origin.block_solver);
    out_.TextIfAny("stencil", origin.stencil);
    out_.TextIfAny("splat", origin.splat);
    out_.TextIfAny("device", origin.device);
    if (origin.block_px) out_.Text("block_px", std::to_string(*origin.block_px));
    NumberIfAny("gamma", origin.gamma);
    NumberIfAny("ridge", origin.ridge);
    NumberIfAny("seconds", origin.seconds);
    if (origin.iterations) out_.Text("iterations", std::to_string(*origin.iterations));
    NumberIfAny("relative_residual", origin.relative_residual);
    NumberIfAny("rcond_min", origin.rcond_min);
    if (!origin.effects.empty()) out_.List("effects", origin.effects);
    out_.TextIfAny("version", origin.version);
    out_.TextIfAny("date", origin.date);
    out_.EndMap();
  }

  const LightFieldDescription& description_;
  const LightField& light_field_;
  YamlWriter out_{description_.scene ? kSchemaOfScene : kSchemaOfViews};
};

}  // namespace

std::string ViewFileStem(int k, int l) { return fmt::format("view_{:02}_{:02}", l, k); }

LightFieldDescription ParseLightFieldDescription(const std::string& text,
                                                 const std::string& source_name) {
  const YamlNode root = YamlNode::Parse(text, source_name);
  const bool is_scene = root.HasSchema(kSchemaOfScene);
  if (!is_scene) root.RequireSchema(kSchemaOfViews);
  std::vector<std::string> keys = {
      "schema",  "views",  "size",   "channels", "transfer",        "disparity", "landing_step_px",
      "weights", "camera", "planes", "steps",    "st_origin_index", "origin"};
  if (is_scene) {
    keys.emplace_back("scene");
  } else {
    keys.insert(keys.end(), {"view_format", "confidence_format", "missing_views"});
  }
  root.RequireKeys(keys);
  LightFieldDescription description;
  LightField& light_field = description.light_field;
  ReadSizes(root, &light_field);
  if (is_scene) {
    ReadScene(root.At("scene"), &description);
  } else {
    ReadViewFormats(root, &description);
  }
  light_field.transfer = ReadTransfer(root.At("transfer"));
  const YamlNode disparity = root.At("disparity");
  if (disparity.Text() != kDisparityIs) {
    throw disparity.ErrorHere(
        fmt::format("'{}' is expected, found '{}'", kDisparityIs, disparity.Text()));
  }
  if (const auto step = root.Find("landing_step_px")) light_field.landing_step_px = ReadPair(*step);
  ReadWeights(root.At("weights"), &light_field);
  ReadCameraAndGrid(root, &description);
  if (const auto origin = root.Find("origin")) light_field.origin = ReadOrigin(*origin);
  return description;
}

LightFieldDescription ReadLightFieldDescription(const std::string& path) {
  return ParseLightFieldDescription(ReadTextFile(path), path);
}

std::string LightFieldDescriptionToYaml(const LightFieldDescription& description) {
  return DescriptionWriter(description).Write();
}

}  // namespace thicklens::model
