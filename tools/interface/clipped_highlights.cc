#include "tools/interface/clipped_highlights.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <map>
#include <utility>
#include <variant>

#include "thicklens/base/cancel.h"
#include "thicklens/base/index.h"
#include "thicklens/estimator/scene_solver.h"

namespace thicklens {
namespace {

// Below full scale, at least so many values must be equal to the largest, so many times as many as
// at any of the next lower levels, and the level must be in the upper half.
constexpr std::size_t kMinValues = 20;
constexpr std::size_t kPileFactor = 8;
constexpr int kLevelsBelow = 10;
constexpr double kLowestLevel = 0.5;
// Separate areas at the largest level, of at least so many values each, that show it as a limit:
// that several objects have one brightness to the last level is no coincidence.
constexpr int kMinAreas = 3;
constexpr std::size_t kMinOfArea = 5;
// Expected number of values above the largest, for its noise, that is no coincidence; the noise of
// highlights may be below that of the photograph by this factor.
constexpr double kMinExpected = 15;
constexpr double kNoiseOfHighlights = 0.4;
// Linear light has no levels. Its texture looks like noise far below those of 8 bits.
constexpr double kLevelsOfLight = 255;
// Values between two safe points of a loop that does not run over rows.
constexpr std::size_t kValuesPerSafePoint = std::size_t{1} << 18U;

double NormalBelow(double x) { return std::erfc(-x / std::sqrt(2.0)) / 2; }

// Returns the least share of the values at the largest level that noise would lift to the next
// level, where the largest level is the commonest (so that the mean is at most half a level lower).
// `sigma`: in levels.
double ShareAbove(double sigma) {
  if (!(sigma > 0)) return 0;
  const double level = 1 / sigma;
  return (NormalBelow(2 * level) - NormalBelow(level)) / (NormalBelow(level) - 0.5);
}

// One channel as whole or real numbers, and what its largest values are like.
template <typename Value>
class Channel {
 public:
  Channel(const std::vector<Value>& values, int width_px, int height_px, int channels, int channel)
      : values_(values),
        width_px_(width_px),
        height_px_(height_px),
        channels_(channels),
        channel_(channel) {
    largest_ = At(0, 0);
    for (int y = 0; y < height_px_; ++y) {
      ThrowIfCancelled();
      for (int x = 0; x < width_px_; ++x) largest_ = std::max(largest_, At(x, y));
    }
    // The values near the largest: only these are counted one by one.
    for (int y = 0; y < height_px_; ++y) {
      ThrowIfCancelled();
      for (int x = 0; x < width_px_; ++x) {
        const Value value = At(x, y);
        if (counts_.size() > kLevelsBelow && value < counts_.begin()->first) continue;
        ++counts_[value];
        if (counts_.size() > kLevelsBelow + 1) counts_.erase(counts_.begin());
      }
    }
  }

  Value largest() const { return largest_; }
  std::size_t count() const { return counts_.rbegin()->second; }
  // Returns the number of values at the next lower level, or at the fullest of the next ten that
  // occur.
  std::size_t next_count() const {
    const auto next = std::next(counts_.rbegin());
    return next == counts_.rend() ? 0 : next->second;
  }
  std::size_t largest_count_below() const {
    std::size_t most = 0;
    for (auto level = std::next(counts_.rbegin()); level != counts_.rend(); ++level)
      most = std::max(most, level->second);
    return most;
  }
  bool is_piled_up() const {
    return count() >= kMinValues && count() >= kPileFactor * largest_count_below() &&
           counts_.size() > 1;
  }

