#include "calib/edges/edge_patch.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "thicklens/base/statistics.h"

// The surroundings of an edge, resampled along its normal, and the properties measured in them.

namespace thicklens::calib {
namespace {

constexpr int kHalfWidth = 32;  // half width of the patch, px of the scale
constexpr int kColumns = 2 * kHalfWidth + 1;
constexpr int kMaxRows = 64;
constexpr int kMinRows = 7;
constexpr double kMissing = std::numeric_limits<double>::quiet_NaN();
// Maximum departure of a plateau from a step, relative to the contrast.
constexpr double kTolerance = 0.06;

struct Range {
  int first = 0, last = -1;
  int Count() const { return last - first + 1; }
};

class Patch {
 public:
  Patch(const FrameScale& scale, const StraightRegion& line)
      : noise_(scale.gradient_noise), line_(line) {
    const int wanted = static_cast<int>(2 * line.half_length) + 1;
    rows_ = std::min(wanted, kMaxRows);
    spacing_ = 2 * line.half_length / std::max(rows_ - 1, 1);
    values_.resize(static_cast<std::size_t>(rows_ * kColumns));
    const Eigen::Vector2d normal(std::cos(line.normal_rad), std::sin(line.normal_rad));
    const Eigen::Vector2d along(-normal.y(), normal.x());
    for (int row = 0; row < rows_; ++row) {
      for (int d = -kHalfWidth; d <= kHalfWidth; ++d) {
        At(row, d) = SampleAt(scale.smoothed, line.centre + Along(row) * along + d * normal);
      }
    }
    kept_ = {0, rows_ - 1};
  }

  // Distance of a row from the middle of the line.
  double Along(int row) const { return row * spacing_ - line_.half_length; }
  int rows() const { return rows_; }
  double spacing() const { return spacing_; }
  Range kept() const { return kept_; }
  double contrast() const { return contrast_; }
  int reach() const { return reach_; }  // distance where the transition ends on both sides
  int plateau() const { return plateau_; }

  // Finds profile, transition and plateaus from the kept rows. Returns false if they show no step.
  bool Describe() {
    for (int d = -kHalfWidth; d <= kHalfWidth; ++d) SummariseColumn(d);
    if (!FindTransition()) return false;
    contrast_ = Profile(reach_ + 1) - Profile(-reach_ - 1);
    if (!(contrast_ > 8 * noise_)) return false;
    plateau_ = std::min(Plateau(1), Plateau(-1));
    return true;
  }

  // Keeps the longest run of rows that follow the profile.
  void KeepUndisturbed() {
    Range run, best;
    run.first = kept_.first;
    for (int row = kept_.first; row <= kept_.last; ++row) {
      if (!Follows(row)) run.first = row + 1;
      run.last = row;
      if (run.Count() > best.Count()) best = run;
    }
    kept_ = best;
  }

  // The line moved to the edge that the kept rows show.
  StraightRegion Aligned() const {
    double n = 0, st = 0, stt = 0, sd = 0, std = 0;
    for (int row = kept_.first; row <= kept_.last; ++row) {
      const double d = EdgeOf(row);
      if (!std::isfinite(d)) continue;
      const double t = Along(row);
      n += 1;
      st += t;
      stt += t * t;
      sd += d;
      std += t * d;
    }
    StraightRegion aligned = line_;
    const double determinant = n * stt - st * st;
    if (!(n >= 4) || !(determinant > 0)) return aligned;
    const double turn = std::atan((n * std - st * sd) / determinant);
    const double shift = (sd - turn * st) / n;
    const Eigen::Vector2d normal(std::cos(line_.normal_rad), std::sin(line_.normal_rad));
    aligned.centre += shift * normal;
    // Where the edge lies further along the normal for larger t, the normal turns back.
    aligned.normal_rad -= turn;
    return aligned;
  }

 private:
  double& At(int row, int d) {
    return values_[static_cast<std::size_t>(row * kColumns + d + kHalfWidth)];
  }
  double At(int row, int d) const {
    return values_[static_cast<std::size_t>(row * kColumns + d + kHalfWidth)];
  }
  double Profile(int d) const {
    return std::abs(d) > kHalfWidth ? kMissing : profile_[static_cast<std::size_t>(d + kHalfWidth)];
  }
  double Slope(int d) const { return 0.5 * (Profile(d + 1) - Profile(d - 1)); }
  double Spread(int d) const { return spread_[static_cast<std::size_t>(d + kHalfWidth)]; }

  // Median of the kept rows, and the spread of a row about it.
  void SummariseColumn(int d) {
    std::vector<double> values;
    for (int row = kept_.first; row <= kept_.last; ++row) {
      if (std::isfinite(At(row, d))) values.push_back(At(row, d));
    }
    const auto column = static_cast<std::size_t>(d + kHalfWidth);
    // The patch ends where the frame cuts off too much of the column.
    const bool is_there = static_cast<double>(values.size()) > 0.6 * kept_.Count();
    profile_[column] = is_there ? Median(values) : kMissing;
    for (double& value : values) value = std::abs(value - profile_[column]);
    spread_[column] = is_there ? 1.4826 * Median(std::move(values)) : kMissing;
  }

  // Finds the steepest place near the middle, and the distance outward at which the slope has
  // fallen to a twentieth.
  bool FindTransition() {
    int steepest = 0;
    for (int d = -4; d <= 4; ++d) {
      if (Slope(d) > Slope(steepest)) steepest = d;
    }
    const double peak = Slope(steepest);
    if (!(peak > 0)) return false;
    reach_ = 0;
    for (const int side : {-1, 1}) {
      int d = steepest;
      while (std::abs(d) < kHalfWidth && Slope(d) > 0.05 * peak) d += side;
      if (!std::isfinite(Slope(d))) return false;
      reach_ = std::max(reach_, std::abs(d));
    }
    return reach_ + 2 < kHalfWidth;
  }

