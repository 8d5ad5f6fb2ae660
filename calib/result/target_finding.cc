#include "thicklens/calib/target_finding.h"

namespace thicklens::calib {

std::string TargetFinding::ReliefMap() const {
  constexpr int kLetters = 26;
  std::string map;
  for (int row = 0; row < relief.rows; ++row) {
    for (int column = 0; column < relief.columns; ++column) {
      const auto zone = static_cast<std::size_t>(row * relief.columns + column);
      const int part = zone < relief.part_of_zone.size() ? relief.part_of_zone[zone] : -1;
      map += part < 0 || part >= kLetters ? '.' : static_cast<char>('a' + part);
    }
    map += '\n';
  }
  return map;
}

}  // namespace thicklens::calib
