#include "tools/report/calibration_report.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <limits>
#include <opencv2/core.hpp>
#include <random>
#include <set>
#include <sstream>
#include <utility>

#include "tools/report/page_images.h"
#include "tools/support/fake_calibration.h"
#include "tools/support/xml_elements.h"

namespace thicklens::tools {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;

const ReportOrigin kOrigin = {"sweeps/bench.yaml", "0.1.0", "2026-01-31", {"a note"}};

std::string Page(const MadeUpCalibration& made, bool with_truth = true) {
  return MakeCalibrationReport(made.sweep, made.calibration, with_truth ? &made.truth : nullptr,
                               kOrigin)
      .html;
}

// Which <svg> of the page has this name, by its title's id.
int PlotNamed(const XmlDocument& document, const std::string& name) {
  for (const XmlElement& title : document.Named("title"))
    if (title.Attribute("id") == name + "-title") return title.plot;
  ADD_FAILURE() << "no figure " << name;
  return 0;
}

bool HasCell(const XmlDocument& document, const std::string& text) {
  const std::vector<XmlElement> cells = document.Named("td");
  return std::any_of(cells.begin(), cells.end(),
                     [&](const XmlElement& cell) { return cell.text == text; });
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
    // Sharpness, blur, its residuals, readings, three examples, scale, its residuals, the field.
    EXPECT_EQ(document.Named("svg").size(), 10u);
    EXPECT_EQ(document.Named("figcaption").size(), 7u);
  }
}

TEST(CalibrationReport, WithoutDetailsLeavesTheirPartsOut) {
  MadeUpCalibration made = MakeUpCalibration(31, 330, 5);
  RemoveDetails(&made.calibration);
  const std::string html = Page(made);
  const XmlDocument document = ParseXml(html);
  ASSERT_EQ(document.error, "");
  EXPECT_EQ(document.Named("svg").size(), 5u);
  EXPECT_EQ(document.Named("figcaption").size(), 4u);
  for (const char* absent : {"Over the field", "Over the whole field", "What to do next",
                             "Least certain", "red channel", "recipe, over mean grey"})
    EXPECT_THAT(html, Not(HasSubstr(absent)));
  EXPECT_THAT(html, Not(HasSubstr("not run")));
  made.calibration.diagnostics.nearer.message = "3 frames; 5 are needed";
  EXPECT_THAT(Page(made), HasSubstr("<li>blur, nearer side only: 3 frames; 5 are needed</li>"));
}

TEST(CalibrationReport, EscapesNamesFromOutside) {
  MadeUpCalibration made = MakeUpCalibration(9, 340, 15);
  const std::string nasty = "<i>&\"#'\x02\xFE";
  made.sweep.camera.name = nasty;
  made.calibration.frames[1].image = nasty + "1";
  made.calibration.frames[2].image = nasty + "2";
  RejectFrame(2, nasty, &made.calibration);
  made.calibration.summary.warnings = {nasty};
  made.calibration.summary.outcome = calib::Outcome::kPartial;
  made.calibration.summary.reason = nasty;
  made.calibration.diagnostics.scale.done = false;
  made.calibration.diagnostics.scale.message = nasty;
  made.calibration.diagnostics.covariance_order[0] = nasty;
  made.calibration.diagnostics.blur.undetermined = {nasty};
  made.calibration.diagnostics.blur.weak_direction = made.calibration.diagnostics.advice = nasty;
  made.calibration.diagnostics.nearer = {};
  made.calibration.diagnostics.nearer.message = nasty;
  made.calibration.diagnostics.field.tiles[3].done = false;
  made.calibration.diagnostics.field.tiles[3].message = nasty;
  made.calibration.diagnostics.channels[0].name = nasty;
  made.calibration.diagnostics.channels[1].done = false;
  made.calibration.diagnostics.channels[1].message = nasty;
  made.calibration.diagnostics.systematic_parts[0].name = nasty;
  made.calibration.diagnostics.systematic_parts[1].remedy = nasty;
  const CalibrationReport report = MakeCalibrationReport(
      made.sweep, made.calibration, &made.truth, {nasty, nasty, nasty, {nasty}},
      [](std::size_t) { return cv::Mat(4, 4, CV_8U, cv::Scalar(9)); });
  for (const ReportFile& figure : report.figures) EXPECT_EQ(ParseXml(figure.content).error, "");
  const std::string& html = report.html;
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
  EXPECT_THAT(html, HasSubstr("frame_020.png … frame_030.png (11 frames)"));
  for (const char* count : {"20", "11"}) EXPECT_TRUE(HasCell(document, count)) << count;
  // Twelve dark frames and how many more, one run of blank ones, each frame of them, five numbers
  // of the camera, and the three heads.
  EXPECT_EQ(document.Named("tr").size(), 13u + 1u + 31u + 5u + 3u);
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
  c.summary.outcome = calib::Outcome::kPartial;
  c.summary.reason = "the blur floor is not determined";
  c.summary.blur_floor_px.reset();
  c.summary.bench_offset_mm.reset();
  RemoveDetails(&c);
  c.diagnostics.scale = {};
  c.diagnostics.scale.kind = calib::ScaleKind::kConstant;
  const std::string html = Page(made, false);
  const XmlDocument document = ParseXml(html);
  ASSERT_EQ(document.error, "");
  EXPECT_EQ(document.Named("svg").size(), 4u);
  EXPECT_THAT(html, HasSubstr("its dependence on the reading: constant: the lens is telecentric"));
  EXPECT_THAT(html, HasSubstr("Partly calibrated: the blur floor is not determined"));
  EXPECT_THAT(html, HasSubstr("is estimated from the points"));
}

