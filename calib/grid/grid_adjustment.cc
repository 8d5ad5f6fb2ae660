#include "calib/grid/grid_adjustment.h"

#include <ceres/ceres.h>
#include <ceres/rotation.h>
#include <fmt/format.h>

#include <Eigen/Dense>
#include <Eigen/SparseCore>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <map>
#include <opencv2/calib3d.hpp>

#include "thicklens/base/cancel.h"
#include "thicklens/base/error.h"
#include "thicklens/base/pi.h"

namespace thicklens::calib {
namespace {

// Standard deviations of the weak priors of `shared`. Prints and rulers are good to about 0.3 %.
constexpr std::array<double, kCameraSize> kCameraPrior = {1, 0.5, 0.5, 0.3, 0.15, 0.03, 0.03, 0.05};
constexpr std::array<double, kSheetSize> kSheetPrior = {0.003, 0.003, 0.003, 0.05, 0.05, 0.05};
constexpr double kDirectionPrior = 0.5;
constexpr double kFirstSigmaPx = 0.1, kMinSigmaPx = 0.005;
constexpr int kRounds = 4;
constexpr double kOutlier = 6;           // standard deviations beyond which a point is left out
constexpr double kMinLateralPx = 0.005;  // scatter of a stage
constexpr int kDiscSides = 16;           // of the polygon that stands for a disc
constexpr double kWindow = 0.5;          // least part of the points that stays

double CornerRadius(const GridSetup& setup) {
  const Eigen::Vector2d& c = setup.principal_point_px;
  return std::hypot(std::max(c.x(), setup.width_px - 1 - c.x()),
                    std::max(c.y(), setup.height_px - 1 - c.y())) /
         setup.focal_length_px;
}

double HalfDiagonal(const GridSetup& setup) {
  double farthest_mm = 0;
  for (const Eigen::Vector2d& point : setup.target_mm)
    farthest_mm = std::max(farthest_mm, point.norm());
  return farthest_mm > 0 ? farthest_mm : 1;  // the bend of a lone point is none
}

// The units that turn scaled parameters into a camera.
struct Units {
  explicit Units(const GridSetup& setup)
      : focal_px(setup.focal_length_px),
        centre_px(setup.principal_point_px),
        width_px(setup.width_px),
        corner(CornerRadius(setup)),
        half_mm(HalfDiagonal(setup)) {}

  template <typename T>
  std::array<T, kCameraSize> Camera(const T* a) const {
    using std::exp;
    const double c = corner, c2 = c * c;
    return {focal_px * exp(a[0]),
            centre_px.x() + width_px * a[1],
            centre_px.y() + width_px * a[2],
            a[3] / c2,
            a[4] / (c2 * c2),
            a[5] / c,
            a[6] / c,
            a[7] / (c2 * c2 * c2)};
  }

  // [L20] with 5 coefficients.
  template <typename T>
  void Image(const std::array<T, kCameraSize>& camera, const T* point, T* image) const {
    const T x = point[0] / point[2], y = point[1] / point[2];
    const T s = x * x + y * y;
    const T q = 1.0 + s * (camera[3] + s * (camera[4] + s * camera[7]));
    image[0] =
        camera[1] + camera[0] * (x * q + 2.0 * camera[5] * x * y + camera[6] * (s + 2.0 * x * x));
    image[1] =
        camera[2] + camera[0] * (y * q + camera[5] * (s + 2.0 * y * y) + 2.0 * camera[6] * x * y);
  }

  // A point of the sheet as it really is.
  template <typename T>
  void OnSheet(const T* sheet, double x_mm, double y_mm, T* point) const {
    point[0] = (1.0 + sheet[0]) * ((1.0 + sheet[1]) * x_mm + sheet[2] * y_mm);
    point[1] = (1.0 + sheet[0]) * (1.0 - sheet[1]) * y_mm;
    const double x = x_mm / half_mm, y = y_mm / half_mm;
    point[2] = half_mm * (sheet[3] * (x * x) + sheet[4] * (x * y) + sheet[5] * (y * y));
  }

