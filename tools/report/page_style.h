#ifndef THICKLENS_TOOLS_REPORT_PAGE_STYLE_H_
#define THICKLENS_TOOLS_REPORT_PAGE_STYLE_H_

#include <string>

namespace thicklens::tools {

// The style rules that the program's HTML pages share: light, dark and for print.
std::string PageStyle();

// Kinds of pages that replace only pages of their kind.
inline constexpr char kCalibrationPage[] = "calibration";
inline constexpr char kLightFieldPage[] = "light field";

// The tag in the head of a page by which the program recognises its own page of this kind.
std::string GeneratorTag(const std::string& kind);

// Returns a page's text up to its <main>; close it with "</main>\n</body>\n</html>\n". `style`
// follows the rules of PageStyle.
std::string PageHead(const std::string& kind, const std::string& title, const std::string& style);

// Replaces hyphens of negative numbers by minus signs; those of exponents stay.
std::string TrueMinus(const std::string& text);

// A table cell; one of class "number" holds a number.
std::string TableCell(const std::string& content, const std::string& css_class = "number");

}  // namespace thicklens::tools

#endif  // THICKLENS_TOOLS_REPORT_PAGE_STYLE_H_
