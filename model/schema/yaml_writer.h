#ifndef THICKLENS_MODEL_SCHEMA_YAML_WRITER_H_
#define THICKLENS_MODEL_SCHEMA_YAML_WRITER_H_

#include <yaml-cpp/yaml.h>

#include <optional>
#include <string>
#include <vector>

#include "thicklens/model/camera.h"

namespace thicklens::model {

// Writes a file that consists of one map, the counterpart of YamlNode. Entries are written in the
// order of the calls, into the innermost map or list that is open. Texts are quoted where needed,
// and numbers have their shortest form that is read back as the same value.
class YamlWriter {
 public:
  // Opens the map of the file. Its first entry is `schema`.
  explicit YamlWriter(const std::string& schema);

  // Entries of a map.
  void Text(const std::string& key, const std::string& value);
  void TextIfAny(const std::string& key, const std::string& value);  // unless it is empty
  void Number(const std::string& key, double value);
  void NumberIfAny(const std::string& key, const std::optional<double>& value);
  void Measured(const std::string& key, const Estimate& estimate);            // value and sigma
  void List(const std::string& key, const std::vector<std::string>& values);  // in one line

  void BeginMap(const std::string& key);
  void BeginMapInLine(const std::string& key);
  void BeginList(const std::string& key);
  void BeginListInLine(const std::string& key);

  // Elements of a list.
  void Element(double value);
  void Element(const std::vector<std::string>& values);  // a list in one line
  void BeginMapInLine();
  void BeginListInLine();

  void EndMap();
  void EndList();

  // Closes the map of the file and returns its text.
  std::string Finish();

 private:
  YAML::Emitter out_;
};

}  // namespace thicklens::model

#endif  // THICKLENS_MODEL_SCHEMA_YAML_WRITER_H_
