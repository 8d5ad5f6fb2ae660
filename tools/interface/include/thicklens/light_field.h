#ifndef THICKLENS_LIGHT_FIELD_H_
#define THICKLENS_LIGHT_FIELD_H_

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "thicklens/base/export.h"
#include "thicklens/base/output_file.h"
#include "thicklens/image.h"
#include "thicklens/model/light_field.h"
#include "thicklens/run.h"

namespace thicklens {

// U x V views of S x T samples in linear light (thicklens/model/light_field.h). The view (k, l) is
// seen from a = k - (U-1)/2 steps to the right and b = l - (V-1)/2 steps down on the aperture. With
// a camera the steps are in mm; without one a unit of disparity is 1 px per view step.
using LightField = model::LightField;
using PixelRect = model::PixelRect;  // px; (x, y) is the top-left pixel

// Numbers of views across and down, each from 1 to 99.
struct ViewCounts {
  int u = 0, v = 0;  // across, down
};

// How the order of views is changed when they are read.
struct ViewOrderChange {
  bool swap = false;                        // rows and columns are exchanged, before the others
  bool mirror_u = false, mirror_v = false;  // columns, rows are counted backwards
};

// The part of a light field's folder that is read, and its layout.
struct LightFieldReadOptions {
  // Row length of the HCI numbering input_CamNNN.png, 1 to 1000; 0: parameters.cfg says it, or the
  // views are a full square.
  int hci_grid = 0;
  bool allow_missing_views = false;       // any set of views may be present
  std::optional<ViewCounts> inner_views;  // take only these views in the middle
  std::optional<PixelRect> crop;          // take only this rectangle of each view
  // The layout (docs/file-formats.md): "thicklens", "hci", "stanford", "names", "mat", "hdf5",
  // "quilt", "parts", "lenslets" or "tiles"; empty: it is recognised.
  std::string layout;
  // Views or tiles across and down, or pixels of a lenslet, each from 1 to 100; needs `layout`.
  std::optional<ViewCounts> layout_counts;
  // Pattern of the names of views: "view_{v}_{u}.jpg" with the row {v} and the column {u}, or with
  // {n}, which counts row by row; empty: the layout states the names.
  std::string view_name;
  ViewOrderChange view_order;  // how the order of the views is corrected

  // Returns whether all members are valid. Otherwise `why`, if not null, gets the field, the value
  // and the constraint.
  THICKLENS_EXPORT bool IsValid(std::string* why) const;
};

// Reads a light field: the folder of ours (lightfield.yaml) or of another layout, or one file with
// all views (docs/file-formats.md). Views of other layouts are read as sRGB, unless their files
// state linear light, with equal weights; black views are left out. Notices say what was read and
// what may be wrong with it. Throws OptionError, and Error that names the folder and the view.
THICKLENS_EXPORT LightField ReadLightField(const std::string& folder,
                                           const LightFieldReadOptions& options = {},
                                           const RunControl& run = {});

// Reads the confidence that an estimate's folder has beside its views (docs/file-formats.md): one
// byte per ray, view by view (index l * U + k), row by row, as LightFieldEstimate::confidence; all
// V x U x T x S rays of the file, also those that options of ReadLightField would leave out. Rays
// of a view that is missing have 0. Empty: the folder has none, as in the HCI layout. Throws
// OptionError for `run`, Error that names the folder, or the file that is missing, has another size
// than the views or is no grey image of 8 bits, and Interrupted.
THICKLENS_EXPORT std::vector<std::uint8_t> ReadConfidence(const std::string& folder,
                                                          const RunControl& run = {});

// How the views are stored.
enum class LightFieldFormat {
  kPng,    // views of 16 bits, encoded by the light field's transfer curve and clipped
  kTiff,   // views in float, linear light, not clipped
  kHci,    // the HCI layout: views of 8 bits in sRGB, and parameters.cfg; no camera, no weights
  kScene,  // the scene that the views show (scene_form.h); of an estimate that has one
};

// Writes a light field into a folder, completely or not at all. The confidence of an estimate is
// written only by WriteLightField(folder, estimate) of estimate.h. A folder that this program did
// not write is not replaced. Returns the number of clipped values. Throws OptionError for a format
// that is no enumerator or kScene, and Error, also for a light field that is not valid.
THICKLENS_EXPORT std::size_t WriteLightField(const std::string& folder,
                                             const LightField& light_field,
                                             LightFieldFormat format = LightFieldFormat::kPng,
                                             const RunControl& run = {});

// Both steps of WriteLightField, for a folder that is claimed before a long computation or that
// gets other files too: the name is claimed, views and description are written below it, and Commit
// of the folder (thicklens/base/output_file.h) puts it in place. Throws OptionError and Error.
THICKLENS_EXPORT OutputFolder
ClaimLightFieldFolder(const std::string& folder, LightFieldFormat format = LightFieldFormat::kPng);
// Writes views and description into a claimed folder; the caller commits it. Returns the number of
// clipped values. Throws OptionError, and Error, also for a folder that is null.
THICKLENS_EXPORT std::size_t WriteLightField(OutputFolder* folder, const LightField& light_field,
                                             LightFieldFormat format = LightFieldFormat::kPng,
                                             const RunControl& run = {});

// The view (k, l) as an image in linear light. Throws Error if the light field is not valid, if it
// has other channels than 1 (grey) or 3 (RGB), which an image cannot have, and if there is no such
// view or it is not present.
THICKLENS_EXPORT Image ViewOf(const LightField& light_field, int k, int l);

// The positions of views on the aperture and the share of each in a photograph, taken from another
// light field.
struct ApertureViews {
  LightField description;       // without values; its present views count
  bool weights_stated = false;  // whether its file states the weights (HCI's does not)
  std::string source;           // its folder; messages name it
};
// Reads a light field and keeps its description. All of its views are checked.
THICKLENS_EXPORT ApertureViews ReadApertureViews(const std::string& folder,
                                                 const LightFieldReadOptions& options = {},
                                                 const RunControl& run = {});

}  // namespace thicklens

#endif  // THICKLENS_LIGHT_FIELD_H_
