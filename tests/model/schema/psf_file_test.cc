#include "thicklens/model/psf_file.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>

#include "support/error_message.h"
#include "support/temporary_folder.h"
#include "thicklens/model/camera_file.h"

namespace thicklens::model {
namespace {

using ::testing::HasSubstr;

using thicklens::testing::ErrorOf;
using thicklens::testing::TemporaryFolder;

constexpr char kPsf[] = R"(schema: thicklens/psf/1
step: 0.5
light: [[0, 2, 0], [2, 4, 2], [0, 2, 0]]
)";

std::string CameraText(const std::string& psf) {
  return "schema: thicklens/camera/2\nname: c\nlens: {front_focal_length_mm: 50, "
         "rear_focal_length_mm: 50, lens_thickness_mm: 0, aperture_radius_mm: 8}\nsensor: "
         "{width_px: 64, height_px: 48, pixel_pitch_mm: 0.005, principal_point_px: [31.5, 23.5], "
         "transfer: linear}\n" +
         psf;
}

std::string MessageOf(const std::string& text) {
  return ErrorOf([&] { ParsePsf(text, "psf.yaml"); });
}

TEST(PsfFile, IsReadNormalisedAndWrittenBack) {
  const MeasuredPsf psf = ParsePsf(kPsf, "psf.yaml");
  EXPECT_DOUBLE_EQ(psf.light(1, 1), 4.0 / 12);
  EXPECT_DOUBLE_EQ(psf.light(0, 1), 2.0 / 12);
  EXPECT_DOUBLE_EQ(psf.step, 0.5);
  EXPECT_EQ(psf.sigma.size(), 0);
  MeasuredPsf with_sigma = psf;
  with_sigma.sigma = Eigen::ArrayXXd::Constant(3, 3, 0.01);
  const MeasuredPsf again = ParsePsf(PsfToYaml(with_sigma), "again.yaml");
  EXPECT_TRUE((again.light == psf.light).all());
  EXPECT_TRUE((again.sigma == with_sigma.sigma).all());
  EXPECT_EQ(again.step, psf.step);
}

TEST(PsfFile, RefusesAWrongFileWithItsPlace) {
  const std::string head = "schema: thicklens/psf/1\nstep: 0.5\n";
  EXPECT_THAT(MessageOf(head + "light: [[1, 1, 1], [1, 1], [1, 1, 1]]"),
              HasSubstr("psf.yaml:3:20: light[1]: found 2 numbers in a row of 3 rows: it must be "
                        "square"));
  EXPECT_THAT(MessageOf(head + "light: [[0, 1, 0], [1, -1, 1], [0, 1, 0]]"),
              HasSubstr("light[1][1]"));
  EXPECT_THAT(MessageOf(head + "light: [[0, 0, 0], [0, 0, 0], [0, 0, 0]]"),
              HasSubstr("a sum > 0 is expected"));
  EXPECT_THAT(MessageOf(head + "light: [[1, 0, 0], [0, 0, 0], [0, 0, 0]]"),
              HasSubstr("light is off-centre"));
  EXPECT_THAT(MessageOf(head + "light: [[1, 1], [1, 1]]"), HasSubstr("an odd number from 3"));
  EXPECT_THAT(MessageOf("schema: thicklens/psf/1\nlight: [[1]]"), HasSubstr("step"));
  EXPECT_THAT(MessageOf(head + "lihgt: [[1]]"), HasSubstr("lihgt"));
}

TEST(PsfFile, BelongsToTheCameraThatNamesIt) {
  const TemporaryFolder folder;
  folder.Put("shape.yaml", kPsf);
  const std::string path = folder.Put(
      "camera.yaml", CameraText("psf: measured\npsf_file: shape.yaml\npsf_like: disc\n"));
  const Camera camera = ReadCamera(path);
  ASSERT_NE(camera.measured_psf, nullptr);
  EXPECT_EQ(camera.psf, Psf::kDisc);
  EXPECT_DOUBLE_EQ(camera.measured_psf->light(1, 1), 4.0 / 12);
  EXPECT_THAT(CameraToYaml(camera),
              HasSubstr("psf: measured\npsf_file: shape.yaml\npsf_like: disc"));
  EXPECT_THAT(CameraToYaml(WithoutMeasuredPsf(camera)), HasSubstr("psf: disc\n"));
}

TEST(PsfFile, ACameraThatNamesNoneOrAWrongOneIsRefused) {
  const TemporaryFolder folder;
  const auto message = [&](const std::string& psf) {
    const std::string path = folder.Put("camera.yaml", CameraText(psf));
    return ErrorOf([&] { ReadCamera(path); });
  };
  EXPECT_THAT(message("psf: measured\n"), HasSubstr("psf_file"));
  EXPECT_THAT(message("psf: disc\npsf_file: shape.yaml\n"),
              HasSubstr("psf_file: psf is disc: this key is for psf: measured"));
  EXPECT_THAT(message("psf: measured\npsf_file: missing.yaml\n"), HasSubstr("missing.yaml"));
  folder.Put("wrong.yaml",
             "schema: thicklens/psf/1\nstep: 0.5\nlight: [[0, 0, 0], [0, 0, 0], [0, 0, "
             "0]]\n");
  EXPECT_THAT(message("psf: measured\npsf_file: wrong.yaml\n"), HasSubstr("wrong.yaml:3"));
}

}  // namespace
}  // namespace thicklens::model
