#ifndef THICKLENS_MODEL_STATISTICS_H_
#define THICKLENS_MODEL_STATISTICS_H_

#include <vector>

namespace thicklens::model {

// The middle one of the values, of an even number the upper of the two in the middle; 0 if there
// are none.
double Median(std::vector<double> values);

}  // namespace thicklens::model

#endif  // THICKLENS_MODEL_STATISTICS_H_