  // Returns the number of connected areas of the largest value that are not small.
  int Areas() const {
    std::vector<char> was_seen(Index(width_px_) * Index(height_px_), 0);
    std::vector<std::size_t> open;
    int areas = 0;
    const auto visit = [&](int x, int y) {
      if (x < 0 || y < 0 || x >= width_px_ || y >= height_px_ || At(x, y) != largest_) return;
      const std::size_t pixel = Index(y) * Index(width_px_) + Index(x);
      if (was_seen[pixel] != 0) return;
      was_seen[pixel] = 1;
      open.push_back(pixel);
    };
    for (int y = 0; y < height_px_; ++y) {
      ThrowIfCancelled();
      for (int x = 0; x < width_px_; ++x) {
        visit(x, y);
        std::size_t size = 0;
        while (!open.empty()) {
          const auto at = static_cast<int>(open.back());
          open.pop_back();
          if (++size % kValuesPerSafePoint == 0) ThrowIfCancelled();
          const int i = at % width_px_, j = at / width_px_;
          visit(i - 1, j);
          visit(i + 1, j);
          visit(i, j - 1);
          visit(i, j + 1);
        }
        if (size >= kMinOfArea) ++areas;
      }
    }
    return areas;
  }

 private:
  Value At(int x, int y) const {
    return values_[(Index(y) * Index(width_px_) + Index(x)) * Index(channels_) + Index(channel_)];
  }