  // Distance over which a side stays at its level, apart from an illumination gradient.
  int Plateau(int side) const {
    const double tolerance = Tolerance();
    const double level = Profile(side * (reach_ + 1));
    int d = reach_ + 1;
    while (d <= kHalfWidth && std::abs(Profile(side * d) - level) < tolerance &&
           Spread(side * d) < tolerance) {
      ++d;
    }
    if (d > kHalfWidth || !std::isfinite(Profile(side * d))) return d - 1;
    // The structure that ended the plateau disturbs it further in, below the tolerance, about as
    // far as the structure is blurred.
    return static_cast<int>(d - 1 - 0.4 * reach_);
  }

  // Noise that is a large part of the contrast is the texture of the frame, and does not widen the
  // tolerance further.
  double Tolerance() const {
    return kTolerance * contrast_ + std::min(4 * noise_, 0.1 * contrast_);
  }

  bool Follows(int row) const {
    double sum = 0, squares = 0, count = 0;
    for (int d = -plateau_; d <= plateau_; ++d) {
      const double departure = At(row, d) - Profile(d);
      if (!std::isfinite(departure)) continue;
      sum += departure;
      squares += departure * departure;
      ++count;
    }
    if (!(count > plateau_)) return false;
    // An illumination gradient along the edge shifts a whole row.
    const double mean = sum / count;
    const double bound = 1.2 * Tolerance();
    return squares / count - mean * mean < bound * bound && std::abs(mean) < 0.25 * contrast_;
  }

  // Position of the edge in a row: the centroid of its rise within the transition.
  double EdgeOf(int row) const {
    double weight = 0, moment = 0;
    for (int d = -reach_ - 2; d <= reach_ + 2; ++d) {
      if (std::abs(d) >= kHalfWidth) continue;
      const double rise = 0.5 * (At(row, d + 1) - At(row, d - 1));
      if (!(rise > noise_)) continue;
      weight += rise;
      moment += rise * d;
    }
    return weight > 0.5 * contrast_ ? moment / weight : kMissing;
  }

  double noise_;
  StraightRegion line_;
  int rows_ = 0;
  double spacing_ = 1;
  std::vector<double> values_;
  std::vector<double> profile_ = std::vector<double>(kColumns);
  std::vector<double> spread_ = std::vector<double>(kColumns);
  Range kept_;
  int reach_ = 0;
  int plateau_ = 0;
  double contrast_ = 0;
};

}  // namespace

float SampleAt(const cv::Mat& grey, const Eigen::Vector2d& at) {
  const int x = static_cast<int>(std::floor(at.x())), y = static_cast<int>(std::floor(at.y()));
  if (x < 0 || y < 0 || x + 1 >= grey.cols || y + 1 >= grey.rows) {
    return std::numeric_limits<float>::quiet_NaN();
  }
  const float u = static_cast<float>(at.x()) - static_cast<float>(x);
  const float v = static_cast<float>(at.y()) - static_cast<float>(y);
  const auto* above = grey.ptr<float>(y);
  const auto* below = grey.ptr<float>(y + 1);
  return (1 - v) * ((1 - u) * above[x] + u * above[x + 1]) +
         v * ((1 - u) * below[x] + u * below[x + 1]);
}

std::optional<FeatureCandidate> UndisturbedStep(const FrameScale& scale,
                                                const StraightRegion& region) {
  Patch rough(scale, region);
  if (rough.rows() < kMinRows || !rough.Describe()) return std::nullopt;
  const StraightRegion line = rough.Aligned();
  Patch patch(scale, line);
  if (!patch.Describe()) return std::nullopt;
  patch.KeepUndisturbed();
  if (patch.kept().Count() < kMinRows || !patch.Describe()) return std::nullopt;
  if (patch.plateau() < patch.reach() + 1) return std::nullopt;

  // A structure beyond an end disturbs the rows as far as the blur reaches. The rows that it
  // disturbs by more than the tolerance are already removed.
  const double margin = 0.5 * patch.reach() + 0.5;
  const Eigen::Vector2d normal(std::cos(line.normal_rad), std::sin(line.normal_rad));
  const Eigen::Vector2d along(-normal.y(), normal.x());
  const auto end_of = [&](int row, double outward) {
    const double t = patch.Along(row);
    const Eigen::Vector2d beyond = line.centre + (t + outward * 3 * margin) * along;
    const bool at_border = !std::isfinite(SampleAt(scale.smoothed, beyond));
    return at_border ? t : t - outward * margin;
  };
  const double first = end_of(patch.kept().first, -1);
  const double last = end_of(patch.kept().last, 1);
  const double half_length = (last - first) / 2;
  if (!(half_length >= 4) || !(2 * half_length >= patch.reach())) return std::nullopt;

  FeatureCandidate candidate;
  EdgeFeature& feature = candidate.feature;
  const Eigen::Vector2d centre = line.centre + (first + last) / 2 * along;
  feature.centre_px = (centre.array() + 0.5) * scale.factor - 0.5;
  feature.angle_rad = line.normal_rad;
  feature.half_length_px = half_length * scale.factor;
  feature.half_width_px = patch.plateau() * scale.factor;
  candidate.strength = patch.contrast() * std::sqrt(feature.half_length_px);
  return candidate;
}

}  // namespace thicklens::calib