// A floor of which only an interval is known has no value; the law is drawn all the same.
TEST(CalibrationReport, AnIntervalForTheFloorKeepsTheFittedCurve) {
  MadeUpCalibration made = MakeUpCalibration(31, 300, 8);
  made.calibration.summary.blur_floor_px.reset();
  const std::string without = Page(made, false);
  constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
  made.calibration.summary.blur_floor_px = calib::Result{kNan, kNan, Eigen::Vector2d(0, 0.7)};
  const std::string html = Page(made, false);
  ASSERT_EQ(ParseXml(html).error, "");
  EXPECT_THAT(html, HasSubstr("is estimated from the points"));
  EXPECT_THAT(html, HasSubstr("not determined"));
  EXPECT_THAT(Page(made), Not(HasSubstr("nan")));
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
  made.calibration.diagnostics.covariance(0, 0) = nan;
  made.calibration.summary.focus_depth_mm->value = inf;
  EXPECT_EQ(ParseXml(Page(made)).error, "");
  made.calibration.diagnostics.field.tiles[2].focus_depth_mm = {nan, inf};
  made.calibration.examples[0].measured[1] = nan;
  made.calibration.examples[1].x.resize(2);
  made.calibration.examples[2].frame = 99;
  made.calibration.diagnostics.nearer.focus_depth_mm.value = 2;  // nearer than any focus
  made.calibration.diagnostics.farther.blur_ratio.value = nan;
  made.calibration.diagnostics.systematic_parts[0].focus_depth_mm = {nan, inf};
  made.calibration.diagnostics.channels[0].focus_depth_mm.value = nan;
  made.calibration.frames[6].reading_error_mm = nan;
  EXPECT_EQ(ParseXml(Page(made)).error, "");
  for (calib::FieldTile& tile : made.calibration.diagnostics.field.tiles) tile.done = false;
  made.calibration.summary.image_distance_mm->value = 1;  // a sensor in front of every image
  EXPECT_EQ(ParseXml(Page(made)).error, "");
}

// The five answers, in this order, and the largest term of the table in the fourth.
TEST(CalibrationReport, AnswersFirst) {
  MadeUpCalibration made = MakeUpCalibration(31, 300, 8);
  RemoveDetails(&made.calibration);
  const auto order = [](const std::string& html) {
    std::vector<std::size_t> places;
    for (const char* question : {"Where is focus?", "What is the blur?", "Can I trust it?",
                                 "What is the largest error?", "What next?", "<h2>"})
      places.push_back(html.find(question));
    return places;
  };
  made.calibration.summary.focus_depth_mm = calib::Result{400, 3, Eigen::Vector2d(399, 401)};
  std::string html = Page(made);
  std::vector<std::size_t> places = order(html);
  EXPECT_TRUE(std::is_sorted(places.begin(), places.end()));
  EXPECT_NE(places.back(), std::string::npos);
  EXPECT_THAT(html, HasSubstr("largest error?</b> Noise and readings ("));
  EXPECT_THAT(html, HasSubstr("31 frames: 31 used, 0 rejected."));
  made.calibration.diagnostics.systematic_parts = {
      {"blur floor", {-30, 36}, {-0.015, 0.012}, {-0.07, 0.08}, "photograph a knife edge"}};
  html = Page(made);
  EXPECT_THAT(html, HasSubstr("largest error?</b> The blur floor ("));
  EXPECT_THAT(html, HasSubstr("What next?</b> Photograph a knife edge"));
}

