#include "calib/registration/scale_causes.h"

#include <fmt/format.h>

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>

#include "thicklens/base/statistics.h"

namespace thicklens::calib {
namespace {

constexpr std::array<ReadingUnit, 7> kUnits = {{{"inches", 25.4},
                                                {"centimetres", 10},
                                                {"metres", 1000},
                                                {"micrometres", 0.001},
                                                {"thousandths of an inch", 0.0254},
                                                {"tenths of a millimetre", 0.1},
                                                {"feet", 304.8}}};
constexpr double kScaleBias = 3e-5;  // error of registrations, from frame to frame
constexpr double kZeroBias = 0.01;  // error of a bench offset from the scale, relative to the depth
constexpr double kCauchyWidth = 3;
constexpr int kRounds = 12;
constexpr std::size_t kMaxForMedians = 300;
constexpr double kNearDioptres = 0.15;  // relative difference from 1000/f

struct Point {
  double reading_mm = 0, value = 0, sigma = 0;
};
using Points = std::vector<Point>;

// value = intercept + slope reading, fitted robustly against outliers.
struct Line {
  double intercept = 0, slope = 0;
  double slope_sigma = 0;
  double zero_sigma_mm = 0;  // error of the reading at which the value is 0
  double chi2 = 0;
  double Zero() const { return -intercept / slope; }
};

double RobustSquare(double off) {
  return kCauchyWidth * kCauchyWidth * std::log1p(off * off / (kCauchyWidth * kCauchyWidth));
}

Points PointsOf(const std::vector<ScaleSample>& samples, bool inverse) {
  Points points;
  for (const ScaleSample& s : samples) {
    const double sigma = std::hypot(s.registration.scale_sigma, kScaleBias * s.scale);
    points.push_back({s.reading_mm, inverse ? 1 / s.scale : s.scale,
                      inverse ? sigma / (s.scale * s.scale) : sigma});
  }
  return points;
}

// The slope is the median over pairs of points, and the intercept is the median over the points
// with that slope.
Line MedianLine(const Points& points) {
  // The line is only a start; a long sweep therefore uses only a part of its pairs.
  const std::size_t step = 1 + points.size() / kMaxForMedians;
  std::vector<double> slopes, intercepts;
  for (std::size_t i = 0; i < points.size(); i += step) {
    for (std::size_t j = 0; j < i; j += step) {
      const double step_mm = points[i].reading_mm - points[j].reading_mm;
      if (step_mm != 0) slopes.push_back((points[i].value - points[j].value) / step_mm);
    }
  }
  Line line;
  line.slope = slopes.empty() ? 0 : Median(slopes);
  for (const Point& p : points) intercepts.push_back(p.value - line.slope * p.reading_mm);
  line.intercept = Median(intercepts);
  return line;
}

// The errors of the readings contribute in proportion to the slope; `widening` stretches all
// errors.
Line FitLine(const Points& points, double reading_sigma_mm, double widening) {
  Line line = MedianLine(points);
  double middle_mm = 0;
  for (const Point& p : points) middle_mm += p.reading_mm / static_cast<double>(points.size());
  for (int round = 0; round < kRounds; ++round) {
    Eigen::Matrix2d normal = Eigen::Matrix2d::Zero();
    Eigen::Vector2d right = Eigen::Vector2d::Zero();
    line.chi2 = 0;
    for (const Point& p : points) {
      const double sigma = widening * std::hypot(p.sigma, line.slope * reading_sigma_mm);
      const double off = (p.value - line.intercept - line.slope * p.reading_mm) / sigma;
      line.chi2 += RobustSquare(off);
      const double weight = 1 / (1 + off * off / (kCauchyWidth * kCauchyWidth)) / (sigma * sigma);
      const Eigen::Vector2d row(1, p.reading_mm - middle_mm);
      normal += weight * row * row.transpose();
      right += weight * row * p.value;
    }
    if (!(std::abs(normal.determinant()) > 0)) break;
    const Eigen::Matrix2d covariance = normal.inverse();
    const Eigen::Vector2d solved = covariance * right;
    line.slope = solved.y();
    line.intercept = solved.x() - solved.y() * middle_mm;
    line.slope_sigma = std::sqrt(std::max(0.0, covariance(1, 1)));
    if (line.slope != 0) {
      const Eigen::Vector2d by(-1 / line.slope, solved.x() / (line.slope * line.slope));
      line.zero_sigma_mm = std::sqrt(std::max(0.0, by.dot(covariance * by)));
    }
  }
  return line;
}

double ChiSquareOfConstant(const Points& points, double slope, double reading_sigma_mm,
                           double widening) {
  std::vector<double> values;
  for (const Point& p : points) values.push_back(p.value);
  const double middle = Median(values);
  double sum = 0;
  for (const Point& p : points)
    sum += RobustSquare((p.value - middle) /
                        (widening * std::hypot(p.sigma, slope * reading_sigma_mm)));
  return sum;
}

// Cost of a bench offset for which the scale gives another value than the given one.
double ChiSquareOfZero(const FocusSweep& sweep, double offset_mm, double sigma_mm,
                       double depth_mm) {
  if (!sweep.offset_mm) return 0;
  const double off = (offset_mm - sweep.offset_mm->value) /
                     std::hypot(sigma_mm, sweep.offset_mm->sigma, kZeroBias * depth_mm);
  return RobustSquare(off);
}

// Whether the best cause explains the observations, and is not only better than the others.
bool IsExplained(const ScaleCauses& causes) {
  const Diagnosis& diagnosis = causes.diagnosis;
  return diagnosis.named > 0 &&
         diagnosis.causes.front().chi2 - std::min(causes.chi2_target, causes.chi2_lens) <
             Diagnosis::kDecisive;
}

class Comparison {
 public:
  Comparison(const std::vector<ScaleSample>& samples, const FocusSweep& sweep)
      : sweep_(sweep),
        inverse_points_(PointsOf(samples, true)),
        linear_points_(PointsOf(samples, false)) {
    result_.blur_slope = FindBlurSlope(samples);
  }

