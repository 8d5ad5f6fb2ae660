#include "calib/grid/grid_geometry.h"

#include <fmt/format.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <limits>
#include <mutex>

#include "calib/grid/grid_detection.h"
#include "thicklens/base/error.h"
#include "thicklens/base/parallel.h"
#include "thicklens/base/pi.h"
#include "thicklens/base/statistics.h"
#include "thicklens/model/pupil_law.h"

namespace thicklens::calib {
namespace {

constexpr std::size_t kMaxFrames = 60;       // of a sweep, evenly chosen
constexpr std::size_t kMinFramesOfGrid = 4;  // that show a motion
constexpr double kPrintError = 0.003;        // relative, of the size of a print
constexpr double kPointPx = 0.02;            // least standard deviation of a point in a frame
constexpr double kFileError = 0.05;          // of the file's focal length, which scales the tilt
// Part of the unit of a parameter above which a direction of the parameters is called open. The
// weak prior then has an effect below 0.3 % of its distance.
constexpr double kOpen = 0.05;
constexpr double kKnownFocalLength = 0.05;  // relative sigma up to which it is reported
constexpr double kKnownPoint = 0.025;       // likewise, of the image's width
constexpr double kKnownTiltDeg = 5;
constexpr double kNamedPart = 0.25;  // of the largest part of an open direction
constexpr int kMaxDirections = 4;
// A distortion: chi^2 of five coefficients (1.5e-5 by chance), its size, its error over the field,
// and the residuals of views that were left out.
constexpr double kSurely = 30, kSmallestShiftPx = 0.1, kSigmasOfShift = 3;
constexpr double kErrorOfShift = 0.25, kSmallErrorPx = 0.1, kHeldOutGain = 0.98;
// The change of the grid's size over the sweep, relative to what the readings and the focal length
// of the camera file let expect; and the scatter about the line.
constexpr double kMinChange = 0.4, kMaxChange = 2.5, kMaxScatter = 0.1;
constexpr double kSeenChange = 5;  // standard deviations of the change that must be expected

// px of the image per mm of the target at the target's middle, by the homography of a view.
double ScaleOf(const GridView& view, const std::vector<Eigen::Vector2d>& target_mm) {
  // The affine part of least squares is the homography's in the middle of the points.
  const auto n = static_cast<Eigen::Index>(view.ids.size());
  Eigen::MatrixXd design(n, 3), image(n, 2);
  for (Eigen::Index i = 0; i < n; ++i) {
    const Eigen::Vector2d& at =
        target_mm[static_cast<std::size_t>(view.ids[static_cast<std::size_t>(i)])];
    design.row(i) << at.x(), at.y(), 1;
    image.row(i) = view.image_px[static_cast<std::size_t>(i)];
  }
  const Eigen::MatrixXd map = design.colPivHouseholderQr().solve(image);
  return std::sqrt(std::abs(map.topRows(2).determinant()));
}

// px of the image per mm of the target where the axis meets it, by the pose of a view before a
// camera without distortion. A tilted target is not smaller there, though its affine map is.
model::Estimate ScaleByPose(const GridSetup& setup, const GridView& view) {
  const GridPose pose = FitPose(setup, Eigen::VectorXd::Zero(kRailAt), view);
  const auto depth_mm = [](const Eigen::VectorXd& six) {
    return PlaneOfTarget(six.head<3>(), six.tail<3>()).depth_mm;
  };
  Eigen::VectorXd six(6);
  six << pose.rotation, pose.place_mm;
  const double at_mm = depth_mm(six);
  const double scale = setup.focal_length_px / at_mm;
  if (!(at_mm > 0) || !std::isfinite(scale)) {
    const double affine = ScaleOf(view, setup.target_mm);
    return {affine, kPrintError * affine};
  }
  Eigen::VectorXd gradient(6);
  for (int i = 0; i < 6; ++i) {
    const double step = 1e-6 * (i < 3 ? 1 : at_mm);
    Eigen::VectorXd more = six, less = six;
    more[i] += step;
    less[i] -= step;
    gradient[i] = (depth_mm(more) - depth_mm(less)) / (2 * step);
  }
  const auto count = static_cast<double>(view.ids.size());
  const double noise_px =
      std::max(kPointPx, pose.rms_px * std::sqrt(count / std::max(1.0, count - 3)));
  const double variance = gradient.dot(pose.covariance * gradient);
  return {scale, scale * noise_px * std::sqrt(std::max(0.0, variance)) / at_mm};
}

// The scale with the error that the tilt has from that of the focal length.
model::Estimate ScaleAtAxis(const GridSetup& setup, const GridView& view) {
  model::Estimate scale = ScaleByPose(setup, view);
  GridSetup longer = setup;
  longer.focal_length_px *= 1 + kFileError;
  scale.sigma = std::hypot(scale.sigma, ScaleByPose(longer, view).value - scale.value);
  return scale;
}

// The position that a camera without the stated distortion would show.
Eigen::Vector2d Undistorted(const model::LensDistortion& distortion, const Eigen::Vector2d& at_px) {
  Eigen::Vector2d found = at_px;
  constexpr int kSteps = 50;
  for (int i = 0; i < kSteps; ++i) {
    const Eigen::Vector2d miss = at_px - distortion.Distorted(found);
    if (!miss.allFinite()) break;
    found += miss;
    if (miss.norm() < 1e-6) break;
  }
  return found;
}

// Places of the field at which displacements are compared.
std::vector<Eigen::Vector2d> FieldOf(const GridSetup& setup) {
  std::vector<Eigen::Vector2d> field;
  constexpr int kColumns = 9, kRows = 7;
  for (int row = 0; row < kRows; ++row) {
    for (int column = 0; column < kColumns; ++column)
      field.emplace_back((setup.width_px - 1) * static_cast<double>(column) / (kColumns - 1),
                         (setup.height_px - 1) * static_cast<double>(row) / (kRows - 1));
  }
  return field;
}

model::LensDistortion LensOf(const GridSetup& setup, const GridAdjustment& found) {
  const Eigen::VectorXd camera = CameraOf(setup, found.shared);
  model::LensDistortion lens;
  lens.width_px = setup.width_px;
  lens.height_px = setup.height_px;
  lens.focal_length_px = {camera[0], camera[0]};
  lens.principal_point_px = {camera[1], camera[2]};
  lens.coefficients.assign(camera.data() + 3, camera.data() + kCameraSize);
  const Eigen::MatrixXd gradient = CameraGradient(setup, found.shared);
  lens.covariance =
      gradient * found.covariance.topLeftCorner(kCameraSize, kCameraSize) * gradient.transpose();
  // Rounding must not make it asymmetric.
  const Eigen::MatrixXd turned = lens.covariance.transpose();
  lens.covariance = 0.5 * (lens.covariance + turned);
  lens.source = "the grid of the sweep";
  return lens;
}

// [L20] by the five coefficients of a camera (CameraOf), px.
Eigen::Vector2d Displacement(const Eigen::VectorXd& camera, const Eigen::Vector2d& at_px) {
  const double x = (at_px.x() - camera[1]) / camera[0], y = (at_px.y() - camera[2]) / camera[0];
  const double s = x * x + y * y;
  const double q = s * (camera[3] + s * (camera[4] + s * camera[7]));
  return camera[0] * Eigen::Vector2d(x * q + 2 * camera[5] * x * y + camera[6] * (s + 2 * x * x),
                                     y * q + camera[5] * (s + 2 * y * y) + 2 * camera[6] * x * y);
}

// [D162] Displacements over the field without what a homography explains, and their error. Another
// direction of the axis, another scale and another principal point bend no line.
struct FieldShift {
  model::Estimate largest_px;
  double worst_sigma_px = 0;
};
FieldShift ShiftOf(const GridSetup& setup, const GridAdjustment& found) {
  const std::vector<Eigen::Vector2d> field = FieldOf(setup);
  const auto n = static_cast<Eigen::Index>(2 * field.size());
  const auto stacked = [&](const Eigen::VectorXd& shared) {
    const Eigen::VectorXd camera = CameraOf(setup, shared);
    Eigen::VectorXd shift(n);
    for (std::size_t i = 0; i < field.size(); ++i)
      shift.segment<2>(static_cast<Eigen::Index>(2 * i)) = Displacement(camera, field[i]);
    return shift;
  };
  Eigen::MatrixXd homographies(n, 8);
  for (std::size_t i = 0; i < field.size(); ++i) {
    const Eigen::Vector2d at =
        (field[i] - 0.5 * Eigen::Vector2d(setup.width_px, setup.height_px)) / setup.width_px;
    const double x = at.x(), y = at.y();
    const auto row = static_cast<Eigen::Index>(2 * i);
    homographies.row(row) << 1, 0, x, y, 0, 0, x * x, x * y;
    homographies.row(row + 1) << 0, 1, 0, 0, x, y, x * y, y * y;
  }
  const Eigen::ColPivHouseholderQR<Eigen::MatrixXd> qr(homographies);
  const auto without = [&](const Eigen::MatrixXd& fields) {
    return Eigen::MatrixXd(fields - homographies * qr.solve(fields));
  };
  const Eigen::VectorXd shift = without(stacked(found.shared));
  Eigen::MatrixXd gradient(n, kCameraSize);
  for (int i = 0; i < kCameraSize; ++i) {
    const double step = std::max(1e-8, 1e-3 * std::sqrt(found.covariance(i, i)));
    Eigen::VectorXd more = found.shared, less = found.shared;
    more[i] += step;
    less[i] -= step;
    gradient.col(i) = (stacked(more) - stacked(less)) / (2 * step);
  }
  const Eigen::MatrixXd projected = without(gradient);
  const Eigen::MatrixXd covariance = found.covariance.topLeftCorner(kCameraSize, kCameraSize);
  FieldShift result;
  for (Eigen::Index i = 0; i < n; i += 2) {
    const Eigen::Matrix2d error =
        projected.middleRows(i, 2) * covariance * projected.middleRows(i, 2).transpose();
    result.worst_sigma_px = std::max(result.worst_sigma_px, std::sqrt(0.5 * error.trace()));
    const Eigen::Vector2d at = shift.segment<2>(i);
    if (!(at.norm() > result.largest_px.value)) continue;
    const Eigen::Vector2d along = at.normalized();
    result.largest_px = {at.norm(), std::sqrt(along.dot(error * along))};
  }
  return result;
}

// A parameter of an open direction: its value, its unit, and how it is reported.
struct Shown {
  std::function<double(const Eigen::VectorXd&)> value;
  double unit = 1;
  const char* name = "";
  double shown = 1;  // factor of the value in the text
  const char* shown_unit = "";
};

std::vector<Shown> ShownParameters(const GridSetup& setup, bool has_motion) {
  const auto at = [](int index) {
    return [index](const Eigen::VectorXd& shared) { return shared[index]; };
  };
  std::vector<Shown> parameters = {
      {at(0), 1, "image distance", 100, " %"},
      {at(1), 0.5, "principal point x", static_cast<double>(setup.width_px), " px"},
      {at(2), 0.5, "principal point y", static_cast<double>(setup.width_px), " px"},
      {at(3), 0.3, "k1", 100, " % at the corner"},
      {at(4), 0.15, "k2", 100, " % at the corner"},
      {at(5), 0.03, "p1", 100, " % at the corner"},
      {at(6), 0.03, "p2", 100, " % at the corner"},
      {at(7), 0.05, "k3", 100, " % at the corner"}};
  if (!has_motion) return parameters;
  const double degrees = 180 / kPi;
  parameters.push_back({at(kRailAt + 6), 0.5, "direction of the motion in x", degrees, " degrees"});
  parameters.push_back({at(kRailAt + 7), 0.5, "direction of the motion in y", degrees, " degrees"});
  const auto plane = [](const Eigen::VectorXd& shared) {
    return PlaneOfTarget(shared.segment<3>(kRailAt), shared.segment<3>(kRailAt + 3));
  };
  parameters.push_back({[plane](const Eigen::VectorXd& s) { return std::log(plane(s).depth_mm); },
                        1, "distance of the target", 100, " %"});
  parameters.push_back({[plane](const Eigen::VectorXd& s) { return std::atan(plane(s).right); },
                        0.5, "tilt of the target about the vertical", degrees, " degrees"});
  parameters.push_back({[plane](const Eigen::VectorXd& s) { return std::atan(plane(s).down); }, 0.5,
                        "tilt of the target about the horizontal", degrees, " degrees"});
  return parameters;
}

// [D163] The eigenvectors of the Fisher information, with each parameter in its unit, whose
// standard deviation is more than a part of that unit.
std::vector<std::string> OpenDirections(const GridSetup& setup, const GridAdjustment& found) {
  const std::vector<Shown> parameters = ShownParameters(setup, found.has_motion);
  const auto n = static_cast<Eigen::Index>(parameters.size());
  Eigen::MatrixXd gradient(n, found.shared.size());
  for (Eigen::Index j = 0; j < found.shared.size(); ++j) {
    const double step = std::max(1e-9, 1e-3 * std::sqrt(found.covariance(j, j)));
    Eigen::VectorXd more = found.shared, less = found.shared;
    more[j] += step;
    less[j] -= step;
    for (Eigen::Index i = 0; i < n; ++i) {
      const Shown& of = parameters[static_cast<std::size_t>(i)];
      gradient(i, j) = (of.value(more) - of.value(less)) / (2 * step) / of.unit;
    }
  }
  const Eigen::MatrixXd scaled = gradient * found.covariance * gradient.transpose();
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> solver(scaled);
  std::vector<std::string> directions;
  for (Eigen::Index k = n - 1; k >= 0 && static_cast<int>(directions.size()) < kMaxDirections;
       --k) {
    const double sigma = std::sqrt(std::max(0.0, solver.eigenvalues()[k]));
    if (!(sigma > kOpen)) break;
    Eigen::VectorXd direction = solver.eigenvectors().col(k);
    Eigen::Index largest = 0;
    const double most = direction.cwiseAbs().maxCoeff(&largest);
    if (direction[largest] < 0) direction = -direction;
    std::string text;
    for (Eigen::Index i = 0; i < n; ++i) {
      if (!(std::abs(direction[i]) > kNamedPart * most)) continue;
      const Shown& of = parameters[static_cast<std::size_t>(i)];
      text += fmt::format("{}{} {:+.2g}{}", text.empty() ? "" : ", ", of.name,
                          sigma * direction[i] * of.unit * of.shown, of.shown_unit);
    }
    directions.push_back(text);
  }
  return directions;
}

class Geometry {
 public:
  Geometry(const FocusSweep& sweep, const GridViews& found) : sweep_(sweep), found_(found) {
    result_.grid = sweep.target_grid->Description();
    result_.frames_used = static_cast<int>(found.frames.size());
    result_.views_used = static_cast<int>(found.views.size());
  }

