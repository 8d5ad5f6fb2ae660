#include "thicklens/base/yaml_reader.h"

#include <fmt/format.h>
#include <yaml-cpp/eventhandler.h>
#include <yaml-cpp/yaml.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstddef>
#include <filesystem>
#include <set>
#include <sstream>

#include "thicklens/base/input_file.h"

namespace thicklens {
namespace {

std::string Join(const std::vector<std::string>& items) {
  return fmt::format("{}", fmt::join(items, ", "));
}

// "pixel_pitch_mm" -> "pixel_pitch"; a key without a unit suffix is unchanged.
std::string WithoutUnit(const std::string& key) {
  static const std::set<std::string> kUnits = {
      "nm",  "um",  "mm",  "cm", "dm",        "m",      "in",      "inch",  "px",
      "pix", "deg", "rad", "e",  "electrons", "micron", "microns", "pixel", "pixels"};
  const auto underscore = key.rfind('_');
  if (underscore == std::string::npos || kUnits.count(key.substr(underscore + 1)) == 0) return key;
  return key.substr(0, underscore);
}

std::size_t EditDistance(const std::string& a, const std::string& b) {
  std::vector<std::size_t> row(b.size() + 1);
  for (std::size_t j = 0; j <= b.size(); ++j) row[j] = j;
  for (std::size_t i = 1; i <= a.size(); ++i) {
    std::size_t diagonal = row[0];
    row[0] = i;
    for (std::size_t j = 1; j <= b.size(); ++j) {
      const std::size_t replaced = diagonal + (a[i - 1] == b[j - 1] ? 0 : 1);
      diagonal = row[j];
      row[j] = std::min({row[j] + 1, row[j - 1] + 1, replaced});
    }
  }
  return row[b.size()];
}

std::string SuggestionFor(const std::string& key, const std::vector<std::string>& allowed) {
  for (const std::string& candidate : allowed) {
    if (WithoutUnit(candidate) == WithoutUnit(key)) {
      return fmt::format("wrong unit: this field is '{}'", candidate);
    }
  }
  for (const std::string& candidate : allowed) {
    if (EditDistance(key, candidate) <= 2) return fmt::format("did you mean '{}'?", candidate);
  }
  // A name without its first words: tube_length_mm for optical_tube_length_mm.
  const std::string ending = "_" + key;
  std::vector<std::string> longer;
  for (const std::string& candidate : allowed) {
    if (candidate.size() > ending.size() &&
        candidate.compare(candidate.size() - ending.size(), ending.size(), ending) == 0)
      longer.push_back(candidate);
  }
  if (longer.size() == 1) return fmt::format("did you mean '{}'?", longer.front());
  return fmt::format("allowed here: {}", Join(allowed));
}

// Text for a message. A long text is shortened.
std::string Shown(const std::string& text) {
  constexpr std::size_t kLongest = 80, kBegin = 40;
  if (text.size() <= kLongest) return text;
  std::size_t end = kBegin;
  while (end > 0 && (static_cast<unsigned char>(text[end]) & 0xC0U) == 0x80U) --end;  // UTF-8
  return fmt::format("{}... ({} bytes)", text.substr(0, end), text.size());
}

// Limits of numbers. Beyond them no length, angle or count is meaningful, and products of several
// numbers overflow.
constexpr double kMaxMagnitude = 1e30, kMinPositive = 1e-30;

std::string KindOf(const YAML::Node& node) {
  switch (node.Type()) {
    case YAML::NodeType::Map:
      return "a map";
    case YAML::NodeType::Sequence:
      return "a list";
    case YAML::NodeType::Scalar:
      return "'" + Shown(node.Scalar()) + "'";
    default:
      return "nothing";
  }
}

// Collects the positions at which the documents of a text begin.
class DocumentStarts : public YAML::EventHandler {
 public:
  const std::vector<YAML::Mark>& marks() const { return marks_; }

