#include "thicklens/io/lens_distortion_file.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstdint>
#include <cstring>
#include <opencv2/core.hpp>
#include <string>
#include <vector>

#include "support/error_message.h"
#include "support/temporary_folder.h"

namespace thicklens::io {
namespace {

using model::DistortionModel;
using ::testing::AllOf;
using ::testing::DoubleNear;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::Not;
using ::testing::Pointwise;
using ::testing::StartsWith;
using ::thicklens::testing::ErrorOf;
using ::thicklens::testing::TemporaryFolder;

LensDistortionFile Parsed(const std::string& text, const std::string& camera = "") {
  return ParseLensDistortion(text, "calib", camera);
}
std::string Refused(const std::string& text, const std::string& camera = "") {
  return ErrorOf([&] { Parsed(text, camera); });
}
std::string ReplacedOnce(std::string text, const std::string& what, const std::string& by) {
  const std::size_t place = text.find(what);
  EXPECT_NE(place, std::string::npos) << what;
  return place == std::string::npos ? text : text.replace(place, what.size(), by);
}

// As OpenCV's sample of its calibration writes it.
constexpr char kOpenCv[] = R"(%YAML:1.0
---
calibration_time: "Sat Nov 28 10:00:00 2026"
nr_of_frames: 25
image_width: 640
image_height: 480
board_width: 9
board_height: 6
square_size: 50.
# flags: +fix_aspectRatio +fix_principal_point +zero_tangent_dist
flags: 14
fisheye_model: 0
camera_matrix: !!opencv-matrix
   rows: 3
   cols: 3
   dt: d
   data: [ 6.5746697944293521e+02, 0., 3.1950000000000000e+02, 0.,
       6.5746697944293521e+02, 2.3950000000000000e+02, 0., 0., 1. ]
distortion_coefficients: !!opencv-matrix
   rows: 5
   cols: 1
   dt: d
   data: [ -4.1802327176423804e-01, 5.0715244063187526e-01, 0., 0.,
       -5.7843597214487474e-01 ]
avg_reprojection_error: 3.8441346462381063e-01
)";

TEST(LensDistortionFile, OpenCvYaml) {
  const LensDistortionFile file = Parsed(kOpenCv);
  EXPECT_EQ(file.format, "OpenCV FileStorage");
  EXPECT_TRUE(file.states_size);
  const model::LensDistortion& d = file.distortion;
  EXPECT_EQ(d.model, DistortionModel::kOpenCv);
  EXPECT_EQ(d.width_px, 640);
  EXPECT_EQ(d.height_px, 480);
  EXPECT_EQ(d.focal_length_px, Eigen::Vector2d(657.46697944293521, 657.46697944293521));
  EXPECT_EQ(d.principal_point_px, Eigen::Vector2d(319.5, 239.5));  // the same pixels as here
  EXPECT_THAT(d.coefficients,
              ElementsAre(-0.41802327176423804, 0.50715244063187526, 0, 0, -0.57843597214487474));
  EXPECT_EQ(d.source, "calib");
  // Older versions write no line of dashes, and fisheye calibrations state it.
  EXPECT_EQ(Parsed(ReplacedOnce(kOpenCv, "---\n", "")).distortion.coefficients, d.coefficients);
  std::string fisheye = ReplacedOnce(kOpenCv, "fisheye_model: 0", "fisheye_model: 1");
  fisheye = ReplacedOnce(fisheye, "rows: 5", "rows: 4");
  fisheye = ReplacedOnce(fisheye,
                         "[ -4.1802327176423804e-01, 5.0715244063187526e-01, 0., 0.,\n       "
                         "-5.7843597214487474e-01 ]",
                         "[ -1e-2, 2e-3, -3e-3, 4e-4 ]");
  EXPECT_EQ(Parsed(fisheye).distortion.model, DistortionModel::kFisheye);
  EXPECT_THAT(Parsed(fisheye).distortion.coefficients, ElementsAre(-1e-2, 2e-3, -3e-3, 4e-4));
}

// OpenCV itself writes the file, in each of its syntaxes and under the names that people use.
TEST(LensDistortionFile, WhatOpenCvWrites) {
  const cv::Mat k = (cv::Mat_<double>(3, 3) << 812.25, 0, 401.5, 0, 813.75, 299.125, 0, 0, 1);
  const cv::Mat d = (cv::Mat_<double>(1, 8) << -0.25, 0.0625, 1e-3, -2e-3, 0.011, 0.3, -0.1, 0.02);
  for (const char* ending : {".yml", ".xml", ".json"}) {
    for (const auto& [matrix, coefficients] :
         {std::pair("camera_matrix", "distortion_coefficients"),
          {"Camera_Matrix", "Distortion_Coefficients"},
          {"cameraMatrix", "distCoeffs"},
          {"K", "D"}}) {
      cv::FileStorage out(ending, cv::FileStorage::WRITE | cv::FileStorage::MEMORY);
      out << "image_width" << 800 << "image_height" << 600 << matrix << k << coefficients << d;
      const std::string text = out.releaseAndGetString();
      SCOPED_TRACE(text);
      const LensDistortionFile file = Parsed(text);
      EXPECT_EQ(file.distortion.width_px, 800);
      EXPECT_EQ(file.distortion.height_px, 600);
      EXPECT_EQ(file.distortion.focal_length_px, Eigen::Vector2d(812.25, 813.75));
      EXPECT_EQ(file.distortion.principal_point_px, Eigen::Vector2d(401.5, 299.125));
      EXPECT_THAT(
          file.distortion.coefficients,
          Pointwise(DoubleNear(1e-15), std::vector<double>(d.begin<double>(), d.end<double>())));
    }
  }
}

// A stereo calibration and nodes of several cameras; and matrices that Python's json wrote.
TEST(LensDistortionFile, OneOfSeveralCamerasOfOpenCv) {
  const std::string stereo =
      "%YAML:1.0\n---\nimage_size: [ 640, 480 ]\n"
      "M1: !!opencv-matrix\n   rows: 3\n   cols: 3\n   dt: d\n   data: [ 500., 0., 320., 0., 500., "
      "240., 0., 0., 1. ]\n"
      "D1: !!opencv-matrix\n   rows: 1\n   cols: 5\n   dt: d\n   data: [ -0.1, 0., 0., 0., 0. ]\n"
      "M2: !!opencv-matrix\n   rows: 3\n   cols: 3\n   dt: d\n   data: [ 600., 0., 320., 0., 600., "
      "240., 0., 0., 1. ]\n"
      "D2: !!opencv-matrix\n   rows: 1\n   cols: 5\n   dt: d\n   data: [ -0.2, 0., 0., 0., 0. ]\n";
  EXPECT_EQ(Parsed(stereo, "1").distortion.focal_length_px.x(), 500);
  EXPECT_EQ(Parsed(stereo, "2").distortion.coefficients[0], -0.2);
  EXPECT_EQ(Parsed(stereo, "2").distortion.source, "calib:2");
  EXPECT_THAT(Refused(stereo), AllOf(HasSubstr("2 cameras"), HasSubstr("calib:1")));
  EXPECT_THAT(Refused(stereo, "3"), HasSubstr("no camera '3'"));
  const std::string json =
      R"({"left": {"mtx": [[500, 0, 320], [0, 500, 240], [0, 0, 1]], "dist": [[-0.1, 0, 0, 0, 0]],
       "image_size": [640, 480]}})";
  EXPECT_EQ(Parsed(json, "left").distortion.coefficients[0], -0.1);
  EXPECT_THAT(Refused(kOpenCv, "left"), HasSubstr("leave the colon out"));
}

