#include "thicklens/estimator/resample_depth.h"

#include <fmt/format.h>

#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>

#include "estimator/depth/depth_surfaces.h"
#include "thicklens/base/error.h"
#include "thicklens/base/index.h"
#include "thicklens/base/parallel.h"

namespace thicklens::estimator {
namespace {

constexpr float kHole = std::numeric_limits<float>::quiet_NaN();
// Around a pixel, in samples: those that its surfaces are fitted to lie in a square of this edge.
constexpr int kBlock = 4;
constexpr double kFitSigma = 0.8;       // of the weights of the fit, samples
constexpr double kFitRidge = 0.05;      // of its slope, relative to the weights' sum
constexpr int kRounds = 4;              // of the comparison with the photograph
constexpr double kPriorWeight = 2;      // of the bilinear weights, logarithm of a likelihood
constexpr double kNeighbourWeight = 2;  // of the pixels around, likewise
constexpr double kLargestEvidence = 4;  // of the light of one pixel, likewise
constexpr double kMinSigma = 0.004;     // of the light around a pixel, 1 at full scale

// ---- One pixel between the samples.

// The two surfaces that a pixel may have: its surface by the samples alone, and the next one.
struct Candidates {
  float first = kHole, second = kHole;
  float lead = 1;  // bilinear weight of the first less that of the second, 0 to 1
  bool is_hole = false;
};

struct Member {
  double x, y, weight, value;  // position relative to the pixel, samples
};

// The value at the pixel of the plane through the members, which is not allowed to leave their
// range by more than half of it.
float PlaneAt(const std::vector<Member>& members) {
  double sum = 0, mean = 0, low = members.front().value, high = low;
  for (const Member& m : members) {
    sum += m.weight;
    mean += m.weight * m.value;
    low = std::min(low, m.value);
    high = std::max(high, m.value);
  }
  mean /= sum;
  Eigen::Matrix3d normal = Eigen::Matrix3d::Zero();
  Eigen::Vector3d right = Eigen::Vector3d::Zero();
  for (const Member& m : members) {
    const Eigen::Vector3d place(1, m.x, m.y);
    normal += m.weight / sum * place * place.transpose();
    right += m.weight / sum * (m.value - mean) * place;
  }
  normal(1, 1) += kFitRidge;
  normal(2, 2) += kFitRidge;
  const double value = mean + normal.inverse().row(0).dot(right);
  const double slack = (high - low) / 2;
  return static_cast<float>(std::clamp(value, low - slack, high + slack));
}

// The samples of kBlock x kBlock around a position, in groups of one surface.
class Block {
 public:
  Block(const DepthSurfaces& map, int left, int top) : map_(map), left_(left), top_(top) {
    for (int n = 0; n < kBlock * kBlock; ++n) group_[Index(n)] = n;
    for (int y = 0; y < kBlock; ++y) {
      for (int x = 0; x < kBlock; ++x) Link(x, y);
    }
    for (int n = 0; n < kBlock * kBlock; ++n) group_[Index(n)] = RootOf(n);
  }

  bool Has(int x, int y) const {
    return left_ + x >= 0 && top_ + y >= 0 && left_ + x < map_.width() &&
           top_ + y < map_.height() && !std::isnan(map_.value(left_ + x, top_ + y));
  }
  int group(int x, int y) const { return group_[Index(y * kBlock + x)]; }

  std::vector<Member> MembersOf(int group, double s, double t) const {
    std::vector<Member> members;
    for (int y = 0; y < kBlock; ++y) {
      for (int x = 0; x < kBlock; ++x) {
        if (!Has(x, y) || this->group(x, y) != group) continue;
        const double dx = left_ + x - s, dy = top_ + y - t;
        const double near = std::exp(-(dx * dx + dy * dy) / (2 * kFitSigma * kFitSigma));
        members.push_back({dx, dy,
                           near * static_cast<double>(map_.weight(left_ + x, top_ + y)) + 1e-12,
                           static_cast<double>(map_.value(left_ + x, top_ + y))});
      }
    }
    return members;
  }