  ScaleCauses Run() {
    const double stated_mm = std::max(sweep_.reading_sigma_mm, 0.0);
    // The remainder that the better of the two laws leaves is scatter that neither explains.
    const double freedom = std::max(1.0, static_cast<double>(inverse_points_.size()) - 2);
    const double least = std::min(FitLine(inverse_points_, stated_mm, 1).chi2,
                                  FitLine(linear_points_, stated_mm, 1).chi2);
    widening_ = std::sqrt(std::max(1.0, least / freedom));
    inverse_ = FitLine(inverse_points_, stated_mm, widening_);
    const Line linear = FitLine(linear_points_, stated_mm, widening_);
    constant_ = ChiSquareOfConstant(inverse_points_, inverse_.slope, stated_mm, widening_);
    result_.diagnosis.symptom = "the image scale against the readings";
    result_.diagnosis.chi2_of_none = constant_;
    result_.chi2_target = inverse_.chi2;
    result_.chi2_lens = linear.chi2;
    result_.lens_zero_mm = linear.Zero();
    result_.inverse_zero_mm = inverse_.Zero();
    result_.reference_depth_mm = 1 / std::abs(inverse_.slope);
    for (const bool as_stated : {true, false}) AddMovingTarget(as_stated);
    const double lens_ratio =
        result_.blur_slope ? ChiSquareOfRatio(result_.blur_slope->RatioOfMovingLens(sweep_.camera))
                           : 0;
    Add(kLensMoves, std::min(linear.chi2, inverse_.chi2) + lens_ratio);
    AddObjective();
    SortCauses(&result_.diagnosis);
    ChooseUnit();
    return std::move(result_);
  }

 private:
  void Add(const std::string& cause, double chi2) {
    result_.diagnosis.causes.push_back({cause, chi2});
  }

  bool FollowsStatedDirection() const {
    return inverse_.slope * model::DirectionSign(sweep_.direction) > 0;
  }

  // Adds the moving target in mm and in each other unit. If the scale changes in the opposite
  // direction, the law is no better than a constant scale.
  void AddMovingTarget(bool as_stated) {
    const std::string name = as_stated ? kTargetMoves : kReversedReadings;
    const bool agrees = FollowsStatedDirection() == as_stated;
    const double of_scale = agrees ? inverse_.chi2 : constant_;
    // 1/scale = (offset + sign reading)/depth, so that the offset is the intercept times the depth.
    const double offset_mm = inverse_.intercept * result_.reference_depth_mm;
    // Readings from the other end of the scale have another zero.
    const double of_zero_in_mm =
        as_stated
            ? ChiSquareOfZero(sweep_, offset_mm, inverse_.zero_sigma_mm, result_.reference_depth_mm)
            : 0;
    Add(name, of_scale + OfDepth(1) + of_zero_in_mm);
    // A free zero explains everything that a given zero explains. It is a cause only where the
    // given one fails.
    if (of_zero_in_mm >= Diagnosis::kDecisive) Add(kZeroIsWrong, of_scale + OfDepth(1));
    // Only the blur determines a unit: without it, any depth is possible.
    if (!result_.blur_slope || !agrees) return;
    for (const ReadingUnit& unit : kUnits) {
      const double u = unit.millimetres;
      // The zero may have been given in the unit of the readings or in mm.
      const double of_zero =
          as_stated ? std::min(of_zero_in_mm,
                               ChiSquareOfZero(sweep_, u * offset_mm, u * inverse_.zero_sigma_mm,
                                               u * result_.reference_depth_mm))
                    : 0;
      Add(UnitName(name, unit), of_scale + OfDepth(u) + of_zero);
    }
  }

