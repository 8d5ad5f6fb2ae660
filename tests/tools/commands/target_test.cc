#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <nlohmann/json.hpp>
#include <opencv2/core.hpp>
#include <set>
#include <string>
#include <thread>
#include <vector>

#include "support/special_numbers.h"
#include "support/temporary_folder.h"
#include "thicklens/base/error.h"
#include "thicklens/io/image_io.h"
#include "thicklens/model/target_grid.h"
#include "thicklens/model/target_page.h"
#include "thicklens/model/target_texture.h"
#include "tools/io/png_check.h"
#include "tools/report/target_drawing.h"
#include "tools/support/child_process.h"
#include "tools/support/xml_elements.h"

namespace thicklens::tools {
namespace {

using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using thicklens::testing::ContentOf;
using thicklens::testing::TemporaryFolder;

constexpr double kMmPerInch = 25.4;
using thicklens::testing::kPi;
constexpr model::SheetSize kSheet = {210, 297, true};

// Half an A4 sheet: quick, and with all that a whole one has.
model::TargetRequest SmallRequest() {
  model::TargetRequest request;
  request.sheet = {148, 120, false};
  request.feature_mm = 0.5;
  request.has_marks = false;
  return request;
}

std::uint32_t BigEndian(const std::string& bytes, std::size_t at) {
  std::uint32_t value = 0;
  for (std::size_t i = 0; i < 4; ++i) value = value << 8 | static_cast<std::uint8_t>(bytes[at + i]);
  return value;
}

// Pixels per metre that a PNG file states, across and down, and the unit; -1 where it has none.
std::vector<std::int64_t> StatedResolution(const std::string& png) {
  const std::size_t at = png.find("pHYs");
  if (at == std::string::npos || at > png.find("IDAT")) return {-1, -1, -1};
  return {BigEndian(png, at + 4), BigEndian(png, at + 8), png[at + 12]};
}

// A target as a printer at `dpi` would get it.
struct Drawn {
  model::TargetPage page;
  std::vector<model::TargetLeaf> leaves;
  cv::Mat image;  // CV_8U
  double px_per_mm = 0;