  GridGeometry Run() {
    MakeTarget();
    if (found_.frames.empty() && found_.views.empty()) {
      result_.message = fmt::format(
          "target_grid: no frame shows the {} sharply enough to be found: check the numbers of "
          "squares, and that all of the grid is in view",
          result_.grid);
      return result_;
    }
    MakeSetup();
    MeasureScales();
    const bool follows = CompareWithReadings();
    if (!follows && found_.views.empty()) return result_;
    Adjust(follows);
    return result_;
  }

 private:
  void MakeTarget() {
    setup_.target_mm = model::GridPoints(*sweep_.target_grid);
    Eigen::Vector2d mean_mm(0, 0);
    for (const Eigen::Vector2d& point : setup_.target_mm)
      mean_mm += point / static_cast<double>(setup_.target_mm.size());
    for (Eigen::Vector2d& point : setup_.target_mm) point -= mean_mm;
    if (sweep_.target_grid->pattern == model::GridPattern::kCircles)
      setup_.disc_radius_mm = model::kCirclePart * sweep_.target_grid->square_mm;
  }

  void MakeSetup() {
    const model::Sensor& sensor = sweep_.camera.sensor;
    setup_.width_px = sensor.width_px;
    setup_.height_px = sensor.height_px;
    setup_.principal_point_px = sensor.principal_point_px;
    const GridView& some =
        found_.frames.empty() ? found_.views.front() : found_.frames[found_.frames.size() / 2];
    // [S13] D = f2 (1 + m) for a target in focus; f1 D/(f2 p) is the distance that chief rays show.
    const auto start_from = [&](double px_per_mm) {
      setup_.focal_length_px = sweep_.camera.lens.front_focal_length_mm *
                               (1 + px_per_mm * sensor.pixel_pitch_mm) / sensor.pixel_pitch_mm;
    };
    start_from(ScaleOf(some, setup_.target_mm));
    start_from(ScaleAtAxis(setup_, some).value);
    setup_.reading_sigma_mm = sweep_.reading_sigma_mm;
    if (sweep_.stage_alignment_deg) setup_.alignment_rad = *sweep_.stage_alignment_deg * kPi / 180;
  }

