// Calibrations in YAML or JSON: OpenCV's FileStorage, ROS's camera_info, Kalibr's camchain, and the
// camera files of this project.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <optional>

#include "thicklens/model/camera_file.h"
#include "tools/io/lens/distortion_formats.h"

namespace thicklens::io {
namespace {

using model::DistortionModel;
using model::LensDistortion;

constexpr char kOpenCvFormat[] = "OpenCV FileStorage";

// Names that programs give to the camera matrix, and to the coefficients.
constexpr const char* kMatrixNames[] = {"camera_matrix",
                                        "Camera_Matrix",
                                        "cameraMatrix",
                                        "CameraMatrix",
                                        "camera_Matrix",
                                        "intrinsic_matrix",
                                        "intrinsics_matrix",
                                        "mtx",
                                        "K",
                                        "M"};
constexpr const char* kCoefficientNames[] = {"distortion_coefficients",
                                             "Distortion_Coefficients",
                                             "distCoeffs",
                                             "DistortionCoefficients",
                                             "dist_coeffs",
                                             "distortion_coeffs",
                                             "dist_coeff",
                                             "dist_coefs",
                                             "distortionCoefficients",
                                             "distCoeff",
                                             "Distortion_Coeffiecients",
                                             "distortion",
                                             "dist",
                                             "D"};
constexpr const char* kWidthNames[] = {"image_width", "image_Width", "imageWidth",
                                       "ImageWidth",  "img_width",   "width"};
constexpr const char* kHeightNames[] = {"image_height", "image_Height", "imageHeight",
                                        "ImageHeight",  "img_height",   "height"};
constexpr const char* kSizeNames[] = {"image_size", "imageSize", "ImageSize", "img_size",
                                      "resolution"};
constexpr const char* kFisheyeNames[] = {"fisheye_model", "use_fisheye_model", "fisheye"};
constexpr const char* kModelNames[] = {"distortion_model", "camera_model", "model"};

template <std::size_t kCount>
std::string NameIn(const CalibrationFields& fields, const char* const (&names)[kCount]) {
  for (const char* name : names) {
    if (fields.Has(name)) return name;
  }
  return "";
}

std::string Lower(std::string text) {
  std::transform(text.begin(), text.end(), text.begin(), [](unsigned char c) {
    return c >= 'A' && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : static_cast<char>(c);
  });
  return text;
}

bool IsTrue(const std::string& text) {
  const std::string lower = Lower(text);
  return lower == "1" || lower == "true" || lower == "yes";
}

// The camera matrix [fx 0 cx; 0 fy cy; 0 0 1].
void TakeCameraMatrix(const CalibrationFields& fields, const std::string& key,
                      LensDistortion* distortion) {
  const std::vector<double> k = fields.Numbers(key);
  constexpr std::size_t kNine = 9;
  if (k.size() != kNine) {
    throw fields.ErrorAt(key, fmt::format("a camera matrix of 3 x 3 numbers is expected, found {} "
                                          "numbers",
                                          k.size()));
  }
  if (!(k[0] > 0 && k[4] > 0)) {
    throw fields.ErrorAt(key, fmt::format("fx and fy must be > 0, found {} and {}{}", k[0], k[4],
                                          k[0] == 0 ? ": the camera is not calibrated" : ""));
  }
  constexpr double kMaxSkew = 1e-6;
  if (!(std::abs(k[1]) <= kMaxSkew * k[0])) {
    throw fields.ErrorAt(key, fmt::format("the camera matrix has a skew of {} px, which OpenCV's "
                                          "model does not have: calibrate without it",
                                          k[1]));
  }
  const double rest = std::abs(k[3]) + std::abs(k[6]) + std::abs(k[7]) + std::abs(k[8] - 1);
  if (!(rest <= kMaxSkew)) {
    throw fields.ErrorAt(key, "[fx, 0, cx, 0, fy, cy, 0, 0, 1] are expected, row by row");
  }
  distortion->focal_length_px = {k[0], k[4]};
  distortion->principal_point_px = {k[2], k[5]};
}

void TakeSize(const CalibrationFields& fields, LensDistortion* distortion) {
  const std::string width = NameIn(fields, kWidthNames), height = NameIn(fields, kHeightNames);
  if (!width.empty() && !height.empty()) {
    distortion->width_px = fields.Size(width);
    distortion->height_px = fields.Size(height);
    return;
  }
  const std::string size = NameIn(fields, kSizeNames);
  if (size.empty()) return;
  const std::vector<double> px = fields.Numbers(size);
  constexpr double kMax = 100000;
  if (px.size() != 2 || !(px[0] >= 1 && px[0] <= kMax && px[1] >= 1 && px[1] <= kMax) ||
      px[0] != std::floor(px[0]) || px[1] != std::floor(px[1])) {
    throw fields.ErrorAt(size,
                         "width and height in px are expected, whole numbers from 1 to 100000");
  }
  distortion->width_px = static_cast<int>(px[0]);
  distortion->height_px = static_cast<int>(px[1]);
}

// The model that a name in the file stands for; absent: it is not known.
std::optional<DistortionModel> ModelOfName(const std::string& name) {
  const std::string lower = Lower(name);
  for (const char* fisheye : {"equidistant", "fisheye", "opencv_fisheye", "kannala_brandt",
                              "kannalabrandt", "kannalabrandt8"}) {
    if (lower == fisheye) return DistortionModel::kFisheye;
  }
  for (const char* brown :
       {"plumb_bob", "rational_polynomial", "radtan", "radialtangential", "radial-tangential",
        "radial_tangential", "brown", "brown_conrady", "opencv", "pinhole", "perspective",
        "standard", "thin_prism", "tilted", "none"}) {
    if (lower == brown) return DistortionModel::kOpenCv;
  }
  return std::nullopt;
}

constexpr char kCalibrateAgain[] =
    "calibrate with OpenCV's model (cv::calibrateCamera) or its fisheye model "
    "(cv::fisheye::calibrate)";

DistortionModel ModelOfFields(const CalibrationFields& fields) {
  const std::string flag = NameIn(fields, kFisheyeNames);
  if (!flag.empty() && IsTrue(fields.Text(flag))) return DistortionModel::kFisheye;
  const std::string key = NameIn(fields, kModelNames);
  if (key.empty()) return DistortionModel::kOpenCv;
  const std::string name = fields.Text(key);
  const auto model = ModelOfName(name);
  if (!model) {
    throw fields.ErrorAt(
        key, fmt::format("the model '{}' is not one of OpenCV's: {}", name, kCalibrateAgain));
  }
  return *model;
}

// Coefficients of ROS: a file of an undistorted camera has none.
void PadPinhole(LensDistortion* distortion) {
  if (distortion->coefficients.empty()) distortion->coefficients = {0, 0, 0, 0};
}

LensDistortionFile FromMatrices(const CalibrationFields& fields, const char* format,
                                const std::string& matrix, const std::string& coefficients) {
  LensDistortionFile file;
  file.format = format;
  TakeCameraMatrix(fields, matrix, &file.distortion);
  TakeSize(fields, &file.distortion);
  file.distortion.model = ModelOfFields(fields);
  file.distortion.coefficients = fields.Numbers(coefficients);
  PadPinhole(&file.distortion);
  return file;
}

// Refuses another camera of a file that has only one, which may have a name.
void RequireOnlyCamera(const CalibrationText& text, const std::string& only) {
  if (text.camera.empty() || text.camera == only) return;
  throw Error(fmt::format("{}: it has one camera{}, not '{}': leave the colon out", text.name,
                          only.empty() ? "" : fmt::format(", '{}'", only), text.camera));
}

LensDistortionFile ReadRos(const CalibrationText& text, const CalibrationFields& fields) {
  RequireOnlyCamera(text, fields.Has("camera_name") ? fields.Text("camera_name") : "");
  const std::string name = fields.Has("distortion_model") ? fields.Text("distortion_model") : "";
  const std::string matrix = NameIn(fields, kMatrixNames);
  const std::string coefficients = NameIn(fields, kCoefficientNames);
  if (coefficients.empty()) {
    throw fields.ErrorAt("distortion_model",
                         "distortion_coefficients (or D) are missing beside it");
  }
  LensDistortionFile file = FromMatrices(fields, "ROS camera_info", matrix, coefficients);
  const std::size_t count = file.distortion.coefficients.size();
  const std::string lower = Lower(name);
  const bool fits = lower == "plumb_bob"     ? count == 4 || count == 5
                    : lower == "equidistant" ? count == 4
                                             : true;
  if (!fits) {
    throw fields.ErrorAt(coefficients,
                         fmt::format("the model {} has {} coefficients, found {}", name,
                                     lower == "plumb_bob" ? "4 or 5" : "4", count));
  }
  return file;
}

LensDistortionFile ReadKalibrCamera(const CalibrationFields& fields, const std::string& place) {
  LensDistortionFile file;
  file.format = "Kalibr camchain";
  LensDistortion& d = file.distortion;
  const std::string camera =
      fields.Has("camera_model") ? Lower(fields.Text("camera_model")) : "pinhole";
  const std::string model =
      fields.Has("distortion_model") ? Lower(fields.Text("distortion_model")) : "none";
  const std::string remedy =
      "calibrate with kalibr_calibrate_cameras --models pinhole-radtan or pinhole-equi";
  if (camera != "pinhole") {
    throw fields.ErrorAt("camera_model",
                         NotOfOpenCv(place, camera + "-" + model + " of Kalibr", remedy).what());
  }
  if (model != "radtan" && model != "equidistant" && model != "equi" && model != "none") {
    throw fields.ErrorAt("distortion_model",
                         NotOfOpenCv(place, "pinhole-" + model + " of Kalibr", remedy).what());
  }
  const std::vector<double> intrinsics = fields.Numbers("intrinsics");
  if (intrinsics.size() != 4) {
    throw fields.ErrorAt("intrinsics",
                         fmt::format("the pinhole model has fu, fv, pu and pv, found {} "
                                     "numbers",
                                     intrinsics.size()));
  }
  d.focal_length_px = {intrinsics[0], intrinsics[1]};
  d.principal_point_px = {intrinsics[2], intrinsics[3]};
  d.model = model == "equidistant" || model == "equi" ? DistortionModel::kFisheye
                                                      : DistortionModel::kOpenCv;
  if (model == "none") {
    d.coefficients = {0, 0, 0, 0};
  } else {
    d.coefficients = fields.Numbers("distortion_coeffs");
    if (d.coefficients.size() != 4) {
      throw fields.ErrorAt(
          "distortion_coeffs",
          fmt::format("the model {} has 4 coefficients, found {}", model, d.coefficients.size()));
    }
  }
  TakeSize(fields, &d);
  return file;
}

// Names of the cameras of a Kalibr file, cam0 and so on.
std::vector<std::string> KalibrCameras(const YamlNode& root) {
  constexpr int kMost = 64;
  std::vector<std::string> names;
  for (int i = 0; i < kMost; ++i) {
    std::string name = fmt::format("cam{}", i);
    const auto node = root.Find(name);
    if (node && node->IsMap() && node->Has("intrinsics")) names.push_back(std::move(name));
  }
  return names;
}

LensDistortionFile ReadKalibr(const CalibrationText& text, const YamlNode& root,
                              const std::vector<std::string>& cameras) {
  std::string name = text.camera;
  if (name.empty() && cameras.size() == 1) name = cameras.front();
  const auto is_number = !name.empty() && name.find_first_not_of("0123456789") == std::string::npos;
  if (is_number) name = "cam" + name;
  if (std::find(cameras.begin(), cameras.end(), name) == cameras.end())
    ThrowNoSuchCamera(text, cameras);
  LensDistortionFile file = ReadKalibrCamera(*YamlFields(root.At(name)), name);
  file.camera = name;
  return file;
}

LensDistortionFile ReadOwnCamera(const CalibrationText& text, const std::string& yaml) {
  const model::Camera camera = model::ParseCamera(yaml, text.name);
  RequireOnlyCamera(text, camera.name);
  if (!camera.distortion) {
    throw Error(fmt::format("{}: the camera file states no lens.distortion", text.name));
  }
  LensDistortionFile file;
  file.distortion = *camera.distortion;
  file.format = "camera file";
  return file;
}

// OpenCV's first line is no directive of YAML. It becomes a comment, so that lines keep their
// numbers.
std::string AsYaml(const std::string& bytes) {
  std::string yaml = bytes;
  const std::string mark = "\xEF\xBB\xBF";
  const std::size_t at = yaml.rfind(mark, 0) == 0 ? mark.size() : 0;
  if (yaml.compare(at, 6, "%YAML:") == 0) yaml[at] = '#';
  return yaml;
}

// The number of a camera in files with one matrix for each, such as M1 and D1 of a stereo camera.
std::optional<std::string> MatrixOfCamera(const CalibrationFields& fields,
                                          const std::string& camera, std::string* coefficients) {
  for (const auto& [matrix, distortion] : {std::pair("M", "D"),
                                           {"K", "D"},
                                           {"cameraMatrix", "distCoeffs"},
                                           {"camera_matrix_", "distortion_coefficients_"},
                                           {"camera_matrix", "distortion_coefficients"}}) {
    if (!fields.Has(matrix + camera) || !fields.Has(distortion + camera)) continue;
    *coefficients = distortion + camera;
    return matrix + camera;
  }
  return std::nullopt;
}

}  // namespace

LensDistortionFile ReadOpenCvFields(const CalibrationText& text, const CalibrationFields& fields) {
  const std::string matrix = NameIn(fields, kMatrixNames);
  const std::string coefficients = NameIn(fields, kCoefficientNames);
  if (!text.camera.empty()) {
    std::string numbered;
    if (const auto own = MatrixOfCamera(fields, text.camera, &numbered)) {
      LensDistortionFile file = FromMatrices(fields, kOpenCvFormat, *own, numbered);
      file.camera = text.camera;
      return file;
    }
    if (const auto below = fields.Below(text.camera)) {
      const std::string whole;
      LensDistortionFile file = ReadOpenCvFields({text.bytes, text.name, whole}, *below);
      file.camera = text.camera;
      return file;
    }
    throw Error(fmt::format("{}: it has no camera '{}'{}", text.name, text.camera,
                            matrix.empty() ? "" : ": it has one camera, leave the colon out"));
  }
  if (!matrix.empty() && !coefficients.empty())
    return FromMatrices(fields, kOpenCvFormat, matrix, coefficients);
  std::string numbered;
  std::vector<std::string> cameras;
  for (const char* camera : {"0", "1", "2"}) {
    if (MatrixOfCamera(fields, camera, &numbered)) cameras.emplace_back(camera);
  }
  if (!cameras.empty()) ThrowNoSuchCamera(text, cameras);
  throw Error(fmt::format(
      "{}: no camera matrix with distortion coefficients was found{}: camera_matrix and "
      "distortion_coefficients of OpenCV or ROS, cam0 of Kalibr, cameras.txt or cameras.bin of "
      "COLMAP, a .cameramodel of mrcal, or a camera file with lens.distortion are expected",
      text.name,
      !matrix.empty()         ? fmt::format(" (it has {} without coefficients)", matrix)
      : !coefficients.empty() ? fmt::format(" (it has {} without a camera matrix)", coefficients)
                              : ""));
}

LensDistortionFile ReadYamlCalibration(const CalibrationText& text) {
  const std::string yaml = AsYaml(text.bytes);
  const YamlNode root = YamlNode::Parse(yaml, text.name);
  if (!root.IsMap())
    throw Error(fmt::format("{}: a map of named fields is expected at its top", text.name));
  if (root.HasSchema("thicklens/camera/2") || root.HasSchema("thicklens/camera/1"))
    return ReadOwnCamera(text, yaml);
  const std::vector<std::string> kalibr = KalibrCameras(root);
  if (!kalibr.empty()) return ReadKalibr(text, root, kalibr);
  if (root.Has("intrinsics") && root.Has("camera_model") && root.Has("distortion_coeffs")) {
    RequireOnlyCamera(text, "");
    return ReadKalibrCamera(*YamlFields(root), text.name);
  }
  const auto info = root.Find("camera_info");
  const std::unique_ptr<CalibrationFields> fields =
      YamlFields(info && info->IsMap() ? *info : root);
  if (fields->Has("distortion_model") && !NameIn(*fields, kMatrixNames).empty())
    return ReadRos(text, *fields);
  return ReadOpenCvFields(text, *fields);
}

}  // namespace thicklens::io