  int Px(double mm) const { return static_cast<int>(std::lround(mm * px_per_mm)); }
  cv::Mat Part(const model::SheetRectangle& area) const {
    return image(cv::Rect(Px(area.x), Px(area.y), Px(area.width), Px(area.height)));
  }
};

Drawn Draw(const model::TargetRequest& request, double dpi) {
  Drawn drawn;
  drawn.page = model::LayOutTarget(request);
  if (!drawn.page.grid) drawn.leaves = model::DeadLeaves(drawn.page);
  const std::string png = TargetPng(drawn.page, drawn.leaves, TargetPngSize(drawn.page, dpi));
  drawn.image = io::DecodeImage(png, "target.png");
  drawn.px_per_mm = static_cast<double>(StatedResolution(png)[0]) / 1000;
  return drawn;
}

// Position of the edge in every row of the middle part of the patch, px from the left side of the
// patch on the page: the dark length.
struct EdgeLine {
  double angle_deg = 0;   // from the vertical, upper end to the right
  double centre_mm = 0;   // from the patch's left side, halfway up
  double largest_px = 0;  // distance of a row from the line
};
EdgeLine FitEdge(const Drawn& drawn) {
  const model::SheetRectangle& patch = drawn.page.patch;
  const double centre_y_px = (patch.y + patch.height / 2) * drawn.px_per_mm - 0.5;
  const int left_px = drawn.Px(patch.x) + 3;
  const int right_px = drawn.Px(patch.x + patch.width) - 3;
  std::vector<cv::Point2d> points;
  for (int row = drawn.Px(patch.y) + 3; row < drawn.Px(patch.y + patch.height) - 3; ++row) {
    double dark_px = 0;
    for (int column = left_px; column < right_px; ++column)
      dark_px += 1 - drawn.image.at<std::uint8_t>(row, column) / 255.0;
    points.emplace_back(row - centre_y_px, dark_px + left_px - patch.x * drawn.px_per_mm);
  }
  double y = 0, x = 0, yy = 0, xy = 0;
  const auto n = static_cast<double>(points.size());
  for (const cv::Point2d& p : points) {
    y += p.x / n;
    x += p.y / n;
  }
  for (const cv::Point2d& p : points) {
    yy += (p.x - y) * (p.x - y);
    xy += (p.x - y) * (p.y - x);
  }
  EdgeLine line;
  line.angle_deg = -std::atan(xy / yy) * 180 / kPi;
  line.centre_mm = (x - xy / yy * y) / drawn.px_per_mm;
  for (const cv::Point2d& p : points)
    line.largest_px = std::max(line.largest_px, std::abs(p.y - x - xy / yy * (p.x - y)));
  return line;
}

// A slow reference: at each point the last leaf that holds it. Points on a leaf's border are left
// out.
TEST(TargetPng, ShowsAtEachPointTheForemostLeaf) {
  const Drawn drawn = Draw(SmallRequest(), 300);
  const model::SheetRectangle& pattern = drawn.page.pattern;
  int compared = 0, background = 0, wrong = 0;
  for (int row = drawn.Px(pattern.y) + 2; row < drawn.Px(pattern.y + 25); row += 9) {
    for (int column = drawn.Px(pattern.x) + 2; column < drawn.Px(pattern.x + 100); column += 11) {
      const double x_mm = (column + 0.5) / drawn.px_per_mm;
      const double y_mm = (row + 0.5) / drawn.px_per_mm;
      int grey = model::GreyBehindLeaves(drawn.page);
      bool plain = true, covered = false;
      for (const model::TargetLeaf& leaf : drawn.leaves) {
        const double beyond_px =
            (std::hypot(leaf.x_mm - x_mm, leaf.y_mm - y_mm) - leaf.radius_mm) * drawn.px_per_mm;
        if (std::abs(beyond_px) < 1) plain = false;
        if (beyond_px > -1) continue;
        grey = leaf.grey;
        plain = covered = true;  // the leaves behind do not matter
      }
      if (!plain) continue;
      ++compared;
      if (!covered) ++background;
      if (std::abs(drawn.image.at<std::uint8_t>(row, column) - grey) > 1) ++wrong;
    }
  }
  EXPECT_GT(compared, 1500);
  EXPECT_EQ(wrong, 0);
  EXPECT_LE(background, compared / 100);
}

TEST(TargetPng, HasTrueScaleAndSaysSo) {
  const model::TargetPage page = model::LayOutTarget(SmallRequest());
  const std::string png = TargetPng(page, model::DeadLeaves(page), TargetPngSize(page, 300));
  io::RequireWholePng(png, "target.png");
  EXPECT_THAT(StatedResolution(png), ElementsAre(11811, 11811, 1));  // 300/0.0254
  const cv::Mat image = io::DecodeImage(png, "target.png");
  EXPECT_EQ(image.cols, std::lround(148 / kMmPerInch * 300));
  EXPECT_EQ(image.rows, std::lround(120 / kMmPerInch * 300));
  // The bar, the only dark thing in its rows.
  const cv::Mat row =
      image.row(static_cast<int>((page.bar.y + page.bar.height / 2) / kMmPerInch * 300));
  double dark_px = 0;
  for (int x = 0; x < row.cols; ++x) dark_px += 1 - row.at<std::uint8_t>(0, x) / 255.0;
  EXPECT_NEAR(dark_px * kMmPerInch / 300, page.bar.width, 0.01);
}

TEST(TargetPng, StatesWholePixelsPerMetreAndDrawsByThem) {
  model::TargetRequest request = SmallRequest();
  const model::TargetPage page = model::LayOutTarget(request);
  const PngSize size = TargetPngSize(page, 254.003);
  EXPECT_EQ(size.pixels_per_metre, 10000);
  EXPECT_EQ(size.width_px, 1480);
  EXPECT_EQ(size.height_px, 1200);
}

TEST(TargetPng, RefusesTooManyPixelsAndTooFew) {
  const model::TargetPage page = model::LayOutTarget(SmallRequest());
  EXPECT_THROW(TargetPngSize(page, 4000), Error);
  EXPECT_THROW(TargetPngSize(page, 72), Error);  // features of 0.5 mm: 1.4 px
}

TEST(TargetPng, TheEdgeHasItsStatedAngle) {
  for (const double angle_deg : {5.0, 2.0, 20.0}) {
    model::TargetRequest request = SmallRequest();
    request.edge_angle_deg = angle_deg;
    const Drawn drawn = Draw(request, 300);
    const EdgeLine line = FitEdge(drawn);
    EXPECT_NEAR(line.angle_deg, angle_deg, 0.02);
    EXPECT_NEAR(line.centre_mm, drawn.page.patch.width / 2, 0.005);
    EXPECT_LT(line.largest_px, 0.1);
  }
}

TEST(TargetPng, HasPlainPlateausDarkOnTheLeftAndBrightOnTheRight) {
  const Drawn drawn = Draw(SmallRequest(), 300);
  model::SheetRectangle left = drawn.page.patch;
  left.x += 0.2;
  left.y += 0.2;
  left.height -= 0.4;
  left.width = drawn.page.EdgeX(left.y + left.height) - left.x - 0.2;
  EXPECT_EQ(cv::countNonZero(drawn.Part(left)), 0);
  model::SheetRectangle right = left;
  right.x = drawn.page.EdgeX(left.y) + 0.2;
  right.width = drawn.page.patch.x + drawn.page.patch.width - right.x - 0.2;
  EXPECT_EQ(cv::countNonZero(drawn.Part(right) != 255), 0);
  EXPECT_GT(left.width, 0.4 * drawn.page.patch.width);
  EXPECT_GT(right.width, 0.4 * drawn.page.patch.width);
}

// Each line of the caption has its position on the page: ink above its baseline, none below the
// last.
TEST(TargetPng, ShowsTheCaption) {
  const Drawn drawn = Draw(SmallRequest(), 300);
  const model::TargetPage& page = drawn.page;
  double baseline_mm = page.first_baseline_y_mm;
  for (std::size_t i = 0; i < page.caption.size(); ++i) {
    const double reckoned_mm =
        0.4 * page.text_size_mm * static_cast<double>(page.caption[i].size());
    const cv::Mat dark = drawn.Part({page.bar.x, baseline_mm - 0.7 * page.text_size_mm, reckoned_mm,
                                     0.7 * page.text_size_mm}) < 128;
    EXPECT_GT(cv::countNonZero(dark), 0.05 * static_cast<double>(dark.total()));
    baseline_mm += model::kLineHeight * page.text_size_mm;
  }
  const cv::Mat below =
      drawn.Part({0, baseline_mm, page.width_mm, page.height_mm - baseline_mm - 1});
  EXPECT_EQ(cv::countNonZero(below != 255), 0);
  const cv::Mat beside =
      drawn.Part({page.width_mm - page.bar.x + 0.2, 0, page.bar.x - 1, page.height_mm - 1});
  EXPECT_EQ(cv::countNonZero(beside != 255), 0);
}

// Each module of each mark has its colour, and the paper around them is white.
TEST(TargetPng, ShowsTheMarks) {
  model::TargetRequest request = SmallRequest();
  request.has_marks = true;
  const Drawn drawn = Draw(request, 300);
  ASSERT_EQ(drawn.page.marks.size(), 4U);
  for (const model::PlacedMark& mark : drawn.page.marks) {
    const auto modules = model::MarkerModules(model::kSheetDictionary, mark.number);
    const double side_mm = mark.area.width / static_cast<double>(modules.size());
    const auto grey = [&](double row, double column) {
      return drawn.image.at<std::uint8_t>(drawn.Px(mark.area.y + (row + 0.5) * side_mm),
                                          drawn.Px(mark.area.x + (column + 0.5) * side_mm));
    };
    for (std::size_t i = 0; i < modules.size(); ++i) {
      for (std::size_t j = 0; j < modules.size(); ++j)
        EXPECT_EQ(grey(static_cast<double>(i), static_cast<double>(j)), modules[i][j] ? 0 : 255);
      EXPECT_EQ(grey(static_cast<double>(i), -1), 255);
      EXPECT_EQ(grey(-1, static_cast<double>(i)), 255);
    }
  }
}

// The squares of a board lie where its points say, at the true scale.
TEST(TargetPng, ShowsTheGrid) {
  for (const char* pattern : {"chequerboard:9x6:8", "charuco:9x6:8", "circles:9x6:8"}) {
    model::TargetRequest request = SmallRequest();
    request.grid = model::ParseTargetGrid(pattern);
    const Drawn drawn = Draw(request, 300);
    const model::SheetRectangle& area = drawn.page.pattern;
    for (const Eigen::Vector2d& at : model::GridPoints(*request.grid)) {
      const auto grey = [&](double x_mm, double y_mm) {
        return drawn.image.at<std::uint8_t>(drawn.Px(area.y + at.y() + y_mm),
                                            drawn.Px(area.x + at.x() + x_mm));
      };
      if (request.grid->pattern == model::GridPattern::kCircles) {
        EXPECT_EQ(grey(2.2, 0), 0);
        EXPECT_EQ(grey(2.6, 0), 255);
        continue;
      }
      EXPECT_EQ(grey(0.4, 0.4), grey(-0.4, -0.4));
      EXPECT_EQ(grey(0.4, -0.4), grey(-0.4, 0.4));
      EXPECT_EQ(std::abs(grey(0.4, 0.4) - grey(0.4, -0.4)), 255);
    }
    EXPECT_EQ(drawn.image.at<std::uint8_t>(drawn.Px(area.y - 1), drawn.Px(area.x - 1)), 255);
  }
}

TEST(TargetPng, TwoTonesAreTwo) {
  model::TargetRequest request = SmallRequest();
  request.two_tone = true;
  const Drawn drawn = Draw(request, 300);
  EXPECT_EQ(cv::countNonZero(drawn.image == 0) + cv::countNonZero(drawn.image == 255),
            static_cast<int>(drawn.image.total()));
  EXPECT_NEAR(cv::mean(drawn.Part(drawn.page.pattern))[0], 127.5, 20);
  EXPECT_NEAR(FitEdge(drawn).angle_deg, 5, 0.1);
}

// Autocorrelation of a plane of numbers by the Fourier transform, padded so that nothing wraps
// around. Each lag is normalised by its overlap; lag 0, at (0, 0), is 1.
cv::Mat Autocorrelation(const cv::Mat& image) {
  cv::Mat grey;
  image.convertTo(grey, CV_64F);
  grey -= cv::mean(grey)[0];
  const auto correlate = [&](const cv::Mat& values) {
    cv::Mat padded, spectrum, power, correlation;
    cv::copyMakeBorder(values, padded, 0, cv::getOptimalDFTSize(2 * values.rows) - values.rows, 0,
                       cv::getOptimalDFTSize(2 * values.cols) - values.cols, cv::BORDER_CONSTANT,
                       0);
    cv::dft(padded, spectrum, cv::DFT_COMPLEX_OUTPUT);
    cv::mulSpectrums(spectrum, spectrum, power, 0, true);
    cv::dft(power, correlation, cv::DFT_INVERSE | cv::DFT_REAL_OUTPUT | cv::DFT_SCALE);
    return correlation;
  };
  cv::Mat overlap = correlate(cv::Mat::ones(grey.size(), CV_64F));
  cv::Mat correlation = correlate(grey);
  correlation /= cv::max(overlap, 0.25 * static_cast<double>(grey.total()));
  return correlation / correlation.at<double>(0, 0);
}

// The highest correlation at lags from `from_px` to a third of the image, and the highest one
// that exceeds all others within `reach_px`.
struct Peaks {
  double highest = 0;
  double second_peak = 0;
};
Peaks PeaksBeyond(const cv::Mat& correlation, int from_px, int reach_px) {
  Peaks peaks;
  const int rows = correlation.rows / 2, columns = correlation.cols / 2;
  const auto at = [&](int y, int x) {
    return correlation.at<double>((y + correlation.rows) % correlation.rows,
                                  (x + correlation.cols) % correlation.cols);
  };
  for (int y = 0; y <= rows / 3; ++y) {
    for (int x = -columns / 3; x <= columns / 3; ++x) {
      if (x * x + y * y < from_px * from_px) continue;
      peaks.highest = std::max(peaks.highest, at(y, x));
      bool is_peak = true;
      for (int dy = -reach_px; dy <= reach_px && is_peak; dy += reach_px) {
        for (int dx = -reach_px; dx <= reach_px; dx += reach_px)
          is_peak = is_peak && at(y, x) >= at(y + dy, x + dx);
      }
      if (is_peak) peaks.second_peak = std::max(peaks.second_peak, at(y, x));
    }
  }
  return peaks;
}

TEST(TargetPng, RepeatsNothing) {
  model::TargetRequest request;
  request.sheet = kSheet;
  const Drawn drawn = Draw(request, 127);            // 5 px a mm
  model::SheetRectangle above = drawn.page.pattern;  // of the patch
  above.height = drawn.page.patch.y - above.y - 1;
  const Peaks found = PeaksBeyond(Autocorrelation(drawn.Part(above)), 10, 5);
  EXPECT_LT(found.second_peak, 0.2) << found.highest;

  // The result if a quarter of the image occurred three times.
  cv::Mat repeated = drawn.Part(above).clone();
  const cv::Rect quarter(0, 0, repeated.cols / 4, repeated.rows);
  repeated(quarter).copyTo(repeated(quarter + cv::Point(quarter.width, 0)));
  repeated(quarter).copyTo(repeated(quarter + cv::Point(2 * quarter.width, 0)));
  EXPECT_GT(PeaksBeyond(Autocorrelation(repeated), 10, 5).second_peak, 0.2);
}

TEST(TargetSvg, HasTrueScaleAndTheCaption) {
  const model::TargetPage page = model::LayOutTarget(SmallRequest());
  const std::vector<model::TargetLeaf> leaves = model::DeadLeaves(page);
  const XmlDocument svg = ParseXml(TargetSvg(page, leaves));
  ASSERT_THAT(svg.error, IsEmpty());
  const XmlElement& root = svg.elements.front();
  EXPECT_EQ(root.Attribute("width"), "148mm");
  EXPECT_EQ(root.Attribute("height"), "120mm");
  EXPECT_EQ(root.Attribute("viewBox"), "0 0 148 120");
  std::vector<std::string> lines;
  for (const XmlElement& text : svg.Named("text")) lines.push_back(text.text);
  EXPECT_EQ(lines, page.caption);

  for (const XmlElement& rectangle : svg.Named("rect")) {
    if (rectangle.Attribute("id") == "bar") {
      EXPECT_NEAR(rectangle.Number("width"), page.bar.width, 1e-4);
    }
  }
  const auto circles = svg.Named("circle");
  ASSERT_EQ(circles.size(), leaves.size());
  EXPECT_NEAR(circles.back().Number("cx"), leaves.back().x_mm, 1e-4);
  EXPECT_NEAR(circles.back().Number("r"), leaves.back().radius_mm, 1e-4);
  double x0 = 0, y0 = 0, x1 = 0, y1 = 0, x2 = 0, y2 = 0;
  ASSERT_EQ(std::sscanf(svg.Named("path").at(0).Attribute("d").c_str(), "M%lf %lfL%lf %lfL%lf %lfL",
                        &x0, &y0, &x1, &y1, &x2, &y2),
            6);
  EXPECT_NEAR(std::atan((x1 - x2) / (y2 - y1)) * 180 / kPi, 5, 1e-3);
}

TEST(TargetPdf, HasTrueScaleTheCaptionAndNoDate) {
  const model::TargetPage page = model::LayOutTarget(SmallRequest());
  const std::string pdf = TargetPdf(page, model::DeadLeaves(page));
  EXPECT_EQ(pdf.substr(0, 5), "%PDF-");
  const std::size_t at = pdf.find("/MediaBox [");
  ASSERT_NE(at, std::string::npos);
  double left = -1, bottom = -1, width = 0, height = 0;
  ASSERT_EQ(
      std::sscanf(pdf.c_str() + at, "/MediaBox [ %lf %lf %lf %lf", &left, &bottom, &width, &height),
      4);
  EXPECT_EQ(left, 0);
  EXPECT_EQ(bottom, 0);
  EXPECT_NEAR(width, 148 * 72 / kMmPerInch, 1e-3);
  EXPECT_NEAR(height, 120 * 72 / kMmPerInch, 1e-3);
  EXPECT_THAT(pdf, HasSubstr(page.caption[0]));
  EXPECT_THAT(pdf, HasSubstr("/ToUnicode"));  // there are letters, which can be searched
  EXPECT_THAT(pdf, ::testing::Not(HasSubstr("Date")));
  EXPECT_EQ(TargetPdf(page, model::DeadLeaves(page)), pdf);
}

// The program as a user runs it.
class TargetProgram : public ::testing::Test {
 protected:
  ProgramResult Run(std::vector<std::string> arguments) const {
    arguments.insert(arguments.begin(), "target");
    return ChildProgram(arguments, scratch_.path(), 0).Wait();
  }
  void ExpectFailure(const std::vector<std::string>& arguments, int exit_code,
                     const std::string& message) const {
    const ProgramResult result = Run(arguments);
    EXPECT_EQ(result.exit_code, exit_code) << result.err;
    EXPECT_THAT(result.err, HasSubstr(message));
    EXPECT_EQ(std::count(result.err.begin(), result.err.end(), '\n'), 1) << result.err;
    EXPECT_THAT(folder_.Entries(), IsEmpty());
  }

