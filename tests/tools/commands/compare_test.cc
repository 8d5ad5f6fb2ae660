// thicklens compare: its table and JSON, and the command as a person meets it.
#include "thicklens/estimator/compare.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <limits>
#include <nlohmann/json.hpp>
#include <random>
#include <string>
#include <vector>

#include "support/special_numbers.h"
#include "support/temporary_folder.h"
#include "support/test_cameras.h"
#include "thicklens/base/output_file.h"
#include "thicklens/io/depth_io.h"
#include "thicklens/io/image_io.h"
#include "thicklens/io/light_field_io.h"
#include "thicklens/model/camera.h"
#include "thicklens/model/encoded_values.h"
#include "thicklens/model/light_field_grid.h"
#include "tools/report/compare_table.h"
#include "tools/support/child_process.h"

namespace thicklens::tools {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;
using thicklens::testing::ContentOf;
using thicklens::testing::TemporaryFolder;
using Arguments = std::vector<std::string>;
using Json = nlohmann::json;

using thicklens::testing::kInfinity;
using thicklens::testing::TestCamera;
using thicklens::testing::TestSensor;
using thicklens::testing::WideLens;
using thicklens::testing::WithMethod;
constexpr int kWide = 44, kHigh = 36, kDisparityPx = 1, kGrid = 7;

// ---- Table and JSON.

ImageScores Scores(double psnr_db, double ssim) {
  ImageScores scores;
  scores.psnr_db = psnr_db;
  scores.ssim = ssim;
  scores.delta_e94_mean = 1.25;
  scores.macade_standin = 0.875;
  return scores;
}

LightFieldScores TwoViews(bool with_dibr) {
  LightFieldScores scores;
  for (int k = 0; k < 2; ++k) {
    ViewScores view;
    view.k = k;
    view.scores = Scores(k == 0 ? 30 : kInfinity, 0.9);
    if (with_dibr) view.dibr = Scores(31, 0.8);
    scores.views.push_back(view);
  }
  scores.u_count = 2;
  scores.v_count = 1;
  scores.width_px = 4;
  scores.height_px = 3;
  scores.mean = Scores(30, 0.9);
  scores.centre = scores.corner = scores.mean;
  if (with_dibr) scores.dibr_mean = scores.dibr_centre = scores.dibr_corner = Scores(31, 0.8);
  return scores;
}

TEST(CompareTable, SaysWhatHasNoNumber) {
  ImageScores scores = Scores(kInfinity, std::nan(""));
  scores.macade_standin.reset();
  const std::string text = ImageScoresText(scores, 3);
  EXPECT_THAT(text, AllOf(HasSubstr("identical"), HasSubstr("border 3 px"), HasSubstr("1.250"),
                          Not(HasSubstr("inf")), Not(HasSubstr("nan"))));
  const Json json = ImageScoresJson(scores);
  EXPECT_TRUE(json["psnr_db"].is_null() && json["ssim"].is_null());
  EXPECT_TRUE(json["macade_standin"].is_null());
  EXPECT_EQ(json["identical"], true);
  EXPECT_EQ(json["delta_e94_mean"], 1.25);
  EXPECT_EQ(ImageScoresJson(Scores(30, 0.9))["identical"], false);
}

TEST(CompareTable, PutsDibrBesideEachMean) {
  const std::string text = LightFieldScoresText(TwoViews(true), 1, false);
  EXPECT_THAT(text, AllOf(HasSubstr("2 views of 2x1, 4x3 px each, border 1 px"),
                          HasSubstr("\nmean"), HasSubstr("\ncentre"), HasSubstr("\ncorner"),
                          HasSubstr("views above DIBR (PSNR): 1 of 2"),
                          HasSubstr("1 of 2 views are identical and left out")));
  const std::string plain = LightFieldScoresText(TwoViews(false), 1, false);
  EXPECT_THAT(plain, AllOf(Not(HasSubstr("DIBR")), Not(HasSubstr("(1, 0)"))));
  const std::string all = LightFieldScoresText(TwoViews(false), 1, true);
  EXPECT_THAT(all, AllOf(HasSubstr("(0, 0)"), HasSubstr("(1, 0)")));
}

TEST(CompareTable, WritesNullsWithoutDibr) {
  const Json with = LightFieldScoresJson(TwoViews(true), 1);
  EXPECT_EQ(with["dibr"]["mean"]["psnr_db"], 31);
  EXPECT_EQ(with["dibr"]["centre"]["ssim"], 0.8);
  EXPECT_EQ(with["dibr"]["corner"]["psnr_db"], 31);
  EXPECT_EQ(with["views_above_dibr"], 1);
  EXPECT_EQ(with["per_view"][0]["dibr_psnr_db"], 31);
  EXPECT_EQ(with["identical_views"], 1);
  EXPECT_TRUE(with["per_view"][1]["psnr_db"].is_null());
  const Json without = LightFieldScoresJson(TwoViews(false), 1);
  EXPECT_TRUE(without["dibr"].is_null() && without["views_above_dibr"].is_null());
  EXPECT_TRUE(without["per_view"][0]["dibr_psnr_db"].is_null());
}

// ---- The program.

// A smooth texture at any place, in [0, 255].
double Texture(double x, double y, int channel) {
  return 128 + 60 * std::sin(0.55 * x + 0.3 * channel) * std::cos(0.4 * y) +
         40 * std::sin(0.23 * x - 0.31 * y + channel);
}

// The view at (a, b) of the texture: the point at x in the middle is at x - a d in it.
model::EncodedImage View(int a, int b, int channels = 3) {
  model::EncodedImage image{kWide, kHigh, channels, 8, {}};
  for (int y = 0; y < kHigh; ++y) {
    for (int x = 0; x < kWide; ++x) {
      for (int channel = 0; channel < channels; ++channel) {
        image.values.push_back(static_cast<std::uint16_t>(
            std::lround(Texture(x + a * kDisparityPx, y + b * kDisparityPx, channel))));
      }
    }
  }
  return image;
}

model::EncodedImage Noisy(model::EncodedImage image, int amplitude, unsigned seed) {
  std::mt19937 generator(seed);
  std::uniform_int_distribution<int> noise(-amplitude, amplitude);
  for (std::uint16_t& value : image.values)
    value = static_cast<std::uint16_t>(std::clamp(value + noise(generator), 0, 255));
  return image;
}

// The scores of two images from the library. The protocol between file and score is that of the
// command.
estimator::ImageScores Direct(const model::EncodedImage& reference,
                              const model::EncodedImage& other, int border_px) {
  return estimator::CompareImages(model::EncodedValuesOf(reference), model::EncodedValuesOf(other),
                                  border_px);
}

class CompareProgram : public ::testing::Test {
 protected:
  std::string PutImage(const std::string& name, const model::EncodedImage& image) const {
    return folder_.Put(name, io::EncodePng(image));
  }

