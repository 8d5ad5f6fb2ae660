#ifndef THICKLENS_TOOLS_OPTIONS_LIGHT_FIELD_OPTIONS_H_
#define THICKLENS_TOOLS_OPTIONS_LIGHT_FIELD_OPTIONS_H_

#include <CLI/CLI.hpp>
#include <optional>
#include <string>
#include <utility>

#include "thicklens/depth.h"
#include "thicklens/io/light_field_io.h"
#include "thicklens/light_field.h"
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
// `required` begins the description of --depth-kind: when the kind must be given.
void AddDepthOptions(CLI::App* command, const std::string& required, DepthOptions* options);
// Throws UsageError if the kind is not given, z or range have no unit, or disparity has one.
model::DepthConvention ConventionOf(const DepthOptions& options);

// Likewise in the form of the interface.
DepthMeaning DepthMeaningOf(const DepthOptions& options);

// The option --aperture-shape.
void AddApertureShapeOption(CLI::App* command, std::string* text);

// --device auto|cpu|opencl[:PLATFORM[:DEVICE]].
void AddDeviceOption(CLI::App* command, std::string* text);

}  // namespace thicklens::tools

#endif  // THICKLENS_TOOLS_OPTIONS_LIGHT_FIELD_OPTIONS_H_
