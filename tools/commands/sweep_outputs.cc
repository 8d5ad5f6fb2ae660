#include "tools/commands/sweep_outputs.h"

#include <fmt/format.h>

#include <filesystem>
#include <functional>
#include <memory>
#include <opencv2/core.hpp>
#include <system_error>
#include <utility>
#include <vector>

#include "thicklens/base/cancel.h"
#include "thicklens/base/parallel.h"
#include "thicklens/image.h"
#include "thicklens/io/image_file.h"
#include "thicklens/model/psf_file.h"
#include "tools/options/option_values.h"

namespace thicklens::tools {
namespace {

namespace fs = std::filesystem;

constexpr char kMapEnding[] = ".pfm";
constexpr char kMapTiff[] = ".tif";

bool HasEnding(const std::string& path, const std::string& ending) {
  return path.size() > ending.size() &&
         path.compare(path.size() - ending.size(), std::string::npos, ending) == 0;
}

std::function<void(int, int)> ProgressOf(const RunControl& control, const char* stage) {
  return [&control, stage](int done, int total) {
    ThrowIfCancelled();
    if (control.progress) control.progress({stage, done, total});
  };
}

std::vector<float> ValuesOf(const cv::Mat& image) {
  std::vector<float> values;
  values.reserve(image.total() * static_cast<std::size_t>(image.channels()));
  for (int y = 0; y < image.rows; ++y) {
    const auto* row = image.ptr<float>(y);
    values.insert(values.end(), row,
                  row + static_cast<std::ptrdiff_t>(image.cols) * image.channels());
  }
  return values;
}

// The image is encoded as the camera encodes its frames, with 16 bits where the kind has them.
std::string ImageBytes(const cv::Mat& light, const model::Camera& camera, const std::string& path) {
  const Image image = Image::FromLight(
      light.cols, light.rows, light.channels() == 3 ? ChannelOrder::kRgb : ChannelOrder::kGrey,
      ValuesOf(light), camera.sensor.transfer, path);
  ImageFileOptions options;
  options.format = ImageFormatOfName(path);
  const bool has_words = options.format == ImageFileFormat::kPng ||
                         options.format == ImageFileFormat::kTiff ||
                         options.format == ImageFileFormat::kPnm;
  options.bits = has_words ? 16 : 8;
  options.description = "thicklens: all-in-focus image of a focus sweep";
  return EncodeImage(image, options).bytes;
}

void MakeImages(const SweepOutputPaths& paths, const calib::FocusSweep& sweep,
                const RunControl& control, const Calibration& calibration, SweepImaging* imaging,
                std::vector<std::string>* warnings, SweepOutputBytes* bytes) {
  calib::MergeOptions options;
  options.progress = ProgressOf(control, "merging");
  imaging->merged = calib::MergeFrames(sweep, calibration, options);
  calib::MergedFrames& merged = *imaging->merged;
  if (!merged.done) {
    for (const std::string& path : {paths.image, paths.focus_map}) {
      if (!path.empty())
        warnings->push_back(fmt::format("{} is not written: {}", path, merged.message));
    }
  }
  if (merged.done && !paths.image.empty())
    bytes->image = ImageBytes(merged.light, calibration.camera, paths.image);
  if (merged.done && !paths.focus_map.empty()) {
    const cv::Mat& map = merged.height_mm.empty() ? merged.focus_reading_mm : merged.height_mm;
    io::ImageWriting writing;
    writing.is_linear = true;
    bytes->focus_map = io::EncodeImageFile(
        map,
        HasEnding(paths.focus_map, kMapEnding) ? io::ImageFormat::kPfm : io::ImageFormat::kTiff,
        writing);
  }
  // The numbers stay.
  merged.light.release();
  merged.focus_reading_mm.release();
  merged.height_mm.release();
}

// The folder of a file, without links and without "..".
fs::path FolderOf(const std::string& path) {
  const fs::path folder = fs::absolute(fs::path(path)).parent_path();
  std::error_code failed;
  fs::path found = fs::weakly_canonical(folder, failed);
  return failed ? folder.lexically_normal() : found;
}

// The name by which a camera file in its folder refers to the PSF's file: relative or, where there
// is no such way, absolute.
std::string NameFromCamera(const std::string& psf, const std::string& camera) {
  if (camera.empty()) return psf;
  const fs::path file = FolderOf(psf) / fs::path(psf).filename();
  const fs::path name = file.lexically_relative(FolderOf(camera));
  return (name.empty() ? file : name).generic_string();
}

void MakePsf(const SweepOutputPaths& paths, const std::string& camera_output,
             const calib::FocusSweep& sweep, const RunControl& control, Calibration* calibration,
             SweepImaging* imaging, SweepOutputBytes* bytes) {
  calib::PsfOptions options;
  options.threads = ResolveThreads(control.threads);
  options.progress = ProgressOf(control, "measuring the PSF");
  imaging->psf = calib::MeasurePsf(sweep, *calibration, options);
  if (!imaging->psf->done) {
    calibration->summary.warnings.push_back(
        fmt::format("{} is not written: {}", paths.psf, imaging->psf->message));
    return;
  }
  bytes->psf = model::PsfToYaml(imaging->psf->psf);
  model::MeasuredPsf psf = imaging->psf->psf;
  psf.file = NameFromCamera(paths.psf, camera_output);
  calibration->camera.measured_psf = std::make_shared<const model::MeasuredPsf>(std::move(psf));
}

// A camera that came with a measured PSF keeps it, named as seen from its new place.
void KeepPsf(const std::string& camera_output, Calibration* calibration) {
  const auto& given = calibration->camera.measured_psf;
  if (given == nullptr || given->file.empty() || camera_output.empty()) return;
  const fs::path named(given->file);
  if (named.is_absolute()) return;
  model::MeasuredPsf psf = *given;
  psf.file = NameFromCamera((fs::path(calibration->camera.source).parent_path() / named).string(),
                            camera_output);
  calibration->camera.measured_psf = std::make_shared<const model::MeasuredPsf>(std::move(psf));
}

}  // namespace

void AddSweepOutputOptions(CLI::App* command, SweepOutputPaths* paths) {
  command
      ->add_option("--all-in-focus", paths->image,
                   "Image to write in which each part is as sharp as in its sharpest frame (focus "
                   "stacking); the kind of file is that of the name")
      ->type_name("IMAGE");
  command
      ->add_option("--focus-map", paths->focus_map,
                   "Map to write: for each pixel the height of the target toward the camera in mm "
                   "or, without a bench offset, the reading at which it is sharpest; .pfm or .tif")
      ->type_name("MAP.pfm");
  command
      ->add_option(
          "--write-psf", paths->psf,
          "Measure the shape of the defocus blur and write it; the camera of --output then "
          "has psf: measured")
      ->type_name("PSF.yaml");
}

void CheckSweepOutputs(const SweepOutputPaths& paths) {
  if (!paths.image.empty()) {
    try {
      static_cast<void>(ImageFormatOfName(paths.image));
    } catch (const Error& error) {
      throw UsageError(fmt::format("--all-in-focus {}", error.what()));
    }
  }
  if (!paths.focus_map.empty() && !HasEnding(paths.focus_map, kMapEnding) &&
      !HasEnding(paths.focus_map, kMapTiff)) {
    throw UsageError(fmt::format("--focus-map {}: a name that ends in {} or {} is expected",
                                 paths.focus_map, kMapEnding, kMapTiff));
  }
}

void RequireFramesOfOutputs(const SweepOutputPaths& paths, model::SweepRaw raw) {
  if (raw != model::SweepRaw::kGreen) return;
  for (const auto& [option, path] :
       {std::pair("--all-in-focus", &paths.image), std::pair("--focus-map", &paths.focus_map),
        std::pair("--write-psf", &paths.psf)}) {
    if (path->empty()) continue;
    throw UsageError(
        fmt::format("{} is not made of the green sites of raw files: state raw: demosaiced, or "
                    "leave {} out",
                    option, option));
  }
}

SweepOutputFiles ClaimSweepOutputs(const SweepOutputPaths& paths) {
  SweepOutputFiles files;
  if (!paths.image.empty()) files.image.emplace(paths.image);
  if (!paths.focus_map.empty()) files.focus_map.emplace(paths.focus_map);
  if (!paths.psf.empty()) files.psf.emplace(paths.psf);
  return files;
}

void MakeSweepOutputs(const SweepOutputPaths& paths, const std::string& camera_output,
                      const calib::FocusSweep& sweep, const calib::FocusSweep& part,
                      const RunControl& control, Calibration* calibration, SweepImaging* imaging,
                      SweepOutputBytes* bytes) {
  KeepPsf(camera_output, calibration);
  if (!paths.image.empty() || !paths.focus_map.empty())
    MakeImages(paths, sweep, control, *calibration, imaging, &calibration->summary.warnings, bytes);
  if (!paths.psf.empty()) MakePsf(paths, camera_output, part, control, calibration, imaging, bytes);
}

void CommitSweepOutputs(const SweepOutputBytes& bytes, SweepOutputFiles* files) {
  if (!bytes.image.empty()) files->image->Commit(bytes.image);
  if (!bytes.focus_map.empty()) files->focus_map->Commit(bytes.focus_map);
  if (!bytes.psf.empty()) files->psf->Commit(bytes.psf);
}

}  // namespace thicklens::tools
