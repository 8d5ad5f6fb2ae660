#ifndef THICKLENS_TOOLS_IO_LENS_DISTORTION_FORMATS_H_
#define THICKLENS_TOOLS_IO_LENS_DISTORTION_FORMATS_H_

#include <memory>
#include <string>
#include <vector>

#include "thicklens/base/error.h"
#include "thicklens/base/yaml_reader.h"
#include "thicklens/io/lens_distortion_file.h"

namespace thicklens::io {

// A file of calibration data as it is read: its content, its name in messages, and the camera that
// is asked for; empty: none was named.
struct CalibrationText {
  const std::string& bytes;
  const std::string& name;
  const std::string& camera;
};

// Named fields of one camera, whatever the syntax of their file. Each function throws Error, which
// names the place, if the field has another type.
class CalibrationFields {
 public:
  virtual ~CalibrationFields() = default;
  virtual bool Has(const std::string& key) const = 0;
  // The numbers of a matrix or a list, row by row, at most 64.
  virtual std::vector<double> Numbers(const std::string& key) const = 0;
  virtual int Size(const std::string& key) const = 0;  // a whole number from 1 to 100000
  virtual std::string Text(const std::string& key) const = 0;
  // The fields below a key; null: it has none.
  virtual std::unique_ptr<CalibrationFields> Below(const std::string& key) const = 0;
  virtual Error ErrorAt(const std::string& key, const std::string& what) const = 0;
};
// The fields of a YAML (or JSON) map.
std::unique_ptr<CalibrationFields> YamlFields(const YamlNode& node);
// The fields of OpenCV's XML. Throws Error.
std::unique_ptr<CalibrationFields> XmlFields(const CalibrationText& text);

// The error for a model that OpenCV's functions do not have.
Error NotOfOpenCv(const std::string& place, const std::string& model, const std::string& remedy);
// Throws Error: several cameras are in the file and none of them, or another one, was named.
[[noreturn]] void ThrowNoSuchCamera(const CalibrationText& text,
                                    const std::vector<std::string>& cameras);

// Each function reads the format that it names; the result need not be valid.
LensDistortionFile ReadOpenCvFields(const CalibrationText& text, const CalibrationFields& fields);
LensDistortionFile ReadYamlCalibration(const CalibrationText& text);  // all kinds of YAML and JSON
bool IsColmapText(const std::string& bytes);
LensDistortionFile ReadColmapText(const CalibrationText& text);
LensDistortionFile ReadColmapBinary(const CalibrationText& text);
bool IsMrcal(const std::string& bytes);
LensDistortionFile ReadMrcal(const CalibrationText& text);

}  // namespace thicklens::io

#endif  // THICKLENS_TOOLS_IO_LENS_DISTORTION_FORMATS_H_
