#include "tools/bench/whole_time.h"

#include <fmt/format.h>

#include <algorithm>

#include "tools/bench/bench_machine.h"

namespace thicklens::tools {

double WholeTime::median() const { return Median(seconds); }

std::string WholeTime::MeasuredCell() const {
  return is_extrapolated ? "-" : fmt::format("{:.3g}", median());
}

std::string WholeTime::ExtrapolatedCell() const {
  return is_extrapolated ? fmt::format("{:.3g}", median()) : "-";
}

std::string WholeTime::RangeCell() const {
  const auto [least, most] = std::minmax_element(seconds.begin(), seconds.end());
  return fmt::format("{:.3g} .. {:.3g}", *least, *most);
}

nlohmann::json WholeTime::Json() const {
  nlohmann::json json = {{"seconds", nullptr},
                         {"seconds_of_runs", nullptr},
                         {"extrapolated_seconds", nullptr},
                         {"extrapolated_seconds_of_runs", nullptr}};
  json[is_extrapolated ? "extrapolated_seconds" : "seconds"] = median();
  json[is_extrapolated ? "extrapolated_seconds_of_runs" : "seconds_of_runs"] = seconds;
  return json;
}

}  // namespace thicklens::tools