TEST(CalibrationReport, ListsTheSystematicPartsAndTheOtherWays) {
  const XmlDocument document = ParseXml(Page(MakeUpCalibration(41, 320, 4)));
  for (const char* text : {"−2.9 … +3.6", "−0.0015 … +0.0012", "−0.0070 … +0.0080",
                           "photograph a knife edge", "have the lens measured", "0"})
    EXPECT_TRUE(HasCell(document, text)) << text;
  // zf of the near side is 398.6 +- 0.9, of the fit 399.72 +- 1.1; of blue 401.44 +- 0.12.
  for (const char* text : {"398.60\u00A0±\u00A00.90", "−1.1", "401.44\u00A0±\u00A00.12", "+1.7"})
    EXPECT_TRUE(HasCell(document, text)) << text;
}

TEST(CalibrationReport, SaysWhatTheFieldAndTheColoursDo) {
  MadeUpCalibration made = MakeUpCalibration(41, 320, 4);
  std::string html = Page(made);
  for (const char* words :
       {"tilt about the vertical axis +1.210 ± 0.090° (the target",
        "tilt about the horizontal axis −0.050 ± 0.080° (not significant)",
        "<li>curvature −1.83 ± 0.21 mm", "astigmatism +0.42 ± 0.11 mm", "blue 401.44 ± 0.12 mm",
        "(pincushion)", "A Gaussian describes the frames better than a disc"})
    EXPECT_THAT(html, HasSubstr(words));
  EXPECT_THAT(html, HasSubstr("the target&#39;s right side is nearer"));
  EXPECT_THAT(html, Not(HasSubstr("different readings")));
  made.calibration.diagnostics.field.clusters = {{{398, 0.2}, 12}, {{405, 0.3}, 1}};
  made.calibration.diagnostics.blur.better_psf = model::Psf::kDisc;
  html = Page(made);
  EXPECT_THAT(html, HasSubstr("2 different readings: zf = 398.00 ± 0.20 mm (12 tiles), "
                              "405.00 ± 0.30 mm (1 tile)"));
  EXPECT_THAT(html, HasSubstr("A disc describes the frames better than a Gaussian"));
  EXPECT_THAT(html, HasSubstr("the camera file states gaussian"));
  made.calibration.diagnostics.blur.gaussian_misfit = 46;
  made.calibration.diagnostics.blur.disc_misfit = 45.8;
  EXPECT_THAT(Page(made), HasSubstr("Neither a Gaussian nor a disc fits the frames"));
}

// The tiles have their positions in the image, and the colour is a function of their value.
TEST(CalibrationReport, DrawsTheFieldAsItLies) {
  const MadeUpCalibration made = MakeUpCalibration(41, 320, 4);
  const XmlDocument document = ParseXml(Page(made));
  const int plot = PlotNamed(document, "field");
  std::vector<XmlElement> tiles;
  for (const XmlElement& rect : document.Named("rect", plot))
    if (rect.Number("width") > 20) tiles.push_back(rect);
  ASSERT_EQ(tiles.size(), 20u);
  for (std::size_t i = 0; i + 5 < tiles.size(); ++i) {
    EXPECT_LT(tiles[i].Number("y"), tiles[i + 5].Number("y"));
    EXPECT_EQ(tiles[i].Number("x"), tiles[i + 5].Number("x"));
  }
  EXPECT_LT(tiles[0].Number("x"), tiles[1].Number("x"));
  EXPECT_EQ(tiles[19].Attribute("class"), "empty");
  const auto& field = made.calibration.diagnostics.field.tiles;
  const auto by_depth = [](const calib::FieldTile& a, const calib::FieldTile& b) {
    return a.focus_depth_mm.value < b.focus_depth_mm.value;
  };
  const auto [lo, hi] = std::minmax_element(field.begin(), field.end() - 1, by_depth);
  EXPECT_EQ(tiles[static_cast<std::size_t>(lo - field.begin())].Attribute("fill"), "#440154");
  EXPECT_EQ(tiles[static_cast<std::size_t>(hi - field.begin())].Attribute("fill"), "#fde725");
  bool said = false;
  for (const XmlElement& text : document.Named("text", plot))
    said = said || text.text == fmt::format("{:.2f}", field[7].focus_depth_mm.value);
  EXPECT_TRUE(said);
}