 private:
  int RootOf(int n) const {
    while (group_[Index(n)] != n) n = group_[Index(n)];
    return n;
  }
  void Link(int x, int y) {
    if (!Has(x, y)) return;
    for (std::size_t n = 0; n < DepthSurfaces::kSteps.size(); ++n) {
      const int to_x = x + DepthSurfaces::kSteps[n][0], to_y = y + DepthSurfaces::kSteps[n][1];
      if (to_x < 0 || to_x >= kBlock || to_y >= kBlock || !Has(to_x, to_y)) continue;
      if (!map_.IsLinked(left_ + x, top_ + y, n)) continue;
      const int a = RootOf(y * kBlock + x), b = RootOf(to_y * kBlock + to_x);
      group_[Index(std::max(a, b))] = std::min(a, b);
    }
  }

  const DepthSurfaces& map_;
  int left_, top_;
  std::array<int, static_cast<std::size_t>(kBlock) * kBlock> group_{};
};

// `s` and `t` are the pixel's position in samples.
Candidates CandidatesAt(const DepthSurfaces& map, const Block& block, int left, int top, double s,
                        double t) {
  const double u = s - (left + 1), v = t - (top + 1);  // 0 to 1 between the inner four
  std::array<double, static_cast<std::size_t>(kBlock) * kBlock> share{};
  double holes = 0, all = 0, bilinear = 0;
  int groups = 0, last = -1;
  for (int y = 0; y < 2; ++y) {
    for (int x = 0; x < 2; ++x) {
      const double area = (x == 0 ? 1 - u : u) * (y == 0 ? 1 - v : v);
      // Beyond the first or the last sample the nearest one stands for its neighbour.
      const int column = std::clamp(left + 1 + x, 0, map.width() - 1) - left;
      const int row = std::clamp(top + 1 + y, 0, map.height() - 1) - top;
      if (!block.Has(column, row)) {
        holes += area;
        continue;
      }
      const int group = block.group(column, row);
      if (group != last) ++groups;
      last = group;
      const double weight = area * static_cast<double>(map.weight(left + column, top + row));
      share[Index(group)] += weight;
      bilinear += weight * static_cast<double>(map.value(left + column, top + row));
      all += weight;
    }
  }
  Candidates found;
  if (holes > 0.5 || !(all > 0)) {
    found.is_hole = true;
    return found;
  }
  // Groups outside the inner four may reach the pixel as well.
  std::array<bool, static_cast<std::size_t>(kBlock) * kBlock> is_present{};
  for (int y = 0; y < kBlock; ++y) {
    for (int x = 0; x < kBlock; ++x) {
      if (block.Has(x, y)) is_present[Index(block.group(x, y))] = true;
    }
  }
  int first = -1, second = -1;
  double of_second = 0;
  const auto strength = [&](int group) {
    double near = 0;
    for (const Member& m : block.MembersOf(group, s, t)) near += m.weight;
    return share[Index(group)] / all + 1e-3 * near;
  };
  double of_first = 0;
  for (int group = 0; group < kBlock * kBlock; ++group) {
    if (!is_present[Index(group)]) continue;
    const double here = strength(group);
    if (first < 0 || here > of_first) {
      second = first;
      of_second = of_first;
      first = group;
      of_first = here;
    } else if (second < 0 || here > of_second) {
      second = group;
      of_second = here;
    }
  }
  const bool is_one = groups == 1 && holes == 0;
  found.first = is_one ? static_cast<float>(bilinear / all) : PlaneAt(block.MembersOf(first, s, t));
  if (second < 0) return found;
  found.second = PlaneAt(block.MembersOf(second, s, t));
  found.lead = static_cast<float>((share[Index(first)] - share[Index(second)]) / all);
  return found;
}

// The surface that fills most of a pixel that contains several samples, as the mean of its samples.
Candidates LargestSurfaceAt(const DepthSurfaces& map, double s, double t,
                            const Eigen::Vector2d& step) {
  const double half_s = 0.5 / step.x(), half_t = 0.5 / step.y();
  const auto first = [](double at, double half, int size) {
    return std::clamp(static_cast<int>(std::ceil(at - half)), 0, size - 1);
  };
  const auto last = [](double at, double half, int size) {
    return std::clamp(static_cast<int>(std::ceil(at + half)) - 1, 0, size - 1);
  };
  const int x0 = first(s, half_s, map.width()), x1 = std::max(x0, last(s, half_s, map.width()));
  const int y0 = first(t, half_t, map.height()), y1 = std::max(y0, last(t, half_t, map.height()));
  std::vector<std::pair<float, double>> inside;  // value and weight
  double all = 0;
  int holes = 0;
  for (int y = y0; y <= y1; ++y) {
    for (int x = x0; x <= x1; ++x) {
      if (std::isnan(map.value(x, y))) {
        ++holes;
        continue;
      }
      inside.emplace_back(map.value(x, y), static_cast<double>(map.weight(x, y)));
      all += inside.back().second;
    }
  }
  Candidates found;
  if (inside.empty() || holes > static_cast<int>(inside.size())) {
    found.is_hole = true;
    return found;
  }
  std::sort(inside.begin(), inside.end());
  // Runs of values without a jump between them; the heaviest one is the surface.
  double best = -1;
  for (std::size_t begin = 0; begin < inside.size();) {
    double weight = 0, sum = 0;
    std::size_t end = begin;
    do {
      weight += inside[end].second;
      sum += inside[end].second * static_cast<double>(inside[end].first);
      ++end;
    } while (end < inside.size() && inside[end].first - inside[end - 1].first <= map.jump());
    if (weight > best) {
      best = weight;
      found.first = static_cast<float>(sum / weight);
    }
    begin = end;
  }
  return found;
}

// ---- The whole photograph.

struct Draft {
  std::vector<Candidates> pixels;
  std::vector<std::size_t> between;  // pixels with two candidates
};

Draft DraftOf(const DepthSurfaces& map, const MapPlacement& place, int width_px, int height_px,
              int threads) {
  Draft draft;
  draft.pixels.resize(Index(width_px) * Index(height_px));
  const bool is_coarse = place.step_px.x() >= 1 && place.step_px.y() >= 1;
  ParallelFor(height_px, threads, [&](int y) {
    const double t = (y - place.first_px.y()) / place.step_px.y();
    for (int x = 0; x < width_px; ++x) {
      const double s = (x - place.first_px.x()) / place.step_px.x();
      Candidates& found = draft.pixels[Index(y) * Index(width_px) + Index(x)];
      constexpr double kBorder = 0.5 + 1e-9;
      if (s < -kBorder || t < -kBorder || s > map.width() - 1 + kBorder ||
          t > map.height() - 1 + kBorder) {
        found.is_hole = true;
        continue;
      }
      if (!is_coarse) {
        found = LargestSurfaceAt(map, s, t, place.step_px);
        continue;
      }
      const int left = static_cast<int>(std::floor(s)) - 1;
      const int top = static_cast<int>(std::floor(t)) - 1;
      found = CandidatesAt(map, Block(map, left, top), left, top, s, t);
    }
  });
  for (std::size_t i = 0; i < draft.pixels.size(); ++i) {
    if (!draft.pixels[i].is_hole && !std::isnan(draft.pixels[i].second)) draft.between.push_back(i);
  }
  return draft;
}

// The light around a pixel on each of its two surfaces.
class LightOfSurfaces {
 public:
  LightOfSurfaces(const model::LinearImage& photo, const MapPlacement& place) : photo_(photo) {
    constexpr double kLargestReach = 24;
    const double reach = std::min(1.5 * place.step_px.maxCoeff(), kLargestReach);
    reach_ = std::max(2, static_cast<int>(std::ceil(reach)));
    stride_ = std::max(1, reach_ / 6);
    sigma_ = reach_ / 2.0;
  }