TEST(LensDistortionFile, AFileWithoutASizeTakesTheOneOfTheImages) {
  const std::string text =
      "K: [500, 0, 320, 0, 500, 240, 0, 0, 1]\n"
      "D: [-0.1, 0.01, 0, 0]\n";
  EXPECT_THAT(Refused(text), AllOf(HasSubstr("calib"), HasSubstr("image_width")));
  const LensDistortionFile file = ParseLensDistortion(text, "calib", "", 640, 480);
  EXPECT_FALSE(file.states_size);
  EXPECT_EQ(file.distortion.width_px, 640);
  EXPECT_THAT(ErrorOf([&] { ParseLensDistortion(text, "calib", "", 64, 48); }),
              AllOf(HasSubstr("principal_point_px"), HasSubstr("64 x 48 px were assumed")));
}

constexpr char kRos[] = R"(image_width: 640
image_height: 480
camera_name: narrow_stereo
camera_matrix:
  rows: 3
  cols: 3
  data: [526.69, 0, 312.33, 0, 525.75, 246.22, 0, 0, 1]
distortion_model: plumb_bob
distortion_coefficients:
  rows: 1
  cols: 5
  data: [0.01864, -0.08079, 0.00067, -0.0018, 0]
rectification_matrix:
  rows: 3
  cols: 3
  data: [1, 0, 0, 0, 1, 0, 0, 0, 1]
