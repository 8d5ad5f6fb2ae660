// Fields of calibration files: maps of YAML or JSON, and OpenCV's XML.
#include <expat.h>
#include <fmt/format.h>

#include <charconv>
#include <cmath>
#include <cstdint>
#include <limits>
#include <map>
#include <utility>

#include "tools/io/lens/distortion_formats.h"

namespace thicklens::io {
namespace {

constexpr std::size_t kMaxNumbers = 64;
constexpr int kMaxSizePx = 100000;

class FieldsOfYaml : public CalibrationFields {
 public:
  explicit FieldsOfYaml(YamlNode node) : node_(std::move(node)) {}

  bool Has(const std::string& key) const override { return node_.Find(key).has_value(); }

  std::vector<double> Numbers(const std::string& key) const override {
    const YamlNode node = node_.At(key);
    const YamlNode list = node.IsMap() ? node.At("data") : node;
    std::vector<double> numbers;
    const auto add = [&](const YamlNode& number) {
      if (numbers.size() == kMaxNumbers)
        throw number.ErrorHere(fmt::format("at most {} numbers are expected", kMaxNumbers));
      numbers.push_back(number.Number());
    };
    for (const YamlNode& element : list.Elements()) {
      if (!element.IsSequence()) {
        add(element);
        continue;
      }
      for (const YamlNode& inner : element.Elements()) add(inner);
    }
    if (node.IsMap() && node.Has("rows") && node.Has("cols")) {
      const int most = static_cast<int>(kMaxNumbers);
      const auto count = static_cast<std::size_t>(node.At("rows").Integer(0, most)) *
                         static_cast<std::size_t>(node.At("cols").Integer(0, most));
      if (count != numbers.size()) {
        throw node.ErrorHere(
            fmt::format("rows times cols is {}, but data has {} numbers", count, numbers.size()));
      }
    }
    return numbers;
  }

  int Size(const std::string& key) const override { return node_.At(key).Integer(1, kMaxSizePx); }

  std::string Text(const std::string& key) const override { return node_.At(key).Text(); }

  std::unique_ptr<CalibrationFields> Below(const std::string& key) const override {
    const auto node = node_.Find(key);
    if (!node || !node->IsMap()) return nullptr;
    return YamlFields(*node);
  }

  Error ErrorAt(const std::string& key, const std::string& what) const override {
    const auto node = node_.Find(key);
    return node ? node->ErrorHere(what) : node_.ErrorHere(what);
  }

 private:
  YamlNode node_;
};

struct XmlElement {
  std::string text;
  int line = 0;
  std::map<std::string, XmlElement> inner;  // the first of each name
};

class FieldsOfXml : public CalibrationFields {
 public:
  FieldsOfXml(std::string name, XmlElement element)
      : name_(std::move(name)), element_(std::move(element)) {}

  bool Has(const std::string& key) const override { return element_.inner.count(key) > 0; }

  std::vector<double> Numbers(const std::string& key) const override {
    const XmlElement& element = At(key);
    const auto data = element.inner.find("data");
    std::vector<double> numbers;
    const std::string& text = data == element.inner.end() ? element.text : data->second.text;
    std::size_t at = 0;
    while ((at = text.find_first_not_of(" \t\r\n", at)) != std::string::npos) {
      const std::size_t end = std::min(text.find_first_of(" \t\r\n", at), text.size());
      if (numbers.size() == kMaxNumbers)
        throw ErrorAt(key, fmt::format("at most {} numbers are expected", kMaxNumbers));
      numbers.push_back(Number(key, text.substr(at, end - at)));
      at = end;
    }
    const auto rows = element.inner.find("rows"), cols = element.inner.find("cols");
    if (rows != element.inner.end() && cols != element.inner.end()) {
      const double count =
          Number(key, Trimmed(rows->second.text)) * Number(key, Trimmed(cols->second.text));
      if (count != static_cast<double>(numbers.size())) {
        throw ErrorAt(key, fmt::format("rows times cols is {}, but data has {} numbers", count,
                                       numbers.size()));
      }
    }
    return numbers;
  }

  int Size(const std::string& key) const override {
    const double number = Number(key, Text(key));
    if (!(number >= 1 && number <= kMaxSizePx && number == std::floor(number))) {
      throw ErrorAt(key, fmt::format("a whole number from 1 to {} is expected, found {}",
                                     kMaxSizePx, number));
    }
    return static_cast<int>(number);
  }

  std::string Text(const std::string& key) const override {
    std::string text = Trimmed(At(key).text);
    if (text.size() >= 2 && text.front() == '"' && text.back() == '"')
      text = text.substr(1, text.size() - 2);
    return text;
  }

  std::unique_ptr<CalibrationFields> Below(const std::string& key) const override {
    const auto found = element_.inner.find(key);
    if (found == element_.inner.end() || found->second.inner.empty()) return nullptr;
    return std::make_unique<FieldsOfXml>(name_, found->second);
  }

  Error ErrorAt(const std::string& key, const std::string& what) const override {
    const auto found = element_.inner.find(key);
    if (found == element_.inner.end()) return Error(fmt::format("{}: {}", name_, what));
    return Error(fmt::format("{}: line {}: {}: {}", name_, found->second.line, key, what));
  }

 private:
  static std::string Trimmed(const std::string& text) {
    const std::size_t first = text.find_first_not_of(" \t\r\n");
    if (first == std::string::npos) return "";
    return text.substr(first, text.find_last_not_of(" \t\r\n") - first + 1);
  }