  // The logarithm of how much likelier the light of pixel i is on the surface `first` than on
  // `second`. `current`: the value of each pixel as decided so far.
  double Evidence(std::size_t i, float first, float second,
                  const std::vector<float>& current) const {
    const int width = photo_.width_px, x = static_cast<int>(i % Index(width));
    const int y = static_cast<int>(i / Index(width));
    const int channels = std::min(photo_.channels, 3);
    double weights[2] = {0, 0}, sums[2][3] = {}, squares[2] = {0, 0};
    const float limit = std::abs(first - second) / 3;
    for (int v = -reach_; v <= reach_; v += stride_) {
      if (y + v < 0 || y + v >= photo_.height_px) continue;
      for (int u = -reach_; u <= reach_; u += stride_) {
        if (x + u < 0 || x + u >= width || (u == 0 && v == 0)) continue;
        const std::size_t at = Index(y + v) * Index(width) + Index(x + u);
        const float value = current[at];
        int side = -1;
        if (std::abs(value - first) < limit) side = 0;
        if (std::abs(value - second) < limit) side = 1;
        if (side < 0) continue;
        const double w = std::exp(-(u * u + v * v) / (2 * sigma_ * sigma_));
        weights[side] += w;
        for (int c = 0; c < channels; ++c) {
          const auto light = static_cast<double>(photo_.at(x + u, y + v, c));
          sums[side][c] += w * light;
          squares[side] += w * light * light;
        }
      }
    }
    constexpr double kMinWeight = 1;
    if (!(weights[0] > kMinWeight && weights[1] > kMinWeight)) return 0;
    double distance[2] = {0, 0};
    for (int side = 0; side < 2; ++side) {
      for (int c = 0; c < channels; ++c) {
        const double mean = sums[side][c] / weights[side];
        squares[side] -= mean * sums[side][c];
        const double off = static_cast<double>(photo_.at(x, y, c)) - mean;
        distance[side] += off * off;
      }
    }
    double evidence = 0;
    for (int side = 0; side < 2; ++side) {
      const double variance =
          std::max(squares[side], 0.0) / weights[side] / channels + kMinSigma * kMinSigma;
      const double here = -distance[side] / (2 * variance) - channels / 2.0 * std::log(variance);
      evidence += side == 0 ? here : -here;
    }
    return std::clamp(evidence, -kLargestEvidence, kLargestEvidence);
  }

