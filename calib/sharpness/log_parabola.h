#ifndef THICKLENS_CALIB_SHARPNESS_LOG_PARABOLA_H_
#define THICKLENS_CALIB_SHARPNESS_LOG_PARABOLA_H_

#include <Eigen/Core>
#include <optional>

#include "thicklens/model/camera.h"

namespace thicklens::calib {

// The vertex -c1/(2 c2) [D70] of ln index = c0 + c1 x + c2 x^2, x = (reading - middle)/half, by
// least squares over the readings, mm; its error follows from the residuals. Returns std::nullopt
// where `half_mm` is not above 0, the samples do not determine a maximum, or it lies beyond abs(x)
// = 1.
std::optional<model::Estimate> VertexOfLogs(const Eigen::VectorXd& readings_mm,
                                            const Eigen::VectorXd& log_index, double middle_mm,
                                            double half_mm);

}  // namespace thicklens::calib

#endif  // THICKLENS_CALIB_SHARPNESS_LOG_PARABOLA_H_
