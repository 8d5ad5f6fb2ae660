#include "tools/report/light_field_page.h"

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <fstream>
#include <limits>
#include <nlohmann/json.hpp>
#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>
#include <random>
#include <set>
#include <string>
#include <vector>

#include "support/temporary_folder.h"
#include "support/test_cameras.h"
#include "thicklens/io/depth_io.h"
#include "thicklens/io/image_io.h"
#include "thicklens/io/light_field_io.h"
#include "tools/report/calibration_report.h"
#include "tools/report/embedded_report.h"
#include "tools/support/child_process.h"
#include "tools/support/fake_calibration.h"
#include "tools/support/xml_elements.h"

namespace thicklens::tools {
namespace {

using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::Not;
using ::testing::StartsWith;
using thicklens::testing::CentredSensor;
using thicklens::testing::ContentOf;
using thicklens::testing::TemporaryFolder;
using thicklens::testing::TestCamera;
using thicklens::testing::WideLens;
using thicklens::testing::WithMethod;

constexpr int kAcrossPx = 40, kDownPx = 24;
constexpr float kUnknown = std::numeric_limits<float>::quiet_NaN();

model::LightField Relative(int u_count, int v_count, unsigned seed = 1) {
  model::LightField light_field = model::MakeLightField(kAcrossPx, kDownPx, u_count, v_count, 3);
  std::mt19937 generator(seed);
  std::uniform_real_distribution<float> any(0, 1);
  for (float& value : light_field.values) value = any(generator);
  return light_field;
}

model::Camera Calibrated() {
  model::Camera camera =
      WithMethod(TestCamera("bench-camera", WideLens(), CentredSensor(kAcrossPx, kDownPx, 0.006),
                            {16.2158, 0.0012}, {0.4512, 0.0021}),
                 "joint-blur-fit");
  camera.calibration->bench_offset_mm = model::Estimate{0, 0};
  camera.calibration->evidence.frames_used = 41;
  return camera;
}

model::LightField SeenByCamera(int u_count, int v_count, unsigned seed = 1) {
  model::LightField light_field = Relative(u_count, v_count, seed);
  light_field.camera = Calibrated();
  light_field.grid = model::DefaultGrid(*light_field.camera, u_count, v_count);
  return light_field;
}

ComparisonRecord Comparison(double estimate_db, double dibr_db) {
  ComparisonRecord comparison;
  comparison.mean = {estimate_db, 0.9123, 2.345, 0.9517};
  comparison.centre = ScoresRecord{estimate_db + 2, 0.9555, 1.2, 0.97};
  comparison.corner = ScoresRecord{estimate_db - 2, 0.8777, 3.4, std::nullopt};
  comparison.dibr_mean = ScoresRecord{dibr_db, 0.9001, 2.468, 0.9412};
  comparison.dibr_centre = ScoresRecord{dibr_db + 1, 0.9501, 1.357, 0.9601};
  comparison.dibr_corner = ScoresRecord{dibr_db - 1, 0.8601, 3.579, 0.9201};
  for (int v = 0; v < 3; ++v) {
    for (int u = 0; u < 3; ++u) {
      comparison.views.push_back({u, v, 30.14 + u + 3 * v, u == 0 ? 40.0 : 20.0});
    }
  }
  comparison.views_above_dibr = 7;
  return comparison;
}

EstimateRecord Estimate() {
  EstimateRecord record;
  record.solver = "blocks";
  record.u_count = record.v_count = 3;
  record.s_count = kAcrossPx;
  record.t_count = kDownPx;
  record.block_solver = "umfpack";
  record.stencil = "warp";
  record.gamma = 1.25;
  record.ridge = 0.00111;
  record.threads = 2;
  record.block_px = 16;
  record.blocks = 6;
  record.holes_filled = 5;
  record.setup_seconds = 0.25;
  record.solve_seconds = 12.5;
  record.views_seconds = 0.5;
  record.total_seconds = 13.25;
  record.peak_rss_mib = 345.6;
  record.relative_residual = 3.25e-15;
  record.rcond_min = 1.5e-4;
  record.effects = std::vector<std::string>{"defocus", "falloff"};
  return record;
}

estimator::SceneMaps Maps() {
  estimator::SceneMaps maps;
  maps.residual.assign(kAcrossPx * kDownPx, 0.0F);
  maps.occluded_fraction.assign(kAcrossPx * kDownPx, 0.0F);
  maps.blur_sigma_px.assign(kAcrossPx * kDownPx, 0.0F);
  return maps;
}

// The page without its images: their base64 holds any short text.
std::string WithoutImages(const std::string& html) {
  std::string text;
  std::size_t at = 0;
  while (true) {
    const std::size_t image = html.find(";base64,", at);
    if (image == std::string::npos) return text + html.substr(at);
    text += html.substr(at, image - at);
    at = html.find('"', image);
  }
}

// All inputs of a page, of 3 x 3 views with a camera.
class LightFieldPageTest : public ::testing::Test {
 protected:
  LightFieldPageTest() {
    light_field_.origin.method = "blocks";
    light_field_.origin.version = "0.0.9";
    light_field_.origin.date = "2026-01-30T00:00:00Z";
    input_.name = "out/est";
    input_.light_field = &light_field_;
    input_.version = "0.1.0";
    input_.date = "2026-01-31T00:00:00Z";
  }

  void GiveAll() {
    input_.truth = &truth_;
    input_.photo = &photo_;
    GiveDepth();
    input_.sweep = SweepStrip{"bench/sweep.yaml", 41, {}};
    for (int i = 0; i < 7; ++i) {
      input_.sweep->shots.push_back({cv::Mat(20, 20, CV_16UC1, cv::Scalar(9000 * i)),
                                     fmt::format("frames/f{}.png", i), 290.5 + i, i == 3});
    }
    const MadeUpCalibration made = MakeUpCalibration(31, 330, 5);
    input_.calibration = InlinedCalibrationReport(
        MakeCalibrationReport(made.sweep, made.calibration, nullptr, {"s", "0.1.0", "now", {}})
            .html,
        "r");
    input_.estimate = Estimate();
    input_.comparison = Comparison(31.25, 30.75);
  }
  // 300 to 600 mm from left to right, one column without depth.
  void GiveDepth() {
    input_.depth = PageDepth{kAcrossPx, kDownPx, {}, true};
    for (int i = 0; i < kAcrossPx * kDownPx; ++i) {
      input_.depth->values.push_back(
          i % kAcrossPx == 7 ? kUnknown
                             : 300 + 300.0F * static_cast<float>(i % kAcrossPx) / (kAcrossPx - 1));
    }
  }