projection_matrix:
  rows: 3
  cols: 4
  data: [516.2, 0, 310.3, 0, 0, 514.0, 246.8, 0, 0, 0, 1, 0]
)";

TEST(LensDistortionFile, RosCameraInfo) {
  const LensDistortionFile file = Parsed(kRos);
  EXPECT_EQ(file.format, "ROS camera_info");
  EXPECT_EQ(file.distortion.focal_length_px, Eigen::Vector2d(526.69, 525.75));
  EXPECT_EQ(file.distortion.principal_point_px, Eigen::Vector2d(312.33, 246.22));
  EXPECT_THAT(file.distortion.coefficients, ElementsAre(0.01864, -0.08079, 0.00067, -0.0018, 0));
  const std::string equidistant = ReplacedOnce(
      ReplacedOnce(ReplacedOnce(kRos, "plumb_bob", "equidistant"), "cols: 5", "cols: 4"),
      "[0.01864, -0.08079, 0.00067, -0.0018, 0]", "[0.01864, -0.08079, 0.00067, -0.0018]");
  EXPECT_EQ(Parsed(equidistant).distortion.model, DistortionModel::kFisheye);
  const std::string rational = ReplacedOnce(
      ReplacedOnce(ReplacedOnce(kRos, "plumb_bob", "rational_polynomial"), "cols: 5", "cols: 8"),
      "-0.0018, 0]", "-0.0018, 0, 0.02, -0.03, 0.001]");
  EXPECT_EQ(Parsed(rational).distortion.coefficients.size(), 8U);
  // The message as rostopic echo prints it.
  const std::string echo =
      "height: 480\nwidth: 640\ndistortion_model: \"plumb_bob\"\n"
      "D: [-0.1, 0.0, 0.0, 0.0, 0.0]\n"
      "K: [500.0, 0.0, 320.0, 0.0, 500.0, 240.0, 0.0, 0.0, 1.0]\n";
  EXPECT_EQ(Parsed(echo).distortion.coefficients[0], -0.1);
  EXPECT_THAT(Refused(ReplacedOnce(kRos, "plumb_bob", "omnidirectional")),
              AllOf(HasSubstr("calib:8:"), HasSubstr("omnidirectional"), HasSubstr("OpenCV")));
  EXPECT_THAT(Refused(ReplacedOnce(kRos, "[526.69, 0, 312.33, 0, 525.75, 246.22, 0, 0, 1]",
                                   "[0, 0, 0, 0, 0, 0, 0, 0, 0]")),
              HasSubstr("not calibrated"));
  EXPECT_THAT(Refused(ReplacedOnce(kRos, "plumb_bob", "equidistant")),
              AllOf(HasSubstr("4 coefficients"), HasSubstr("found 5")));
}

