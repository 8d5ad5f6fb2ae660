#include "thicklens/model/lens_distortion.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <opencv2/calib3d.hpp>
#include <opencv2/core.hpp>

#include "thicklens/base/cancel.h"
#include "thicklens/base/error.h"
#include "thicklens/base/validity.h"

namespace thicklens::model {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr double kNotANumber = std::numeric_limits<double>::quiet_NaN();
constexpr int kMaxSizePx = 100000;
// Numbers of coefficients that OpenCV knows.
constexpr std::array<std::size_t, 5> kCounts = {4, 5, 8, 12, 14};
constexpr std::size_t kFisheyeCount = 4;
// The angles of a tilted sensor stand behind the other coefficients.
constexpr std::size_t kTilt = 12;

// A coefficient that is not stated is 0.
double Coefficient(const LensDistortion& d, std::size_t i) {
  return i < d.coefficients.size() ? d.coefficients[i] : 0;
}

cv::Matx33d CameraMatrix(const LensDistortion& d, int x = 0, int y = 0) {
  return {d.focal_length_px.x(),
          0,
          d.principal_point_px.x() - x,
          0,
          d.focal_length_px.y(),
          d.principal_point_px.y() - y,
          0,
          0,
          1};
}

cv::Mat Coefficients(const LensDistortion& d) {
  return cv::Mat(d.coefficients, true).reshape(1, 1);
}

// The radial part of the distortion at a radius of the undistorted image: where it lies in the
// photograph, and whether it still moves outwards.
struct Radial {
  double distorted = 0;
  bool grows = true;
};

// d(r q)/dr of q = a/b is (a + r a')/b - r a b'/b^2, with a' and b' the derivatives by r.
Radial RadialOf(const LensDistortion& d, double r) {
  if (d.model == DistortionModel::kFisheye) {
    const double angle = std::atan(r), s = angle * angle;
    double distorted = angle, derivative = 1, power = 1;
    for (std::size_t i = 0; i < kFisheyeCount; ++i) {
      power *= s;
      distorted += Coefficient(d, i) * power * angle;
      derivative += static_cast<double>(2 * i + 3) * Coefficient(d, i) * power;
    }
    return {distorted, derivative > 0};
  }
  const double s = r * r;
  const std::array<double, 3> k = {Coefficient(d, 0), Coefficient(d, 1), Coefficient(d, 4)};
  const std::array<double, 3> l = {Coefficient(d, 5), Coefficient(d, 6), Coefficient(d, 7)};
  double a = 1, b = 1, r_da = 0, r_db = 0, power = 1;
  for (std::size_t i = 0; i < k.size(); ++i) {
    power *= s;
    a += k[i] * power;
    b += l[i] * power;
    r_da += static_cast<double>(2 * i + 2) * k[i] * power;
    r_db += static_cast<double>(2 * i + 2) * l[i] * power;
  }
  if (!(b > 0)) return {kInfinity, false};
  return {r * a / b, (a + r_da) * b - a * r_db > 0};
}

// The position of the corner, or of another point, that is farthest from the principal point.
double FarthestRadius(const LensDistortion& d) {
  double farthest = 0;
  for (const double x : {-0.5, d.width_px - 0.5}) {
    for (const double y : {-0.5, d.height_px - 0.5}) {
      farthest =
          std::max(farthest, std::hypot((x - d.principal_point_px.x()) / d.focal_length_px.x(),
                                        (y - d.principal_point_px.y()) / d.focal_length_px.y()));
    }
  }
  return farthest;
}

// The radius of the undistorted image at which the polynomial turns back, and where that is in the
// photograph, both divided by the focal length; infinite: it does not within the image. Beyond it
// the polynomial would show points of the inside again.
struct Turn {
  double undistorted = kInfinity, distorted = kInfinity;
};
Turn TurnOf(const LensDistortion& d) {
  constexpr int kSteps = 4096;
  const double farthest = FarthestRadius(d);
  double before = 0;
  for (int i = 1; i <= kSteps; ++i) {
    const double r = farthest * i / kSteps;
    const Radial radial = RadialOf(d, r);
    if (!radial.grows) return {farthest * (i - 1) / kSteps, before};
    before = radial.distorted;
  }
  return {};
}

bool IsFiniteAndAbove(double value, double least) { return value > least && std::isfinite(value); }

std::string CountsText() { return fmt::format("{}", fmt::join(kCounts, ", ")); }

bool HasPossibleCamera(const LensDistortion& d, std::string* why) {
  for (const auto& [name, size] : {std::pair("width_px", d.width_px), {"height_px", d.height_px}}) {
    if (size < 1 || size > kMaxSizePx)
      return Fail(why, fmt::format("{} must be from 1 to {}, found {}", name, kMaxSizePx, size));
  }
  const Eigen::Vector2d& f = d.focal_length_px;
  if (!IsFiniteAndAbove(f.x(), 0) || !IsFiniteAndAbove(f.y(), 0)) {
    return Fail(
        why, fmt::format("focal_length_px must be two finite numbers > 0 (fx, fy), found {} and {}",
                         f.x(), f.y()));
  }
  constexpr double kMaxRatio = 4;  // anamorphic lenses have 2
  if (f.x() > kMaxRatio * f.y() || f.y() > kMaxRatio * f.x()) {
    return Fail(why, fmt::format("focal_length_px: fx {} and fy {} px differ by more than {} times",
                                 f.x(), f.y(), kMaxRatio));
  }
  const Eigen::Vector2d size(d.width_px, d.height_px);
  const Eigen::Vector2d& c = d.principal_point_px;
  for (int axis = 0; axis < 2; ++axis) {
    if (c[axis] >= -size[axis] && c[axis] <= 2 * size[axis]) continue;
    return Fail(
        why,
        fmt::format("principal_point_px: {} is {} px, farther from the image of {} x {} px than "
                    "its own size",
                    axis == 0 ? "cx" : "cy", c[axis], d.width_px, d.height_px));
  }
  return true;
}

}  // namespace