  LightFieldPage Page() const {
    LightFieldPage page = MakeLightFieldPage(input_);
    EXPECT_EQ(ParseXml(page.html).error, "");
    return page;
  }
  std::string Html() const { return WithoutImages(Page().html); }

  model::LightField light_field_ = SeenByCamera(3, 3, 1);
  model::LightField truth_ = SeenByCamera(3, 3, 2);
  model::LinearImage photo_ = model::ViewImage(truth_, 1, 1);
  LightFieldPageInput input_;
};

// The image of the <img> with that alternative text; RGB.
cv::Mat ImageFrom(const XmlDocument& document, const std::string& alt) {
  for (const XmlElement& image : document.Named("img")) {
    if (image.Attribute("alt") != alt) continue;
    const std::string source = image.Attribute("src");
    const std::string digits = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    std::string bytes;
    unsigned bits = 0;
    int count = 0;
    for (char c : source.substr(source.find(',') + 1)) {
      if (c == '=') break;
      bits = bits << 6 | static_cast<unsigned>(digits.find(c));
      count += 6;
      if (count >= 8) bytes += static_cast<char>(bits >> (count -= 8) & 255);
    }
    return io::DecodeImage(bytes, alt);
  }
  ADD_FAILURE() << "no image '" << alt << "'";
  return cv::Mat::zeros(1, 1, CV_8UC3);
}

TEST_F(LightFieldPageTest, IsOneWellFormedPageThatNeedsNothingElse) {
  GiveAll();
  const LightFieldPage page = Page();
  const XmlDocument document = ParseXml(page.html);
  const std::string text = WithoutImages(page.html);
  for (const char* outside : {"http", "href=", "<script", "@import", "nan", "inf "})
    EXPECT_THAT(text, Not(HasSubstr(outside)));
  std::set<std::string> ids;
  for (const XmlElement& element : document.elements) {
    const std::string id = element.Attribute("id");
    if (!id.empty()) {
      EXPECT_TRUE(ids.insert(id).second) << id;
    }
  }
  for (const std::string& section : page.sections) EXPECT_EQ(ids.count(section), 1u) << section;
  const std::vector<XmlElement> images = document.Named("img");
  // 7 frames, photograph, depth, 9 views, 3 x 3 large ones, 2 epipolar, 5 refocused.
  EXPECT_EQ(images.size(), 7u + 2u + 9u + 9u + 2u + 5u);
  for (const XmlElement& image : images) {
    EXPECT_THAT(image.Attribute("src"), StartsWith("data:image/"));
    EXPECT_NE(image.Attribute("alt"), "");
  }
  EXPECT_EQ(document.Named("h1").size(), 1u);
}

TEST_F(LightFieldPageTest, SaysOnlyWhatItWasGiven) {
  EXPECT_THAT(Page().sections, ElementsAre("summary", "views", "epipolar", "how"));
  const std::string html = Html();
  for (const char* absent : {"DIBR", "truth", "PSNR", "sweep", "refocus", "MiB"})
    EXPECT_THAT(html.substr(html.find("<main>")), Not(HasSubstr(absent)));
  input_.photo = &photo_;
  EXPECT_THAT(Page().sections, ElementsAre("summary", "image", "views", "epipolar", "how"));
  EXPECT_THAT(Html(), Not(HasSubstr("Depth map")));
  input_.photo = nullptr;
  GiveDepth();
  EXPECT_THAT(Page().sections,
              ElementsAre("summary", "image", "views", "epipolar", "refocus", "how"));
  EXPECT_THAT(Html(), Not(HasSubstr("All available data on the light")));
  GiveAll();
  EXPECT_THAT(Page().sections, ElementsAre("summary", "sweep", "calibration", "image", "views",
                                           "epipolar", "refocus", "numbers", "how"));
}

TEST_F(LightFieldPageTest, EscapesNamesFromOutside) {
  GiveAll();
  const std::string nasty = "<i>&\"#'\x02\xFE";
  input_.name = input_.sweep->name = input_.version = input_.date = nasty;
  for (SweepShot& shot : input_.sweep->shots) shot.file_name = nasty;
  light_field_.camera->name = nasty;
  light_field_.origin.version = light_field_.origin.date = nasty;
  EstimateRecord& record = *input_.estimate;
  record.solver = record.block_solver = record.stencil = record.splat = record.device = nasty;
  record.effects = std::vector<std::string>{nasty};
  const XmlDocument document = ParseXml(MakeLightFieldPage(input_).html);
  EXPECT_EQ(document.error, "");
  EXPECT_TRUE(document.Named("i").empty());
}

TEST_F(LightFieldPageTest, NumbersAreThoseGiven) {
  GiveAll();
  const std::string html = Html();
  for (const char* cell :
       {">31.25</td><td class=\"number\">0.9123</td><td class=\"number\">2.345</td>"
        "<td class=\"number\">0.9517</td>",
        ">30.75</td><td class=\"number\">0.9001</td><td class=\"number\">2.468</td>"
        "<td class=\"number\">0.9412</td>",
        ">33.25</td><td class=\"number\">0.9555</td>",
        ">31.75</td><td class=\"number\">0.9501</td>",
        ">29.25</td><td class=\"number\">0.8777</td><td class=\"number\">3.400</td>"
        "<td class=\"number\">–</td>",
        ">29.75</td><td class=\"number\">0.8601</td>"})
    EXPECT_THAT(html, HasSubstr(cell));
  for (const char* row :
       {"<th scope=\"row\">solver</th><td>blocks</td>",
        "<th scope=\"row\">solver of a block</th><td>umfpack</td>",
        "<th scope=\"row\">stencil of the smoothness</th><td>warp</td>",
        "<th scope=\"row\">smoothness gamma</th><td>1.25</td>",
        "<th scope=\"row\">ridge mu</th><td>0.00111</td>",
        "<th scope=\"row\">edge of a block</th><td>16 px</td>",
        "<th scope=\"row\">largest relative residual</th><td>3.25e-15</td>",
        "<th scope=\"row\">smallest rcond</th><td>1.50e-04</td>", "<td>defocus, falloff</td>",
        "<td>13.25 s: set-up 0.25, solve 12.50, views 0.50</td>",
        "<th scope=\"row\">peak memory</th><td>346 MiB</td>",
        "<th scope=\"row\">made with thicklens</th><td>0.0.9</td>",
        "<th scope=\"row\">on</th><td>2026-01-30T00:00:00Z</td>"})
    EXPECT_THAT(html, HasSubstr(row));
}

// Cells in their places, and ▾ where DIBR is better: in the first column.
TEST_F(LightFieldPageTest, TheHeatTableShowsEachViewInItsPlace) {
  GiveAll();
  const std::string html = Html();
  for (int v = 0; v < 3; ++v) {
    std::string row;
    const std::size_t at = html.find(fmt::format("<th scope=\"row\">v {}</th>", v));
    ASSERT_NE(at, std::string::npos);
    row = html.substr(at, html.find("</tr>", at) - at);
    EXPECT_THAT(row, HasSubstr(fmt::format(">{:.1f}\u00A0▾</td>", 30.14 + 3 * v)));
    EXPECT_THAT(row, HasSubstr(fmt::format(">{:.1f}</td>", 31.14 + 3 * v)));
    EXPECT_THAT(row, HasSubstr(fmt::format(">{:.1f}</td>", 32.14 + 3 * v)));
  }
  EXPECT_THAT(html, HasSubstr("▾ marks the 3 of 9 where DIBR is better"));
  EXPECT_THAT(html, HasSubstr("background: #440154; color: #ffffff"));  // the worst
  EXPECT_THAT(html, HasSubstr("background: #fde725; color: #10141a"));  // the best
  for (ViewRecord& view : input_.comparison->views) view.dibr_psnr_db = 1;
  EXPECT_THAT(Html(), HasSubstr("DIBR is better in none of them"));
  for (ViewRecord& view : input_.comparison->views) view.dibr_psnr_db.reset();
  EXPECT_THAT(Html(), Not(HasSubstr("DIBR is better in")));
  input_.comparison->views.clear();
  EXPECT_THAT(Html(), Not(HasSubstr("PSNR of each view")));
}

TEST_F(LightFieldPageTest, SaysSoWhereDibrIsBetter) {
  GiveAll();
  input_.comparison = Comparison(31.25, 33.5);
  const std::string html = Html();
  EXPECT_THAT(html, HasSubstr("9\u00A0views from one photograph; warping by depth (DIBR) is better "
                              "here"));
  EXPECT_THAT(html, HasSubstr("<div class=\"verdict partial\">"));
  EXPECT_THAT(html, HasSubstr("33.50\u00A0dB in the mean: 2.25\u00A0dB better than the estimate"));
  EXPECT_THAT(html,
              HasSubstr("in the centre 34.50\u00A0dB, 1.25\u00A0dB better than the estimate"));
  EXPECT_THAT(html, HasSubstr("The estimate is above DIBR in 7 of 9 views"));
}

TEST_F(LightFieldPageTest, SaysSoWhereTheEstimateIsBetter) {
  GiveAll();
  const std::string html = Html();
  EXPECT_THAT(html, HasSubstr("from one photograph, better than warping by depth (DIBR)"));
  EXPECT_THAT(html, HasSubstr("<div class=\"verdict ok\">"));
  EXPECT_THAT(html, HasSubstr("PSNR 31.25\u00A0dB in the mean, 33.25\u00A0dB in the centre, "
                              "29.25\u00A0dB in the corners"));
  EXPECT_THAT(html, HasSubstr("30.75\u00A0dB in the mean: 0.50\u00A0dB worse than the estimate"));
  EXPECT_THAT(html, HasSubstr("in the centre 31.75\u00A0dB, 1.50\u00A0dB worse than the estimate"));
}

TEST_F(LightFieldPageTest, EqualAndPerfectScoresAreNamed) {
  GiveAll();
  input_.comparison = Comparison(31.25, 31.25);
  EXPECT_THAT(Html(), AllOf(HasSubstr("as good as warping by depth"),
                            HasSubstr("in the mean: the same as the estimate")));
  const double infinity = std::numeric_limits<double>::infinity();
  input_.comparison = Comparison(infinity, 31.25);
  EXPECT_THAT(Html(), AllOf(HasSubstr("better than warping by depth"), HasSubstr("PSNR ∞"),
                            HasSubstr("in the mean: worse")));
  input_.comparison = Comparison(31.25, infinity);
  EXPECT_THAT(Html(), AllOf(HasSubstr("(DIBR) is better here"), HasSubstr("in the mean: better")));
  input_.comparison = Comparison(infinity, infinity);
  EXPECT_THAT(Html(), HasSubstr("as good as warping by depth"));
  for (ViewRecord& view : input_.comparison->views) view.psnr_db = infinity;
  EXPECT_THAT(Html(), HasSubstr(">∞</td>"));
  input_.comparison->dibr_mean.reset();
  EXPECT_THAT(Html(), AllOf(HasSubstr("<div class=\"verdict plain\">"),
                            Not(HasSubstr("warping by depth"))));
}

TEST_F(LightFieldPageTest, TheCameraInWords) {
  const std::string html = Html();
  EXPECT_THAT(html, HasSubstr("Camera bench-camera: image distance d1 = "
                              "16.2158\u00A0±\u00A00.0012\u00A0mm, blur ratio κ "
                              "= 0.4512\u00A0±\u00A00.0021 (calibrated from 41\u00A0frames)"));
  light_field_.camera->calibration->evidence.method = "assumed";
  light_field_.camera->calibration->image_distance_mm->sigma = 0;
  EXPECT_THAT(Html(), AllOf(HasSubstr("d1 = 16.216\u00A0mm"), HasSubstr("assumed, not measured"),
                            Not(HasSubstr("calibrated from"))));
  // If there are no frames, they are not mentioned.
  light_field_.camera->calibration->evidence.frames_used = 0;
  light_field_.camera->calibration->evidence.method = "simulated";
  EXPECT_THAT(Html(), AllOf(HasSubstr("(true values of a simulated camera, not measured)."),
                            Not(HasSubstr("frame"))));
  light_field_.camera->calibration->evidence.method = "by<hand>";
  EXPECT_THAT(Html(), AllOf(HasSubstr("(by by&lt;hand&gt;)."), Not(HasSubstr("frame"))));
  light_field_.camera->calibration->evidence.method = "";
  EXPECT_THAT(Html(), AllOf(HasSubstr("blur ratio κ = 0.4512\u00A0±\u00A00.0021."),
                            Not(HasSubstr("frame"))));
  const model::LightField relative = Relative(3, 3);
  input_.light_field = &relative;
  EXPECT_THAT(Html(), AllOf(HasSubstr("There is no camera"), Not(HasSubstr("image distance"))));
}

TEST_F(LightFieldPageTest, TheRunInWords) {
  GiveAll();
  EXPECT_THAT(Html(), HasSubstr("by the solver blocks (6\u00A0blocks of 16\u00A0px) in "
                                "13.2\u00A0s with at most 346\u00A0MiB of memory."));
  // Without the record, less is known from the file of the light field itself.
  input_.estimate.reset();
  light_field_.origin.block_px = 24;
  light_field_.origin.seconds = 7.5;
  EXPECT_THAT(Html(),
              AllOf(HasSubstr("(blocks of 24\u00A0px) in 7.5\u00A0s."), Not(HasSubstr("MiB"))));
}

// A light field that was not estimated is not called so.
TEST_F(LightFieldPageTest, KnownLightFieldsAreNoEstimates) {
  light_field_.origin.method = "simulated";
  const std::string html = Html();
  EXPECT_THAT(html, HasSubstr("<h1>A light field</h1>"));
  EXPECT_THAT(html, HasSubstr("in colour, simulated."));
  EXPECT_THAT(html.substr(html.find("<main>")), Not(HasSubstr("estimated")));
}

TEST_F(LightFieldPageTest, AtMostFiveByFiveThumbnailsWithTheOutermost) {
  const model::LightField many = Relative(9, 7);
  input_.light_field = &many;
  const XmlDocument document = ParseXml(Html());
  std::vector<std::string> names;
  for (const XmlElement& image : document.Named("img")) {
    const std::string alt = image.Attribute("alt");
    if (alt.rfind("View ", 0) == 0) names.push_back(alt);
  }
  EXPECT_EQ(names.size(), 25u);
  for (const char* view : {"View u 0, v 0", "View u 8, v 0", "View u 4, v 3", "View u 8, v 6"})
    EXPECT_THAT(names, ::testing::Contains(view));
  EXPECT_THAT(Html(), HasSubstr("25 of the 63 views"));
}

TEST_F(LightFieldPageTest, MissingViewsAreNamedAndNotCounted) {
  GiveAll();
  light_field_.present.assign(9, true);
  light_field_.present[0] = light_field_.present[3] = false;  // (0, 0) and (0, 1)
  std::fill_n(light_field_.values.begin(), light_field_.view_size(), 0.0F);
  const std::string html = Html();
  EXPECT_THAT(html, HasSubstr("7\u00A0views from one photograph"));
  EXPECT_THAT(html, HasSubstr("u 0, v 0: missing"));
  EXPECT_THAT(html, Not(HasSubstr("estimate, u 0, v 1")));
  EXPECT_THAT(html, HasSubstr("estimate, u 2, v 1"));
}

TEST_F(LightFieldPageTest, OneColumnOrOneViewIsShownToo) {
  const model::LightField column = Relative(1, 3);
  input_.light_field = &column;
  EXPECT_THAT(Page().sections, ElementsAre("summary", "views", "how"));
  EXPECT_THAT(Html(), HasSubstr("view, u 0, v 2"));
  EXPECT_THAT(Html(), HasSubstr("uppermost, the middle and the lowest"));
  const model::LightField one = Relative(1, 1);
  input_.light_field = &one;
  EXPECT_THAT(Html(), HasSubstr(">1\u00A0view<"));
}

// The images of the views show their encoded light, and the difference to the truth.
TEST_F(LightFieldPageTest, ImagesShowTheLightField) {
  GiveAll();
  const model::TransferCurve srgb = model::TransferCurve::Srgb();
  const auto level = [&](const model::LightField& light_field, int k, int l, int s, int t, int c) {
    const std::size_t at =
        light_field.ViewStart(c, k, l) + static_cast<std::size_t>(t * kAcrossPx + s);
    return std::lround(255 * srgb.Encode(light_field.values[at]));
  };
  const XmlDocument document = ParseXml(Page().html);
  const cv::Mat estimate = ImageFrom(document, "estimate, u 2, v 1");
  const cv::Mat truth = ImageFrom(document, "truth, u 2, v 1");
  const std::string html = Html();
  const std::size_t times = html.find("difference × ");
  ASSERT_NE(times, std::string::npos);
  const int gain = std::stoi(html.substr(times + std::string("difference × ").size()));
  const cv::Mat difference = ImageFrom(document, fmt::format("difference × {}, u 2, v 1", gain));
  ASSERT_EQ(estimate.size(), cv::Size(kAcrossPx, kDownPx));
  for (const auto& [s, t] : {std::pair{0, 0}, std::pair{33, 5}, std::pair{7, 23}}) {
    for (int c = 0; c < 3; ++c) {
      const long a = level(light_field_, 2, 1, s, t, c), b = level(truth_, 2, 1, s, t, c);
      EXPECT_EQ(estimate.ptr<unsigned char>(t)[3 * s + c], a);
      EXPECT_EQ(truth.ptr<unsigned char>(t)[3 * s + c], b);
      EXPECT_EQ(difference.ptr<unsigned char>(t)[3 * s + c],
                std::clamp(128 + gain * (a - b), 0L, 255L));
    }
  }
  const cv::Mat epipolar = ImageFrom(document, "Epipolar image, truth");
  const int repeat = epipolar.rows / 3;
  EXPECT_EQ(epipolar.ptr<unsigned char>(2 * repeat)[3 * 11 + 1], level(truth_, 2, 1, 11, 12, 1));
}

// Equally spaced in 1/z over the depths, outliers aside; the plane of focus, shifted by nothing,
// is the mean of the views.
TEST_F(LightFieldPageTest, RefocusesFromNearToFar) {
  GiveDepth();
  const std::vector<XmlElement> images = ParseXml(Html()).Named("img");
  std::vector<double> depths_mm;
  for (const XmlElement& image : images) {
    const std::string alt = image.Attribute("alt"), what = "Refocused to ";
    if (alt.rfind(what, 0) == 0) depths_mm.push_back(std::stod(alt.substr(what.size())));
  }
  ASSERT_EQ(depths_mm.size(), 5u);
  EXPECT_NEAR(depths_mm.front(), 300, 0.6);
  EXPECT_NEAR(depths_mm.back(), 600, 0.6);
  EXPECT_NEAR(depths_mm[2], 400, 0.6);  // 1/400 is between 1/300 and 1/600
  EXPECT_NEAR(depths_mm[1], 1 / (0.75 / 300 + 0.25 / 600), 0.6);
}

TEST_F(LightFieldPageTest, RefocusesToDisparitiesWithoutACamera) {
  const model::LightField relative = Relative(3, 3);
  input_.light_field = &relative;
  input_.depth =
      PageDepth{kAcrossPx, kDownPx, std::vector<float>(kAcrossPx * kDownPx, -1.5F), false};
  for (int i = 0; i < kAcrossPx * kDownPx / 2; ++i)
    input_.depth->values[static_cast<std::size_t>(i)] = 1.5F;
  const std::string html = Html();
  for (const char* label : {"+1.50 px<", "+0.75 px<", "+0.00 px<", "−0.75 px<", "−1.50 px<"})
    EXPECT_THAT(html, HasSubstr(label));
  EXPECT_LT(html.find("+1.50 px<"), html.find("−1.50 px<"));  // the near first
  PageDepth small = *input_.depth;
  for (float& value : small.values) value /= 100;
  std::swap(small, *input_.depth);
  EXPECT_THAT(Html(), AllOf(HasSubstr("+0.015 px<"), HasSubstr("−0.007 px<")));
  std::swap(small, *input_.depth);
  const cv::Mat mean = ImageFrom(ParseXml(Page().html), "Refocused to +0.00 px");
  double light = 0;
  for (int l = 0; l < 3; ++l)
    for (int k = 0; k < 3; ++k)
      light += relative.values[relative.ViewStart(0, k, l) + 5 * kAcrossPx + 6] / 9.0;
  EXPECT_NEAR(mean.ptr<unsigned char>(5)[3 * 6], 255 * model::TransferCurve::Srgb().Encode(light),
              0.6);
}

TEST_F(LightFieldPageTest, DepthsAreColouredAndHolesCounted) {
  GiveDepth();
  const std::string html = Html();
  EXPECT_THAT(html, HasSubstr("from 300 to 600 mm from the aperture; bright is near"));
  EXPECT_THAT(html, HasSubstr("Hatched in grey: 24 px (2.5 %)"));
  const cv::Mat map = ImageFrom(ParseXml(Page().html), "Depth map in colours");
  const auto* row = map.ptr<unsigned char>(3);
  EXPECT_GT(row[1], 200);                       // the nearest is yellow
  EXPECT_LT(row[3 * (kAcrossPx - 1) + 1], 20);  // the farthest dark
  EXPECT_EQ(row[3 * 7], row[3 * 7 + 2]);        // the hole grey
  input_.depth->values.assign(kAcrossPx * kDownPx, 400.0F);
  EXPECT_THAT(Html(), AllOf(HasSubstr("Refocused to 400 mm"), Not(HasSubstr("Hatched"))));
  input_.depth->values.assign(kAcrossPx * kDownPx, kUnknown);
  EXPECT_THAT(Html(), AllOf(HasSubstr("100.0 %"), Not(HasSubstr("Refocused"))));
}

// The residual in greys, mid grey where it is 0; 99 of 100 pixels within 10 grey levels.
TEST_F(LightFieldPageTest, TheResidualIsSigned) {
  estimator::SceneMaps maps = Maps();
  input_.maps = &maps;
  for (std::size_t i = 0; i < maps.residual.size(); ++i) {
    maps.residual[i] = static_cast<float>((i % 17 == 0 ? 6.0 : 0.0) / 255);
  }
  maps.residual[0] = 1;
  maps.residual[1] = -1;
  maps.residual[2] = -5.0F / 255;
  const cv::Mat map = ImageFrom(ParseXml(Page().html), "Residual of the photograph");
  ASSERT_EQ(map.size(), cv::Size(kAcrossPx, kDownPx));
  const auto* row = map.ptr<unsigned char>(0);
  const int step = map.channels();
  EXPECT_EQ(row[0], 255);
  EXPECT_EQ(row[step], 0);
  EXPECT_NEAR(row[2 * step], 128 - 127 / 2, 1);
  EXPECT_EQ(row[3 * step], 128);
  EXPECT_NEAR(row[17 * step], 128 + 127 * 0.6, 1);
  EXPECT_THAT(Html(), AllOf(HasSubstr("The colours from -10 to 10 grey levels"),
                            Not(HasSubstr("Its rms is"))));
  input_.estimate = Estimate();
  input_.estimate->residual_rms = 1.5 / 255;
  input_.estimate->noise_sigma = 1.25 / 255;
  EXPECT_THAT(Html(), AllOf(HasSubstr("Its rms is 1.50 grey levels"),
                            HasSubstr("noise of the photograph 1.25 per channel")));
}

TEST_F(LightFieldPageTest, TheConfidenceHasItsShares) {
  estimator::SceneMaps maps = Maps();
  input_.maps = &maps;
  // The rows are: 12 of 24 visible, 6 blurred, 3 partly visible, 3 filled in (one of these blurred
  // as well).
  for (std::size_t i = 0; i < maps.occluded_fraction.size(); ++i) {
    const std::size_t y = i / kAcrossPx;
    maps.blur_sigma_px[i] = y < 6 || y == 23 ? 3.5F : 2.5F;
    maps.occluded_fraction[i] = y >= 21 ? 0.75F : y >= 18 ? 0.25F : 0.005F;
  }
  const std::string html = Html();
  EXPECT_THAT(html, AllOf(HasSubstr("that the aperture sees (50.0 %)"),
                          HasSubstr("some rays come past an edge or the border (12.5 %)"),
                          HasSubstr("for fine detail (25.0 %)"),
                          HasSubstr("most rays come past an edge or the border (12.5 %)")));
  const cv::Mat map = ImageFrom(ParseXml(Page().html), "Confidence of the estimate");
  ASSERT_EQ(map.size(), cv::Size(kAcrossPx, kDownPx));
  const auto at = [&](int y, int c) {
    return static_cast<int>(map.ptr<unsigned char>(y)[3 * 5 + c]);
  };
  EXPECT_GT(at(3, 2), at(3, 0) + 60);    // blue
  EXPECT_EQ(at(12, 0), at(12, 2));       // grey
  EXPECT_GT(at(19, 1), at(19, 2) + 40);  // yellow
  EXPECT_GT(at(19, 0), at(19, 2) + 60);
  EXPECT_GT(at(22, 0), at(22, 1) + 60);  // red
  EXPECT_GT(at(23, 0), at(23, 1) + 60);
}

TEST_F(LightFieldPageTest, TheMosaicHasEachViewInItsPlace) {
  input_.mosaic = true;
  const XmlDocument document = ParseXml(Page().html);
  const cv::Mat mosaic = ImageFrom(document, "Mosaic of the views");
  constexpr int kGap = 2;
  ASSERT_EQ(mosaic.size(), cv::Size(3 * kAcrossPx + 2 * kGap, 3 * kDownPx + 2 * kGap));
  const model::TransferCurve srgb = model::TransferCurve::Srgb();
  const std::size_t sample = light_field_.ViewStart(1, 2, 1) + 7 * kAcrossPx + 9;
  EXPECT_EQ(mosaic.ptr<unsigned char>(kDownPx + kGap + 7)[3 * (2 * (kAcrossPx + kGap) + 9) + 1],
            std::lround(255 * srgb.Encode(light_field_.values[sample])));
  EXPECT_EQ(mosaic.ptr<unsigned char>(kDownPx)[3 * 9 + 1], 0);  // between the views
  EXPECT_THAT(Html(), Not(HasSubstr("alt=\"View u")));
  light_field_.present.assign(9, true);
  light_field_.present[0] = false;
  EXPECT_EQ(ImageFrom(ParseXml(Page().html), "Mosaic of the views").size(), mosaic.size());
}

TEST_F(LightFieldPageTest, WarningsStandInTheSummary) {
  input_.warnings = {"first <b>", "second"};
  const std::string html = Html();
  EXPECT_THAT(html, HasSubstr("<ul class=\"warnings\">\n<li>first &lt;b&gt;</li>\n<li>second"));
  EXPECT_LT(html.find("<li>first"), html.find("</section>"));
}

TEST_F(LightFieldPageTest, AnEstimateOfTheSceneInWords) {
  light_field_.origin.method = "scene";
  light_field_.origin.prior = "tv";
  light_field_.origin.strength = 0.00125;
  light_field_.origin.noise_sigma = 0.5 / 255;
  light_field_.origin.iterations = 57;
  EXPECT_THAT(Html(), AllOf(HasSubstr("by the solver scene (prior tv)."),
                            HasSubstr("<td>total variation</td>"), HasSubstr("<td>0.00125</td>"),
                            HasSubstr("<td>0.50 grey levels</td>"), HasSubstr("<td>57</td>")));
  input_.estimate = Estimate();
  input_.estimate->block_solver = "";
  input_.estimate->block_px.reset();
  input_.estimate->prior = "gradient";
  input_.estimate->strength = 0.5;
  input_.estimate->strength_rule = "gcv";
  input_.estimate->iterations = 9;
  input_.estimate->converged = false;
  input_.estimate->occluded_fraction = 0.125;
  input_.estimate->files_seconds = 2.5;
  EXPECT_THAT(Html(), AllOf(HasSubstr("<td>gradient</td>"), HasSubstr("<td>0.5 (gcv)</td>"),
                            HasSubstr("<td>9, not converged</td>"), HasSubstr("<td>12.5 %</td>"),
                            HasSubstr("views 0.50, files 2.50</td>")));
}

TEST_F(LightFieldPageTest, TheSweepNamesItsEndsAndFocus) {
  GiveAll();
  const std::string html = Html();
  for (const char* label : {"290.5 mm, near", "293.5 mm, focus", "296.5 mm, far", ">291.5 mm<"})
    EXPECT_THAT(html, HasSubstr(label));
  EXPECT_THAT(html, HasSubstr("7 of the 41 frames of bench/sweep.yaml"));
  EXPECT_THAT(html, HasSubstr("sharpest near the frame marked focus"));
  input_.sweep->shots[3].nearest_to_focus = false;
  EXPECT_THAT(Html(), Not(HasSubstr("marked focus")));
}

// Views of a common camera, with noise and edges, which compress badly.
TEST_F(LightFieldPageTest, SlowStaysBelowFourMegabytesForOrdinaryImages) {
  model::LightField large = model::MakeLightField(640, 480, 5, 5, 3);
  std::mt19937 generator(5);
  std::normal_distribution<float> noise(0, 0.02F);
  for (std::size_t i = 0; i < large.values.size(); ++i) {
    large.values[i] = 0.4F + 0.3F * std::sin(0.05F * static_cast<float>(i % 640)) +
                      0.2F * static_cast<float>(i / 40 % 2) + noise(generator);
  }
  input_.light_field = input_.truth = &large;
  const model::LinearImage photo = model::ViewImage(large, 0, 0);
  input_.photo = &photo;
  input_.depth = PageDepth{640, 480, {}, false};
  for (int i = 0; i < 640 * 480; ++i)
    input_.depth->values.push_back(std::sin(0.01F * static_cast<float>(i % 640)) +
                                   noise(generator) / 4);
  EXPECT_LT(Page().html.size(), 4u << 20);
}

// The program.

class ReportProgram : public ::testing::Test {
 protected:
  std::string Write(const model::LightField& light_field, const std::string& name) {
    OutputFolder folder(folder_ / name, io::kLightFieldMarker, io::LightFieldEntries());
    io::WriteLightField(light_field, io::ViewFormat::kPng, &folder);
    folder.Commit();
    return folder_ / name;
  }
  std::string PutPhoto(int width_px, int height_px, int channels) {
    std::vector<unsigned char> png;
    cv::imencode(".png", cv::Mat(height_px, width_px, CV_8UC(channels), cv::Scalar::all(100)), png);
    return folder_.Put("photo.png", {png.begin(), png.end()});
  }
  std::string PutDepth(float value, int width_px = kAcrossPx, int height_px = kDownPx) {
    model::RawDepthMap map{width_px, height_px, {}, false};
    map.values.assign(static_cast<std::size_t>(width_px * height_px), value);
    for (int i = 0; i < width_px; ++i) map.values[static_cast<std::size_t>(i)] = value * 1.1F;
    return folder_.Put("depth.pfm", io::EncodePfm(map));
  }
  ProgramResult Run(std::vector<std::string> arguments) {
    arguments.insert(arguments.begin(), "report");
    arguments.insert(arguments.end(), {"-o", page_, "--quiet"});
    return ChildProgram(arguments, folder_.path(), 0).Wait();
  }
  // Exit code 1, one line that has all of `parts`, and no page.
  void ExpectRefused(const std::vector<std::string>& arguments,
                     const std::vector<std::string>& parts, int exit_code = 1) {
    const ProgramResult result = Run(arguments);
    EXPECT_EQ(result.exit_code, exit_code) << result.err;
    EXPECT_THAT(result.err, StartsWith("thicklens: error: "));
    EXPECT_EQ(std::count(result.err.begin(), result.err.end(), '\n'), 1) << result.err;
    for (const std::string& part : parts) EXPECT_THAT(result.err, HasSubstr(part));
    EXPECT_THAT(folder_.Entries(), Not(::testing::Contains("page.html")));
  }