constexpr char kKalibr[] = R"(cam0:
  cam_overlaps: [1]
  camera_model: pinhole
  distortion_coeffs: [-0.27695497, 0.06712482, 0.00087538, 0.00011556]
  distortion_model: radtan
  intrinsics: [461.629, 460.152, 362.680, 246.049]
  resolution: [752, 480]
  rostopic: /cam0/image_raw
cam1:
  T_cn_cnm1:
  - [0.99998854, 0.00216014, 0.00427195, -0.11003785]
  - [-0.00221074, 0.99992702, 0.01187697, 0.00045792]
  - [-0.00424598, -0.01188627, 0.99992034, -0.00064487]
  - [0.0, 0.0, 0.0, 1.0]
  camera_model: pinhole
  distortion_coeffs: [-0.01, 0.002, -0.003, 0.0004]
  distortion_model: equidistant
  intrinsics: [459.3, 458.2, 370.1, 250.2]
  resolution: [752, 480]
cam2:
  camera_model: omni
  distortion_coeffs: [-0.3, 0.1, 0.0, 0.0]
  distortion_model: radtan
  intrinsics: [0.8, 833.0, 830.3, 373.8, 253.7]
  resolution: [752, 480]
cam3:
  camera_model: pinhole
  distortion_coeffs: [0.9]
  distortion_model: fov
  intrinsics: [459.3, 458.2, 370.1, 250.2]
  resolution: [752, 480]
cam4:
  camera_model: pinhole
  distortion_coeffs: []
  distortion_model: none
  intrinsics: [459.3, 458.2, 370.1, 250.2]
  resolution: [752, 480]
)";

TEST(LensDistortionFile, KalibrCamchain) {
  const LensDistortionFile zero = Parsed(kKalibr, "cam0");
  EXPECT_EQ(zero.format, "Kalibr camchain");
  EXPECT_EQ(zero.camera, "cam0");
  EXPECT_EQ(zero.distortion.width_px, 752);
  EXPECT_EQ(zero.distortion.model, DistortionModel::kOpenCv);
  EXPECT_EQ(zero.distortion.principal_point_px, Eigen::Vector2d(362.680, 246.049));
  EXPECT_THAT(zero.distortion.coefficients,
              ElementsAre(-0.27695497, 0.06712482, 0.00087538, 0.00011556));
  EXPECT_EQ(Parsed(kKalibr, "1").distortion.model, DistortionModel::kFisheye);
  EXPECT_THAT(Parsed(kKalibr, "cam4").distortion.coefficients, ElementsAre(0, 0, 0, 0));
  EXPECT_THAT(Refused(kKalibr),
              AllOf(HasSubstr("5 cameras"), HasSubstr("cam0, cam1"), HasSubstr("calib:cam0")));
  EXPECT_THAT(Refused(kKalibr, "cam7"), HasSubstr("no camera 'cam7'"));
  EXPECT_THAT(Refused(kKalibr, "cam2"), AllOf(HasSubstr("omni-radtan"), HasSubstr("pinhole-equi")));
  EXPECT_THAT(Refused(kKalibr, "cam3"), HasSubstr("pinhole-fov"));
  EXPECT_THAT(
      Refused(ReplacedOnce(kKalibr, "[461.629, 460.152, 362.680, 246.049]", "[461.629]"), "cam0"),
      AllOf(HasSubstr("cam0.intrinsics"), HasSubstr("fu, fv, pu and pv")));
}