  void MeasureScales() {
    for (std::size_t i = 0; i < found_.frames.size(); ++i) {
      const double pitch_mm = sweep_.camera.sensor.pixel_pitch_mm;
      const model::Estimate scale = ScaleAtAxis(setup_, found_.frames[i]);
      result_.scales.push_back(
          {found_.readings_mm[i], scale.value * pitch_mm, scale.sigma * pitch_mm});
    }
  }

  // Whether 1/scale grows with the position as it does before a fixed camera. Frames that were
  // aligned by a program all have one scale, and a lens that moves has another law.
  bool CompareWithReadings() {
    const auto n = static_cast<Eigen::Index>(found_.frames.size());
    if (n < static_cast<Eigen::Index>(kMinFramesOfGrid)) {
      result_.message =
          fmt::format("target_grid: {} frames of the sweep show the {}, fewer than {}", n,
                      result_.grid, kMinFramesOfGrid);
      return false;
    }
    Eigen::MatrixXd design(n, 2);
    Eigen::VectorXd inverse(n);
    for (Eigen::Index i = 0; i < n; ++i) {
      design.row(i) << 1, *found_.frames[static_cast<std::size_t>(i)].position_mm;
      inverse[i] = setup_.focal_length_px * sweep_.camera.sensor.pixel_pitch_mm /
                   result_.scales[static_cast<std::size_t>(i)].magnification;
    }
    // `inverse` is the distance, mm, if the focal length is right: its slope is 1.
    const Eigen::Vector2d line = design.colPivHouseholderQr().solve(inverse);
    const double scatter_mm = std::sqrt((inverse - design * line).squaredNorm() /
                                        std::max<double>(1, static_cast<double>(n - 2)));
    const double range_mm = design.col(1).maxCoeff() - design.col(1).minCoeff();
    const double noise_mm = std::max(scatter_mm, 1e-5 * inverse.mean());
    if (!(range_mm > kSeenChange * noise_mm)) {
      // A short sweep shows no change of scale: neither for nor against the readings.
      result_.follows_readings = std::abs(line[1] * range_mm) < kSeenChange * noise_mm;
    } else {
      result_.follows_readings = line[1] > kMinChange && line[1] < kMaxChange &&
                                 scatter_mm < kMaxScatter * line[1] * range_mm;
    }
    if (!result_.follows_readings) {
      result_.message = fmt::format(
          "target_grid: the size of the grid changes by {:.2g} of what the readings and the focal "
          "length of the camera file let expect, with a scatter of {:.2g} mm about a line: the "
          "frames were aligned or scaled by a program, the lens or the sensor moves, or readings "
          "are "
          "wrong; no geometry is taken from them",
          line[1], scatter_mm);
    }
    return result_.follows_readings;
  }