  const XmlElement& At(const std::string& key) const {
    const auto found = element_.inner.find(key);
    if (found != element_.inner.end()) return found->second;
    throw Error(fmt::format("{}: the element {} is missing", name_, key));
  }

  double Number(const std::string& key, const std::string& text) const {
    double number = 0;
    const char* const end = text.data() + text.size();
    // OpenCV writes "2." for a whole number.
    const auto [stop, failure] = std::from_chars(text.data(), end, number);
    constexpr double kMax = 1e30;
    if (failure == std::errc() && stop == end && std::abs(number) <= kMax) return number;
    constexpr std::size_t kShown = 40;
    throw ErrorAt(key,
                  fmt::format("a finite number is expected, found '{}'", text.substr(0, kShown)));
  }

  std::string name_;
  XmlElement element_;
};

// Reads the elements of a document below its root.
class XmlReader {
 public:
  explicit XmlReader(const CalibrationText& text) : text_(text) {}

  XmlElement Read() {
    const std::unique_ptr<XML_ParserStruct, void (*)(XML_Parser)> parser(XML_ParserCreate(nullptr),
                                                                         XML_ParserFree);
    parser_ = parser.get();
    XML_SetUserData(parser_, this);
    XML_SetElementHandler(parser_, Begin, End);
    XML_SetCharacterDataHandler(parser_, Characters);
    XML_SetEntityDeclHandler(parser_, RefuseEntity);
    if (text_.bytes.size() > static_cast<std::size_t>(std::numeric_limits<int>::max()))
      throw Error(fmt::format("{}: it is too large for a calibration", text_.name));
    const auto status =
        XML_Parse(parser_, text_.bytes.data(), static_cast<int>(text_.bytes.size()), XML_TRUE);
    if (!fault_.empty()) throw Error(fmt::format("{}: {}", text_.name, fault_));
    if (status != XML_STATUS_OK) {
      throw Error(fmt::format("{}: line {}: not valid XML: {}", text_.name,
                              XML_GetCurrentLineNumber(parser_),
                              XML_ErrorString(XML_GetErrorCode(parser_))));
    }
    return std::move(root_);
  }

 private:
  static void Begin(void* data, const XML_Char* name, const XML_Char** /*attributes*/) {
    static_cast<XmlReader*>(data)->Open(name);
  }
  static void End(void* data, const XML_Char* /*name*/) {
    static_cast<XmlReader*>(data)->open_.pop_back();
  }
  static void Characters(void* data, const XML_Char* text, int length) {
    auto* reader = static_cast<XmlReader*>(data);
    if (!reader->open_.empty())
      reader->open_.back()->text.append(text, static_cast<std::size_t>(length));
  }
  static void RefuseEntity(void* data, const XML_Char*, int, const XML_Char*, int, const XML_Char*,
                           const XML_Char*, const XML_Char*, const XML_Char*) {
    static_cast<XmlReader*>(data)->Stop("it declares entities, which no calibration needs");
  }

  void Open(const std::string& name) {
    constexpr std::size_t kDeepest = 16, kMost = 10000;
    if (open_.size() == kDeepest || ++count_ > kMost) {
      Stop("its elements are nested more deeply or are more than in any calibration");
      open_.push_back(&other_);
      return;
    }
    if (open_.empty()) {
      open_.push_back(&root_);
      return;
    }
    auto& inner = open_.back()->inner;
    const bool is_new = inner.count(name) == 0;
    XmlElement* element = is_new ? &inner[name] : &other_;
    if (is_new) element->line = static_cast<int>(XML_GetCurrentLineNumber(parser_));
    open_.push_back(element);
  }

  void Stop(const std::string& fault) {
    if (fault_.empty()) fault_ = fault;
    XML_StopParser(parser_, XML_FALSE);
  }

  const CalibrationText& text_;
  XML_Parser parser_ = nullptr;
  XmlElement root_, other_;
  std::vector<XmlElement*> open_;
  std::size_t count_ = 0;
  std::string fault_;
};

}  // namespace

std::unique_ptr<CalibrationFields> YamlFields(const YamlNode& node) {
  return std::make_unique<FieldsOfYaml>(node);
}

std::unique_ptr<CalibrationFields> XmlFields(const CalibrationText& text) {
  return std::make_unique<FieldsOfXml>(text.name, XmlReader(text).Read());
}

Error NotOfOpenCv(const std::string& place, const std::string& model, const std::string& remedy) {
  return Error(
      fmt::format("{}: the model {} is none of those that are known here (OpenCV's perspective "
                  "model with up to "
                  "14 coefficients, and its fisheye model): {}",
                  place, model, remedy));
}

void ThrowNoSuchCamera(const CalibrationText& text, const std::vector<std::string>& cameras) {
  constexpr std::size_t kShown = 12;
  const std::size_t shown = std::min(kShown, cameras.size());
  throw Error(fmt::format(
      "{}: {}; its cameras are {}{}: state one behind a colon, {}:{}", text.name,
      text.camera.empty() ? fmt::format("it has {} cameras", cameras.size())
                          : fmt::format("it has no camera '{}'", text.camera),
      fmt::join(cameras.begin(), cameras.begin() + static_cast<std::ptrdiff_t>(shown), ", "),
      cameras.size() > shown ? fmt::format(" and {} more", cameras.size() - shown) : "", text.name,
      cameras.front()));
}

}  // namespace thicklens::io
