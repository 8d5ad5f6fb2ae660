#include <algorithm>
#include <string>

#include "tools/report/svg_plot.h"

namespace thicklens::tools {
namespace {

struct Colour {
  const char* name;
  const char* light;
  const char* dark;
};

// Colours by Okabe and Ito, which colour-blind readers can distinguish; lighter ones on a dark
// background.
constexpr Colour kColours[] = {
    {"--fit", "#0072b2", "#56b4e9"},   {"--source", "#d55e00", "#f08c3a"},
    {"--peak", "#008a64", "#35c79c"},  {"--data", "#4a4f57", "#ccd1d8"},
    {"--muted", "#8d949e", "#838a95"}, {"--truth", "#b8578d", "#e39cc3"},
    {"--axis", "#7a818b", "#8d949e"},  {"--grid", "#e6e8eb", "#2c3139"},
    {"--plate", "#ffffff", "#14171c"}, {"--words", "#1c2128", "#e4e7eb"}};

constexpr char kRules[] = R"(.plot text { fill: currentColor; font-variant-numeric: tabular-nums; }
.plot .note { font-style: italic; }
.plot .heading { font-weight: 600; }
.plot .grid line { stroke: var(--grid); stroke-width: 1; }
.plot .axis path { stroke: var(--axis); stroke-width: 1; fill: none; }
.ink-fit { color: var(--fit); } .ink-source { color: var(--source); }
.ink-peak { color: var(--peak); } .ink-data { color: var(--data); }
.ink-muted { color: var(--muted); } .ink-truth { color: var(--truth); }
.plot .line { stroke: currentColor; stroke-width: 1.6; fill: none; }
.plot .thin { stroke: currentColor; stroke-width: .9; fill: none; }
.plot .band { fill: currentColor; fill-opacity: .2; stroke: none; }
.plot .bar { stroke: currentColor; stroke-width: 1; opacity: .6; fill: none; }
.plot .full { fill: currentColor; }
.plot .empty { fill: none; stroke: var(--axis); stroke-dasharray: 3 3; }
.plot .on-dark { fill: #ffffff; } .plot .on-light { fill: #14171c; }
.plot .open { stroke: currentColor; stroke-width: 1.3; fill: none; }
)";

std::string Declarations(const char* Colour::*shade) {
  std::string text = ":root {";
  for (const Colour& colour : kColours)
    text += std::string(" ") + colour.name + ": " + colour.*shade + ";";
  return text + " }\n";
}

// The rules with the colours inserted, because many programs that show SVG files do not support
// variables.
std::string Resolved(std::string rules, const char* Colour::*shade) {
  for (const Colour& colour : kColours) {
    const std::string reference = std::string("var(") + colour.name + ")";
    for (std::size_t at = rules.find(reference); at != rules.npos; at = rules.find(reference, at))
      rules.replace(at, reference.size(), colour.*shade);
  }
  return rules;
}

}  // namespace

std::string SvgPlotStyle() {
  return Declarations(&Colour::light) + "@media (prefers-color-scheme: dark) { " +
         Declarations(&Colour::dark) + "}\n@media print { " + Declarations(&Colour::light) +
         "}\n.plot { display: block; max-width: 100%; height: auto; font-size: 12px; }\n" + kRules;
}

std::string SvgFile(const std::string& element) {
  static const std::string begin = "<svg ";
  const std::string rules = std::string(
                                ".plot { color: var(--words); font: 12px sans-serif; }\n"
                                ".plate { fill: var(--plate); }\n") +
                            kRules;
  const std::size_t content = element.find('>') + 1;
  return "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n" + begin +
         "xmlns=\"http://www.w3.org/2000/svg\" " +
         element.substr(begin.size(), content - begin.size()) + "\n<style>" +
         Resolved(rules, &Colour::light) + "@media screen and (prefers-color-scheme: dark) {\n" +
         Resolved(rules, &Colour::dark) + "}\n</style>\n" +
         "<rect class=\"plate\" width=\"100%\" height=\"100%\"/>" + element.substr(content);
}

}  // namespace thicklens::tools