  void Adjust(bool follows) {
    if (follows) setup_.views = found_.frames;
    setup_.views.insert(setup_.views.end(), found_.views.begin(), found_.views.end());
    const GridAdjustment found = AdjustGrid(setup_);
    if (!found.done) {
      result_.message = "target_grid: " + found.message;
      return;
    }
    result_.done = true;
    if (follows) result_.message.clear();
    result_.points = found.points;
    result_.rms_px = found.rms_px;
    result_.lens = LensOf(setup_, found);
    Report(found);
    JudgeDistortion(found, follows);
  }

  void Report(const GridAdjustment& found) {
    const auto camera = [&](int index) {
      return found.Of([&](const Eigen::VectorXd& s) { return CameraOf(setup_, s)[index]; });
    };
    const model::Estimate focal_px = camera(0);
    if (focal_px.sigma < kKnownFocalLength * focal_px.value) {
      result_.focal_length_px = focal_px;
      const model::ThickLens& lens = sweep_.camera.lens;
      const double per_px = sweep_.camera.sensor.pixel_pitch_mm * lens.rear_focal_length_mm /
                            lens.front_focal_length_mm;
      // Sizes are proportional to 1/(z - c) for the centre of perspective c, which depends on the
      // light in the pupil and is not known: m (zf - c) is seen in place of D = m zf f2/f1.
      const double distance_mm = per_px * focal_px.value;
      result_.image_distance_mm = model::Estimate{
          lens.lens_thickness_mm + distance_mm,
          std::hypot(per_px * focal_px.sigma, distance_mm * PupilError(distance_mm))};
    }
    const model::Estimate x_px = camera(1), y_px = camera(2);
    if (std::max(x_px.sigma, y_px.sigma) < kKnownPoint * setup_.width_px) {
      result_.principal_x_px = x_px;
      result_.principal_y_px = y_px;
    }
    result_.open = OpenDirections(setup_, found);
    if (!found.has_motion) return;
    const auto plane = [](const Eigen::VectorXd& s) {
      return PlaneOfTarget(s.segment<3>(kRailAt), s.segment<3>(kRailAt + 3));
    };
    const double degrees = 180 / kPi;
    const model::Estimate right =
        found.Of([&](const Eigen::VectorXd& s) { return degrees * std::atan(plane(s).right); });
    const model::Estimate down =
        found.Of([&](const Eigen::VectorXd& s) { return degrees * std::atan(plane(s).down); });
    if (std::max(right.sigma, down.sigma) < kKnownTiltDeg) {
      result_.tilt_right_deg = right;
      result_.tilt_down_deg = down;
    }
    // [D161] What a motion along a line always fixes: the size in the image in the middle of the
    // sweep, and the place to which all points of the target run.
    const auto combine = [&](const char* name, const auto& function) {
      result_.combinations.push_back({name, found.Of(function)});
    };
    combine(
        "image distance in px over the distance of the target in the middle of the sweep, px/mm",
        [&](const Eigen::VectorXd& s) { return CameraOf(setup_, s)[0] / s[kRailAt + 5]; });
    combine("vanishing point of the motion, x, px", [&](const Eigen::VectorXd& s) {
      const Eigen::VectorXd c = CameraOf(setup_, s);
      return c[1] + c[0] * s[kRailAt + 6];
    });
    combine("vanishing point of the motion, y, px", [&](const Eigen::VectorXd& s) {
      const Eigen::VectorXd c = CameraOf(setup_, s);
      return c[2] + c[0] * s[kRailAt + 7];
    });
  }

