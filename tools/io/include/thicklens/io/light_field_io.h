#ifndef THICKLENS_IO_LIGHT_FIELD_IO_H_
#define THICKLENS_IO_LIGHT_FIELD_IO_H_

#include <array>
#include <cstddef>
#include <cstdint>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "thicklens/base/export.h"
#include "thicklens/base/output_file.h"
#include "thicklens/model/light_field.h"
#include "thicklens/model/quantised_levels.h"

namespace thicklens::io {

// The user's options for a light field that is read; see light_field_options.h.
struct LightFieldReading {
  int grid = 0;  // --grid: row length of the HCI numbering; 0: from parameters.cfg, or square
  bool sparse = false;  // --sparse: any set of views may be present
  // --views: the inner ones; 0: all
  int u_count = 0, v_count = 0;
  std::optional<model::PixelRect> crop;  // --crop
  // --layout NAME[:UxV]: the layout, one of LightFieldLayouts(); empty: it is recognised. The
  // numbers are views, tiles or pixels of a lenslet across and down; 0: not stated.
  std::string layout;
  int layout_u = 0, layout_v = 0;  // the numbers of --layout
  std::string name;                // --name: the pattern of names, "view_{v}_{u}.jpg"
  // --view-order: exchanges rows and columns, and then counts columns or rows backwards.
  bool swap_uv = false, mirror_u = false, mirror_v = false;
};

// The findings while a light field was read.
struct LightFieldFacts {
  std::string kind;     // "a Stanford folder"
  bool is_own = false;  // the layout of thicklens, which states everything itself
  // The reading needs no words: the layout of thicklens, or that of HCI with all of its views.
  bool is_plain = false;
  std::string one_line;  // "PATH: read as a Stanford folder: 17 x 17 views of 1024 x 1024 px, ..."
  std::vector<std::string> left_out;  // black views, "(0, 4)"
  std::vector<std::string> notices;   // what may make the light field wrong, one sentence each
};

// Names of the layouts: "thicklens", "hci", "stanford", "names" (folders); "mat", "hdf5", "quilt",
// "parts", "lenslets", "tiles" (files).
THICKLENS_EXPORT std::vector<std::string> LightFieldLayouts();
// Whether one of these is the layout of a folder.
THICKLENS_EXPORT bool IsLayoutOfFolders(const std::string& layout);
// The layout of a file that its contents or its name state for certain: "mat", "hdf5", "quilt" or
// "lenslets"; otherwise empty.
THICKLENS_EXPORT std::string LayoutThatIsStated(const std::string& file);

// Reads a light field in one of these layouts (docs/file-formats.md), then takes the inner views
// and the crop. All but our own are relative, sRGB unless the files state linear light, with
// uniform weights; black views are left out. Throws Error that names the folder and the view that
// is missing, broken or of another size, or what was found if it has none of the layouts. Unless
// `sparse` is set, a view that is missing within the smallest rectangle that holds the others is
// such an Error.
THICKLENS_EXPORT model::LightField ReadLightField(const std::string& folder,
                                                  const LightFieldReading& reading);
// Likewise; `facts` gets what was found.
THICKLENS_EXPORT model::LightField ReadLightField(const std::string& folder,
                                                  const LightFieldReading& reading,
                                                  LightFieldFacts* facts);

// How the views are stored.
enum class ViewFormat {
  kPng,   // 16 bit, encoded by the light field's transfer curve, clipped
  kTiff,  // float, linear light
};
// The file that marks a folder of our layout, for OutputFolder.
THICKLENS_EXPORT extern const char kLightFieldMarker[];  // "lightfield.yaml"
// The names of all files and folders that a light field may have.
THICKLENS_EXPORT std::vector<std::string> LightFieldEntries();

// Writes a light field of which only some views are in memory at a time. Views are written as they
// are made, in any order and from several threads at once; their description follows at the end.
class THICKLENS_EXPORT LightFieldWriter {
 public:
  // `folder` is not owned and must outlive the writer; the caller commits it. `icc_profile` is
  // written into PNG files; its curve is `transfer`.
  LightFieldWriter(const model::TransferCurve& transfer, ViewFormat format, OutputFolder* folder,
                   std::string icc_profile = "");

  // Writes the view (k, l), linear light. Throws Error.
  void WriteView(int k, int l, const model::LinearImage& view);
  // Writes one byte for each ray, row by row (docs/file-formats.md). Call it for all views or for
  // none.
  void WriteConfidence(int k, int l, const std::vector<std::uint8_t>& confidence, int width_px);
  // Call this after the last view. The values of `light_field` are not read. Returns the number of
  // clipped values.
  std::size_t Finish(const model::LightField& light_field);

  // Returns the bytes that the writer needs besides a view of `values` values while it writes it.
  double BytesForView(double values) const;
  // Number of rays with each confidence.
  const std::array<std::size_t, 256>& confidence_counts() const { return confidence_counts_; }
  double seconds() const { return seconds_; }  // time spent on views, summed over the threads

 private:
  const model::TransferCurve transfer_;
  const std::string icc_profile_;
  std::optional<model::QuantisedLevels> levels_;  // levels of PNG files
  const ViewFormat format_;
  OutputFolder* folder_;
  std::mutex mutex_;
  std::size_t clipped_ = 0;
  std::array<std::size_t, 256> confidence_counts_{};
  bool has_confidence_ = false;
  double seconds_ = 0;
};

// Writes all views that are present.
THICKLENS_EXPORT void WriteViews(const model::LightField& light_field, LightFieldWriter* writer);

// Writes views/view_VV_UU.png or .tiff, lightfield.yaml, and camera.yaml if there is a camera,
// below the folder's staging path; the caller commits. Returns the number of clipped values.
THICKLENS_EXPORT std::size_t WriteLightField(const model::LightField& light_field,
                                             ViewFormat format, OutputFolder* folder);

// The file that marks a folder of the HCI layout.
THICKLENS_EXPORT extern const char kHciMarker[];  // "parameters.cfg"
// Writes the HCI layout, input_CamNNN.png (8 bit sRGB) and parameters.cfg, below the staging path.
// Returns the number of clipped values.
THICKLENS_EXPORT std::size_t WriteHciLightField(const model::LightField& light_field,
                                                OutputFolder* folder);

// Claims a folder for the HCI layout. The benchmark's own folders look the same, so a folder that
// this program did not write is not replaced. Throws Error.
THICKLENS_EXPORT OutputFolder ClaimHciFolder(const std::string& path);

// Counts the values that a file of 8 or 16 bits cannot hold: those more than half a level below 0
// or above full scale, and NaN.
THICKLENS_EXPORT std::size_t CountClipped(const model::LinearImage& image,
                                          const model::TransferCurve& transfer, int bits);

}  // namespace thicklens::io

#endif  // THICKLENS_IO_LIGHT_FIELD_IO_H_
