#include "tools/io/lightfields/view_order.h"

#include <fmt/format.h>

#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <Eigen/Eigenvalues>
#include <algorithm>
#include <array>
#include <cmath>
#include <iterator>
#include <limits>
#include <map>
#include <opencv2/imgproc.hpp>
#include <optional>
#include <utility>
#include <vector>

#include "thicklens/base/cancel.h"
#include "tools/io/lightfields/view_grid.h"

namespace thicklens::io {
namespace {

// Views are compared at most at this size, px: finer details add nothing.
constexpr int kMaxPx = 320;
// Largest shift that is followed, px of the compared size.
constexpr int kMaxShiftPx = 6;
// Standard deviation of a shift besides the one that noise causes, px: interpolation, occlusions.
constexpr double kShiftFloorPx = 0.1;
// A tile counts at most this much: tiles at occlusions fit nothing.
constexpr double kMaxCost = 25;
// A tile shows a shift if no shift at all costs at least this much.
constexpr double kShows = 9;
constexpr int kMinTiles = 3;
// The differences that remain may have at most this part of a tile's variance. Of two views with
// nothing in common but their noise, it is 1 or more at any shift.
constexpr double kMatches = 0.5;
// A tile fits at two places, as patterns that repeat themselves do, if its differences at the
// second are larger by less than this part of its variance.
constexpr double kSamePattern = 0.25;
// Gradients along an axis count where they are this many times those that noise has.
constexpr double kAboveNoise = 3;
// Tiles overlap by half along both axes: four tiles have the information of one.
constexpr double kOverlap = 4;
// The margin by which an order must be better than another.
constexpr double kDecides = 30;
// Tiles of a view that are followed where only the consistency of a step is tested.
constexpr std::size_t kCheckedTiles = 64;
// A step does not show the same scene if more than the first share of its tiles have no match,
// where no more than the second share have none in the middle.
constexpr double kUnlike = 0.75, kUsuallyUnlike = 0.5;
// Single views may differ for other reasons, as dark corners do: this share may not fit.
constexpr double kMayNotFit = 0.05;

using Vector2 = Eigen::Vector2d;
using Matrix2 = Eigen::Matrix2d;

// The shift of a tile of one view in another, with the inverse of its covariance.
struct Shift {
  Vector2 px{0, 0};
  Matrix2 weight = Matrix2::Zero();
  bool is_match = true;  // false: the other view has nothing like the tile there
};
// The shifts of a tile to the neighbour across and to that below.
struct TileShifts {
  Shift across, down;
};

// Square root of the mean of the channels, whose noise hardly depends on the brightness; reduced.
cv::Mat ComparedView(const model::LightField& light_field, int k, int l) {
  cv::Mat grey(light_field.t_count, light_field.s_count, CV_32F, cv::Scalar(0));
  for (int y = 0; y < grey.rows; ++y) {
    ThrowIfCancelled();
    auto* row = grey.ptr<float>(y);
    for (int x = 0; x < grey.cols; ++x) {
      float sum = 0;
      for (int channel = 0; channel < light_field.channels; ++channel) {
        const float value =
            light_field.values[light_field.ViewStart(channel, k, l) +
                               static_cast<std::size_t>(y) * static_cast<std::size_t>(grey.cols) +
                               static_cast<std::size_t>(x)];
        sum += std::isfinite(value) ? std::clamp(value, 0.0F, 4.0F) : 0.0F;
      }
      row[x] = std::sqrt(sum / static_cast<float>(light_field.channels));
    }
  }
  const int factor = (std::max(grey.rows, grey.cols) + kMaxPx - 1) / kMaxPx;
  if (factor <= 1) return grey;
  cv::Mat reduced;
  cv::resize(grey, reduced,
             cv::Size(std::max(1, grey.cols / factor), std::max(1, grey.rows / factor)), 0, 0,
             cv::INTER_AREA);
  return reduced;
}

float Interpolated(const cv::Mat& image, double x, double y) {
  const int x0 = std::clamp(static_cast<int>(std::floor(x)), 0, image.cols - 2);
  const int y0 = std::clamp(static_cast<int>(std::floor(y)), 0, image.rows - 2);
  const auto fx = static_cast<float>(x - x0);
  const auto fy = static_cast<float>(y - y0);
  const auto* upper = image.ptr<float>(y0);
  const auto* lower = image.ptr<float>(y0 + 1);
  return (1 - fy) * ((1 - fx) * upper[x0] + fx * upper[x0 + 1]) +
         fy * ((1 - fx) * lower[x0] + fx * lower[x0 + 1]);
}

// The tiles on which views are compared.
struct Tiling {
  int edge = 0, margin = 0;
  explicit Tiling(const cv::Mat& view) {
    const int side = std::min(view.rows, view.cols);
    const int most_shift = std::clamp(side / 8, 1, kMaxShiftPx);
    margin = most_shift + 2;
    edge = std::clamp(side / 6, 8, 16);
  }
  int most_shift() const { return margin - 2; }
};

// Gradients and variance of a tile, summed over its pixels.
struct TileDetails {
  Matrix2 normal = Matrix2::Zero();
  double variance = 0;
};
TileDetails DetailsOf(const cv::Mat& from, int x0, int y0, const Tiling& tiling) {
  TileDetails details;
  double sum = 0, squares = 0;
  for (int y = y0; y < y0 + tiling.edge; ++y) {
    for (int x = x0; x < x0 + tiling.edge; ++x) {
      const Vector2 gradient(0.5 * (from.at<float>(y, x + 1) - from.at<float>(y, x - 1)),
                             0.5 * (from.at<float>(y + 1, x) - from.at<float>(y - 1, x)));
      details.normal += gradient * gradient.transpose();
      const double value = from.at<float>(y, x);
      sum += value;
      squares += value * value;
    }
  }
  details.variance = squares - sum * sum / (tiling.edge * tiling.edge);
  return details;
}

struct Coarse {
  cv::Point shift;
  bool is_only = true;  // no other shift fits nearly as well
};

// Whole-pixel shift with the least difference; nothing if it is at the limit.
std::optional<Coarse> CoarseShift(const cv::Mat& from, const cv::Mat& to, int x0, int y0,
                                  const Tiling& tiling, const TileDetails& details) {
  std::vector<std::pair<cv::Point, double>> differences;
  const int most = tiling.most_shift();
  double least = std::numeric_limits<double>::infinity();
  cv::Point best;
  for (int dy = -most; dy <= most; ++dy) {
    for (int dx = -most; dx <= most; ++dx) {
      double sum = 0;
      for (int y = y0; y < y0 + tiling.edge; ++y) {
        const auto* a = from.ptr<float>(y);
        const auto* b = to.ptr<float>(y + dy);
        for (int x = x0; x < x0 + tiling.edge; ++x) {
          const double difference = a[x] - b[x + dx];
          sum += difference * difference;
        }
      }
      // Equal differences, as in flat tiles: the smaller shift.
      if (sum < least || (sum == least && std::hypot(dx, dy) < std::hypot(best.x, best.y))) {
        least = sum;
        best = {dx, dy};
      }
      differences.emplace_back(cv::Point(dx, dy), sum);
    }
  }
  if (std::abs(best.x) == most || std::abs(best.y) == most) return std::nullopt;
  Coarse coarse{best, true};
  for (const auto& [shift, sum] : differences) {
    const Vector2 away(shift.x - best.x, shift.y - best.y);
    // Along an edge a tile fits everywhere: that is no repetition.
    const bool is_elsewhere =
        away.norm() > 1.5 && away.dot(details.normal * away) > details.variance;
    if (is_elsewhere && sum < least + kSamePattern * details.variance) coarse.is_only = false;
  }
  return coarse;
}

// The shift of a tile: the least squares of its differences, by Gauss-Newton steps. Its covariance
// follows from the differences that remain.
std::optional<Shift> ShiftOf(const cv::Mat& from, const cv::Mat& to, int x0, int y0,
                             const Tiling& tiling) {
  const TileDetails details = DetailsOf(from, x0, y0, tiling);
  const Matrix2& normal = details.normal;
  const std::optional<Coarse> found = CoarseShift(from, to, x0, y0, tiling, details);
  if (!found) return std::nullopt;
  if (!found->is_only) return Shift{};
  const cv::Point coarse = found->shift;
  constexpr double kSmall = 1e-9;
  const double ridge = kSmall + 1e-3 * normal.trace();
  const Eigen::LDLT<Matrix2> solver(normal + ridge * Matrix2::Identity());
  Vector2 shift(coarse.x, coarse.y);
  double squares = 0;
  for (int step = 0; step < 6; ++step) {
    Vector2 right = Vector2::Zero();
    squares = 0;
    for (int y = y0; y < y0 + tiling.edge; ++y) {
      for (int x = x0; x < x0 + tiling.edge; ++x) {
        const Vector2 gradient(0.5 * (from.at<float>(y, x + 1) - from.at<float>(y, x - 1)),
                               0.5 * (from.at<float>(y + 1, x) - from.at<float>(y - 1, x)));
        const double difference =
            from.at<float>(y, x) - Interpolated(to, x + shift.x(), y + shift.y());
        right += gradient * difference;
        squares += difference * difference;
      }
    }
    const Vector2 update = solver.solve(right);
    if (!(update.norm() < 1)) return std::nullopt;
    shift += update;
    if ((shift - Vector2(coarse.x, coarse.y)).cwiseAbs().maxCoeff() > 1) return std::nullopt;
  }
  const int count = tiling.edge * tiling.edge;
  // Noise alone has a best shift too, which says nothing: no weight.
  if (squares > kMatches * details.variance) {
    Shift none;
    none.is_match = false;
    return none;
  }
  const double variance = squares / (count - 2) + kSmall;
  // A tile without details has no weight; along an edge only its normal has. The noise of the
  // differences is that of two values, and a gradient has a quarter of it.
  const double of_noise = kAboveNoise * count * variance / 4;
  const Eigen::SelfAdjointEigenSolver<Matrix2> axes(normal);
  Matrix2 weight = Matrix2::Zero();
  for (int i = 0; i < 2; ++i) {
    const double information = axes.eigenvalues()[i] - of_noise;
    if (information <= 0) continue;
    const Vector2 axis = axes.eigenvectors().col(i);
    weight += axis * axis.transpose() / (variance / information + kShiftFloorPx * kShiftFloorPx);
  }
  return Shift{shift, weight, true};
}

// The directions, up to one common sign, of the shifts across and down in an order of views.
struct Hypothesis {
  ViewOrder order;
  Vector2 across, down;
};
const std::array<Hypothesis, 4>& Hypotheses() {
  static const std::array<Hypothesis, 4> all = {{{ViewOrder::kAsStated, {1, 0}, {0, 1}},
                                                 {ViewOrder::kMirrored, {1, 0}, {0, -1}},
                                                 {ViewOrder::kSwapped, {0, 1}, {1, 0}},
                                                 {ViewOrder::kSwappedMirrored, {0, 1}, {-1, 0}}}};
  return all;
}

double Square(const Shift& shift) { return shift.px.dot(shift.weight * shift.px); }

// Squared deviation of a tile's shifts from the best disparity in that order, limited.
double CostOf(const TileShifts& tile, const Vector2& across, const Vector2& down) {
  const double product =
      across.dot(tile.across.weight * tile.across.px) + down.dot(tile.down.weight * tile.down.px);
  const double square = across.dot(tile.across.weight * across) + down.dot(tile.down.weight * down);
  const double cost =
      Square(tile.across) + Square(tile.down) - (square > 0 ? product * product / square : 0);
  return std::clamp(cost, 0.0, kMaxCost);
}

struct Fit {
  double cost = std::numeric_limits<double>::infinity();
  double ratio = 1;
};

// The cost of an order, with the ratio of both steps that fits best; 1 unless another is clearly
// better.
Fit FitOf(const std::vector<TileShifts>& tiles, const Hypothesis& hypothesis) {
  constexpr std::array<double, 7> kRatios = {1, 0.25, 0.5, 0.71, 1.41, 2, 4};
  Fit best;
  for (const double ratio : kRatios) {
    double cost = 0;
    for (const TileShifts& tile : tiles)
      cost += CostOf(tile, hypothesis.across, ratio * hypothesis.down) / kOverlap;
    if (cost + (ratio == 1 ? 0 : kDecides) < best.cost) best = {cost, ratio};
  }
  return best;
}

// Three views: one, its neighbour `step` views across, and that `step` views down.
struct Triple {
  int k = 0, l = 0, step = 0;
  bool has_across = false, has_down = false;
};

// The triple nearest to the middle whose views are known.
std::optional<Triple> TripleInTheMiddle(const model::LightField& light_field, int step) {
  const bool has_across = light_field.u_count > step;
  const bool has_down = light_field.v_count > step;
  if (!has_across && !has_down) return std::nullopt;
  if (light_field.u_count > 1 && light_field.v_count > 1 && !(has_across && has_down))
    return std::nullopt;
  std::optional<Triple> best;
  double least = std::numeric_limits<double>::infinity();
  const int last_k = light_field.u_count - 1 - (has_across ? step : 0);
  const int last_l = light_field.v_count - 1 - (has_down ? step : 0);
  for (int l = 0; l <= last_l; ++l) {
    for (int k = 0; k <= last_k; ++k) {
      if (!light_field.IsPresent(k, l) || (has_across && !light_field.IsPresent(k + step, l)) ||
          (has_down && !light_field.IsPresent(k, l + step))) {
        continue;
      }
      const double away = std::hypot(k - last_k / 2.0, l - last_l / 2.0);
      if (away < least) {
        least = away;
        best = Triple{k, l, step, has_across, has_down};
      }
    }
  }
  return best;
}

// Sets the range of the disparities of the tiles that show one, with views of `compared_px`
// columns.
void SetDisparities(const model::LightField& light_field, const Triple& triple,
                    const std::vector<TileShifts>& tiles, double ratio, int compared_px,
                    ViewOrderFinding* finding) {
  const auto hypothesis =
      std::find_if(Hypotheses().begin(), Hypotheses().end(),
                   [&](const Hypothesis& one) { return one.order == finding->order; });
  const Vector2& across = hypothesis->across;
  const Vector2 down = ratio * hypothesis->down;
  const double px_of_view = static_cast<double>(light_field.s_count) / compared_px;
  std::vector<double> disparities;
  for (const TileShifts& tile : tiles) {
    if (Square(tile.across) + Square(tile.down) < kShows) continue;
    const double product =
        across.dot(tile.across.weight * tile.across.px) + down.dot(tile.down.weight * tile.down.px);
    const double square =
        across.dot(tile.across.weight * across) + down.dot(tile.down.weight * down);
    // A point at x is at x - d in the next view.
    if (square > 0) disparities.push_back(-product / square * px_of_view / triple.step);
  }
  if (disparities.empty()) return;
  std::sort(disparities.begin(), disparities.end());
  finding->least_px = disparities[disparities.size() / 10];
  finding->most_px = disparities[disparities.size() - 1 - disparities.size() / 10];
}

ViewOrderFinding FindingOf(const model::LightField& light_field, const Triple& triple) {
  const cv::Mat from = ComparedView(light_field, triple.k, triple.l);
  const cv::Mat across =
      triple.has_across ? ComparedView(light_field, triple.k + triple.step, triple.l) : cv::Mat();
  const cv::Mat down =
      triple.has_down ? ComparedView(light_field, triple.k, triple.l + triple.step) : cv::Mat();
  const Tiling tiling(from);
  std::vector<TileShifts> tiles;
  int lost = 0, showing = 0;
  for (int y = tiling.margin; y + tiling.edge + tiling.margin <= from.rows; y += tiling.edge / 2) {
    for (int x = tiling.margin; x + tiling.edge + tiling.margin <= from.cols;
         x += tiling.edge / 2) {
      ThrowIfCancelled();
      const std::optional<Shift> a =
          triple.has_across ? ShiftOf(from, across, x, y, tiling) : Shift{};
      const std::optional<Shift> b = triple.has_down ? ShiftOf(from, down, x, y, tiling) : Shift{};
      if (!a || !b) {
        ++lost;
        continue;
      }
      tiles.push_back({*a, *b});
      if (Square(*a) + Square(*b) >= kShows) ++showing;
    }
  }
  ViewOrderFinding finding;
  if (tiles.empty() && lost == 0) {
    finding.why = "the views are too small";
    return finding;
  }
  if (showing < kMinTiles) {
    finding.why = lost > static_cast<int>(tiles.size())
                      ? "the shifts between neighbouring views are too large to be followed"
                      : "the shifts between the views are too small, or the views have no details";
    return finding;
  }
  std::array<Fit, 4> fits;
  for (std::size_t i = 0; i < fits.size(); ++i) fits[i] = FitOf(tiles, Hypotheses()[i]);
  const bool is_line = !triple.has_across || !triple.has_down;
  std::size_t best = 0;
  for (std::size_t i = 1; i < fits.size(); ++i) {
    if (fits[i].cost < fits[best].cost) best = i;
  }
  // How well the best order explains the tiles that show a shift, compared with no shift.
  double unexplained = 0;
  for (const TileShifts& tile : tiles) {
    if (Square(tile.across) + Square(tile.down) < kShows) continue;
    const Hypothesis& hypothesis = Hypotheses()[best];
    if (CostOf(tile, hypothesis.across, fits[best].ratio * hypothesis.down) >= kMaxCost)
      ++unexplained;
  }
  if (2 * unexplained > showing) {
    finding.order = ViewOrder::kIrregular;
    return finding;
  }
  double second = std::numeric_limits<double>::infinity();
  for (std::size_t i = 0; i < fits.size(); ++i) {
    // A single row or column shows only its axis: i / 2.
    if (i != best && (!is_line || i / 2 != best / 2)) second = std::min(second, fits[i].cost);
  }
  if (second - fits[best].cost < kDecides) {
    finding.why = "the shifts between the views fit several orders";
    return finding;
  }
  finding.order = Hypotheses()[best].order;
  finding.step_ratio = fits[best].ratio;
  finding.is_line = is_line;
  SetDisparities(light_field, triple, tiles, fits[best].ratio, from.cols, &finding);
  return finding;
}

// ---- All steps.

// Some tiles from all over a view.
std::vector<cv::Point> CheckedTiles(const cv::Mat& view, const Tiling& tiling) {
  std::vector<cv::Point> all, tiles;
  for (int y = tiling.margin; y + tiling.edge + tiling.margin <= view.rows; y += tiling.edge) {
    for (int x = tiling.margin; x + tiling.edge + tiling.margin <= view.cols; x += tiling.edge)
      all.emplace_back(x, y);
  }
  const std::size_t stride = (all.size() + kCheckedTiles - 1) / kCheckedTiles;
  for (std::size_t i = 0; i < all.size(); i += stride) tiles.push_back(all[i]);
  return tiles;
}

// The tiles of a view in another; absent: lost.
std::vector<std::optional<Shift>> ShiftsOf(const cv::Mat& from, const cv::Mat& to,
                                           const std::vector<cv::Point>& tiles,
                                           const Tiling& tiling) {
  std::vector<std::optional<Shift>> shifts;
  for (const cv::Point& tile : tiles) {
    ThrowIfCancelled();
    shifts.push_back(ShiftOf(from, to, tile.x, tile.y, tiling));
  }
  return shifts;
}

double ShareWithoutMatch(const std::vector<std::optional<Shift>>& shifts) {
  if (shifts.empty()) return 0;
  const auto count = std::count_if(shifts.begin(), shifts.end(),
                                   [](const auto& shift) { return !shift || !shift->is_match; });
  return static_cast<double>(count) / static_cast<double>(shifts.size());
}

// Whether the shifts of tiles along two steps contradict one disparity for both. The directions are
// those of the order that the middle shows.
bool Contradicts(const std::vector<std::optional<Shift>>& first, const Vector2& along_first,
                 const std::vector<std::optional<Shift>>& second, const Vector2& along_second) {
  double cost = 0, flipped = 0, unexplained = 0;
  int showing = 0;
  for (std::size_t i = 0; i < first.size(); ++i) {
    if (!first[i] || !second[i]) continue;
    const TileShifts tile{*first[i], *second[i]};
    if (Square(tile.across) + Square(tile.down) < kShows) continue;
    ++showing;
    const double cost_of_tile = CostOf(tile, along_first, along_second);
    cost += cost_of_tile / kOverlap;
    flipped += CostOf(tile, along_first, -along_second) / kOverlap;
    if (cost_of_tile >= kMaxCost) ++unexplained;
  }
  return showing >= kMinTiles && (2 * unexplained > showing || flipped + kDecides < cost);
}

// Tests whether every view and its neighbours have the order that was found in the middle.
class StepCheck {
 public:
  StepCheck(const model::LightField& light_field, const Triple& middle, const Hypothesis& order,
            double ratio)
      : light_field_(light_field),
        step_(middle.step),
        across_(order.across),
        down_(ratio * order.down) {
    const cv::Mat from = ComparedView(light_field, middle.k, middle.l);
    const Tiling tiling(from);
    const std::vector<cv::Point> tiles = CheckedTiles(from, tiling);
    std::vector<std::vector<std::optional<Shift>>> shifts;
    for (const bool is_across : {true, false}) {
      if (!(is_across ? middle.has_across : middle.has_down)) continue;
      const cv::Mat to = ComparedView(light_field, middle.k + (is_across ? step_ : 0),
                                      middle.l + (is_across ? 0 : step_));
      shifts.push_back(ShiftsOf(from, to, tiles, tiling));
      usually_unlike_ = std::max(usually_unlike_, ShareWithoutMatch(shifts.back()));
    }
    // Fewer tiles are compared than those that decided: they may not suffice.
    usually_contradicts_ = shifts.size() == 2 && Contradicts(shifts[0], across_, shifts[1], down_);
  }