TEST(CalibrationReport, ShowsRejectedFramesAndCountsTheRest) {
  MadeUpCalibration made = MakeUpCalibration(41, 320, 4);
  RejectFrame(2, "reading off by 15.1 mm, or frame damaged", &made.calibration);
  std::set<std::size_t> asked;
  const auto image = [&](std::size_t i) {
    asked.insert(i);
    return i == 20 ? cv::Mat()
                   : cv::Mat(300, 400, CV_16UC3,
                             cv::Scalar(30000, 20000, 100.0 * static_cast<double>(i)));
  };
  const auto images = [&] {
    asked.clear();
    return ParseXml(
               MakeCalibrationReport(made.sweep, made.calibration, nullptr, kOrigin, image).html)
        .Named("img");
  };
  ASSERT_EQ(images().size(), 1u);
  EXPECT_EQ(asked, std::set<std::size_t>{2});
  EXPECT_EQ(images()[0].Attribute("alt"),
            "frame_002.png, rejected: reading off by 15.1 mm, or frame damaged");
  EXPECT_EQ(images()[0].Attribute("width"), "220");
  EXPECT_EQ(images()[0].Attribute("height"), "165");
  EXPECT_THAT(images()[0].Attribute("src"), ::testing::StartsWith("data:image/jpeg;base64,"));
  // There are 20 dark frames and a saturated one. Each kind is shown, and one frame has no image.
  for (int i = 10; i < 30; ++i) RejectFrame(i, "dark: mean 0.001", &made.calibration);
  RejectFrame(40, "saturated: 90 %", &made.calibration);
  EXPECT_EQ(images().size(), 12u);
  EXPECT_EQ(asked.count(2) + asked.count(40), 2u);
  EXPECT_THAT(MakeCalibrationReport(made.sweep, made.calibration, nullptr, kOrigin, image).html,
              HasSubstr("… and 10 more."));
}

TEST(CalibrationReport, GivesEveryRejectedFrameItsOwnAmount) {
  MadeUpCalibration made = MakeUpCalibration(41, 320, 4);
  RejectFrame(4, "reading off by -4.1 mm, or frame damaged", &made.calibration);
  RejectFrame(5, "reading off by 4.0 mm, or frame damaged", &made.calibration);
  for (int i = 10; i < 30; ++i)
    RejectFrame(i, "dark: mean 0.0" + std::to_string(i), &made.calibration);
  const std::string html =
      MakeCalibrationReport(made.sweep, made.calibration, nullptr, kOrigin, {}).html;
  const std::string table = html.substr(html.find("<h2>Rejected frames"));
  const std::string overview = table.substr(0, table.find("<details>"));
  EXPECT_THAT(overview, HasSubstr("by −4.1 mm")) << "the numbers of the one";
  EXPECT_THAT(overview, HasSubstr("by 4.0 mm")) << "and of the other";
  EXPECT_THAT(overview, HasSubstr("mean 0.021"));
  EXPECT_THAT(overview, Not(HasSubstr("mean 0.022")));
  EXPECT_THAT(overview, HasSubstr("and 8 more"));
  EXPECT_THAT(table, HasSubstr("mean 0.029")) << "each is named further down";
}

// Linear cameras' images would look nearly black.
TEST(CalibrationReport, ThumbnailsAreEncodedForTheScreen) {
  MadeUpCalibration made = MakeUpCalibration(9, 340, 15);
  RejectFrame(2, "blank", &made.calibration);
  const auto page = [&] {
    return MakeCalibrationReport(made.sweep, made.calibration, nullptr, kOrigin,
                                 [](std::size_t) { return cv::Mat(20, 20, CV_8U, cv::Scalar(55)); })
        .html;
  };
  const auto shown = [&](int level) {
    return EmbeddedImage(cv::Mat(20, 20, CV_8U, cv::Scalar(level)),
                         "frame_002.png, rejected: blank", Packing::kSmall, 220);
  };
  made.sweep.camera.sensor.transfer = model::TransferCurve::Srgb();
  EXPECT_THAT(page(), HasSubstr(shown(55)));
  made.sweep.camera.sensor.transfer = model::TransferCurve::Linear();
  // Computed by hand: 55/255 = 0.2157, 1.055 * 0.2157^(1/2.4) - 0.055 = 0.5020, * 255 = 128.
  EXPECT_THAT(page(), HasSubstr(shown(128)));
}

