#ifndef THICKLENS_TOOLS_OPTIONS_LIGHT_FIELD_OPTIONS_H_
#define THICKLENS_TOOLS_OPTIONS_LIGHT_FIELD_OPTIONS_H_

#include <CLI/CLI.hpp>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "thicklens/depth.h"
#include "thicklens/depth_fit.h"
#include "thicklens/io/light_field_io.h"
#include "thicklens/light_field.h"
#include "thicklens/model/scene.h"
#include "tools/options/interface_options.h"

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

// The options --grid N, --sparse, --views, --crop, --layout NAME[:UxV], --name PATTERN and
// --view-order CHANGES for a light field that is read.
struct ReadingOptions {
  int grid = 0;
  bool sparse = false;
  ViewsOption views;
  CropOption crop;
  std::string layout, name, view_order;
};
constexpr int kMaxGrid = 1000;  // of --grid
void AddReadingOptions(CLI::App* command, ReadingOptions* options);
OptionNames ReadingOptionNames();
// Throws UsageError, which names --layout and --view-order with this in front of their names.
LightFieldReadOptions LightFieldReadOptionsOf(const ReadingOptions& options,
                                              const std::string& dashes = "--");

// The options --depth-kind, --depth-unit, --disparity-scale and --disparity-offset, and those of
// inverse depth, state what a depth map's numbers mean. Kind and unit are never guessed: z and
// range need a unit, disparity has none, and inverse has that of --depth-near and --depth-far. The
// others state which values of the file are depths.
struct DepthOptions {
  std::string kind;  // "relative": a disparity whose scale and offset are found
  std::string unit;
  std::string near_is;  // "large" or "small"; empty: large
  double disparity_scale = 1;
  double disparity_offset_px = 0;
  double inverse_scale_dpt = 1;
  double inverse_offset_dpt = 0;
  std::optional<double> near, far;  // in the unit
  std::vector<double> hole_values = {};
  std::string zero_is, largest_is;  // "hole" or "value"; empty: by rule
  std::string channel;
  std::string pfm_scale;  // "apply" or "ignore"; empty: by rule
  std::string flip;       // "rows", "columns" or "both"; empty: none
};

// The options of `estimate` for a map of another size, part or camera, and for its confidence.
struct DepthFitOptions {
  std::string part, camera_path, samples, confidence_path;  // empty: not given
  std::optional<double> confidence_full, min_confidence;
};
void AddDepthFitOptions(CLI::App* command, DepthFitOptions* options);
// Throws UsageError. The depth camera is read later.
DepthFit DepthFitOf(const DepthFitOptions& options);
// Reads the confidence into the map, if it was given. Throws UsageError and Error.
void ReadConfidenceInto(const DepthFitOptions& options, DepthMap* depth);
// `required` begins the description of --depth-kind: when the kind must be given. `takes_relative`:
// the command finds the values of a relative map.
void AddDepthOptions(CLI::App* command, const std::string& required, DepthOptions* options,
                     bool takes_relative = false);
// Throws UsageError if the kind is not given, z or range have no unit, disparity has one, or an
// option is for another kind. Near and far are not part of the result: they need the file.
model::DepthConvention ConventionOf(const DepthOptions& options);

// Likewise in the form of the interface.
DepthMeaning DepthMeaningOf(const DepthOptions& options);
// How the map is read. Throws UsageError as ConventionOf does.
// The value of --depth-flip.
model::DepthFlip DepthFlipOf(const DepthOptions& options);
DepthReadOptions DepthReadOptionsOf(const DepthOptions& options);

// The option --aperture-shape.
void AddApertureShapeOption(CLI::App* command, std::string* text);

// --device auto|cpu|opencl[:PLATFORM[:DEVICE]].
void AddDeviceOption(CLI::App* command, std::string* text);

}  // namespace thicklens::tools

#endif  // THICKLENS_TOOLS_OPTIONS_LIGHT_FIELD_OPTIONS_H_