  // Whether the steps from this view fit the order.
  bool Fits(int k, int l) {
    const cv::Mat& from = ViewAt(k, l);
    const Tiling tiling(from);
    const std::vector<cv::Point> tiles = CheckedTiles(from, tiling);
    // The next view of each axis, or at its end the one before; of a single row or column both.
    std::vector<Vector2> directions;
    std::vector<std::vector<std::optional<Shift>>> shifts;
    const bool is_line = light_field_.u_count == 1 || light_field_.v_count == 1;
    for (const bool is_across : {true, false}) {
      bool has_one = false;
      for (const int sign : {1, -1}) {
        const int distance = sign * step_;
        const int to_k = k + (is_across ? distance : 0), to_l = l + (is_across ? 0 : distance);
        if ((has_one && !is_line) || !IsThere(to_k, to_l)) continue;
        has_one = true;
        shifts.push_back(ShiftsOf(from, ViewAt(to_k, to_l), tiles, tiling));
        directions.emplace_back(sign * (is_across ? across_ : down_));
        const bool is_unlike =
            ShareWithoutMatch(shifts.back()) > kUnlike && usually_unlike_ <= kUsuallyUnlike;
        if (is_unlike) return false;
      }
      if (step_ > 1 && has_one && !NearerFits(from, k, l, is_across, tiles)) return false;
    }
    return shifts.size() < 2 || usually_contradicts_ ||
           !Contradicts(shifts[0], directions[0], shifts[1], directions[1]);
  }

