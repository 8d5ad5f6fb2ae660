#include "tools/report/svg_plot.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <random>

#include "support/special_numbers.h"
#include "thicklens/base/printable_text.h"
#include "tools/support/xml_elements.h"

namespace thicklens::tools {
namespace {

using ::testing::DoubleNear;
using ::testing::ElementsAre;
using ::testing::IsEmpty;

using thicklens::testing::kNan;

Plot PlotOf(std::vector<double> x, std::vector<double> y) {
  Plot plot;
  plot.id = "p";
  plot.title = "a title";
  plot.x_axis.label = "x [mm]";
  plot.y_axis.label = "y [px]";
  PlotSeries series;
  series.label = "points";
  series.x = std::move(x);
  series.y = std::move(y);
  plot.series.push_back(series);
  return plot;
}

// The circles of the data; the first one in the file is that of the legend.
std::vector<XmlElement> DataCircles(const XmlDocument& document) {
  std::vector<XmlElement> circles = document.Named("circle");
  if (!circles.empty()) circles.erase(circles.begin());
  return circles;
}

TEST(EscapeXml, KeepsTextAndEscapesMarkup) {
  EXPECT_EQ(EscapeXml("a<b>&\"c\"'#"), "a&lt;b&gt;&amp;&quot;c&quot;&#39;#");
  EXPECT_EQ(EscapeXml("κ = 0.45 ± 0.01, 写真 😀"), "κ = 0.45 ± 0.01, 写真 😀");
}

TEST(PrintableUtf8, ReplacesWhatXmlAndJsonCannotCarry) {
  EXPECT_EQ(PrintableUtf8("a\x1b[31mb\n"), "a\uFFFD[31mb\uFFFD");
  EXPECT_EQ(PrintableUtf8("x\xFFy"), "x\uFFFDy");
  EXPECT_EQ(PrintableUtf8("cut \xE2\x82"), "cut \uFFFD\uFFFD");    // a sequence cut short
  EXPECT_EQ(PrintableUtf8("\xC0\xAF"), "\uFFFD\uFFFD");            // overlong '/'
  EXPECT_EQ(PrintableUtf8("\xED\xA0\x80"), "\uFFFD\uFFFD\uFFFD");  // a surrogate
  EXPECT_EQ(PrintableUtf8("\xEF\xBF\xBF"), "\uFFFD\uFFFD\uFFFD");  // U+FFFF
  EXPECT_EQ(PrintableUtf8("\xF4\x90\x80\x80").find('\xF4'), std::string::npos);  // > U+10FFFF
  EXPECT_EQ(PrintableUtf8("\xC2\x85"), "\uFFFD\uFFFD");                          // a C1 control
}

TEST(NiceTicks, KnownRanges) {
  EXPECT_THAT(NiceTicks(0, 10, 6), ElementsAre(0, 2, 4, 6, 8, 10));
  EXPECT_THAT(
      NiceTicks(-0.13, 0.27, 4),
      ElementsAre(DoubleNear(-0.1, 1e-12), 0, DoubleNear(0.1, 1e-12), DoubleNear(0.2, 1e-12)));
  EXPECT_THAT(NiceTicks(1, 1, 5), IsEmpty());
  EXPECT_THAT(NiceTicks(kNan, 1, 5), IsEmpty());
  EXPECT_THAT(NiceTicks(0, std::numeric_limits<double>::infinity(), 5), IsEmpty());
}

TEST(NiceTicks, AreTheFinestRoundOnesThatFit) {
  std::mt19937 generator(3);
  std::uniform_real_distribution<double> start(-1000, 1000), exponent(-6, 6);
  for (int trial = 0; trial < 2000; ++trial) {
    const double lo = start(generator);
    const double span = std::pow(10, exponent(generator));
    const int at_most = 3 + trial % 10;
    const std::vector<double> ticks = NiceTicks(lo, lo + span, at_most);
    ASSERT_LE(ticks.size(), static_cast<std::size_t>(at_most));
    ASSERT_FALSE(ticks.empty());
    for (double tick : ticks) {
      EXPECT_GE(tick, lo - 1e-6 * span);
      EXPECT_LE(tick, lo + span * (1 + 1e-6));
    }
    // A step of 2 or 2.5 times the finest that could fit is always among the round ones.
    if (ticks.size() > 1) {
      EXPECT_LT(ticks[1] - ticks[0], 2.5 * span / (at_most - 1) * 1.001);
      const double step = ticks[1] - ticks[0];
      const double mantissa = step / std::pow(10, std::floor(std::log10(step) + 1e-6));
      EXPECT_TRUE(std::abs(mantissa - 1) < 1e-4 || std::abs(mantissa - 2) < 1e-4 ||
                  std::abs(mantissa - 5) < 1e-4)
          << step;
    }
  }
}

TEST(NiceLogTicks, ArePowersOfTenOrRoundNumbersBetween) {
  EXPECT_THAT(NiceLogTicks(0.8, 12, 8), ElementsAre(1, 2, 5, DoubleNear(10, 1e-9)));
  EXPECT_THAT(NiceLogTicks(0.01, 1000, 6),
              ElementsAre(DoubleNear(0.01, 1e-9), DoubleNear(0.1, 1e-9), 1, DoubleNear(10, 1e-9),
                          DoubleNear(100, 1e-9), DoubleNear(1000, 1e-9)));
  EXPECT_LE(NiceLogTicks(1e-9, 1e9, 5).size(), 5U);
  EXPECT_THAT(NiceLogTicks(2.1, 3.9, 6), ElementsAre(2.5, 3, 3.5));  // as on a plain axis
  EXPECT_THAT(NiceLogTicks(0, 1, 5), IsEmpty());
  EXPECT_THAT(NiceLogTicks(2, 1, 5), IsEmpty());
}

TEST(TickLabel, HasTheDigitsOfItsStep) {
  EXPECT_EQ(TickLabel(0.5, 0.5), "0.5");
  EXPECT_EQ(TickLabel(1, 0.5), "1.0");
  EXPECT_EQ(TickLabel(400, 20), "400");
  EXPECT_EQ(TickLabel(0.0025, 0.0005), "0.0025");
  EXPECT_EQ(TickLabel(-5, 5), "−5");
}

TEST(SvgPlot, PutsPointsWhereTheyBelong) {
  Plot plot = PlotOf({0, 1, 2}, {10, 20, 30});
  plot.x_axis.range = {{0, 4}};
  plot.y_axis.range = {{0, 40}};
  const XmlDocument document = ParseXml(SvgPlot(plot));
  ASSERT_EQ(document.error, "");
  const std::vector<XmlElement> circles = DataCircles(document);
  ASSERT_EQ(circles.size(), 3u);
  // The tick labels give the position of a number: x labels are centred, y labels end at the axis.
  double x_of_2 = 0, y_of_20 = 0;
  for (const XmlElement& text : document.Named("text")) {
    if (text.text == "2.0" && text.Attribute("text-anchor") == "middle") x_of_2 = text.Number("x");
    if (text.text == "20" && text.Attribute("text-anchor") == "end") y_of_20 = text.Number("y") - 4;
  }
  EXPECT_NEAR(circles[2].Number("cx"), x_of_2, 0.15);
  EXPECT_NEAR(circles[1].Number("cy"), y_of_20, 0.15);
  EXPECT_NEAR(circles[1].Number("cx") - circles[0].Number("cx"),
              circles[2].Number("cx") - circles[1].Number("cx"), 0.15);
  EXPECT_GT(circles[0].Number("cy"), circles[2].Number("cy"));  // up is more
}

TEST(SvgPlot, LogarithmicAxesPutEqualRatiosEquallyFar) {
  Plot plot = PlotOf({0.1, 1, 10, -3}, {2, 20, 200, 5});
  plot.x_axis.logarithmic = plot.y_axis.logarithmic = true;
  const XmlDocument document = ParseXml(SvgPlot(plot));
  ASSERT_EQ(document.error, "");
  const std::vector<XmlElement> circles = DataCircles(document);
  ASSERT_EQ(circles.size(), 3u);  // values that are not above 0 are left out
  for (const char* place : {"cx", "cy"}) {
    const double first = circles[1].Number(place) - circles[0].Number(place);
    EXPECT_NEAR(circles[2].Number(place) - circles[1].Number(place), first, 0.11) << place;
    EXPECT_GT(std::abs(first), 50) << place;
  }
}

TEST(SvgPlot, LeavesOutWhatIsNotFiniteAndBreaksTheLineThere) {
  Plot plot = PlotOf({0, 1, 2, 3, 4}, {1, 2, kNan, 2, 1});
  plot.series[0].stroke = Stroke::kSolid;
  const std::string svg = SvgPlot(plot);
  const XmlDocument document = ParseXml(svg);
  ASSERT_EQ(document.error, "");
  EXPECT_EQ(DataCircles(document).size(), 4u);
  EXPECT_EQ(svg.find("nan"), std::string::npos);
  for (const XmlElement& path : document.Named("path")) {
    if (path.Attribute("class") != "line") continue;
    const std::string d = path.Attribute("d");
    EXPECT_EQ(std::count(d.begin(), d.end(), 'M'), 2);
  }
}

TEST(SvgPlot, ShowsPointsBeyondTheRangeAsTriangles) {
  Plot plot = PlotOf({0, 1, 2}, {0, 100, 0});
  plot.y_axis.range = {{-1, 1}};
  const XmlDocument document = ParseXml(SvgPlot(plot));
  EXPECT_EQ(DataCircles(document).size(), 2u);
  const std::vector<XmlElement> paths = document.Named("path");
  EXPECT_EQ(std::count_if(paths.begin(), paths.end(),
                          [](const XmlElement& path) {
                            return path.Attribute("class") == "open" &&
                                   path.Attribute("d").back() == 'z';
                          }),
            1);
}

TEST(SvgPlot, SaysThatALineIsOutside) {
  Plot plot = PlotOf({0, 1, 2}, {0, 1, 0});
  plot.lines.push_back({"near", Ink::kFit, Stroke::kSolid, true, 2.5});
  plot.lines.push_back({"far", Ink::kFit, Stroke::kSolid, true, 50});
  const std::string svg = SvgPlot(plot);
  EXPECT_NE(svg.find(">near</text>"), std::string::npos);
  EXPECT_NE(svg.find(">far (outside the plot)</text>"), std::string::npos);
}

TEST(SvgPlot, OneHugeErrorBarDoesNotFlattenTheRest) {
  Plot plot = PlotOf({0, 1, 2}, {1, 2, 3});
  plot.series[0].y_error = {0.1, 1e6, 0.1};
  const std::vector<XmlElement> circles = DataCircles(ParseXml(SvgPlot(plot)));
  ASSERT_EQ(circles.size(), 3u);
  EXPECT_GT(circles[0].Number("cy") - circles[2].Number("cy"), 80);
}

TEST(SvgPlot, EscapesEveryWord) {
  Plot plot = PlotOf({0, 1}, {0, 1});
  const std::string nasty = "<&\"#'\x01\xFF>";
  plot.title = plot.x_axis.label = plot.y_axis.label = plot.series[0].label = nasty;
  plot.series[0].names = {nasty, nasty};
  plot.notes = {{nasty, 0.5, 0.5}};
  plot.lines.push_back({nasty, Ink::kFit, Stroke::kSolid, true, 0.5});
  const XmlDocument document = ParseXml(SvgPlot(plot));
  ASSERT_EQ(document.error, "");
  int found = 0;
  for (const XmlElement& element : document.elements)
    found += element.text == "<&\"#'\uFFFD\uFFFD>";
  EXPECT_EQ(found, 8);
}

TEST(SvgPlot, NoDataIsAnEmptyPlot) {
  EXPECT_EQ(ParseXml(SvgPlot(PlotOf({}, {}))).error, "");
  EXPECT_EQ(ParseXml(SvgPlot(PlotOf({kNan}, {kNan}))).error, "");
  EXPECT_EQ(ParseXml(SvgPlot(PlotOf({5, 5}, {0, 0}))).error, "");
}

// Labels of one axis must not touch, whatever the range: 12 px type is at most 8 px a digit wide.
TEST(SvgPlot, TickLabelsDoNotTouch) {
  const double starts[] = {-1e5, -312.25, 0, 0.001, 30, 395.5, 1e6};
  const double spans[] = {1e-3, 0.37, 2, 30, 131, 1970, 3e5};
  for (double lo : starts) {
    for (double span : spans) {
      const XmlDocument document = ParseXml(SvgPlot(PlotOf({lo, lo + span}, {lo, lo + span})));
      double last_end = -1e9, last_y = 1e9;
      int x_labels = 0, y_labels = 0;
      for (const XmlElement& text : document.Named("text")) {
        if (text.Attribute("class") == "name") continue;
        const double width =
            8.0 * static_cast<double>(std::count_if(text.text.begin(), text.text.end(),
                                                    [](char c) { return (c & 0xC0) != 0x80; }));
        if (text.Attribute("text-anchor") == "middle") {
          EXPECT_GT(text.Number("x") - width / 2, last_end) << lo << " " << span;
          last_end = text.Number("x") + width / 2;
          ++x_labels;
        } else if (text.Attribute("text-anchor") == "end") {
          EXPECT_LT(text.Number("y"), last_y - 12);
          EXPECT_GT(text.Number("x") - width, 13) << "runs into the axis name";
          last_y = text.Number("y");
          ++y_labels;
        }
      }
      EXPECT_GE(x_labels, 2) << lo << " " << span;
      EXPECT_GE(y_labels, 2) << lo << " " << span;
    }
  }
}

// The entries of the legend are separate and inside the drawing.
TEST(SvgPlot, LegendEntriesDoNotTouch) {
  Plot plot = PlotOf({0, 1}, {0, 1});
  for (int i = 0; i < 9; ++i)
    plot.lines.push_back({"zf, sharpness peak: 400.123 mm", Ink::kFit, Stroke::kSolid, true, 0.5});
  double last_end = 0, last_y = 0;
  for (const XmlElement& text : ParseXml(SvgPlot(plot)).Named("text")) {
    if (!text.Attribute("text-anchor").empty()) continue;
    if (text.Number("y") > last_y) last_end = 0;
    EXPECT_GT(text.Number("x"), last_end);
    last_end = text.Number("x") + 7.2 * static_cast<double>(text.text.size());
    EXPECT_LE(last_end, plot.width_px);
    last_y = text.Number("y");
  }
}

// A band lies between its curves and is interrupted where one of them is unknown.
TEST(SvgPlot, DrawsABandAsAClosedArea) {
  Plot plot = PlotOf({0, 10}, {0, 10});
  plot.x_axis.range = plot.y_axis.range = {{0, 10}};
  PlotBand band;
  band.label = "between";
  band.x = {0, 5, 6, 8, 10};
  band.lo = {2, 2, kNan, 4, 4};
  band.hi = {3, 3, 5, 6, 6};
  plot.bands.push_back(band);
  const XmlDocument document = ParseXml(SvgPlot(plot));
  ASSERT_EQ(document.error, "");
  std::string d;
  for (const XmlElement& path : document.Named("path"))
    if (path.Attribute("class") == "band") d += path.Attribute("d");
  EXPECT_EQ(std::count(d.begin(), d.end(), 'M'), 2);
  EXPECT_EQ(std::count(d.begin(), d.end(), 'Z'), 2);
  EXPECT_EQ(std::count(d.begin(), d.end(), 'L'), 6);  // two areas of four corners
  const std::vector<XmlElement> keys = document.Named("rect");
  EXPECT_TRUE(std::any_of(keys.begin(), keys.end(), [](const XmlElement& rect) {
    return rect.Attribute("class") == "band";
  }));
}

TEST(SvgPlot, ABandDoesNotWidenThePlot) {
  Plot plot = PlotOf({0, 10}, {0, 10});
  const auto labels = [&] {
    std::string text;
    for (const XmlElement& element : ParseXml(SvgPlot(plot)).Named("text"))
      text += element.text + "|";
    return text;
  };
  const std::string before = labels();
  PlotBand band;
  band.x = {0, 10};
  band.lo = {-1000, -1000};
  band.hi = {1000, 1000};
  plot.bands.push_back(band);
  EXPECT_EQ(labels(), before);
}

TEST(SvgPlot, AHeadingStandsAboveTheLegend) {
  Plot plot = PlotOf({0, 10}, {0, 10});
  plot.heading = "what & which";
  const XmlDocument document = ParseXml(SvgPlot(plot));
  double heading_y = 0, legend_y = 0;
  for (const XmlElement& text : document.Named("text")) {
    if (text.Attribute("class") == "heading") {
      EXPECT_EQ(text.text, "what & which");
      heading_y = text.Number("y");
    }
    if (text.text == "points") legend_y = text.Number("y");
  }
  EXPECT_GT(heading_y, 0);
  EXPECT_GT(legend_y, heading_y + 12);
}

TEST(SvgFile, StandsAloneWithoutVariables) {
  const std::string element = SvgPlot(PlotOf({0, 1}, {0, 1}));
  const std::string file = SvgFile(element);
  const XmlDocument document = ParseXml(file);
  ASSERT_EQ(document.error, "");
  EXPECT_EQ(document.elements[0].Attribute("xmlns"), "http://www.w3.org/2000/svg");
  EXPECT_EQ(document.elements[0].Attribute("viewBox"), "0 0 860 320");
  EXPECT_EQ(file.find("var("), std::string::npos);
  EXPECT_EQ(document.Named("path").size(), ParseXml(element).Named("path").size());
  EXPECT_NE(file.find("#0072b2"), std::string::npos);  // the fit's colour on light paper
  EXPECT_NE(file.find("#56b4e9"), std::string::npos);  // and on dark
}

}  // namespace
}  // namespace thicklens::tools