  double focal_px;
  Eigen::Vector2d centre_px;
  double width_px, corner, half_mm;
};

// Residuals of all points of a view in its standard deviations.
class ViewResiduals {
 public:
  ViewResiduals(const Units& units, const GridSetup& setup, const GridView& view, double sigma_px,
                double position_mm)
      : units_(units), setup_(setup), view_(view), sigma_px_(sigma_px), position_mm_(position_mm) {}

  // A view that stands anywhere.
  template <typename T>
  bool operator()(const T* camera, const T* sheet, const T* rotation, const T* place,
                  T* residuals) const {
    const std::array<T, kCameraSize> of = units_.Camera(camera);
    for (std::size_t i = 0; i < view_.ids.size(); ++i) {
      T image[2];
      if (!Predict(of, sheet, rotation, place,
                   setup_.target_mm[static_cast<std::size_t>(view_.ids[i])], image))
        return false;
      residuals[2 * i] = (image[0] - view_.image_px[i].x()) / sigma_px_;
      residuals[2 * i + 1] = (image[1] - view_.image_px[i].y()) / sigma_px_;
    }
    return true;
  }

  // A frame of the sweep, whose place differs by `error` from the line.
  template <typename T>
  bool operator()(const T* camera, const T* sheet, const T* rotation, const T* middle,
                  const T* direction, const T* error, T* residuals) const {
    const T along = position_mm_ + error[2];
    // The positions are distances along the line, which is not parallel to the axis.
    using std::sqrt;
    const T dz = along / sqrt(1.0 + direction[0] * direction[0] + direction[1] * direction[1]);
    const T place[3] = {middle[0] + direction[0] * dz + error[0],
                        middle[1] + direction[1] * dz + error[1], middle[2] + dz};
    return (*this)(camera, sheet, rotation, place, residuals);
  }

  template <typename T>
  bool Predict(const std::array<T, kCameraSize>& camera, const T* sheet, const T* rotation,
               const T* place, const Eigen::Vector2d& at_mm, T* image) const {
    if (!(setup_.disc_radius_mm > 0))
      return PredictPoint(camera, sheet, rotation, place, at_mm, image);
    // The centroid of the image of a disc is not the image of its centre.
    std::array<std::array<T, 2>, kDiscSides> rim;
    for (int i = 0; i < kDiscSides; ++i) {
      const double angle = 2 * kPi * i / kDiscSides;
      const Eigen::Vector2d on_rim =
          at_mm + setup_.disc_radius_mm * Eigen::Vector2d(std::cos(angle), std::sin(angle));
      if (!PredictPoint(camera, sheet, rotation, place, on_rim,
                        rim[static_cast<std::size_t>(i)].data()))
        return false;
    }
    const std::array<T, 2> from = rim[0];
    T area(0.0), x(0.0), y(0.0);
    for (std::size_t i = 1; i + 1 < rim.size(); ++i) {
      const T ax = rim[i][0] - from[0], ay = rim[i][1] - from[1];
      const T bx = rim[i + 1][0] - from[0], by = rim[i + 1][1] - from[1];
      const T twice = ax * by - bx * ay;
      area += twice;
      x += twice * (ax + bx) / 3.0;
      y += twice * (ay + by) / 3.0;
    }
    image[0] = from[0] + x / area;
    image[1] = from[1] + y / area;
    return true;
  }

 private:
  template <typename T>
  bool PredictPoint(const std::array<T, kCameraSize>& camera, const T* sheet, const T* rotation,
                    const T* place, const Eigen::Vector2d& at_mm, T* image) const {
    T on_sheet[3], point[3];
    units_.OnSheet(sheet, at_mm.x(), at_mm.y(), on_sheet);
    ceres::AngleAxisRotatePoint(rotation, on_sheet, point);
    for (int axis = 0; axis < 3; ++axis) point[axis] += place[axis];
    if (!(point[2] > T(1e-9))) return false;
    units_.Image(camera, point, image);
    return true;
  }

