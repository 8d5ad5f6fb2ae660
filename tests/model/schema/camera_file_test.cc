#include "thicklens/model/camera_file.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstring>
#include <filesystem>
#include <limits>
#include <optional>
#include <stdexcept>
#include <string>
#include <vector>

#include "support/error_message.h"
#include "thicklens/base/error.h"
#include "thicklens/model/sweep_simulator.h"

namespace thicklens::model {
namespace {

using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::EndsWith;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;
using ::testing::StartsWith;
using ::thicklens::testing::ErrorOf;

constexpr char kLens[] =
    "lens: {front_focal_length_mm: 12.5, rear_focal_length_mm: 12.8, lens_thickness_mm: 3.0, "
    "aperture_radius_mm: 4.46}\n";
constexpr char kSensor[] =
    "sensor: {width_px: 640, height_px: 480, pixel_pitch_mm: 0.006, "
    "principal_point_px: [319.5, 239.5], transfer: srgb}\n";

std::string Text(const std::string& rest, const std::string& lens = kLens,
                 const std::string& sensor = kSensor) {
  return "schema: thicklens/camera/2\nname: bench\n" + lens + sensor + rest;
}

std::string ErrorOfText(const std::string& text) {
  return ErrorOf([&] { ParseCamera(text, "c.yaml"); });
}

std::string Replaced(std::string text, const std::string& what, const std::string& by) {
  const std::size_t place = text.find(what);
  if (place == std::string::npos) throw std::logic_error("not in the text: " + what);
  return text.replace(place, what.size(), by);
}

std::string ErrorWith(const std::string& what, const std::string& by) {
  return ErrorOfText(Replaced(Text("psf: gaussian\n"), what, by));
}

bool SameBits(double a, double b) { return std::memcmp(&a, &b, sizeof a) == 0; }

TEST(CameraFile, ReadsWhatIsThere) {
  const Camera camera = ParseCamera(Text("psf: disc\n"), "c.yaml");
  EXPECT_EQ(camera.name, "bench");
  EXPECT_EQ(camera.lens.front_focal_length_mm, 12.5);
  EXPECT_EQ(camera.lens.rear_focal_length_mm, 12.8);
  EXPECT_EQ(camera.lens.lens_thickness_mm, 3.0);
  EXPECT_EQ(camera.lens.aperture_radius_mm, 4.46);
  EXPECT_EQ(camera.sensor.width_px, 640);
  EXPECT_EQ(camera.sensor.height_px, 480);
  EXPECT_EQ(camera.sensor.pixel_pitch_mm, 0.006);
  EXPECT_EQ(camera.sensor.principal_point_px, Eigen::Vector2d(319.5, 239.5));
  EXPECT_EQ(camera.sensor.transfer.Name(), "srgb");
  EXPECT_EQ(camera.psf, Psf::kDisc);
  EXPECT_FALSE(camera.calibration.has_value());
  EXPECT_THAT(camera.statements, IsEmpty());
  EXPECT_EQ(ParseCamera(Text(""), "c.yaml").psf, Psf::kGaussian);
}

constexpr char kDistortedLens[] =
    "lens: {front_focal_length_mm: 12.5, rear_focal_length_mm: 12.8, lens_thickness_mm: 3.0, "
    "aperture_radius_mm: 4.46,\n"
    "  distortion: {model: opencv, size_px: [1280, 960], focal_length_px: [4266.1, 4266.7],\n"
    "    principal_point_px: [640.3, 478.9], coefficients: [-0.21, 0.07, 0.0011, -7e-4, 0.013]}}\n";

TEST(CameraFile, LensDistortionIsReadAndWritten) {
  const Camera camera = ParseCamera(Text("", kDistortedLens), "c.yaml");
  ASSERT_TRUE(camera.distortion);
  EXPECT_EQ(camera.distortion->model, DistortionModel::kOpenCv);
  EXPECT_EQ(camera.distortion->width_px, 1280);
  EXPECT_EQ(camera.distortion->height_px, 960);
  EXPECT_EQ(camera.distortion->focal_length_px, Eigen::Vector2d(4266.1, 4266.7));
  EXPECT_EQ(camera.distortion->principal_point_px, Eigen::Vector2d(640.3, 478.9));
  EXPECT_THAT(camera.distortion->coefficients, ElementsAre(-0.21, 0.07, 0.0011, -7e-4, 0.013));
  const std::string yaml = CameraToYaml(camera);
  const Camera again = ParseCamera(yaml, "again.yaml");
  ASSERT_TRUE(again.distortion);
  EXPECT_EQ(again.distortion->coefficients, camera.distortion->coefficients);
  EXPECT_EQ(CameraToYaml(again), yaml);
  EXPECT_THAT(CameraToYaml(ParseCamera(Text(""), "c.yaml")), Not(HasSubstr("distortion")));
  const std::string fisheye =
      Replaced(Replaced(kDistortedLens, "opencv", "fisheye"), ", 0.013", "");
  EXPECT_EQ(ParseCamera(Text("", fisheye), "c.yaml").distortion->model, DistortionModel::kFisheye);
}

TEST(CameraFile, ErrorsOfTheLensDistortionNameItsFields) {
  const auto error = [](const std::string& what, const std::string& by) {
    return ErrorOfText(Text("", Replaced(kDistortedLens, what, by)));
  };
  EXPECT_THAT(error("-0.21, 0.07, 0.0011, ", ""),
              AllOf(StartsWith("c.yaml:4:"), HasSubstr("lens.distortion: coefficients"),
                    HasSubstr("4, 5, 8, 12, 14"), HasSubstr("found 2")));
  EXPECT_THAT(error("0.0011", ".nan"), HasSubstr("lens.distortion.coefficients[2]"));
  EXPECT_THAT(error("model: opencv", "model: brown"),
              AllOf(HasSubstr("lens.distortion.model"), HasSubstr("opencv, fisheye")));
  EXPECT_THAT(error("focal_length_px", "focal_lenght_px"),
              HasSubstr("did you mean 'focal_length_px'?"));
  EXPECT_THAT(error("[1280, 960]", "[1280]"), HasSubstr("lens.distortion.size_px"));
  EXPECT_THAT(error("[1280, 960]", "[1280, 720]"),
              AllOf(HasSubstr("lens.distortion"), HasSubstr("1280 x 720 px"),
                    HasSubstr("640 x 480 px"), HasSubstr("aspect ratio")));
  EXPECT_THAT(error("[4266.1, 4266.7]", "[0, 4266.7]"),
              HasSubstr("lens.distortion.focal_length_px[0]"));
}

TEST(CameraFile, EveryErrorNamesItsPlace) {
  EXPECT_EQ(ErrorWith("aperture_radius_mm", "aperture_raduis_mm"),
            "c.yaml:3:89: lens: unknown key 'aperture_raduis_mm'; did you mean "
            "'aperture_radius_mm'?");
  EXPECT_THAT(
      ErrorWith("pixel_pitch_mm", "pixel_pitch_um"),
      AllOf(StartsWith("c.yaml:4:"), HasSubstr("wrong unit: this field is 'pixel_pitch_mm'")));
  EXPECT_THAT(ErrorWith("0.006", "6 um"), AllOf(StartsWith("c.yaml:4:"), HasSubstr("'6 um'")));
  EXPECT_THAT(ErrorWith("12.5", "nan"), AllOf(StartsWith("c.yaml:3:"), HasSubstr("finite")));
  EXPECT_THAT(ErrorWith("4.46", "-4.46"),
              AllOf(StartsWith("c.yaml:3:"),
                    HasSubstr("lens.aperture_radius_mm: must be > 0, found -4.46")));
  EXPECT_THAT(ErrorWith("4.46", "0"), HasSubstr("must be > 0, found 0"));
  EXPECT_THAT(ErrorWith("12.8", "0"), HasSubstr("lens.rear_focal_length_mm: must be > 0"));
  EXPECT_THAT(ErrorWith("640", "640.5"), HasSubstr("sensor.width_px: a whole number"));
  EXPECT_THAT(ErrorWith("640", "0"), HasSubstr("sensor.width_px"));
  EXPECT_THAT(ErrorWith("[319.5, 239.5]", "[319.5]"),
              HasSubstr("sensor.principal_point_px: a list of 2 is expected, found 1"));
  EXPECT_THAT(ErrorWith("239.5", "mid"), HasSubstr("sensor.principal_point_px[1]"));
  EXPECT_THAT(ErrorWith("srgb", "bt709"),
              AllOf(StartsWith("c.yaml:4:"), HasSubstr("sensor.transfer"), HasSubstr("gamma-2.2")));
  EXPECT_THAT(ErrorWith("gaussian", "square"),
              AllOf(StartsWith("c.yaml:5:6: psf"), HasSubstr("disc")));
  EXPECT_THAT(ErrorWith("lens: {", "lens: ["), StartsWith("c.yaml:3:"));
  EXPECT_THAT(ErrorWith("psf: gaussian", "psf: gaussian\npsf: disc"),
              StartsWith("c.yaml:6:1: key 'psf' is given twice"));
  EXPECT_THAT(ErrorWith("name: bench\n", ""), HasSubstr("'name' is missing"));
  EXPECT_THAT(ErrorWith("schema: thicklens/camera/2\n", ""), HasSubstr("schema"));
  EXPECT_THAT(ErrorWith("camera/2", "camera/3"), HasSubstr("found 'thicklens/camera/3'"));
}

TEST(CameraFile, SensorInFrontOfEveryImageIsRefusedWithTheNumber) {
  const auto error = [](const std::string& d1) {
    return ErrorOfText(
        Text("calibration:\n  image_distance_mm: " + d1 + "\n  evidence: {method: assumed}\n"));
  };
  EXPECT_EQ(error("15.9"), "(no error)");
  // D = f2 is a focus at infinity.
  EXPECT_EQ(error("15.8"), "(no error)");
  EXPECT_THAT(error("15.7"), AllOf(StartsWith("c.yaml:6:22: calibration.image_distance_mm"),
                                   HasSubstr("15.7"), HasSubstr("= 15.8")));
  EXPECT_THAT(error("{value: 15.7, sigma: 0.1}"), HasSubstr("15.7"));
}

TEST(CameraFile, CalibrationIsChecked) {
  const auto error = [](const std::string& line) {
    return ErrorOfText(Text("calibration:\n  " + line + "\n  evidence: {method: assumed}\n"));
  };
  EXPECT_THAT(error("blur_ratio: -0.1"),
              StartsWith("c.yaml:6:15: calibration.blur_ratio: must be >= 0"));
  EXPECT_THAT(error("blur_floor_px: {value: -1}"),
              HasSubstr("calibration.blur_floor_px.value: must be >= 0"));
  EXPECT_THAT(error("blur_ratio: {value: 1, sigma: -1}"), HasSubstr("blur_ratio.sigma"));
  EXPECT_THAT(error("blur_ratio: {sigma: 1}"), HasSubstr("'value' is missing"));
  EXPECT_THAT(error("blur_ratio: [1, 2]"), HasSubstr("a number is expected, found a list"));
  EXPECT_THAT(error("covariance: {order: [blur_ratio], rows: [[1, 2]]}"), HasSubstr("a list of 1"));
  EXPECT_THAT(error("covariance: {order: [blur_ratio, blur_floor_px], rows: [[1, 2], [3, 1]]}"),
              HasSubstr("symmetric"));
  EXPECT_THAT(error("covariance: {order: [kappa], rows: [[1]]}"),
              AllOf(HasSubstr("covariance.order[0]"), HasSubstr("'kappa'")));
  EXPECT_THAT(error("covariance: {order: [blur_ratio, blur_ratio], rows: [[1, 0], [0, 1]]}"),
              HasSubstr("twice"));
  EXPECT_THAT(ErrorOfText(Text("calibration: {blur_ratio: 0.5}\n")),
              HasSubstr("'evidence' is missing"));
}

TEST(CameraFile, PositionsOfAMovingLensAreReadAndWritten) {
  const auto with = [](const std::string& positions) {
    return Text("calibration:\n  image_distance_mm: 17\n  focus_positions: " + positions +
                "\n  evidence: {method: assumed}\n");
  };
  const Camera camera =
      ParseCamera(with("{unit: dpt, positions: [[2, 16.5], [4.5, 17]]}"), "c.yaml");
  const FocusPositions& found = camera.calibration->focus_positions.value();
  EXPECT_EQ(found.unit, "dpt");
  ASSERT_EQ(found.positions.size(), 2U);
  EXPECT_EQ(found.positions[1].reading, 4.5);
  EXPECT_EQ(found.positions[1].image_distance_mm, 17);
  const Camera again = ParseCamera(CameraToYaml(camera), "again.yaml");
  EXPECT_EQ(again.calibration->focus_positions.value().positions[0].image_distance_mm, 16.5);
  EXPECT_EQ(again.calibration->focus_positions.value().unit, "dpt");
  EXPECT_THAT(ErrorOfText(with("{unit: mm, positions: [[2, 16.5], [2, 17]]}")),
              AllOf(StartsWith("c.yaml:7:20: calibration.focus_positions"),
                    HasSubstr("must rise, but 2 follows 2")));
  EXPECT_THAT(ErrorOfText(with("{unit: mm, positions: [[2, 16.5]]}")), HasSubstr("at least 2"));
  EXPECT_THAT(ErrorOfText(with("{unit: mm, positions: [[2, -1], [3, 4]]}")),
              HasSubstr("must be > 0, found -1"));
  EXPECT_THAT(ErrorOfText(with("{unit: inch, positions: [[2, 1], [3, 4]]}")), HasSubstr("dpt"));
}

TEST(CameraFile, StatementsAreKeptByPath) {
  const Camera camera =
      ParseCamera(Text("", Replaced(kLens, "12.8", "{value: 12.8, tolerance: 0.1, assumed: true}"),
                       Replaced(Replaced(kSensor, "319.5", "{value: 319.5, tolerance: 2}"), "640",
                                "{value: 640, assumed: false}")),
                  "c.yaml");
  EXPECT_EQ(camera.lens.rear_focal_length_mm, 12.8);
  EXPECT_EQ(camera.sensor.principal_point_px.x(), 319.5);
  // About the width nothing is stated.
  ASSERT_EQ(camera.statements.size(), 2U);
  EXPECT_EQ(camera.statements.at("lens.rear_focal_length_mm").tolerance, 0.1);
  EXPECT_TRUE(camera.statements.at("lens.rear_focal_length_mm").assumed);
  EXPECT_EQ(camera.statements.at("sensor.principal_point_px[0]").tolerance, 2);
  EXPECT_FALSE(camera.statements.at("sensor.principal_point_px[0]").assumed);
  EXPECT_THAT(AssumedFields(camera), ElementsAre("lens.rear_focal_length_mm"));

  EXPECT_THAT(ErrorWith("12.8", "{value: 12.8, tolerance: -1}"),
              HasSubstr("rear_focal_length_mm.tolerance"));
  EXPECT_THAT(ErrorWith("12.8", "{value: 12.8, sigma: 1}"), HasSubstr("unknown key 'sigma'"));
  EXPECT_THAT(ErrorWith("12.8", "{assumed: true}"), HasSubstr("'value' is missing"));
  EXPECT_THAT(ErrorWith("12.8", "{value: 12.8, assumed: perhaps}"), HasSubstr("'perhaps'"));
}

// ---- a lens that is stated by the data of an objective ----

constexpr char kObjective[] =
    "lens: {magnification: 10, numerical_aperture: 0.6, tube_lens_focal_length_mm: 200}\n";

TEST(CameraFile, AnObjectiveStatesTheLens) {
  const Camera camera = ParseCamera(Text("", kObjective), "c.yaml");
  ASSERT_TRUE(camera.objective);
  EXPECT_EQ(camera.objective->magnification, 10);
  EXPECT_EQ(camera.objective->numerical_aperture, 0.6);
  EXPECT_EQ(camera.objective->tube_lens_focal_length_mm, 200);
  EXPECT_DOUBLE_EQ(camera.lens.front_focal_length_mm, 20);
  EXPECT_DOUBLE_EQ(camera.lens.rear_focal_length_mm, 20);
  EXPECT_EQ(camera.lens.lens_thickness_mm, 0);
  // At the plane of focus, 22 mm, the cone has the sine 0.6 and the tangent 0.75.
  EXPECT_NEAR(camera.lens.aperture_radius_mm, 16.5, 1e-12);
  EXPECT_FALSE(ParseCamera(Text(""), "c.yaml").objective);

  const Camera stated =
      ParseCamera(Text("", Replaced(Replaced(kObjective, "10", "{value: 10, tolerance: 0.2}"),
                                    "200", "{value: 200, assumed: true}")),
                  "c.yaml");
  EXPECT_EQ(stated.objective.value().magnification, 10);
  ASSERT_EQ(stated.statements.size(), 2U);
  EXPECT_EQ(stated.statements.at("lens.magnification").tolerance, 0.2);
  EXPECT_THAT(AssumedFields(stated), ElementsAre("lens.tube_lens_focal_length_mm"));
}

TEST(CameraFile, AnObjectiveAndLengthsExcludeEachOther) {
  EXPECT_EQ(ErrorOfText(Text("", Replaced(kObjective, "}", ", aperture_radius_mm: 3}"))),
            "c.yaml:3:23: lens.magnification: 'magnification' is of an objective and "
            "'aperture_radius_mm' of a lens: state either magnification, numerical_aperture, "
            "tube_lens_focal_length_mm, or front_focal_length_mm, rear_focal_length_mm, "
            "lens_thickness_mm, aperture_radius_mm, not both");
  EXPECT_THAT(ErrorOfText(Text("", Replaced(kLens, "}", ", numerical_aperture: 0.1}"))),
              AllOf(StartsWith("c.yaml:3:"), HasSubstr("'numerical_aperture' is of an objective"),
                    HasSubstr("'front_focal_length_mm' of a lens")));
}

TEST(CameraFile, DataOfAnObjectiveAreChecked) {
  const auto error = [](const std::string& what, const std::string& by) {
    return ErrorOfText(Text("", Replaced(kObjective, what, by)));
  };
  EXPECT_EQ(error("0.6", "1.25"),
            "c.yaml:3:47: lens.numerical_aperture: must be < 1, found 1.25: immersion is not "
            "supported");
  EXPECT_THAT(error("0.6", "{value: 1, tolerance: 0.1}"),
              AllOf(StartsWith("c.yaml:3:55: lens.numerical_aperture.value: "),
                    HasSubstr("immersion is not supported")));
  EXPECT_THAT(error("0.6", "0"), HasSubstr("lens.numerical_aperture: must be > 0"));
  EXPECT_THAT(error("10", "-10"), HasSubstr("c.yaml:3:23: lens.magnification: must be > 0"));
  EXPECT_THAT(error("200", "0"), HasSubstr("lens.tube_lens_focal_length_mm: must be > 0"));
  EXPECT_THAT(error(", tube_lens_focal_length_mm: 200", ""),
              AllOf(StartsWith("c.yaml:3:"), HasSubstr("'tube_lens_focal_length_mm' is missing")));
  EXPECT_THAT(error("numerical_aperture", "numerical_apperture"),
              HasSubstr("did you mean 'numerical_aperture'?"));
}

TEST(CameraFile, ThePlaceOfTheApertureMayBeStatedWithBothForms) {
  EXPECT_FALSE(ParseCamera(Text(""), "c.yaml").aperture_behind_front_mm);
  for (const char* lens : {kLens, kObjective}) {
    Camera camera =
        ParseCamera(Text("", Replaced(lens, "}", ", aperture_behind_front_mm: 31.5}")), "c.yaml");
    EXPECT_EQ(camera.aperture_behind_front_mm.value(), 31.5);
    camera = ParseCamera(
        Text("", Replaced(lens, "}",
                          ", aperture_behind_front_mm: {value: -2, tolerance: 0.5, assumed: "
                          "true}}")),
        "c.yaml");
    EXPECT_EQ(camera.aperture_behind_front_mm.value(), -2);
    EXPECT_EQ(camera.statements.at("lens.aperture_behind_front_mm").tolerance, 0.5);
    const Camera back = ParseCamera(CameraToYaml(camera), "c.yaml");
    EXPECT_EQ(back.aperture_behind_front_mm.value(), -2);
    EXPECT_EQ(back.statements.at("lens.aperture_behind_front_mm").tolerance, 0.5);
    EXPECT_TRUE(back.statements.at("lens.aperture_behind_front_mm").assumed);
    EXPECT_EQ(back.objective.has_value(), lens == kObjective);
    EXPECT_THAT(
        ErrorOfText(Text("", Replaced(lens, "}", ", aperture_behind_front_mm: near}"))),
        AllOf(StartsWith("c.yaml:3:"), HasSubstr("lens.aperture_behind_front_mm: a number")));
  }
}

TEST(CameraToYaml, AnObjectiveComesBackAsOne) {
  for (const double magnification : {1.0 / 3, 1e29, 1.2345678901234567e-29, 10.0}) {
    Camera camera = ParseCamera(Text("", kObjective), "c.yaml");
    camera.objective->magnification = magnification;
    camera.objective->numerical_aperture = 1.0 / 7;
    camera.lens = LensOfObjective(*camera.objective);
    camera.statements["lens.magnification"] = {0.3, false};
    const std::string text = CameraToYaml(camera);
    EXPECT_THAT(text, Not(HasSubstr("focal_length_mm: 20\n")));
    const Camera back = ParseCamera(text, "c.yaml");
    ASSERT_TRUE(back.objective) << text;
    EXPECT_TRUE(SameBits(back.objective->magnification, magnification)) << magnification;
    EXPECT_TRUE(SameBits(back.objective->numerical_aperture, 1.0 / 7));
    EXPECT_TRUE(SameBits(back.lens.aperture_radius_mm, camera.lens.aperture_radius_mm));
    EXPECT_EQ(back.statements.at("lens.magnification").tolerance, 0.3);
    EXPECT_EQ(CameraToYaml(back), text);
  }
}

TEST(Camera, AnObjectiveAgreesWithTheLens) {
  const auto why = [](const auto& change) {
    Camera camera = ParseCamera(Text("", kObjective), "c.yaml");
    change(&camera);
    std::string reason;
    return camera.IsValid(&reason) ? "valid" : reason;
  };
  EXPECT_EQ(why([](Camera*) {}), "valid");
  for (double ThickLens::*length :
       {&ThickLens::front_focal_length_mm, &ThickLens::rear_focal_length_mm,
        &ThickLens::lens_thickness_mm, &ThickLens::aperture_radius_mm}) {
    EXPECT_THAT(why([&](Camera* c) { c->lens.*length += 1e-4; }),
                HasSubstr("it must be LensOfObjective of the objective"));
    EXPECT_EQ(why([&](Camera* c) {
                c->lens.*length += 1e-4;
                c->objective.reset();
              }),
              "valid");
  }
  EXPECT_THAT(why([](Camera* c) { c->objective->numerical_aperture = 1; }),
              HasSubstr("objective: numerical_aperture is 1"));
  EXPECT_THAT(why([](Camera* c) {
                c->aperture_behind_front_mm = std::numeric_limits<double>::quiet_NaN();
              }),
              HasSubstr("aperture_behind_front_mm must be finite"));
}

TEST(Camera, TheThinEquivalentOfAnObjectiveIsItself) {
  Camera camera = ParseCamera(Text("", kObjective), "c.yaml");
  camera.calibration.emplace();
  camera.calibration->image_distance_mm = Estimate{220, 0.1};
  const Camera thin = ThinLensEquivalent(camera);
  std::string reason;
  EXPECT_TRUE(thin.IsValid(&reason)) << reason;
  EXPECT_TRUE(thin.objective.has_value());
  EXPECT_NEAR(thin.image_distance_mm(), 220, 1e-10);
}

// The former schema has no objectives of its own; its conversion needs the lens alone.
TEST(CameraFile, AnObjectiveOfTheFormerSchemaIsConvertedAsItsLens) {
  const std::string calibration =
      "calibration: {image_distance_mm: 220, blur_ratio: 0.45, evidence: {method: "
      "joint-blur-fit}}\n";
  const auto former = [&](const std::string& lens) {
    return ParseCamera(Replaced(Text(calibration, lens), "camera/2", "camera/1"), "c.yaml");
  };
  const Camera objective = former(kObjective);
  const Camera lengths = former(
      "lens: {front_focal_length_mm: 20, rear_focal_length_mm: 20, lens_thickness_mm: 0, "
      "aperture_radius_mm: 16.5}\n");
  EXPECT_NE(objective.blur_ratio(), 0.45);
  EXPECT_NEAR(objective.blur_ratio(), lengths.blur_ratio(), 1e-12);
  EXPECT_TRUE(objective.IsValid(nullptr));
}

Camera FullCamera() {
  Camera camera = ParseCamera(Text(""), "c.yaml");
  camera.calibration.emplace();
  CameraCalibration& calibration = *camera.calibration;
  calibration.image_distance_mm = Estimate{47.0 / 3, 1e-300};
  calibration.image_distance_mm->value += 1;
  calibration.blur_ratio = Estimate{1.0 / 3, 0.1};
  calibration.blur_floor_px = Estimate{5e-324, 0};
  calibration.bench_offset_mm = Estimate{-0.0, 1e29};
  calibration.covariance_order = {"image_distance_mm", "blur_ratio"};
  calibration.covariance.resize(2, 2);
  calibration.covariance << 1.0 / 3, -1e-17, -1e-17, 0.1;
  Evidence& evidence = calibration.evidence;
  evidence.method = "joint";
  evidence.frames_used = 41;
  evidence.frames_rejected = {{"frames/a, b: c.png", "clipped: 3.5 %, \"white\""},
                              {"[x]{y} #1.jpg", "- no"},
                              {"Z-1@1#1.jpg", "it's dark\nand dim"}};
  evidence.chi2_per_dof = 1.0 / 7;
  evidence.focus_depth_mm = Estimate{1155.0 / 7, 0.1};
  evidence.data_sha256 = "0123456789012345678901234567890123456789012345678901234567890123";
  evidence.version = "1.0";
  evidence.date = "2020-01-02T03:04:05Z";
  return camera;
}

void ExpectSame(const std::optional<Estimate>& a, const std::optional<Estimate>& b) {
  ASSERT_EQ(a.has_value(), b.has_value());
  if (!a) return;
  EXPECT_TRUE(SameBits(a->value, b->value)) << a->value << " " << b->value;
  EXPECT_TRUE(SameBits(a->sigma, b->sigma)) << a->sigma << " " << b->sigma;
}

// A reader sees the calibration first, and the list of rejected frames last of it.
TEST(CameraToYaml, BeginsWithTheCalibration) {
  const std::string text = CameraToYaml(FullCamera());
  const std::size_t calibration = text.find("\ncalibration:");
  ASSERT_NE(calibration, std::string::npos);
  EXPECT_LT(calibration, text.find("\nlens:"));
  const std::size_t rejected = text.find("frames_rejected:");
  ASSERT_NE(rejected, std::string::npos);
  for (const char* earlier : {"chi2_per_dof:", "data_sha256:", "date:"})
    EXPECT_LT(text.find(earlier), rejected) << earlier;
  EXPECT_LT(rejected, text.find("\nlens:"));
}

TEST(CameraToYaml, CalibrationComesBackWhole) {
  const Camera camera = FullCamera();
  const Camera back = ParseCamera(CameraToYaml(camera), "c.yaml");
  const CameraCalibration& a = *camera.calibration;
  const CameraCalibration& b = back.calibration.value();
  ExpectSame(a.image_distance_mm, b.image_distance_mm);
  ExpectSame(a.blur_ratio, b.blur_ratio);
  ExpectSame(a.blur_floor_px, b.blur_floor_px);
  ExpectSame(a.bench_offset_mm, b.bench_offset_mm);
  EXPECT_EQ(a.covariance_order, b.covariance_order);
  EXPECT_EQ(a.covariance, b.covariance);
  EXPECT_EQ(b.evidence.method, "joint");
  EXPECT_EQ(b.evidence.frames_used, 41);
  ASSERT_EQ(b.evidence.frames_rejected.size(), 3U);
  for (std::size_t i = 0; i < 3; ++i) {
    EXPECT_EQ(a.evidence.frames_rejected[i].image, b.evidence.frames_rejected[i].image);
    EXPECT_EQ(a.evidence.frames_rejected[i].reason, b.evidence.frames_rejected[i].reason);
  }
  EXPECT_TRUE(SameBits(*a.evidence.chi2_per_dof, b.evidence.chi2_per_dof.value()));
  ExpectSame(a.evidence.focus_depth_mm, b.evidence.focus_depth_mm);
  EXPECT_EQ(a.evidence.data_sha256, b.evidence.data_sha256);
  EXPECT_EQ(b.evidence.version, "1.0");
  EXPECT_EQ(b.evidence.date, "2020-01-02T03:04:05Z");
  // Written again, nothing changes any more.
  EXPECT_EQ(CameraToYaml(back), CameraToYaml(camera));
}

TEST(CameraToYaml, WhatDidNotConvergeIsNotWritten) {
  Camera camera = FullCamera();
  camera.calibration->blur_floor_px.reset();
  camera.calibration->covariance_order.clear();
  camera.calibration->covariance.resize(0, 0);
  const std::string text = CameraToYaml(camera);
  EXPECT_EQ(text.find("blur_floor_px"), std::string::npos) << text;
  EXPECT_EQ(text.find("covariance"), std::string::npos) << text;
  EXPECT_FALSE(ParseCamera(text, "c.yaml").calibration->blur_floor_px.has_value());
}

TEST(CameraToYaml, NumbersKeepTheirBits) {
  for (const double value : {1.0 / 3, 1e29, 1.2345678901234567e-29, 0.1, 4.4643}) {
    Camera camera = ParseCamera(Text(""), "c.yaml");
    camera.lens.front_focal_length_mm = value;
    camera.lens.lens_thickness_mm = -value;
    camera.sensor.pixel_pitch_mm = value;
    camera.sensor.principal_point_px = {-0.0, -value};
    camera.statements["sensor.principal_point_px[1]"] = {value, true};
    const Camera back = ParseCamera(CameraToYaml(camera), "c.yaml");
    EXPECT_TRUE(SameBits(back.lens.front_focal_length_mm, value)) << value;
    EXPECT_TRUE(SameBits(back.lens.lens_thickness_mm, -value)) << value;
    EXPECT_TRUE(SameBits(back.sensor.pixel_pitch_mm, value)) << value;
    EXPECT_TRUE(SameBits(back.sensor.principal_point_px.x(), -0.0)) << value;
    EXPECT_TRUE(SameBits(back.sensor.principal_point_px.y(), -value)) << value;
    EXPECT_TRUE(SameBits(back.statements.at("sensor.principal_point_px[1]").tolerance, value));
  }
}

TEST(CameraToYaml, AnyNameComesBack) {
  for (const char* name : {"true",
                           "12",
                           "1e3",
                           "null",
                           "~",
                           "a: b",
                           "a #b",
                           "# a",
                           "\"quoted\"",
                           "it's",
                           "'",
                           "\"",
                           "- a",
                           "-",
                           "? a",
                           "?",
                           ": a",
                           ":",
                           "[a",
                           "{a",
                           "a]",
                           "a,b",
                           "&a",
                           "*a",
                           "!a",
                           "|",
                           ">",
                           "%a",
                           "@a",
                           "`a",
                           "---",
                           "...",
                           "<<",
                           "=",
                           " leading",
                           "trailing ",
                           "a\tb",
                           "a\nb",
                           "a\\b",
                           "a\rb",
                           "K\xC3\xA4mera \xE2\x82\xAC \xF0\x9F\x93\xB7",
                           "\xC2\x85",
                           "\xEF\xBB\xBF"
                           "a",
                           "schema: thicklens/sweep/1"}) {
    Camera camera = FullCamera();
    camera.name = name;
    camera.calibration->evidence.method = name;
    camera.calibration->evidence.frames_rejected = {{name, name}};
    const std::string text = CameraToYaml(camera);
    Camera back;
    ASSERT_NO_THROW(back = ParseCamera(text, "c.yaml")) << text;
    EXPECT_EQ(back.name, name) << text;
    EXPECT_EQ(back.calibration->evidence.method, name) << text;
    EXPECT_EQ(back.calibration->evidence.frames_rejected.at(0).image, name) << text;
    EXPECT_EQ(back.calibration->evidence.frames_rejected.at(0).reason, name) << text;
  }
}

TEST(Camera, MissingCalibrationIsNamed) {
  const Camera camera = ParseCamera(Text(""), "c.yaml");
  EXPECT_THAT(ErrorOf([&] { camera.image_distance_mm(); }),
              AllOf(HasSubstr("'bench' is not calibrated yet"),
                    HasSubstr("image_distance_mm and blur_ratio are missing")));
  EXPECT_THAT(ErrorOf([&] { camera.blur_ratio(); }),
              HasSubstr("image_distance_mm and blur_ratio are missing"));
}

TEST(Camera, IsValidNamesTheField) {
  const auto why = [](const auto& change) {
    Camera camera = FullCamera();
    change(&camera);
    std::string reason;
    return camera.IsValid(&reason) ? "valid" : reason;
  };
  const double nan = std::numeric_limits<double>::quiet_NaN();
  EXPECT_EQ(why([](Camera*) {}), "valid");
  EXPECT_THAT(why([&](Camera* c) { c->lens.aperture_radius_mm = nan; }),
              HasSubstr("aperture_radius_mm"));
  EXPECT_THAT(why([&](Camera* c) { c->sensor.pixel_pitch_mm = nan; }), HasSubstr("pixel_pitch_mm"));
  EXPECT_THAT(why([&](Camera* c) { c->sensor.width_px = 0; }), HasSubstr("width_px"));
  EXPECT_THAT(why([&](Camera* c) { c->sensor.principal_point_px.y() = nan; }),
              HasSubstr("principal_point_px"));
  EXPECT_THAT(why([&](Camera* c) { c->calibration->blur_ratio->value = nan; }),
              HasSubstr("blur_ratio"));
  EXPECT_THAT(why([&](Camera* c) { c->calibration->blur_ratio->sigma = nan; }),
              HasSubstr("blur_ratio"));
  EXPECT_THAT(why([&](Camera* c) { c->calibration->image_distance_mm->value = 15.79; }),
              HasSubstr("15.79"));
}

std::vector<std::string> Shipped(const std::string& kind) {
  std::vector<std::string> files;
  const std::string folder = std::string(THICKLENS_SOURCE_DIR) + "/configs/" + kind;
  for (const auto& entry : std::filesystem::directory_iterator(folder))
    if (entry.path().extension() == ".yaml") files.push_back(entry.path().string());
  return files;
}

TEST(ShippedCameras, AreReadAndFocusWhereTheySay) {
  const std::vector<std::string> files = Shipped("cameras");
  EXPECT_GE(files.size(), 9U);
  for (const std::string& file : files) {
    SCOPED_TRACE(file);
    const Camera camera = ReadCamera(file);
    EXPECT_THAT(file, EndsWith("/" + camera.name + ".yaml"));
    if (!camera.calibration) continue;
    // Shipped cameras were not measured.
    EXPECT_EQ(camera.calibration->evidence.method, "assumed");
    const double stated_mm = camera.calibration->evidence.focus_depth_mm.value().value;
    const ThickLens& lens = camera.lens;
    // [S13] in its own form: 1 = f2/D + f1/zf.
    const double rear_mm = camera.image_distance_mm() - lens.lens_thickness_mm;
    EXPECT_NEAR(lens.rear_focal_length_mm / rear_mm + lens.front_focal_length_mm / stated_mm, 1,
                4e-16);
    EXPECT_NEAR(camera.focus_depth_mm() / stated_mm, 1, 1e-12);
  }
}

TEST(ShippedCameras, KinectHasItsPublishedScale) {
  const Camera camera =
      ReadCamera(std::string(THICKLENS_SOURCE_DIR) + "/configs/cameras/kinect.yaml");
  EXPECT_NEAR(camera.focal_scale_px(), 525, 1e-10);
  EXPECT_EQ(camera.sensor.principal_point_px, Eigen::Vector2d(319.5, 239.5));
}

TEST(ShippedSweeps, AreRead) {
  const std::vector<std::string> files = Shipped("sweeps");
  EXPECT_GE(files.size(), 6U);
  for (const std::string& file : files)
    EXPECT_EQ(ErrorOf([&] { ReadSweepSimulation(file); }), "(no error)") << file;
}

}  // namespace
}  // namespace thicklens::model
