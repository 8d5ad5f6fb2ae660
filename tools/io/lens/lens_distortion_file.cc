#include "thicklens/io/lens_distortion_file.h"

#include <fmt/format.h>

#include <filesystem>
#include <system_error>

#include "thicklens/base/input_file.h"
#include "tools/io/lens/distortion_formats.h"

namespace thicklens::io {
namespace {

// Whether the text, after white space and a byte order mark, begins with <.
bool IsXml(const std::string& bytes) {
  const std::size_t mark = bytes.rfind("\xEF\xBB\xBF", 0) == 0 ? 3 : 0;
  const std::size_t first = bytes.find_first_not_of(" \t\r\n", mark);
  return first != std::string::npos && bytes[first] == '<';
}

LensDistortionFile Parse(const CalibrationText& text) {
  if (text.bytes.find('\0') != std::string::npos) return ReadColmapBinary(text);
  if (IsXml(text.bytes)) return ReadOpenCvFields(text, *XmlFields(text));
  if (IsColmapText(text.bytes)) return ReadColmapText(text);
  if (IsMrcal(text.bytes)) return ReadMrcal(text);
  return ReadYamlCalibration(text);
}

}  // namespace

LensDistortionFile ParseLensDistortion(const std::string& bytes, const std::string& name,
                                       const std::string& camera, int width_px, int height_px) {
  LensDistortionFile file = Parse({bytes, name, camera});
  model::LensDistortion& distortion = file.distortion;
  file.states_size = distortion.width_px > 0;
  if (!file.states_size) {
    if (width_px < 1 || height_px < 1) {
      throw Error(fmt::format(
          "{}: it states no size of the photographs: image_width and image_height are expected",
          name));
    }
    distortion.width_px = width_px;
    distortion.height_px = height_px;
  }
  std::string why;
  if (!distortion.IsValid(&why)) {
    throw Error(fmt::format(
        "{}: {}{}{}", name, file.camera.empty() ? "" : fmt::format("camera {}: ", file.camera), why,
        file.states_size ? ""
                         : fmt::format(" (it states no size, and {} x {} px were assumed)",
                                       width_px, height_px)));
  }
  distortion.source = file.camera.empty() ? name : fmt::format("{}:{}", name, file.camera);
  return file;
}

std::pair<std::string, std::string> FileAndCamera(const std::string& file_and_camera) {
  std::error_code failure;
  const std::size_t colon = file_and_camera.rfind(':');
  if (colon == std::string::npos || std::filesystem::exists(file_and_camera, failure))
    return {file_and_camera, ""};
  return {file_and_camera.substr(0, colon), file_and_camera.substr(colon + 1)};
}

LensDistortionFile ReadLensDistortion(const std::string& file_and_camera, int width_px,
                                      int height_px) {
  const auto [path, camera] = FileAndCamera(file_and_camera);
  return ParseLensDistortion(ReadTextFile(path), path, camera, width_px, height_px);
}

}  // namespace thicklens::io