constexpr char kColmap[] = R"(# Camera list with one line of data per camera:
#   CAMERA_ID, MODEL, WIDTH, HEIGHT, PARAMS[]
# Number of cameras: 4
1 SIMPLE_RADIAL 3072 2304 2559.81 1536 1152 -0.0204997
2 OPENCV 3072 2304 2560.56 2561.5 1536 1152 -0.02 0.01 0.0003 -0.0004
7 OPENCV_FISHEYE 3008 4096 2134.24 2134.5 1531.06 2054.14 0.00372 -0.00331 0.00167 -0.00032
9 FOV 3072 2304 2559.69 2559.69 1536 1152 0.9
11 FULL_OPENCV 800 600 700 701 400 300 -0.1 0.02 0.001 0.002 0.003 0.04 0.005 0.0006
12 RADIAL_FISHEYE 800 600 300 400 300 0.01 -0.002
13 SIMPLE_PINHOLE 800 600 700 400 300
)";

// COLMAP's first pixel has its centre at (0.5, 0.5).
TEST(LensDistortionFile, ColmapText) {
  const LensDistortionFile one = Parsed(kColmap, "1");
  EXPECT_EQ(one.format, "COLMAP cameras.txt");
  EXPECT_EQ(one.distortion.focal_length_px, Eigen::Vector2d(2559.81, 2559.81));
  EXPECT_EQ(one.distortion.principal_point_px, Eigen::Vector2d(1535.5, 1151.5));
  EXPECT_THAT(one.distortion.coefficients, ElementsAre(-0.0204997, 0, 0, 0));
  EXPECT_EQ(Parsed(kColmap, "2").distortion.focal_length_px, Eigen::Vector2d(2560.56, 2561.5));
  EXPECT_THAT(Parsed(kColmap, "2").distortion.coefficients, ElementsAre(-0.02, 0.01, 3e-4, -4e-4));
  EXPECT_EQ(Parsed(kColmap, "7").distortion.model, DistortionModel::kFisheye);
  EXPECT_EQ(Parsed(kColmap, "7").distortion.height_px, 4096);
  EXPECT_THAT(Parsed(kColmap, "11").distortion.coefficients,
              ElementsAre(-0.1, 0.02, 0.001, 0.002, 0.003, 0.04, 0.005, 0.0006));
  EXPECT_EQ(Parsed(kColmap, "12").distortion.model, DistortionModel::kFisheye);
  EXPECT_THAT(Parsed(kColmap, "12").distortion.coefficients, ElementsAre(0.01, -0.002, 0, 0));
  EXPECT_THAT(Parsed(kColmap, "13").distortion.coefficients, ElementsAre(0, 0, 0, 0));
  EXPECT_THAT(Refused(kColmap, "9"),
              AllOf(HasSubstr("line 7"), HasSubstr("FOV of COLMAP"), HasSubstr("OPENCV")));
  EXPECT_THAT(Refused(kColmap), AllOf(HasSubstr("7 cameras"), HasSubstr("calib:1")));
  EXPECT_THAT(Refused(kColmap, "3"), HasSubstr("no camera '3'"));
  EXPECT_EQ(Parsed("1 SIMPLE_RADIAL 640 480 500 320 240 -0.1\n").camera, "");
  EXPECT_THAT(Refused("1 SIMPLE_RADIAL 640 480 500 320 240\n"),
              AllOf(HasSubstr("4 parameters"), HasSubstr("found 3")));
  EXPECT_THAT(Refused("1 SIMPLE_RADIAL 640 480 500 320 nan -0.1\n"), HasSubstr("finite number"));
  EXPECT_THAT(Refused("1 SIMPLE_RADIAL 99999999999 480 500 320 240 0\n"),
              HasSubstr("1 to 100000 px"));
}

void Append(std::string* out, std::uint64_t value, int bytes) {
  for (int i = 0; i < bytes; ++i) {
    *out += static_cast<char>(value & 0xFFU);
    value >>= 8U;
  }
}
std::string BinaryCamera(std::uint32_t id, std::uint32_t model, std::uint64_t width,
                         std::uint64_t height, const std::vector<double>& parameters) {
  std::string out;
  Append(&out, id, 4);
  Append(&out, model, 4);
  Append(&out, width, 8);
  Append(&out, height, 8);
  for (const double parameter : parameters) {
    std::uint64_t bits = 0;
    std::memcpy(&bits, &parameter, sizeof bits);
    Append(&out, bits, 8);
  }
  return out;
}
std::string BinaryFile(std::uint64_t count, const std::string& cameras) {
  std::string out;
  Append(&out, count, 8);
  return out + cameras;
}

