#ifndef THICKLENS_BASE_YAML_READER_H_
#define THICKLENS_BASE_YAML_READER_H_

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "thicklens/base/error.h"

namespace thicklens {

// A strict view of one node of a YAML document: every schema of the project is read through it.
// Every error names file:line:column, the field's path, what was found and what would be right.
class YamlNode {
 public:
  static YamlNode LoadFile(const std::string& path);
  static YamlNode Parse(const std::string& text, const std::string& source_name);

  // Whether this is a map with that `schema`.
  bool HasSchema(const std::string& schema) const;
  // Throws unless this map's `schema` is the given one (e.g. "thicklens/camera/2").
  void RequireSchema(const std::string& schema) const;
  // Throws for the first key that is not in the list, with a suggestion where one is close; a key
  // that differs only in its unit suffix is called a wrong unit. Throws if this is no map.
  void RequireKeys(const std::vector<std::string>& allowed) const;

  bool Has(const std::string& key) const;
  YamlNode At(const std::string& key) const;                   // throws if absent
  std::optional<YamlNode> Find(const std::string& key) const;  // absent or null: nullopt

  bool IsMap() const;
  bool IsSequence() const;
  bool IsScalar() const;
  std::vector<YamlNode> Elements() const;  // of a sequence
  std::vector<YamlNode> ElementsExactly(std::size_t count) const;

  // Scalars, checked in full: "6 um" is no number, NaN and infinities are refused.
  double Number() const;
  double PositiveNumber() const;
  double NonNegativeNumber() const;
  int Integer(int min, int max) const;
  bool Boolean() const;
  std::string Text() const;                                          // a non-empty scalar
  std::string OneOf(const std::vector<std::string>& allowed) const;  // a scalar out of a list

  // "file:12:7: lens.aperture_radius_mm: " + what.
  Error ErrorHere(const std::string& what) const;
  const std::string& path() const;    // dotted path of the field
  const std::string& source() const;  // file name
  // `relative` as seen from the folder of this document's file. What a file names is an input of
  // the run: the InputWatch (input_file.h) is called.
  std::string ResolvePath(const std::string& relative) const;

 private:
  struct Impl;
  explicit YamlNode(std::shared_ptr<const Impl> impl) : impl_(std::move(impl)) {}
  std::shared_ptr<const Impl> impl_;
};

// A number in its shortest form that reads back to the same bits.
std::string YamlNumber(double value);

}  // namespace thicklens

#endif  // THICKLENS_BASE_YAML_READER_H_