std::string DistortionModelName(DistortionModel model) {
  return model == DistortionModel::kFisheye ? "fisheye" : "opencv";
}

bool LensDistortion::IsValid(std::string* why) const {
  if (!HasPossibleCamera(*this, why)) return false;
  const std::size_t count = coefficients.size();
  const bool is_fisheye = model == DistortionModel::kFisheye;
  if (is_fisheye && count != kFisheyeCount) {
    return Fail(why, fmt::format("coefficients: the fisheye model has 4 (k1, k2, k3, k4), found {}",
                                 count));
  }
  if (!is_fisheye && std::find(kCounts.begin(), kCounts.end(), count) == kCounts.end()) {
    return Fail(
        why,
        fmt::format("coefficients: {} are expected (k1, k2, p1, p2, k3, k4, k5, k6, s1, s2, s3, "
                    "s4, tau_x, tau_y, as OpenCV orders them), found {}",
                    CountsText(), count));
  }
  for (std::size_t i = 0; i < count; ++i) {
    constexpr double kMax = 1e12;  // k3 of a narrow field is that large
    if (!(std::abs(coefficients[i]) <= kMax)) {
      return Fail(why, fmt::format("coefficients[{}] must be finite and at most {}, found {}", i,
                                   kMax, coefficients[i]));
    }
  }
  constexpr double kMaxTilt = 1.0;
  for (std::size_t i = kTilt; i < count; ++i) {
    if (!(std::abs(coefficients[i]) <= kMaxTilt)) {
      return Fail(
          why,
          fmt::format("coefficients[{}] is the angle of a tilted sensor in radians and must be at "
                      "most {}, found {}",
                      i, kMaxTilt, coefficients[i]));
    }
  }
  const auto unknowns = static_cast<Eigen::Index>(3 + count);
  if (covariance.size() > 0 &&
      (covariance.rows() != unknowns || covariance.cols() != unknowns || !covariance.allFinite())) {
    return Fail(why, fmt::format("covariance: {} x {} finite numbers are expected (focal length, "
                                 "principal point and coefficients), found {} x {}",
                                 unknowns, unknowns, covariance.rows(), covariance.cols()));
  }
  const Turn turn = TurnOf(*this);
  const double turn_px = turn.distorted * std::min(focal_length_px.x(), focal_length_px.y());
  const double near_px = 0.25 * std::min(width_px, height_px);
  if (!(turn_px >= near_px)) {
    return Fail(
        why,
        fmt::format("coefficients: the polynomial turns back {:.0f} px from the principal point, "
                    "in the middle of a photograph of {} x {} px: check the order of the "
                    "coefficients, the model and the size of the photographs",
                    turn_px, width_px, height_px));
  }
  return true;
}

