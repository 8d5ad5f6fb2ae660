#ifndef THICKLENS_ESTIMATOR_COMPARE_H_
#define THICKLENS_ESTIMATOR_COMPARE_H_

#include <Eigen/Core>
#include <optional>
#include <string>
#include <vector>

#include "thicklens/estimator/view_geometry.h"
#include "thicklens/model/light_field.h"
#include "thicklens/model/scene.h"

namespace thicklens::estimator {

// A picture as it would be stored, in [0, 1]: what picture metrics are taken on. Channels are
// interleaved.
struct StoredValues {
  int width_px = 0;
  int height_px = 0;
  int channels = 0;  // 1 (grey) or 3 (sRGB)
  std::vector<float> values;
};
// Divided by full scale; alpha is left out.
StoredValues StoredValuesOf(const model::StoredPicture& picture);
// Encoded by the transfer curve and clipped to [0, 1], not rounded.
StoredValues StoredValuesOf(const model::LinearPicture& picture,
                            const model::TransferCurve& transfer);

struct PictureScores {
  double psnr_db = 0;                    // +inf for equal pictures
  double ssim = 0;                       // NaN if the picture is smaller than a window
  double delta_e94_mean = 0;             // grey is taken as R = G = B
  std::optional<double> macade_standin;  // absent if the reference has no edges
};

// The second picture against the first, the reference, without a border of `border_px` (the metrics
// are computed on the whole, then averaged inside). Throws Error if the sizes or channels differ or
// the border leaves nothing.
//
// PSNR = -10 log10 of the mean squared difference, channels pooled [L19].
// SSIM (Wang et al. 2004): on .2126 R + .7152 G + .0722 B of the stored values, Gaussian window of
// 11 x 11 px, sigma 1.5, K1 = .01, K2 = .03, range 1; windows that leave the picture are left out.
// M-dE94: mean CIE94 difference, graphic arts (kL = kC = kH = 1, K1 = .045, K2 = .015), D65 sRGB to
// Lab, the reference's chroma in the weights.
// MACADE stand-in [D119] (the definition of MACADE was not available): mean over edge pixels of the
// reference of |grad A . grad B|/(|grad A||grad B|); 1 for equal orientation, 2/pi for random.
// Gradients of the grey of SSIM, 3 x 3 (Sobel), not on the outermost pixels. An edge pixel has at
// least half of the gradient that one pixel in a hundred of the reference exceeds, and at least
// 2/255 per px (a fixed multiple of the noise of 8-bit values). Where the other picture has no
// gradient at all an edge was lost: the pixel counts 0.
PictureScores ComparePictures(const StoredValues& reference, const StoredValues& other,
                              int border_px);

// CIE94 difference of two colours, L*, a*, b*, the first being the reference.
double DeltaE94(const Eigen::Vector3d& reference_lab, const Eigen::Vector3d& lab);
// sRGB in [0, 1] to CIE L*a*b*, D65, 2 degrees.
Eigen::Vector3d LabOf(const Eigen::Vector3d& srgb);

struct ViewScores {
  int u = 0, v = 0;  // indices k, l
  PictureScores scores;
  std::optional<PictureScores> dibr;
};
// Of scores, the mean; of PSNRs, the mean of the finite ones (inf if there are none), so that views
// equal to the reference do not hide the others. With a baseline, both means of PSNR are over the
// views where both are finite, unless there are none.
struct LightFieldScores {
  std::vector<ViewScores> views;  // those present in both
  // Of all views; of those nearest to the middle (one for odd counts, two or four where counts are
  // even); of those farthest from it (the four corners, unless they are missing).
  PictureScores mean, centre, corner;
  std::optional<PictureScores> dibr_mean, dibr_centre, dibr_corner;
};

// Baseline: a photograph and its disparity.
struct DibrInput {
  model::LinearPicture photograph;
  DisparityMap disparity;  // without holes
};
// View by view, as they would be stored by the reference's transfer curve. Throws Error if sizes,
// counts or channels differ (with the counts, and that --views takes inner ones), if no view is in
// both, or if both have grids whose steps between views differ by more than 5 %: inner views of a
// camera's larger light field are not those of its smaller one.
LightFieldScores CompareLightFields(const model::LightField& reference,
                                    const model::LightField& other, int border_px,
                                    const std::optional<DibrInput>& dibr, int threads);

}  // namespace thicklens::estimator

#endif  // THICKLENS_ESTIMATOR_COMPARE_H_
