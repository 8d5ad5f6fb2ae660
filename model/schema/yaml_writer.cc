#include "model/schema/yaml_writer.h"

#include "thicklens/base/yaml_reader.h"

namespace thicklens::model {

YamlWriter::YamlWriter(const std::string& schema) {
  out_ << YAML::BeginMap;
  Text("schema", schema);
}

void YamlWriter::Text(const std::string& key, const std::string& value) {
  out_ << YAML::Key << key << YAML::Value << value;
}

void YamlWriter::TextIfAny(const std::string& key, const std::string& value) {
  if (!value.empty()) Text(key, value);
}

void YamlWriter::Number(const std::string& key, double value) { Text(key, YamlNumber(value)); }

void YamlWriter::NumberIfAny(const std::string& key, const std::optional<double>& value) {
  if (value) Number(key, *value);
}

void YamlWriter::Measured(const std::string& key, const Estimate& estimate) {
  BeginMapInLine(key);
  Number("value", estimate.value);
  Number("sigma", estimate.sigma);
  EndMap();
}

void YamlWriter::List(const std::string& key, const std::vector<std::string>& values) {
  out_ << YAML::Key << key << YAML::Value << YAML::Flow << values;
}

void YamlWriter::BeginMap(const std::string& key) {
  out_ << YAML::Key << key << YAML::Value << YAML::BeginMap;
}

void YamlWriter::BeginMapInLine(const std::string& key) {
  out_ << YAML::Key << key << YAML::Value;
  BeginMapInLine();
}

void YamlWriter::BeginList(const std::string& key) {
  out_ << YAML::Key << key << YAML::Value << YAML::BeginSeq;
}

void YamlWriter::BeginListInLine(const std::string& key) {
  out_ << YAML::Key << key << YAML::Value;
  BeginListInLine();
}

void YamlWriter::Element(double value) { out_ << YamlNumber(value); }

void YamlWriter::Element(const std::vector<std::string>& values) { out_ << YAML::Flow << values; }

void YamlWriter::BeginMapInLine() { out_ << YAML::Flow << YAML::BeginMap; }

void YamlWriter::BeginListInLine() { out_ << YAML::Flow << YAML::BeginSeq; }

void YamlWriter::EndMap() { out_ << YAML::EndMap; }

void YamlWriter::EndList() { out_ << YAML::EndSeq; }

std::string YamlWriter::Finish() {
  EndMap();
  return std::string(out_.c_str()) + "\n";
}

}  // namespace thicklens::model
