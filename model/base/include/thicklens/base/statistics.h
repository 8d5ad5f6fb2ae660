#ifndef THICKLENS_BASE_STATISTICS_H_
#define THICKLENS_BASE_STATISTICS_H_

#include <vector>

namespace thicklens {

// The middle one of the values, of an even number the upper of the two in the middle; 0 if there
// are none.
double Median(std::vector<double> values);

}  // namespace thicklens

#endif  // THICKLENS_BASE_STATISTICS_H_
