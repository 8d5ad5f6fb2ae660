#ifndef THICKLENS_TOOLS_LIGHT_FIELD_OPTIONS_H_
#define THICKLENS_TOOLS_LIGHT_FIELD_OPTIONS_H_

#include <CLI/CLI.hpp>
#include <cstddef>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "light_field_io.h"
#include "thicklens/estimator/view_geometry.h"
#include "thicklens/model/camera.h"
#include "thicklens/model/light_field_grid.h"
#include "thicklens/model/scene.h"

namespace thicklens::tools {

// Options that several commands about light fields share: texts as typed, and what they say.

// --views UxV, --crop X,Y,W,H.
struct ViewsOption {
  std::string text;
};
void AddViewsOption(CLI::App* command, ViewsOption* option, const std::string& help);
// Throws UsageError. {0, 0} where it was not given.
std::pair<int, int> ViewCounts(const ViewsOption& option);
struct CropOption {
  std::string text;
};
void AddCropOption(CLI::App* command, CropOption* option);
std::optional<model::PixelRect> CropRect(const CropOption& option);  // throws UsageError

// --grid N, --sparse, --views, --crop of a light field that is read.
struct ReadingOptions {
  int grid = 0;
  bool sparse = false;
  ViewsOption views;
  CropOption crop;
};
void AddReadingOptions(CLI::App* command, ReadingOptions* options);
LightFieldReading ReadingOf(const ReadingOptions& options);  // throws UsageError

// --depth-kind, --depth-unit, --disparity-scale, --disparity-offset: what a depth map's numbers
// mean. Kind and unit are never guessed: z and range ask for a unit, disparity has none.
struct DepthOptions {
  std::string kind;
  std::string unit;
  double disparity_scale = 1;
  double disparity_offset_px = 0;
};
void AddDepthOptions(CLI::App* command, DepthOptions* options);
// Throws UsageError if the kind is not given, z or range have no unit, or disparity has one.
model::DepthConvention ConventionOf(const DepthOptions& options);

// --aperture-shape; empty text: `otherwise`.
void AddApertureShapeOption(CLI::App* command, std::string* text);
model::ApertureShape ApertureShapeOr(const std::string& text, model::ApertureShape otherwise);

// --device auto|cpu|opencl[:PLATFORM[:DEVICE]].
void AddDeviceOption(CLI::App* command, std::string* text);

// The disparity of a picture's pixels on the grid of its light field, without holes.
struct PreparedDepth {
  estimator::DisparityMap disparity;            // filled
  std::size_t holes = 0;                        // how many were
  std::vector<bool> was_hole;                   // per pixel
  std::optional<model::DepthStatistics> depth;  // in mm, where there is a camera
};
// Without a camera the map must be a disparity (UsageError else). With one, `grid` is its light
// field's and the map is checked by model::MakeScene. Sizes must be the picture's. Throws Error.
PreparedDepth PrepareDepth(const model::RawDepthMap& map, const std::string& map_name,
                           const DepthOptions& options, const model::LinearPicture& picture,
                           const model::Camera* camera, const model::LightFieldGrid* grid);

}  // namespace thicklens::tools

#endif  // THICKLENS_TOOLS_LIGHT_FIELD_OPTIONS_H_
