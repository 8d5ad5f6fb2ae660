#include "thicklens/kernels/patch_filter.h"

#include <algorithm>
#include <array>
#include <cstddef>

#include "kernels/cpu/bands.h"
#include "kernels/cpu/patch_loops.h"
#include "thicklens/base/index.h"

namespace thicklens::kernels {
namespace {

constexpr int kBandRows = 64;
constexpr int kColours = 3;
// Values of sqrt(1/3), sqrt(1/2) and sqrt(1/6).
constexpr double kThird = 0.57735026918962576451, kHalf = 0.70710678118654752440,
                 kSixth = 0.40824829046386301637;
// Orthonormal sum and two differences of the colours.
constexpr std::array<std::array<double, kColours>, kColours> kOpponents{
    {{kThird, kThird, kThird}, {kHalf, 0, -kHalf}, {kSixth, -2 * kSixth, kSixth}}};

// Filters an image in bands of rows; each thread uses its own Room.
template <typename Real>
class PatchFilter {
 public:
  struct Room {
    std::vector<Real> from, sum, weight, columns;
  };

  PatchFilter(int width_px, int height_px, int channels, const std::vector<Real>& image,
              Real threshold, std::vector<Real>* to)
      : width_px_(width_px),
        height_px_(height_px),
        channels_(channels),
        stride_((width_px + kPatchChunkPx - 1) / kPatchChunkPx * kPatchChunkPx + 2 * kPatchPx),
        image_(image),
        threshold_(threshold),
        to_(*to) {}

  Room NewRoom() const {
    const std::vector<Real> rows(Index(kBandRows + 2 * kPatchPx) * Index(stride_));
    return {rows, rows, rows, std::vector<Real>(Index(kPatchPx * stride_))};
  }

  // Filters rows [y0, y1), which must be 0 before.
  void FilterRows(int y0, int y1, Room* room) const {
    for (int channel = 0; channel < channels_; ++channel) {
      const int first = std::max(0, y0 - (kPatchPx - 1));
      const int last = std::min(height_px_, y1 + kPatchPx - 1);
      for (int y = first; y < last; ++y) Read(channel, y, room->from.data() + At(y - first));
      std::fill(room->sum.begin(), room->sum.end(), Real(0));
      std::fill(room->weight.begin(), room->weight.end(), Real(0));
      for (int y = first; y + kPatchPx <= last; ++y) {
        BestPatchLoops<Real>().filter_row({room->from.data() + At(y - first), room->columns.data(),
                                           stride_, width_px_ - (kPatchPx - 1), threshold_,
                                           room->sum.data() + At(y - first),
                                           room->weight.data() + At(y - first)});
      }
      for (int y = y0; y < y1; ++y) {
        Real* sum = room->sum.data() + At(y - first);
        const Real* weight = room->weight.data() + At(y - first);
        for (int x = 0; x < width_px_; ++x) sum[x] /= weight[x];
        Write(channel, y, sum);
      }
    }
  }

 private:
  std::size_t At(int row) const { return Index(row) * Index(stride_); }
  std::size_t Start(int channel, int y) const {
    return (Index(channel) * Index(height_px_) + Index(y)) * Index(width_px_);
  }

  // Read and Write convert a row between the channels and the filtered sums and differences.
  void Read(int channel, int y, Real* row) const {
    if (channels_ != kColours) {
      std::copy_n(image_.data() + Start(channel, y), width_px_, row);
      return;
    }
    std::fill(row, row + width_px_, Real(0));
    for (int colour = 0; colour < kColours; ++colour) {
      const Real share = static_cast<Real>(kOpponents[Index(channel)][Index(colour)]);
      const Real* from = image_.data() + Start(colour, y);
      for (int x = 0; x < width_px_; ++x) row[x] += share * from[x];
    }
  }
  void Write(int channel, int y, const Real* row) const {
    if (channels_ != kColours) {
      std::copy_n(row, width_px_, to_.data() + Start(channel, y));
      return;
    }
    for (int colour = 0; colour < kColours; ++colour) {
      const Real share = static_cast<Real>(kOpponents[Index(channel)][Index(colour)]);
      Real* to = to_.data() + Start(colour, y);
      for (int x = 0; x < width_px_; ++x) to[x] += share * row[x];
    }
  }

  const int width_px_, height_px_, channels_, stride_;
  const std::vector<Real>& image_;
  const Real threshold_;
  std::vector<Real>& to_;
};

}  // namespace

template <typename Real>
std::vector<Real> FilterPatches(int width_px, int height_px, int channels,
                                const std::vector<Real>& image, double threshold, int threads) {
  if (std::min(width_px, height_px) < kPatchPx) return image;
  std::vector<Real> filtered(image.size());
  const PatchFilter<Real> filter(width_px, height_px, channels, image, static_cast<Real>(threshold),
                                 &filtered);
  const int bands = (height_px + kBandRows - 1) / kBandRows;
  const int used = BandCount(bands, threads, 1);
  // The memory is allocated before the threads start, because threads must not throw.
  std::vector<typename PatchFilter<Real>::Room> rooms(Index(used), filter.NewRoom());
  ForBands(bands, used, [&](int thread, int first, int last) {
    for (int band = first; band < last; ++band) {
      filter.FilterRows(band * kBandRows, std::min((band + 1) * kBandRows, height_px),
                        &rooms[Index(thread)]);
    }
  });
  return filtered;
}

template std::vector<float> FilterPatches(int, int, int, const std::vector<float>&, double, int);
template std::vector<double> FilterPatches(int, int, int, const std::vector<double>&, double, int);

}  // namespace thicklens::kernels
