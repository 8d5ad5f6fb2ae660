// thicklens camera verify: whether a stored calibration still holds. The statistics by hand:
// tests/calib/calibrate/verification_test.cc.
#include "tools/commands/camera_verify.h"

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "support/temporary_folder.h"
#include "thicklens/base/parallel.h"
#include "thicklens/calib/calibrate.h"
#include "thicklens/calib/verification.h"
#include "thicklens/model/camera_file.h"
#include "tools/bench/bench_sweep.h"
#include "tools/support/child_process.h"

namespace thicklens::tools {
namespace {

namespace fs = std::filesystem;
using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;
using thicklens::testing::ContentOf;
using thicklens::testing::TemporaryFolder;
using Arguments = std::vector<std::string>;

// A sweep of one camera with its calibration.
struct CalibratedSweep {
  calib::FocusSweep sweep;
  calib::Calibration calibration;
};

CalibratedSweep SmallSweep(std::uint64_t seed) {
  model::SweepSimulationOptions options = BenchSweepOptions();
  options.frame_count = 11;
  options.step_mm = 3;
  const BenchSweep bench = MakeBenchSweep(options, {}, 160, seed);
  calib::CalibrationOptions settings;
  settings.map_field = false;
  settings.threads = 1;
  return {bench.sweep, calib::Calibrate(bench.sweep, settings)};
}

// Pairs of sweeps of the same camera, one of which is stored.
std::vector<CalibratedSweep> Sweeps(int count) {
  std::vector<CalibratedSweep> sweeps(static_cast<std::size_t>(count));
  ParallelFor(count, 0, [&](int i) {
    sweeps[static_cast<std::size_t>(i)] = SmallSweep(500 + static_cast<std::uint64_t>(i));
  });
  return sweeps;
}

calib::Verification Verified(const CalibratedSweep& stored, const CalibratedSweep& next,
                             double d1_sigmas) {
  model::Camera camera = calib::CalibratedCamera(stored.sweep.camera, stored.calibration, false);
  model::Estimate& d1 = *camera.calibration->image_distance_mm;
  d1.value += d1_sigmas * std::hypot(d1.sigma, next.calibration.summary.image_distance_mm->sigma);
  return calib::VerifyCalibration(camera, next.sweep, next.calibration, {});
}

// Forty pairs: the chi-squares of calibrations that hold add up to one of as many degrees of
// freedom, and a camera whose d1 has moved by five sigma is found.
TEST(VerifySlow, TheJointChiSquareIsOneAndFiveSigmaAreFound) {
  constexpr int kPairs = 40;
  const std::vector<CalibratedSweep> sweeps = Sweeps(2 * kPairs);
  double chi_square = 0;
  int degrees_of_freedom = 0, holds = 0, found = 0;
  for (std::size_t i = 0; i < sweeps.size(); i += 2) {
    ASSERT_TRUE(sweeps[i].calibration.summary.image_distance_mm)
        << sweeps[i].calibration.summary.reason;
    const calib::Verification same = Verified(sweeps[i], sweeps[i + 1], 0);
    chi_square += same.chi_square;
    degrees_of_freedom += same.degrees_of_freedom;
    if (same.verdict == calib::Verdict::kHolds) ++holds;
    for (const double sigmas : {-5.0, 5.0}) {
      if (Verified(sweeps[i], sweeps[i + 1], sigmas).verdict == calib::Verdict::kDoesNotHold) {
        ++found;
      }
    }
  }
  RecordProperty("chi_square", fmt::format("{:.1f} of {}", chi_square, degrees_of_freedom));
  EXPECT_EQ(degrees_of_freedom, 2 * kPairs);
  // Too large would mean errors that are stated too small. They may be stated a little too large:
  // systematic parts widen them.
  EXPECT_GT(calib::ChiSquareTail(chi_square, degrees_of_freedom), 0.01) << chi_square;
  EXPECT_GT(chi_square, 0.2 * degrees_of_freedom);
  EXPECT_GE(holds, kPairs - 1);
  // 95 % of the cases are found, by the definition of five sigma at this significance; of 80, four
  // missed, and three standard deviations more.
  EXPECT_GE(found, 2 * kPairs - 10);
}

class CameraVerifyTest : public ::testing::Test {
 protected:
  static void SetUpTestSuite() {
    shared_ = std::make_unique<TemporaryFolder>();
    for (const int seed : {1, 2}) {
      const std::string config = shared_->Put(
          fmt::format("config{}.yaml", seed),
          fmt::format("schema: thicklens/simulate-sweep/1\ncamera: {}/configs/cameras/"
                      "case-ii.yaml\ntruth: {{focus_depth_mm: 300, blur_ratio: 0.45, "
                      "blur_floor_px: 0.5}}\nsize_px: [144, 144]\ntarget: {{kind: dead-leaves}}\n"
                      "bench: {{first_depth_mm: 286, step_mm: 3, frames: 10, offset_mm: 20, "
                      "reading_sigma_mm: 0.05}}\nnoise: {{full_well_electrons: 10000}}\nseed: {}\n",
                      THICKLENS_SOURCE_DIR, seed));
      const ProgramResult result = Run({"simulate", "sweep", config, "-o", Sweep(seed)});
      ASSERT_EQ(result.exit_code, 0) << result.err;
    }
    const ProgramResult result = Run({"calibrate", Sweep(1), "--offset-mm", "20", "--floor-px",
                                      "0.5:0.01", "--no-field", "-o", *shared_ / "camera.yaml"});
    ASSERT_EQ(result.exit_code, 0) << result.err;
  }
  static void TearDownTestSuite() { shared_.reset(); }
  static std::string Sweep(int seed) { return *shared_ / fmt::format("sweep{}", seed); }
  static ProgramResult Run(const Arguments& arguments) {
    return ChildProgram(arguments, shared_->path(), 0).Wait();
  }

