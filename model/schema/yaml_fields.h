#ifndef THICKLENS_MODEL_SCHEMA_YAML_FIELDS_H_
#define THICKLENS_MODEL_SCHEMA_YAML_FIELDS_H_

#include <Eigen/Core>
#include <cstddef>
#include <string>
#include <vector>

#include "thicklens/base/yaml_reader.h"
#include "thicklens/model/aperture_outline.h"
#include "thicklens/model/camera.h"
#include "thicklens/model/lens_aberrations.h"

// Readers of values that occur in several files. They throw Error with file:line:column.
namespace thicklens::model {

// Reads the number of a key of the map `node`. A missing key keeps the value of `field`.
void ReadNumber(const YamlNode& node, const char* key, double* field);

Eigen::Vector2d ReadPair(const YamlNode& node);  // a list of two numbers

// Reads a number, whose sigma is then 0, or {value: .., sigma: ..}. `number` reads and checks the
// value: any, positive or not negative.
Estimate ReadEstimate(const YamlNode& node, double (YamlNode::*number)() const);

LensAberrations ReadAberrations(const YamlNode& node);  // the aberrations of a simulated sweep
ApertureOutline ReadAperture(const YamlNode& node);     // its outline of the aperture

TransferCurve ReadTransfer(const YamlNode& node);  // the name of a transfer curve

// Reads the keys `focus_depth_mm`, `blur_ratio` and `blur_floor_px` of the truth of a simulation. A
// missing key keeps the value of the calibration.
void ReadTruthValues(const YamlNode& node, const ThickLens& lens, CameraCalibration* truth);

// Reads [width, height] in px. Returns the camera whose sensor is the part of this size in the
// middle of the sensor; the axis keeps its position on the chip. An odd difference leaves the extra
// row or column below or on the right.
Camera ReadCrop(const YamlNode& node, const Camera& camera);

// Reads the name of one of these values.
template <typename Value>
Value ReadNamed(const YamlNode& node, const std::vector<Value>& values,
                std::string (*name_of)(Value)) {
  std::vector<std::string> names;
  for (const Value value : values) names.push_back(name_of(value));
  const std::string name = node.OneOf(names);
  std::size_t i = 0;
  while (names[i] != name) ++i;
  return values[i];
}

// Reads the name of one of these values, of which one was renamed: its former name is accepted, and
// its first use adds a line to `notices`.
template <typename Value>
Value ReadNamed(const YamlNode& node, const std::vector<Value>& values,
                std::string (*name_of)(Value), const RenamedWord& renamed,
                std::vector<std::string>* notices) {
  std::vector<std::string> names;
  for (const Value value : values) names.push_back(name_of(value));
  const std::string name = node.OneOf(names, renamed, notices);
  std::size_t i = 0;
  while (names[i] != name) ++i;
  return values[i];
}

}  // namespace thicklens::model

#endif  // THICKLENS_MODEL_SCHEMA_YAML_FIELDS_H_
