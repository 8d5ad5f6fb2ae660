#ifndef THICKLENS_BASE_STATISTICS_H_
#define THICKLENS_BASE_STATISTICS_H_

#include <vector>

#include "thicklens/base/export.h"

namespace thicklens {

// The median of the values. For an even number it is the upper of the two in the middle; it is 0 if
// there are no values.
THICKLENS_EXPORT double Median(std::vector<double> values);

}  // namespace thicklens

#endif  // THICKLENS_BASE_STATISTICS_H_
