#include "calib/uncertainty/relief_parts.h"

#include <fmt/format.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <numeric>

#include "thicklens/base/statistics.h"

namespace thicklens::calib {
namespace {

constexpr std::size_t kMinZones = 9;
constexpr int kMinOfPart = 3;
constexpr std::size_t kMaxParts = 8;
constexpr double kCeiling = 16;        // of the square of a deviation
constexpr double kMinError = 0.1;      // of a step
constexpr double kWithin = 4;          // errors from the depth of a zone's part
constexpr double kApartInSteps = 0.7;  // distance of two depths
constexpr double kApartInErrors = 6;
constexpr double kRough = 3;        // cost per zone of a smooth field, above which it is none
constexpr double kFarBetter = 0.5;  // ratio of the costs
constexpr int kRounds = 8;          // of the robust fit

struct Zone {
  std::size_t index = 0;  // in the grid
  double x = 0, y = 0;    // place, -1 to 1
  double value_mm = 0, error_mm = 0;
  int part = -1;
};

std::vector<Zone> ZonesOf(const ReliefFinding& finding, double step_mm) {
  std::vector<Zone> zones;
  for (std::size_t i = 0; i < finding.sharpest_mm.size(); ++i) {
    const auto& sharpest = finding.sharpest_mm[i];
    if (!sharpest) continue;
    const int column = static_cast<int>(i) % finding.columns;
    const int row = static_cast<int>(i) / finding.columns;
    Zone zone;
    zone.index = i;
    zone.x = finding.columns > 1 ? 2.0 * column / (finding.columns - 1) - 1 : 0;
    zone.y = finding.rows > 1 ? 2.0 * row / (finding.rows - 1) - 1 : 0;
    zone.value_mm = sharpest->value;
    zone.error_mm = std::max(sharpest->sigma, kMinError * step_mm);
    zones.push_back(zone);
  }
  return zones;
}

// Half of the zones differ from their right or lower neighbour by less than the scatter makes,
// because a part has more zones inside than at its border: their errors are at least that scatter.
void WidenToScatter(const ReliefFinding& finding, std::vector<Zone>* zones) {
  constexpr double kMedianOfDifference = 0.6745 * 1.4142;  // of two values with sigma 1
  std::vector<double> differences_mm;
  const auto add = [&](int column, int row, const Zone& zone) {
    if (column >= finding.columns || row >= finding.rows) return;
    const auto& other =
        finding.sharpest_mm[static_cast<std::size_t>(row * finding.columns + column)];
    if (other) differences_mm.push_back(std::abs(other->value - zone.value_mm));
  };
  for (const Zone& zone : *zones) {
    const int column = static_cast<int>(zone.index) % finding.columns;
    const int row = static_cast<int>(zone.index) / finding.columns;
    add(column + 1, row, zone);
    add(column, row + 1, zone);
  }
  const double scatter_mm = Median(differences_mm) / kMedianOfDifference;
  for (Zone& zone : *zones) zone.error_mm = std::max(zone.error_mm, scatter_mm);
}

double CostOfDeviation(double deviation_mm, const Zone& zone) {
  return std::min(std::pow(deviation_mm / zone.error_mm, 2), kCeiling);
}

// Weights 1/(1 + r^2/4) (Cauchy), renewed a few times from the fit by all zones. Of this start and
// that from the zones near the median, the better one counts.
double CostOfSmoothField(const std::vector<Zone>& zones) {
  const auto n = static_cast<Eigen::Index>(zones.size());
  Eigen::MatrixXd design(n, 6);
  Eigen::VectorXd values(n), errors(n);
  for (Eigen::Index i = 0; i < n; ++i) {
    const Zone& zone = zones[static_cast<std::size_t>(i)];
    design.row(i) << 1, zone.x, zone.y, zone.x * zone.x, zone.x * zone.y, zone.y * zone.y;
    values[i] = zone.value_mm;
    errors[i] = zone.error_mm;
  }
  const double median_mm = Median({values.data(), values.data() + n});
  double least = kCeiling * static_cast<double>(n);
  for (const bool from_median : {false, true}) {
    Eigen::VectorXd deviations = from_median
                                     ? Eigen::VectorXd((values.array() - median_mm).matrix())
                                     : Eigen::VectorXd(Eigen::VectorXd::Zero(n));
    for (int round = 0; round < kRounds; ++round) {
      const Eigen::ArrayXd r = deviations.array() / errors.array();
      const Eigen::VectorXd weight = (1 / (errors.array() * (1 + r.square() / 4).sqrt())).matrix();
      const Eigen::VectorXd c =
          (weight.asDiagonal() * design).colPivHouseholderQr().solve(weight.cwiseProduct(values));
      deviations = values - design * c;
    }
    double cost = 0;
    for (Eigen::Index i = 0; i < n; ++i)
      cost += CostOfDeviation(deviations[i], zones[static_cast<std::size_t>(i)]);
    least = std::min(least, cost);
  }
  return least;
}

struct Depth {
  double value_mm = 0, sigma_mm = 0;
  int count = 0;
};

// The mean of the zones that belong to a part.
Depth MeanOf(const std::vector<Zone>& zones, int part) {
  Depth depth;
  double weights = 0, squares = 0;
  for (const Zone& zone : zones) {
    if (zone.part != part) continue;
    const double weight = 1 / (zone.error_mm * zone.error_mm);
    depth.value_mm += weight * zone.value_mm;
    weights += weight;
    ++depth.count;
  }
  if (depth.count == 0) return depth;
  depth.value_mm /= weights;
  for (const Zone& zone : zones) {
    if (zone.part == part) squares += std::pow((zone.value_mm - depth.value_mm) / zone.error_mm, 2);
  }
  const double scatter = std::sqrt(std::max(1.0, squares / std::max(1, depth.count - 1)));
  depth.sigma_mm = scatter / std::sqrt(weights);
  return depth;
}

// A zone without a neighbour in its part shows a step or an accident.
void RemoveLoneZones(const ReliefFinding& finding, int part, std::vector<Zone>* zones) {
  std::vector<int> of_grid(finding.sharpest_mm.size(), -1);
  for (const Zone& zone : *zones) of_grid[zone.index] = zone.part;
  for (Zone& zone : *zones) {
    if (zone.part != part) continue;
    const int column = static_cast<int>(zone.index) % finding.columns;
    const int row = static_cast<int>(zone.index) / finding.columns;
    const auto belongs = [&](int x, int y) {
      return x >= 0 && y >= 0 && x < finding.columns && y < finding.rows &&
             of_grid[static_cast<std::size_t>(y * finding.columns + x)] == part;
    };
    if (!belongs(column - 1, row) && !belongs(column + 1, row) && !belongs(column, row - 1) &&
        !belongs(column, row + 1))
      zone.part = -1;
  }
}

// Takes the depth that the most zones share, then the next one among the rest.
std::vector<Depth> TakeParts(const ReliefFinding& finding, double step_mm,
                             std::vector<Zone>* zones) {
  std::vector<Depth> depths;
  std::vector<bool> was_tried(zones->size(), false);
  while (depths.size() < kMaxParts) {
    int most = 0;
    std::size_t middle = 0;
    for (std::size_t i = 0; i < zones->size(); ++i) {
      const Zone& here = (*zones)[i];
      if (here.part >= 0 || was_tried[i]) continue;
      const auto count = std::count_if(zones->begin(), zones->end(), [&](const Zone& zone) {
        return zone.part < 0 && std::abs(zone.value_mm - here.value_mm) <
                                    kWithin * std::max(zone.error_mm, here.error_mm);
      });
      if (count <= most) continue;
      most = static_cast<int>(count);
      middle = i;
    }
    if (most < kMinOfPart) break;
    was_tried[middle] = true;
    const int part = static_cast<int>(depths.size());
    double value_mm = (*zones)[middle].value_mm;
    for (int round = 0; round < 3; ++round) {
      for (Zone& zone : *zones) {
        if (zone.part == part) zone.part = -1;
        if (zone.part < 0 && std::abs(zone.value_mm - value_mm) < kWithin * zone.error_mm)
          zone.part = part;
      }
      if (MeanOf(*zones, part).count == 0) break;
      value_mm = MeanOf(*zones, part).value_mm;
    }
    RemoveLoneZones(finding, part, zones);
    const Depth depth = MeanOf(*zones, part);
    const bool is_apart = std::all_of(depths.begin(), depths.end(), [&](const Depth& other) {
      return std::abs(other.value_mm - depth.value_mm) >
             std::max(kApartInSteps * step_mm,
                      kApartInErrors * std::hypot(other.sigma_mm, depth.sigma_mm));
    });
    if (depth.count >= kMinOfPart && is_apart) {
      depths.push_back(depth);
      continue;
    }
    for (Zone& zone : *zones) {
      if (zone.part == part) zone.part = -1;
    }
  }
  return depths;
}

// The number of neighbouring zones that belong to different parts.
int BordersBetweenParts(const ReliefFinding& finding) {
  int borders = 0;
  for (int y = 0; y < finding.rows; ++y) {
    for (int x = 0; x < finding.columns; ++x) {
      const auto of = [&](int column, int row) {
        return finding.part_of_zone[static_cast<std::size_t>(row * finding.columns + column)];
      };
      if (of(x, y) < 0) continue;
      const bool ends_right =
          x + 1 < finding.columns && of(x + 1, y) >= 0 && of(x + 1, y) != of(x, y);
      const bool ends_below = y + 1 < finding.rows && of(x, y + 1) >= 0 && of(x, y + 1) != of(x, y);
      borders += (ends_right ? 1 : 0) + (ends_below ? 1 : 0);
    }
  }
  return borders;
}

}  // namespace

void DivideByDepth(double step_mm, double toward_camera, ReliefFinding* finding) {
  std::vector<Zone> zones = ZonesOf(*finding, step_mm);
  finding->part_of_zone.assign(finding->sharpest_mm.size(), -1);
  if (zones.size() < kMinZones) {
    finding->message = fmt::format(
        "{} zones of the field come into focus within the sweep, but {} "
        "are needed",
        zones.size(), kMinZones);
    return;
  }
  WidenToScatter(*finding, &zones);
  finding->measured = true;
  finding->message = "done";
  const auto n = static_cast<double>(zones.size());
  const double smooth = CostOfSmoothField(zones);
  const std::vector<Depth> depths = TakeParts(*finding, step_mm, &zones);
  for (const Zone& zone : zones) finding->part_of_zone[zone.index] = zone.part;
  double steps = 2 * BordersBetweenParts(*finding) *
                 std::log(std::max<double>(1, static_cast<double>(depths.size())));
  for (const Zone& zone : zones) {
    steps += zone.part < 0
                 ? kCeiling
                 : CostOfDeviation(
                       zone.value_mm - depths[static_cast<std::size_t>(zone.part)].value_mm, zone);
  }
  for (const Depth& depth : depths) {
    ReliefPart part;
    part.nearer_mm = {toward_camera * (depth.value_mm - depths[0].value_mm),
                      std::hypot(depth.sigma_mm, depths[0].sigma_mm)};
    part.share = depth.count / n;
    finding->parts.push_back(part);
  }
  if (!finding->parts.empty()) finding->parts[0].nearer_mm.sigma = 0;
  finding->is_relief = depths.size() > 1 && smooth > kRough * n && steps < kFarBetter * smooth;
}

cv::Rect LargestRectangle(const ReliefFinding& finding, int* part) {
  cv::Rect largest;
  const auto of = [&](int x, int y) {
    return finding.part_of_zone[static_cast<std::size_t>(y * finding.columns + x)];
  };
  for (int top = 0; top < finding.rows; ++top) {
    for (int left = 0; left < finding.columns; ++left) {
      const int here = of(left, top);
      if (here < 0) continue;
      int width = finding.columns - left;
      for (int y = top; y < finding.rows; ++y) {
        int reach = 0;
        while (reach < width && of(left + reach, y) == here) ++reach;
        width = reach;
        if (width == 0) break;
        const cv::Rect rectangle(left, top, width, y - top + 1);
        if (rectangle.area() <= largest.area()) continue;
        largest = rectangle;
        *part = here;
      }
    }
  }
  return largest;
}

void MakeFirst(int part, ReliefFinding* finding) {
  std::vector<ReliefPart>& parts = finding->parts;
  if (part <= 0 || part >= static_cast<int>(parts.size())) return;
  const double before_mm = parts[static_cast<std::size_t>(part)].nearer_mm.value;
  const double sigma_mm = parts[static_cast<std::size_t>(part)].nearer_mm.sigma;
  parts[0].nearer_mm.sigma = sigma_mm;
  std::swap(parts[0], parts[static_cast<std::size_t>(part)]);
  for (ReliefPart& other : parts) other.nearer_mm.value -= before_mm;
  parts[0].nearer_mm = {0, 0};
  for (int& of_zone : finding->part_of_zone) {
    if (of_zone == 0)
      of_zone = part;
    else if (of_zone == part)
      of_zone = 0;
  }
}

std::string PartsInWords(const ReliefFinding& finding) {
  std::string words;
  for (std::size_t i = 0; i < finding.parts.size(); ++i) {
    const ReliefPart& part = finding.parts[i];
    const auto letter = static_cast<char>('a' + i);
    words += i == 0
                 ? fmt::format("a: {:.0f} % of the zones", 100 * part.share)
                 : fmt::format(", {}: {:.2f} +- {:.2f} mm {} ({:.0f} %)", letter,
                               std::abs(part.nearer_mm.value), part.nearer_mm.sigma,
                               part.nearer_mm.value > 0 ? "nearer" : "farther", 100 * part.share);
  }
  return words;
}

}  // namespace thicklens::calib