TEST(CalibrationReport, GivesItsFiguresAsFilesThatStandAlone) {
  const MadeUpCalibration made = MakeUpCalibration(41, 320, 4);
  const CalibrationReport report =
      MakeCalibrationReport(made.sweep, made.calibration, &made.truth, kOrigin);
  const XmlDocument page = ParseXml(report.html);
  ASSERT_EQ(report.figures.size(), page.Named("svg").size());
  const std::vector<std::string> known = ReportFigureNames();
  for (std::size_t i = 0; i < report.figures.size(); ++i) {
    const ReportFile& figure = report.figures[i];
    EXPECT_EQ(std::count(known.begin(), known.end(), figure.name), 1) << figure.name;
    EXPECT_THAT(report.captions, HasSubstr(figure.name));
    const XmlDocument drawing = ParseXml(figure.content);
    ASSERT_EQ(drawing.error, "") << figure.name;
    EXPECT_EQ(drawing.elements[0].name, "svg");
    EXPECT_EQ(drawing.elements[0].Attribute("xmlns"), "http://www.w3.org/2000/svg");
    EXPECT_EQ(drawing.Named("style").size(), 1u);
    EXPECT_THAT(figure.content, Not(HasSubstr("var(")));
    EXPECT_EQ(drawing.Named("path").size(), page.Named("path", static_cast<int>(i)).size());
  }
}

TEST(CalibrationReport, MarksAssumedNumbers) {
  const XmlDocument document = ParseXml(Page(MakeUpCalibration(9, 340, 15)));
  const std::vector<XmlElement> cells = document.Named("td");
  EXPECT_EQ(std::count_if(cells.begin(), cells.end(),
                          [](const XmlElement& cell) { return cell.text == "± 0.1, assumed"; }),
            1);
}

TEST(CalibrationReport, ShowsTheDataOfAnObjective) {
  MadeUpCalibration made = MakeUpCalibration(9, 340, 15);
  EXPECT_THAT(Page(made), Not(HasSubstr("magnification of the objective")));
  made.sweep.camera.objective = model::Objective{12.5, 0.28, 164.5};
  made.sweep.camera.statements["lens.numerical_aperture"] = {0.007, false};
  const std::string page = Page(made);
  EXPECT_THAT(page, HasSubstr("magnification of the objective"));
  const XmlDocument document = ParseXml(page);
  for (const char* cell : {"12.5", "0.28", "164.5", "± 0.007"})
    EXPECT_TRUE(HasCell(document, cell)) << cell;
}

TEST(CalibrationReport, GivesErrorsAndCorrelations) {
  const std::string html = Page(MakeUpCalibration(41, 320, 4));
  EXPECT_THAT(html, HasSubstr(">+0.0003</td>"));  // d1
  EXPECT_THAT(html, HasSubstr(">−6.5</td>"));     // zf of the paper's recipe
  EXPECT_THAT(html, HasSubstr(">−0.710</td>"));   // d1 with the bench offset
  EXPECT_THAT(html, HasSubstr(">−0.550</td>"));
  EXPECT_THAT(Page(MakeUpCalibration(41, 320, 4), false), Not(HasSubstr("Errors against")));
}

