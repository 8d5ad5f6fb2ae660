#include "tools/options/estimate_call.h"

#include <fmt/format.h>

#include <memory>
#include <string>
#include <utility>
#include <variant>

#include "thicklens/distortion.h"
#include "thicklens/frames.h"
#include "thicklens/model/light_field_grid.h"
#include "tools/options/distortion_option.h"
#include "tools/options/embedded_depth.h"
#include "tools/options/estimate_plan.h"
#include "tools/options/option_values.h"

namespace thicklens::tools {
namespace {

Prior PriorOf(const std::string& name) {
  if (name == "ridge") return Prior::kRidge;
  if (name == "gradient") return Prior::kGradient;
  if (name == "patches") return Prior::kPatches;
  if (name == "tv") return Prior::kTotalVariation;
  throw UsageError("--prior: ridge, gradient, tv or patches is expected, found '" + name + "'");
}

SceneSolver SceneSolverOf(const EstimateOptions& options) {
  SceneSolver solver;
  if (options.prior) solver.prior = PriorOf(*options.prior);
  const std::string strength = options.strength.value_or("auto");
  if (strength == "gcv") {
    solver.strength_rule = StrengthRule::kGcv;
  } else if (strength != "auto") {
    solver.strength_rule = StrengthRule::kGiven;
    solver.strength = SplitNumbers("--strength", strength, ',', "auto, gcv or a number")[0];
  }
  solver.tolerance = options.tolerance;
  if (options.max_iterations) solver.max_iterations = *options.max_iterations;
  solver.double_precision = options.double_precision;
  solver.check_blur = options.check_blur;
  if (options.photo == "captured") solver.photo = PhotoKind::kCaptured;
  if (options.photo == "sharp") solver.photo = PhotoKind::kSharp;
  return solver;
}

BlockSolver::Linear LinearOf(const std::string& name) {
  using Linear = BlockSolver::Linear;
  for (const auto& [known, linear] :
       {std::pair("umfpack", Linear::kUmfpack), std::pair("cholmod", Linear::kCholmod),
        std::pair("eigen", Linear::kEigen), std::pair("cg", Linear::kCg),
        std::pair("bicgstab", Linear::kBicgstab)}) {
    if (name == known) return linear;
  }
  return Linear::kViennaCl;
}

BlockSolver BlockSolverOf(const EstimateOptions& options) {
  BlockSolver solver;
  if (options.block_solver) solver.linear = LinearOf(*options.block_solver);
  if (options.stencil == "paper") solver.stencil = BlockSolver::Stencil::kPaper;
  if (options.splat == "nearest") solver.splat = BlockSolver::Splat::kNearest;
  if (options.gamma) solver.gamma = *options.gamma;
  solver.ridge = options.ridge;
  solver.block_px = options.block_px;
  solver.tolerance = options.tolerance;
  solver.max_iterations = options.max_iterations;
  return solver;
}

GridSolver FunctionalSolverOf(const EstimateOptions& options) {
  GridSolver solver;
  if (options.gamma) solver.gamma = *options.gamma;
  solver.ridge = options.ridge;
  if (options.tolerance) solver.tolerance = *options.tolerance;
  if (options.max_iterations) solver.max_iterations = *options.max_iterations;
  solver.double_precision = options.double_precision;
  return solver;
}

std::optional<SensorOrigin> SensorOriginOf(const std::string& text) {
  if (text.empty()) return std::nullopt;
  const auto origin = SplitPixels("--sensor-origin", text, ',', "X,Y");
  if (origin.size() != 2) {
    throw UsageError(fmt::format("--sensor-origin: X,Y is expected, found '{}'", text));
  }
  return SensorOrigin{origin[0], origin[1]};
}

}  // namespace

OptionNames EstimateOptionNames() {
  return {{"views", "--views"},
          {"crop", "--crop"},
          {"hci_grid", "--grid"},
          {"allow_missing_views", "--sparse"},
          {"inner_views", "--views"},
          {"camera", "--camera"},
          {"correction", "--dark, --flat, --defects"},
          {"correction.dark", "--dark"},
          {"correction.flat", "--flat"},
          {"correction.defects", "--defects"},
          {"sensor_origin", "--sensor-origin"},
          {"lens_position", "--lens-position"},
          {"undistort", "--distortion none"},
          {"distortion", "--distortion"},
          {"exif", "--ignore-exif"},
          {"photo.transfer", "--transfer"},
          {"photo.orientation", "--orientation displayed"},
          {"aperture.shape", "--aperture-shape"},
          {"aperture", "--aperture-shape and --aperture-of"},
          {"st_depth_mm", "--st-depth-mm"},
          {"smooth_depth", "--keep-depth-noise"},
          {"refine_depth", "--refine-depth"},
          {"strict", "--strict"},
          {"effects", "--effects, --without"},
          {"effects.given", "--effects"},
          {"effects.without", "--without"},
          {"effects.tolerance", "--effect-tolerance"},
          {"depth.meaning.kind", "--depth-kind"},
          {"depth.meaning.unit", "--depth-unit"},
          {"depth.meaning.disparity_scale", "--disparity-scale"},
          {"depth.meaning.disparity_offset_px", "--disparity-offset"},
          {"depth.flip", "--depth-flip"},
          {"depth_fit.part", "--depth-crop"},
          {"depth_fit.camera", "--depth-camera"},
          {"depth_fit.min_confidence", "--min-confidence"},
          {"depth.meaning.inverse_scale_dpt", "--inverse-scale"},
          {"depth.meaning.inverse_offset_dpt", "--inverse-offset"},
          {"depth.near_mm", "--depth-near"},
          {"depth.far_mm", "--depth-far"},
          {"depth.holes", "--hole-value"},
          {"depth.holes.zero_is_value", "--zero-is value"},
          {"depth.holes.largest_is_value", "--largest-is value"},
          {"hidden_rays", "--fill"},
          {"form", "--store"},
          {"device", "--device"},
          {"memory_limit_mib", "--memory-limit"},
          {"solver", "--solver"},
          {"solver.prior", "--prior"},
          {"solver.strength", "--strength"},
          {"solver.photo", "--photo"},
          {"clipped", "--clipped"},
          {"solver.tolerance", "--tolerance"},
          {"solver.max_iterations", "--max-iterations"},
          {"solver.gamma", "--gamma"},
          {"solver.ridge", "--ridge"},
          {"solver.block_px", "--block-px"}};
}

SolverOptions SolverOf(const EstimateOptions& options) {
  if (options.solver == "scene") return SceneSolverOf(options);
  if (options.by_blocks()) return BlockSolverOf(options);
  const GridSolver functional = FunctionalSolverOf(options);
  if (options.solver == "grid") return functional;
  return static_cast<const FunctionalSolver&>(functional);
}

SolverChoice SolverOf(const estimator::EstimatePlan& plan) {
  EstimateOptions options;
  ApplyPlan(plan, &options);
  return {SolverOf(options), options.device};
}

AnySolver AsAnySolver(const SolverOptions& solver) {
  return std::visit([](const auto& one) { return AnySolver(one); }, solver);
}

thicklens::EstimateOptions SettingsOf(const EstimateOptions& options) {
  thicklens::EstimateOptions settings;
  if (const auto [u_count, v_count] = ViewCounts(options.views); u_count > 0) {
    settings.views = {u_count, v_count};
  }
  settings.crop = CropRect(options.crop);
  settings.sensor_origin = SensorOriginOf(options.sensor_origin);
  settings.lens_position = options.lens_position;
  settings.undistort = options.distortion != kUndistorted;
  if (options.ignore_exif) settings.exif = ExifCheck::kIgnore;
  if (!options.aperture_shape.empty()) {
    settings.aperture.shape = model::ApertureShapeFromName(options.aperture_shape);
  }
  settings.st_depth_mm = options.st_depth_mm;
  settings.depth_fit = DepthFitOf(options.depth_fit);
  settings.smooth_depth = !options.keep_depth_noise;
  if (options.clipped == "data") settings.clipped = ClippedHighlights::kData;
  if (options.refine_depth == "on") settings.refine_depth = DepthRefining::kOn;
  if (options.refine_depth == "off") settings.refine_depth = DepthRefining::kOff;
  settings.strict = options.strict;
  settings.effects = EffectSelectionOf(options.effects);
  settings.solver = AsAnySolver(SolverOf(options));
  if (options.stores_scene()) settings.form = LightFieldForm::kScene;
  if (options.fill == "telea") settings.hidden_rays = HiddenRays::kTelea;
  settings.device = options.device;
  settings.memory_limit_mib = options.memory_limit_mib;
  // The number of views is checked once those of --aperture-of are known.
  thicklens::EstimateOptions checked = settings;
  if (!options.aperture_of.empty()) checked.views.reset();
  std::string why;
  if (!checked.IsValid(&why)) {
    throw UsageErrorOf(OptionError(why.substr(0, why.find(':')), why), EstimateOptionNames());
  }
  return settings;
}

EstimateCall ReadEstimateCall(const EstimateOptions& options, const RunControl& run) {
  EstimateCall call;
  call.settings = SettingsOf(options);
  ImageReadOptions how;
  if (!options.transfer.empty()) how.transfer = TransferCurve::FromName(options.transfer);
  if (options.orientation == "displayed") how.orientation = Orientation::kDisplayed;
  call.photo = ReadImage(options.image_path, how);
  call.depth = options.depth_path.empty()
                   ? DepthInsidePhoto(options, call.photo.width_px(), call.photo.height_px())
                   : ReadDepth(options.depth_path, DepthMeaningOf(options.depth),
                               DepthReadOptionsOf(options.depth),
                               DepthRun("the same command without a depth map"));
  ReadConfidenceInto(options.depth_fit, &call.depth);
  if (!options.depth_fit.camera_path.empty()) {
    call.settings.depth_fit.camera =
        std::make_shared<const DepthCamera>(ReadDepthCamera(options.depth_fit.camera_path));
  }
  if (!options.camera_path.empty()) call.camera = ReadCamera(options.camera_path);
  if (call.settings.undistort && !options.distortion.empty()) {
    const model::Sensor& sensor = call.camera->sensor;
    call.camera->distortion =
        ReadLensDistortion(options.distortion, sensor.width_px, sensor.height_px, run);
    std::string why;
    if (!call.camera->IsValid(&why)) throw Error("--distortion: " + why);
  }
  call.photo = CorrectPhotograph(call.photo, options.correction, TransferOf(call), run);
  if (options.aperture_of.empty()) return call;
  LightFieldReadOptions reading;
  reading.hci_grid = options.grid;
  reading.allow_missing_views = options.sparse;
  reading.inner_views = call.settings.views;
  call.settings.aperture.views_of =
      std::make_shared<const ApertureViews>(ReadApertureViews(options.aperture_of, reading, run));
  return call;
}

TransferCurve TransferOf(const EstimateCall& call) {
  if (call.photo.transfer()) return *call.photo.transfer();
  if (call.camera) return call.camera->sensor.transfer;
  return call.photo.StatedTransfer().value_or(TransferCurve::Srgb());
}

Problem PrepareProblemOf(const EstimateOptions& options) {
  const CommandRun run(options.common, EstimateOptionNames());
  return WithOptionNames(run.names(), [&] {
    EstimateCall call = ReadEstimateCall(options, run.control());
    return PrepareProblem(std::move(call.photo), std::move(call.depth), call.camera, call.settings,
                          nullptr, run.control());
  });
}

}  // namespace thicklens::tools