  // n x n views in the HCI layout, in the middle of a numbering of 7 in a row.
  std::string PutHci(const std::string& name, int n, int noise) const {
    const int half = n / 2;
    for (int b = -half; b <= half; ++b) {
      for (int a = -half; a <= half; ++a) {
        char file[32];
        const int number = kGrid * (b + kGrid / 2) + a + kGrid / 2;
        std::snprintf(file, sizeof file, "/input_Cam%03d.png", number);
        PutImage(name + file, Noisy(View(a, b), noise, static_cast<unsigned>(number)));
      }
    }
    return folder_ / name;
  }

  // Writes the same views in the project's own layout.
  std::string PutOwn(const std::string& name, int n, int noise) const {
    io::LightFieldReading reading;
    reading.grid = kGrid;
    return Write(name, io::ReadLightField(PutHci(name + "_hci", n, noise), reading));
  }
  std::string Write(const std::string& name, const model::LightField& light_field) const {
    OutputFolder folder(folder_ / name, io::kLightFieldMarker, io::LightFieldEntries());
    io::WriteLightField(light_field, io::ViewFormat::kPng, &folder);
    folder.Commit();
    return folder_ / name;
  }

  std::string PutDepth(const std::string& name, float value, int width_px = kWide,
                       int height_px = kHigh) const {
    model::RawDepthMap map{width_px, height_px, {}, false};
    map.values.assign(static_cast<std::size_t>(width_px * height_px), value);
    return folder_.Put(name, io::EncodePfm(map));
  }