  const std::vector<Value>& values_;
  const int width_px_, height_px_, channels_, channel_;
  Value largest_{};
  std::map<Value, std::size_t> counts_;  // of the largest levels
};

// Alpha is no light.
int ColoursOf(const Image& photo) { return photo.channels() == 4 ? 3 : photo.channels(); }

// Returns the noise of the values that are below the largest of their channel, in encoded values.
template <typename Value>
double NoiseBelow(const Image& photo, const std::vector<Value>& values,
                  const std::vector<Value>& largest) {
  const auto channels = Index(photo.channels());
  std::vector<std::uint8_t> clipped(values.size(), 0);
  for (std::size_t i = 0; i < values.size(); ++i) {
    if (i % kValuesPerSafePoint == 0) ThrowIfCancelled();
    if (i % channels < largest.size() && values[i] == largest[i % channels]) clipped[i] = 1;
  }
  const TransferCurve transfer = photo.transfer().value_or(TransferCurve::Srgb());
  return estimator::EncodedNoiseSigma(photo.ToLight(transfer), transfer, clipped).value_or(0);
}

template <typename Value>
std::vector<Channel<Value>> ChannelsOf(const Image& photo, const std::vector<Value>& values) {
  std::vector<Channel<Value>> channels;
  for (int c = 0; c < ColoursOf(photo); ++c)
    channels.emplace_back(values, photo.width_px(), photo.height_px(), photo.channels(), c);
  return channels;
}

// Full scale is a limit of the type: a pile at it is enough. A single largest value is none,
// because images are often stretched to full scale.
PhotoClipping ClippingOfEncoded(const Image& photo) {
  const model::EncodedImage& image = photo.encoded();
  const double full_scale = image.full_scale();
  PhotoClipping found;
  found.levels.assign(Index(ColoursOf(photo)), 0);
  const auto channels = ChannelsOf(photo, image.values);
  std::vector<std::uint16_t> largest;
  for (const auto& channel : channels) largest.push_back(channel.largest());
  std::optional<double> noise;  // measured only where it decides
  for (std::size_t c = 0; c < channels.size(); ++c) {
    const Channel<std::uint16_t>& channel = channels[c];
    const double level = channel.largest() / full_scale;
    if (level == 1) {
      if (channel.count() >= 2 && channel.count() > channel.next_count()) found.levels[c] = 1;
      continue;
    }
    if (level < kLowestLevel || !channel.is_piled_up()) continue;
    bool is_limit = channel.Areas() >= kMinAreas;
    if (!is_limit) {
      if (!noise) noise = NoiseBelow(photo, image.values, largest);
      const double sigma = kNoiseOfHighlights * *noise * full_scale;
      is_limit = static_cast<double>(channel.count()) * ShareAbove(sigma) >= kMinExpected;
    }
    if (!is_limit) continue;
    found.levels[c] = level;
    found.at_full_scale = false;
  }
  return found;
}

// Real numbers have no full scale, and noise makes all of them different. A rendered image without
// noise may have one even area that is its brightest.
PhotoClipping ClippingOfLight(const Image& photo) {
  const model::LinearImage& image = photo.light();
  PhotoClipping found;
  found.levels.assign(Index(ColoursOf(photo)), 0);
  found.at_full_scale = false;
  const auto channels = ChannelsOf(photo, image.values);
  std::vector<float> largest;
  for (const auto& channel : channels) largest.push_back(channel.largest());
  std::optional<double> noise;  // measured only where it decides
  for (std::size_t c = 0; c < channels.size(); ++c) {
    const Channel<float>& channel = channels[c];
    if (!(channel.largest() > 0) || !channel.is_piled_up()) continue;
    bool is_limit = channel.Areas() >= kMinAreas;
    const bool is_continuous = channel.largest_count_below() <= 2;
    if (!is_limit && is_continuous) {
      if (!noise) noise = NoiseBelow(photo, image.values, largest);
      const double sigma = kNoiseOfHighlights * *noise * kLevelsOfLight;
      is_limit = static_cast<double>(channel.count()) * ShareAbove(sigma) >= kMinExpected;
    }
    if (is_limit) found.levels[c] = static_cast<double>(channel.largest());
  }
  return found;
}

double EncodedAt(const Image& photo, std::size_t i) {
  return photo.is_linear() ? static_cast<double>(photo.light().values[i])
                           : photo.encoded().values[i] / photo.encoded().full_scale();
}

// Returns whether each value is at the level at which its channel is clipped.
std::vector<float> MaskOf(const Image& photo, const PhotoClipping& clipping) {
  const auto channels = Index(photo.channels());
  std::vector<float> mask(Index(photo.width_px()) * Index(photo.height_px()) * channels, 0.0F);
  for (std::size_t i = 0; i < mask.size(); ++i) {
    if (i % kValuesPerSafePoint == 0) ThrowIfCancelled();
    const std::size_t c = i % channels;
    if (c >= clipping.levels.size() || clipping.levels[c] == 0) continue;
    if (EncodedAt(photo, i) >= clipping.levels[c]) mask[i] = 1;
  }
  return mask;
}

// Compression scatters the values of a clipped area about its level. Adds to the mask the values
// that are lower than the level by no more than `scatter` and touch one of the mask.
void GrowMask(const Image& photo, const PhotoClipping& clipping, double scatter,
              std::vector<float>* mask) {
  const auto channels = Index(photo.channels());
  std::vector<std::size_t> open;
  for (std::size_t i = 0; i < mask->size(); ++i) {
    if (i % kValuesPerSafePoint == 0) ThrowIfCancelled();
    if ((*mask)[i] != 0) open.push_back(i);
  }
  std::size_t steps = 0;
  while (!open.empty()) {
    // Each looks at nine values.
    if (++steps % (kValuesPerSafePoint / 16) == 0) ThrowIfCancelled();
    const std::size_t from = open.back();
    open.pop_back();
    const std::size_t channel = from % channels;
    const auto pixel = static_cast<int>(from / channels);
    const int x = pixel % photo.width_px(), y = pixel / photo.width_px();
    for (int j = std::max(0, y - 1); j <= std::min(photo.height_px() - 1, y + 1); ++j) {
      for (int i = std::max(0, x - 1); i <= std::min(photo.width_px() - 1, x + 1); ++i) {
        const std::size_t to = (Index(j) * Index(photo.width_px()) + Index(i)) * channels + channel;
        if ((*mask)[to] != 0 || EncodedAt(photo, to) < clipping.levels[channel] - scatter) continue;
        (*mask)[to] = 1;
        open.push_back(to);
      }
    }
  }
}

double ShareOf(const std::vector<float>& mask) {
  return static_cast<double>(std::count(mask.begin(), mask.end(), 1.0F)) /
         static_cast<double>(mask.size());
}

std::string LevelsInWords(const PhotoClipping& clipping) {
  static constexpr const char* kNames[] = {"red", "green", "blue"};
  constexpr double kEightBits = 255;
  if (std::all_of(clipping.levels.begin(), clipping.levels.end(),
                  [](double level) { return level == 1; })) {
    return "at full scale";
  }
  std::string text;
  for (std::size_t c = 0; c < clipping.levels.size(); ++c) {
    if (clipping.levels[c] == 0) continue;
    if (!text.empty()) text += ", ";
    if (clipping.levels.size() == 3) text += fmt::format("{} ", kNames[c]);
    text += clipping.levels[c] == 1 ? "at full scale"
                                    : fmt::format("at {:.4g}/255", kEightBits * clipping.levels[c]);
  }
  return text;
}

}  // namespace

PhotoClipping FindClipping(const Image& photo) {
  if (photo.is_empty()) return {};
  PhotoClipping found = photo.is_linear() ? ClippingOfLight(photo) : ClippingOfEncoded(photo);
  if (std::any_of(found.levels.begin(), found.levels.end(), [](double level) { return level > 0; }))
    found.share = ShareOf(MaskOf(photo, found));
  return found;
}

std::optional<Image> ClippedPartsOf(const Image& photo, EstimateDiagnostics* diagnostics) {
  diagnostics->clipping = FindClipping(photo);
  if (!(diagnostics->clipping.share > 0)) return std::nullopt;
  std::vector<float> mask = MaskOf(photo, diagnostics->clipping);
  constexpr double kLargestScatter = 4;  // in standard deviations of the compression
  const double scatter = kLargestScatter * diagnostics->compression_sigma.value_or(0);
  if (scatter > 0) {
    GrowMask(photo, diagnostics->clipping, scatter, &mask);
    diagnostics->clipping.share = ShareOf(mask);
  }
  return Image::FromLight(photo.width_px(), photo.height_px(), photo.order(), std::move(mask),
                          TransferCurve::Linear());
}

std::vector<std::uint8_t> MarksOf(const Image& clipped_parts) {
  constexpr float kTrace = 1e-3F;  // interpolation overshoots by less than this far away
  std::vector<std::uint8_t> marks;
  marks.reserve(clipped_parts.light().values.size());
  for (const float value : clipped_parts.light().values) {
    if (marks.size() % kValuesPerSafePoint == 0) ThrowIfCancelled();
    marks.push_back(std::abs(value) > kTrace ? 1 : 0);
  }
  return marks;
}

void LimitToMarks(const std::vector<std::uint8_t>& marks, PhotoClipping* clipping) {
  std::vector<std::size_t> counts(clipping->levels.size(), 0);
  for (std::size_t i = 0; i < marks.size(); ++i) {
    if (i % kValuesPerSafePoint == 0) ThrowIfCancelled();
    if (marks[i] != 0) ++counts[i % counts.size()];
  }
  std::size_t all = 0;
  for (std::size_t c = 0; c < counts.size(); ++c) {
    all += counts[c];
    if (counts[c] == 0) clipping->levels[c] = 0;
  }
  clipping->share = static_cast<double>(all) / static_cast<double>(marks.size());
}

void ReportClipping(const std::string& photo, const EstimateOptions& options,
                    const PhotoClipping& clipping, RunScope* run) {
  if (!(clipping.share > 0)) return;
  constexpr double kPercent = 100;
  const bool is_open = std::holds_alternative<SolverChooser>(options.solver);
  const std::string found = fmt::format("{}: {:.2g} % of its values are clipped ({})", photo,
                                        kPercent * clipping.share, LevelsInWords(clipping));
  if (options.clipped == ClippedHighlights::kData) {
    run->Warn(
        fmt::format("{}: they are taken as the light itself ({})", found, run->Option("clipped")));
  } else if (is_open) {
    run->Warn(
        fmt::format("{}: if the solver scene is chosen, the light there is at least that, and its "
                    "residual counts only below it; {} data, and every other solver, takes such "
                    "values as the light itself",
                    found, run->Option("clipped")));
  } else if (std::holds_alternative<SceneSolver>(options.solver)) {
    run->Warn(
        fmt::format("{}: the light there is at least that, and its residual counts only below it; "
                    "{} data takes "
                    "such values as the light itself",
                    found, run->Option("clipped")));
  } else {
    run->Warn(fmt::format(
        "{}: this solver takes them as the light itself, which makes highlights too dark and wide; "
        "the solver scene takes them as lower bounds",
        found));
  }
}

}  // namespace thicklens