  // The largest |c|/zf of the pupil laws.
  double PupilError(double distance_mm) const {
    const model::ThickLens& lens = sweep_.camera.lens;
    constexpr double kUsualRatio = 0.45;
    const double behind_mm = distance_mm - lens.rear_focal_length_mm;
    if (!(behind_mm > 0)) return 0;
    const double zf_mm = lens.front_focal_length_mm * distance_mm / behind_mm;
    double largest = 0;
    for (const model::PupilLaw law : model::AllPupilLaws()) {
      largest = std::max(largest, std::abs(model::CentreOfPerspectiveMm(lens, sweep_.camera.psf,
                                                                        law, kUsualRatio, zf_mm)) /
                                      zf_mm);
    }
    return largest;
  }

  // Residuals of every second view that an adjustment to the others leaves, without and with
  // distortion.
  void HoldOut() {
    GridSetup half = setup_;
    half.views.clear();
    std::vector<GridView> rest;
    for (std::size_t i = 0; i < setup_.views.size(); ++i)
      (i % 2 == 0 ? half.views : rest).push_back(setup_.views[i]);
    double* const rms_px[] = {&result_.held_out_without_px, &result_.held_out_with_px};
    for (const bool has_distortion : {false, true}) {
      half.has_distortion = has_distortion;
      const GridAdjustment found = AdjustGrid(half);
      double square = 0;
      for (const GridView& view : rest) {
        // An adjustment that fails is no evidence: every comparison with it is false.
        const double rms = found.done ? HeldOutRms(half, found.shared, view)
                                      : std::numeric_limits<double>::quiet_NaN();
        square += rms * rms;
      }
      *rms_px[has_distortion ? 1 : 0] =
          std::sqrt(square / std::max<double>(1, static_cast<double>(rest.size())));
    }
  }