  void OnDocumentStart(const YAML::Mark& mark) override { marks_.push_back(mark); }
  void OnDocumentEnd() override {}
  void OnNull(const YAML::Mark&, YAML::anchor_t) override {}
  void OnAlias(const YAML::Mark&, YAML::anchor_t) override {}
  void OnScalar(const YAML::Mark&, const std::string&, YAML::anchor_t,
                const std::string&) override {}
  void OnSequenceStart(const YAML::Mark&, const std::string&, YAML::anchor_t,
                       YAML::EmitterStyle::value) override {}
  void OnSequenceEnd() override {}
  void OnMapStart(const YAML::Mark&, const std::string&, YAML::anchor_t,
                  YAML::EmitterStyle::value) override {}
  void OnMapEnd() override {}

 private:
  std::vector<YAML::Mark> marks_;
};

// YAML permits no NUL, but yaml-cpp accepts one as a part of a text. UTF-16 and UTF-32 contain many
// NUL bytes; yaml-cpp recognises these encodings by their first bytes.
void RequireNoNul(const std::string& text, const std::string& source_name) {
  const auto is_wide = [&text] {
    if (text.size() < 2) return false;
    const bool has_mark =
        text.compare(0, 2, "\xFF\xFE") == 0 || text.compare(0, 2, "\xFE\xFF") == 0;
    return has_mark || text[0] == '\0' || text[1] == '\0';
  };
  const std::size_t at = text.find('\0');
  if (at == std::string::npos || is_wide()) return;
  const auto end = text.begin() + static_cast<std::ptrdiff_t>(at);
  throw Error(fmt::format("{}:{}: a NUL byte, which no text file contains; a YAML file is expected",
                          source_name, 1 + std::count(text.begin(), end, '\n')));
}

// yaml-cpp finds endless empty documents in a text that begins with a comma, for example. Therefore
// at most two documents are requested.
void RequireOneDocument(const std::string& text, const std::string& source_name) {
  std::istringstream stream(text);
  YAML::Parser parser(stream);
  DocumentStarts documents;
  const bool has_one = parser.HandleNextDocument(documents);
  const bool has_two = has_one && parser.HandleNextDocument(documents);
  if (has_one && !has_two) return;
  const std::vector<YAML::Mark>& marks = documents.marks();
  if (has_two && marks.size() == 2 && marks[0].pos == marks[1].pos) {
    throw Error(fmt::format("{}:{}:{}: not valid YAML: a document cannot begin with this character",
                            source_name, marks[0].line + 1, marks[0].column + 1));
  }
  throw Error(fmt::format("{}: one YAML document is expected, found {}", source_name,
                          has_two ? "more" : "none"));
}

}  // namespace

struct YamlNode::Impl {
  YAML::Node node;
  std::string source;
  std::string path;
};

YamlNode YamlNode::LoadFile(const std::string& path) { return Parse(ReadTextFile(path), path); }

YamlNode YamlNode::Parse(const std::string& text, const std::string& source_name) {
  try {
    RequireNoNul(text, source_name);
    RequireOneDocument(text, source_name);
    auto impl = std::make_shared<Impl>();
    impl->node.reset(YAML::Load(text));
    impl->source = source_name;
    return YamlNode(impl);
  } catch (const YAML::Exception& e) {
    throw Error(fmt::format("{}:{}:{}: not valid YAML: {}", source_name, e.mark.line + 1,
                            e.mark.column + 1, e.msg));
  }
}

Error YamlNode::ErrorHere(const std::string& what) const {
  const YAML::Mark mark = impl_->node.Mark();
  const std::string where =
      mark.is_null() ? impl_->source
                     : fmt::format("{}:{}:{}", impl_->source, mark.line + 1, mark.column + 1);
  return Error(impl_->path.empty() ? fmt::format("{}: {}", where, what)
                                   : fmt::format("{}: {}: {}", where, impl_->path, what));
}

bool YamlNode::HasSchema(const std::string& schema) const {
  return IsMap() && Has("schema") && At("schema").Text() == schema;
}

void YamlNode::RequireSchema(const std::string& schema) const {
  if (!IsMap())
    throw ErrorHere(
        fmt::format("a map with 'schema: {}' is expected, found {}", schema, KindOf(impl_->node)));
  if (!Has("schema")) throw ErrorHere(fmt::format("'schema: {}' is missing", schema));
  const YamlNode found = At("schema");
  if (found.Text() != schema) {
    throw found.ErrorHere(fmt::format("'{}' is expected, found '{}'", schema, Shown(found.Text())));
  }
}

void YamlNode::RequireKeys(const std::vector<std::string>& allowed,
                           const std::vector<RenamedWord>& renamed) const {
  if (!IsMap()) throw ErrorHere(fmt::format("a map is expected, found {}", KindOf(impl_->node)));
  std::set<std::string> seen;
  for (const auto& entry : impl_->node) {
    auto key_impl = std::make_shared<Impl>(*impl_);
    key_impl->node.reset(entry.first);
    const YamlNode key(key_impl);
    if (!entry.first.IsScalar()) throw key.ErrorHere("a key must be a plain word");
    const std::string name = entry.first.Scalar();
    const bool is_former =
        std::any_of(renamed.begin(), renamed.end(),
                    [&name](const RenamedWord& word) { return word.former == name; });
    if (!is_former && std::find(allowed.begin(), allowed.end(), name) == allowed.end()) {
      throw key.ErrorHere(
          fmt::format("unknown key '{}'; {}", Shown(name), SuggestionFor(name, allowed)));
    }
    if (!seen.insert(name).second)
      throw key.ErrorHere(fmt::format("key '{}' is given twice", Shown(name)));
  }
}

bool YamlNode::Has(const std::string& key) const { return Find(key).has_value(); }

std::optional<YamlNode> YamlNode::Find(const std::string& key) const {
  if (!IsMap()) throw ErrorHere(fmt::format("a map is expected, found {}", KindOf(impl_->node)));
  const YAML::Node& constant = impl_->node;  // the non-const operator[] would insert
  const YAML::Node child = constant[key];
  if (!child.IsDefined() || child.IsNull()) return std::nullopt;
  auto impl = std::make_shared<Impl>();
  impl->node.reset(child);
  impl->source = impl_->source;
  impl->path = impl_->path.empty() ? key : impl_->path + "." + key;
  return YamlNode(impl);
}

std::optional<YamlNode> YamlNode::Find(const RenamedWord& key,
                                       std::vector<std::string>* notices) const {
  const std::optional<YamlNode> former = Find(key.former);
  if (!former) return Find(key.now);
  if (Has(key.now)) {
    throw former->ErrorHere(
        fmt::format("'{}' is the former name of '{}', which is here as well: "
                    "give only '{}'",
                    key.former, key.now, key.now));
  }
  former->NoteFormerName(key, notices);
  return former;
}

// One line for all uses of a name in a file: a scene may have many layers.
void YamlNode::NoteFormerName(const RenamedWord& word, std::vector<std::string>* notices) const {
  const std::string text = DeprecationText(word);
  const auto ends_so = [&text](const std::string& notice) {
    return notice.size() >= text.size() &&
           notice.compare(notice.size() - text.size(), text.size(), text) == 0;
  };
  if (std::none_of(notices->begin(), notices->end(), ends_so)) {
    notices->emplace_back(ErrorHere(text).what());
  }
}

YamlNode YamlNode::At(const std::string& key) const {
  std::optional<YamlNode> child = Find(key);
  if (!child) throw ErrorHere(fmt::format("'{}' is missing", key));
  return *child;
}

bool YamlNode::IsMap() const { return impl_->node.IsMap(); }
bool YamlNode::IsSequence() const { return impl_->node.IsSequence(); }
bool YamlNode::IsScalar() const { return impl_->node.IsScalar(); }

std::vector<YamlNode> YamlNode::Elements() const {
  if (!IsSequence())
    throw ErrorHere(fmt::format("a list is expected, found {}", KindOf(impl_->node)));
  std::vector<YamlNode> elements;
  elements.reserve(impl_->node.size());
  for (const auto& child : impl_->node) {
    auto impl = std::make_shared<Impl>();
    impl->node.reset(child);
    impl->source = impl_->source;
    impl->path = fmt::format("{}[{}]", impl_->path, elements.size());
    elements.push_back(YamlNode(impl));
  }
  return elements;
}

std::vector<YamlNode> YamlNode::ElementsExactly(std::size_t count) const {
  std::vector<YamlNode> elements = Elements();
  if (elements.size() != count) {
    throw ErrorHere(fmt::format("a list of {} is expected, found {}", count, elements.size()));
  }
  return elements;
}

double YamlNode::Number() const {
  const std::string expected = "a number is expected";
  if (!IsScalar()) throw ErrorHere(fmt::format("{}, found {}", expected, KindOf(impl_->node)));
  const std::string& text = impl_->node.Scalar();
  const bool has_plus = text.rfind('+', 0) == 0 && text.rfind("+-", 0) != 0;
  const char* begin = text.data() + (has_plus ? 1 : 0);
  const char* end = text.data() + text.size();
  double value = 0;
  const auto [rest, status] = std::from_chars(begin, end, value);
  if (status != std::errc() || rest != end) {
    const bool has_unit = status == std::errc() && std::isfinite(value);
    throw ErrorHere(fmt::format(
        "{}, found '{}'{}", expected, Shown(text),
        has_unit ? "; the unit is in the key's name, the value is the bare number" : ""));
  }
  if (!std::isfinite(value))
    throw ErrorHere(fmt::format("a finite number is expected, found '{}'", Shown(text)));
  if (!(std::abs(value) <= kMaxMagnitude)) {
    throw ErrorHere(fmt::format("a number between {} and {} is expected, found '{}'",
                                -kMaxMagnitude, kMaxMagnitude, Shown(text)));
  }
  return value;
}

double YamlNode::PositiveNumber() const {
  const double value = Number();
  if (!(value > 0)) throw ErrorHere(fmt::format("must be > 0, found {}", value));
  if (!(value >= kMinPositive))
    throw ErrorHere(fmt::format("must be at least {}, found {}", kMinPositive, value));
  return value;
}

double YamlNode::NonNegativeNumber() const {
  const double value = Number();
  if (!(value >= 0)) throw ErrorHere(fmt::format("must be >= 0, found {}", value));
  return value;
}

int YamlNode::Integer(int min, int max) const {
  const std::string expected = fmt::format("a whole number from {} to {} is expected", min, max);
  if (!IsScalar()) throw ErrorHere(fmt::format("{}, found {}", expected, KindOf(impl_->node)));
  const std::string& text = impl_->node.Scalar();
  int value = 0;
  const auto [rest, status] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (status != std::errc() || rest != text.data() + text.size() || value < min || value > max) {
    throw ErrorHere(fmt::format("{}, found '{}'", expected, Shown(text)));
  }
  return value;
}

bool YamlNode::Boolean() const { return OneOf({"true", "false"}) == "true"; }

std::string YamlNode::Text() const {
  if (!IsScalar() || impl_->node.Scalar().empty()) {
    throw ErrorHere(fmt::format("text is expected, found {}", KindOf(impl_->node)));
  }
  return impl_->node.Scalar();
}

std::string YamlNode::OneOf(const std::vector<std::string>& allowed) const {
  const std::string text = Text();
  if (std::find(allowed.begin(), allowed.end(), text) == allowed.end()) {
    throw ErrorHere(fmt::format("one of {} is expected, found '{}'", Join(allowed), Shown(text)));
  }
  return text;
}

std::string YamlNode::OneOf(const std::vector<std::string>& allowed, const RenamedWord& value,
                            std::vector<std::string>* notices) const {
  if (Text() != value.former) return OneOf(allowed);
  NoteFormerName(value, notices);
  return value.now;
}

const std::string& YamlNode::path() const { return impl_->path; }
const std::string& YamlNode::source() const { return impl_->source; }

std::string YamlNode::ResolvePath(const std::string& relative) const {
  const std::filesystem::path path(relative);
  const std::filesystem::path folder = std::filesystem::path(impl_->source).parent_path();
  const std::string resolved =
      path.is_absolute() ? relative : (folder / path).lexically_normal().string();
  ReportInput(resolved);
  return resolved;
}

std::string YamlNumber(double value) { return fmt::format("{}", value); }

}  // namespace thicklens
