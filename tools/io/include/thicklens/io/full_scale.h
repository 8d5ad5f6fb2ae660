#ifndef THICKLENS_IO_FULL_SCALE_H_
#define THICKLENS_IO_FULL_SCALE_H_

#include <cstdint>
#include <opencv2/core/mat.hpp>
#include <string>
#include <vector>

#include "thicklens/base/export.h"

namespace thicklens::io {

// The finding of frames of 16 bits about the value that stands for white.
struct FullScaleFinding {
  // Which values the frames have.
  enum class Kind {
    kContainer,     // white is 65535
    kLeftAligned,   // fewer bits, the lowest ones of each value are 0
    kRightAligned,  // fewer bits, the highest ones of each value are 0
    kUndecided,     // right-aligned values and dark values of 16 bits look like this
  };
  Kind kind = Kind::kContainer;  // which of them
  int bits = 16;           // of each value; kUndecided: the fewest that hold the highest value
  int full_scale = 65535;  // 2^bits - 1, or that times a power of 2 if left-aligned
  std::string reason;      // what decides, or why nothing does; one line
};

// Counts which values occur in frames of 16 bits.
class THICKLENS_EXPORT ValueCounter {
 public:
  ValueCounter();
  // Adds a frame; `name` is for messages. Alpha is left out. Throws Error unless it has unsigned
  // integers of 16 bits.
  void Add(const cv::Mat& frame, const std::string& name);
  // Whether the frames so far show that values use all 16 bits, whatever the other frames have.
  bool UsesWholeContainer() const;

  // Decides from all frames. If all values are multiples of 2^k, they are left-aligned values of
  // 16 - k bits, 8 at least. If the highest value is 16384 or above, they have 16 bits. If many
  // values equal the highest one, which is 2^n - 1 with n = 8 to 14, the scale ends there, and they
  // are right-aligned values of n bits. If neighbouring values are 4 or more apart, fewer bits were
  // stretched to 16. Otherwise the values alone cannot show it: a dark frame of 16 bits has the
  // same values.
  FullScaleFinding Finding() const;

 private:
  std::vector<std::uint64_t> counts_;
  std::uint32_t highest_ = 0, set_bits_ = 0;
  double most_at_highest_ = 0;  // the largest share of a frame's values at `highest_`
  std::string frame_at_highest_;
};

// Returns values for which `full_scale` is white with the full scale of their container: 8 bits
// with 255 and 16 bits with 65535 are unchanged; 8 bits with another full scale become 16 bits.
// Throws Error that names the frame for a value above `full_scale`, and for a full scale that the
// container cannot hold.
THICKLENS_EXPORT cv::Mat ScaledToContainer(const cv::Mat& frame, int full_scale,
                                           const std::string& name);

}  // namespace thicklens::io

#endif  // THICKLENS_IO_FULL_SCALE_H_