  const Units& units_;
  const GridSetup& setup_;
  const GridView& view_;
  double sigma_px_, position_mm_;
};

// A prior of each number of a block.
template <int kSize>
struct BlockPrior {
  std::array<double, kSize> sigma;
  template <typename T>
  bool operator()(const T* value, T* residual) const {
    for (int i = 0; i < kSize; ++i) residual[i] = value[i] / sigma[static_cast<std::size_t>(i)];
    return true;
  }
};

template <int kSize>
ceres::CostFunction* PriorOf(const std::array<double, kSize>& sigma) {
  return new ceres::AutoDiffCostFunction<BlockPrior<kSize>, kSize, kSize>(
      new BlockPrior<kSize>{sigma});
}

struct Pose {
  Eigen::Vector3d rotation{0, 0, 0}, place_mm{0, 0, 0};
};

// The pose of a view by the camera to start from.
Pose StartingPose(const GridSetup& setup, const GridView& view) {
  std::vector<cv::Point3d> target;
  std::vector<cv::Point2d> image;
  for (std::size_t i = 0; i < view.ids.size(); ++i) {
    const Eigen::Vector2d& at = setup.target_mm[static_cast<std::size_t>(view.ids[i])];
    target.emplace_back(at.x(), at.y(), 0);
    image.emplace_back(view.image_px[i].x(), view.image_px[i].y());
  }
  const double f = setup.focal_length_px;
  const cv::Matx33d matrix(f, 0, setup.principal_point_px.x(), 0, f, setup.principal_point_px.y(),
                           0, 0, 1);
  cv::Vec3d rotation, place;
  Pose pose;
  if (cv::solvePnP(target, image, matrix, cv::noArray(), rotation, place, false,
                   cv::SOLVEPNP_IPPE)) {
    pose.rotation = {rotation[0], rotation[1], rotation[2]};
    pose.place_mm = {place[0], place[1], place[2]};
  }
  return pose;
}

// Returns the pose with the target facing the camera: the sweep's frames show which way it leans.
Pose Facing(const Pose& pose) {
  const double angle = pose.rotation.norm();
  Eigen::Matrix3d matrix = Eigen::Matrix3d::Identity();
  if (angle > 0) matrix = Eigen::AngleAxisd(angle, pose.rotation / angle).toRotationMatrix();
  return {
      Eigen::Vector3d(0, 0, std::atan2(matrix(1, 0) - matrix(0, 1), matrix(0, 0) + matrix(1, 1))),
      pose.place_mm};
}

ceres::Solver::Options SolverOptions() {
  ceres::Solver::Options options;
  options.logging_type = ceres::SILENT;
  options.linear_solver_type = ceres::DENSE_SCHUR;
  options.max_num_iterations = 100;
  options.function_tolerance = 1e-12;
  options.parameter_tolerance = 1e-12;
  options.gradient_tolerance = 1e-14;
  return options;
}

class Adjuster {
 public:
  explicit Adjuster(const GridSetup& setup) : setup_(setup), units_(setup_) {}

  GridAdjustment Run() {
    Start();
    for (int round = 0; round < kRounds; ++round) {
      ThrowIfCancelled();
      if (!Solve()) return result_;
      LeaveOutliers();
      MeasureScatter();
    }
    if (!Solve() || !Covariance()) return result_;
    Describe();
    result_.done = true;
    result_.message = "converged";
    return result_;
  }

 private:
  bool IsFrame(std::size_t view) const { return setup_.views[view].position_mm.has_value(); }