  TemporaryFolder folder_;
  std::string page_ = folder_ / "page.html";
};

TEST_F(ReportProgram, WritesThePageAndItsSections) {
  const std::string estimate = Write(SeenByCamera(3, 3, 1), "est");
  const std::string truth = Write(SeenByCamera(3, 3, 2), "true");
  const ProgramResult result =
      Run({estimate, "--truth", truth, "--photo", PutPhoto(kAcrossPx, kDownPx, 4), "--depth",
           PutDepth(400), "--depth-kind", "z", "--depth-unit", "mm", "--json", folder_ / "r.json"});
  ASSERT_EQ(result.exit_code, 0) << result.err;
  EXPECT_EQ(result.out, "");
  const nlohmann::json json = nlohmann::json::parse(ContentOf(folder_ / "r.json"));
  EXPECT_EQ(json["status"], "ok");
  EXPECT_EQ(json["reason"], "");
  EXPECT_EQ(json["output"], page_);
  EXPECT_EQ(json["sections"],
            nlohmann::json({"summary", "image", "views", "epipolar", "refocus", "how"}));
  const std::string html = ContentOf(page_);
  EXPECT_EQ(ParseXml(html).error, "");
  EXPECT_THAT(html, HasSubstr("from 400 to 440 mm"));
  const cv::Mat photo = ImageFrom(ParseXml(html), "The photograph through the whole aperture");
  EXPECT_EQ(photo.channels(), 3);  // its alpha is not light
  EXPECT_EQ(photo.ptr<unsigned char>(0)[0], 100);
}

TEST_F(ReportProgram, CropsAllAlikeButNotWhatIsCropped) {
  const model::LightField whole = SeenByCamera(3, 3, 1);
  const std::string estimate = Write(model::CropViews(whole, {4, 2, 30, 20}), "est");
  const std::string truth = Write(whole, "true");
  const ProgramResult result = Run({estimate, "--truth", truth, "--photo",
                                    PutPhoto(kAcrossPx, kDownPx, 3), "--crop", "4,2,30,20"});
  ASSERT_EQ(result.exit_code, 0) << result.err;
  // The views are the same, so the differences are grey everywhere.
  const XmlDocument document = ParseXml(ContentOf(page_));
  const cv::Mat difference = ImageFrom(document, "difference × 32, u 0, v 1");
  EXPECT_EQ(difference.size(), cv::Size(30, 20));
  EXPECT_EQ(cv::norm(difference, cv::Mat(20, 30, CV_8UC3, cv::Scalar::all(128)), cv::NORM_INF), 0);
}

TEST_F(ReportProgram, TakesTheInnerViewsOfALargerTruth) {
  const model::LightField five = Relative(5, 5);
  const std::string estimate = Write(model::InnerViews(five, 3, 3), "est");
  const ProgramResult result = Run({estimate, "--truth", Write(five, "true")});
  ASSERT_EQ(result.exit_code, 0) << result.err;
  ImageFrom(ParseXml(ContentOf(page_)), "difference × 32, u 0, v 1");
}

TEST_F(ReportProgram, ShowsTheSweepAroundTheFocus) {
  const model::LightField light_field = SeenByCamera(3, 3);
  const double focus_mm = light_field.camera->focus_depth_mm();
  std::string rows;
  for (int i = 0; i < 21; ++i) {
    std::vector<unsigned char> png;
    cv::imencode(".png", cv::Mat(60, 80, CV_8UC1, cv::Scalar(10 * i)), png);
    folder_.Put(fmt::format("sweep/f{}.png", i), {png.begin(), png.end()});
    // The frames run from far to near and are in focus at frame 5.
    rows += fmt::format("  - {{image: f{}.png, reading_mm: {:.3f}}}\n", i,
                        focus_mm + 1000 - (focus_mm + 10.0 * (5 - i)) + 0.001);
  }
  folder_.Put("sweep/sweep.yaml",
              fmt::format("schema: thicklens/sweep/1\ncamera: none.yaml\nreading_sigma_mm: 0.1\n"
                          "direction: toward\noffset_mm: {{value: {}, sigma: 0}}\nframes:\n{}",
                          focus_mm + 1000, rows));
  const ProgramResult result = Run({Write(light_field, "est"), "--sweep", folder_ / "sweep"});
  ASSERT_EQ(result.exit_code, 0) << result.err;
  const std::string html = ContentOf(page_);
  EXPECT_THAT(html, HasSubstr("7 of the 21 frames"));
  EXPECT_THAT(html, HasSubstr("60 × 60 px"));
  const std::size_t near = html.find("mm, near"), focus = html.find("mm, focus"),
                    far = html.find("mm, far");
  EXPECT_LT(near, focus);
  EXPECT_LT(focus, far);
  const XmlDocument document = ParseXml(html);
  // z = offset - reading: frame 20 is the nearest.
  EXPECT_LT(html.find("alt=\"f20.png\""), near);
  EXPECT_GT(html.find("alt=\"f0.png\""), focus);
  EXPECT_EQ(ImageFrom(document, "f5.png").ptr<unsigned char>(0)[0], 50);
}

TEST_F(ReportProgram, RefusesFilesThatDoNotFit) {
  const std::string estimate = Write(SeenByCamera(3, 3), "est");
  ExpectRefused({folder_ / "missing"}, {folder_ / "missing"});
  ExpectRefused({estimate, "--photo", PutPhoto(kAcrossPx, kDownPx - 1, 3)},
                {"photo.png: it is 40x23 px, the views are 40x24 px"});
  ExpectRefused({estimate, "--photo", folder_.Put("p.png", "no image")}, {"p.png: cannot be"});
  ExpectRefused({estimate, "--photo", PutPhoto(kAcrossPx, kDownPx, 3), "--crop", "30,0,20,20"},
                {"30"});
  ExpectRefused({estimate, "--depth", PutDepth(400, kAcrossPx + 1, kDownPx), "--depth-kind", "z",
                 "--depth-unit", "mm"},
                {"depth.pfm: it is 41x24 px"});
  ExpectRefused({estimate, "--depth", PutDepth(0), "--depth-kind", "z", "--depth-unit", "mm"},
                {"depth.pfm"});
  ExpectRefused({estimate, "--depth", PutDepth(400), "--depth-kind", "z", "--depth-unit", "m"},
                {"depth.pfm"});
  ExpectRefused({estimate, "--truth", Write(SeenByCamera(5, 5), "true")},
                {"true: its views are", "mm apart"});
  ExpectRefused({estimate, "--truth", Write(Relative(2, 3), "true")}, {"true: "});
  ExpectRefused({estimate, "--sweep", folder_ / "nowhere"}, {"nowhere"});
  ExpectRefused({estimate, "--calibration", folder_.Put("r.html", "<main><script/></main>")},
                {"r.html: not a page of `thicklens calibrate --report`"});
  ExpectRefused({estimate, "--estimate", folder_.Put("e.json", "{]")}, {"e.json: not a JSON file"});
  ExpectRefused({estimate, "--comparison", folder_.Put("c.json", "{\"status\": \"ok\"}")},
                {"c.json: 'mean' is missing"});
  ExpectRefused(
      {estimate, "--estimate",
       folder_.Put("e.json", R"({"solver": "blocks", "views": [5, 5], "size": [40, 24]})")},
      {"e.json: it is for 5x5 views of 40x24 px", "3x3"});
  // Scores of another part, or of other views, would stand beside these.
  for (const char* area :
       {R"("views": [3, 3], "size": [20, 24])", R"("views": [5, 5], "size": [40, 24])"}) {
    ExpectRefused(
        {estimate, "--comparison",
         folder_.Put("c.json", fmt::format("{{{}, \"mean\": {{\"psnr_db\": 30}}}}", area))},
        {"c.json: it compares", "3x3 views of 40x24 px"});
  }
}

TEST_F(ReportProgram, SaysOfWhichAreaTheScoresAre) {
  const std::string estimate = Write(SeenByCamera(3, 3), "est");
  const ProgramResult result =
      Run({estimate, "--comparison",
           folder_.Put("c.json", R"({"views": [3, 3], "size": [40, 24], "border_px": 5,)"
                                 R"( "mean": {"psnr_db": 30}})")});
  ASSERT_EQ(result.exit_code, 0) << result.err;
  EXPECT_THAT(ContentOf(page_), HasSubstr("without a border of 5 px"));
}

TEST_F(ReportProgram, RefusalsStandInTheJson) {
  ExpectRefused({Write(Relative(3, 3), "est"), "--estimate", folder_.Put("e.json", "{]"), "--json",
                 folder_ / "r.json"},
                {"e.json"});
  const nlohmann::json json = nlohmann::json::parse(ContentOf(folder_ / "r.json"));
  EXPECT_EQ(json["status"], "refused");
  EXPECT_THAT(json["reason"].get<std::string>(), HasSubstr("e.json: not a JSON file"));
}

TEST_F(ReportProgram, CommandLinesThatCannotBeMeant) {
  const std::string relative = Write(Relative(3, 3), "est");
  const std::string depth = PutDepth(1);
  ExpectRefused({relative, "--depth", depth}, {"--depth-kind is missing"}, 2);
  ExpectRefused({relative, "--depth-kind", "disparity"}, {"require --depth"}, 2);
  ExpectRefused({relative, "--depth", depth, "--depth-kind", "z", "--depth-unit", "mm"},
                {"has no camera"}, 2);
  ExpectRefused({relative, "--crop", "1,2,3"}, {"--crop"}, 2);
  ExpectRefused({relative, "--views", "3"}, {"--views"}, 2);
  ExpectRefused({relative, "--photo", page_}, {"would be overwritten"}, 2);
  EXPECT_EQ(ChildProgram({"report", relative}, folder_.path(), 0).Wait().exit_code, 2);
}

}  // namespace
}  // namespace thicklens::tools
