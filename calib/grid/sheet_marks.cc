#include "calib/grid/sheet_marks.h"

#include <fmt/format.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <map>
#include <tuple>

#include "calib/grid/grid_adjustment.h"
#include "calib/grid/grid_detection.h"
#include "thicklens/base/pi.h"
#include "thicklens/model/target_grid.h"

namespace thicklens::calib {
namespace {

constexpr double kCornerPx = 0.3;           // of its corners, which blur rounds
constexpr double kCentrePx = 0.05;          // least standard deviation of a mark's centre
constexpr double kStepReach = 0.25;         // of a step, by which a distance may miss a multiple
constexpr double kFocalLengthError = 0.05;  // of the camera file, by which perspective is scaled

// A mark in a frame.
struct Mark {
  int corner = 0;
  FoundMarker found;
};

// The marks of one sheet, by their side.
std::vector<Mark> MarksIn(const cv::Mat& light, double* side_mm) {
  std::map<double, std::vector<Mark>> by_side;
  for (const FoundMarker& marker : FindMarkers(light, model::kSheetDictionary)) {
    const std::optional<model::SheetMark> mark = model::SheetMarkOf(marker.number);
    if (mark) by_side[mark->side_mm].push_back({mark->corner, marker});
  }
  std::vector<Mark> most;
  for (const auto& [side, marks] : by_side) {
    if (marks.size() <= most.size()) continue;
    most = marks;
    *side_mm = side;
  }
  return most;
}

// Distances between the columns and the rows of marks, in steps; 0: not seen.
struct Steps {
  double x = 0, y = 0;
};
// The distances by the shape of the marks; absent: they are no multiples of a step, so that these
// are no marks of one flat sheet.
std::optional<Steps> StepsOf(const std::vector<Mark>& marks) {
  Steps steps;
  for (const Mark& a : marks) {
    for (const Mark& b : marks) {
      // Sides of a mark half-way between the two, px: those of a tilted sheet differ.
      Eigen::Matrix2d axes = Eigen::Matrix2d::Zero();
      for (const Mark* mark : {&a, &b}) {
        const auto& c = mark->found.corners_px;
        axes.col(0) += 0.25 * (c[1] - c[0] + c[2] - c[3]);
        axes.col(1) += 0.25 * (c[3] - c[0] + c[2] - c[1]);
      }
      const Eigen::Matrix2d to_sides = axes.inverse();
      if (!to_sides.allFinite()) return std::nullopt;
      const Eigen::Vector2d apart =
          to_sides * (b.found.CentrePx() - a.found.CentrePx()) / model::kMarkStep;
      const int columns = b.corner % 2 - a.corner % 2, rows = b.corner / 2 - a.corner / 2;
      for (const auto& [count, value, step] :
           {std::tuple(columns, apart.x(), &steps.x), std::tuple(rows, apart.y(), &steps.y)}) {
        if (count < 0) continue;
        const double whole = std::round(value);
        if (std::abs(value - whole) > kStepReach || (count == 0) != (whole == 0) || whole < 0)
          return std::nullopt;
        if (count == 0) continue;
        if (*step > 0 && *step != whole) return std::nullopt;
        *step = whole;
      }
    }
  }
  return steps;
}

struct Tilt {
  double right_deg = 0, down_deg = 0;
  Eigen::Vector2d sigma_deg{0, 0};
};

}  // namespace

SheetMarks FindSheetMarks(const FocusSweep& sweep, const std::vector<MarkedFrame>& frames) {
  SheetMarks result;
  result.message = "no marks of a sheet are in view";
  const double pitch_mm = sweep.camera.sensor.pixel_pitch_mm;
  std::vector<Tilt> tilts;
  for (const MarkedFrame& frame : frames) {
    double side_mm = 0;
    const std::vector<Mark> marks = MarksIn(frame.light, &side_mm);
    if (marks.size() < 2 || (result.side_mm > 0 && side_mm != result.side_mm)) continue;
    const std::optional<Steps> steps = StepsOf(marks);
    if (!steps) continue;
    // Centres are not displaced by blur as corners are, but fewer than four do not show a tilt.
    const bool has_centres = marks.size() == 4;
    GridSetup setup;
    GridView view;
    const auto add = [&](const Eigen::Vector2d& at_mm, const Eigen::Vector2d& at_px) {
      view.ids.push_back(static_cast<int>(setup.target_mm.size()));
      view.image_px.push_back(at_px);
      setup.target_mm.push_back(at_mm);
    };
    for (const Mark& mark : marks) {
      const Eigen::Vector2d at_mm(model::kMarkStep * side_mm * steps->x * (mark.corner % 2),
                                  model::kMarkStep * side_mm * steps->y * (mark.corner / 2));
      if (has_centres) {
        add(at_mm, mark.found.CentrePx());
        continue;
      }
      const double half = 0.5 * side_mm;
      const Eigen::Vector2d corners_mm[] = {
          {-half, -half}, {half, -half}, {half, half}, {-half, half}};
      for (std::size_t i = 0; i < 4; ++i) add(at_mm + corners_mm[i], mark.found.corners_px[i]);
    }
    const auto count = static_cast<double>(view.ids.size());
    Eigen::Vector2d mean_mm(0, 0), mean_px(0, 0);
    for (std::size_t i = 0; i < view.ids.size(); ++i) {
      mean_mm += setup.target_mm[i] / count;
      mean_px += view.image_px[i] / count;
    }
    double square_mm2 = 0, square_px2 = 0;
    for (std::size_t i = 0; i < view.ids.size(); ++i) {
      setup.target_mm[i] -= mean_mm;
      square_mm2 += setup.target_mm[i].squaredNorm();
      square_px2 += (view.image_px[i] - mean_px).squaredNorm();
    }
    if (!(square_mm2 > 0)) continue;
    setup.width_px = sweep.camera.sensor.width_px;
    setup.height_px = sweep.camera.sensor.height_px;
    setup.principal_point_px =
        sweep.camera.sensor.principal_point_px - Eigen::Vector2d(sweep.roi.x, sweep.roi.y);
    setup.focal_length_px = sweep.camera.lens.front_focal_length_mm *
                            (1 + std::sqrt(square_px2 / square_mm2) * pitch_mm) / pitch_mm;
    const GridPose pose = FitPose(setup, Eigen::VectorXd::Zero(kRailAt), view);
    if (!(pose.place_mm.z() > 0)) continue;
    const double noise_px = std::max(has_centres ? kCentrePx : kCornerPx,
                                     pose.rms_px * std::sqrt(count / std::max(1.0, count - 3)));
    const auto shown = [](const Eigen::VectorXd& six) {
      const TargetPlane at = PlaneOfTarget(six.head<3>(), six.tail<3>());
      return Eigen::Vector3d(std::atan(at.right), std::atan(at.down), at.depth_mm);
    };
    Eigen::VectorXd six(6);
    six << pose.rotation, pose.place_mm;
    const Eigen::Vector3d at = shown(six);
    Eigen::MatrixXd gradient(3, 6);
    for (int i = 0; i < 6; ++i) {
      const double step = 1e-6 * (i < 3 ? 1 : at.z());
      Eigen::VectorXd more = six, less = six;
      more[i] += step;
      less[i] -= step;
      gradient.col(i) = (shown(more) - shown(less)) / (2 * step);
    }
    const Eigen::Matrix3d error =
        noise_px * noise_px * gradient * pose.covariance * gradient.transpose();
    const double degrees = 180 / kPi;
    tilts.push_back({degrees * at.x(), degrees * at.y(),
                     degrees * Eigen::Vector2d(std::sqrt(error(0, 0)), std::sqrt(error(1, 1)))});
    const double magnification = setup.focal_length_px * pitch_mm / at.z();
    const double sigma = magnification * std::sqrt(error(2, 2)) / at.z();
    result.done = true;
    result.side_mm = side_mm;
    result.marks = std::max(result.marks, static_cast<int>(marks.size()));
    ++result.frames;
    result.scales.push_back({frame.reading_mm, magnification, sigma});
  }
  if (result.done) result.message = "found";
  if (!tilts.empty()) {
    // The frames show one sheet: their mean, with the larger of scatter and error.
    const auto mean = [&](const auto& value, int axis) {
      double sum = 0, squares = 0, variance = 0;
      for (const Tilt& tilt : tilts) {
        sum += value(tilt);
        squares += value(tilt) * value(tilt);
        variance += tilt.sigma_deg[axis] * tilt.sigma_deg[axis];
      }
      const auto n = static_cast<double>(tilts.size());
      const double centre = sum / n;
      const double scatter = std::max(0.0, squares / n - centre * centre);
      return model::Estimate{centre, std::hypot(std::sqrt(std::max(scatter, variance / n) / n),
                                                kFocalLengthError * centre)};
    };
    result.tilt_right_deg = mean([](const Tilt& tilt) { return tilt.right_deg; }, 0);
    result.tilt_down_deg = mean([](const Tilt& tilt) { return tilt.down_deg; }, 1);
  }
  return result;
}

}  // namespace thicklens::calib
