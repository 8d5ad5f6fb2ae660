// thicklens mtf.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <nlohmann/json.hpp>
#include <opencv2/core.hpp>
#include <string>
#include <vector>

#include "calib/drawn_edges.h"
#include "support/temporary_folder.h"
#include "thicklens/base/output_file.h"
#include "thicklens/io/image_file.h"
#include "tools/support/child_process.h"
#include "tools/support/xml_elements.h"

namespace thicklens::tools {
namespace {

using ::testing::HasSubstr;
using ::testing::StartsWith;
using thicklens::testing::ContentOf;
using thicklens::testing::DrawnEdge;
using thicklens::testing::EncodedBytes;
using thicklens::testing::TemporaryFolder;
using Arguments = std::vector<std::string>;

class MtfProgram : public ::testing::Test {
 protected:
  ProgramResult Start(const Arguments& arguments) const {
    return ChildProgram(arguments, scratch_.path(), 0).Wait();
  }
  // An edge of sigma 1.2 px at 5 degrees, in linear values.
  std::string PutEdge() const {
    const std::string path = folder_ / "edge.png";
    WriteFileAtomically(path,
                        io::EncodeImageFile(EncodedBytes(DrawnEdge(160, 5, 1.2, 0.1, 0.8), 1, 1),
                                            io::ImageFormat::kPng));
    return path;
  }
  TemporaryFolder folder_, scratch_;
};

// exp(-2 pi^2 sigma^2 f^2) sinc(f) = 1/2 at f = 0.149 for sigma 1.2 px.
TEST_F(MtfProgram, MeasuresAnEdge) {
  const std::string json = folder_ / "mtf.json", csv = folder_ / "mtf.csv",
                    svg = folder_ / "mtf.svg";
  const ProgramResult result = Start({"mtf", PutEdge(), "--transfer", "linear", "--pitch-um", "5",
                                      "-o", csv, "--figure", svg, "--json", json});
  ASSERT_EQ(result.exit_code, 0) << result.err;
  EXPECT_THAT(result.out, HasSubstr("MTF50"));
  EXPECT_THAT(result.out, HasSubstr("lp/mm on the sensor"));
  const auto found = nlohmann::json::parse(ContentOf(json));
  const double half = found.at("mtf50").at("cycles_per_px").at("value").get<double>();
  EXPECT_NEAR(
      std::exp(-2 * CV_PI * CV_PI * 1.44 * half * half) * std::sin(CV_PI * half) / (CV_PI * half),
      0.5, 0.02);
  EXPECT_NEAR(found["mtf50"]["sensor_lp_per_mm"]["value"].get<double>(), 200 * half, 1e-9);
  EXPECT_TRUE(found["mtf50"]["object_lp_per_mm"].is_null());
  EXPECT_NEAR(found.at("edge").at("normal_deg").get<double>(), 5, 0.2);
  EXPECT_THAT(ContentOf(csv), StartsWith("frequency_cycles_per_px,"));
  EXPECT_EQ(ParseXml(ContentOf(svg)).error, "");
  const ProgramResult part =
      Start({"mtf", folder_ / "edge.png", "--transfer", "linear", "--roi", "20,20,120,120"});
  EXPECT_EQ(part.exit_code, 0) << part.err;
}

TEST_F(MtfProgram, RefusesWhatShowsNoEdge) {
  const std::string path = folder_ / "grey.png";
  WriteFileAtomically(
      path, io::EncodeImageFile(cv::Mat(80, 80, CV_8U, cv::Scalar(90)), io::ImageFormat::kPng));
  ProgramResult result = Start({"mtf", path, "--transfer", "linear", "--json", folder_ / "r.json"});
  EXPECT_EQ(result.exit_code, 1);
  EXPECT_THAT(result.err, HasSubstr("shows no straight edge with an even area on each side"));
  EXPECT_EQ(nlohmann::json::parse(ContentOf(folder_ / "r.json")).at("status"), "refused");
  result = Start({"mtf", path, "--roi", "70,0,20,20"});
  EXPECT_EQ(result.exit_code, 1);
  EXPECT_THAT(result.err, HasSubstr("the region 70,0,20,20 is not inside of its 80 x 80 px"));
  result = Start({"mtf", path, "--roi", "1,2,3"});
  EXPECT_EQ(result.exit_code, 2);
  EXPECT_THAT(result.err, HasSubstr("--roi"));
}

}  // namespace
}  // namespace thicklens::tools