  void Start() {
    double sum_mm = 0;
    int frames = 0;
    for (const GridView& view : setup_.views) {
      if (!view.position_mm) continue;
      sum_mm += *view.position_mm;
      ++frames;
    }
    result_.has_motion = frames > 0;
    middle_mm_ = frames > 0 ? sum_mm / frames : 0;
    const std::size_t n = setup_.views.size();
    poses_.resize(n);
    errors_.assign(n, Eigen::Vector3d::Zero());
    sigma_px_.assign(n, kFirstSigmaPx);
    double nearest_mm = std::numeric_limits<double>::infinity(), least = 0, most = 0;
    for (std::size_t i = 0; i < n; ++i) {
      poses_[i] = StartingPose(setup_, setup_.views[i]);
      if (setup_.views[i].sigma_px > 0) sigma_px_[i] = setup_.views[i].sigma_px;
      if (!IsFrame(i)) continue;
      const double apart_mm = *setup_.views[i].position_mm - middle_mm_;
      least = std::min(least, apart_mm);
      most = std::max(most, apart_mm);
      if (std::abs(apart_mm) < nearest_mm) {
        nearest_mm = std::abs(apart_mm);
        motion_ = Facing(poses_[i]);
        motion_.place_mm.z() -= apart_mm;
      }
    }
    range_mm_ = most - least;
    lateral_mm_ = motion_.place_mm.z() / setup_.focal_length_px;  // 1 px
    axial_mm_ = setup_.reading_sigma_mm > 0 ? setup_.reading_sigma_mm : 0.01 * range_mm_;
  }

  void Build(ceres::Problem* problem) {
    const double alignment = setup_.alignment_rad.value_or(kDirectionPrior);
    problem->AddResidualBlock(PriorOf<kCameraSize>(kCameraPrior), nullptr, camera_.data());
    problem->AddResidualBlock(PriorOf<kSheetSize>(kSheetPrior), nullptr, sheet_.data());
    if (!setup_.has_distortion) {
      problem->SetManifold(camera_.data(), new ceres::SubsetManifold(kCameraSize, {3, 4, 5, 6, 7}));
    }
    if (result_.has_motion)
      problem->AddResidualBlock(PriorOf<2>({alignment, alignment}), nullptr, direction_.data());
    for (std::size_t i = 0; i < setup_.views.size(); ++i) {
      const GridView& view = setup_.views[i];
      const int count = static_cast<int>(2 * view.ids.size());
      auto* residuals = new ViewResiduals(units_, setup_, view, sigma_px_[i],
                                          IsFrame(i) ? *view.position_mm - middle_mm_ : 0);
      if (IsFrame(i)) {
        problem->AddResidualBlock(
            new ceres::AutoDiffCostFunction<ViewResiduals, ceres::DYNAMIC, kCameraSize, kSheetSize,
                                            3, 3, 2, 3>(residuals, count),
            nullptr, camera_.data(), sheet_.data(), motion_.rotation.data(),
            motion_.place_mm.data(), direction_.data(), errors_[i].data());
        problem->AddResidualBlock(PriorOf<3>({lateral_mm_, lateral_mm_, axial_mm_}), nullptr,
                                  errors_[i].data());
      } else {
        problem->AddResidualBlock(
            new ceres::AutoDiffCostFunction<ViewResiduals, ceres::DYNAMIC, kCameraSize, kSheetSize,
                                            3, 3>(residuals, count),
            nullptr, camera_.data(), sheet_.data(), poses_[i].rotation.data(),
            poses_[i].place_mm.data());
      }
    }
  }

  bool Solve() {
    ceres::Problem problem;
    Build(&problem);
    ceres::Solver::Summary summary;
    if (!has_begun_) {
      // Poses first: the camera must not follow a pose that is far off.
      problem.SetParameterBlockConstant(camera_.data());
      problem.SetParameterBlockConstant(sheet_.data());
      ceres::Solve(SolverOptions(), &problem, &summary);
      problem.SetParameterBlockVariable(camera_.data());
      problem.SetParameterBlockVariable(sheet_.data());
      has_begun_ = true;
    }
    ceres::Solve(SolverOptions(), &problem, &summary);
    if (!summary.IsSolutionUsable()) {
      result_.message = "the adjustment of the grid did not converge";
      return false;
    }
    return true;
  }

