// cameras.txt and cameras.bin of COLMAP. In its pixels the centre of the first one is (0.5, 0.5).
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <limits>
#include <string_view>

#include "tools/io/lens/distortion_formats.h"

namespace thicklens::io {
namespace {

using model::DistortionModel;
using model::LensDistortion;

struct ColmapModel {
  const char* name;
  std::size_t parameters;  // how many numbers it has
  bool one_focal_length;   // f instead of fx and fy
  bool is_known;           // one of OpenCV's
  DistortionModel model;
};
// In the order of their numbers in cameras.bin.
constexpr std::array<ColmapModel, 12> kModels = {{
    {"SIMPLE_PINHOLE", 3, true, true, DistortionModel::kOpenCv},
    {"PINHOLE", 4, false, true, DistortionModel::kOpenCv},
    {"SIMPLE_RADIAL", 4, true, true, DistortionModel::kOpenCv},
    {"RADIAL", 5, true, true, DistortionModel::kOpenCv},
    {"OPENCV", 8, false, true, DistortionModel::kOpenCv},
    {"OPENCV_FISHEYE", 8, false, true, DistortionModel::kFisheye},
    {"FULL_OPENCV", 12, false, true, DistortionModel::kOpenCv},
    {"FOV", 5, false, false, DistortionModel::kOpenCv},
    {"SIMPLE_RADIAL_FISHEYE", 4, true, true, DistortionModel::kFisheye},
    {"RADIAL_FISHEYE", 5, true, true, DistortionModel::kFisheye},
    {"THIN_PRISM_FISHEYE", 12, false, false, DistortionModel::kFisheye},
    {"RAD_TAN_THIN_PRISM_FISHEYE", 16, false, false, DistortionModel::kFisheye},
}};

// A camera as both files state it.
struct ColmapCamera {
  std::string id;
  std::string model;
  std::int64_t width_px = 0, height_px = 0;
  std::vector<double> parameters;
  std::string place;  // for messages
};

const ColmapModel* ModelOf(const std::string& name) {
  const auto* found = std::find_if(kModels.begin(), kModels.end(),
                                   [&](const ColmapModel& model) { return name == model.name; });
  return found == kModels.end() ? nullptr : found;
}

LensDistortionFile Convert(const ColmapCamera& camera, const char* format) {
  const ColmapModel* model = ModelOf(camera.model);
  if (model == nullptr || !model->is_known) {
    throw NotOfOpenCv(camera.place, camera.model + " of COLMAP",
                      "reconstruct with OPENCV, FULL_OPENCV or OPENCV_FISHEYE (colmap "
                      "feature_extractor --ImageReader.camera_model OPENCV)");
  }
  if (camera.parameters.size() != model->parameters) {
    throw Error(fmt::format("{}: the model {} has {} parameters, found {}", camera.place,
                            camera.model, model->parameters, camera.parameters.size()));
  }
  constexpr std::int64_t kMaxSizePx = 100000;
  if (camera.width_px < 1 || camera.height_px < 1 || camera.width_px > kMaxSizePx ||
      camera.height_px > kMaxSizePx) {
    throw Error(fmt::format("{}: a size of 1 to {} px is expected, found {} x {}", camera.place,
                            kMaxSizePx, camera.width_px, camera.height_px));
  }
  LensDistortionFile file;
  file.format = format;
  file.camera = camera.id;
  LensDistortion& d = file.distortion;
  d.model = model->model;
  d.width_px = static_cast<int>(camera.width_px);
  d.height_px = static_cast<int>(camera.height_px);
  const std::vector<double>& p = camera.parameters;
  const std::size_t focal = model->one_focal_length ? 1 : 2;
  d.focal_length_px = {p[0], p[focal - 1]};
  constexpr double kCentreOfFirstPixel = 0.5;
  d.principal_point_px = {p[focal] - kCentreOfFirstPixel, p[focal + 1] - kCentreOfFirstPixel};
  d.coefficients.assign(p.begin() + static_cast<std::ptrdiff_t>(focal + 2), p.end());
  // The models with fewer parameters are those of OpenCV with zeros. No model of COLMAP has a
  // number of coefficients between 4 and 8.
  if (d.coefficients.size() < 4) d.coefficients.resize(4, 0);
  return file;
}

LensDistortionFile Chosen(const CalibrationText& text, const std::vector<ColmapCamera>& cameras,
                          const char* format) {
  if (cameras.empty()) throw Error(fmt::format("{}: it has no camera", text.name));
  std::vector<std::string> ids;
  for (const ColmapCamera& camera : cameras) {
    if (camera.id == text.camera) return Convert(camera, format);
    ids.push_back(camera.id);
  }
  if (!text.camera.empty() || cameras.size() > 1) ThrowNoSuchCamera(text, ids);
  LensDistortionFile file = Convert(cameras.front(), format);
  file.camera.clear();
  return file;
}

std::vector<std::string_view> Words(std::string_view line) {
  constexpr std::size_t kMost = 64;
  std::vector<std::string_view> words;
  std::size_t at = 0;
  while (words.size() < kMost &&
         (at = line.find_first_not_of(" \t\r,", at)) != std::string_view::npos) {
    const std::size_t end = std::min(line.find_first_of(" \t\r,", at), line.size());
    words.push_back(line.substr(at, end - at));
    at = end;
  }
  return words;
}

template <typename Number>
bool Parsed(std::string_view word, Number* number) {
  const auto [stop, failure] = std::from_chars(word.data(), word.data() + word.size(), *number);
  return failure == std::errc() && stop == word.data() + word.size();
}

// Calls `take` with each line that is not empty and no comment, and its number, until it returns
// false.
template <typename Take>
void ForLines(const std::string& bytes, const Take& take) {
  std::size_t begin = 0;
  for (int number = 1; begin < bytes.size(); ++number) {
    const std::size_t end = std::min(bytes.find('\n', begin), bytes.size());
    const std::string_view line(bytes.data() + begin, end - begin);
    begin = end + 1;
    const std::size_t first = line.find_first_not_of(" \t\r");
    if (first == std::string_view::npos || line[first] == '#') continue;
    if (!take(line, number)) return;
  }
}

// Little endian, as COLMAP writes on every machine.
class BinaryReader {
 public:
  explicit BinaryReader(const CalibrationText& text) : text_(text) {}