  // Data of an objective that are wrong explain any depth and any blur. They are a cause only where
  // the stated ones fail. The blur per mm gives the magnification that would fit it.
  void AddObjective() {
    const auto& objective = sweep_.camera.objective;
    if (!objective || !FollowsStatedDirection() || !(OfDepth(1) >= Diagnosis::kDecisive)) return;
    Add(kObjectiveIsWrong, inverse_.chi2);
    if (result_.blur_slope)
      result_.fitting_magnification =
          MagnificationOfBlur(*objective, sweep_.camera.sensor.pixel_pitch_mm,
                              result_.blur_slope->px * std::abs(inverse_.slope));
  }

  static std::string UnitName(const std::string& law, const ReadingUnit& unit) {
    return fmt::format("{}, readings in {}", law, unit.name);
  }

  // Cost of the blur ratio that the depth requires. Nearer than the focal point there is no image.
  // In a sweep that is short against its depth, the scale determines the depth poorly: the slope of
  // 1/scale, which is 1/depth, takes its best value, which costs its square in standard deviations.
  double OfDepth(double unit) const {
    constexpr int kSteps = 60;
    constexpr double kReach = 6;  // standard deviations of the slope
    const double slope = std::abs(inverse_.slope);
    double least = ChiSquareOfRatio(-1);
    for (int i = -kSteps; i <= kSteps; ++i) {
      const double off = kReach * i / kSteps;
      const double moved = slope + off * inverse_.slope_sigma;
      if (moved > 0) least = std::min(least, off * off + OfDepthAlone(unit / moved));
    }
    return least;
  }

  double OfDepthAlone(double depth_mm) const {
    if (!(depth_mm > sweep_.camera.lens.front_focal_length_mm)) return ChiSquareOfRatio(-1);
    if (!result_.blur_slope) return 0;
    return ChiSquareOfRatio(result_.blur_slope->RatioOfMovingTarget(sweep_.camera, depth_mm));
  }

  void ChooseUnit() {
    const Diagnosis& diagnosis = result_.diagnosis;
    if (diagnosis.Names(kTargetMoves) || diagnosis.Names(kReversedReadings) ||
        diagnosis.Names(kZeroIsWrong) || !IsExplained(result_))
      return;
    for (std::size_t i = 0; i < diagnosis.named; ++i) {
      for (const ReadingUnit& unit : kUnits) {
        const std::string& cause = diagnosis.causes[i].cause;
        if (cause != UnitName(kTargetMoves, unit) && cause != UnitName(kReversedReadings, unit))
          continue;
        if (!result_.unit)
          result_.unit = unit;
        else
          result_.other_units.push_back(unit);
      }
    }
  }