  void JudgeDistortion(const GridAdjustment& found, bool follows) {
    constexpr int kFirst = 3, kCount = 5;
    const Eigen::VectorXd coefficients = found.shared.segment(kFirst, kCount);
    const Eigen::MatrixXd covariance = found.covariance.block(kFirst, kFirst, kCount, kCount);
    result_.chi2_of_distortion = coefficients.dot(covariance.ldlt().solve(coefficients));
    const FieldShift shift = ShiftOf(setup_, found);
    result_.largest_shift_px = shift.largest_px;
    HoldOut();
    const std::string size =
        fmt::format("{:.2g} +- {:.2g} px at most", shift.largest_px.value, shift.largest_px.sigma);
    std::string why;
    if (!(result_.chi2_of_distortion > kSurely) ||
        !(shift.largest_px.value > kSigmasOfShift * shift.largest_px.sigma) ||
        !(result_.held_out_with_px < kHeldOutGain * result_.held_out_without_px)) {
      result_.verdict = fmt::format(
          "no distortion is seen beyond doubt ({}; chi2 {:.3g} with 5 degrees of freedom, 30 is "
          "needed; views left out: {:.3g} px without and {:.3g} px with it)",
          size, result_.chi2_of_distortion, result_.held_out_without_px, result_.held_out_with_px);
    } else if (!(shift.largest_px.value > kSmallestShiftPx)) {
      result_.verdict = fmt::format("the distortion is negligible ({})", size);
    } else if (!(shift.worst_sigma_px <
                 std::max(kSmallErrorPx, kErrorOfShift * shift.largest_px.value))) {
      result_.verdict = fmt::format(
          "the lens distorts ({}), but the grid does not determine it over the whole field ({:.2g} "
          "px at the worst place): it is not used; let the grid fill the field, and add tilted "
          "views",
          size, shift.worst_sigma_px);
    } else if (!result_.lens->IsValid(&why)) {
      result_.verdict = "the distortion cannot be used: " + why;
    } else {
      result_.distortion_is_found = true;
      result_.verdict = fmt::format(
          "distortion {}; chi2 {:.3g} with 5 degrees of freedom; views left out: {:.3g} px without "
          "and {:.3g} px with it",
          size, result_.chi2_of_distortion, result_.held_out_without_px, result_.held_out_with_px);
      if (!follows && !found_.frames.empty()) {
        result_.verdict += "; it is not used, because the frames do not follow their readings";
      } else if (sweep_.camera.distortion) {
        result_.verdict += "; it is what the stated distortion leaves, and is not used";
      } else {
        result_.distortion_is_used = true;
        result_.verdict += "; the frames are undistorted by it";
      }
    }
  }

