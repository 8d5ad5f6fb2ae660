// .cameramodel files of mrcal: the text of a dictionary of Python, which is nearly YAML.
#include <fmt/format.h>

#include <map>

#include "tools/io/lens/distortion_formats.h"

namespace thicklens::io {
namespace {

// Numbers of coefficients of the models that are OpenCV's.
const std::map<std::string, std::size_t>& ModelsOfOpenCv() {
  static const std::map<std::string, std::size_t> models = {{"PINHOLE", 0},   {"OPENCV4", 4},
                                                            {"OPENCV5", 5},   {"OPENCV8", 8},
                                                            {"OPENCV12", 12}, {"OPENCV14", 14}};
  return models;
}

// Literals of bytes, b'...' (the inputs of the optimisation in base 85), become empty texts: their
// characters would have a meaning in YAML.
std::string WithoutBytes(const std::string& text) {
  std::string out;
  out.reserve(text.size());
  std::size_t at = 0;
  while (at < text.size()) {
    const std::size_t single = text.find("b'", at), twin = text.find("b\"", at);
    const std::size_t begin = std::min(single, twin);
    const bool is_literal =
        begin != std::string::npos &&
        (begin == 0 || std::string(" \t\n:,[{(").find(text[begin - 1]) != std::string::npos);
    if (begin == std::string::npos) break;
    if (!is_literal) {
      out.append(text, at, begin + 1 - at);
      at = begin + 1;
      continue;
    }
    const std::size_t end = text.find(text[begin + 1], begin + 2);
    if (end == std::string::npos) break;
    out.append(text, at, begin - at);
    out += "''";
    at = end + 1;
  }
  return out.append(text, at, std::string::npos);
}

}  // namespace

bool IsMrcal(const std::string& bytes) {
  return bytes.find("LENSMODEL_") != std::string::npos ||
         (bytes.find("DISTORTION_") != std::string::npos &&
          bytes.find("imagersize") != std::string::npos) ||
         bytes.find("Model = CAHV") != std::string::npos;
}

LensDistortionFile ReadMrcal(const CalibrationText& text) {
  const std::string remedy = "convert it by mrcal-convert-lensmodel LENSMODEL_OPENCV8 FILE";
  if (text.bytes.find("Model = CAHV") != std::string::npos)
    throw NotOfOpenCv(text.name, "CAHV, CAHVOR or CAHVORE", remedy);
  if (!text.camera.empty()) {
    throw Error(fmt::format("{}: a .cameramodel has one camera, not '{}': leave the colon out",
                            text.name, text.camera));
  }
  const YamlNode root = YamlNode::Parse(WithoutBytes(text.bytes), text.name);
  const YamlNode name = root.At(root.Has("distortion_model") ? "distortion_model" : "lensmodel");
  std::string model = name.Text();
  for (const char* prefix : {"LENSMODEL_", "DISTORTION_"}) {
    if (model.rfind(prefix, 0) == 0) model = model.substr(std::string(prefix).size());
  }
  if (model == "NONE") model = "PINHOLE";
  const auto known = ModelsOfOpenCv().find(model);
  if (known == ModelsOfOpenCv().end()) {
    const std::string shown = model.substr(0, model.find("_order"));
    throw NotOfOpenCv(text.name, "LENSMODEL_" + shown + " of mrcal", remedy);
  }
  const auto fields = YamlFields(root);
  const std::vector<double> intrinsics = fields->Numbers("intrinsics");
  if (intrinsics.size() != 4 + known->second) {
    throw fields->ErrorAt("intrinsics", fmt::format("LENSMODEL_{} has {} numbers, found {}", model,
                                                    4 + known->second, intrinsics.size()));
  }
  LensDistortionFile file;
  file.format = "mrcal .cameramodel";
  model::LensDistortion& d = file.distortion;
  d.focal_length_px = {intrinsics[0], intrinsics[1]};
  d.principal_point_px = {intrinsics[2], intrinsics[3]};
  d.coefficients.assign(intrinsics.begin() + 4, intrinsics.end());
  if (d.coefficients.empty()) d.coefficients = {0, 0, 0, 0};
  const auto size = root.At("imagersize").ElementsExactly(2);
  constexpr int kMaxSizePx = 100000;
  d.width_px = size[0].Integer(1, kMaxSizePx);
  d.height_px = size[1].Integer(1, kMaxSizePx);
  return file;
}

}  // namespace thicklens::io
