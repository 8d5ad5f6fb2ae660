#include "thicklens/io/full_scale.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <cstddef>

#include "thicklens/base/cancel.h"
#include "thicklens/base/error.h"

namespace thicklens::io {
namespace {

constexpr std::size_t kLevels = 65536;
constexpr int kContainerBits = 16, kMinBits = 8, kMaxBits = 14;
// Values from here on need more than 14 bits.
constexpr std::uint32_t kBeyondFourteenBits = 1U << kMaxBits;
// A share of this size at the highest value is clipping, as in calib/sweep/clipping.cc.
constexpr double kClippedShare = 0.001;
// A value that occurs so often has neighbours that occur too, unless values were stretched: a
// smooth histogram does not fall from 30 to 0 at one step by chance.
constexpr std::uint64_t kOften = 30;
constexpr std::size_t kEnoughValues = 16;
// Stretching 14 bits, the most that converters of cameras with small pixels have, to 16.
constexpr std::size_t kStretchedGap = 4;

int LowestBit(std::uint32_t set_bits) {
  int bit = 0;
  while (set_bits != 0 && (set_bits >> bit & 1U) == 0) ++bit;
  return bit;
}

// The values that occur often, in rising order.
std::vector<std::size_t> OftenUsed(const std::vector<std::uint64_t>& counts) {
  std::vector<std::size_t> used;
  for (std::size_t value = 0; value < counts.size(); ++value) {
    if (counts[value] >= kOften) used.push_back(value);
  }
  return used;
}

// The median distance from a value that occurs often to the next value that occurs at all; 0 if too
// few values occur often.
std::size_t TypicalGap(const std::vector<std::uint64_t>& counts) {
  const std::vector<std::size_t> used = OftenUsed(counts);
  if (used.size() < kEnoughValues) return 0;
  std::vector<std::size_t> gaps;
  for (const std::size_t value : used) {
    std::size_t next = value + 1;
    while (next < counts.size() && counts[next] == 0) ++next;
    if (next < counts.size()) gaps.push_back(next - value);
  }
  if (gaps.empty()) return 0;
  const auto middle = gaps.begin() + static_cast<std::ptrdiff_t>(gaps.size() / 2);
  std::nth_element(gaps.begin(), middle, gaps.end());
  return *middle;
}

int FewestBits(std::uint32_t highest) {
  int bits = kMinBits;
  while (bits < kMaxBits && highest >> bits != 0) bits += 2;
  return bits;
}

FullScaleFinding Undecided(std::uint32_t highest) {
  FullScaleFinding finding;
  finding.kind = FullScaleFinding::Kind::kUndecided;
  finding.bits = FewestBits(highest);
  finding.full_scale = (1 << finding.bits) - 1;
  std::vector<int> bits;
  for (int n = finding.bits; n <= kMaxBits; n += 2) bits.push_back(n);
  finding.reason = fmt::format(
      "values reach {} of 65535 and use every step: right-aligned values of {} bits in a container "
      "of 16, or dark frames of 16 bits; values alone do not show which, because nothing is "
      "clipped at {}",
      highest, fmt::join(bits, " or "), finding.full_scale);
  return finding;
}

}  // namespace

ValueCounter::ValueCounter() : counts_(kLevels, 0) {}

void ValueCounter::Add(const cv::Mat& frame, const std::string& name) {
  if (frame.depth() != CV_16U)
    throw Error(name + ": unsigned integers of 16 bits are expected in each frame of the sweep");
  const int channels = frame.channels();
  const bool has_alpha = channels == 2 || channels == 4;
  std::uint32_t highest = 0;
  for (int y = 0; y < frame.rows; ++y) {
    ThrowIfCancelled();
    const auto* row = frame.ptr<std::uint16_t>(y);
    for (int i = 0; i < frame.cols * channels; ++i) {
      if (has_alpha && i % channels == channels - 1) continue;
      ++counts_[row[i]];
      highest = std::max<std::uint32_t>(highest, row[i]);
      set_bits_ |= row[i];
    }
  }
  if (highest < highest_) return;
  // The share at the top of the scale is that of one frame: few frames are clipped.
  std::uint64_t here = 0, all = 0;
  for (int y = 0; y < frame.rows; ++y) {
    const auto* row = frame.ptr<std::uint16_t>(y);
    for (int i = 0; i < frame.cols * channels; ++i) {
      if (has_alpha && i % channels == channels - 1) continue;
      here += row[i] == highest ? 1U : 0U;
      ++all;
    }
  }
  const double share = all == 0 ? 0 : static_cast<double>(here) / static_cast<double>(all);
  if (highest > highest_ || share > most_at_highest_) {
    most_at_highest_ = share;
    frame_at_highest_ = name;
  }
  highest_ = highest;
}

bool ValueCounter::UsesWholeContainer() const {
  return highest_ >= kBeyondFourteenBits && (set_bits_ & 1U) != 0;
}

FullScaleFinding ValueCounter::Finding() const {
  FullScaleFinding finding;
  finding.reason = fmt::format("values reach {} of 65535", highest_);
  const int shift = LowestBit(set_bits_);
  const auto used =
      std::count_if(counts_.begin(), counts_.end(), [](std::uint64_t count) { return count > 0; });
  const bool has_enough = used >= static_cast<std::ptrdiff_t>(kEnoughValues);
  if (shift > 0 && kContainerBits - shift >= kMinBits && has_enough) {
    finding.kind = FullScaleFinding::Kind::kLeftAligned;
    finding.bits = kContainerBits - shift;
    finding.full_scale = static_cast<int>(kLevels) - (1 << shift);
    finding.reason = fmt::format("all values are multiples of {}", 1 << shift);
    return finding;
  }
  if (highest_ == 0 || highest_ >= kBeyondFourteenBits || shift > 0) return finding;
  for (int bits = kMinBits; bits <= kMaxBits; ++bits) {
    if (highest_ != (1U << bits) - 1 || most_at_highest_ <= kClippedShare) continue;
    finding.kind = FullScaleFinding::Kind::kRightAligned;
    finding.bits = bits;
    finding.full_scale = static_cast<int>(highest_);
    finding.reason = fmt::format("the scale ends at {}, which {:.2g} % of the values in {} have",
                                 highest_, 100 * most_at_highest_, frame_at_highest_);
    return finding;
  }
  const std::size_t gap = TypicalGap(counts_);
  if (gap >= kStretchedGap) {
    finding.reason = fmt::format(
        "values reach {} of 65535, and neighbouring ones are {} apart: fewer bits were stretched "
        "to 16",
        highest_, gap);
    return finding;
  }
  return Undecided(highest_);
}

cv::Mat ScaledToContainer(const cv::Mat& frame, int full_scale, const std::string& name) {
  const bool is_wide = frame.depth() == CV_16U;
  if (!is_wide && frame.depth() != CV_8U)
    throw Error(name + ": unsigned integers of 8 or 16 bits are expected for a full scale");
  const int most = is_wide ? 65535 : 255;
  if (full_scale < 1 || full_scale > most) {
    throw Error(fmt::format("{}: a full scale from 1 to {} is expected for its {} bits, found {}",
                            name, most, is_wide ? 16 : 8, full_scale));
  }
  if (full_scale == most) return frame;
  std::vector<std::uint16_t> scaled(static_cast<std::size_t>(full_scale) + 1);
  for (std::size_t value = 0; value < scaled.size(); ++value) {
    scaled[value] = static_cast<std::uint16_t>(
        std::floor(static_cast<double>(value) * 65535 / full_scale + 0.5));
  }
  cv::Mat result(frame.size(), CV_MAKETYPE(CV_16U, frame.channels()));
  for (int y = 0; y < frame.rows; ++y) {
    ThrowIfCancelled();
    auto* out = result.ptr<std::uint16_t>(y);
    for (int i = 0; i < frame.cols * frame.channels(); ++i) {
      const unsigned value = is_wide ? frame.ptr<std::uint16_t>(y)[i] : frame.ptr(y)[i];
      if (value > static_cast<unsigned>(full_scale)) {
        throw Error(fmt::format("{}: it has the value {}, above the full scale of {} ({} bits)",
                                name, value, full_scale, is_wide ? 16 : 8));
      }
      out[i] = scaled[value];
    }
  }
  return result;
}

}  // namespace thicklens::io