TEST(LensDistortionFile, ColmapBinary) {
  const std::string radial = BinaryCamera(3, 2, 3072, 2304, {2559.81, 1536, 1152, -0.0204997});
  const std::string opencv =
      BinaryCamera(5, 4, 3072, 2304, {2560, 2561, 1536, 1152, -0.02, 0.01, 3e-4, -4e-4});
  const LensDistortionFile file = Parsed(BinaryFile(1, radial));
  EXPECT_EQ(file.format, "COLMAP cameras.bin");
  EXPECT_EQ(file.distortion.principal_point_px, Eigen::Vector2d(1535.5, 1151.5));
  EXPECT_THAT(file.distortion.coefficients, ElementsAre(-0.0204997, 0, 0, 0));
  const std::string both = BinaryFile(2, radial + opencv);
  EXPECT_EQ(Parsed(both, "5").distortion.focal_length_px.y(), 2561);
  EXPECT_THAT(Refused(both), HasSubstr("calib:3"));
  EXPECT_THAT(Refused(BinaryFile(1, BinaryCamera(1, 10, 640, 480, std::vector<double>(12, 1.0)))),
              HasSubstr("THIN_PRISM_FISHEYE"));
  // Damaged: cut anywhere, a count that the file cannot have, a model that is not known, numbers
  // that are none, and bytes at the end.
  for (std::size_t size = 1; size < both.size(); size += 5)
    EXPECT_THAT(Refused(both.substr(0, size), "5"), StartsWith("calib: ")) << size;
  EXPECT_THAT(Refused(BinaryFile(0xFFFFFFFFFFFFFFFFULL, radial)), HasSubstr("neither a text nor"));
  EXPECT_THAT(Refused(BinaryFile(1, BinaryCamera(1, 77, 640, 480, {1}))),
              AllOf(HasSubstr("model number 77"), HasSubstr("model_converter")));
  EXPECT_THAT(Refused(BinaryFile(1, BinaryCamera(1, 0, 640, 480, {0.0 / 0.0, 1, 1}))),
              HasSubstr("parameter 1 is not a finite number"));
  EXPECT_THAT(Refused(BinaryFile(1, radial + "xyz")), HasSubstr("3 bytes follow"));
  EXPECT_THAT(Refused(BinaryFile(1, BinaryCamera(1, 0, 0xFFFFFFFFFFFFFFFFULL, 480, {1, 1, 1}))),
              HasSubstr("1 to 100000 px"));
}

constexpr char kMrcal[] =
    R"(# generated on 2026-11-28 10:00:00 with   mrcal-calibrate-cameras --focal 1700

{
    'lensmodel':  'LENSMODEL_OPENCV8',

    # intrinsics are fx,fy,cx,cy,distortion0,distortion1,....
    'intrinsics': [ 1761.181055, 1761.250444, 1965.706996, 1087.518797, -0.01266096516, 0.03590794372, -0.0002547045941, 0.0005275929652, 0.01968883397, 0.01482863541, -0.0562239888, 0.0500223357,],

    'valid_intrinsics_region': [
        [ 120, 1 ],
        [ 3780, 2100 ],
    ],

    # extrinsics are rt_fromref
    'extrinsics': [ 0, 0, 0, 0, 0, 0,],

    'imagersize': [ 4000, 2200,],

    'icam_intrinsics': 0,

    'optimization_inputs': b'P)h>@6aWAK2mk;8K>z>${:}[]#%s,ZVQ$00000',
}
)";