  ProgramResult Run(Arguments arguments) const {
    arguments.insert(arguments.begin(), "compare");
    return ChildProgram(arguments, scratch_.path(), 0).Wait();
  }
  Json Summary(Arguments arguments) const {
    arguments.insert(arguments.end(), {"--json", folder_ / "result.json"});
    const ProgramResult result = Run(arguments);
    EXPECT_EQ(result.exit_code, 0) << result.err;
    return result.exit_code == 0 ? Json::parse(ContentOf(folder_ / "result.json")) : Json();
  }
  // Returns the one line of a command that must fail.
  std::string Failure(const Arguments& arguments, int exit_code = 1) const {
    const ProgramResult result = Run(arguments);
    EXPECT_EQ(result.exit_code, exit_code) << result.err;
    EXPECT_EQ(std::count(result.err.begin(), result.err.end(), '\n'), 1) << result.err;
    EXPECT_THAT(result.out, IsEmpty());
    return result.err;
  }

  TemporaryFolder folder_;
  TemporaryFolder scratch_;
};

TEST_F(CompareProgram, ComparesTwoImages) {
  const model::EncodedImage truth = View(0, 0);
  const model::EncodedImage noisy = Noisy(truth, 9, 1);
  const std::string a = PutImage("a.png", truth);
  const std::string b = PutImage("b.png", noisy);
  const Json json = Summary({a, b, "--border", "4"});
  const estimator::ImageScores expected = Direct(truth, noisy, 4);
  EXPECT_EQ(json["status"], "ok");
  EXPECT_EQ(json["reason"], "");
  EXPECT_EQ(json["psnr_db"], expected.psnr_db);
  EXPECT_EQ(json["ssim"], expected.ssim);
  EXPECT_EQ(json["delta_e94_mean"], expected.delta_e94_mean);
  EXPECT_EQ(json["macade_standin"], expected.macade_standin.value_or(-1));
  EXPECT_EQ(json["border_px"], 4);
  const ProgramResult result = Run({a, b, "--border", "4"});
  EXPECT_THAT(result.out, AllOf(HasSubstr("PSNR dB"), HasSubstr("SSIM"), HasSubstr("M-dE94"),
                                HasSubstr("edge orientation")));
  EXPECT_THAT(Run({a, b, "--quiet"}).out, IsEmpty());
}

TEST_F(CompareProgram, SaysThatImagesAreIdentical) {
  const std::string a = PutImage("a.png", View(0, 0));
  const Json json = Summary({a, a});
  EXPECT_TRUE(json["psnr_db"].is_null());
  EXPECT_EQ(json["identical"], true);
  EXPECT_THAT(Run({a, a}).out, HasSubstr("identical"));
}

TEST_F(CompareProgram, TheFirstImageIsTheReference) {
  model::EncodedImage red = View(0, 0);
  for (std::size_t i = 0; i < red.values.size(); ++i) {
    if (i % 3 != 0) red.values[i] /= 4;
  }
  const std::string a = PutImage("a.png", View(0, 0));
  const std::string b = PutImage("b.png", red);
  const double one_way = Direct(View(0, 0), red, 0).delta_e94_mean;
  const double other_way = Direct(red, View(0, 0), 0).delta_e94_mean;
  ASSERT_GT(std::abs(one_way - other_way), 1);
  EXPECT_EQ(Summary({a, b})["delta_e94_mean"], one_way);
  EXPECT_EQ(Summary({b, a})["delta_e94_mean"], other_way);
}

TEST_F(CompareProgram, CropsImagesAlike) {
  const model::PixelRect rect{5, 3, 30, 25};
  const model::EncodedImage truth = View(0, 0);
  const model::EncodedImage noisy = Noisy(truth, 9, 2);
  const std::string a = PutImage("a.png", truth);
  const double expected =
      Direct(model::CropImage(truth, rect), model::CropImage(noisy, rect), 1).psnr_db;
  const std::string crop = "5,3,30,25";
  const Json both = Summary({a, PutImage("b.png", noisy), "--crop", crop, "--border", "1"});
  EXPECT_EQ(both["psnr_db"], expected);
  EXPECT_EQ(both["size"], Json({30, 25}));
  // An image that already has the size of the rectangle is used as it is.
  const std::string cut = PutImage("cut.png", model::CropImage(noisy, rect));
  EXPECT_EQ(Summary({a, cut, "--crop", crop, "--border", "1"})["psnr_db"], expected);
  EXPECT_THAT(Failure({a, a, "--crop", "20,3,30,25"}),
              AllOf(HasSubstr("a.png"), HasSubstr("44x36")));
}

TEST_F(CompareProgram, FollowsTheProtocolOfALightField) {
  const std::string truth = PutHci("truth", 3, 0);
  const std::string estimate = PutOwn("estimate", 3, 6);
  const std::string photo = PutImage("photo.png", Noisy(View(0, 0), 3, 99));
  const std::string depth = PutDepth("disparity.pfm", kDisparityPx);
  const Json json =
      Summary({truth, estimate, "--grid", "7", "--border", "6", "--dibr", photo, depth});
  EXPECT_EQ(json["status"], "ok");
  EXPECT_EQ(json["border_px"], 6);
  EXPECT_EQ(json["views"], Json({3, 3}));
  EXPECT_EQ(json["size"], Json({kWide, kHigh}));
  ASSERT_EQ(json["per_view"].size(), 9U);
  double sum = 0, corner_sum = 0;
  for (const Json& view : json["per_view"]) {
    const int a = view["u"].get<int>() - 1;
    const int b = view["v"].get<int>() - 1;
    const auto seed = static_cast<unsigned>(kGrid * (b + 3) + a + 3);
    const estimator::ImageScores expected = Direct(View(a, b), Noisy(View(a, b), 6, seed), 6);
    EXPECT_NEAR(view["psnr_db"].get<double>(), expected.psnr_db, 1e-3);  // 16-bit files between
    EXPECT_NEAR(view["ssim"].get<double>(), expected.ssim, 1e-4);
    sum += expected.psnr_db;
    if (a != 0 && b != 0) corner_sum += expected.psnr_db;
    // The photograph's noise, shifted by whole pixels with the image.
    EXPECT_NEAR(view["dibr_psnr_db"].get<double>(),
                Direct(View(0, 0), Noisy(View(0, 0), 3, 99), 6).psnr_db, 0.6);
  }
  EXPECT_NEAR(json["mean"]["psnr_db"].get<double>(), sum / 9, 1e-3);
  EXPECT_NEAR(json["corner"]["psnr_db"].get<double>(), corner_sum / 4, 1e-3);
  EXPECT_EQ(json["centre"]["psnr_db"], json["per_view"][4]["psnr_db"]);
  for (const char* place : {"mean", "centre", "corner"}) {
    for (const char* key : {"psnr_db", "ssim", "delta_e94_mean", "macade_standin"}) {
      EXPECT_TRUE(json[place][key].is_number()) << place << " " << key;
      EXPECT_TRUE(json["dibr"][place][key].is_number()) << place << " " << key;
    }
  }
  EXPECT_EQ(json["views_above_dibr"], 0);  // twice the noise
}

TEST_F(CompareProgram, CountsTheViewsAboveDibr) {
  const std::string truth = PutHci("truth", 3, 0);
  const std::string estimate = PutHci("estimate", 3, 1);
  const std::string photo = PutImage("photo.png", Noisy(View(0, 0), 9, 99));
  const Arguments arguments = {
      truth, estimate, "--grid", "7", "--dibr", photo, PutDepth("disparity.pfm", kDisparityPx)};
  EXPECT_EQ(Summary(arguments)["views_above_dibr"], 9);
  const ProgramResult result = Run(arguments);
  EXPECT_THAT(result.out, AllOf(HasSubstr("  DIBR"), HasSubstr("above DIBR (PSNR): 9 of 9")));
  Arguments verbose = arguments;
  verbose.emplace_back("--verbose");
  EXPECT_THAT(Run(verbose).out, HasSubstr("(2, 2)"));
  EXPECT_THAT(result.out, Not(HasSubstr("(2, 2)")));
}

TEST_F(CompareProgram, SaysWhatTheDisparityMeansByItsOptions) {
  const std::string truth = PutHci("truth", 3, 0);
  const std::string photo = PutImage("photo.png", View(0, 0));
  const std::string halves = PutDepth("halves.pfm", 2 * kDisparityPx + 6.0F);
  const Json json = Summary({truth, truth, "--grid", "7", "--border", "4", "--dibr", photo, halves,
                             "--depth-kind", "disparity", "--disparity-scale", "0.5",
                             "--disparity-offset", "-3"});
  EXPECT_GT(json["dibr"]["corner"]["psnr_db"].is_null()
                ? kInfinity
                : json["dibr"]["corner"]["psnr_db"].get<double>(),
            60);
  EXPECT_EQ(json["identical_views"], 9);
  EXPECT_THAT(Failure({truth, truth, "--grid", "7", "--dibr", photo, halves, "--depth-kind", "z",
                       "--depth-unit", "mm"},
                      2),
              HasSubstr("disparity"));
}

// If a camera is given, the disparity is converted to millimetres and back to the steps of the
// grid.
TEST_F(CompareProgram, AsksWhatTheDepthMapOfACameraSays) {
  const model::Camera camera = WithMethod(
      TestCamera("small", WideLens(), TestSensor(kWide, kHigh, 0.006, {21.5, 17.5}), {16.3, 0}));
  io::LightFieldReading reading;
  reading.grid = kGrid;
  model::LightField light_field = io::ReadLightField(PutHci("views", 3, 0), reading);
  light_field.camera = camera;
  light_field.grid = model::DefaultGrid(camera, 3, 3);
  const std::string truth = Write("truth", light_field);
  const std::string photo = PutImage("photo.png", View(0, 0));
  const Arguments arguments = {
      truth, truth, "--border", "4", "--dibr", photo, PutDepth("disparity.pfm", kDisparityPx)};
  EXPECT_THAT(Failure(arguments, 2), HasSubstr("--depth-kind"));
  Arguments with_kind = arguments;
  with_kind.insert(with_kind.end(), {"--depth-kind", "disparity"});
  const Json json = Summary(with_kind);
  EXPECT_GT(json["dibr"]["corner"]["psnr_db"].get<double>(), 50);
  EXPECT_LT(Summary({truth, truth, "--border", "4", "--dibr", photo, PutDepth("no.pfm", 0),
                     "--depth-kind", "disparity"})["dibr"]["corner"]["psnr_db"]
                .get<double>(),
            30);
}

TEST_F(CompareProgram, TakesInnerViewsAndTellsSo) {
  const std::string truth = PutHci("truth", 5, 0);
  const std::string estimate = PutHci("estimate", 3, 4);
  const ProgramResult result = Run({truth, estimate, "--grid", "7"});
  EXPECT_EQ(result.exit_code, 0);
  EXPECT_THAT(result.err, AllOf(HasSubstr("inner 3x3"), HasSubstr("5x5"), HasSubstr("truth")));
  const Json inner = Summary({truth, estimate, "--grid", "7"});
  EXPECT_EQ(inner["views"], Json({3, 3}));
  const estimator::ImageScores centre = Direct(View(0, 0), Noisy(View(0, 0), 4, 24), 0);
  EXPECT_NEAR(inner["centre"]["psnr_db"].get<double>(), centre.psnr_db, 1e-3);
  // The other way round, and asked for.
  EXPECT_EQ(Summary({estimate, truth, "--grid", "7"})["views"], Json({3, 3}));
  const Arguments asked = {truth, estimate, "--grid", "7", "--views", "3x3"};
  EXPECT_THAT(Run(asked).err, IsEmpty());
  EXPECT_EQ(Summary(asked)["per_view"], inner["per_view"]);
  // The middle of an even count is none of an odd one.
  io::LightFieldReading reading;
  reading.grid = kGrid;
  const model::LightField all = io::ReadLightField(estimate, reading);
  model::LightField even = model::MakeLightField(kWide, kHigh, 2, 2, 3);
  for (int i = 0; i < 4; ++i)
    model::SetView(&even, i % 2, i / 2, model::ViewImage(all, i % 2, i / 2));
  EXPECT_THAT(Failure({truth, Write("even", even), "--grid", "7"}),
              AllOf(HasSubstr("truth"), HasSubstr("odd")));
}

TEST_F(CompareProgram, CropsLightFieldsPhotographAndDepthAlike) {
  const std::string truth = PutHci("truth", 3, 0);
  const std::string estimate = PutHci("estimate", 3, 4);
  const std::string photo = PutImage("photo.png", Noisy(View(0, 0), 3, 5));
  const std::string depth = PutDepth("disparity.pfm", kDisparityPx);
  const auto summary = [&](const std::string& other, const std::string& image,
                           const std::string& map) {
    return Summary({truth, other, "--grid", "7", "--crop", "6,5,30,28", "--border", "2", "--dibr",
                    image, map});
  };
  const Json all = summary(estimate, photo, depth);
  EXPECT_EQ(all["size"], Json({30, 28}));
  const model::PixelRect rect{6, 5, 30, 28};
  EXPECT_NEAR(all["centre"]["psnr_db"].get<double>(),
              Direct(model::CropImage(View(0, 0), rect),
                     model::CropImage(Noisy(View(0, 0), 4, 24), rect), 2)
                  .psnr_db,
              1e-3);
  EXPECT_NEAR(
      all["dibr"]["centre"]["psnr_db"].get<double>(),
      Direct(model::CropImage(View(0, 0), rect), model::CropImage(Noisy(View(0, 0), 3, 5), rect), 2)
          .psnr_db,
      1e-3);
  // Cropped before, by whoever made them.
  io::LightFieldReading reading;
  reading.grid = kGrid;
  reading.crop = rect;
  const std::string cut = Write("cut", io::ReadLightField(estimate, reading));
  const std::string cut_photo =
      PutImage("cut.png", model::CropImage(Noisy(View(0, 0), 3, 5), rect));
  const Json before = summary(cut, cut_photo, PutDepth("cut.pfm", kDisparityPx, 30, 28));
  EXPECT_EQ(before["dibr"], all["dibr"]);
  EXPECT_NEAR(before["mean"]["psnr_db"].get<double>(), all["mean"]["psnr_db"].get<double>(), 1e-3);
}

TEST_F(CompareProgram, MissingViewsAreAcceptedOnRequest) {
  const std::string truth = PutHci("truth", 3, 0);
  const std::string estimate = PutHci("estimate", 3, 4);
  std::remove((estimate + "/input_Cam017.png").c_str());
  EXPECT_THAT(Failure({truth, estimate, "--grid", "7"}),
              AllOf(HasSubstr("input_Cam017.png"), HasSubstr("the option --sparse")));
  const Json json = Summary({truth, estimate, "--grid", "7", "--sparse"});
  EXPECT_EQ(json["per_view"].size(), 8U);
}

TEST_F(CompareProgram, GivesTheSameOnAnyNumberOfThreads) {
  const std::string truth = PutHci("truth", 3, 0);
  const std::string estimate = PutHci("estimate", 3, 4);
  EXPECT_EQ(Summary({truth, estimate, "--grid", "7", "--threads", "1"}),
            Summary({truth, estimate, "--grid", "7", "--threads", "3"}));
}

TEST_F(CompareProgram, MismatchesAreReportedInOneLine) {
  const std::string image = PutImage("a.png", View(0, 0));
  const std::string grey = PutImage("grey.png", View(0, 0, 1));
  const std::string small =
      PutImage("small.png", model::CropImage(View(0, 0), model::PixelRect{0, 0, 20, 20}));
  const std::string folder = PutHci("truth", 3, 0);
  const std::string depth = PutDepth("disparity.pfm", kDisparityPx);
  const std::string missing = folder_ / "missing.png";
  EXPECT_THAT(Failure({image, missing}), AllOf(HasSubstr("missing.png"), HasSubstr("no such")));
  EXPECT_THAT(Failure({missing, folder}), AllOf(HasSubstr("missing.png"), HasSubstr("no such")));
  const std::string noise = PutImage("noise.png", Noisy(View(0, 0), 255, 3));
  EXPECT_THAT(Failure({noise, folder}), AllOf(HasSubstr("noise.png"), HasSubstr("truth")));
  EXPECT_THAT(Failure({folder, noise}), AllOf(HasSubstr("noise.png"), HasSubstr("truth")));
  EXPECT_THAT(Failure({image, small}), AllOf(HasSubstr("44x36"), HasSubstr("20x20")));
  EXPECT_THAT(Failure({image, grey}), HasSubstr("channel"));
  EXPECT_THAT(Failure({image, image, "--border", "18"}), HasSubstr("0 to 17"));
  EXPECT_THAT(Failure({image, folder_.Put("text.png", "no image")}), HasSubstr("text.png"));
  EXPECT_THAT(Failure({image, folder_.Put("half.png", ContentOf(image).substr(0, 900))}),
              HasSubstr("half.png"));
  const auto with_dibr = [&](const std::string& photo, const std::string& map) {
    return Failure({folder, folder, "--grid", "7", "--dibr", photo, map});
  };
  EXPECT_THAT(with_dibr(missing, depth), HasSubstr("missing.png"));
  EXPECT_THAT(with_dibr(image, missing), HasSubstr("missing.png"));
  EXPECT_THAT(with_dibr(small, depth), AllOf(HasSubstr("small.png"), HasSubstr("44x36")));
  EXPECT_THAT(with_dibr(grey, depth), HasSubstr("grey.png"));
  EXPECT_THAT(with_dibr(image, PutDepth("small.pfm", 1, 20, 20)),
              AllOf(HasSubstr("small.pfm"), HasSubstr("20x20")));
}

// Identical views have no PSNR.
void ExpectTheSameViews(const Json& json) {
  ASSERT_EQ(json["per_view"].size(), 9U);
  for (const Json& view : json["per_view"])
    EXPECT_TRUE(view["psnr_db"].is_null() || view["psnr_db"].get<double>() > 80) << view;
}

// A mosaic that has the name of a quilt as well.
TEST_F(CompareProgram, AFileOfViewsIsComparedWithAFolder) {
  model::EncodedImage tiles{3 * kWide, 3 * kHigh, 3, 8, {}};
  for (int y = 0; y < tiles.height_px; ++y) {
    for (int x = 0; x < tiles.width_px; ++x) {
      for (int channel = 0; channel < 3; ++channel) {
        const int a = x / kWide - 1, b = y / kHigh - 1;
        tiles.values.push_back(static_cast<std::uint16_t>(std::lround(
            Texture(x % kWide + a * kDisparityPx, y % kHigh + b * kDisparityPx, channel))));
      }
    }
  }
  const std::string folder = PutHci("truth", 3, 0);
  const std::string file = PutImage("tiles_qs3x3.png", tiles);
  for (const Arguments& inputs : {Arguments{folder, file}, Arguments{file, folder}}) {
    const Json json = Summary({inputs[0], inputs[1], "--grid", "7", "--layout", "tiles:3x3"});
    EXPECT_EQ(json["views"], Json({3, 3}));
    ExpectTheSameViews(json);
  }
  ExpectTheSameViews(Summary({folder, file, "--grid", "7", "--other-layout", "tiles:3x3"}));
  EXPECT_THAT(Failure({folder, file, "--grid", "7", "--view-order", "swap"}, 2),
              HasSubstr("--other-view-order"));
  // Two such files are images, and a notice says that they may be more.
  const ProgramResult result = Run({file, file});
  EXPECT_EQ(result.exit_code, 0);
  EXPECT_THAT(result.err, HasSubstr("--layout quilt"));
  EXPECT_THAT(result.out, HasSubstr("identical"));
}

// Before, the messages named the options that are for both inputs.
TEST_F(CompareProgram, MessagesAboutTheOtherNameItsOptions) {
  const std::string folder = PutHci("truth", 3, 0);
  const std::string image = PutImage("a.png", View(0, 0));
  EXPECT_THAT(Run({folder, folder, "--grid", "7", "--other-view-order", "mirror-u"}).err,
              HasSubstr("the option --other-view-order"));
  EXPECT_THAT(Failure({folder, folder, "--grid", "7", "--other-name", "a_{v}_{u}.png"}),
              Not(HasSubstr("--name is for both")));
  EXPECT_THAT(Failure({folder, folder, "--name", "a_{v}_{u}.png"}), HasSubstr("--other-name"));
  EXPECT_THAT(Failure({image, image, "--other-grid", "3"}, 2),
              AllOf(HasSubstr("--other-grid: only for light fields"),
                    HasSubstr("states that it is a light field"), Not(HasSubstr("--views"))));
  EXPECT_THAT(Failure({image, image, "--other-layout", "foo"}, 2), HasSubstr("--other-layout: "));
}

// The first bytes say that it is a file of Matlab: nobody compares two images.
TEST_F(CompareProgram, ATruncatedFileOfViewsIsNoImage) {
  std::string content = "MATLAB 5.0 MAT-file";
  content.resize(124, ' ');
  content += {'\0', '\1', 'I', 'M', '\16', '\0', '\0', '\0', '\0', '\1', '\0', '\0'};
  const std::string file = folder_.Put("cut.mat", content);
  EXPECT_THAT(Failure({PutHci("truth", 3, 0), file, "--grid", "7"}),
              AllOf(HasSubstr("cut.mat"), Not(HasSubstr("two images"))));
}

TEST_F(CompareProgram, RefusesWrongUsage) {
  const std::string image = PutImage("a.png", View(0, 0));
  const std::string folder = PutHci("truth", 3, 0);
  const std::string before = ContentOf(image);
  Failure({image}, 2);
  Failure({image, image, "--border", "-1"}, 2);
  Failure({image, image, "--crop", "1,2,3"}, 2);
  Failure({folder, folder, "--grid", "7", "--views", "3"}, 2);
  Failure({folder, folder, "--grid", "7", "--dibr", image}, 2);
  EXPECT_THAT(Failure({folder, folder, "--grid", "7", "--depth-kind", "disparity"}, 2),
              HasSubstr("--dibr"));
  EXPECT_THAT(Failure({image, image, "--dibr", image, image}, 2), HasSubstr("for light fields"));
  EXPECT_THAT(Failure({image, image, "--views", "3x3"}, 2), HasSubstr("for light fields"));
  EXPECT_THAT(Failure({image, image, "--json", image}, 2), HasSubstr("overwritten"));
  EXPECT_THAT(Failure({folder, folder, "--grid", "7", "--dibr", image, image, "--json", image}, 2),
              HasSubstr("overwritten"));
  EXPECT_EQ(ContentOf(image), before);
}

TEST_F(CompareProgram, WritesARefusalAsJson) {
  const std::string image = PutImage("a.png", View(0, 0));
  const std::string json = folder_ / "result.json";
  Failure({image, image, "--border", "90", "--json", json});
  const Json summary = Json::parse(ContentOf(json));
  EXPECT_EQ(summary["status"], "refused");
  EXPECT_THAT(summary["reason"].get<std::string>(), HasSubstr("border of 90 px"));
}

}  // namespace
}  // namespace thicklens::tools
