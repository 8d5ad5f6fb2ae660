#ifndef THICKLENS_TOOLS_IO_LIGHTFIELDS_VIEW_NAMES_H_
#define THICKLENS_TOOLS_IO_LIGHTFIELDS_VIEW_NAMES_H_

#include <optional>
#include <regex>
#include <string>
#include <vector>

#include "tools/io/lightfields/view_grid.h"

namespace thicklens::io {

// The numbers that a name holds at the places of a pattern.
struct NameNumbers {
  std::optional<int> u, v, n;  // column, row; number of the view, counted row by row
  std::optional<double> x, y;  // position of the camera
};

// A pattern of names: "view_{v}_{u}.jpg". {v} is the row, {u} the column, {n} a number that counts
// row by row, {x} and {y} are positions, and * is any text. Numbers may have a sign, '-' or '+'.
class NamePattern {
 public:
  // Throws Error for a pattern that cannot give each view a place.
  explicit NamePattern(const std::string& pattern);

  // Returns nothing if the name does not fit.
  std::optional<NameNumbers> Match(const std::string& name) const;
  // Whether the name would fit with other signs before its numbers, or with letters that stand for
  // signs: "cam_m2_p1.png" and "cam_-2_1.png".
  bool MatchesUpToSigns(const std::string& name) const;
  bool HasRowAndColumn() const { return has_row_and_column_; }
  const std::string& text() const { return text_; }

 private:
  std::string text_;
  std::string places_;  // letters of the places, in their order
  bool has_row_and_column_ = false;
  std::regex expression_, any_signs_;
};

// The pattern that names suggest: that of the largest group of names that differ only in numbers.
// A '-' directly before digits is a sign where other numbers at its place have none or a '+'.
struct NameProposal {
  std::string pattern;    // "view_{v}_{u}.png", or "frame_{n}.png" with one changing number
  int changing = 0;       // how many numbers change
  std::size_t names = 0;  // how many names it fits
  // All numbers at one place have a '-' before them that may separate or be a sign: then `pattern`
  // has it as text, and `other_pattern` takes it as a sign.
  bool is_sign_unclear = false;
  std::string other_pattern;
  // Patterns of other groups with at least half as many names, in which as many numbers change: a
  // light field may be in each of them. Groups that are no full grid are not among them if the
  // largest group is one.
  std::vector<std::string> other_patterns;
  // Patterns of smaller groups that are full grids of at least 2 x 2 views, and of large groups
  // that are not full grids.
  std::vector<std::string> smaller_patterns;
  // Names that would fit with other signs, or with letters that may stand for signs.
  std::vector<std::string> other_signs;
};
// Throws Error if a proposal cannot be used without a statement of the user.
void RequireClear(const std::string& path, const NameProposal& proposal);
// Returns nothing if no two names differ only in their numbers, or if more than two numbers change.
std::optional<NameProposal> ProposedPattern(const std::vector<std::string>& names);

// The grid of the names that fit the pattern; `others` gets the names that do not. `first` is that
// of GridOfNumbers.
ViewGrid GridOfNames(const std::string& path, const NamePattern& pattern,
                     const std::vector<std::string>& names, const LightFieldReading& reading,
                     std::vector<std::string>* others, std::optional<int> first = std::nullopt);

// Adds warnings about images that are not read although they may be views: other groups of names,
// and names that fit the pattern but for signs.
void AddWarningsOfNames(const std::string& path, const NamePattern& pattern,
                        const std::optional<NameProposal>& proposal,
                        const std::vector<std::string>& others, ViewSource* source);

}  // namespace thicklens::io

#endif  // THICKLENS_TOOLS_IO_LIGHTFIELDS_VIEW_NAMES_H_
