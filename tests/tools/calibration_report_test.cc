#include "calibration_report.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <set>
#include <sstream>
#include <utility>

#include "made_up_calibration.h"
#include "xml_elements.h"

namespace thicklens::tools {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;

const ReportOrigin kOrigin = {"sweeps/bench.yaml", "0.1.0", "2026-01-31", {"a note"}};

std::string Page(const MadeUpCalibration& made, bool with_truth = true) {
  return CalibrationReportHtml(made.sweep, made.calibration, with_truth ? &made.truth : nullptr,
                               kOrigin);
}

TEST(CalibrationReport, IsOneWellFormedPageThatNeedsNothingElse) {
  for (int frames : {7, 31, 131}) {
    const std::string html = Page(MakeUpCalibration(frames, 330, 280.0 / frames));
    const XmlDocument document = ParseXml(html);
    ASSERT_EQ(document.error, "");
    for (const char* outside : {"http", "src=", "href=", "<script", "@import", "nan"})
      EXPECT_THAT(html, Not(HasSubstr(outside)));
    std::set<std::string> ids;
    for (const XmlElement& element : document.elements) {
      const std::string id = element.Attribute("id");
      if (!id.empty()) {
        EXPECT_TRUE(ids.insert(id).second) << id;
      }
    }
    EXPECT_EQ(document.Named("svg").size(), 5u);
    EXPECT_EQ(document.Named("figcaption").size(), 4u);
  }
}

TEST(CalibrationReport, EscapesNamesFromOutside) {
  MadeUpCalibration made = MakeUpCalibration(9, 340, 15);
  const std::string nasty = "<i>&\"#'\x02\xFE";
  made.sweep.camera.name = nasty;
  made.calibration.frames[1].image = nasty + "1";
  made.calibration.frames[2].image = nasty + "2";
  RejectFrame(2, nasty, &made.calibration);
  made.calibration.warnings = {nasty};
  made.calibration.outcome = calib::Outcome::kPartial;
  made.calibration.reason = nasty;
  made.calibration.scale.done = false;
  made.calibration.scale.message = nasty;
  made.calibration.covariance_order[0] = nasty;
  made.calibration.blur.undetermined = {nasty};
  const std::string html = CalibrationReportHtml(made.sweep, made.calibration, &made.truth,
                                                 {nasty, nasty, nasty, {nasty}});
  const XmlDocument document = ParseXml(html);
  EXPECT_EQ(document.error, "");
  EXPECT_TRUE(document.Named("i").empty());
}

TEST(CalibrationReport, RefusalSaysWhyAndShowsNoEmptyFigures) {
  MadeUpCalibration made = MakeUpCalibration(31, 700, 10);
  for (int i = 0; i < 31; ++i)
    RejectFrame(i, i < 20 ? fmt::format("dark: mean 0.00{}", i % 7) : "blank", &made.calibration);
  RefuseAll("no usable frame (20 dark, 11 blank)", &made.calibration);
  const std::string html = Page(made, false);
  const XmlDocument document = ParseXml(html);
  ASSERT_EQ(document.error, "");
  EXPECT_THAT(html, HasSubstr("Refused: no usable frame (20 dark, 11 blank)"));
  EXPECT_TRUE(document.Named("svg").empty());
  EXPECT_THAT(html, HasSubstr("frame_000.png … frame_019.png"));
  const std::vector<XmlElement> cells = document.Named("td");
  for (const char* count : {"20", "11"})
    EXPECT_TRUE(std::any_of(cells.begin(), cells.end(),
                            [&](const XmlElement& cell) { return cell.text == count; }));
  // Two runs, each frame of them, five numbers of the camera, and the three heads.
  EXPECT_EQ(document.Named("tr").size(), 2u + 31u + 5u + 3u);
}

TEST(CalibrationReport, WithoutDepthsPlotsAgainstReadings) {
  MadeUpCalibration made = MakeUpCalibration(31, 700, 10);
  RefuseAll("sharpness is monotone", &made.calibration);
  for (calib::FrameMeasurement& frame : made.calibration.frames) frame.depth_mm = 0;
  const std::string html = Page(made, false);
  ASSERT_EQ(ParseXml(html).error, "");
  EXPECT_THAT(html, HasSubstr("bench reading b [mm] (no depths"));
  EXPECT_THAT(html, HasSubstr("No law was fitted"));
}

TEST(CalibrationReport, PartialResultKeepsTheFiguresItHas) {
  MadeUpCalibration made = MakeUpCalibration(31, 300, 8);
  calib::Calibration& c = made.calibration;
  c.outcome = calib::Outcome::kPartial;
  c.reason = "the blur floor is not determined";
  c.blur_floor_px.reset();
  c.bench_offset_mm.reset();
  c.scale = {};
  const std::string html = Page(made, false);
  const XmlDocument document = ParseXml(html);
  ASSERT_EQ(document.error, "");
  EXPECT_EQ(document.Named("svg").size(), 3u);
  EXPECT_THAT(html, HasSubstr("Partly calibrated: the blur floor is not determined"));
  EXPECT_THAT(html, HasSubstr("is taken from the points"));
}

// A floor of which only an interval is known has no value; the law is drawn all the same.
TEST(CalibrationReport, AnIntervalForTheFloorKeepsTheFittedCurve) {
  MadeUpCalibration made = MakeUpCalibration(31, 300, 8);
  made.calibration.blur_floor_px.reset();
  const std::string without = Page(made, false);
  constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
  made.calibration.blur_floor_px = calib::Result{kNan, kNan, Eigen::Vector2d(0, 0.7)};
  const std::string html = Page(made, false);
  ASSERT_EQ(ParseXml(html).error, "");
  EXPECT_THAT(html, HasSubstr("is taken from the points"));
  EXPECT_THAT(html, HasSubstr("not determined"));
  EXPECT_EQ(ParseXml(html).Named("path").size(), ParseXml(without).Named("path").size());
  EXPECT_EQ(ParseXml(html).Named("polyline").size(), ParseXml(without).Named("polyline").size());
}

TEST(CalibrationReport, SurvivesNumbersThatAreNone) {
  MadeUpCalibration made = MakeUpCalibration(9, 340, 15);
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const double inf = std::numeric_limits<double>::infinity();
  made.calibration.frames[1].depth_mm = nan;
  made.calibration.frames[2].blur_sigma_px = nan;
  made.calibration.frames[3].blur_sigma_error_px = inf;
  made.calibration.frames[4].image_scale = 0.0;
  made.calibration.frames[5].depth_mm = -3;
  made.calibration.covariance(0, 0) = nan;
  made.calibration.focus_depth_mm->value = inf;
  EXPECT_EQ(ParseXml(Page(made)).error, "");
  made.calibration.image_distance_mm->value = 1;  // a sensor in front of every image
  EXPECT_EQ(ParseXml(Page(made)).error, "");
}

TEST(CalibrationReport, NamesWhatLimitsIt) {
  MadeUpCalibration made = MakeUpCalibration(31, 300, 8);
  calib::Result& focus = *made.calibration.focus_depth_mm;
  focus = {400, 0.1, Eigen::Vector2d(397, 402)};
  EXPECT_THAT(Page(made), HasSubstr("What limits it is systematic"));
  EXPECT_THAT(Page(made), HasSubstr("knife edge"));
  made.sweep.floor.given_px = model::Estimate{0.5, 0.01};
  EXPECT_THAT(Page(made), Not(HasSubstr("knife edge")));
  focus = {400, 3, Eigen::Vector2d(399, 401)};
  EXPECT_THAT(Page(made), HasSubstr("What limits it is statistical"));
  focus = {400, 1, Eigen::Vector2d(399, 401)};
  EXPECT_THAT(Page(made), HasSubstr("limit it alike"));
}

TEST(CalibrationReport, MarksAssumedNumbers) {
  const XmlDocument document = ParseXml(Page(MakeUpCalibration(9, 340, 15)));
  const std::vector<XmlElement> cells = document.Named("td");
  EXPECT_EQ(std::count_if(cells.begin(), cells.end(),
                          [](const XmlElement& cell) { return cell.text == "± 0.1, assumed"; }),
            1);
}

TEST(CalibrationReport, GivesErrorsAndCorrelations) {
  const std::string html = Page(MakeUpCalibration(41, 320, 4));
  EXPECT_THAT(html, HasSubstr(">+0.0003</td>"));  // d1
  EXPECT_THAT(html, HasSubstr(">−6.5</td>"));     // zf of the source's recipe
  EXPECT_THAT(html, HasSubstr(">−0.710</td>"));   // d1 with the bench offset
  EXPECT_THAT(html, HasSubstr(">−0.550</td>"));
  EXPECT_THAT(Page(MakeUpCalibration(41, 320, 4), false), Not(HasSubstr("Errors against")));
}

// Where the tick labels of a plot say that numbers stand: value = from + per_px * position.
struct Scale {
  double from = 0, per_px = 0;
  double operator()(double px) const { return from + per_px * px; }
};

Scale AxisScale(const XmlDocument& document, int plot, const std::string& anchor,
                const std::string& coordinate, double shift_px) {
  std::vector<std::pair<double, double>> ticks;
  for (const XmlElement& text : document.Named("text", plot)) {
    if (text.Attribute("text-anchor") != anchor || !text.Attribute("class").empty()) continue;
    std::string label = text.text;
    if (label.rfind("−", 0) == 0) label.replace(0, 3, "-");
    ticks.emplace_back(text.Number(coordinate) + shift_px, std::stod(label));
  }
  const double per_px =
      (ticks.back().second - ticks.front().second) / (ticks.back().first - ticks.front().first);
  return {ticks.front().second - per_px * ticks.front().first, per_px};
}

// The drawn curve against sigma^2 = S0 + A (1/z - 1/zf)^2, A = (kappa r K/p)^2, written out here.
TEST(CalibrationReport, DrawsTheFittedBlurLaw) {
  const MadeUpCalibration made = MakeUpCalibration(41, 320, 4);
  const XmlDocument document = ParseXml(Page(made, false));
  constexpr int kBlurPlot = 1;
  const Scale z_at = AxisScale(document, kBlurPlot, "middle", "x", 0);
  const Scale sigma_at = AxisScale(document, kBlurPlot, "end", "y", -4);
  const double d_mm = made.calibration.image_distance_mm->value - 3.0;
  const double zf_mm = 12.5 * d_mm / (d_mm - 12.8);
  const double k_mm = 12.5 * zf_mm / (zf_mm - 12.5);
  const double a_px2_mm2 = std::pow(made.calibration.blur_ratio->value * 4.46 * k_mm / 0.006, 2);
  const double s0_px2 = std::pow(made.calibration.blur_floor_px->value, 2);
  int checked = 0;
  for (const XmlElement& path : document.Named("path", kBlurPlot)) {
    const std::string d = path.Attribute("d");
    if (path.parent_class != "ink-fit" || std::count(d.begin(), d.end(), 'L') < 50) continue;
    std::string numbers = d;
    std::replace_if(
        numbers.begin(), numbers.end(), [](char c) { return c == 'M' || c == 'L'; }, ' ');
    std::istringstream stream(numbers);
    for (double x = 0, y = 0; stream >> x >> y; ++checked) {
      const double z_mm = z_at(x);
      EXPECT_NEAR(sigma_at(y), std::sqrt(s0_px2 + a_px2_mm2 * std::pow(1 / z_mm - 1 / zf_mm, 2)),
                  0.01)
          << "at z = " << z_mm;
    }
  }
  EXPECT_EQ(checked, 401);
}

// Readings that follow the law exactly leave no residual, for both directions of the bench scale.
TEST(CalibrationReport, ScaleResidualsVanishOnTheLaw) {
  for (const auto direction : {model::BenchDirection::kAway, model::BenchDirection::kToward}) {
    MadeUpCalibration made = MakeUpCalibration(21, 320, 8);
    made.sweep.direction = direction;
    const double sign = direction == model::BenchDirection::kAway ? 1 : -1;
    const double offset_mm = sign > 0 ? 12.34 : 600;
    made.calibration.scale.offset_mm = {offset_mm, 0.1, std::nullopt};
    for (std::size_t i = 0; i < made.calibration.frames.size(); ++i) {
      calib::FrameMeasurement& frame = made.calibration.frames[i];
      frame.reading_mm = sign * (made.truth.frames[i].depth_mm - offset_mm);
    }
    made.calibration.frames[5].reading_mm += 1.5;  // the one wrong reading
    const XmlDocument document = ParseXml(Page(made));
    constexpr int kResiduals = 4;
    const Scale residual_at = AxisScale(document, kResiduals, "end", "y", -4);
    const std::vector<XmlElement> points = document.Named("circle", kResiduals);
    ASSERT_EQ(points.size(), 21u);
    for (std::size_t i = 0; i < points.size(); ++i)
      EXPECT_NEAR(residual_at(points[i].Number("cy")), i == 5 ? 1.5 : 0, 0.02) << i;
  }
}

}  // namespace
}  // namespace thicklens::tools
