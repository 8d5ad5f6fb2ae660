#include "thicklens/io/light_field_io.h"

#include <fmt/format.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <opencv2/core/utility.hpp>
#include <system_error>

#include "thicklens/base/cancel.h"
#include "thicklens/base/error.h"
#include "thicklens/base/input_file.h"
#include "thicklens/base/parallel.h"
#include "thicklens/base/stopwatch.h"
#include "thicklens/io/image_io.h"
#include "thicklens/model/light_field_file.h"
#include "tools/io/confidence_file_name.h"
#include "tools/io/light_field_camera.h"
#include "tools/io/plain_tiff.h"
#include "tools/io/view_files.h"

namespace thicklens::io {

const char kLightFieldMarker[] = "lightfield.yaml";
const char kHciMarker[] = "parameters.cfg";

namespace {

namespace fs = std::filesystem;

constexpr char kViewsFolder[] = "views";
constexpr char kHciSignature[] = "# Written by thicklens.\n";

// Returns the value of --threads, which RunCommand has passed to OpenCV.
int Threads() { return std::max(1, cv::getNumThreads()); }

std::string NameOf(ViewFormat format) { return format == ViewFormat::kPng ? "png" : "tiff"; }

// Throws Error unless image files can store such views.
void RequireStorable(int channels) {
  if (channels != 1 && channels != 3) {
    throw Error(fmt::format(
        "light field: channels is {}: image files of views have 1 (grey) or 3 (RGB)", channels));
  }
}

void RequireValid(const model::LightField& light_field) {
  std::string why;
  if (!light_field.IsValid(&why)) throw Error("light field: " + why);
  RequireStorable(light_field.channels);
}

// Calls write(k, l, image) for every view that is present, on several threads.
void ForEachView(const model::LightField& light_field,
                 const std::function<void(int, int, const model::LinearImage&)>& write) {
  ParallelFor(light_field.u_count * light_field.v_count, Threads(), [&](int i) {
    ThrowIfCancelled();
    const int k = i % light_field.u_count;
    const int l = i / light_field.u_count;
    if (light_field.IsPresent(k, l)) write(k, l, model::ViewImage(light_field, k, l));
  });
}

// Writes the parameters that the benchmark's tools use, as far as they are known. Their cameras are
// pinholes, for which d = baseline_mm focal_length_mm (1/z - 1/zf)
// image_resolution_px/sensor_size_mm. The focal length is K = f1 zf/(zf - f1), the scale of chief
// rays, and the baseline is the step between views on the aperture, so that this is d(z) = da K
// (1/z - 1/zf)/p. Derived here [D22].
std::string HciParameters(const model::LightField& light_field) {
  const double larger_side_px = std::max(light_field.s_count, light_field.t_count);
  std::string intrinsics, extrinsics;
  if (light_field.camera) {
    const model::Camera& camera = *light_field.camera;
    const double pitch_mm = camera.sensor.pixel_pitch_mm;
    intrinsics += fmt::format("focal_length_mm = {}\n", camera.focal_scale_px() * pitch_mm);
    intrinsics += fmt::format("sensor_size_mm = {}\n", larger_side_px * pitch_mm);
    const model::LightFieldGrid& grid = *light_field.grid;
    const Eigen::Vector2d step_mm = model::ApertureStepsMm(grid, camera);
    const double baseline_mm = std::abs(step_mm.x() != 0 ? step_mm.x() : step_mm.y());
    if (baseline_mm > 0) extrinsics += fmt::format("baseline_mm = {}\n", baseline_mm);
    const double focus_depth_m = camera.focus_depth_mm() / 1000;
    if (std::isfinite(focus_depth_m))
      extrinsics += fmt::format("focus_distance_m = {}\n", focus_depth_m);
  }
  return kHciSignature +
         fmt::format(
             "[intrinsics]\nimage_resolution_x_px = {}\nimage_resolution_y_px = {}\n{}\n"
             "[extrinsics]\nnum_cams_x = {}\nnum_cams_y = {}\n{}",
             light_field.s_count, light_field.t_count, intrinsics, light_field.u_count,
             light_field.v_count, extrinsics);
}

}  // namespace

std::vector<std::string> LightFieldEntries() {
  std::vector<std::string> entries = {kLightFieldMarker,           kLightFieldCameraFile,
                                      model::kSceneRadianceFile,   model::kSceneDisparityFile,
                                      model::kSceneConfidenceFile, model::kSceneProfileFile};
  for (const char* v : {"[0-9][0-9]", "[0-9][0-9][0-9]"}) {
    for (const char* u : {"[0-9][0-9]", "[0-9][0-9][0-9]"}) {
      for (const char* format : {"png", "tiff"})
        entries.push_back(fmt::format("{}/view_{}_{}.{}", kViewsFolder, v, u, format));
      entries.push_back(fmt::format("{}/view_{}_{}.png", kConfidenceFolder, v, u));
    }
  }
  return entries;
}

LightFieldWriter::LightFieldWriter(const model::TransferCurve& transfer, ViewFormat format,
                                   OutputFolder* folder, std::string icc_profile)
    : transfer_(transfer), icc_profile_(std::move(icc_profile)), format_(format), folder_(folder) {
  constexpr int kBits = 16;
  if (format_ == ViewFormat::kPng) levels_.emplace(transfer, kBits);
}

double LightFieldWriter::BytesForView(double values) const {
  constexpr double kPngBytes = 10;  // encoded values, their rows, and the growing file
  return format_ == ViewFormat::kTiff ? 0 : values * kPngBytes;
}

void LightFieldWriter::WriteView(int k, int l, const model::LinearImage& view) {
  RequireStorable(view.channels);
  const auto start = Clock::now();
  const std::string name = ViewFile(k, l, NameOf(format_));
  std::size_t clipped = 0;
  if (format_ == ViewFormat::kTiff) {
    folder_->WriteWith(name, [&view](const std::string& path, const std::string& shown) {
      WriteFloatTiff(view, path, shown);
    });
  } else {
    folder_->Write(name, EncodePng(model::ToEncoded(view, *levels_), icc_profile_));
    clipped = CountClipped(view, transfer_, levels_->bits());
  }
  const std::lock_guard<std::mutex> lock(mutex_);
  clipped_ += clipped;
  seconds_ += SecondsSince(start);
}

void LightFieldWriter::WriteConfidence(int k, int l, const std::vector<std::uint8_t>& confidence,
                                       int width_px) {
  const auto start = Clock::now();
  folder_->Write(ConfidenceFileName(k, l), EncodeBytesPng(confidence, width_px));
  std::array<std::size_t, 256> counts{};
  for (const std::uint8_t value : confidence) ++counts[value];
  const std::lock_guard<std::mutex> lock(mutex_);
  has_confidence_ = true;
  for (std::size_t i = 0; i < counts.size(); ++i) confidence_counts_[i] += counts[i];
  seconds_ += SecondsSince(start);
}

std::size_t LightFieldWriter::Finish(const model::LightField& light_field) {
  model::LightFieldDescription description;
  description.view_format = NameOf(format_);
  description.has_confidence = has_confidence_;
  description.camera_file = WriteCameraOfLightField(light_field, folder_);
  description.light_field = model::DescriptionOf(light_field);
  folder_->Write(kLightFieldMarker, model::LightFieldDescriptionToYaml(description));
  return clipped_;
}

void WriteViews(const model::LightField& light_field, LightFieldWriter* writer) {
  RequireValid(light_field);
  ForEachView(light_field,
              [&](int k, int l, const model::LinearImage& view) { writer->WriteView(k, l, view); });
}

std::size_t WriteLightField(const model::LightField& light_field, ViewFormat format,
                            OutputFolder* folder) {
  LightFieldWriter writer(light_field.transfer, format, folder, light_field.colour_profile);
  WriteViews(light_field, &writer);
  return writer.Finish(light_field);
}

OutputFolder ClaimHciFolder(const std::string& path) {
  const fs::path parameters = fs::path(path) / kHciMarker;
  std::error_code ignored;
  if (fs::exists(parameters, ignored) &&
      ReadOwnFile(parameters.string(), kMaxTextBytes).rfind(kHciSignature, 0) != 0) {
    throw Error(
        fmt::format("{}: this folder holds a light field that thicklens did not write and is not "
                    "replaced; choose another name",
                    path));
  }
  constexpr int kMaxViews = 10000;
  std::vector<std::string> entries = {kHciMarker};
  for (int i = 0; i < kMaxViews; ++i) entries.push_back(HciFile(i));
  return OutputFolder(path, kHciMarker, entries);
}

std::size_t WriteHciLightField(const model::LightField& light_field, OutputFolder* folder) {
  RequireValid(light_field);
  constexpr int kBits = 8;
  const model::TransferCurve srgb = model::TransferCurve::Srgb();
  const model::QuantisedLevels levels(srgb, kBits);
  std::atomic<std::size_t> clipped{0};
  ForEachView(light_field, [&](int k, int l, const model::LinearImage& view) {
    folder->Write(HciFile(l * light_field.u_count + k), EncodePng(model::ToEncoded(view, levels)));
    clipped += CountClipped(view, srgb, kBits);
  });
  folder->Write(kHciMarker, HciParameters(light_field));
  return clipped;
}

std::size_t CountClipped(const model::LinearImage& image, const model::TransferCurve& transfer,
                         int bits) {
  const double half_level = 0.5 / (bits == 8 ? 255.0 : 65535.0);
  const auto least = static_cast<float>(transfer.Decode(-half_level));
  const auto most = static_cast<float>(transfer.Decode(1 + half_level));
  return static_cast<std::size_t>(
      std::count_if(image.values.begin(), image.values.end(),
                    [=](float light) { return !(light >= least && light <= most); }));
}

}  // namespace thicklens::io