TEST(LensDistortionFile, MrcalCameraModel) {
  const LensDistortionFile file = Parsed(kMrcal);
  EXPECT_EQ(file.format, "mrcal .cameramodel");
  EXPECT_EQ(file.distortion.width_px, 4000);
  EXPECT_EQ(file.distortion.height_px, 2200);
  EXPECT_EQ(file.distortion.focal_length_px, Eigen::Vector2d(1761.181055, 1761.250444));
  EXPECT_EQ(file.distortion.principal_point_px, Eigen::Vector2d(1965.706996, 1087.518797));
  EXPECT_THAT(file.distortion.coefficients,
              ElementsAre(-0.01266096516, 0.03590794372, -0.0002547045941, 0.0005275929652,
                          0.01968883397, 0.01482863541, -0.0562239888, 0.0500223357));
  const std::string pinhole =
      "{ 'lensmodel': 'LENSMODEL_PINHOLE', 'intrinsics': [ 1000, 1100, 320, 240 ], 'extrinsics': "
      "[0,0,0,0,0,0], 'imagersize': [ 640, 480 ] }";
  EXPECT_THAT(Parsed(pinhole).distortion.coefficients, ElementsAre(0, 0, 0, 0));
  EXPECT_THAT(
      Refused(ReplacedOnce(kMrcal, "LENSMODEL_OPENCV8",
                           "LENSMODEL_SPLINED_STEREOGRAPHIC_order=3_Nx=30_Ny=18_fov_x_deg=150")),
      AllOf(HasSubstr("LENSMODEL_SPLINED_STEREOGRAPHIC of mrcal"),
            HasSubstr("mrcal-convert-lensmodel LENSMODEL_OPENCV8")));
  EXPECT_THAT(Refused(ReplacedOnce(kMrcal, "LENSMODEL_OPENCV8", "LENSMODEL_CAHVOR")),
              HasSubstr("LENSMODEL_CAHVOR of mrcal"));
  EXPECT_THAT(Refused("Model = CAHVOR = perspective, distortion\nDimensions = 640 480\n"),
              HasSubstr("CAHVOR"));
  EXPECT_THAT(Refused(ReplacedOnce(kMrcal, "LENSMODEL_OPENCV8", "LENSMODEL_OPENCV5")),
              AllOf(HasSubstr("intrinsics"), HasSubstr("9 numbers, found 12")));
  EXPECT_THAT(Refused(kMrcal, "cam0"), HasSubstr("one camera"));
}

TEST(LensDistortionFile, OwnCameraFile) {
  const std::string camera =
      "schema: thicklens/camera/2\nname: bench\n"
      "lens: {front_focal_length_mm: 12.5, rear_focal_length_mm: 12.5, lens_thickness_mm: 0, "
      "aperture_radius_mm: 4, distortion: {model: opencv, size_px: [640, 480], focal_length_px: "
      "[2083, 2083], principal_point_px: [319.5, 239.5], coefficients: [-0.3, 0.1, 0, 0]}}\n"
      "sensor: {width_px: 640, height_px: 480, pixel_pitch_mm: 0.006, principal_point_px: [319.5, "
      "239.5], transfer: srgb}\n";
  EXPECT_THAT(Parsed(camera).distortion.coefficients, ElementsAre(-0.3, 0.1, 0, 0));
  EXPECT_EQ(Parsed(camera).format, "camera file");
  const std::size_t begin = camera.find(", distortion"), end = camera.find("]}}");
  EXPECT_THAT(Refused(camera.substr(0, begin) + camera.substr(end + 2)),
              HasSubstr("states no lens.distortion"));
}