std::vector<std::string> LensDistortion::CovarianceOrder() const {
  static constexpr std::array<const char*, 14> kNames = {
      "k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6", "s1", "s2", "s3", "s4", "tau_x", "tau_y"};
  static constexpr std::array<const char*, kFisheyeCount> kFisheyeNames = {"k1", "k2", "k3", "k4"};
  std::vector<std::string> order = {"focal_length_px", "principal_point_x_px",
                                    "principal_point_y_px"};
  const bool is_fisheye = model == DistortionModel::kFisheye;
  const std::size_t most = is_fisheye ? kFisheyeNames.size() : kNames.size();
  for (std::size_t i = 0; i < std::min(coefficients.size(), most); ++i)
    order.emplace_back(is_fisheye ? kFisheyeNames[i] : kNames[i]);
  return order;
}

LensDistortion LensDistortion::ScaledTo(int width, int height) const {
  if (width == width_px && height == height_px) return *this;
  if (width < 1 || height < 1)
    throw Error(fmt::format("the lens distortion cannot hold for {} x {} px", width, height));
  const double sx = static_cast<double>(width) / width_px;
  const double sy = static_cast<double>(height) / height_px;
  // Binning and scaling round each size to whole pixels, down or up.
  const double tolerance = 1.0 / width + 1.0 / height + 1.0 / width_px + 1.0 / height_px;
  if (!(std::abs(sx / sy - 1) <= tolerance)) {
    const bool is_turned =
        std::abs(static_cast<double>(width) / height_px * width_px / height - 1) <= tolerance;
    throw Error(fmt::format(
        "the lens distortion{} holds for {} x {} px, the image has {} x {} px: {}",
        source.empty() ? "" : " of " + source, width_px, height_px, width, height,
        is_turned
            ? "it is turned; the orientation of the photographs that the distortion was measured "
              "on is needed"
            : "it can be scaled to images of the same aspect ratio alone, so that a part of a "
              "photograph needs the whole one, or the distortion of that part"));
  }
  LensDistortion scaled = *this;
  // Both axes have the same scale; what the rounding of sizes cut off is at the right and below.
  const bool by_width = width_px >= height_px;
  const double s = by_width ? sx : sy;
  scaled.width_px = width;
  scaled.height_px = height;
  scaled.focal_length_px = s * focal_length_px;
  scaled.principal_point_px =
      s * (principal_point_px + Eigen::Vector2d::Constant(0.5)) - Eigen::Vector2d::Constant(0.5);
  if (scaled.covariance.size() > 0) {
    scaled.covariance.topRows(3) *= s;
    scaled.covariance.leftCols(3) *= s;
  }
  return scaled;
}

LensDistortion LensDistortion::OfPart(int x, int y, int width, int height) const {
  LensDistortion part = *this;
  part.width_px = width;
  part.height_px = height;
  part.principal_point_px -= Eigen::Vector2d(x, y);
  return part;
}

Eigen::Vector2d LensDistortion::Distorted(const Eigen::Vector2d& undistorted_px) const {
  const Eigen::Vector2d at = (undistorted_px - principal_point_px).cwiseQuotient(focal_length_px);
  const double turn = TurnOf(*this).undistorted;
  if (!(at.norm() <= turn)) return {kNotANumber, kNotANumber};
  if (model == DistortionModel::kFisheye) {
    std::vector<cv::Point2d> image;
    cv::fisheye::distortPoints(std::vector<cv::Point2d>{{at.x(), at.y()}}, image,
                               CameraMatrix(*this), Coefficients(*this));
    return {image[0].x, image[0].y};
  }
  std::vector<cv::Point2d> image;
  cv::projectPoints(std::vector<cv::Point3d>{{at.x(), at.y(), 1}}, cv::Vec3d(), cv::Vec3d(),
                    CameraMatrix(*this), Coefficients(*this), image);
  return {image[0].x, image[0].y};
}

