// Hard cases of optics: cameras and depths near the limits of what is possible.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <functional>
#include <limits>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "thicklens/base/error.h"
#include "thicklens/base/output_file.h"
#include "thicklens/model/camera.h"
#include "tools/stress/stress_suite.h"
#include "tools/stress/stress_views.h"

namespace thicklens::tools {
namespace {

namespace fs = std::filesystem;

// The content of a camera file. The fields are texts, so that impossible values can be written,
// too.
struct StressCamera {
  double front_focal_length_mm = 12.5, rear_focal_length_mm = 12.8, lens_thickness_mm = 3;
  double aperture_radius_mm = 4.46, pixel_pitch_mm = 0.006;
  double image_distance_mm = 15.94;
  double blur_ratio = 0.45;
  double principal_x_px = 19.5;

  StressCamera Scaled(double factor) const {
    StressCamera scaled = *this;
    for (double* length :
         {&scaled.front_focal_length_mm, &scaled.rear_focal_length_mm, &scaled.lens_thickness_mm,
          &scaled.aperture_radius_mm, &scaled.pixel_pitch_mm, &scaled.image_distance_mm}) {
      *length *= factor;
    }
    return scaled;
  }
};

const char kCameraFile[] = "camera.yaml";

void WriteCamera(const fs::path& folder, const StressCamera& camera,
                 const std::string& name = kCameraFile) {
  WriteFileAtomically(
      (folder / name).string(),
      fmt::format("schema: thicklens/camera/2\nname: hard\n"
                  "lens: {{front_focal_length_mm: {}, rear_focal_length_mm: {}, "
                  "lens_thickness_mm: {}, aperture_radius_mm: {}}}\n"
                  "sensor: {{width_px: 40, height_px: 30, pixel_pitch_mm: {}, "
                  "principal_point_px: [{}, 14.5], transfer: linear}}\n"
                  "calibration:\n  image_distance_mm: {{value: {}, sigma: 0}}\n"
                  "  blur_ratio: {{value: {}, sigma: 0}}\n  evidence: {{method: assumed}}\n",
                  camera.front_focal_length_mm, camera.rear_focal_length_mm,
                  camera.lens_thickness_mm, camera.aperture_radius_mm, camera.pixel_pitch_mm,
                  camera.principal_x_px, camera.image_distance_mm, camera.blur_ratio));
}

// The oracle: the height on the sensor of the ray from the point on the axis at that depth through
// the rim of the aperture, refracted by the matrix of a lens between two media; in long double.
double TracedBlurRadiusMm(const StressCamera& camera, double depth_mm) {
  const long double height = camera.aperture_radius_mm;
  const long double slope = std::isinf(depth_mm) ? 0.0L : height / depth_mm;
  const long double after = slope * camera.front_focal_length_mm / camera.rear_focal_length_mm -
                            height / camera.rear_focal_length_mm;
  const long double rear_distance =
      static_cast<long double>(camera.image_distance_mm) - camera.lens_thickness_mm;
  return static_cast<double>(std::abs(height + rear_distance * after));
}

// Returns the relative error of the reported plane of focus, without the part that the rounding of
// d1 and rho explains.
double FocusError(const StressCamera& camera, const nlohmann::json& focus_depth_mm) {
  const long double rear_distance =
      static_cast<long double>(camera.image_distance_mm) - camera.lens_thickness_mm;
  const long double beyond = rear_distance - camera.rear_focal_length_mm;
  const auto open = static_cast<double>(
      std::abs(4 * std::numeric_limits<double>::epsilon() * camera.image_distance_mm / beyond));
  // Rounding decides whether it is at infinity or only very far.
  constexpr double kVeryFarMm = 1e12;
  if (!(open < 1)) {
    return focus_depth_mm.is_number() && !(focus_depth_mm.get<double>() > kVeryFarMm) ? 1 : 0;
  }
  if (!focus_depth_mm.is_number()) throw Error("no plane of focus is reported");
  const auto truth = static_cast<double>(camera.front_focal_length_mm * rear_distance / beyond);
  return std::max(0.0, std::abs(focus_depth_mm.get<double>() / truth - 1) - open);
}

// Runs `explain` between two depths. Its blur radii are compared with the ray trace: the largest
// difference counts, each divided by the larger of its own radius and the aperture's. The plane of
// focus is compared with [S13] in long double, relative to the effect of rounding D.
StressRun ExplainBetween(const StressCamera& camera, const std::string& depths,
                         const std::string& file = kCameraFile) {
  StressRun run;
  run.arguments = {"explain", file, "--depth-range", depths, "--steps", "5"};
  run.required = Solved(
      [camera](const fs::path&, const nlohmann::json& summary) {
        if (summary.at("depths").size() != 5) throw Error("five depths were requested");
        double most = 0;
        for (const nlohmann::json& row : summary["depths"]) {
          const double depth_mm =
              row.at("depth_mm").is_null() ? HUGE_VAL : row["depth_mm"].get<double>();
          const double traced_mm = TracedBlurRadiusMm(camera, depth_mm);
          const auto given_mm = row.at("blur_radius_mm").get<double>();
          if (!std::isfinite(given_mm)) throw Error("a blur radius is not finite");
          most = std::max(most, std::abs(given_mm - traced_mm) /
                                    std::max(traced_mm, camera.aperture_radius_mm));
        }
        return std::max(most, FocusError(camera, summary.at("focus_depth_mm")));
      },
      1e-9);
  return run;
}

StressRun ExplainRefused(std::vector<std::string> words) {
  StressRun run;
  run.arguments = {"explain", kCameraFile, "--depth-range", "500:2000"};
  run.required = Refused(std::move(words));
  return run;
}

StressCase Optics(
    std::string name, std::string why, std::string required,
    std::function<std::vector<StressRun>(const fs::path&, const Capabilities&)> prepare) {
  return {"optics/" + std::move(name), std::move(why), std::move(required), std::move(prepare)};
}

const char kTraced[] =
    "the blur radii and the plane of focus of explain equal those of a traced ray, to 1e-9";

// Explains one camera, or several, between the same depths.
StressCase Explained(std::string name, std::string why, const std::vector<StressCamera>& cameras,
                     const std::vector<std::string>& depths) {
  return Optics(std::move(name), std::move(why), kTraced,
                [=](const fs::path& folder, const Capabilities&) {
                  std::vector<StressRun> runs;
                  for (std::size_t i = 0; i < cameras.size(); ++i) {
                    const std::string file = fmt::format("camera-{}.yaml", i);
                    WriteCamera(folder, cameras[i], file);
                    for (const std::string& between : depths) {
                      runs.push_back(ExplainBetween(cameras[i], between, file));
                    }
                  }
                  return runs;
                });
}

StressCase CameraRefused(std::string name, std::string why, std::string required,
                         const StressCamera& camera, const std::vector<std::string>& words) {
  return Optics(std::move(name), std::move(why), std::move(required),
                [=](const fs::path& folder, const Capabilities&) {
                  WriteCamera(folder, camera);
                  return std::vector<StressRun>{ExplainRefused(words)};
                });
}

// Explains cameras whose measured PSF is none; each is named by its file.
StressCase PsfRefused() {
  return Optics(
      "measured-psf-that-is-none",
      "psf_file has rows of unequal length, a negative share, no light, and light on one side",
      "refused with the place in the file and what would be right",
      [](const fs::path& folder, const Capabilities&) {
        struct Wrong {
          const char* name;
          const char* light;
          std::vector<std::string> words;
        };
        const std::vector<Wrong> wrong = {
            {"not-square", "[[0, 1, 0], [1, 1], [0, 1, 0]]", {"psf.yaml:3", "must be square"}},
            {"negative", "[[0, 1, 0], [1, -1, 1], [0, 1, 0]]", {"psf.yaml:3", "light[1][1]"}},
            {"dark", "[[0, 0, 0], [0, 0, 0], [0, 0, 0]]", {"psf.yaml:3", "a sum > 0"}},
            {"off-centre", "[[1, 0, 0], [1, 0, 0], [1, 0, 0]]", {"psf.yaml:3", "off-centre"}}};
        std::vector<StressRun> runs;
        for (const Wrong& one : wrong) {
          const std::string camera = std::string(one.name) + "-camera.yaml";
          const std::string psf = std::string(one.name) + "-psf.yaml";
          WriteCamera(folder, StressCamera(), camera);
          WriteFileAtomically((folder / camera).string(),
                              ReadWholeFile((folder / camera).string()) +
                                  fmt::format("psf: measured\npsf_file: {}\n", psf));
          WriteFileAtomically(
              (folder / psf).string(),
              fmt::format("schema: thicklens/psf/1\nstep: 0.5\nlight: {}\n", one.light));
          StressRun run = ExplainRefused(one.words);
          run.arguments[1] = camera;
          runs.push_back(std::move(run));
        }
        return runs;
      });
}

template <typename Change>
StressCamera Changed(const Change& change) {
  StressCamera camera;
  change(&camera);
  return camera;
}

std::vector<StressCase> Lenses() {
  const std::vector<std::string> usual = {"500:2000"};
  std::vector<StressCase> cases;
  std::vector<StressCamera> at_infinity;
  for (const double beyond_mm : {0.0, 1e-12, 1e-9, 1e-6, 1e-3}) {
    at_infinity.push_back(
        Changed([&](StressCamera* camera) { camera->image_distance_mm = 15.8 + beyond_mm; }));
  }
  cases.push_back(
      Explained("focus-at-infinity",
                "D - f2 is 1e-3 to 1e-12 mm, and 0: the plane of focus is as far as infinity",
                at_infinity, {"500:2000", "500:inf"}));
  cases.push_back(
      CameraRefused("sensor-before-every-image", "D < f2: no depth is in focus",
                    "refused: the file, the field, and its limit",
                    Changed([](StressCamera* camera) { camera->image_distance_mm = 15.7; }),
                    {"camera.yaml:", "image_distance_mm", "15.8", "15.7"}));
  cases.push_back(Explained("object-at-front-focus",
                            "z = f1: its image is at infinity, its blur the "
                            "aperture",
                            {StressCamera()}, {"12.5:1000"}));
  cases.push_back(Explained("object-within-front-focus", "z < f1: it has no real image",
                            {StressCamera()}, {"6:1000", "1e-3:1000"}));
  cases.push_back(Explained("object-very-far", "z = 1e9 mm and 1e300 mm", {StressCamera()},
                            {"500:1e9", "1e9:1e10", "500:1e300"}));
  cases.push_back(Explained("focal-lengths-differ",
                            "one side of the lens in water, or oil: f2/f1 "
                            "up to 1.5",
                            {Changed([](StressCamera* camera) {
                               camera->rear_focal_length_mm = 16.6;
                               camera->image_distance_mm = 19.8;
                             }),
                             Changed([](StressCamera* camera) {
                               camera->rear_focal_length_mm = 18.75;
                               camera->image_distance_mm = 22;
                             })},
                            usual));
  cases.push_back(Explained("crossed-planes", "rho is negative, down to nearly -f2",
                            {Changed([](StressCamera* camera) {
                               camera->lens_thickness_mm = -5;
                               camera->image_distance_mm = 7.94;
                             }),
                             Changed([](StressCamera* camera) {
                               camera->lens_thickness_mm = -12.7;
                               camera->image_distance_mm = 0.3;
                             })},
                            usual));
  cases.push_back(Explained("thickness-nearly-image-distance",
                            "rho = 15.9 of d1 = 15.91 mm: hardly anything remains behind the lens",
                            {Changed([](StressCamera* camera) {
                              camera->lens_thickness_mm = 15.9;
                              camera->rear_focal_length_mm = 0.01;
                              camera->image_distance_mm = 15.91001;
                            })},
                            usual));
  cases.push_back(Explained(
      "pinhole", "aperture radius 1e-12 mm: no blur",
      {Changed([](StressCamera* camera) { camera->aperture_radius_mm = 1e-12; })}, usual));
  cases.push_back(CameraRefused(
      "no-aperture", "aperture radius 0: no light", "refused: the file, the field, and its limit",
      Changed([](StressCamera* camera) { camera->aperture_radius_mm = 0; }),
      {"camera.yaml:", "aperture_radius_mm", "> 0"}));
  cases.push_back(Explained("lengths-times-a-millionth", "all lengths times 1e-6",
                            {StressCamera().Scaled(1e-6)}, {"5e-4:2e-3"}));
  cases.push_back(Explained("lengths-times-a-million", "all lengths times 1e6",
                            {StressCamera().Scaled(1e6)}, {"5e8:2e9"}));
  return cases;
}

const StressImage& Shape() {
  static const StressImage shape;
  return shape;
}

// The disparity of a plane at one depth for this camera: sigma = kappa r c/p along each axis equals
// the spread of the views' places, 2/3 of a step squared with three equal weights.
double DisparityPx(const StressCamera& camera, double depth_mm) {
  const double rear_mm = camera.image_distance_mm - camera.lens_thickness_mm;
  // Infinite if the rear distance is the focal length.
  const double beyond_mm = rear_mm - camera.rear_focal_length_mm;
  const double focus_mm =
      beyond_mm > 0 ? camera.front_focal_length_mm * rear_mm / beyond_mm : HUGE_VAL;
  const double sigma_px =
      camera.blur_ratio * TracedBlurRadiusMm(camera, depth_mm) / camera.pixel_pitch_mm;
  return (depth_mm < focus_mm ? 1 : -1) * sigma_px / std::sqrt(2.0 / 3);
}

std::vector<std::string> WithCamera() {
  return {"--camera", kCameraFile, "--aperture-shape", "uniform", "--without", "falloff"};
}

// Runs `estimate` with depth in mm, with the scene solver and its alternatives.
std::vector<StressRun> EstimatesOfDepth(const std::vector<std::string>& more,
                                        const Requirement& required) {
  std::vector<StressRun> runs;
  for (const char* solver : {"scene", "functional", "grid", "blocks"}) {
    std::vector<std::string> arguments = WithCamera();
    arguments.insert(arguments.end(), more.begin(), more.end());
    arguments.insert(arguments.end(), {"--solver", solver});
    StressRun run = EstimateOf(Shape(), arguments, required);
    const auto kind = std::find(run.arguments.begin(), run.arguments.end(), "disparity");
    *kind = "z";
    run.arguments.insert(kind + 1, {"--depth-unit", "mm"});
    runs.push_back(std::move(run));
  }
  return runs;
}

// If ST is not the plane of focus, the views are shifted by the blur of a point on ST.
StressCase EstimatedPlane(std::string name, std::string why, const StressCamera& camera,
                          double depth_mm, double limit, std::optional<double> st_depth_mm = {}) {
  return Optics(std::move(name), std::move(why),
                fmt::format("views differ from the true ones by at most {:g} of full scale, rms, "
                            "without a border of 8 px",
                            limit),
                [=](const fs::path& folder, const Capabilities&) {
                  const double disparity_px = DisparityPx(camera, depth_mm);
                  WriteCamera(folder, camera);
                  WriteMeanOfViews(folder, Shape(), SlantedSurface(Waves, disparity_px, 0));
                  WriteDepth(folder, Shape(), [&](int, int) { return depth_mm; });
                  std::vector<std::string> more;
                  double st_disparity_px = 0;
                  if (st_depth_mm) {
                    more = {"--st-depth-mm", fmt::format("{}", *st_depth_mm)};
                    st_disparity_px = DisparityPx(camera, *st_depth_mm);
                  }
                  const ViewOf view = SlantedSurface(Waves, disparity_px - st_disparity_px, 0);
                  return EstimatesOfDepth(more, ViewsAre(Shape(), view, kTruthBorderPx, limit));
                });
}

StressCase EstimateRefused(std::string name, std::string why, std::string required,
                           const StressCamera& camera, double depth_mm,
                           const std::vector<std::string>& words) {
  return Optics(std::move(name), std::move(why), std::move(required),
                [=](const fs::path& folder, const Capabilities&) {
                  WriteCamera(folder, camera);
                  WriteImage(folder, Shape(), Waves);
                  WriteDepth(folder, Shape(), [&](int, int) { return depth_mm; });
                  return EstimatesOfDepth({}, Refused(words));
                });
}

std::vector<StressCase> Estimates() {
  const StressCamera usual;
  std::vector<StressCase> cases;
  cases.push_back(PsfRefused());
  cases.push_back(EstimatedPlane("estimate-usual", "the camera of the cases below: not hard", usual,
                                 900, 0.025));
  cases.push_back(EstimatedPlane("estimate-in-focus", "the scene lies in the plane of focus", usual,
                                 12.5 * 12.94 / (12.94 - 12.8), 0.005));
  cases.push_back(EstimatedPlane("estimate-no-blur-ratio", "kappa is 0: all views are equal",
                                 Changed([](StressCamera* camera) { camera->blur_ratio = 0; }), 900,
                                 0.005));
  cases.push_back(EstimatedPlane("estimate-hardly-a-blur-ratio", "kappa is 1e-12",
                                 Changed([](StressCamera* camera) { camera->blur_ratio = 1e-12; }),
                                 900, 0.005));
  cases.push_back(EstimatedPlane(
      "estimate-pinhole", "aperture radius 1e-12 mm",
      Changed([](StressCamera* camera) { camera->aperture_radius_mm = 1e-12; }), 900, 0.005));
  cases.push_back(EstimatedPlane(
      "estimate-principal-point-off-the-sensor", "the optical axis misses the image by 1000 px",
      Changed([](StressCamera* camera) { camera->principal_x_px = 1000; }), 900, 0.025));
  cases.push_back(EstimatedPlane("estimate-lengths-times-1e-6", "all lengths times 1e-6",
                                 usual.Scaled(1e-6), 900e-6, 0.025));
  cases.push_back(EstimatedPlane("estimate-lengths-times-1e6", "all lengths times 1e6",
                                 usual.Scaled(1e6), 900e6, 0.025));
  cases.push_back(EstimatedPlane("estimate-focus-at-infinity",
                                 "no plane of focus for ST: it is given at 1000 mm",
                                 Changed([](StressCamera* camera) {
                                   camera->image_distance_mm = 15.8;
                                   camera->aperture_radius_mm = 0.5;
                                 }),
                                 2000, 0.01, 1000));
  cases.push_back(EstimateRefused(
      "estimate-focus-at-infinity-without-planes", "no plane of focus for ST, and none is given",
      "refused: planes must be given",
      Changed([](StressCamera* camera) { camera->image_distance_mm = 15.8; }), 900,
      {"camera.yaml", "focused at infinity", "--st-depth-mm"}));
  cases.push_back(EstimateRefused("estimate-depth-within-front-focus", "z < f1: no real image",
                                  "refused: the file, its depths, and the front focal point", usual,
                                  5,
                                  {"depth.pfm", "beyond the camera's front focal point", "12.5"}));
  cases.push_back(EstimateRefused("estimate-depth-at-front-focus", "z = f1",
                                  "refused: the file, its depths, and the front focal point", usual,
                                  12.5,
                                  {"depth.pfm", "beyond the camera's front focal point", "12.5"}));
  cases.push_back(
      EstimateRefused("estimate-depth-very-far", "z = 1e9 mm",
                      "refused: the file, its depths, and that their unit is most likely "
                      "wrong",
                      usual, 1e9, {"depth.pfm", "1e+09", "unit"}));
  cases.push_back(EstimateRefused("estimate-depth-negative", "z = -900 mm",
                                  "refused: the file and its depths", usual, -900, {"depth.pfm"}));
  return cases;
}

// Runs `simulate light-field` for a plane, with UV at another depth.
StressCase Planes(std::string name, std::string why, std::string required, double uv_depth_mm,
                  double plane_depth_mm, const std::vector<std::string>& refusal,
                  bool all_views_alike = false) {
  return Optics(std::move(name), std::move(why), std::move(required),
                [=](const fs::path& folder, const Capabilities&) {
                  WriteCamera(folder, StressCamera());
                  WriteFileAtomically(
                      (folder / "scene.yaml").string(),
                      fmt::format("schema: thicklens/simulate-scene/1\ncamera: camera.yaml\n"
                                  "views: [3, 3]\nuv_depth_mm: {}\nlayers:\n"
                                  "  - plane: {{depth_mm: {}}}\n    texture: {{kind: noise}}\n",
                                  uv_depth_mm, plane_depth_mm));
                  StressRun run;
                  run.arguments = {"simulate", "light-field", "scene.yaml", "--format",
                                   "tiff",     "-o",          "views"};
                  run.output = "views";
                  if (!refusal.empty()) {
                    run.required = Refused(refusal);
                  } else {
                    StressImage shape;
                    shape.channels = 3;
                    run.required =
                        all_views_alike ? ViewsAreAlike(shape, 2e-4) : ViewsAreNumbers(shape);
                  }
                  return std::vector<StressRun>{run};
                });
}

std::vector<StressCase> LightFieldPlanes() {
  const double focus_mm = 12.5 * 12.94 / (12.94 - 12.8);
  std::vector<StressCase> cases;
  cases.push_back(Planes("uv-on-the-aperture",
                         "zl = 0: (8) is infinite there, the formula used here is not",
                         "all views are finite", 0, 900, {}));
  cases.push_back(Planes("object-on-st", "z = zl + d0: the slope of its rays is 0",
                         "all views are equal to 2e-4 of full scale", 0, focus_mm, {}, true));
  cases.push_back(Planes("object-on-uv",
                         "z = zl: the slope of its rays is infinite, each view sees "
                         "one point of it",
                         "all views are finite", 50, 50, {}));
  cases.push_back(Planes("planes-nearly-one", "d0 is 1e-9 mm", "refused: zl and the focus depth",
                         focus_mm - 1e-9, 900, {"uv_depth_mm"}));
  cases.push_back(Planes("uv-behind-focus",
                         "zl beyond the plane of focus: rays no longer separate "
                         "pixels",
                         "refused: zl, and that it must be below the focus depth", 2000, 900,
                         {"uv_depth_mm", "2000", "focus depth"}));
  return cases;
}

}  // namespace

std::vector<StressCase> OpticsStressCases() {
  std::vector<StressCase> all;
  for (std::vector<StressCase> part : {Lenses(), Estimates(), LightFieldPlanes()}) {
    for (StressCase& hard : part) all.push_back(std::move(hard));
  }
  return all;
}

}  // namespace thicklens::tools
