#include "thicklens/io/confidence_files.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstddef>
#include <filesystem>
#include <opencv2/core/mat.hpp>
#include <system_error>
#include <utility>

#include "thicklens/base/cancel.h"
#include "thicklens/base/error.h"
#include "thicklens/base/parallel.h"
#include "thicklens/estimator/scene_form.h"
#include "thicklens/io/image_io.h"
#include "thicklens/io/scene_form_files.h"
#include "thicklens/model/light_field_file.h"
#include "tools/io/array_file.h"
#include "tools/io/confidence_file_name.h"
#include "tools/io/image_names.h"

namespace thicklens::io {
namespace {

namespace fs = std::filesystem;

// Reads the confidence of one view: 8 bits, grey, and the size of the views.
cv::Mat ReadConfidenceOfView(const std::string& path, const model::LightField& frame) {
  cv::Mat image = ReadImageFile(path);
  if (image.type() != CV_8UC1) {
    throw Error(
        fmt::format("{}: a grey image of 8 bits is expected, found {} channel(s) of {} bits", path,
                    image.channels(), 8 * image.elemSize1()));
  }
  if (image.cols != frame.s_count || image.rows != frame.t_count) {
    throw Error(fmt::format("{}: it has {}x{} px, the views {}x{}: they must be equal", path,
                            image.cols, image.rows, frame.s_count, frame.t_count));
  }
  return image;
}

}  // namespace

void WriteConfidence(const std::vector<estimator::Confidence>& of_rays, int u_count, int width_px,
                     int height_px, LightFieldWriter* writer) {
  const auto pixels = static_cast<std::ptrdiff_t>(width_px) * height_px;
  const auto views = static_cast<int>(static_cast<std::ptrdiff_t>(of_rays.size()) / pixels);
  for (int i = 0; i < views; ++i) {
    ThrowIfCancelled();
    const auto first = of_rays.begin() + i * pixels;
    writer->WriteConfidence(i % u_count, i / u_count, {first, first + pixels}, width_px);
  }
}

std::vector<estimator::Confidence> ReadConfidence(const std::string& folder, int threads) {
  std::error_code ignored;
  if (!fs::is_directory(folder, ignored)) {
    // A light field in one image, such as a quilt, or in one array has none.
    if (fs::exists(folder, ignored) && (IsImageName(folder) || FormatOfArrays(folder))) return {};
    throw Error(fmt::format("{}: {}; the folder of a light field is expected", folder,
                            fs::exists(folder, ignored) ? "is a file" : "does not exist"));
  }
  const fs::path description_path = fs::path(folder) / kLightFieldMarker;
  if (!fs::exists(description_path, ignored)) {
    if (!ImageNames(folder).empty()) return {};  // only our own layout has some
    throw Error(
        fmt::format("{}: the folder of a light field is expected, with {} or images of views",
                    folder, kLightFieldMarker));
  }
  const model::LightFieldDescription description =
      model::ReadLightFieldDescription(description_path.string());
  if (!description.has_confidence) return {};
  if (description.scene) return estimator::RayConfidenceOf(ReadSceneForm(folder), threads);
  const model::LightField& frame = description.light_field;
  std::vector<std::string> paths;  // empty: the view is missing, and its confidence too
  for (int l = 0; l < frame.v_count; ++l) {
    for (int k = 0; k < frame.u_count; ++k) {
      std::string path = (fs::path(folder) / ConfidenceFileName(k, l)).string();
      if (!frame.IsPresent(k, l) && !fs::exists(path, ignored)) path.clear();
      paths.push_back(std::move(path));
    }
  }
  // Memory is allocated only after a view was found to have the stated size: a wrong size could
  // exhaust the memory.
  const auto first = std::find_if(paths.begin(), paths.end(),
                                  [](const std::string& path) { return !path.empty(); });
  if (first != paths.end()) ReadConfidenceOfView(*first, frame);
  std::vector<estimator::Confidence> confidence(frame.ViewStart(1, 0, 0), estimator::kFilledIn);
  ParallelFor(static_cast<int>(paths.size()), threads, [&](int i) {
    const auto view = static_cast<std::size_t>(i);
    if (paths[view].empty()) return;
    const cv::Mat image = ReadConfidenceOfView(paths[view], frame);
    auto to = confidence.begin() + static_cast<std::ptrdiff_t>(view * frame.view_size());
    for (int t = 0; t < image.rows; ++t) {
      const auto* const row = image.ptr<estimator::Confidence>(t);
      to = std::copy(row, row + image.cols, to);
    }
  });
  return confidence;
}

}  // namespace thicklens::io
