#include "tools/report/embedded_report.h"

#include <fmt/format.h>

#include <cstddef>
#include <set>
#include <string_view>
#include <vector>

#include "thicklens/base/error.h"
#include "thicklens/base/printable_text.h"

namespace thicklens::tools {
namespace {

constexpr char kBegin[] = "<main>";
constexpr char kEnd[] = "</main>";
constexpr char kIdPrefix[] = "calibration-";
constexpr char kNameLetters[] = "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789-";

bool IsKnownElement(const std::string& name) {
  static const std::set<std::string> known = {
      "b",    "circle", "clipPath", "details", "div",   "figcaption", "figure", "g",
      "h1",   "h2",     "h3",       "img",     "li",    "line",       "p",      "path",
      "rect", "span",   "summary",  "svg",     "table", "tbody",      "td",     "text",
      "th",   "thead",  "title",    "tr",      "ul"};
  return known.count(name) > 0;
}

bool IsKnownAttribute(const std::string& name) {
  static const std::set<std::string> known = {"alt",
                                              "aria-labelledby",
                                              "class",
                                              "clip-path",
                                              "cx",
                                              "cy",
                                              "d",
                                              "fill",
                                              "height",
                                              "id",
                                              "r",
                                              "role",
                                              "scope",
                                              "src",
                                              "stroke-dasharray",
                                              "style",
                                              "text-anchor",
                                              "transform",
                                              "viewBox",
                                              "width",
                                              "x",
                                              "x1",
                                              "x2",
                                              "y",
                                              "y1",
                                              "y2"};
  return known.count(name) > 0;
}

bool IsMadeOf(std::string_view text, std::string_view letters) {
  return !text.empty() && text.find_first_not_of(letters) == text.npos;
}

bool TakesPrefix(std::string_view prefix, std::string_view* text) {
  if (text->substr(0, prefix.size()) != prefix) return false;
  text->remove_prefix(prefix.size());
  return true;
}

// Returns whether an image carries its data, in one of the two formats that a report uses.
bool IsInlineImage(std::string_view source) {
  return (TakesPrefix("data:image/png;base64,", &source) ||
          TakesPrefix("data:image/jpeg;base64,", &source)) &&
         IsMadeOf(source, "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/=");
}

// Returns whether an attribute that could load something contains only what a report writes there.
bool IsHarmless(const std::string& key, std::string_view value) {
  if (key == "src") return IsInlineImage(value);
  if (key == "fill") return TakesPrefix("#", &value) && IsMadeOf(value, "0123456789abcdef");
  if (key != "style") return true;
  const bool is_width = TakesPrefix("max-width: ", &value) && value.size() > 2 &&
                        value.substr(value.size() - 2) == "px";
  return is_width && IsMadeOf(value.substr(0, value.size() - 2), "0123456789");
}

// Recognises character references as EscapeXml writes them.
bool IsReference(std::string_view text) {
  static const std::set<std::string_view> known = {"&amp;", "&lt;", "&gt;", "&quot;", "&#39;"};
  return known.count(text) > 0;
}

// Reads the markup from its beginning to its end and writes it again.
class Inliner {
 public:
  Inliner(std::string_view markup, const std::string& name) : markup_(markup), name_(name) {}

  std::string Run() {
    while (at_ < markup_.size()) {
      if (markup_[at_] == '<') {
        TakeTag();
      } else {
        TakeText();
      }
    }
    if (!open_.empty()) Refuse(fmt::format("<{}> is not closed", open_.back()));
    return out_;
  }

 private:
  [[noreturn]] void Refuse(const std::string& why) const {
    throw Error(fmt::format("{}: not a page of `thicklens calibrate --report`: {}", name_,
                            PrintableUtf8(why)));
  }

  // Checks text and attribute values: printable UTF-8, with no references except the usual ones.
  std::string CheckedText(std::string_view text) const {
    std::string lines;
    for (char c : text) lines += c == '\n' ? ' ' : c;
    if (PrintableUtf8(lines) != lines) Refuse("a text in it is not UTF-8");
    for (std::size_t i = text.find('&'); i != text.npos; i = text.find('&', i + 1)) {
      const std::size_t end = text.find(';', i);
      if (end == text.npos || !IsReference(text.substr(i, end - i + 1))) Refuse("a stray '&'");
    }
    return std::string(text);
  }

