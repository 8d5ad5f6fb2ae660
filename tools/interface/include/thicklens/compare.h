#ifndef THICKLENS_COMPARE_H_
#define THICKLENS_COMPARE_H_

#include <optional>
#include <string>
#include <vector>

#include "thicklens/base/export.h"
#include "thicklens/depth.h"
#include "thicklens/image.h"
#include "thicklens/light_field.h"
#include "thicklens/run.h"

namespace thicklens {

// Metrics of an image against a reference, on encoded values in [0, 1]. The definitions are those
// of thicklens/estimator/compare.h ([L19], Wang et al. 2004, CIE94, [D119]).
struct ImageScores {
  double psnr_db = 0;                    // +inf for equal images
  double ssim = 0;                       // NaN if the image is smaller than the window of 11 px
  double delta_e94_mean = 0;             // grey is taken as R = G = B
  std::optional<double> macade_standin;  // absent if the reference has no edges
};

// The scores of one view.
struct ViewScores {
  int k = 0, l = 0;                 // index of the view
  ImageScores scores;               // of the other light field
  std::optional<ImageScores> dibr;  // the baseline
};

// The scores of all views, and their means.
struct LightFieldScores {
  int u_count = 0, v_count = 0, width_px = 0, height_px = 0;  // of the views that were compared
  // Over all views, the middle ones, the outermost ones. The mean of PSNRs is over the finite ones.
  ImageScores mean, centre, corner;
  std::optional<ImageScores> dibr_mean, dibr_centre, dibr_corner;  // of the baseline, likewise
  std::vector<ViewScores> views;                                   // the views that both have
  std::vector<Notice> notices;  // remarks on the call, in their order

  // One line: mean PSNR, SSIM and dE94, and that of the baseline.
  THICKLENS_EXPORT std::string BriefReport() const;
};

// The baseline of a comparison: a photograph warped to each view by its depth (DIBR).
struct Baseline {
  Image photo;                 // the photograph that is warped
  DepthMap depth;              // its depth
  bool remove_falloff = true;  // divide the fall-off [S12] out of the photograph, with a camera
};

// The options of CompareImages and CompareLightFields.
struct CompareOptions {
  int border_px = 0;                 // 0 to 100000; a border that is left out
  std::optional<Baseline> baseline;  // of light fields only; absent: none

  // Returns whether all members are valid. Otherwise `why`, if not null, gets the field, the value
  // and the constraint.
  THICKLENS_EXPORT bool IsValid(std::string* why) const;
};

// Compares an image with the reference, both encoded. Throws Error if sizes or channels differ, if
// the border leaves nothing, and for linear light, which Image::Encoded converts.
THICKLENS_EXPORT ImageScores CompareImages(const Image& reference, const Image& other,
                                           const CompareOptions& options = {});

// Compares two light fields view by view, as the reference's transfer curve would store them. Of
// light fields with different counts the inner views of the larger one are taken, which a notice
// reports, and so is a difference of the apertures that their files state. The distances between
// neighbouring views must be equal within 5 %; 7 x 7 views and 5 x 5 views of the same aperture are
// at other places, and are refused. The arguments are values so that large ones can be moved in:
// they are freed as soon as they are no longer needed. Throws OptionError, and Error if they do not
// fit.
THICKLENS_EXPORT LightFieldScores CompareLightFields(LightField reference, LightField other,
                                                     CompareOptions options = {},
                                                     const RunControl& run = {});

}  // namespace thicklens

#endif  // THICKLENS_COMPARE_H_
