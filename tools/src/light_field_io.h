#ifndef THICKLENS_TOOLS_LIGHT_FIELD_IO_H_
#define THICKLENS_TOOLS_LIGHT_FIELD_IO_H_

#include <array>
#include <cstddef>
#include <cstdint>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "thicklens/base/output_file.h"
#include "thicklens/model/light_field.h"
#include "thicklens/model/stored_levels.h"

namespace thicklens::tools {

// What a person says about a light field that they read; see light_field_options.h.
struct LightFieldReading {
  int grid = 0;  // --grid: row length of the HCI numbering; 0: from parameters.cfg, or square
  bool sparse = false;  // --sparse: any set of views may be present
  // --views: the inner ones; 0: all
  int u_count = 0, v_count = 0;
  std::optional<model::PixelRect> crop;  // --crop
};

// Reads a folder of ours (lightfield.yaml) or of the HCI layout (input_CamNNN.png row-major, NNN =
// grid * v + u, and parameters.cfg if it is there), then takes the inner views and the crop. HCI
// light fields are relative, sRGB, with uniform weights. Views that are not present within the
// smallest rectangle that holds the others are an Error that names them, unless `sparse`. Throws
// Error naming the folder and the view that is missing, broken or of another size.
model::LightField ReadLightField(const std::string& folder, const LightFieldReading& reading);

enum class ViewFormat {
  kPng,   // 16 bit, encoded by the light field's transfer curve, clipped
  kTiff,  // float, linear light
};
// Entries that a folder of ours may hold: for OutputFolder.
extern const char kLightFieldMarker[];  // "lightfield.yaml"
std::vector<std::string> LightFieldEntries();

// Writes a light field of which there is never more than some views: each as it is made, in any
// order, from several threads at the same time; and then what describes them.
class LightFieldWriter {
 public:
  // The folder must outlive it, and is committed by the caller.
  LightFieldWriter(const model::TransferCurve& transfer, ViewFormat format, OutputFolder* folder);

  void WriteView(int k, int l, const model::LinearPicture& view);
  // One byte a ray, row by row (docs/file-formats.md); of all views or of none.
  void WriteConfidence(int k, int l, const std::vector<std::uint8_t>& confidence, int width_px);
  // After the last view. The light field's values are not looked at. Returns how many values were
  // clipped.
  std::size_t Finish(const model::LightField& light_field);

  // What it holds besides a view of so many values while it writes it.
  double BytesForView(double values) const;
  // How many rays have each confidence.
  const std::array<std::size_t, 256>& confidence_counts() const { return confidence_counts_; }
  double seconds() const { return seconds_; }  // spent on views, of all threads together

 private:
  const model::TransferCurve transfer_;
  std::optional<model::StoredLevels> levels_;  // of PNG
  const ViewFormat format_;
  OutputFolder* folder_;
  std::mutex mutex_;
  std::size_t clipped_ = 0;
  std::array<std::size_t, 256> confidence_counts_{};
  bool has_confidence_ = false;
  double seconds_ = 0;
};

// All views that there are.
void WriteViews(const model::LightField& light_field, LightFieldWriter* writer);

// Writes views/view_VV_UU.png or .tiff, lightfield.yaml, and camera.yaml if there is a camera,
// below the folder's staging path; the caller commits. Returns how many values were clipped.
std::size_t WriteLightField(const model::LightField& light_field, ViewFormat format,
                            OutputFolder* folder);

// HCI layout: input_CamNNN.png (8 bit sRGB) and parameters.cfg, below the staging path. Returns how
// many values were clipped.
extern const char kHciMarker[];  // "parameters.cfg"
std::size_t WriteHciLightField(const model::LightField& light_field, OutputFolder* folder);

// Claims a folder for it. The benchmark's own folders look the same: one that this program did not
// write is not replaced. Throws Error.
OutputFolder ClaimHciFolder(const std::string& path);

// How many values a file of 8 or 16 bits cannot hold: those more than half a level below 0 or above
// full scale, and NaN.
std::size_t CountClipped(const model::LinearPicture& picture, const model::TransferCurve& transfer,
                         int bits);

}  // namespace thicklens::tools

#endif  // THICKLENS_TOOLS_LIGHT_FIELD_IO_H_