// The positions of numbers according to the tick labels of a plot: value = from + per_px *
// position.
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
TEST(CalibrationReport, DrawsTheFittedBlurModel) {
  const MadeUpCalibration made = MakeUpCalibration(41, 320, 4);
  const XmlDocument document = ParseXml(Page(made, false));
  const int kBlurPlot = PlotNamed(document, "blur");
  const Scale z_at = AxisScale(document, kBlurPlot, "middle", "x", 0);
  const Scale sigma_at = AxisScale(document, kBlurPlot, "end", "y", -4);
  const double d_mm = made.calibration.summary.image_distance_mm->value - 3.0;
  const double zf_mm = 12.5 * d_mm / (d_mm - 12.8);
  const double k_mm = 12.5 * zf_mm / (zf_mm - 12.5);
  const double kappa = made.calibration.summary.blur_ratio->value;
  const double a_px2_mm2 = kappa * kappa * std::pow(4.46 * k_mm / 0.006, 2);
  const double s0_px2 = std::pow(made.calibration.summary.blur_floor_px->value, 2);
  int checked = 0;
  for (const XmlElement& path : document.Named("path", kBlurPlot)) {
    const std::string d = path.Attribute("d");
    if (path.parent_class != "ink-fit" || path.Attribute("class") != "line" ||
        std::count(d.begin(), d.end(), 'L') < 50)
      continue;
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

// "M1 2L3 4" as numbers.
std::vector<std::pair<double, double>> PathPoints(std::string d) {
  std::replace_if(
      d.begin(), d.end(), [](char c) { return c == 'M' || c == 'L' || c == 'Z'; }, ' ');
  std::istringstream stream(d);
  std::vector<std::pair<double, double>> points;
  for (double x = 0, y = 0; stream >> x >> y;) points.emplace_back(x, y);
  return points;
}

// The drawn band against the scatter of the law over draws of its parameters.
TEST(CalibrationReport, TheBandIsTheScatterOfTheModel) {
  MadeUpCalibration made = MakeUpCalibration(41, 320, 4);
  made.calibration.diagnostics.covariance *=
      9;  // large enough to exceed the rounding of the drawing
  const XmlDocument document = ParseXml(Page(made, false));
  const int plot = PlotNamed(document, "blur");
  const Scale z_at = AxisScale(document, plot, "middle", "x", 0);
  const Scale sigma_at = AxisScale(document, plot, "end", "y", -4);
  std::vector<std::pair<double, double>> band;
  for (const XmlElement& path : document.Named("path", plot))
    if (path.Attribute("class") == "band") band = PathPoints(path.Attribute("d"));
  ASSERT_EQ(band.size(), 2u * 401u);

  const Eigen::LLT<Eigen::MatrixXd> root(made.calibration.diagnostics.covariance);
  const Eigen::Vector4d mean(
      made.calibration.summary.image_distance_mm->value, made.calibration.summary.blur_ratio->value,
      made.calibration.summary.blur_floor_px->value, 0);  // of the offset only the change matters
  std::mt19937 generator(4);
  std::normal_distribution<double> normal;
  std::vector<Eigen::Vector4d> draws(4000);
  for (Eigen::Vector4d& draw : draws)
    draw = mean + root.matrixL() * Eigen::Vector4d::NullaryExpr([&] { return normal(generator); });
  const auto law = [](const Eigen::Vector4d& p, double z_mm) {
    const double d_mm = p[0] - 3.0, zf_mm = 12.5 * d_mm / (d_mm - 12.8);
    const double k_mm = 12.5 * zf_mm / (zf_mm - 12.5);
    return std::hypot(p[2], p[1] * 4.46 * k_mm / 0.006 * (1 / (z_mm + p[3]) - 1 / zf_mm));
  };
  for (const std::size_t i :
       {std::size_t{20}, std::size_t{120}, std::size_t{300}, std::size_t{390}}) {
    const double z_mm = z_at(band[i].first);
    double sum = 0;
    for (const Eigen::Vector4d& draw : draws) sum += std::pow(law(draw, z_mm) - law(mean, z_mm), 2);
    const double sd_px = std::sqrt(sum / static_cast<double>(draws.size()));
    const double half_px = (sigma_at(band[i].second) - sigma_at(band[801 - i].second)) / 2;
    EXPECT_NEAR(half_px, 2 * sd_px, 0.06 * sd_px + 0.004) << "at z = " << z_mm;
  }
}

// Each side's thin curve against its own zf and kappa.
TEST(CalibrationReport, DrawsEachSideAlone) {
  const MadeUpCalibration made = MakeUpCalibration(41, 320, 4);
  const XmlDocument document = ParseXml(Page(made, false));
  const int plot = PlotNamed(document, "blur");
  const Scale z_at = AxisScale(document, plot, "middle", "x", 0);
  const Scale sigma_at = AxisScale(document, plot, "end", "y", -4);
  std::vector<std::vector<std::pair<double, double>>> curves;
  for (const XmlElement& path : document.Named("path", plot))
    if (path.Attribute("class") == "thin") curves.push_back(PathPoints(path.Attribute("d")));
  ASSERT_EQ(curves.size(), 2u);
  for (const bool far : {false, true}) {
    const double zf_mm = far ? 401.1 : 398.6;
    const double a_px_mm = (far ? 0.439 : 0.464) * 4.46 * 12.5 * zf_mm / (zf_mm - 12.5) / 0.006;
    for (const auto& [x, y] : curves[far ? 1 : 0])
      EXPECT_NEAR(sigma_at(y), std::hypot(0.508, a_px_mm * (1 / z_at(x) - 1 / zf_mm)), 0.01);
  }
}

// Readings that follow the law exactly leave no residual, for both directions of the bench scale.
TEST(CalibrationReport, ScaleResidualsVanishOnTheModel) {
  for (const auto direction : {model::BenchDirection::kAway, model::BenchDirection::kToward}) {
    MadeUpCalibration made = MakeUpCalibration(21, 320, 8);
    made.sweep.direction = direction;
    const double sign = direction == model::BenchDirection::kAway ? 1 : -1;
    const double offset_mm = sign > 0 ? 12.34 : 600;
    made.calibration.diagnostics.scale.offset_mm = {offset_mm, 0.1, std::nullopt};
    for (std::size_t i = 0; i < made.calibration.frames.size(); ++i) {
      calib::FrameMeasurement& frame = made.calibration.frames[i];
      frame.reading_mm = sign * (made.truth.frames[i].depth_mm - offset_mm);
    }
    made.calibration.frames[5].reading_mm += 1.5;  // the one wrong reading
    const XmlDocument document = ParseXml(Page(made));
    const int kResiduals = PlotNamed(document, "scale-residuals");
    const Scale residual_at = AxisScale(document, kResiduals, "end", "y", -4);
    const std::vector<XmlElement> points = document.Named("circle", kResiduals);
    ASSERT_EQ(points.size(), 21u);
    for (std::size_t i = 0; i < points.size(); ++i)
      EXPECT_NEAR(residual_at(points[i].Number("cy")), i == 5 ? 1.5 : 0, 0.02) << i;
  }
}

TEST(CalibrationReport, NamesTheBenchOffsetWhereItIsMostOfTheError) {
  MadeUpCalibration made = MakeUpCalibration(31, 300, 8);
  RemoveDetails(&made.calibration);
  made.calibration.diagnostics.covariance_order.clear();
  *made.calibration.summary.focus_depth_mm = {400, 0.57, Eigen::Vector2d(399.9, 400.1)};
  made.calibration.summary.bench_offset_mm->sigma = 0.56;
  EXPECT_THAT(Page(made), HasSubstr("largest error?</b> The bench offset ("));
  made.calibration.summary.bench_offset_mm->sigma = 0.01;
  EXPECT_THAT(Page(made), HasSubstr("largest error?</b> Noise and readings ("));
}

TEST(CalibrationReport, SaysWhichTolerancesAreMissing) {
  MadeUpCalibration made = MakeUpCalibration(31, 300, 8);
  EXPECT_THAT(Page(made, false),
              HasSubstr("No tolerance is stated for the focal lengths and the pixel pitch"));
  EXPECT_THAT(Page(made, true), Not(HasSubstr("No tolerance is stated")));
  auto& statements = made.sweep.camera.statements;
  statements["sensor.pixel_pitch_mm"] = {1e-5, false};
  statements["lens.front_focal_length_mm"] = {0.1, false};
  statements["lens.rear_focal_length_mm"] = {0, true};  // assumed, but not how well
  const std::string html = Page(made, false);
  EXPECT_THAT(html, HasSubstr("No tolerance is stated for the focal lengths: the intervals"));
  EXPECT_THAT(html, Not(HasSubstr("of the pixel pitch")));
  statements["lens.rear_focal_length_mm"] = {0.1, true};
  EXPECT_THAT(Page(made, false), Not(HasSubstr("No tolerance is stated")));
}

TEST(CalibrationReport, AccountsForFramesThatAreNotInTheFit) {
  MadeUpCalibration made = MakeUpCalibration(31, 300, 8);
  EXPECT_THAT(Page(made), Not(HasSubstr("no information about the blur")));
  for (const std::size_t i : {3u, 4u, 5u, 9u})
    made.calibration.frames[i].not_in_fit = "blurred too strongly";
  made.calibration.frames[20].not_in_fit = "not registered";
  const std::string html = Page(made);
  ASSERT_EQ(ParseXml(html).error, "");
  EXPECT_THAT(
      html,
      HasSubstr("5 more frames passed the quality checks but give no information about the blur:"));
  EXPECT_THAT(html, HasSubstr("blurred too strongly (4): frame_003.png … frame_005.png (3 frames), "
                              "frame_009.png</li>"));
  EXPECT_THAT(html, HasSubstr("not registered (1): frame_020.png</li>"));
  RejectFrame(0, "dark", &made.calibration);
  EXPECT_THAT(Page(made), HasSubstr("5 more frames passed"));
}

TEST(CalibrationReport, TheWorstKnownValueIsNamedOnlyWhereItIsInformative) {
  MadeUpCalibration made = MakeUpCalibration(31, 300, 8);
  const auto page_with = [&](double correlation) {
    made.calibration.diagnostics.blur.weak_direction = "a with b";
    made.calibration.diagnostics.blur.weak_correlation = correlation;
    return Page(made);
  };
  EXPECT_THAT(page_with(0.05), Not(HasSubstr("Least certain")));
  EXPECT_THAT(page_with(-0.49), Not(HasSubstr("Least certain")));
  EXPECT_THAT(page_with(-0.93), HasSubstr("Least certain: a with b"));
}

TEST(CalibrationReport, SaysWhatWasNotStatedOfTheReadings) {
  MadeUpCalibration made = MakeUpCalibration(9, 340, 15);
  EXPECT_THAT(Page(made), HasSubstr("deviation of a reading 0.07 mm."));
  ReportOrigin origin = kOrigin;
  origin.reading_sigma_stated = false;
  EXPECT_THAT(MakeCalibrationReport(made.sweep, made.calibration, nullptr, origin).html,
              HasSubstr("deviation of a reading not stated."));
}

TEST(CalibrationReport, SaysWhereTheFramesLieOffTheModel) {
  MadeUpCalibration made = MakeUpCalibration(31, 300, 8);
  EXPECT_THAT(Page(made), Not(HasSubstr("exceed their errors")));
  made.calibration.diagnostics.blur.chi2_per_dof = 2.5;
  const std::string widened =
      "The residuals of the frames exceed their errors (χ²/dof 2.5); the errors were widened";
  EXPECT_THAT(Page(made), HasSubstr(widened));
  // If there are few frames, chance may cause as much, and no widening is reported.
  made.calibration.diagnostics.blur.frames_used = 8;
  EXPECT_THAT(Page(made), HasSubstr("exceed their errors (χ²/dof 2.5)."));
}

// Tiles that differ by noise alone stay near the middle of the colours, all with as many digits.
TEST(CalibrationReport, NoiseDoesNotFillTheColoursOfTheField) {
  MadeUpCalibration made = MakeUpCalibration(41, 320, 4);
  auto& tiles = made.calibration.diagnostics.field.tiles;
  for (std::size_t i = 0; i < tiles.size(); ++i)
    tiles[i].focus_depth_mm = {400 + (i % 2 == 0 ? 0.1 : -0.1), i == 0 ? 0.031 : 0.21};
  const XmlDocument document = ParseXml(Page(made));
  const int plot = PlotNamed(document, "field");
  // 400 +- 3 * 0.21: the tiles are at (0.63 -+ 0.1)/1.26 = 0.42 and 0.58 of the colours.
  std::set<std::string> colours, words;
  for (const XmlElement& rect : document.Named("rect", plot))
    if (rect.Number("width") > 20 && !rect.Attribute("fill").empty())
      colours.insert(rect.Attribute("fill"));
  EXPECT_EQ(colours, (std::set<std::string>{MapColourCss(0.53 / 1.26), MapColourCss(0.73 / 1.26)}));
  for (const XmlElement& text : document.Named("text", plot)) words.insert(text.text);
  for (const char* word : {"400.10", "399.90", "± 0.21", "± 0.03", "399.370 … 400.630 mm"})
    EXPECT_EQ(words.count(word), 1u) << word;
}

// Long names must not push the reasons off the page.
TEST(CalibrationReport, LongNamesWrapAndLeaveRoomForTheReasons) {
  MadeUpCalibration made = MakeUpCalibration(9, 340, 15);
  RejectFrame(2, "dark: mean 0.001", &made.calibration);
  const XmlDocument document = ParseXml(Page(made));
  int reasons = 0;
  for (const XmlElement& cell : document.Named("td"))
    if (cell.text == "mean 0.001" || cell.text == "have the lens measured") {
      EXPECT_EQ(cell.Attribute("class"), "words");
      ++reasons;
    }
  EXPECT_EQ(reasons, 2);
  const std::string style = Page(made).substr(0, Page(made).find("</style>"));
  EXPECT_THAT(style, HasSubstr("tbody th, .name, .words { overflow-wrap: anywhere; }"));
}

}  // namespace
}  // namespace thicklens::tools