 private:
  const model::LinearImage& photo_;
  int reach_ = 2, stride_ = 1;
  double sigma_ = 1;
};

// Which of the two surfaces the pixels around have, -1 (all the second) to 1.
double NeighboursFor(const Candidates& own, std::size_t i, const std::vector<float>& current,
                     int width, int height) {
  const int x = static_cast<int>(i % Index(width)), y = static_cast<int>(i / Index(width));
  double sum = 0, all = 0;
  const float middle = (own.first + own.second) / 2;
  for (int v = -1; v <= 1; ++v) {
    for (int u = -1; u <= 1; ++u) {
      if ((u == 0 && v == 0) || x + u < 0 || y + v < 0 || x + u >= width || y + v >= height)
        continue;
      const float value = current[Index(y + v) * Index(width) + Index(x + u)];
      if (std::isnan(value)) continue;
      sum += (value > middle) == (own.first > middle) ? 1 : -1;
      all += 1;
    }
  }
  return all > 0 ? sum / all : 0;
}

std::vector<float> FirstOf(const Draft& draft) {
  std::vector<float> values(draft.pixels.size(), kHole);
  for (std::size_t i = 0; i < values.size(); ++i) {
    if (!draft.pixels[i].is_hole) values[i] = draft.pixels[i].first;
  }
  return values;
}

// The work on the pixels between two surfaces, by parts that the threads share.
template <typename Work>
void ForEachBetween(const Draft& draft, int threads, const Work& work) {
  constexpr std::size_t kPart = 4096;
  const auto parts = static_cast<int>((draft.between.size() + kPart - 1) / kPart);
  ParallelFor(parts, threads, [&](int part) {
    const std::size_t end = std::min(draft.between.size(), (Index(part) + 1) * kPart);
    for (std::size_t n = Index(part) * kPart; n < end; ++n) work(n, draft.between[n]);
  });
}

void RequireFitting(const DepthSampling& map, const model::LinearImage& photo,
                    const MapPlacement& place) {
  const std::size_t count = Index(std::max(map.width_px, 0)) * Index(std::max(map.height_px, 0));
  if (count == 0 || map.values.size() != count ||
      (!map.confidence.empty() && map.confidence.size() != count)) {
    throw Error(fmt::format(
        "a depth map of {} x {} px has {} values and {} numbers of confidence: the sizes must fit",
        map.width_px, map.height_px, map.values.size(), map.confidence.size()));
  }
  if (photo.width_px < 1 || photo.height_px < 1 ||
      photo.values.size() !=
          Index(photo.width_px) * Index(photo.height_px) * Index(photo.channels)) {
    throw Error("the photograph that guides a depth map has no pixels, or not those of its size");
  }
  if (!(place.step_px.minCoeff() > 0) || !place.step_px.allFinite() ||
      !place.first_px.allFinite()) {
    throw Error(
        fmt::format("the samples of a depth map are {} and {} px apart: a finite number > "
                    "0 is expected",
                    place.step_px.x(), place.step_px.y()));
  }
}

// The bilinear mean of the confidence, of the samples that are no holes.
std::vector<float> ConfidenceOf(const DepthSurfaces& map, const MapPlacement& place, int width_px,
                                int height_px, int threads) {
  std::vector<float> found(Index(width_px) * Index(height_px), 0.0F);
  ParallelFor(height_px, threads, [&](int y) {
    const double t = std::clamp((y - place.first_px.y()) / place.step_px.y(), 0.0,
                                static_cast<double>(map.height() - 1));
    const int row = std::min(static_cast<int>(t), std::max(map.height() - 2, 0));
    const int below = std::min(row + 1, map.height() - 1);
    for (int x = 0; x < width_px; ++x) {
      const double s = std::clamp((x - place.first_px.x()) / place.step_px.x(), 0.0,
                                  static_cast<double>(map.width() - 1));
      const int column = std::min(static_cast<int>(s), std::max(map.width() - 2, 0));
      const int right = std::min(column + 1, map.width() - 1);
      const double u = s - column, v = t - row;
      found[Index(y) * Index(width_px) + Index(x)] =
          static_cast<float>((1 - v) * ((1 - u) * static_cast<double>(map.weight(column, row)) +
                                        u * static_cast<double>(map.weight(right, row))) +
                             v * ((1 - u) * static_cast<double>(map.weight(column, below)) +
                                  u * static_cast<double>(map.weight(right, below))));
    }
  });
  return found;
}

}  // namespace

MapPlacement PlaceOn(const Eigen::Vector2d& corner_px, const Eigen::Vector2d& size_px, int width_px,
                     int height_px) {
  MapPlacement place;
  place.step_px = size_px.cwiseQuotient(Eigen::Vector2d(width_px, height_px));
  place.first_px = corner_px + place.step_px / 2 - Eigen::Vector2d(0.5, 0.5);
  return place;
}

ResampledDepth ResampleDepth(const DepthSampling& map, const model::LinearImage& photo,
                             const MapPlacement& placement, int threads) {
  RequireFitting(map, photo, placement);
  threads = ResolveThreads(threads);
  const DepthSurfaces surfaces(map);
  const Draft draft = DraftOf(surfaces, placement, photo.width_px, photo.height_px, threads);
  ResampledDepth result;
  result.mixed_samples = surfaces.mixed();
  result.values = FirstOf(draft);
  if (!map.confidence.empty()) {
    result.confidence = ConfidenceOf(surfaces, placement, photo.width_px, photo.height_px, threads);
  }
  const LightOfSurfaces light(photo, placement);
  std::vector<float> decided(draft.between.size());
  for (int round = 0; round < kRounds; ++round) {
    // All decide by the values of the round before, so that their order does not matter.
    ForEachBetween(draft, threads, [&](std::size_t n, std::size_t i) {
      const Candidates& own = draft.pixels[i];
      const double score =
          kPriorWeight * static_cast<double>(own.lead) +
          light.Evidence(i, own.first, own.second, result.values) +
          kNeighbourWeight * NeighboursFor(own, i, result.values, photo.width_px, photo.height_px);
      decided[n] = score >= 0 ? own.first : own.second;
    });
    for (std::size_t n = 0; n < decided.size(); ++n) result.values[draft.between[n]] = decided[n];
  }
  std::size_t moved = 0;
  for (const std::size_t i : draft.between) {
    if (result.values[i] != draft.pixels[i].first) ++moved;
  }
  const auto all = static_cast<double>(draft.pixels.size());
  result.between_share = static_cast<double>(draft.between.size()) / all;
  result.moved_share = static_cast<double>(moved) / all;
  return result;
}

EdgeAgreement AgreementOf(const DepthSampling& map, const model::LinearImage& photo,
                          const MapPlacement& placement, int threads) {
  RequireFitting(map, photo, placement);
  threads = ResolveThreads(threads);
  const DepthSurfaces surfaces(map);
  const Draft draft = DraftOf(surfaces, placement, photo.width_px, photo.height_px, threads);
  const std::vector<float> values = FirstOf(draft);
  const LightOfSurfaces light(photo, placement);
  std::vector<double> evidence(draft.between.size());
  ForEachBetween(draft, threads, [&](std::size_t n, std::size_t i) {
    evidence[n] = light.Evidence(i, draft.pixels[i].first, draft.pixels[i].second, values);
  });
  constexpr int kTiles = 16;  // along the longer side
  const int tile_px =
      std::max(1, (std::max(photo.width_px, photo.height_px) + kTiles - 1) / kTiles);
  EdgeAgreement agreement;
  agreement.sums.assign(Index(kTiles) * kTiles, 0.0);
  agreement.counts.assign(Index(kTiles) * kTiles, 0);
  for (std::size_t n = 0; n < evidence.size(); ++n) {
    const std::size_t i = draft.between[n];
    const std::size_t tile = i / Index(photo.width_px) / Index(tile_px) * kTiles +
                             i % Index(photo.width_px) / Index(tile_px);
    agreement.sums[tile] += evidence[n];
    ++agreement.counts[tile];
  }
  return agreement;
}

double SigmaBetter(const EdgeAgreement& first, const EdgeAgreement& second) {
  std::vector<double> differences;
  for (std::size_t n = 0; n < first.sums.size(); ++n) {
    if (first.counts[n] == 0 || second.counts[n] == 0) continue;
    differences.push_back(second.sums[n] / static_cast<double>(second.counts[n]) -
                          first.sums[n] / static_cast<double>(first.counts[n]));
  }
  constexpr std::size_t kMinTiles = 8;
  if (differences.size() < kMinTiles) return 0;
  const auto count = static_cast<double>(differences.size());
  double mean = 0, scatter = 0;
  for (const double difference : differences) mean += difference / count;
  for (const double difference : differences) scatter += (difference - mean) * (difference - mean);
  const double error = std::sqrt(scatter / (count * (count - 1)));
  return error > 0 ? mean / error : 0;
}

}  // namespace thicklens::estimator