  // Residuals of a view, px.
  std::vector<Eigen::Vector2d> Residuals(std::size_t i) const {
    const GridView& view = setup_.views[i];
    std::vector<double> values(2 * view.ids.size());
    const ViewResiduals residuals(units_, setup_, view, 1,
                                  IsFrame(i) ? *view.position_mm - middle_mm_ : 0);
    if (IsFrame(i)) {
      residuals(camera_.data(), sheet_.data(), motion_.rotation.data(), motion_.place_mm.data(),
                direction_.data(), errors_[i].data(), values.data());
    } else {
      residuals(camera_.data(), sheet_.data(), poses_[i].rotation.data(), poses_[i].place_mm.data(),
                values.data());
    }
    std::vector<Eigen::Vector2d> pairs;
    for (std::size_t k = 0; k < view.ids.size(); ++k)
      pairs.emplace_back(values[2 * k], values[2 * k + 1]);
    return pairs;
  }

  static double RobustSigma(const std::vector<Eigen::Vector2d>& residuals) {
    std::vector<double> sizes;
    for (const Eigen::Vector2d& residual : residuals) sizes.push_back(residual.norm());
    const auto middle = sizes.begin() + static_cast<std::ptrdiff_t>(sizes.size() / 2);
    std::nth_element(sizes.begin(), middle, sizes.end());
    constexpr double kMedianOfRayleigh = 1.17741;
    return *middle / kMedianOfRayleigh;
  }

  // A corner that was taken for another one, or that dirt displaced.
  void LeaveOutliers() {
    for (std::size_t i = 0; i < setup_.views.size(); ++i) {
      GridView& view = setup_.views[i];
      const std::vector<Eigen::Vector2d> residuals = Residuals(i);
      const double limit_px = kOutlier * std::max(RobustSigma(residuals), kMinSigmaPx);
      GridView kept = view;
      kept.ids.clear();
      kept.image_px.clear();
      for (std::size_t k = 0; k < residuals.size(); ++k) {
        if (residuals[k].norm() > limit_px) continue;
        kept.ids.push_back(view.ids[k]);
        kept.image_px.push_back(view.image_px[k]);
      }
      if (static_cast<double>(kept.ids.size()) > kWindow * static_cast<double>(view.ids.size()) &&
          kept.ids.size() >= 4)
        view = kept;
    }
  }

  // The standard deviation of the points in each view, and the scatter of the stage.
  void MeasureScatter() {
    for (std::size_t i = 0; i < setup_.views.size(); ++i) {
      if (setup_.views[i].sigma_px > 0) continue;
      double square = 0;
      const std::vector<Eigen::Vector2d> residuals = Residuals(i);
      for (const Eigen::Vector2d& residual : residuals) square += residual.squaredNorm();
      const double freedom =
          std::max(1.0, 2 * static_cast<double>(residuals.size()) - (IsFrame(i) ? 3 : 6));
      sigma_px_[i] = std::max(kMinSigmaPx, std::sqrt(square / freedom));
    }
    if (!result_.has_motion || !Covariance()) return;
    double lateral = 0, axial = 0;
    int frames = 0;
    for (std::size_t i = 0; i < setup_.views.size(); ++i) {
      if (!IsFrame(i)) continue;
      const Eigen::Vector3d& variance = error_variance_[i];
      lateral += 0.5 * (errors_[i].head(2).squaredNorm() + variance.x() + variance.y());
      axial += errors_[i].z() * errors_[i].z() + variance.z();
      ++frames;
    }
    const double per_px_mm = motion_.place_mm.z() / setup_.focal_length_px;
    lateral_mm_ = std::max(kMinLateralPx * per_px_mm, std::sqrt(lateral / frames));
    if (!(setup_.reading_sigma_mm > 0))
      axial_mm_ = std::max(1e-5 * range_mm_ + 1e-9, std::sqrt(axial / frames));
  }

