// thicklens camera init: a camera file from a data sheet or from a photograph's EXIF.
#include "tools/commands/camera_init.h"

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <cmath>
#include <memory>
#include <opencv2/core/mat.hpp>
#include <vector>

#include "thicklens/base/error.h"
#include "thicklens/base/output_file.h"
#include "thicklens/base/printable_text.h"
#include "thicklens/distortion.h"
#include "thicklens/io/image_io.h"
#include "thicklens/model/camera_file.h"
#include "tools/commands/camera_verify.h"
#include "tools/commands/commands.h"
#include "tools/options/command_frame.h"
#include "tools/options/distortion_option.h"
#include "tools/options/interface_options.h"
#include "tools/options/option_values.h"
#include "tools/report/distortion_words.h"
#include "tools/report/files_read_json.h"

namespace thicklens::tools {
namespace {

constexpr double kMaxLengthMm = 10000;
constexpr double kMaxFNumber = 1000;
constexpr double kMaxPitchUm = 1000;
constexpr double kUmPerMm = 1000;

struct CameraInitOptions {
  CommonOptions common;
  CameraDescription camera;
  std::string size;
  std::string principal_point;
  std::string photo_path;
  std::string distortion;  // FILE or FILE:CAMERA
  std::string output;
};

// A number, and whether it was assumed.
struct Known {
  double value = 0;
  bool assumed = false;
};

std::optional<Known> GivenOr(const std::optional<double>& given,
                             const std::optional<double>& from_photo) {
  if (given) return Known{*given, false};
  if (from_photo) return Known{*from_photo, true};
  return std::nullopt;
}

// Collects what is missing, so that everything is reported at once.
Known Require(const std::optional<Known>& known, const std::string& what,
              std::vector<std::string>* missing) {
  if (!known) missing->push_back(what);
  return known.value_or(Known{});
}

double Take(const Known& known, const char* field, model::Camera* camera) {
  if (known.assumed) camera->statements[field] = {0, true};
  return known.value;
}

void DescribeLens(const CameraDescription& given, const Known& focal, const Known& f_number,
                  model::Camera* camera) {
  model::ThickLens& lens = camera->lens;
  lens.front_focal_length_mm = Take(focal, "lens.front_focal_length_mm", camera);
  lens.rear_focal_length_mm =
      Take(*GivenOr(given.rear_focal_length_mm, focal.value), "lens.rear_focal_length_mm", camera);
  lens.lens_thickness_mm =
      Take(*GivenOr(given.lens_thickness_mm, 0.0), "lens.lens_thickness_mm", camera);
  // The f-number N is the focal length divided by the diameter of the entrance pupil, which is
  // assumed to equal the aperture on the front principal plane: r = f1/(2 N), mm [D9].
  const Known radius{focal.value / (2 * f_number.value), focal.assumed || f_number.assumed};
  lens.aperture_radius_mm = Take(radius, "lens.aperture_radius_mm", camera);
}

// A given curve is taken as it is, and so is that of a raw file, whose values are linear. What
// another file states is the photograph's, not the camera's, and is assumed to be that of all.
void DescribeTransfer(const CameraDescription& given, const io::ImageFacts* facts,
                      model::Camera* camera) {
  model::TransferCurve& transfer = camera->sensor.transfer;
  if (given.transfer) {
    transfer = model::TransferCurve::FromName(*given.transfer);
    return;
  }
  if (facts != nullptr && facts->raw) {
    transfer = model::TransferCurve::Linear();
    return;
  }
  const bool is_linear = facts != nullptr && facts->transfer == io::StatedTransfer::kLinear;
  transfer = is_linear ? model::TransferCurve::Linear() : model::TransferCurve::Srgb();
  camera->statements["sensor.transfer"] = {0, true};
}

void DescribeSensor(const CameraDescription& given, const Known& pitch_mm,
                    const Eigen::Vector2i& size_px, model::Camera* camera) {
  model::Sensor& sensor = camera->sensor;
  sensor.width_px = size_px.x();
  sensor.height_px = size_px.y();
  sensor.pixel_pitch_mm = Take(pitch_mm, "sensor.pixel_pitch_mm", camera);
  if (given.principal_point_px) {
    sensor.principal_point_px = *given.principal_point_px;
    return;
  }
  const Eigen::Vector2d middle = (size_px - Eigen::Vector2i(1, 1)).cast<double>() / 2;
  sensor.principal_point_px = {Take({middle.x(), true}, "sensor.principal_point_px[0]", camera),
                               Take({middle.y(), true}, "sensor.principal_point_px[1]", camera)};
}

void ParseTexts(CameraInitOptions* options) {
  if (!options->size.empty()) {
    const auto px = SplitPixels("--size", options->size, 'x', "WIDTHxHEIGHT");
    if (px.size() != 2 || px[0] < 1 || px[1] < 1) {
      throw UsageError(fmt::format("--size: WIDTHxHEIGHT, each above 0, is expected, found '{}'",
                                   options->size));
    }
    options->camera.size_px = Eigen::Vector2i(px[0], px[1]);
  }
  if (options->principal_point.empty()) return;
  const auto point = SplitNumbers("--principal-point", options->principal_point, ',', "x,y in px");
  if (point.size() != 2) {
    throw UsageError(fmt::format("--principal-point: x,y in px is expected, found '{}'",
                                 options->principal_point));
  }
  options->camera.principal_point_px = Eigen::Vector2d(point[0], point[1]);
}

// LibRaw reads raw files whose metadata Exiv2 does not: what is missing must then be given.
io::PhotoExif ReadExifOf(const std::string& path, const Eigen::Vector2i& size_px,
                         const io::ImageFacts& facts) {
  if (!facts.raw) return io::ReadPhotoExif(path, size_px.x(), size_px.y());
  std::string why;
  io::PhotoExif photo = io::ReadExifIfAny(path, size_px.x(), size_px.y(), &why, &*facts.raw);
  if (!why.empty()) {
    spdlog::warn("{}", PrintableUtf8(why));
    photo.why_no_pitch = "its metadata cannot be read";
  } else if (!photo.pixel_pitch_mm && photo.why_no_pitch.empty()) {
    photo.why_no_pitch = "Exiv2 does not read the metadata of this kind of raw file";
  }
  if (photo.model.empty()) photo.model = facts.raw->camera;
  return photo;
}

// The distortion of the camera. It was measured with the principal point of the lens, which is
// taken unless another one was given.
void TakeDistortion(const CameraInitOptions& options, model::Camera* camera) {
  const CommandRun run(options.common, {{"distortion", "--distortion"}});
  model::Sensor& sensor = camera->sensor;
  camera->distortion =
      ReadLensDistortion(options.distortion, sensor.width_px, sensor.height_px, run.control());
  std::string why;
  if (!camera->IsValid(&why)) throw Error("--distortion: " + why);
  if (options.camera.principal_point_px) return;
  sensor.principal_point_px =
      camera->distortion->ScaledTo(sensor.width_px, sensor.height_px).principal_point_px;
  camera->statements.erase("sensor.principal_point_px[0]");
  camera->statements.erase("sensor.principal_point_px[1]");
}

CommandResult InitCamera(const CameraInitOptions& options) {
  std::optional<OutputFile> output;
  if (!options.output.empty()) output.emplace(options.output);
  std::optional<io::PhotoExif> photo;
  std::optional<Eigen::Vector2i> photo_size_px;
  std::optional<io::ImageFacts> facts;
  if (!options.photo_path.empty()) {
    const cv::Mat image = io::ReadImageFile(options.photo_path, &facts.emplace());
    spdlog::info("{}: {}", PrintableUtf8(options.photo_path), PrintableUtf8(facts->OneLine()));
    photo_size_px = Eigen::Vector2i(image.cols, image.rows);
    const Eigen::Vector2i size_px = options.camera.size_px.value_or(*photo_size_px);
    photo = ReadExifOf(options.photo_path, size_px, *facts);
  }
  model::Camera camera =
      DescribedCamera(options.camera, photo, photo_size_px, facts ? &*facts : nullptr);
  if (!options.distortion.empty()) TakeDistortion(options, &camera);
  const SensorSources sources = SourcesOf(options.camera, photo, facts ? &*facts : nullptr);
  const std::string yaml =
      (photo ? SourcesComment(sources) : std::string()) + model::CameraToYaml(camera);
  if (output) output->Commit(yaml);
  PrintResult(options.common, output ? WrittenText({options.output}) : yaml);
  ReportAssumedFields(camera);
  CommandResult result;
  result.is_written = output.has_value();
  result.summary = {{"status", "ok"},
                    {"reason", ""},
                    {"name", camera.name},
                    {"front_focal_length_mm", camera.lens.front_focal_length_mm},
                    {"rear_focal_length_mm", camera.lens.rear_focal_length_mm},
                    {"lens_thickness_mm", camera.lens.lens_thickness_mm},
                    {"aperture_radius_mm", camera.lens.aperture_radius_mm},
                    {"width_px", camera.sensor.width_px},
                    {"height_px", camera.sensor.height_px},
                    {"size_source", sources.size},
                    {"pixel_pitch_mm", camera.sensor.pixel_pitch_mm},
                    {"pixel_pitch_source", sources.pixel_pitch},
                    {"principal_point_px",
                     {camera.sensor.principal_point_px.x(), camera.sensor.principal_point_px.y()}},
                    {"transfer", camera.sensor.transfer.Name()},
                    {"psf", model::PsfName(camera.psf)},
                    {"distortion", DistortionJson(camera.distortion)},
                    {"read", FileReadJson(options.photo_path, facts ? &*facts : nullptr)},
                    {"assumed", model::AssumedFields(camera)}};
  return result;
}

void AddLensOptions(CLI::App* command, CameraDescription* camera) {
  command->add_option("--focal-mm", camera->front_focal_length_mm, "Front focal length f1")
      ->check(Between(0, kMaxLengthMm, "millimetres"))
      ->type_name("MM");
  command
      ->add_option("--rear-focal-mm", camera->rear_focal_length_mm,
                   "Rear focal length f2; default: equal to the front one, marked as assumed")
      ->check(Between(0, kMaxLengthMm, "millimetres"))
      ->type_name("MM");
  command
      ->add_option("--thickness-mm", camera->lens_thickness_mm,
                   "Distance from the front to the rear principal plane, negative if they cross; "
                   "default: 0, marked as assumed")
      ->check(Between(-kMaxLengthMm, kMaxLengthMm, "millimetres"))
      ->type_name("MM");
  command
      ->add_option("--f-number", camera->f_number,
                   "Focal length divided by the diameter of the entrance pupil, which is assumed "
                   "to equal the aperture: its radius is f1/(2 N)")
      ->check(Between(0, kMaxFNumber, "focal length over pupil diameter"))
      ->type_name("N");
}

void AddSensorOptions(CLI::App* command, CameraInitOptions* options) {
  CameraDescription& camera = options->camera;
  command
      ->add_option(
          "--pitch-um", camera.pixel_pitch_um,
          "Distance between neighbouring pixels; default: what EXIF or TIFF/EP states, if it "
          "is about the pixels of the photograph")
      ->check(Between(0, kMaxPitchUm, "micrometres"))
      ->type_name("UM");
  command
      ->add_option("--size", options->size,
                   "Size of the images; default: that of the photograph, which is the active area "
                   "of the sensor for a raw file")
      ->type_name("WIDTHxHEIGHT");
  command
      ->add_option("--principal-point", options->principal_point,
                   "Point where the axis meets the sensor, px; the centre of the top-left pixel is "
                   "0,0; default: the middle, marked as assumed")
      ->type_name("X,Y");
  command
      ->add_option("--transfer", camera.transfer,
                   "How light becomes encoded values: linear, srgb or gamma-G, e.g. gamma-2.2; "
                   "default: linear for a raw photograph, or srgb, marked as assumed")
      ->check(TransferCurveName())
      ->type_name("NAME");
  command->add_option("--psf", camera.psf, "Shape of the defocus blur: gaussian or disc")
      ->check(CLI::IsMember({"gaussian", "disc"}))
      ->capture_default_str()
      ->type_name("NAME");
  command
      ->add_option("--name", camera.name,
                   "Name of the camera; default: the model in EXIF, or camera")
      ->type_name("TEXT");
}

}  // namespace

model::Camera DescribedCamera(const CameraDescription& description,
                              const std::optional<io::PhotoExif>& photo,
                              const std::optional<Eigen::Vector2i>& photo_size_px,
                              const io::ImageFacts* facts) {
  std::optional<double> pitch_mm;
  if (description.pixel_pitch_um) pitch_mm = *description.pixel_pitch_um / kUmPerMm;
  const std::string why_no_pitch =
      photo && !photo->why_no_pitch.empty() ? " (" + photo->why_no_pitch + ")" : "";
  const io::PhotoExif exif = photo.value_or(io::PhotoExif{});

  std::vector<std::string> missing;
  const Known focal = Require(GivenOr(description.front_focal_length_mm, exif.focal_length_mm),
                              "the focal length: --focal-mm MM", &missing);
  const Known f_number =
      Require(GivenOr(description.f_number, exif.f_number), "the f-number: --f-number N", &missing);
  const Known pitch = Require(GivenOr(pitch_mm, exif.pixel_pitch_mm),
                              "the pixel pitch: --pitch-um UM" + why_no_pitch, &missing);
  const auto size_px = description.size_px ? description.size_px : photo_size_px;
  if (!size_px) missing.emplace_back("the image size: --size WIDTHxHEIGHT");
  if (!missing.empty()) throw Error(fmt::format("missing: {}", fmt::join(missing, "; ")));

  model::Camera camera;
  camera.name = !description.name.empty() ? description.name
                : exif.model.empty()      ? "camera"
                                          : PrintableUtf8(exif.model);
  DescribeLens(description, focal, f_number, &camera);
  DescribeSensor(description, pitch, *size_px, &camera);
  DescribeTransfer(description, facts, &camera);
  camera.psf = description.psf == "disc" ? model::Psf::kDisc : model::Psf::kGaussian;
  std::string why;
  if (!camera.IsValid(&why)) throw Error(why);
  return camera;
}

SensorSources SourcesOf(const CameraDescription& description,
                        const std::optional<io::PhotoExif>& photo, const io::ImageFacts* facts) {
  SensorSources sources;
  const io::RawFacts* const raw = facts != nullptr && facts->raw ? &*facts->raw : nullptr;
  if (description.size_px) {
    sources.size = "given";
  } else if (raw != nullptr && !raw->why_resampled.empty()) {
    sources.size = "the image of the raw file, whose pixels are not those of the sensor: " +
                   raw->why_resampled;
  } else if (raw != nullptr) {
    sources.size = fmt::format(
        "the active area of the raw file's sensor, which has {} x {} px; it begins at ({}, {})",
        raw->sensor_width_px, raw->sensor_height_px, raw->active_left_px, raw->active_top_px);
  } else {
    sources.size = "the photograph";
  }
  sources.pixel_pitch = description.pixel_pitch_um ? "given" : photo ? photo->pitch_source : "";
  return sources;
}

std::string SourcesComment(const SensorSources& sources) {
  return fmt::format("# width_px, height_px: {}\n# pixel_pitch_mm: {}\n", sources.size,
                     sources.pixel_pitch);
}

void AddCameraCommand(CLI::App* program, CommandAction* action) {
  CLI::App* camera = program->add_subcommand("camera", "Camera files");
  camera->require_subcommand(1);
  CLI::App* command = camera->add_subcommand(
      "init", "A camera file from data-sheet values or from a photograph's EXIF");
  const auto options = std::make_shared<CameraInitOptions>();
  command
      ->add_option(
          "--from-exif", options->photo_path,
          "Take values that are not given from this photograph; they are marked as assumed")
      ->type_name("PHOTO");
  AddLensOptions(command, &options->camera);
  AddSensorOptions(command, options.get());
  command
      ->add_option("--distortion", options->distortion,
                   "Lens distortion of the camera, and its principal point unless "
                   "--principal-point states another: a file of OpenCV, ROS, Kalibr, COLMAP or "
                   "mrcal, FILE:CAMERA in a file of several")
      ->type_name("FILE[:CAMERA]");
  command
      ->add_option("-o,--output", options->output, "Camera file to write; default: standard output")
      ->type_name("CAMERA.yaml");
  AddCommonOptions(command, &options->common);
  command->callback([options, action] {
    *action = [options] {
      ParseTexts(options.get());
      if (options->output == "-") options->output.clear();
      if (options->output.empty() && options->common.json_path == "-") {
        throw UsageError(
            "--json -: the camera file also goes to standard output; give --output FILE, or --json "
            "FILE");
      }
      RequireDistinctFiles({options->output, options->common.json_path},
                           {options->photo_path, FileOfDistortion(options->distortion)});
      RunCommand(options->common, [&] { return InitCamera(*options); });
    };
  });
  AddCameraVerifyCommand(camera, action);  // in the order of work
}

}  // namespace thicklens::tools
