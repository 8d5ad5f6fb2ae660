#include "thicklens/model/target_texture.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <random>

#include "thicklens/base/cancel.h"

namespace thicklens::model {
namespace {

constexpr double kLargestLeaf = 0.1;  // radius relative to the pattern's shorter side
constexpr double kSamplesPerFeature = 6;
constexpr double kOpenAtEnd = 1e-3;
constexpr int kDarkestGrey = 51;     // 0.2 of full scale
constexpr int kBrightestGrey = 230;  // 0.9
constexpr int kTriesPerLook = 4096;

// Uniform in [0, 1), from the upper 53 bits; the standard specifies the numbers of the engine but
// not those of its distributions.
class Draws {
 public:
  explicit Draws(std::uint64_t seed) : engine_(seed) {}
  double Uniform() { return static_cast<double>(engine_() >> 11) * 0x1p-53; }

 private:
  std::mt19937_64 engine_;
};

// Tracks which points of a fine grid over the pattern are still uncovered while leaves are laid
// from the front backward.
class Openings {
 public:
  Openings(const SheetRectangle& pattern, double spacing_mm)
      : pattern_(pattern),
        spacing_mm_(spacing_mm),
        columns_(static_cast<int>(std::ceil(pattern.width / spacing_mm))),
        rows_(static_cast<int>(std::ceil(pattern.height / spacing_mm))),
        open_(static_cast<std::size_t>(columns_) * static_cast<std::size_t>(rows_), 1),
        left_(open_.size()) {}

  double OpenPart() const { return static_cast<double>(left_) / static_cast<double>(open_.size()); }

  // Covers the points of an area, and returns whether any of them was still uncovered.
  bool Close(const SheetRectangle& area) {
    bool was_open = false;
    for (int row = FirstRow(area.y); row <= LastRow(area.y + area.height); ++row)
      was_open |= CloseRow(row, area.x, area.x + area.width);
    return was_open;
  }
  bool Close(const TargetLeaf& leaf) {
    bool was_open = false;
    const int last = LastRow(leaf.y_mm + leaf.radius_mm);
    for (int row = FirstRow(leaf.y_mm - leaf.radius_mm); row <= last; ++row) {
      const double dy_mm = pattern_.y + (row + 0.5) * spacing_mm_ - leaf.y_mm;
      const double square = leaf.radius_mm * leaf.radius_mm - dy_mm * dy_mm;
      if (!(square > 0)) continue;
      const double half_chord_mm = std::sqrt(square);
      was_open |= CloseRow(row, leaf.x_mm - half_chord_mm, leaf.x_mm + half_chord_mm);
    }
    return was_open;
  }

 private:
  // Grid points lie in the middle of their cells.
  int FirstAt(double from_mm) const {
    return std::max(0, static_cast<int>(std::ceil(from_mm / spacing_mm_ - 0.5)));
  }
  int LastAt(double to_mm, int count) const {
    return std::min(count - 1, static_cast<int>(std::floor(to_mm / spacing_mm_ - 0.5)));
  }
  int FirstRow(double y_mm) const { return FirstAt(y_mm - pattern_.y); }
  int LastRow(double y_mm) const { return LastAt(y_mm - pattern_.y, rows_); }

  bool CloseRow(int row, double from_x_mm, double to_x_mm) {
    const std::size_t begin = static_cast<std::size_t>(row) * static_cast<std::size_t>(columns_);
    const int last = LastAt(to_x_mm - pattern_.x, columns_);
    bool was_open = false;
    for (int column = FirstAt(from_x_mm - pattern_.x); column <= last; ++column) {
      std::uint8_t& open = open_[begin + static_cast<std::size_t>(column)];
      if (open == 0) continue;
      open = 0;
      --left_;
      was_open = true;
    }
    return was_open;
  }

  SheetRectangle pattern_;
  double spacing_mm_;
  int columns_, rows_;
  std::vector<std::uint8_t> open_;
  std::size_t left_;
};

int DrawGrey(bool two_tone, Draws* draws) {
  const double draw = draws->Uniform();
  if (two_tone) return draw < 0.5 ? 0 : 255;
  return kDarkestGrey + static_cast<int>(draw * (kBrightestGrey - kDarkestGrey + 1));
}

}  // namespace

std::vector<TargetLeaf> DeadLeaves(const TargetPage& page) {
  const SheetRectangle& pattern = page.pattern;
  const double smallest_mm = page.feature_mm / 2;
  const double largest_mm =
      std::max(kLargestLeaf * std::min(pattern.width, pattern.height), 2 * smallest_mm);
  const double small_term = 1 / (smallest_mm * smallest_mm);
  const double large_term = 1 / (largest_mm * largest_mm);

  Openings openings(pattern, page.feature_mm / kSamplesPerFeature);
  openings.Close(page.patch);  // in front of every leaf
  Draws draws(page.seed);
  std::vector<TargetLeaf> leaves;
  for (int count = 0; openings.OpenPart() > kOpenAtEnd; ++count) {
    if (count % kTriesPerLook == 0) ThrowIfCancelled();
    // r = (rmin^-2 - q (rmin^-2 - rmax^-2))^(-1/2), q uniform: the inverse of the distribution
    // function of the density ~ r^-3 between rmin and rmax, derived here [D46].
    TargetLeaf leaf;
    leaf.radius_mm = 1 / std::sqrt(small_term - draws.Uniform() * (small_term - large_term));
    // Leaves also start beyond the sides, so that the texture there equals that in the middle.
    leaf.x_mm = pattern.x - largest_mm + draws.Uniform() * (pattern.width + 2 * largest_mm);
    leaf.y_mm = pattern.y - largest_mm + draws.Uniform() * (pattern.height + 2 * largest_mm);
    leaf.grey = DrawGrey(page.two_tone, &draws);
    if (openings.Close(leaf)) leaves.push_back(leaf);
  }
  std::reverse(leaves.begin(), leaves.end());
  return leaves;
}

int GreyBehindLeaves(const TargetPage& page) {
  return page.two_tone ? 255 : (kDarkestGrey + kBrightestGrey) / 2;
}

}  // namespace thicklens::model
