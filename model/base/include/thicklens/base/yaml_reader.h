#ifndef THICKLENS_BASE_YAML_READER_H_
#define THICKLENS_BASE_YAML_READER_H_

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "thicklens/base/deprecation.h"
#include "thicklens/base/error.h"
#include "thicklens/base/export.h"

namespace thicklens {

// A strict view of one node of a YAML document. Every schema of the project is read through it.
// Copies share the document, which lives as long as one of its nodes. Every Error names
// file:line:column, the path of the field, the value found and the expected value. Every reader
// throws Error if the node has the wrong type or value.
class THICKLENS_EXPORT YamlNode {
 public:
  // Read a file or a text that contains exactly one YAML document. `source_name` is the name of the
  // text in messages.
  static YamlNode LoadFile(const std::string& path);
  // Reads a text. `source_name` is its name in messages.
  static YamlNode Parse(const std::string& text, const std::string& source_name);

  // Returns true if this is a map whose key `schema` has the given value.
  bool HasSchema(const std::string& schema) const;
  // Throws Error unless HasSchema (e.g. for "thicklens/camera/2").
  void RequireSchema(const std::string& schema) const;
  // Throws Error for the first key that is not in the list, with a suggestion if a similar key is
  // allowed; a key that differs only in its unit suffix is reported as a wrong unit. Throws Error
  // also for a key that occurs twice, and if this is no map. The former names of `renamed` are
  // accepted too, but messages do not list them.
  void RequireKeys(const std::vector<std::string>& allowed,
                   const std::vector<RenamedWord>& renamed = {}) const;

  // Returns whether the map has the key, whatever its value.
  bool Has(const std::string& key) const;
  YamlNode At(const std::string& key) const;                   // throws Error if absent
  std::optional<YamlNode> Find(const std::string& key) const;  // absent or null: nullopt
  // Finds a renamed key by either name. Throws Error if both are there. The first use of the former
  // name adds a line to `notices`.
  std::optional<YamlNode> Find(const RenamedWord& key, std::vector<std::string>* notices) const;

  // Returns whether the node is a map of keys and values.
  bool IsMap() const;
  // Returns whether the node is a list.
  bool IsSequence() const;
  // Returns whether the node is a single value.
  bool IsScalar() const;
  std::vector<YamlNode> Elements() const;                          // the elements of a sequence
  std::vector<YamlNode> ElementsExactly(std::size_t count) const;  // throws Error for other counts

  // Scalars, of which the whole text is checked: "6 um" is no number. NaN, infinities and
  // magnitudes above 1e30 throw Error; a positive number must be at least 1e-30. `min` and `max`
  // are included.
  double Number() const;
  // Returns a number that must be > 0.
  double PositiveNumber() const;
  // Returns a number that must be >= 0.
  double NonNegativeNumber() const;
  // Returns a whole number from `min` to `max`, both included.
  int Integer(int min, int max) const;
  // Returns the value of "true" or "false".
  bool Boolean() const;
  std::string Text() const;                                          // a non-empty scalar
  std::string OneOf(const std::vector<std::string>& allowed) const;  // a scalar of the list
  // As OneOf, for a list that contains a renamed value. Its former name gives the present one, and
  // its first use adds a line to `notices`.
  std::string OneOf(const std::vector<std::string>& allowed, const RenamedWord& value,
                    std::vector<std::string>* notices) const;

  // The Error with the message "file:12:7: lens.aperture_radius_mm: " + what.
  Error ErrorHere(const std::string& what) const;
  const std::string& path() const;    // dotted path of the field
  const std::string& source() const;  // name of the file
  // The path `relative`, resolved against the folder of this document's file; an absolute path is
  // unchanged. A file that a document names is an input of the run, so that the InputWatch
  // (input_file.h) is called.
  std::string ResolvePath(const std::string& relative) const;

 private:
  struct Impl;
  void NoteFormerName(const RenamedWord& word, std::vector<std::string>* notices) const;
  explicit YamlNode(std::shared_ptr<const Impl> impl) : impl_(std::move(impl)) {}
  std::shared_ptr<const Impl> impl_;
};

// The shortest text of a number that is read back to the same bits.
THICKLENS_EXPORT std::string YamlNumber(double value);

}  // namespace thicklens

#endif  // THICKLENS_BASE_YAML_READER_H_