  TemporaryFolder folder_;
  TemporaryFolder scratch_;
};

TEST_F(TargetProgram, WritesTheSameBytesEveryTimeAndOthersForAnotherSeed) {
  for (const std::string ending : {"pdf", "svg", "png"}) {
    const auto make = [&](const std::string& name, const std::string& seed) {
      const ProgramResult result = Run({"-o", folder_ / name, "--paper", "100x80", "--seed", seed,
                                        "--feature-mm", "1", "--dpi", "150"});
      EXPECT_EQ(result.exit_code, 0) << result.err;
      return ContentOf(folder_ / name);
    };
    const std::string first = make("first." + ending, "1");
    EXPECT_GT(first.size(), 1000U);
    EXPECT_EQ(make("second." + ending, "1"), first);
    EXPECT_NE(make("third." + ending, "2"), first);
  }
}

TEST_F(TargetProgram, SaysWhatItChoseAndWritesItAsJson) {
  const std::string camera = std::string(THICKLENS_SOURCE_DIR) + "/configs/cameras/case-iii.yaml";
  const ProgramResult result = Run({"-o", folder_ / "target.svg", "--camera", camera,
                                    "--distance-mm", "400", "--json", folder_ / "target.json"});
  EXPECT_EQ(result.exit_code, 0) << result.err;
  EXPECT_THAT(result.out, AllOf(HasSubstr("where 2 to 6 px are best"), HasSubstr("print at 100 %"),
                                HasSubstr("the bar must then measure 100.0 mm")));
  const auto json = nlohmann::json::parse(ContentOf(folder_ / "target.json"));
  EXPECT_EQ(json["status"], "ok");
  EXPECT_EQ(json["sheet_width_mm"], 210);
  EXPECT_EQ(json["bar"]["width_mm"], 100);
  EXPECT_NEAR(json["smallest_feature_px"], 3, 0.15);
  EXPECT_NEAR(json["pattern"]["width_mm"], 1.15 * json["camera_view"]["width_mm"].get<double>(),
              0.1);
  EXPECT_THAT(Run({"-o", folder_ / "target.svg", "--feature-mm", "2", "--quiet"}).out, IsEmpty());
}

TEST_F(TargetProgram, RefusesNonsense) {
  const std::string pdf = folder_ / "target.pdf";
  ExpectFailure({"-o", folder_ / "target.gif"}, 2, ".pdf, .svg or .png is expected");
  ExpectFailure({"-o", folder_ / "target"}, 2, ".pdf, .svg or .png is expected");
  for (const std::string size : {"10x10", "100", "100x", "ax100", "100x100x100", "-100x100",
                                 "nanx100", "1e9x100", "a5", ""}) {
    ExpectFailure({"-o", pdf, "--paper=" + size}, 2, "--paper");
  }
  ExpectFailure({"-o", pdf, "--feature-mm", "nan"}, 2, "--feature-mm");
  ExpectFailure({"-o", pdf, "--feature-mm", "0"}, 2, "--feature-mm");
  ExpectFailure({"-o", pdf, "--square-mm", "12"}, 2,
                "--square-mm is for --pattern chequerboard, charuco or circles");
  ExpectFailure({"-o", pdf, "--feature-mm", "0.01"}, 1, "below the 0.1 mm");
  ExpectFailure({"-o", pdf, "--edge-angle-deg", "0"}, 2, "from 2 to 20");
  ExpectFailure({"-o", pdf, "--edge-angle-deg", "45"}, 2, "from 2 to 20");
  ExpectFailure({"-o", pdf, "--dpi", "1"}, 2, "--dpi");
  ExpectFailure({"-o", pdf, "--seed", "-1"}, 2, "--seed");
  ExpectFailure({"-o", pdf, "--distance-mm", "500"}, 2, "--camera");
  ExpectFailure({"-o", pdf, "--camera", "camera.yaml"}, 2, "--distance-mm");
  ExpectFailure({"-o", pdf, "--camera", folder_ / "none.yaml", "--distance-mm", "500"}, 1,
                "none.yaml");
  const std::string camera = std::string(THICKLENS_SOURCE_DIR) + "/configs/cameras/case-iii.yaml";
  const ProgramResult near = Run({"-o", pdf, "--camera", camera, "--distance-mm", "8"});
  EXPECT_EQ(near.exit_code, 1);
  EXPECT_THAT(near.err, AllOf(HasSubstr("--distance-mm 8: it must be above the front focal length"),
                              HasSubstr("case-iii.yaml")));
  ExpectFailure({"-o", folder_ / "target.png", "--dpi", "4800"}, 1, "smaller --dpi");
  ExpectFailure({"-o", folder_ / "none/target.pdf"}, 1, "none does not exist");
}

TEST_F(TargetProgram, AnInterruptLeavesNothing) {
  ChildProgram child({"target", "-o", folder_ / "target.pdf", "--feature-mm", "0.12"},
                     scratch_.path(), 0);
  while (child.Running() && folder_.Entries().empty())
    std::this_thread::sleep_for(std::chrono::milliseconds(2));
  child.Interrupt();
  const ProgramResult result = child.Wait();
  EXPECT_EQ(result.exit_code, 1);
  EXPECT_THAT(result.err, HasSubstr("interrupted"));
  EXPECT_THAT(folder_.Entries(), IsEmpty());
}

}  // namespace
}  // namespace thicklens::tools