  ProgramResult Verify(const std::string& camera, const std::string& sweep,
                       const Arguments& more = {}) {
    Arguments arguments = {"camera",      "verify",   camera,   sweep,
                           "--floor-px",  "0.5:0.01", "--json", folder_ / "verify.json",
                           "--offset-mm", offset_mm_};
    arguments.insert(arguments.end(), more.begin(), more.end());
    const ProgramResult result = Run(arguments);
    json_ = nlohmann::json::parse(ContentOf(folder_ / "verify.json"));
    return result;
  }

  static std::unique_ptr<TemporaryFolder> shared_;
  TemporaryFolder folder_;
  std::string offset_mm_ = "20";
  nlohmann::json json_;
};

std::unique_ptr<TemporaryFolder> CameraVerifyTest::shared_;

TEST_F(CameraVerifyTest, ACalibrationOfTheSameCameraHolds) {
  const ProgramResult result = Verify(*shared_ / "camera.yaml", Sweep(2));
  EXPECT_EQ(result.exit_code, 0) << result.err << result.out;
  EXPECT_THAT(result.out, AllOf(HasSubstr("image_distance_mm"), HasSubstr("detectable"),
                                HasSubstr("the calibration holds")));
  EXPECT_EQ(json_["status"], "holds");
  EXPECT_EQ(json_["degrees_of_freedom"], 2);
  EXPECT_GT(json_["p_value"].get<double>(), 0.0027);
  for (const auto& parameter : json_["parameters"]) {
    SCOPED_TRACE(parameter.dump());
    EXPECT_GT(parameter["stored"]["value"].get<double>(), 0);
    const double sigma = parameter["sigma"];
    if (sigma > 0) {
      EXPECT_NEAR(parameter["difference_sigmas"].get<double>(),
                  parameter["difference"].get<double>() / sigma, 1e-9);
    } else {  // a bench offset that is stated as exact
      EXPECT_TRUE(parameter["difference_sigmas"].is_null());
    }
    EXPECT_EQ(parameter["counted"].get<bool>(), parameter["why_not_counted"].is_null());
  }
}

TEST_F(CameraVerifyTest, ACameraThatWasRefocusedIsFound) {
  model::Camera camera = model::ReadCamera(*shared_ / "camera.yaml");
  ASSERT_EQ(Verify(*shared_ / "camera.yaml", Sweep(2)).exit_code, 0);
  double sigma = 0;
  for (const auto& parameter : json_["parameters"]) {
    if (parameter["name"] == "image_distance_mm") sigma = parameter["sigma"];
  }
  ASSERT_GT(sigma, 0);
  // Eight, so that it does not hang on how far this sweep itself is off.
  camera.calibration->image_distance_mm->value += 8 * sigma;
  const std::string other = folder_.Put("other.yaml", model::CameraToYaml(camera));
  const ProgramResult result = Verify(other, Sweep(2));
  EXPECT_EQ(result.exit_code, 1);
  EXPECT_EQ(json_["status"], "does-not-hold");
  EXPECT_THAT(result.out, AllOf(HasSubstr("\nthe calibration does not hold: "),
                                HasSubstr("image_distance_mm"), HasSubstr("sigma")));
  EXPECT_THAT(result.err, Not(HasSubstr("error")));
  EXPECT_LT(json_["p_value"].get<double>(), 0.0027);
}

TEST_F(CameraVerifyTest, CasesWithoutAVerdictAreReported) {
  // The sweep that it was made from agrees whatever has happened since.
  ProgramResult result = Verify(*shared_ / "camera.yaml", Sweep(1));
  EXPECT_EQ(result.exit_code, 1);
  EXPECT_EQ(json_["status"], "cannot-tell");
  // The verdict is a result, which comes once; with --quiet it is the only line.
  EXPECT_THAT(result.out, AllOf(HasSubstr("whether the calibration holds is undecided: "),
                                HasSubstr("take a new one")));
  EXPECT_THAT(result.err, Not(HasSubstr("error")));
  result = Verify(*shared_ / "camera.yaml", Sweep(1), {"--quiet"});
  EXPECT_EQ(result.exit_code, 1);
  EXPECT_EQ(result.out, "");
  EXPECT_THAT(result.err, HasSubstr("take a new one"));
  // Three frames give no calibration.
  fs::create_directories(folder_ / "few");
  std::string rows = "file,reading\n";
  for (int i = 0; i < 3; ++i) {
    const std::string name = fmt::format("frame_{:03}.png", 4 * i);
    fs::path frame;
    for (const auto& entry : fs::recursive_directory_iterator(Sweep(2))) {
      if (entry.path().filename() == name) frame = entry.path();
    }
    ASSERT_FALSE(frame.empty()) << name;
    fs::copy_file(frame, fs::path(folder_ / "few") / name);
    rows += fmt::format("{},{}\n", name, 266 + 12 * i);
  }
  result = Verify(*shared_ / "camera.yaml", folder_ / "few",
                  {"--readings", folder_.Put("few.csv", rows)});
  EXPECT_EQ(result.exit_code, 1);
  EXPECT_EQ(json_["status"], "cannot-tell");
  EXPECT_THAT(result.out, HasSubstr("frames"));
  // This sweep is too coarse for the requested accuracy.
  result = Verify(*shared_ / "camera.yaml", Sweep(2), {"--needed-blur-px", "0.0001"});
  EXPECT_EQ(result.exit_code, 1);
  EXPECT_EQ(json_["status"], "cannot-tell");
  EXPECT_GT(json_["smallest_detectable_blur_px"].get<double>(), 0.0001);
}

// An unknown bench offset leaves zf undetermined. The message reports this and how to determine it.
TEST_F(CameraVerifyTest, AnUnknownBenchZeroIsReported) {
  offset_mm_ = "unknown";
  const ProgramResult result = Verify(*shared_ / "camera.yaml", Sweep(2));
  EXPECT_NE(result.exit_code, 2) << result.err;
  EXPECT_THAT(result.out,
              AllOf(HasSubstr("bench offset is not stated"), HasSubstr("(same_bench)")));
}

TEST_F(CameraVerifyTest, ACameraWithoutCalibrationIsRefused) {
  model::Camera camera = model::ReadCamera(*shared_ / "camera.yaml");
  camera.calibration.reset();
  const std::string bare = folder_.Put("bare.yaml", model::CameraToYaml(camera));
  const ProgramResult result = Verify(bare, Sweep(2));
  EXPECT_EQ(result.exit_code, 1);
  EXPECT_EQ(json_["status"], "refused");
  EXPECT_THAT(result.err, HasSubstr("bare.yaml: calibration is missing"));
  EXPECT_EQ(Run({"camera", "verify", bare}).exit_code, 2);
}

}  // namespace
}  // namespace thicklens::tools
