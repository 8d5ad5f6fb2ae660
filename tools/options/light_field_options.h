#ifndef THICKLENS_TOOLS_OPTIONS_LIGHT_FIELD_OPTIONS_H_
#define THICKLENS_TOOLS_OPTIONS_LIGHT_FIELD_OPTIONS_H_

#include <CLI/CLI.hpp>
#include <cstddef>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "thicklens/depth.h"
#include "thicklens/estimator/view_geometry.h"
#include "thicklens/io/light_field_io.h"
#include "thicklens/light_field.h"
#include "thicklens/model/camera.h"
#include "thicklens/model/light_field_grid.h"
#include "thicklens/model/scene.h"

namespace thicklens::tools {

// Options that several commands about light fields share: the texts as typed, and their values.

// --views UxV, --crop X,Y,W,H.
struct ViewsOption {
  std::string text;
};
void AddViewsOption(CLI::App* command, ViewsOption* option, const std::string& help);
// Returns {0, 0} if the option was not given. Throws UsageError.
std::pair<int, int> ViewCounts(const ViewsOption& option);
struct CropOption {
  std::string text;
};
void AddCropOption(CLI::App* command, CropOption* option);
std::optional<model::PixelRect> CropRect(const CropOption& option);  // throws UsageError

// The options --grid N, --sparse, --views and --crop for a light field that is read.
struct ReadingOptions {
  int grid = 0;
  bool sparse = false;
  ViewsOption views;
  CropOption crop;
};
void AddReadingOptions(CLI::App* command, ReadingOptions* options);
io::LightFieldReading ReadingOf(const ReadingOptions& options);                // throws UsageError
LightFieldReadOptions LightFieldReadOptionsOf(const ReadingOptions& options);  // throws UsageError

// The options --depth-kind, --depth-unit, --disparity-scale and --disparity-offset state what a
// depth map's numbers mean. Kind and unit are never guessed: z and range need a unit, disparity has
// none.
struct DepthOptions {
  std::string kind;
  std::string unit;
  double disparity_scale = 1;
  double disparity_offset_px = 0;
};
void AddDepthOptions(CLI::App* command, DepthOptions* options);
// Throws UsageError if the kind is not given, z or range have no unit, or disparity has one.
model::DepthConvention ConventionOf(const DepthOptions& options);

// Likewise in the form of the interface.
DepthMeaning DepthMeaningOf(const DepthOptions& options);

// The option --aperture-shape; for an empty text the result is `otherwise`.
void AddApertureShapeOption(CLI::App* command, std::string* text);
model::ApertureShape ApertureShapeOr(const std::string& text, model::ApertureShape otherwise);

// --device auto|cpu|opencl[:PLATFORM[:DEVICE]].
void AddDeviceOption(CLI::App* command, std::string* text);

// The disparity of a photograph's pixels on the grid of its light field, without holes.
struct PreparedDepth {
  estimator::DisparityMap disparity;            // filled
  std::size_t holes = 0;                        // number of filled holes
  std::vector<bool> was_hole;                   // per pixel
  std::optional<model::DepthStatistics> depth;  // in mm, if there is a camera
};
// Prepares a depth map. Without a camera the map must be a disparity, otherwise UsageError is
// thrown. With a camera, `grid` is that of its light field, and model::MakeScene checks the map.
// The sizes must be those of `image`. Throws Error.
PreparedDepth PrepareDepth(const model::RawDepthMap& map, const std::string& map_name,
                           const DepthOptions& options, const model::LinearImage& image,
                           const model::Camera* camera, const model::LightFieldGrid* grid);

}  // namespace thicklens::tools

#endif  // THICKLENS_TOOLS_OPTIONS_LIGHT_FIELD_OPTIONS_H_
