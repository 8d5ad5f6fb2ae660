#ifndef THICKLENS_BASE_INDEX_H_
#define THICKLENS_BASE_INDEX_H_

#include <cstddef>
#include <cstdint>

namespace thicklens {

// Converts a number that is not negative, for an index or a count of a container.
constexpr std::size_t Index(std::int64_t i) { return static_cast<std::size_t>(i); }

}  // namespace thicklens

#endif  // THICKLENS_BASE_INDEX_H_