  // The inverse of the Fisher information of everything; its part for `shared`.
  bool Covariance() {
    ceres::Problem problem;
    Build(&problem);
    std::vector<double*> blocks = {camera_.data(), sheet_.data()};
    int shared = kCameraSize + kSheetSize;
    if (result_.has_motion) {
      blocks.insert(blocks.end(),
                    {motion_.rotation.data(), motion_.place_mm.data(), direction_.data()});
      shared += kRailSize;
    }
    int size = shared;
    std::vector<int> begins(setup_.views.size());
    for (std::size_t i = 0; i < setup_.views.size(); ++i) {
      begins[i] = size;
      if (IsFrame(i)) {
        blocks.push_back(errors_[i].data());
        size += 3;
      } else {
        blocks.push_back(poses_[i].rotation.data());
        blocks.push_back(poses_[i].place_mm.data());
        size += 6;
      }
    }
    // Held parameters have no column in the Jacobian of the manifold.
    const int held = setup_.has_distortion ? 0 : 5;
    ceres::Problem::EvaluateOptions options;
    options.parameter_blocks = blocks;
    ceres::CRSMatrix crs;
    if (!problem.Evaluate(options, nullptr, nullptr, nullptr, &crs)) {
      result_.message = "the adjustment of the grid has no derivatives";
      return false;
    }
    const Eigen::Map<const Eigen::SparseMatrix<double, Eigen::RowMajor>> jacobian(
        crs.num_rows, crs.num_cols, static_cast<Eigen::Index>(crs.values.size()), crs.rows.data(),
        crs.cols.data(), crs.values.data());
    const Eigen::SparseMatrix<double> columns = jacobian;
    Eigen::MatrixXd information =
        Eigen::MatrixXd(Eigen::SparseMatrix<double>(columns.transpose() * columns));
    // Millimetres and radians differ by orders of magnitude.
    const Eigen::VectorXd scale = information.diagonal().cwiseSqrt().cwiseInverse();
    if (!scale.allFinite()) {
      result_.message = "the grid's views leave the pose of the target open";
      return false;
    }
    information = scale.asDiagonal() * information * scale.asDiagonal();
    const Eigen::LDLT<Eigen::MatrixXd> solver(information);
    if (solver.info() != Eigen::Success || !solver.isPositive()) {
      result_.message = "the grid's views leave the pose of the target open";
      return false;
    }
    const Eigen::MatrixXd inverse =
        scale.asDiagonal() *
        Eigen::MatrixXd(solver.solve(Eigen::MatrixXd::Identity(size - held, size - held))) *
        scale.asDiagonal();
    error_variance_.assign(setup_.views.size(), Eigen::Vector3d::Zero());
    for (std::size_t i = 0; i < setup_.views.size(); ++i) {
      if (IsFrame(i)) error_variance_[i] = inverse.diagonal().segment(begins[i] - held, 3);
    }
    result_.covariance = Eigen::MatrixXd::Zero(shared, shared);
    std::vector<int> place(static_cast<std::size_t>(shared), -1);
    for (int i = 0, next = 0; i < shared; ++i) {
      if (held > 0 && i >= 3 && i < kCameraSize) continue;
      place[static_cast<std::size_t>(i)] = next++;
    }
    for (int i = 0; i < shared; ++i) {
      for (int j = 0; j < shared; ++j) {
        const int row = place[static_cast<std::size_t>(i)],
                  column = place[static_cast<std::size_t>(j)];
        if (row >= 0 && column >= 0) result_.covariance(i, j) = inverse(row, column);
      }
    }
    return true;
  }