  void TakeText() {
    const std::size_t end = std::min(markup_.find('<', at_), markup_.size());
    out_ += CheckedText(markup_.substr(at_, end - at_));
    at_ = end;
  }

  std::string TakeName() {
    const std::size_t end = std::min(markup_.find_first_not_of(kNameLetters, at_), markup_.size());
    const std::string name(markup_.substr(at_, end - at_));
    at_ = end;
    return name;
  }

  bool TakeIf(std::string_view expected) {
    if (markup_.substr(at_, expected.size()) != expected) return false;
    at_ += expected.size();
    return true;
  }

  void TakeTag() {
    TakeIf("<");
    const bool closes = TakeIf("/");
    const std::string name = TakeName();
    if (!IsKnownElement(name)) {
      Refuse(name.empty() ? "markup other than elements" : fmt::format("<{}> in it", name));
    }
    out_ += (closes ? "</" : "<") + Lowered(name);
    if (closes) {
      if (open_.empty() || open_.back() != name || !TakeIf(">")) {
        Refuse(fmt::format("</{}> closes nothing", name));
      }
      open_.pop_back();
      out_ += '>';
      return;
    }
    std::set<std::string> seen;
    while (TakeSpace()) {
      if (!TakeAttribute(name, &seen)) break;
    }
    if (TakeIf("/>")) {
      out_ += "/>";
    } else if (TakeIf(">")) {
      open_.push_back(name);
      out_ += '>';
    } else {
      Refuse(fmt::format("a broken <{}>", name));
    }
  }

  bool TakeSpace() {
    const std::size_t from = at_;
    while (at_ < markup_.size() && (markup_[at_] == ' ' || markup_[at_] == '\n')) ++at_;
    return at_ > from;
  }

  bool TakeAttribute(const std::string& element, std::set<std::string>* seen) {
    const std::string key = TakeName();
    if (key.empty()) return false;
    if (!IsKnownAttribute(key) || !seen->insert(key).second) {
      Refuse(fmt::format("<{}> with {}", element, key));
    }
    const std::size_t end = TakeIf("=\"") ? markup_.find('"', at_) : markup_.npos;
    if (end == markup_.npos) Refuse(fmt::format("a broken <{}>", element));
    const std::string value = CheckedText(markup_.substr(at_, end - at_));
    if (value.find('<') != value.npos) Refuse(fmt::format("a broken <{}>", element));
    if (!IsHarmless(key, value)) Refuse(fmt::format("<{}> with {}", element, key));
    at_ = end + 1;
    out_ += fmt::format(" {}=\"{}\"", key, Referring(element, key, value));
    return true;
  }

  // Puts the prefix in front of ids, and of references to them.
  std::string Referring(const std::string& element, const std::string& key,
                        const std::string& value) const {
    if (key == "id" || key == "aria-labelledby") return kIdPrefix + value;
    const std::string url = "url(";
    if (value.find(url) == value.npos) return value;
    if (value.rfind(url + "#", 0) != 0) Refuse(fmt::format("<{}> with {}", element, value));
    return fmt::format("url(#{}{}", kIdPrefix, value.substr(url.size() + 1));
  }

  static std::string Lowered(const std::string& name) {
    return name == "h1" ? "h2" : name == "h2" ? "h3" : name == "h3" ? "h4" : name;
  }

  std::string_view markup_;
  std::string name_;
  std::size_t at_ = 0;
  std::vector<std::string> open_;
  std::string out_;
};

}  // namespace

std::string InlinedCalibrationReport(const std::string& html, const std::string& name) {
  const std::size_t begin = html.find(kBegin);
  const std::size_t end = html.rfind(kEnd);
  if (begin == html.npos || end == html.npos || end < begin) {
    throw Error(fmt::format(
        "{}: not a page of `thicklens calibrate --report`: there is no <main> in it", name));
  }
  const std::size_t from = begin + sizeof(kBegin) - 1;
  return Inliner(std::string_view(html).substr(from, end - from), name).Run();
}

}  // namespace thicklens::tools
