#include "tools/report/calibration_json.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <string>

#include "support/special_numbers.h"
#include "tools/support/fake_calibration.h"

namespace thicklens::tools {
namespace {

using nlohmann::json;

using thicklens::testing::kNan;

TEST(CalibrationJson, HasTheKeysOfTheFormat) {
  MadeUpCalibration made = MakeUpCalibration(41, 320, 4);
  RejectFrame(3, "dark", &made.calibration);
  const json out = CalibrationJson(made.sweep, made.calibration, &made.truth, false);
  EXPECT_EQ(out.at("status"), "ok");
  EXPECT_EQ(out.at("reason"), "");
  EXPECT_EQ(out.at("method"), "fit");
  for (const char* key :
       {"image_distance_mm", "focus_depth_mm", "blur_ratio", "blur_floor_px", "bench_offset_mm"}) {
    EXPECT_TRUE(out.at(key).at("value").is_number()) << key;
    EXPECT_TRUE(out.at(key).at("sigma").is_number()) << key;
    EXPECT_TRUE(out.at(key).contains("systematic")) << key;
  }
  EXPECT_EQ(out["focus_depth_mm"]["systematic"], json::array({400 - 3.1, 400 + 3.9}));
  EXPECT_TRUE(out["blur_floor_px"]["systematic"].is_null());
  EXPECT_EQ(out.at("frames_used"), 40);
  EXPECT_EQ(out.at("frames_rejected"),
            json::array({{{"image", "/sweeps/bench/frame_003.png"}, {"reason", "dark"}}}));
  EXPECT_EQ(out.at("chi2_per_dof"), 1.04);
  EXPECT_EQ(out.at("other_methods").at("source").at("focus_depth_mm").at("value"), 393.5);
  EXPECT_TRUE(out["other_methods"]["source"]["focus_depth_mm"]["sigma"].is_null());
  EXPECT_EQ(out["other_methods"].at("sharpness_peak").at("focus_depth_mm").at("sigma"), 1.3);
  EXPECT_EQ(out.at("seconds"), 2.7);
  EXPECT_EQ(out.at("warnings"), json::array());
  EXPECT_EQ(out.at("covariance").at("order").size(), 4u);
  EXPECT_NEAR(out["covariance"].at("rows")[0][3].get<double>(), -0.71 * 0.0012 * 0.11, 1e-12);
  EXPECT_EQ(out.at("scale_model").at("frames_used"), 41);
  EXPECT_EQ(out.at("frames").size(), 41u);
  EXPECT_TRUE(out["frames"][3]["blur_sigma_px"].is_null());
  EXPECT_EQ(out["frames"][3]["rejection"], "dark");
  EXPECT_TRUE(out["frames"][4]["blur_sigma_px"].is_number());
  const json& errors = out.at("truth").at("errors");
  EXPECT_NEAR(errors.at("fit").at("focus_depth_mm").get<double>(), -0.28, 1e-9);
  EXPECT_NEAR(errors.at("source").at("focus_depth_mm").get<double>(), -6.5, 1e-9);
  EXPECT_NEAR(errors.at("sharpness_peak").at("focus_depth_mm").get<double>(), 0.9, 1e-9);
}

TEST(CalibrationJson, RefusalIsWrittenToo) {
  MadeUpCalibration made = MakeUpCalibration(31, 700, 10);
  RefuseAll("sharpness is monotone", &made.calibration);
  const json out = CalibrationJson(made.sweep, made.calibration, nullptr, false);
  EXPECT_EQ(out.at("status"), "refused");
  EXPECT_EQ(out.at("reason"), "sharpness is monotone");
  for (const char* key : {"image_distance_mm", "focus_depth_mm", "blur_ratio", "blur_floor_px",
                          "bench_offset_mm", "chi2_per_dof", "covariance"})
    EXPECT_TRUE(out.at(key).is_null()) << key;
  EXPECT_FALSE(out.at("other_methods").at("source").at("done").get<bool>());
  EXPECT_FALSE(out.contains("truth"));
}

void ExpectNoZeros(const json& value, const std::string& at) {
  if (value.is_number()) {
    EXPECT_NE(value.get<double>(), 0) << at;
  }
  if (value.is_structured())
    for (const auto& [key, item] : value.items()) ExpectNoZeros(item, at + "/" + key);
}

// A run that ended before a frame was opened has measured nothing.
TEST(CalibrationJson, WhatWasNotMeasuredIsNull) {
  MadeUpCalibration made = MakeUpCalibration(4, 390, 5);
  RefuseAll("a sweep needs at least 5 frames, this one has 4", &made.calibration);
  for (calib::FrameMeasurement& frame : made.calibration.frames) {
    calib::FrameMeasurement bare;
    bare.image = frame.image;
    bare.reading_mm = frame.reading_mm;
    frame = bare;
  }
  json out = CalibrationJson(made.sweep, made.calibration, nullptr, false);
  out.erase("seconds");
  ExpectNoZeros(out, "");
  EXPECT_TRUE(out.at("frames")[0].at("statistics").is_null());
  // For a frame that was rejected as black, the measured value is 0.
  made.calibration.frames[0].rejection = "dark: mean 0.000";
  out = CalibrationJson(made.sweep, made.calibration, nullptr, false);
  EXPECT_EQ(out.at("frames")[0].at("statistics").at("mean_encoded"), 0.0);
}

TEST(CalibrationJson, HoldsWhatTheReportShows) {
  const MadeUpCalibration made = MakeUpCalibration(41, 320, 4);
  const json out = CalibrationJson(made.sweep, made.calibration, &made.truth, false);
  EXPECT_EQ(out.at("advice"), made.calibration.diagnostics.advice);
  EXPECT_EQ(out.at("assumed_fields"), json::array({"lens.lens_thickness_mm"}));
  EXPECT_EQ(out.at("sides").at("nearer").at("focus_depth_mm").at("value"), 398.6);
  EXPECT_NEAR(out["sides"].at("apart_mm").at("value").get<double>(), 2.5, 1e-9);
  EXPECT_NEAR(out["sides"]["apart_mm"].at("sigma").get<double>(), 0.9 * std::sqrt(2), 1e-9);
  const json& field = out.at("field");
  EXPECT_EQ(field.at("tiles").size(), 20u);
  EXPECT_EQ(field["tiles"][7].at("centre_px"), json::array({64 + 128.0 * 2, 60 + 120.0}));
  EXPECT_TRUE(field["tiles"][19].at("focus_depth_mm").is_null());
  EXPECT_EQ(field["tiles"][19].at("message"), "no texture above noise");
  EXPECT_EQ(field.at("tilt_right_deg").at("value"), 1.21);
  EXPECT_EQ(field.at("clusters")[0].at("tiles"), 19);
  EXPECT_EQ(out.at("channels")[2].at("name"), "blue");
  EXPECT_EQ(out.at("magnification").at("period_mm"), 5);
  EXPECT_EQ(out.at("systematic_parts")[0].at("focus_depth_mm"), json::array({-2.9, 3.6}));
  EXPECT_EQ(out["systematic_parts"][1].at("remedy"), "have the lens measured");
  EXPECT_EQ(out.at("blur_fit").at("better_psf"), "gaussian");
  EXPECT_EQ(out["blur_fit"].at("disc_misfit_chi2_per_dof"), 2.31);
  EXPECT_EQ(out.at("scale_model").at("kind"), "inverse-depth");
  EXPECT_EQ(out["scale_model"].at("distortion_at_corner").at("value"), 0.0042);
  EXPECT_EQ(out.at("other_methods").at("source").at("sharpest_normalised_image"),
            "/sweeps/bench/frame_020.png");
  EXPECT_EQ(out["other_methods"].at("sharpness_peak").at("log_parabola").at("coefficients").size(),
            3u);
  const json& example = out.at("examples")[0];
  EXPECT_EQ(example.at("image"), "/sweeps/bench/frame_000.png");
  EXPECT_EQ(example.at("kind"), "transfer");
  EXPECT_EQ(example.at("frequency_cycles_per_px").size(), example.at("disc").size());
  const json& frame = out.at("frames")[6];
  EXPECT_EQ(frame.at("image_scale_sigma"), 1e-4);
  EXPECT_EQ(frame.at("reading_error_sigma_mm"), 0.03);
  // Residuals of a law that the frames follow: measured minus law over both errors.
  const double z = made.calibration.frames[6].depth_mm;
  const double d = made.calibration.summary.image_distance_mm->value - 3,
               zf = 12.5 * d / (d - 12.8);
  const double a =
      made.calibration.summary.blur_ratio->value * 4.46 * 12.5 * zf / (zf - 12.5) / 0.006;
  const double defocus = a * (1 / z - 1 / zf), law = std::hypot(0.508, defocus);
  EXPECT_NEAR(frame.at("blur_model_sigma_px").get<double>(), law, 1e-9);
  const double slope = defocus * a / (z * z) / law;
  EXPECT_NEAR(frame.at("blur_residual_sigmas").get<double>(),
              (made.calibration.frames[6].blur_sigma_px - law) /
                  std::hypot(made.calibration.frames[6].blur_sigma_error_px, slope * 0.07),
              1e-9);
}

TEST(CalibrationJson, SourcesRecipeInPlaceOfTheFit) {
  const MadeUpCalibration made = MakeUpCalibration(41, 320, 4);
  const json out = CalibrationJson(made.sweep, made.calibration, nullptr, true);
  EXPECT_EQ(out.at("method"), "source");
  EXPECT_EQ(out.at("focus_depth_mm").at("value"), 393.5);
  EXPECT_TRUE(out.at("blur_floor_px").is_null());
  EXPECT_EQ(out.at("frames_used"), 40);  // those of the mean of ratios
  EXPECT_TRUE(out.at("chi2_per_dof").is_null());
  const json& fit = out["other_methods"]["fit"];
  for (const char* key : {"undetermined", "covariance", "blur_fit", "sides", "field", "channels",
                          "systematic_parts", "advice", "examples"}) {
    EXPECT_FALSE(out.contains(key)) << key;
    EXPECT_TRUE(fit.contains(key)) << key;
  }
  EXPECT_EQ(fit.at("status"), "ok");
  EXPECT_EQ(fit.at("chi2_per_dof"), 1.04);
  EXPECT_NEAR(out.at("other_methods").at("fit").at("focus_depth_mm").at("value").get<double>(),
              399.72, 1e-9);
}

// JSON has no NaN, and a dump throws on broken UTF-8: neither may reach it from any field.
TEST(CalibrationJson, SurvivesNanAndBrokenFileNames) {
  MadeUpCalibration made = MakeUpCalibration(7, 340, 20);
  calib::Calibration& c = made.calibration;
  c.summary.image_distance_mm->value = kNan;
  c.summary.focus_depth_mm->sigma = kNan;
  c.summary.blur_ratio->systematic = Eigen::Vector2d(kNan, 1);
  c.diagnostics.covariance(1, 1) = std::numeric_limits<double>::infinity();
  c.diagnostics.blur.chi2_per_dof = kNan;
  c.summary.seconds = kNan;
  c.diagnostics.scale.reading_rms_mm = kNan;
  c.frames[0].image = "caf\xE9.png";
  c.frames[0].blur_sigma_px = kNan;
  c.frames[1].image_scale = kNan;
  c.frames[1].statistics.contrast = kNan;
  c.frames[2].rejection = "bad \xFF";
  c.summary.warnings = {"\x80"};
  c.diagnostics.covariance_order[0] = c.diagnostics.blur.weak_direction = c.diagnostics.advice =
      c.diagnostics.nearer.message = "\xFE";
  c.diagnostics.field.tiles[1].message = c.diagnostics.channels[1].name =
      c.diagnostics.systematic_parts[1].remedy = "\xFE";
  c.diagnostics.blur.undetermined = {"\xFE"};
  c.diagnostics.field.tiles[0].focus_depth_mm = {kNan, kNan};
  c.diagnostics.systematic_parts[0].blur_ratio = {kNan, 1};
  c.examples[0].measured[0] = kNan;
  c.frames[3].reading_error_mm = kNan;
  c.frames[3].image_scale_sigma = kNan;
  c.diagnostics.magnification->period_px = kNan;
  c.diagnostics.sharpness.log_parabola[1] = kNan;
  const json out = CalibrationJson(made.sweep, c, &made.truth, false);
  const json back = json::parse(out.dump());
  EXPECT_EQ(back, out) << "a NaN compares unequal to itself or came back as null";
  EXPECT_TRUE(out["image_distance_mm"]["value"].is_null());
  EXPECT_TRUE(out["focus_depth_mm"]["sigma"].is_null());
  EXPECT_TRUE(out["blur_ratio"]["systematic"].is_null());
  EXPECT_TRUE(out["frames"][0]["blur_sigma_px"].is_null());
  EXPECT_EQ(out["frames"][0]["image"], "caf\uFFFD.png");
  EXPECT_TRUE(out["truth"]["errors"]["fit"]["image_distance_mm"].is_null());
}

}  // namespace
}  // namespace thicklens::tools
