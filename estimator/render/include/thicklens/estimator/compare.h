#ifndef THICKLENS_ESTIMATOR_COMPARE_H_
#define THICKLENS_ESTIMATOR_COMPARE_H_

#include <Eigen/Core>
#include <optional>
#include <string>
#include <vector>

#include "thicklens/base/export.h"
#include "thicklens/estimator/disparity_map.h"
#include "thicklens/model/encoded_values.h"
#include "thicklens/model/light_field.h"
#include "thicklens/model/scene.h"

namespace thicklens::estimator {

// How close an image is to its reference.
struct ImageScores {
  double psnr_db = 0;                    // +inf for equal images
  double ssim = 0;                       // NaN if the image is smaller than the SSIM window
  double delta_e94_mean = 0;             // grey is taken as R = G = B
  std::optional<double> macade_standin;  // absent if the reference has no edges
};

// Compares the second image with the first one, the reference, without a border of `border_px`. The
// metrics are computed on the whole images, then averaged inside the border. Throws Error if the
// sizes or channels differ or the border leaves nothing.
//
// PSNR: -10 log10 of the mean squared difference, channels pooled [L19].
// SSIM (Wang et al. 2004): on 0.2126 R + 0.7152 G + 0.0722 B of the encoded values, Gaussian window
// of 11 x 11 px, sigma 1.5, K1 = 0.01, K2 = 0.03, range 1. Windows that leave the image are left
// out.
// M-dE94: mean CIE94 difference, graphic arts (kL = kC = kH = 1, K1 = 0.045, K2 = 0.015), D65 sRGB
// to Lab, with the reference's chroma in the weights.
// MACADE stand-in [D119] (the definition of MACADE was not available): mean over the edge pixels of
// the reference of |grad A . grad B|/(|grad A||grad B|); 1 for equal orientation, 2/pi for random
// orientation. The gradients are 3 x 3 (Sobel), of the grey of SSIM, without the outermost pixels.
// An edge pixel has at least half of the gradient that one pixel in a hundred of the reference
// exceeds, and at least 2/255 per px (a fixed multiple of the noise of 8-bit values). If the other
// image has no gradient at all at an edge pixel, an edge was lost and the pixel counts 0.
THICKLENS_EXPORT ImageScores CompareImages(const model::EncodedValues& reference,
                                           const model::EncodedValues& other, int border_px);

// CIE94 difference of two colours in L*, a*, b*; the first one is the reference.
THICKLENS_EXPORT double DeltaE94(const Eigen::Vector3d& reference_lab, const Eigen::Vector3d& lab);
// Converts sRGB in [0, 1] to CIE L*a*b* for D65 and the 2-degree observer.
THICKLENS_EXPORT Eigen::Vector3d LabOf(const Eigen::Vector3d& srgb);

// The scores of one view.
struct ViewScores {
  int u = 0, v = 0;                 // indices k, l
  ImageScores scores;               // of the second light field
  std::optional<ImageScores> dibr;  // of the baseline
};
// Scores of all views, with means over groups of views. The mean of PSNRs is over the finite ones
// (inf if there are none), so that views equal to the reference do not hide the others. With a
// baseline, both means of PSNR are over the views where both are finite, unless there are none.
struct LightFieldScores {
  std::vector<ViewScores> views;  // views that are present in both light fields
  // Means over all views, over the views nearest to the middle (one for odd counts, two or four for
  // even counts), and over the views farthest from it (the four corners, unless they are missing).
  ImageScores mean, centre, corner;
  std::optional<ImageScores> dibr_mean, dibr_centre, dibr_corner;  // of the baseline
};

// Input of the baseline, depth-image-based rendering (DIBR): a photograph and its disparity.
struct DibrInput {
  model::LinearImage photograph;  // linear light
  DisparityMap disparity;         // without holes
};
// Compares two light fields view by view, with values as the reference's transfer curve would store
// them. Throws Error if sizes, counts or channels differ (the message gives the counts), if no view
// is present in both, if `dibr` does not fit the views, or if both light fields have grids whose
// view steps differ by more than 5 %: inner views of a camera's larger light field are not those of
// its smaller one.
THICKLENS_EXPORT LightFieldScores CompareLightFields(const model::LightField& reference,
                                                     const model::LightField& other, int border_px,
                                                     const std::optional<DibrInput>& dibr,
                                                     int threads);

}  // namespace thicklens::estimator

#endif  // THICKLENS_ESTIMATOR_COMPARE_H_
