#include "tools/options/circle_option.h"

#include <fmt/format.h>

#include "tools/options/option_values.h"

namespace thicklens::tools {
namespace {

constexpr double kDefaultPx = 2;  // a blur radius of 1 px
constexpr double kUmPerMm = 1000;
constexpr double kLargest = 1e5;

}  // namespace

void AddCircleOptions(CLI::App* command, CircleOption* option) {
  CLI::Option* um =
      command
          ->add_option("--coc-um", option->um,
                       "Circle of confusion for the depth of field: diameter on the sensor")
          ->check(Between(0, kLargest, "micrometres"))
          ->type_name("UM");
  command->add_option("--coc-px", option->px, "The same in px of the sensor")
      ->check(Between(0, kLargest, "px"))
      ->excludes(um)
      ->type_name("PX");
}

double CircleOfConfusionMm(const CircleOption& option, const model::Sensor& sensor) {
  if (option.um) return *option.um / kUmPerMm;
  return option.px.value_or(kDefaultPx) * sensor.pixel_pitch_mm;
}

void RequirePossibleCircle(const CircleOption& option, const model::Camera& camera) {
  const double aperture_mm = 2 * camera.lens.aperture_radius_mm;
  const double circle_mm = CircleOfConfusionMm(option, camera.sensor);
  if (!option.is_given() || circle_mm < aperture_mm) return;
  throw UsageError(fmt::format(
      "{}: a circle below the diameter of the aperture, {:.6g} mm, is expected, found {:.6g} mm",
      option.um ? "--coc-um" : "--coc-px", aperture_mm, circle_mm));
}

}  // namespace thicklens::tools
