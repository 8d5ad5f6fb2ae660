// The depth map inside a photograph, where the command line gives none.
#include "tools/options/embedded_depth.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <optional>
#include <utility>

#include "thicklens/base/cancel.h"
#include "thicklens/base/error.h"
#include "thicklens/io/depth_io.h"
#include "thicklens/io/exif.h"
#include "tools/options/interface_options.h"
#include "tools/options/option_values.h"

namespace thicklens::tools {
namespace {

Error NoDepth(const std::string& path) {
  const std::vector<std::string> others = io::ReadEmbeddedDepthFile(path).others;
  return Error(fmt::format(
      "{}: no DEPTH was given, and the photograph's file holds no depth map (looked for: {}{}); "
      "give the depth map of the photograph, with --depth-kind z, range, disparity or inverse",
      path, io::EmbeddedDepthForms(),
      others.empty() ? "" : fmt::format("; found: {}", fmt::join(others, "; "))));
}

// How the user gets a camera for the photograph: EXIF and data sheets describe it, a sweep
// calibrates it. An inverse depth is linear in the disparity, so that it can do without one.
std::string CameraRemedy(const std::string& path, model::DepthKind kind, int width_px,
                         int height_px) {
  std::string why;
  const io::PhotoExif exif = io::ReadExifIfAny(path, width_px, height_px, &why);
  std::vector<std::string> missing;
  if (!exif.focal_length_mm) missing.emplace_back("--focal-mm MM");
  if (!exif.f_number) missing.emplace_back("--f-number N");
  if (!exif.pixel_pitch_mm) missing.emplace_back("--pitch-um UM");
  std::string text = fmt::format(
      "`thicklens camera init --from-exif {}{}{} -o camera.yaml` describes it{}, and `thicklens "
      "calibrate` completes it",
      path, missing.empty() ? "" : " ", fmt::join(missing, " "),
      missing.empty() ? "" : " (the photograph's EXIF does not state these values)");
  if (kind == model::DepthKind::kInverse) {
    text += fmt::format(
        ". Without a camera, `thicklens depth extract {} --enlarge -o inverse.pfm` writes "
        "dioptres, which --depth-kind disparity --disparity-scale S --disparity-offset O takes: S "
        "px per "
        "view step and dioptre, O = -S/zf for a distance in focus of zf metres",
        path);
  }
  return text;
}

}  // namespace

std::vector<std::string> GivenDepthOptions(const DepthOptions& options) {
  std::vector<std::string> given;
  const auto add = [&given](bool is_given, const char* name) {
    if (is_given) given.emplace_back(name);
  };
  add(!options.unit.empty(), "--depth-unit");
  add(!options.near_is.empty(), "--near-is");
  add(options.disparity_scale != 1, "--disparity-scale");
  add(options.disparity_offset_px != 0, "--disparity-offset");
  add(options.inverse_scale_dpt != 1, "--inverse-scale");
  add(options.inverse_offset_dpt != 0, "--inverse-offset");
  add(options.near.has_value(), "--depth-near");
  add(options.far.has_value(), "--depth-far");
  add(!options.hole_values.empty(), "--hole-value");
  add(!options.zero_is.empty(), "--zero-is");
  add(!options.largest_is.empty(), "--largest-is");
  add(!options.channel.empty(), "--depth-channel");
  add(!options.pfm_scale.empty(), "--pfm-scale");
  return given;
}

std::string KindInWords(model::DepthKind kind) {
  switch (kind) {
    case model::DepthKind::kRange:
      return "range (along the ray of each pixel)";
    case model::DepthKind::kInverse:
      return "inverse depth (1/z)";
    case model::DepthKind::kDisparity:
      return "disparity";
    case model::DepthKind::kZ:
      break;
  }
  return "z (along the optical axis)";
}

void RefuseOtherMeaning(const DepthOptions& options, const DepthMap& inside) {
  const std::string file_says = fmt::format("the depth map inside {} states its own meaning, {}",
                                            inside.source, KindInWords(inside.meaning.kind));
  if (!options.kind.empty() && (options.kind == "relative" ||
                                model::DepthKindFromName(options.kind) != inside.meaning.kind)) {
    throw UsageError(fmt::format(
        "--depth-kind {}: {}; leave the option out, or give the map that it describes as DEPTH",
        options.kind, file_says));
  }
  const std::vector<std::string> given = GivenDepthOptions(options);
  if (given.empty()) return;
  throw UsageError(
      fmt::format("{}: {}, with its unit; leave the option{} out, or write the map by `thicklens "
                  "depth extract` and give it as DEPTH",
                  fmt::join(given, ", "), file_says, given.size() == 1 ? "" : "s"));
}

RunControl DepthRun(const std::string& other_way) {
  const std::string command = "`thicklens depth extract`";
  RunControl run;
  run.option_name = OptionNames{
      {"ReadEmbeddedDepth", other_way.empty() ? command : other_way + ", or by " + command},
      {"io::ReadEmbeddedDepthFile", command}};
  return run;
}

DepthMap DepthInsidePhoto(const EstimateOptions& options, int width_px, int height_px) {
  const std::string& path = options.image_path;
  std::optional<DepthMap> inside =
      ReadEmbeddedDepth(path, 0, 0, DepthFlipOf(options.depth), DepthRun());
  if (!inside) throw NoDepth(path);
  RefuseOtherMeaning(options.depth, *inside);
  if (!options.camera_path.empty()) return std::move(*inside);
  throw UsageError(fmt::format(
      "--camera is missing: the depth map inside {} is {}, and how far its points move from view "
      "to view depends on the camera; {}",
      path, KindInWords(inside->meaning.kind),
      CameraRemedy(path, inside->meaning.kind, width_px, height_px)));
}

}  // namespace thicklens::tools