  // Forgets the views above this row that are not needed any more.
  void ForgetAbove(int row) {
    for (auto view = views_.begin(); view != views_.end();)
      view = view->first.first < row - step_ ? views_.erase(view) : std::next(view);
  }

 private:
  bool IsThere(int k, int l) const {
    return k >= 0 && l >= 0 && k < light_field_.u_count && l < light_field_.v_count &&
           light_field_.IsPresent(k, l);
  }
  // Where farther views than the neighbour decided: the neighbour shows the same scene, with a part
  // of the shift.
  bool NearerFits(const cv::Mat& from, int k, int l, bool is_across,
                  const std::vector<cv::Point>& tiles) {
    const int near_k = k + (is_across ? 1 : 0), near_l = l + (is_across ? 0 : 1);
    const int far_k = k + (is_across ? step_ : 0), far_l = l + (is_across ? 0 : step_);
    if (!IsThere(near_k, near_l)) return true;
    const Tiling tiling(from);
    const auto near = ShiftsOf(from, ViewAt(near_k, near_l), tiles, tiling);
    if (ShareWithoutMatch(near) > kUnlike && usually_unlike_ <= kUsuallyUnlike) return false;
    if (!IsThere(far_k, far_l)) return true;
    const auto far = ShiftsOf(from, ViewAt(far_k, far_l), tiles, tiling);
    const Vector2& direction = is_across ? across_ : down_;
    return !Contradicts(near, direction / step_, far, direction);
  }
  const cv::Mat& ViewAt(int k, int l) {
    cv::Mat& view = views_[{l, k}];
    if (view.empty()) view = ComparedView(light_field_, k, l);
    return view;
  }

