#ifndef THICKLENS_MODEL_DEPTH_HOLES_H_
#define THICKLENS_MODEL_DEPTH_HOLES_H_

#include <cstddef>
#include <string>
#include <vector>

#include "thicklens/base/export.h"
#include "thicklens/model/scene.h"

namespace thicklens::model {

// Which values of a depth map are holes, besides NaN and infinities.
struct HoleRules {
  // kDisparity and kInverse: 0 is a value also in an integer map, for example the far end of a
  // relative map. A z or a range of 0 is always a hole.
  bool zero_is_value = false;
  // The largest value that the type holds is a depth, also where it looks like a mark.
  bool largest_is_value = false;
  std::vector<double> hole_values;  // the file's marks of "no depth", e.g. -1 or 9999; finite

  // Returns whether the values are finite and the rules fit the kind. Otherwise `why`, if not null,
  // gets the reason.
  THICKLENS_EXPORT bool IsValid(DepthKind kind, std::string* why) const;
};

// A number that many pixels have exactly and that lies far beyond all others, or alone below 0: it
// may be a mark of "no depth" that the file does not state.
struct SuspectedMark {
  double value = 0;        // as stored
  std::size_t pixels = 0;  // how many have it
};

// Numbers of values by the reason why they are no depth. Each value is counted once.
struct DepthHoles {
  std::size_t pixels = 0;        // of the map
  std::size_t not_a_number = 0;  // NaN
  std::size_t infinite = 0;      // both signs
  std::size_t listed = 0;        // one of HoleRules::hole_values
  std::size_t zero = 0;          // 0
  std::size_t negative = 0;      // below 0, in z and range
  std::size_t largest = 0;       // the largest value of the type, as a mark of "no depth"
  // The zeros of an integer map of disparity or inverse depth form areas, as the far end of a
  // relative map does, and not scattered pixels and thin lines, as failed measurements do.
  bool zeros_form_areas = false;
  // Values that look like marks and are depths nevertheless, because nobody stated them; the
  // largest magnitude comes first.
  std::vector<SuspectedMark> suspects;

  // The sum over all reasons.
  THICKLENS_EXPORT std::size_t total() const;
  // "0: 18.9 %, NaN: 0.1 %"; empty if there are no holes.
  THICKLENS_EXPORT std::string InWords() const;
};

// Sets every hole of the map to NaN and counts them. If 0 is a value, `integer` is false
// afterwards, so that it remains one. Throws Error if the rules are not valid or the size does not
// fit.
//   z, range: below 0 is a hole, unless most values are negative: the map then has another sign,
//   and
//     nothing is changed there. The largest value of a type of more than 8 bits is a hole if no
//     other value comes within 10 % of it, because a scene that reaches the end of the type has
//     values below it.
//   disparity, inverse: the largest value is a value, since relative maps are scaled to reach it.
// A value that remains is suspected if at least 0.1 % of the pixels have it exactly and the next
// magnitude is far below. For a number that programs use as a mark (the largest of the type or one
// less, 999, 9999, .., 4095, 8191, .., 65535, 65534, powers of ten from 10000 on) that is below 0.8
// of it, or 0.5 in maps of disparity and inverse depth, where the largest of 8 bits is no mark. For
// other numbers in z and range it is below 1/100: a wall or a sky is nearer to its scene than that.
// In a map of disparity -1 and -16 are suspected, OpenCV's marks of pixels without a match, where
// no other value is below 0.
THICKLENS_EXPORT DepthHoles MarkHoles(DepthKind kind, const HoleRules& rules, RawDepthMap* map);

}  // namespace thicklens::model

#endif  // THICKLENS_MODEL_DEPTH_HOLES_H_