TEST(LensDistortionFile, DamagedFilesAreRefusedWithTheirPlace) {
  EXPECT_THAT(Refused(""), StartsWith("calib"));
  EXPECT_THAT(Refused("hello"), StartsWith("calib"));
  EXPECT_THAT(Refused("a: 1\nb: 2\n"),
              AllOf(HasSubstr("camera_matrix"), HasSubstr("cameras.txt"), HasSubstr("mrcal")));
  EXPECT_THAT(Refused(ReplacedOnce(kOpenCv, "6.5746697944293521e+02", ".Nan")),
              AllOf(HasSubstr("calib:17:"), HasSubstr("camera_matrix.data[0]")));
  EXPECT_THAT(Refused(ReplacedOnce(kOpenCv, "rows: 3", "rows: 2")),
              AllOf(HasSubstr("camera_matrix"), HasSubstr("rows times cols is 6")));
  EXPECT_THAT(Refused(ReplacedOnce(kOpenCv, "rows: 3", "rows: 4000000000")), HasSubstr("rows"));
  EXPECT_THAT(Refused(ReplacedOnce(kOpenCv, "image_width: 640", "image_width: -640")),
              HasSubstr("image_width"));
  EXPECT_THAT(Refused(ReplacedOnce(kOpenCv, "image_width: 640", "image_width: [640]")),
              HasSubstr("image_width"));
  EXPECT_THAT(Refused(ReplacedOnce(kOpenCv, "distortion_coefficients:", "coefficients:")),
              HasSubstr("camera_matrix without coefficients"));
  EXPECT_THAT(Refused(ReplacedOnce(kOpenCv, "+02, 0., 3.195", "+02, 2., 3.195")),
              HasSubstr("skew"));
  std::string many =
      "K: [500, 0, 320, 0, 500, 240, 0, 0, 1]\nimage_size: [640, 480]\n"
      "D: [0";
  for (int i = 0; i < 100000; ++i) many += ", 0";
  EXPECT_THAT(Refused(many + "]\n"), HasSubstr("at most 64 numbers"));
  const std::string xml =
      "<?xml version=\"1.0\"?>\n<opencv_storage>\n<image_width>640</image_width>\n"
      "<image_height>480</image_height>\n<camera_matrix type_id=\"opencv-matrix\">\n<rows>3</rows>"
      "<cols>3</cols><dt>d</dt>\n<data>500. 0. 320. 0. 500. 240. 0. 0. 1.</data></camera_matrix>\n"
      "<distortion_coefficients type_id=\"opencv-matrix\"><rows>1</rows><cols>4</cols><dt>d</dt>\n"
      "<data>-0.1 0. 0. 0.</data></distortion_coefficients>\n</opencv_storage>\n";
  EXPECT_EQ(Parsed(xml).distortion.coefficients[0], -0.1);
  EXPECT_THAT(Refused(ReplacedOnce(xml, "-0.1 ", ".Inf ")),
              AllOf(HasSubstr("distortion_coefficients"), HasSubstr("'.Inf'")));
  EXPECT_THAT(Refused(ReplacedOnce(xml, "</opencv_storage>", "")), HasSubstr("not valid XML"));
  EXPECT_THAT(Refused("<!DOCTYPE a [<!ENTITY b \"cc\">]>" + xml.substr(xml.find("<opencv"))),
              HasSubstr("entities"));
  std::string deep = "<a>";
  for (int i = 0; i < 100000; ++i) deep += "<b>";
  EXPECT_THAT(Refused(deep), HasSubstr("nested"));
}

TEST(LensDistortionFile, FileAndCameraAreSeparatedAtTheLastColon) {
  const TemporaryFolder folder;
  const std::string path = folder.Put("calib.yaml", kKalibr);
  EXPECT_EQ(ReadLensDistortion(path + ":cam1").distortion.model, DistortionModel::kFisheye);
  EXPECT_EQ(ReadLensDistortion(path + ":cam1").distortion.source, path + ":cam1");
  const std::string colon = folder.Put("odd:name", kOpenCv);
  EXPECT_EQ(FileAndCamera(colon).first, colon);
  EXPECT_EQ(FileAndCamera("a.yml"), std::pair(std::string("a.yml"), std::string()));
  EXPECT_THAT(ErrorOf([&] { ReadLensDistortion(folder / "missing.yml"); }),
              HasSubstr("missing.yml"));
}

}  // namespace
}  // namespace thicklens::io
