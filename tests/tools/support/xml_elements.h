#ifndef THICKLENS_TESTS_TOOLS_SUPPORT_XML_ELEMENTS_H_
#define THICKLENS_TESTS_TOOLS_SUPPORT_XML_ELEMENTS_H_

#include <expat.h>
#include <fmt/format.h>

#include <map>
#include <string>
#include <vector>

namespace thicklens::tools {

struct XmlElement {
  std::string name;
  std::map<std::string, std::string> attributes;
  std::string text;          // its own, without its children's
  std::string parent_class;  // class of the parent element
  int plot = -1;             // which <svg> of the document it is in

  std::string Attribute(const std::string& key) const {
    const auto found = attributes.find(key);
    return found == attributes.end() ? "" : found->second;
  }
  double Number(const std::string& key) const { return std::stod(attributes.at(key)); }
};

struct XmlDocument {
  std::string error;  // empty: well-formed
  std::vector<XmlElement> elements;

  std::vector<XmlElement> Named(const std::string& name, int plot = -1) const {
    std::vector<XmlElement> found;
    for (const XmlElement& element : elements)
      if (element.name == name && (plot < 0 || element.plot == plot)) found.push_back(element);
    return found;
  }
};

// Parses with expat, which accepts well-formed documents alone.
inline XmlDocument ParseXml(const std::string& text) {
  struct State {
    XmlDocument document;
    std::vector<std::size_t> open;
    int plots = 0;
    bool in_plot = false;
  } state;
  XML_Parser parser = XML_ParserCreate("UTF-8");
  XML_SetUserData(parser, &state);
  XML_SetElementHandler(
      parser,
      [](void* data, const XML_Char* name, const XML_Char** attributes) {
        auto& s = *static_cast<State*>(data);
        XmlElement element;
        element.name = name;
        for (int i = 0; attributes[i] != nullptr; i += 2)
          element.attributes[attributes[i]] = attributes[i + 1];
        if (element.name == "svg") {
          ++s.plots;
          s.in_plot = true;
        }
        if (s.in_plot) element.plot = s.plots - 1;
        if (!s.open.empty())
          element.parent_class = s.document.elements[s.open.back()].Attribute("class");
        s.open.push_back(s.document.elements.size());
        s.document.elements.push_back(element);
      },
      [](void* data, const XML_Char* name) {
        auto& s = *static_cast<State*>(data);
        if (std::string(name) == "svg") s.in_plot = false;
        s.open.pop_back();
      });
  XML_SetCharacterDataHandler(parser, [](void* data, const XML_Char* content, int length) {
    auto& s = *static_cast<State*>(data);
    if (!s.open.empty())
      s.document.elements[s.open.back()].text.append(content, static_cast<std::size_t>(length));
  });
  if (XML_Parse(parser, text.data(), static_cast<int>(text.size()), 1) == XML_STATUS_ERROR)
    state.document.error = fmt::format("line {}: {}", XML_GetCurrentLineNumber(parser),
                                       XML_ErrorString(XML_GetErrorCode(parser)));
  XML_ParserFree(parser);
  return state.document;
}

}  // namespace thicklens::tools

#endif  // THICKLENS_TESTS_TOOLS_SUPPORT_XML_ELEMENTS_H_