  const FocusSweep& sweep_;
  const GridViews& found_;
  GridSetup setup_;
  GridGeometry result_;
};

}  // namespace

GridGeometry GeometryOf(const FocusSweep& sweep, const GridViews& found) {
  return Geometry(sweep, found).Run();
}

GridGeometry MeasureGrid(const FocusSweep& sweep, int threads, const std::function<void()>& tick) {
  GridGeometry none;
  if (!sweep.target_grid) return none;
  none.grid = sweep.target_grid->Description();
  if (sweep.target_grid->pattern == model::GridPattern::kCharuco && !CanFindMarkers()) {
    none.message =
        "target_grid: this program was built without OpenCV's aruco module (Debian "
        "package libopencv-contrib-dev), which finds ChArUco boards";
    return none;
  }
  if (sweep.sensor_px_per_px != 1) {
    none.message =
        "target_grid: with raw: green, the grid is looked for neither in the frames nor in "
        "grid_views";
    return none;
  }
  if (sweep.moves && model::MovesFocus(*sweep.moves)) {
    none.message =
        "target_grid: the lens or the sensor moves, so that each frame has another image "
        "distance: no geometry is taken from the frames";
    return none;
  }
  // The whole frames as they come from the camera.
  FocusSweep whole = sweep;
  whole.roi = {};
  whole.camera.distortion.reset();
  const std::size_t frames = std::min(kMaxFrames, sweep.frames.size());
  const std::size_t count = frames + sweep.grid_views.size();
  const std::vector<std::size_t> chosen = [&] {
    std::vector<std::size_t> indices;
    for (std::size_t i = 0; i < frames; ++i) indices.push_back(i * sweep.frames.size() / frames);
    return indices;
  }();
  std::vector<std::optional<GridView>> views(count);
  std::mutex mutex;
  ParallelFor(static_cast<int>(count), threads, [&](int item) {
    const auto i = static_cast<std::size_t>(item);
    FocusSweep of = whole;
    cv::Mat stored;
    std::size_t index = i < frames ? chosen[i] : 0;
    if (i < frames) {
      stored = sweep.read_frame(index);
    } else {
      // Messages name the view.
      of.frames = {{sweep.grid_views[i - frames], 0}};
      stored = sweep.read_grid_view(i - frames);
      index = 0;
    }
    views[i] = DetectGrid(LinearGrey(stored, of, index), *sweep.target_grid);
    if (views[i] && sweep.camera.distortion) {
      const model::LensDistortion stated =
          sweep.camera.distortion->ScaledTo(stored.cols, stored.rows);
      for (Eigen::Vector2d& at : views[i]->image_px) at = Undistorted(stated, at);
    }
    const std::lock_guard<std::mutex> lock(mutex);
    tick();
  });
  GridViews found;
  const double sign = model::DirectionSign(sweep.direction);
  for (std::size_t i = 0; i < count; ++i) {
    if (!views[i]) continue;
    if (i >= frames) {
      found.views.push_back(*views[i]);
      continue;
    }
    const double reading_mm = sweep.frames[chosen[i]].reading_mm;
    views[i]->position_mm = sign * reading_mm;
    found.frames.push_back(*views[i]);
    found.readings_mm.push_back(reading_mm);
  }
  GridGeometry result = GeometryOf(sweep, found);
  result.frames_searched = static_cast<int>(frames);
  result.views_searched = static_cast<int>(sweep.grid_views.size());
  return result;
}

std::optional<model::StatedConjugate> MagnificationOfGrid(const std::vector<GridScale>& scales,
                                                          double front_focal_length_mm, double sign,
                                                          double sharpest_reading_mm,
                                                          const std::string& name) {
  // The magnification of each frame, with the change from its plane to the plane of focus [D127]: m
  // zf/z at z.
  std::vector<double> at_focus, sigmas, beyond;
  for (const GridScale& scale : scales) {
    const double beyond_mm = sign * (scale.reading_mm - sharpest_reading_mm);
    double magnification = scale.magnification;
    constexpr int kRounds = 20;  // each divides the error by about zf over the distance
    for (int round = 0; round < kRounds && magnification > 0; ++round) {
      const double zf_mm = front_focal_length_mm * (1 + 1 / magnification);
      magnification = scale.magnification * (zf_mm + beyond_mm) / zf_mm;
    }
    if (!(magnification > 0) || !std::isfinite(magnification)) continue;
    at_focus.push_back(magnification);
    sigmas.push_back(scale.sigma);
    beyond.push_back(std::abs(beyond_mm));
  }
  if (at_focus.empty()) return std::nullopt;
  // The frames near focus depend least on the focal length.
  std::vector<std::size_t> order(at_focus.size());
  for (std::size_t i = 0; i < order.size(); ++i) order[i] = i;
  std::stable_sort(order.begin(), order.end(),
                   [&](std::size_t a, std::size_t b) { return beyond[a] < beyond[b]; });
  order.resize(std::min<std::size_t>(order.size(), 5));
  std::vector<double> nearest, nearest_sigmas;
  for (const std::size_t i : order) {
    nearest.push_back(at_focus[i]);
    nearest_sigmas.push_back(sigmas[i]);
  }
  const double value = Median(nearest);
  double scatter = 0;
  for (const double one : nearest) scatter = std::max(scatter, std::abs(one - value));
  model::StatedConjugate stated;
  stated.kind = model::ConjugateKind::kMagnification;
  // Frames of one sweep see one target with the same points: their mean has the error of one.
  stated.value = {value, std::hypot(kPrintError * value, scatter, Median(nearest_sigmas))};
  stated.name = name;
  return stated;
}

}  // namespace thicklens::calib
