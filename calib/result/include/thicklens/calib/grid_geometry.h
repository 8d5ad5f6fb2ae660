#ifndef THICKLENS_CALIB_GRID_GEOMETRY_H_
#define THICKLENS_CALIB_GRID_GEOMETRY_H_

#include <Eigen/Core>
#include <optional>
#include <string>
#include <vector>

#include "thicklens/base/export.h"
#include "thicklens/model/camera.h"
#include "thicklens/model/lens_distortion.h"

namespace thicklens::calib {

// A combination of parameters that the frames determine, also where they leave its parts open.
struct GridCombination {
  std::string name;       // in words, with the unit: "vanishing point of the stage's motion, x, px"
  model::Estimate value;  // with its standard deviation
};

// The size of a grid, or of the marks of a sheet, in one frame.
struct GridScale {
  double reading_mm = 0;  // of the frame
  // Size on the sensor over size on the target where the axis meets the target.
  double magnification = 0;
  double sigma = 0;  // of the magnification, without the error of the print
};

// Marks of the sheet (thicklens target) that some of the sharpest frames show.
struct SheetMarks {
  bool done = false;                // true: at least two marks of one sheet were found in a frame
  std::string message = "not run";  // how it ended; without a result, the reason
  int frames = 0;                   // number of frames with marks
  int marks = 0;                    // most marks of a frame
  double side_mm = 0;               // side of a mark, mm
  std::vector<GridScale> scales;    // one per frame
  // Angle of the target about the vertical and the horizontal axis of the image, degrees: positive
  // where its right side, or its bottom, is nearer to the camera. From the perspective of the
  // marks, with the focal length of the camera file.
  std::optional<model::Estimate> tilt_right_deg, tilt_down_deg;
};

// The camera as a grid on the target shows it: focal length (image distance), principal point and
// distortion. A quantity that the frames leave open is absent.
struct GridGeometry {
  bool done = false;                         // true: the adjustment gave a result
  std::string message = "not run";           // how it ended; without a result, the reason
  std::string grid;                          // the grid in words
  int frames_searched = 0, frames_used = 0;  // frames of the sweep
  int views_searched = 0, views_used = 0;    // further views
  int points = 0;                            // found in all of them
  double rms_px = 0;                         // of the residuals, along both axes
  bool follows_readings = false;  // the frames of the sweep lie on a line at their readings
  std::vector<GridScale> scales;  // of the frames of the sweep
  // Image distance in px, f1 D/(f2 p) for D from the rear principal plane to the sensor and the
  // pixel pitch p, and d1 from it, mm.
  std::optional<model::Estimate> focal_length_px, image_distance_mm;
  std::optional<model::Estimate> principal_x_px, principal_y_px;  // of the whole field, px
  // Angle of the target about the vertical and the horizontal axis, as in SheetMarks; by the sweep.
  std::optional<model::Estimate> tilt_right_deg, tilt_down_deg;
  std::vector<GridCombination> combinations;  // determined where their parts may be open
  // Directions in which the parameters may change together without contradicting the frames, in
  // words; from the eigenvectors of the Fisher information.
  std::vector<std::string> open;
  // The adjustment's camera with 5 coefficients and covariance; where a part is open, it is that of
  // a weak prior. Present with `done`.
  std::optional<model::LensDistortion> lens;
  // Displacement by the distortion, without what a homography explains, at the worst place of the
  // field, px, and its standard deviation there.
  model::Estimate largest_shift_px;
  double chi2_of_distortion = 0;  // of the hypothesis that there is none, 5 degrees of freedom
  // Residuals of views that were left out of the adjustment, without and with distortion, px.
  double held_out_without_px = 0, held_out_with_px = 0;
  bool distortion_is_found = false;  // it is significant and determined over the field
  bool distortion_is_used = false;   // the frames were undistorted by it
  std::string verdict;               // why the distortion is, or is not, used; in one sentence

  // The lines of a report, without the name of the section. Empty: not run.
  THICKLENS_EXPORT std::vector<std::string> InWords() const;
};

}  // namespace thicklens::calib

#endif  // THICKLENS_CALIB_GRID_GEOMETRY_H_
