#ifndef THICKLENS_BASE_INDEX_H_
#define THICKLENS_BASE_INDEX_H_

#include <cstddef>
#include <cstdint>

namespace thicklens {

// Converts a count or a position, which must be >= 0, to the type of the sizes and subscripts of
// the standard containers. Sizes and coordinates of images are signed here, so that differences of
// them can be negative. A product of two of them is taken after the conversion, where it does not
// overflow.
constexpr std::size_t Index(std::int64_t i) { return static_cast<std::size_t>(i); }

}  // namespace thicklens

#endif  // THICKLENS_BASE_INDEX_H_