  void Describe() {
    const auto shared = result_.covariance.rows();
    result_.shared.resize(shared);
    result_.shared.head(kCameraSize) = camera_;
    result_.shared.segment(kCameraSize, kSheetSize) = sheet_;
    result_.prior_sigma =
        Eigen::VectorXd::Constant(shared, std::numeric_limits<double>::infinity());
    for (int i = 0; i < kCameraSize; ++i)
      result_.prior_sigma[i] = kCameraPrior[static_cast<std::size_t>(i)];
    for (int i = 0; i < kSheetSize; ++i)
      result_.prior_sigma[kCameraSize + i] = kSheetPrior[static_cast<std::size_t>(i)];
    if (result_.has_motion) {
      result_.shared.segment<3>(kRailAt) = motion_.rotation;
      result_.shared.segment<3>(kRailAt + 3) = motion_.place_mm;
      result_.shared.tail<2>() = direction_;
      result_.prior_sigma.tail<2>().setConstant(setup_.alignment_rad.value_or(kDirectionPrior));
    }
    result_.lateral_sigma_mm = lateral_mm_;
    result_.axial_sigma_mm = axial_mm_;
    struct Mean {
      Eigen::Vector2d sum{0, 0};  // in standard deviations
      int count = 0;
    };
    std::map<int, Mean> means;
    double square = 0;
    for (std::size_t i = 0; i < setup_.views.size(); ++i) {
      const std::vector<Eigen::Vector2d> residuals = Residuals(i);
      double of_view = 0;
      for (std::size_t k = 0; k < residuals.size(); ++k) {
        of_view += residuals[k].squaredNorm();
        Mean& mean = means[setup_.views[i].ids[k]];
        mean.sum += residuals[k] / sigma_px_[i];
        ++mean.count;
      }
      square += of_view;
      result_.points += static_cast<int>(residuals.size());
      result_.view_rms_px.push_back(
          std::sqrt(of_view / (2 * static_cast<double>(residuals.size()))));
    }
    result_.rms_px = std::sqrt(square / (2.0 * result_.points));
    WidenByPrint(means);
  }

  // An error of one point of the print is the same in all views. Its variance, in units of that of
  // one point of one view, is that of the points' means less what chance gives them.
  template <typename Means>
  void WidenByPrint(const Means& means) {
    double excess = 0, views = 0;
    int repeated = 0;
    for (const auto& [id, mean] : means) {
      if (mean.count < 2) continue;
      excess += 0.5 * (mean.sum / mean.count).squaredNorm() - 1.0 / mean.count;
      views += mean.count;
      ++repeated;
    }
    if (repeated == 0) return;
    excess /= repeated;
    views /= repeated;
    // The scatter of the mean of the excess itself.
    const double chance = 2.0 / (views * std::sqrt(static_cast<double>(repeated)));
    if (!(excess > chance)) return;
    result_.common_px = std::sqrt(excess) * result_.rms_px;
    result_.covariance *= 1 + views * excess;
  }

