#include "tools/report/page_style.h"

#include <fmt/format.h>

#include <cstddef>

#include "thicklens/base/printable_text.h"

namespace thicklens::tools {

std::string PageStyle() {
  return R"(
:root { color-scheme: light dark; --paper: #ffffff; --ink: #1c2128; --soft: #59616c;
  --rule: #d9dde2; --panel: #f5f6f8; --ok: #008a64; --partial: #b87400; --refused: #b3261e; }
@media (prefers-color-scheme: dark) {
  :root { --paper: #14171c; --ink: #e4e7eb; --soft: #a0a8b4; --rule: #333a44;
    --panel: #1c2027; --ok: #35c79c; --partial: #f0b23a; --refused: #ff7b72; } }
@media print {
  :root { --paper: #ffffff; --ink: #1c2128; --soft: #59616c; --rule: #d9dde2; --panel: #f5f6f8;
    --ok: #008a64; --partial: #b87400; --refused: #b3261e; } }
* { box-sizing: border-box; }
body { margin: 0; background: var(--paper); color: var(--ink);
  font: 15px/1.5 system-ui, -apple-system, "Segoe UI", Roboto, sans-serif; }
main { max-width: 940px; margin: 0 auto; padding: 36px 24px 64px; }
h1 { font-size: 25px; line-height: 1.25; margin: 0 0 2px; font-weight: 600; }
h2 { font-size: 18px; margin: 40px 0 10px; font-weight: 600; }
.under-title { color: var(--soft); margin: 0 0 20px; overflow-wrap: anywhere; }
.verdict { border-left: 5px solid var(--verdict); background: var(--panel);
  padding: 14px 18px; border-radius: 0 6px 6px 0; }
.verdict p { margin: 6px 0 0; }
.verdict .outcome { margin: 0; font-size: 18px; font-weight: 600; color: var(--verdict); }
.ok { --verdict: var(--ok); } .partial { --verdict: var(--partial); }
.refused { --verdict: var(--refused); }
.warnings { margin: 14px 0 0; padding-left: 20px; }
.warnings li::marker { color: var(--partial); }
.wide { overflow-x: auto; }
table { border-collapse: collapse; font-size: 14px; font-variant-numeric: tabular-nums; }
th, td { padding: 5px 16px 5px 0; text-align: left; vertical-align: top;
  border-bottom: 1px solid var(--rule); }
th { font-weight: 500; } tbody th { min-width: 8em; } .name { min-width: 11em; }
.words { min-width: 12em; } tbody th, .name, .words { overflow-wrap: anywhere; }
thead th { color: var(--soft); font-weight: 500; vertical-align: bottom; }
.number { text-align: right; white-space: nowrap; }
.soft { color: var(--soft); }
.chosen { font-weight: 600; }
h3 { font-size: 15px; margin: 24px 0 6px; font-weight: 600; }
figure { margin: 22px 0 30px; break-inside: avoid; }
figcaption { color: var(--soft); font-size: 14px; margin-top: 6px; max-width: 80ch; }
figcaption b { color: var(--ink); font-weight: 600; }
.beside { display: flex; flex-wrap: wrap; gap: 10px; }
.thumbnails { display: grid; gap: 14px 12px; margin-top: 16px;
  grid-template-columns: repeat(auto-fill, minmax(180px, 1fr)); }
.thumbnails > div { break-inside: avoid; }
.thumbnails img { display: block; width: 100%; height: auto; border-radius: 2px; }
.thumbnails img.crisp { image-rendering: pixelated; }
.thumbnails span { display: block; margin-top: 4px; color: var(--soft); font-size: 12.5px;
  line-height: 1.35; overflow-wrap: anywhere; }
.thumbnails b { color: var(--ink); font-weight: 500; }
details { margin-top: 12px; } summary { cursor: pointer; color: var(--soft); }
@media print { body { font-size: 11pt; } main { padding: 0; max-width: none; }
  h2 { break-after: avoid; } tr { break-inside: avoid; } .wide { overflow-x: visible; } }
)";
}

std::string GeneratorTag(const std::string& kind) {
  return fmt::format("<meta name=\"generator\" content=\"thicklens, {}\"/>", kind);
}

std::string PageHead(const std::string& kind, const std::string& title, const std::string& style) {
  return fmt::format(
      "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\"/>\n"
      "<meta name=\"viewport\" content=\"width=device-width, initial-scale=1\"/>\n"
      "{}\n<title>{}</title>\n<style>{}{}</style>\n</head>\n<body>\n<main>\n",
      GeneratorTag(kind), EscapeXml(title), PageStyle(), style);
}

std::string TrueMinus(const std::string& text) {
  std::string out;
  for (std::size_t i = 0; i < text.size(); ++i)
    if (text[i] == '-' && (i == 0 || text[i - 1] != 'e'))
      out += "−";
    else
      out += text[i];
  return out;
}

std::string TableCell(const std::string& content, const std::string& css_class) {
  const bool is_number = css_class.rfind("number", 0) == 0;
  return fmt::format("<td class=\"{}\">{}</td>", css_class,
                     EscapeXml(is_number ? TrueMinus(content) : content));
}

}  // namespace thicklens::tools
