#include "tools/report/embedded_report.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <opencv2/core.hpp>
#include <set>
#include <string>

#include "support/error_message.h"
#include "tools/report/calibration_report.h"
#include "tools/support/fake_calibration.h"
#include "tools/support/xml_elements.h"

namespace thicklens::tools {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;
using ::testing::StartsWith;
using thicklens::testing::ErrorOf;

std::string Report() {
  MadeUpCalibration made = MakeUpCalibration(31, 330, 5);
  RejectFrame(3, "dark: <0.01 & so on", &made.calibration);
  made.sweep.camera.name = "Ünïcode & <b>";
  return MakeCalibrationReport(made.sweep, made.calibration, &made.truth,
                               {"sweep.yaml", "0.1.0", "2026-01-31", {}},
                               [](std::size_t) { return cv::Mat(300, 400, CV_8U, cv::Scalar(9)); })
      .html;
}

std::string Inlined(const std::string& main) {
  return InlinedCalibrationReport("<html><main>" + main + "</main></html>", "r.html");
}

TEST(InlinedReport, KeepsAllOfTheReport) {
  const std::string report = Report();
  const XmlDocument before = ParseXml(report);
  const XmlDocument after =
      ParseXml("<main>" + InlinedCalibrationReport(report, "r.html") + "</main>");
  ASSERT_EQ(after.error, "");
  for (const char* element :
       {"svg", "table", "td", "path", "figcaption", "details", "li", "img", "rect"}) {
    EXPECT_EQ(after.Named(element).size(), before.Named(element).size()) << element;
  }
  std::string text_before, text_after;
  for (const XmlElement& cell : before.Named("td")) text_before += cell.text + "|";
  for (const XmlElement& cell : after.Named("td")) text_after += cell.text + "|";
  EXPECT_EQ(text_after, text_before);
}

TEST(InlinedReport, HeadingsGoOneLevelDown) {
  const std::string report = Report();
  const XmlDocument before = ParseXml(report);
  const XmlDocument after =
      ParseXml("<main>" + InlinedCalibrationReport(report, "r.html") + "</main>");
  EXPECT_TRUE(after.Named("h1").empty());
  EXPECT_EQ(after.Named("h2").size(), 1u);
  EXPECT_EQ(after.Named("h3").size(), before.Named("h2").size());
  EXPECT_EQ(after.Named("h4").size(), before.Named("h3").size());
}

TEST(InlinedReport, IdsGetAPrefixAndAreStillFound) {
  const XmlDocument document =
      ParseXml("<main>" + InlinedCalibrationReport(Report(), "r.html") + "</main>");
  std::set<std::string> ids;
  for (const XmlElement& element : document.elements) {
    const std::string id = element.Attribute("id");
    if (id.empty()) continue;
    EXPECT_THAT(id, StartsWith("calibration-"));
    EXPECT_TRUE(ids.insert(id).second) << id;
  }
  int references = 0;
  for (const XmlElement& element : document.elements) {
    for (const std::string& reference :
         {element.Attribute("aria-labelledby"), element.Attribute("clip-path")}) {
      if (reference.empty()) continue;
      ++references;
      const bool is_url = reference.rfind("url(#", 0) == 0;
      const std::string id = is_url ? reference.substr(5, reference.size() - 6) : reference;
      EXPECT_EQ(ids.count(id), 1u) << reference;
    }
  }
  EXPECT_EQ(references, 19);  // ten drawings with a title, all but the field with a clip
}

TEST(InlinedReport, RefusesWhatIsNoReport) {
  EXPECT_THAT(ErrorOf([] { InlinedCalibrationReport("{\"a\": 1}", "r.html"); }),
              StartsWith("r.html: not a page of `thicklens calibrate --report`"));
  EXPECT_THAT(ErrorOf([] { InlinedCalibrationReport("</main><main>", "r.html"); }),
              HasSubstr("<main>"));
}

TEST(InlinedReport, LetsNothingInThatRunsOrLoads) {
  for (const char* markup : {"<script>alert(1)</script>",
                             "<p onclick=\"x()\">a</p>",
                             "<img src=\"x\"/>",
                             "<img src=\"http://x/y.png\"/>",
                             "<img src=\"data:image/svg+xml;base64,PHN2Zy8+\"/>",
                             "<img src=\"data:text/html;base64,eA==\"/>",
                             "<img src=\"data:image/png;base64,\"/>",
                             "<img src=\"data:image/png;base64,a b\"/>",
                             "<rect fill=\"url(http://x)\"/>",
                             "<p style=\"max-width: 3px; color: red\">a</p>",
                             "<p style=\"max-width: px\">a</p>",
                             "<p style=\"background: url(http://x)\">a</p>",
                             "<a href=\"http://x\">a</a>",
                             "<g clip-path=\"url(http://x)\"></g>",
                             "<g clip-path=\" url(http://x)\"></g>",
                             "<!-- x -->",
                             "<![CDATA[x]]>",
                             "<?php x ?>",
                             "<iframe/>",
                             "<P>a</P>"}) {
    EXPECT_THAT(ErrorOf([&] { Inlined(markup); }), StartsWith("r.html: ")) << markup;
  }
}

TEST(InlinedReport, RefusesBrokenMarkup) {
  for (const char* markup :
       {"<p>a", "a</p>", "<p><b>a</p></b>", "<p", "<p class>a</p>", "<p class=a>b</p>",
        "<p class=\"a>b</p>", "<p class=\"a\"class=\"b\">c</p>", "<p class=\"a\" class=\"b\">c</p>",
        "<p class=\"<\">a</p>", "a & b", "&nbsp;", "&#0;", "\xff", "\x01", "< p>a</p>"}) {
    EXPECT_THAT(ErrorOf([&] { Inlined(markup); }), StartsWith("r.html: ")) << markup;
  }
  const std::string image =
      "<img src=\"data:image/png;base64,iVBORw0K+/==\" alt=\"a\" style=\"max-width: 80px\"/>";
  EXPECT_EQ(Inlined(image), image);
  EXPECT_EQ(Inlined("<p class=\"x\">a &amp; b</p><rect/>"), "<p class=\"x\">a &amp; b</p><rect/>");
}

}  // namespace
}  // namespace thicklens::tools