  GridSetup setup_;
  Units units_;
  Eigen::Matrix<double, kCameraSize, 1> camera_ = Eigen::Matrix<double, kCameraSize, 1>::Zero();
  Eigen::Matrix<double, kSheetSize, 1> sheet_ = Eigen::Matrix<double, kSheetSize, 1>::Zero();
  Pose motion_;  // of the sweep's frames, at the mean position
  Eigen::Vector2d direction_{0, 0};
  std::vector<Pose> poses_;                               // of the other views
  std::vector<Eigen::Vector3d> errors_, error_variance_;  // of the frames' places
  std::vector<double> sigma_px_;
  double middle_mm_ = 0, range_mm_ = 0, lateral_mm_ = 0, axial_mm_ = 0;
  bool has_begun_ = false;
  GridAdjustment result_;
};

}  // namespace

model::Estimate GridAdjustment::Of(
    const std::function<double(const Eigen::VectorXd&)>& function) const {
  const double value = function(shared);
  Eigen::VectorXd gradient(shared.size());
  for (Eigen::Index i = 0; i < shared.size(); ++i) {
    const double step = std::max(1e-9, 1e-3 * std::sqrt(covariance(i, i)));
    Eigen::VectorXd more = shared, less = shared;
    more[i] += step;
    less[i] -= step;
    gradient[i] = (function(more) - function(less)) / (2 * step);
  }
  return {value, std::sqrt(std::max(0.0, gradient.dot(covariance * gradient)))};
}

GridAdjustment AdjustGrid(const GridSetup& setup) {
  if (setup.views.empty()) {
    GridAdjustment none;
    none.message = "no view shows the grid";
    return none;
  }
  return Adjuster(setup).Run();
}

Eigen::VectorXd CameraOf(const GridSetup& setup, const Eigen::VectorXd& shared) {
  const std::array<double, kCameraSize> camera = Units(setup).Camera(shared.data());
  return Eigen::Map<const Eigen::VectorXd>(camera.data(), kCameraSize);
}

Eigen::MatrixXd CameraGradient(const GridSetup& setup, const Eigen::VectorXd& shared) {
  Eigen::MatrixXd gradient = Eigen::MatrixXd::Zero(kCameraSize, kCameraSize);
  Eigen::VectorXd unit = Eigen::VectorXd::Zero(shared.size());
  // Everything but the focal length is linear.
  const Eigen::VectorXd none = CameraOf(setup, unit);
  for (int i = 1; i < kCameraSize; ++i) {
    unit.setZero();
    unit[i] = 1;
    gradient(i, i) = CameraOf(setup, unit)[i] - none[i];
  }
  gradient(0, 0) = CameraOf(setup, shared)[0];
  return gradient;
}

GridPose FitPose(const GridSetup& setup, const Eigen::VectorXd& shared, const GridView& view) {
  const Units units(setup);
  Eigen::VectorXd fixed = shared;
  const Pose start = StartingPose(setup, view);
  GridPose pose{start.rotation, start.place_mm};
  ceres::Problem problem;
  auto* residuals = new ViewResiduals(units, setup, view, 1, 0);
  const int count = static_cast<int>(2 * view.ids.size());
  problem.AddResidualBlock(
      new ceres::AutoDiffCostFunction<ViewResiduals, ceres::DYNAMIC, kCameraSize, kSheetSize, 3, 3>(
          residuals, count),
      nullptr, fixed.data(), fixed.data() + kCameraSize, pose.rotation.data(),
      pose.place_mm.data());
  problem.SetParameterBlockConstant(fixed.data());
  problem.SetParameterBlockConstant(fixed.data() + kCameraSize);
  ceres::Solver::Summary summary;
  ceres::Solver::Options options = SolverOptions();
  options.linear_solver_type = ceres::DENSE_QR;
  ceres::Solve(options, &problem, &summary);
  pose.rms_px = std::sqrt(2 * summary.final_cost / count);
  ceres::Problem::EvaluateOptions evaluate;
  evaluate.parameter_blocks = {pose.rotation.data(), pose.place_mm.data()};
  ceres::CRSMatrix crs;
  if (problem.Evaluate(evaluate, nullptr, nullptr, nullptr, &crs)) {
    const Eigen::MatrixXd jacobian = Eigen::Map<const Eigen::SparseMatrix<double, Eigen::RowMajor>>(
        crs.num_rows, crs.num_cols, static_cast<Eigen::Index>(crs.values.size()), crs.rows.data(),
        crs.cols.data(), crs.values.data());
    pose.covariance =
        (jacobian.transpose() * jacobian).completeOrthogonalDecomposition().pseudoInverse();
  }
  return pose;
}

TargetPlane PlaneOfTarget(const Eigen::Vector3d& rotation, const Eigen::Vector3d& place_mm) {
  const double angle = rotation.norm();
  Eigen::Vector3d normal(0, 0, 1);
  if (angle > 0) normal = Eigen::AngleAxisd(angle, rotation / angle) * normal;
  return {normal.dot(place_mm) / normal.z(), normal.x() / normal.z(), normal.y() / normal.z()};
}

double HeldOutRms(const GridSetup& setup, const Eigen::VectorXd& shared, const GridView& view) {
  return FitPose(setup, shared, view).rms_px;
}

std::vector<Eigen::Vector2d> ProjectGrid(const GridSetup& setup, const Eigen::VectorXd& shared,
                                         const Eigen::Vector3d& rotation,
                                         const Eigen::Vector3d& place_mm) {
  const Units units(setup);
  const std::array<double, kCameraSize> camera = units.Camera(shared.data());
  const GridView none;
  const ViewResiduals view(units, setup, none, 1, 0);
  std::vector<Eigen::Vector2d> image_px;
  for (const Eigen::Vector2d& at_mm : setup.target_mm) {
    Eigen::Vector2d image;
    if (!view.Predict(camera, shared.data() + kCameraSize, rotation.data(), place_mm.data(), at_mm,
                      image.data()))
      throw Error("a point of the grid is behind the camera");
    image_px.push_back(image);
  }
  return image_px;
}

}  // namespace thicklens::calib
