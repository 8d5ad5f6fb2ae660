// Our own layout: lightfield.yaml, and views/view_VV_UU.png or .tiff, or the planes of a scene
// (docs/file-formats.md).
#include <fmt/format.h>

#include <cstddef>
#include <filesystem>
#include <opencv2/core/mat.hpp>
#include <system_error>
#include <utility>

#include "thicklens/base/cancel.h"
#include "thicklens/base/error.h"
#include "thicklens/base/input_file.h"
#include "thicklens/base/memory_available.h"
#include "thicklens/base/output_file.h"
#include "thicklens/io/image_file.h"
#include "thicklens/io/scene_form_files.h"
#include "thicklens/model/light_field_file.h"
#include "tools/io/confidence_file_name.h"
#include "tools/io/image_file_kind.h"
#include "tools/io/image_metadata.h"
#include "tools/io/light_field_camera.h"
#include "tools/io/lightfields/layout.h"
#include "tools/io/lightfields/view_grid.h"
#include "tools/io/lightfields/view_pixels.h"
#include "tools/io/view_files.h"

namespace thicklens::io {
namespace {

namespace fs = std::filesystem;

model::LinearImage ReadTiffView(const std::string& path) {
  const std::string bytes = ReadWholeFile(path);
  if (KindOfImage(bytes) != ImageFileKind::kTiff) {
    throw Error(fmt::format("{}: cannot be decoded as a TIFF file ({} bytes)", path, bytes.size()));
  }
  const cv::Mat image = DecodeImageFile(bytes, path).pixels;
  if (image.type() != CV_32FC1 && image.type() != CV_32FC3) {
    throw Error(fmt::format(
        "{}: float values in 1 or 3 channels are expected, found {} channel(s) of {} bits{}", path,
        image.channels(), 8 * image.elemSize1(), image.depth() >= CV_32F ? ", float" : ""));
  }
  model::LinearImage light{image.cols, image.rows, image.channels(), {}};
  light.values.reserve(image.total() * static_cast<std::size_t>(image.channels()));
  for (int y = 0; y < image.rows; ++y) {
    ThrowIfCancelled();
    const auto* row = image.ptr<float>(y);
    light.values.insert(light.values.end(), row,
                        row + static_cast<std::ptrdiff_t>(image.cols) * image.channels());
  }
  return light;
}

// Includes the views that were not requested: the light field as a whole is the input.
void ReportFilesOf(const std::string& folder, const model::LightFieldDescription& description) {
  const model::LightField& frame = description.light_field;
  for (int l = 0; l < frame.v_count; ++l) {
    for (int k = 0; k < frame.u_count; ++k) {
      if (!frame.IsPresent(k, l)) continue;
      ReportInput((fs::path(folder) / ViewFile(k, l, description.view_format)).string());
      if (!description.has_confidence) continue;
      ReportInput((fs::path(folder) / ConfidenceFileName(k, l)).string());
    }
  }
}

// All views have the profile of the photograph, or none.
std::string ProfileOfViews(const std::string& folder, const model::LightField& frame) {
  for (int l = 0; l < frame.v_count; ++l) {
    for (int k = 0; k < frame.u_count; ++k) {
      if (!frame.IsPresent(k, l)) continue;
      try {
        return ColourProfileOf(ReadWholeFile((fs::path(folder) / ViewFile(k, l, "png")).string()));
      } catch (const Interrupted&) {
        throw;
      } catch (const Error&) {
        return "";  // whoever reads the view says why it cannot be read
      }
    }
  }
  return "";
}

// Rendered views take memory that no file states. Throws Error if there is too little.
void RequireMemoryForViews(const std::string& folder, const LightFieldReading& reading,
                           const model::LightField& frame) {
  const double views = reading.u_count > 0 ? static_cast<double>(reading.u_count) * reading.v_count
                                           : static_cast<double>(frame.u_count) * frame.v_count;
  const double pixels = static_cast<double>(frame.s_count) * frame.t_count;
  constexpr double kMib = 1 << 20;
  const double needed_mib = views * pixels * frame.channels * sizeof(float) / kMib;
  const std::optional<double> left_mib = MemoryLeftMib();
  if (!left_mib || needed_mib <= *left_mib) return;
  throw Error(fmt::format(
      "{}: its views take {:.0f} MiB, and {:.0f} MiB of memory are left; the option views reads "
      "fewer of them, and single views can be rendered",
      folder, needed_mib, *left_mib));
}

ViewSource SourceOfScene(const std::string& folder, const LightFieldReading& reading) {
  SceneViews views = OpenSceneViews(folder);
  RequireMemoryForViews(folder, reading, views.frame);
  ViewSource source;
  source.is_own = source.is_plain = true;
  source.kind = "a light field of thicklens, stored as its scene";
  source.frame = std::move(views.frame);
  source.read = std::move(views.view);
  return source;
}

}  // namespace

std::optional<ViewSource> OpenOwnFolder(const LayoutInput& input) {
  const std::string& folder = input.path;
  const std::string description_path = (fs::path(folder) / kLightFieldMarker).string();
  std::error_code ignored;
  if (!input.is_forced && !fs::exists(description_path, ignored)) return std::nullopt;
  const model::LightFieldDescription description =
      model::ReadLightFieldDescription(description_path);
  if (description.scene) return SourceOfScene(folder, *input.reading);
  ViewSource source;
  source.is_own = source.is_plain = true;
  source.kind = "a light field of thicklens";
  source.frame = description.light_field;
  model::LightField& frame = source.frame;
  frame.camera = CameraOfLightField(folder, description);
  std::vector<std::string> missing;
  for (int l = 0; l < frame.v_count; ++l) {
    for (int k = 0; k < frame.u_count; ++k) {
      if (!frame.IsPresent(k, l)) missing.push_back(fmt::format("view ({}, {})", k, l));
    }
  }
  if (!missing.empty() && !input.reading->sparse) ThrowMissingViews(folder, missing);
  ReportFilesOf(folder, description);

  const bool is_png = description.view_format == "png";
  if (is_png) frame.colour_profile = ProfileOfViews(folder, frame);
  source.read = [folder, is_png, format = description.view_format, transfer = frame.transfer](
                    int k, int l) {
    const std::string path = (fs::path(folder) / ViewFile(k, l, format)).string();
    return is_png ? ReadPngView(path, transfer) : ReadTiffView(path);
  };
  return source;
}

}  // namespace thicklens::io