double LensDistortion::LargestShiftPx() const {
  double largest = 0;
  constexpr int kSteps = 16;
  const double right = width_px - 1, bottom = height_px - 1;
  for (int i = 0; i <= kSteps; ++i) {
    const double t = static_cast<double>(i) / kSteps;
    for (const Eigen::Vector2d& at :
         {Eigen::Vector2d(t * right, 0), Eigen::Vector2d(t * right, bottom),
          Eigen::Vector2d(0, t * bottom), Eigen::Vector2d(right, t * bottom)}) {
      const double shift = (Distorted(at) - at).norm();
      if (shift > largest) largest = shift;
    }
  }
  return largest;
}

std::string LensDistortion::Description() const {
  return model == DistortionModel::kFisheye
             ? fmt::format("fisheye model with 4 coefficients for {} x {} px", width_px, height_px)
             : fmt::format("OpenCV model with {} coefficients for {} x {} px", coefficients.size(),
                           width_px, height_px);
}

SourcePositions SourcesOf(const LensDistortion& distortion, int x, int y, int width_px,
                          int height_px) {
  std::string why;
  // The axis of a small part may be far outside of it.
  LensDistortion checked = distortion;
  if (distortion.principal_point_px.allFinite())
    checked.principal_point_px = Eigen::Vector2d(distortion.width_px, distortion.height_px) / 2;
  if (!checked.IsValid(&why)) throw Error("lens distortion: " + why);
  SourcePositions sources;
  if (width_px < 1 || height_px < 1) return sources;
  const auto width = static_cast<std::size_t>(width_px);
  sources.x.resize(width * static_cast<std::size_t>(height_px));
  sources.y.resize(sources.x.size());
  cv::Mat map_x(height_px, width_px, CV_32F, sources.x.data());
  cv::Mat map_y(height_px, width_px, CV_32F, sources.y.data());
  const cv::Matx33d camera = CameraMatrix(distortion), shown = CameraMatrix(distortion, x, y);
  if (distortion.model == DistortionModel::kFisheye) {
    cv::fisheye::initUndistortRectifyMap(camera, Coefficients(distortion), cv::Matx33d::eye(),
                                         shown, cv::Size(width_px, height_px), CV_32FC1, map_x,
                                         map_y);
  } else {
    cv::initUndistortRectifyMap(camera, Coefficients(distortion), cv::noArray(), shown,
                                cv::Size(width_px, height_px), CV_32FC1, map_x, map_y);
  }
  const double turn = TurnOf(distortion).undistorted;
  constexpr auto kNone = std::numeric_limits<float>::quiet_NaN();
  const auto right = static_cast<float>(distortion.width_px - 0.5);
  const auto bottom = static_cast<float>(distortion.height_px - 0.5);
  for (int row = 0; row < height_px; ++row) {
    ThrowIfCancelled();
    const double v = (y + row - distortion.principal_point_px.y()) / distortion.focal_length_px.y();
    for (std::size_t column = 0; column < width; ++column) {
      const std::size_t i = static_cast<std::size_t>(row) * width + column;
      const double u = (x + static_cast<double>(column) - distortion.principal_point_px.x()) /
                       distortion.focal_length_px.x();
      // A pixel of the photograph covers half a pixel around its centre. NaN compares as false.
      const bool is_shown = sources.x[i] >= -0.5F && sources.x[i] <= right &&
                            sources.y[i] >= -0.5F && sources.y[i] <= bottom &&
                            u * u + v * v <= turn * turn;
      if (!is_shown) sources.x[i] = sources.y[i] = kNone;
    }
  }
  return sources;
}

}  // namespace thicklens::model