  std::uint64_t Unsigned(std::size_t size) {
    if (text_.bytes.size() - at_ < size) {
      throw Error(fmt::format("{}: it ends after {} bytes, in the middle of a camera", text_.name,
                              text_.bytes.size()));
    }
    std::uint64_t value = 0;
    for (std::size_t i = size; i-- > 0;)
      value = (value << 8U) | static_cast<unsigned char>(text_.bytes[at_ + i]);
    at_ += size;
    return value;
  }
  double Number() {
    const std::uint64_t bits = Unsigned(sizeof(double));
    double number = 0;
    std::memcpy(&number, &bits, sizeof number);
    return number;
  }
  std::size_t left() const { return text_.bytes.size() - at_; }

 private:
  const CalibrationText& text_;
  std::size_t at_ = 0;
};

}  // namespace

bool IsColmapText(const std::string& bytes) {
  bool is_colmap = false;
  ForLines(bytes, [&](std::string_view line, int /*number*/) {
    const std::vector<std::string_view> words = Words(line);
    std::int64_t id = 0, width = 0;
    constexpr std::string_view kCapitals = "ABCDEFGHIJKLMNOPQRSTUVWXYZ_0123456789";
    is_colmap = words.size() >= 4 && Parsed(words[0], &id) &&
                words[1].find_first_not_of(kCapitals) == std::string_view::npos &&
                words[1].front() >= 'A' && Parsed(words[2], &width);
    return false;
  });
  return is_colmap;
}

LensDistortionFile ReadColmapText(const CalibrationText& text) {
  std::vector<ColmapCamera> cameras;
  ForLines(text.bytes, [&](std::string_view line, int number) {
    ColmapCamera camera;
    const std::vector<std::string_view> words = Words(line);
    camera.place = fmt::format("{}: line {}", text.name, number);
    std::int64_t id = 0;
    if (words.size() < 4 || !Parsed(words[0], &id) || !Parsed(words[2], &camera.width_px) ||
        !Parsed(words[3], &camera.height_px)) {
      throw Error(
          fmt::format("{}: CAMERA_ID MODEL WIDTH HEIGHT PARAMS are expected", camera.place));
    }
    camera.id = std::to_string(id);
    camera.model = words[1];
    for (std::size_t i = 4; i < words.size(); ++i) {
      double value = 0;
      if (!Parsed(words[i], &value) || !std::isfinite(value)) {
        constexpr std::size_t kShown = 40;
        throw Error(fmt::format("{}: parameter {}: a finite number is expected, found '{}'",
                                camera.place, i - 3, words[i].substr(0, kShown)));
      }
      camera.parameters.push_back(value);
    }
    cameras.push_back(std::move(camera));
    constexpr std::size_t kMaxCameras = 1000000;
    if (cameras.size() > kMaxCameras)
      throw Error(fmt::format("{}: it has more than {} cameras", text.name, kMaxCameras));
    return true;
  });
  return Chosen(text, cameras, "COLMAP cameras.txt");
}

LensDistortionFile ReadColmapBinary(const CalibrationText& text) {
  BinaryReader reader(text);
  constexpr std::size_t kLeast = 24;  // bytes of a camera without parameters
  constexpr std::size_t kCountBytes = 8, kWordBytes = 4;
  const std::string not_one = fmt::format(
      "{}: it is neither a text nor a cameras.bin of COLMAP: calibrations are read from OpenCV, "
      "ROS "
      "and Kalibr (YAML, XML, JSON), COLMAP (cameras.txt, cameras.bin) and mrcal (.cameramodel)",
      text.name);
  if (reader.left() < kCountBytes) throw Error(not_one);
  const std::uint64_t count = reader.Unsigned(kCountBytes);
  // A count is used only if the file is long enough for it.
  if (count == 0 || count > reader.left() / kLeast) throw Error(not_one);
  std::vector<ColmapCamera> cameras;
  for (std::uint64_t i = 0; i < count; ++i) {
    ColmapCamera camera;
    camera.id = std::to_string(reader.Unsigned(kWordBytes));
    const std::uint64_t number = reader.Unsigned(kWordBytes);
    camera.place = fmt::format("{}: camera {}", text.name, camera.id);
    if (number >= kModels.size()) {
      throw Error(fmt::format(
          "{}: it has the model number {} of COLMAP, which is not known here, so that the cameras "
          "behind it cannot be read either: write the model as text (colmap model_converter "
          "--output_type TXT) and state cameras.txt",
          camera.place, number));
    }
    const ColmapModel& model = kModels[static_cast<std::size_t>(number)];
    camera.model = model.name;
    constexpr std::uint64_t kMost = std::numeric_limits<std::int64_t>::max();
    camera.width_px = static_cast<std::int64_t>(std::min(reader.Unsigned(kCountBytes), kMost));
    camera.height_px = static_cast<std::int64_t>(std::min(reader.Unsigned(kCountBytes), kMost));
    for (std::size_t p = 0; p < model.parameters; ++p) {
      const double value = reader.Number();
      if (!std::isfinite(value)) {
        throw Error(fmt::format("{}: parameter {} is not a finite number", camera.place, p + 1));
      }
      camera.parameters.push_back(value);
    }
    cameras.push_back(std::move(camera));
  }
  if (reader.left() > 0) {
    throw Error(fmt::format("{}: {} bytes follow its {} cameras: it is no cameras.bin of COLMAP",
                            text.name, reader.left(), count));
  }
  return Chosen(text, cameras, "COLMAP cameras.bin");
}

}  // namespace thicklens::io