  const FocusSweep& sweep_;
  Points inverse_points_, linear_points_;
  Line inverse_;
  double widening_ = 1, constant_ = 0;
  ScaleCauses result_;
};

std::string ObjectiveReason(const FocusSweep& sweep, const ScaleCauses& causes) {
  const model::Objective& objective = *sweep.camera.objective;
  const double f1_mm = sweep.camera.lens.front_focal_length_mm;
  std::string text = fmt::format(
      "the image scale and the blur contradict the data of the objective: with lens.magnification "
      "{:.4g} and lens.tube_lens_focal_length_mm {:.4g} its focal length is {:.4g} mm",
      objective.magnification, objective.tube_lens_focal_length_mm, f1_mm);
  if (causes.reference_depth_mm > f1_mm && causes.blur_slope) {
    text += fmt::format(
        ", and at the {:.3g} mm of the image scale the blur ratio would be {:.2g}",
        causes.reference_depth_mm,
        causes.blur_slope->RatioOfMovingTarget(sweep.camera, causes.reference_depth_mm));
  } else {
    text += fmt::format(", but the image scale puts the target at {:.3g} mm",
                        causes.reference_depth_mm);
  }
  if (causes.fitting_magnification) {
    text += fmt::format(
        ". With lens.numerical_aperture {:.3g} the blur fits a magnification of about {:.2g}",
        objective.numerical_aperture, *causes.fitting_magnification);
  }
  return text +
         ". Check lens.magnification and lens.tube_lens_focal_length_mm (the magnification holds "
         "for the tube lens of the objective's maker)";
}

std::string LensMovesReason(const FocusSweep& sweep, const ScaleCauses& causes) {
  const double depth_mm = causes.reference_depth_mm;
  const double f1_mm = sweep.camera.lens.front_focal_length_mm;
  const bool is_in_front = depth_mm > f1_mm;
  std::string evidence;
  if (causes.chi2_target - causes.chi2_lens >= Diagnosis::kDecisive) {
    evidence = fmt::format(
        "the scale is linear in the reading (chi2 {:.0f}), and 1/scale is not (chi2 {:.0f})",
        causes.chi2_lens, causes.chi2_target);
  }
  if (causes.blur_slope) {
    evidence += fmt::format(
        "{}the blur grows with the scale as it does behind a lens that moves (blur ratio about "
        "{:.2g}); a target that moves would {}",
        evidence.empty() ? "" : ", and ", causes.blur_slope->RatioOfMovingLens(sweep.camera),
        is_in_front ? fmt::format("need a blur ratio of {:.2g}",
                                  causes.blur_slope->RatioOfMovingTarget(sweep.camera, depth_mm))
                    : fmt::format("be at {:.3g} mm, nearer than the focal length ({:.3g} mm), "
                                  "where no image forms",
                                  depth_mm, f1_mm));
  }
  if (evidence.empty()) {
    evidence = fmt::format(
        "if the target moved, the scale would put it at {:.3g} mm, nearer than the focal length",
        depth_mm);
  }
  std::string meaning;
  const double of_dioptres = 1000 / sweep.camera.lens.rear_focal_length_mm;
  if (std::abs(causes.inverse_zero_mm / of_dioptres - 1) < kNearDioptres) {
    meaning = fmt::format(
        ". 1/scale would be 0 at the reading {:.4g}, near 1000/f = {:.4g}: the readings may be the "
        "dioptres of a focus motor",
        causes.inverse_zero_mm, of_dioptres);
  } else if (-causes.lens_zero_mm > sweep.camera.lens.rear_focal_length_mm) {
    meaning = fmt::format(
        ". If the readings are extensions in mm, the scale puts the sensor {:.4g} mm behind the "
        "lens at reading 0",
        -causes.lens_zero_mm);
  }
  return fmt::format(
      "the image scale follows the lens, not the target: {}. This is a sweep of the focus ring, of "
      "a focus motor or of the sensor: state moves: lens or moves: sensor (--moves), or move the "
      "target (or the whole camera) along the axis and leave the focus unchanged{}",
      evidence, meaning);
}

std::string NotDistinguished() {
  return "Scale and blur do not distinguish these causes: state what moved (in a sweep with the "
         "focus ring or a focus motor the lens moves: --moves lens)";
}

}  // namespace

double MagnificationOfBlur(const model::Objective& objective, double pixel_pitch_mm,
                           double blur_px_per_mm) {
  const double na = objective.numerical_aperture;
  return blur_px_per_mm * pixel_pitch_mm * std::sqrt(1 - na * na) / (kUsualBlurRatio * na);
}

ScaleCauses CompareScaleCauses(const std::vector<ScaleSample>& samples, const FocusSweep& sweep) {
  return Comparison(samples, sweep).Run();
}

std::optional<std::string> ReasonOfScaleCauses(const FocusSweep& sweep, const ScaleModel& law,
                                               const ScaleCauses& causes) {
  const Diagnosis& diagnosis = causes.diagnosis;
  const bool is_reversed = law.kind == ScaleKind::kReversed;
  if (!is_reversed && (diagnosis.Names(kTargetMoves) || diagnosis.Names(kZeroIsWrong)))
    return std::nullopt;
  const bool is_explained = IsExplained(causes);
  if (is_explained && diagnosis.Names(kObjectiveIsWrong)) {
    std::string text = ObjectiveReason(sweep, causes);
    if (diagnosis.Names(kLensMoves))
      text += ". Or the lens or the sensor moves, and not the target. " + NotDistinguished();
    if (causes.unit) text += ". Or the readings are not in mm. " + UnitThatFits(sweep, causes);
    return text;
  }
  if (is_explained && diagnosis.NamesOnly(kLensMoves)) return LensMovesReason(sweep, causes);
  if (is_explained && diagnosis.Names(kLensMoves) && causes.unit) {
    return fmt::format("either {}; or the target moves{} and the readings are not in mm. {}. {}",
                       LensMovesReason(sweep, causes),
                       is_reversed ? ", " + law.message : std::string(),
                       UnitThatFits(sweep, causes), NotDistinguished());
  }
  if (!is_reversed) return std::nullopt;
  if (!is_explained) {
    return law.message +
           "; but neither this, nor another unit of the readings, nor a lens that moves explains "
           "how the blur changes with the scale: check focal length, aperture radius and pixel "
           "pitch";
  }
  if (causes.unit) {
    return fmt::format("{}; and the readings are not in mm. {}", law.message,
                       UnitThatFits(sweep, causes));
  }
  if (diagnosis.Names(kLensMoves)) {
    return fmt::format("{}, or the lens or the sensor moves and not the target. {}", law.message,
                       NotDistinguished());
  }
  return law.message;
}

std::string UnitThatFits(const FocusSweep& sweep, const ScaleCauses& causes) {
  if (!causes.unit || !causes.blur_slope) return "";
  const auto with = [&](const ReadingUnit& unit) {
    const double depth_mm = unit.millimetres * causes.reference_depth_mm;
    return fmt::format(
        "With readings in {} the target is at about {:.3g} mm and the blur ratio is about {:.2g}",
        unit.name, depth_mm, causes.blur_slope->RatioOfMovingTarget(sweep.camera, depth_mm));
  };
  std::string words = with(*causes.unit);
  for (const ReadingUnit& unit : causes.other_units) words += ". " + with(unit);
  return words;
}

std::string UnitAdvice(const FocusSweep& sweep, const std::vector<FrameMeasurement>& frames,
                       const ScaleModel& law, const ScaleCauses& causes) {
  if (!law.done) return "";
  std::vector<double> depths_mm;
  for (const FrameMeasurement& frame : frames) {
    if (frame.image_scale) depths_mm.push_back(law.reference_depth_mm / *frame.image_scale);
  }
  if (depths_mm.empty()) return "";
  // ReasonOfScaleCauses names a lens that moves, together with the unit where both are possible.
  if (causes.diagnosis.Names(kLensMoves) && !causes.ReadingsMayBeRight()) return "";
  if (causes.diagnosis.Names(kObjectiveIsWrong)) return "";
  const auto [nearest, farthest] = std::minmax_element(depths_mm.begin(), depths_mm.end());
  const double f1_mm = sweep.camera.lens.front_focal_length_mm;
  const std::string placed =
      fmt::format("the image scale puts the target at {:.3g} to {:.3g} mm", *nearest, *farthest);
  if (causes.unit) {
    const std::string contradiction =
        *farthest < f1_mm
            ? fmt::format("nearer than the focal length ({:.3g} mm), where no image forms", f1_mm)
            : fmt::format(
                  "where the blur would require a blur ratio of {:.2g}",
                  causes.blur_slope->RatioOfMovingTarget(sweep.camera, causes.reference_depth_mm));
    return fmt::format("{}, {}: check that the readings are in mm. {}", placed, contradiction,
                       UnitThatFits(sweep, causes));
  }
  if (*nearest < f1_mm && !causes.ReadingsMayBeRight()) {
    return fmt::format(
        "{}, nearer than the focal length ({:.3g} mm), where no image forms: check that the "
        "readings are in mm, and check the focal length",
        placed, f1_mm);
  }
  return "";
}

std::string ConstantScaleWarning(const FocusSweep& sweep, const std::vector<ScaleSample>& samples) {
  if (!sweep.offset_mm || samples.empty()) return "";
  double least_mm = 0, most_mm = 0, low = samples.front().scale, high = low;
  for (const ScaleSample& sample : samples) {
    const double depth_mm =
        sweep.offset_mm->value + model::DirectionSign(sweep.direction) * sample.reading_mm;
    least_mm = &sample == &samples.front() ? depth_mm : std::min(least_mm, depth_mm);
    most_mm = std::max(most_mm, depth_mm);
    low = std::min(low, sample.scale);
    high = std::max(high, sample.scale);
  }
  if (!(least_mm > 0)) return "";
  const double expected = most_mm / least_mm - 1;
  if (!(expected > 4 * (high / low - 1))) return "";
  return fmt::format(
      "the image scale does not change with the reading, although it should change by {:.2g} % "
      "according to offset_mm: the frames were aligned (brought to one scale by a focus stacker), "
      "the lens is telecentric, or the sensor moves. These look alike; the frames as the camera "
      "stored them would distinguish them. The blur law of a telecentric lens is used, which also "
      "holds for aligned frames",
      100 * expected);
}

}  // namespace thicklens::calib