  const model::LightField& light_field_;
  int step_ = 1;
  Vector2 across_, down_;
  double usually_unlike_ = 0;  // the largest share of tiles without a match in the middle
  bool usually_contradicts_ = false;
  std::map<std::pair<int, int>, cv::Mat> views_;
};

// An order that the other steps do not have is undecided.
ViewOrderFinding Checked(const model::LightField& light_field, const Triple& middle,
                         const ViewOrderFinding& finding) {
  const auto order =
      std::find_if(Hypotheses().begin(), Hypotheses().end(),
                   [&](const Hypothesis& hypothesis) { return hypothesis.order == finding.order; });
  if (order == Hypotheses().end()) return finding;
  StepCheck check(light_field, middle, *order, finding.step_ratio);
  std::vector<std::string> wrong;
  int tested = 0;
  for (int l = 0; l < light_field.v_count; ++l) {
    check.ForgetAbove(l);
    for (int k = 0; k < light_field.u_count; ++k) {
      if (!light_field.IsPresent(k, l)) continue;
      ++tested;
      if (!check.Fits(k, l)) wrong.push_back(fmt::format("({}, {})", k, l));
    }
  }
  if (static_cast<double>(wrong.size()) < std::max(2.0, kMayNotFit * tested)) return finding;
  ViewOrderFinding undecided;
  undecided.is_line = finding.is_line;
  undecided.why = fmt::format(
      "{} of {} views do not fit their neighbours as those in the middle do: {}; they may be in "
      "another order, or there may be another number of views",
      wrong.size(), tested, Listed(wrong));
  return undecided;
}

}  // namespace

ViewOrderFinding FindViewOrder(const model::LightField& light_field) {
  ViewOrderFinding finding;
  finding.why = light_field.u_count * light_field.v_count == 1
                    ? "there is one view"
                    : "no view has known neighbours across and down";
  // Small shifts show between views that are farther apart.
  for (int step = 1;; step *= 2) {
    const std::optional<Triple> triple = TripleInTheMiddle(light_field, step);
    if (!triple) return finding;
    ViewOrderFinding next = FindingOf(light_field, *triple);
    if (next.order != ViewOrder::kUndecided) {
      // Large shifts between distant views look irregular.
      if (next.order == ViewOrder::kIrregular && step > 1) return finding;
      return Checked(light_field, *triple, next);
    }
    finding = next;
  }
}

}  // namespace thicklens::io
