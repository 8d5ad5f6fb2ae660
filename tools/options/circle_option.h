#ifndef THICKLENS_TOOLS_OPTIONS_CIRCLE_OPTION_H_
#define THICKLENS_TOOLS_OPTIONS_CIRCLE_OPTION_H_

#include <CLI/CLI.hpp>
#include <optional>

#include "thicklens/model/camera.h"

namespace thicklens::tools {

// The options --coc-um and --coc-px: the diameter of the circle of confusion on the sensor.
struct CircleOption {
  std::optional<double> um, px;  // at most one

  bool is_given() const { return um || px; }
};
void AddCircleOptions(CLI::App* command, CircleOption* option);

// The diameter on the sensor, mm; 2 px if none is given.
double CircleOfConfusionMm(const CircleOption& option, const model::Sensor& sensor);
// Throws UsageError that names the option if the circle is not smaller than the aperture: it would
// have no limits. Without an option there is no error.
void RequirePossibleCircle(const CircleOption& option, const model::Camera& camera);

}  // namespace thicklens::tools

#endif  // THICKLENS_TOOLS_OPTIONS_CIRCLE_OPTION_H_
