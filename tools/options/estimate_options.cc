#include "tools/options/estimate_options.h"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <filesystem>
#include <system_error>
#include <utility>

#include "thicklens/base/error.h"
#include "thicklens/estimator/block_solver.h"
#include "thicklens/estimator/functional_solver.h"
#include "thicklens/estimator/scene_solver.h"
#include "tools/options/deprecated_names.h"
#include "tools/options/help_format.h"
#include "tools/options/option_values.h"
#include "tools/options/quality_target_options.h"

namespace thicklens::tools {
namespace {

namespace fs = std::filesystem;

constexpr char kReportName[] = "index.html";
constexpr char kRunGroup[] = "Run";
constexpr int kMaxIterations = 1000000;

std::optional<double> PositiveNumber(const std::string& text) {
  double value = 0;
  const char* end = text.data() + text.size();
  const auto [read, failure] = std::from_chars(text.data(), end, value);
  if (failure != std::errc() || read != end || !(value > 0) || !std::isfinite(value)) {
    return std::nullopt;
  }
  return value;
}

CLI::Validator IsStrength() {
  return {[](std::string& given) {
            if (given == "auto" || given == "gcv" || PositiveNumber(given)) return std::string();
            return fmt::format("auto, gcv or a number above 0 is expected, found '{}'", given);
          },
          ""};
}

// A shell variable that was never set gives an empty text.
CLI::Validator NotEmpty(const std::string& what) {
  return {[what](std::string& given) {
            return given.empty() ? what + " is expected, found ''" : std::string();
          },
          ""};
}

void AddInputOptions(CLI::App* command, EstimateOptions* options) {
  command->add_option("image", options->image_path, "The photograph (PNG, JPEG or TIFF)")
      ->required()
      ->type_name("IMAGE");
  command
      ->add_option(
          "depth", options->depth_path,
          "Its depth map, of any size with the same aspect ratio (others: --depth-crop, "
          "--depth-camera); default: the one inside the photograph's file, as phones store it")
      ->type_name("DEPTH");
  AddDepthOptions(command, "Required with DEPTH", &options->depth, true);
  AddDepthFitOptions(command, &options->depth_fit);
  command
      ->add_option("--camera", options->camera_path,
                   "The calibrated camera; optional if the depth map holds disparities")
      ->type_name("CAMERA.yaml");
  command
      ->add_option("--transfer", options->transfer,
                   "How light became encoded values: linear, srgb or gamma-G; default: as the "
                   "camera file states; without a camera as the photograph's file states, or srgb")
      ->check(TransferCurveName())
      ->type_name("NAME");
  command
      ->add_option("--orientation", options->orientation,
                   "stored: the photograph's pixels as they are in the file (default); displayed: "
                   "turned as its EXIF states, for a depth map that is turned alike; not with "
                   "--camera")
      ->check(CLI::IsMember({"stored", "displayed"}))
      ->type_name("HOW");
  AddCropOption(command, &options->crop);
  command
      ->add_option("--sensor-origin", options->sensor_origin,
                   "Position on the camera's sensor of an image that is a part of it, px")
      ->type_name("X,Y");
  command
      ->add_option("--lens-position", options->lens_position,
                   "Position of the lens or its motor, in the unit of the camera file's "
                   "focus_positions; default: as the photograph's metadata state it, or that of "
                   "the calibration")
      ->type_name("P");
  command
      ->add_option("--distortion", options->distortion,
                   "Lens distortion that is taken out of photograph and depth map: a file of "
                   "OpenCV, ROS, Kalibr, COLMAP or mrcal, FILE:CAMERA in a file of several, or "
                   "none for images that are undistorted already; default: that of the camera file")
      ->type_name("FILE[:CAMERA]");
  command
      ->add_option("--dark", options->correction.dark,
                   "Exposures without light, which are averaged and subtracted from the photograph "
                   "in linear light; IMAGE and DEPTH are given before it")
      ->type_name("FILE...");
  command
      ->add_option("--flat", options->correction.flat,
                   "Exposures of an even surface, which are averaged, less the dark, and divided "
                   "by their mean; the photograph is divided by them")
      ->type_name("FILE...");
  command
      ->add_option("--defects", options->correction.defects,
                   "Defective pixels, which are interpolated: an image that is not 0 there, or a "
                   "list of x and y")
      ->type_name("FILE...");
  command->add_flag("--ignore-exif", options->ignore_exif,
                    "Continue even if the EXIF of the photograph states another lens, setting or "
                    "sensor than the camera file");
  AddApertureShapeOption(command, &options->aperture_shape);
  command
      ->add_option(
          "--aperture-of", options->aperture_of,
          "Take the views, and which of them the photograph saw, from this light field, with their "
          "weights if its lightfield.yaml states them, otherwise with those of --aperture-shape")
      ->type_name("LF");
  command
      ->add_option("--grid", options->grid, "For --aperture-of: views per row in the HCI numbering")
      ->check(CLI::Range(1, 1000))
      ->type_name("N");
  command->add_flag("--sparse", options->sparse, "For --aperture-of: accept missing views");
}

void AddQualityOptions(CLI::App* command, EstimateOptions* options) {
  AddQualityTargetOptions(command, &options->quality_target);
  command
      ->add_option("--profile", options->profile_path,
                   "Profile for --quality, --within and --psnr-loss, as bench accuracy "
                   "--save-profile writes it; default: your own, or the one that ships")
      ->type_name("FILE");
  command
      ->add_option("--prior", options->prior,
                   "Regularisation prior of the radiance (solver scene): ridge, gradient, tv "
                   "(total variation, default) or patches (tv plus few frequencies per patch and "
                   "shading that follows the relief of the depth: better but slower if depth and "
                   "camera explain the image well)")
      ->check(CLI::IsMember({"ridge", "gradient", "tv", "patches"}))
      ->type_name("NAME");
  command
      ->add_option("--strength", options->strength,
                   "Weight of the prior (solver scene): auto (from the image's noise, default), "
                   "gcv (cross-validation) or a number")
      ->check(IsStrength())
      ->type_name("RULE");
  command->add_flag("--check-blur", options->check_blur,
                    "Check whether a narrower blur or another plane of focus fits the photograph "
                    "better than camera and depth, and propose it (solver scene); costs one more "
                    "solve at half the size, and seven to seventeen if something may be wrong");
  command
      ->add_option(
          "--photo", options->photo,
          "How wide the aperture of the photograph was (solver scene): captured (as camera "
          "and views state), sharp (a pinhole: sharp at all depths) or auto (measured from "
          "the photograph, default)")
      ->check(CLI::IsMember({"captured", "sharp", "auto"}))
      ->type_name("KIND");
  command
      ->add_option("--clipped", options->clipped,
                   "What clipped values of the photograph are: bounds (the light is at least that, "
                   "solver scene) or data (the light itself)")
      ->check(CLI::IsMember({"bounds", "data"}))
      ->capture_default_str()
      ->type_name("WHAT");
  command->add_flag("--strict", options->strict,
                    "Refuse where the result would be partial: the photograph contradicts the "
                    "depth, or the iterations do not converge");
  command->add_flag("--keep-depth-noise", options->keep_depth_noise,
                    "Disable depth denoising, which smooths the depth along surfaces");
  command
      ->add_option("--refine-depth", options->refine_depth,
                   "Repair the depth map by the photograph (edges that are wide or displaced, "
                   "blocks, steps, outliers, filled holes): auto (the faults that map and "
                   "photograph show for certain, default), on (also probable ones) or off")
      ->check(CLI::IsMember({"auto", "on", "off"}))
      ->type_name("WHETHER");
  command
      ->add_option("--fill", options->fill,
                   "Fill of areas that the centre view does not show: by the solver, or by the "
                   "paper's inpainting (telea) view by view, for comparison")
      ->check(CLI::IsMember({"solver", "telea"}))
      ->capture_default_str()
      ->type_name("NAME");
  AddEffectOptions(command, &options->effects);
}

void AddOutputOptions(CLI::App* command, EstimateOptions* options) {
  command->add_option("-o,--output", options->output_folder, "Folder for the light field")
      ->required()
      ->type_name("LF");
  AddViewsOption(command, &options->views, "Number of views across and down; default 7x7");
  command
      ->add_option(
          "--store", options->store,
          "How the light field is stored: scene (light and disparity of the points that "
          "the centre view shows, in three files, from which every view follows), views "
          "(an image file for each), or auto (scene, unless --format, --fill telea, another "
          "solver or a target of time or quality asks for views)")
      ->check(CLI::IsMember({"auto", "scene", "views"}))
      ->capture_default_str()
      ->type_name("FORM");
  command
      ->add_option(
          "--format", options->format,
          "Format of views that are stored: png (16 bit, encoded values), tiff (float, linear "
          "light, which "
          "keeps what is brighter than full scale) or auto (tiff if highlights of the photograph "
          "are clipped and estimated, otherwise png)")
      ->check(CLI::IsMember({"auto", "png", "tiff"}))
      ->capture_default_str()
      ->type_name("NAME");
  command
      ->add_option("--st-depth-mm", options->st_depth_mm,
                   "Depth of the ST plane (UV is the aperture); default: the plane of focus")
      ->check(Between(0, 1e9, "millimetres"))
      ->type_name("MM");
  command
      ->add_option("--report", options->report_folder,
                   "Folder for index.html, a page that shows the estimate and what it knows of "
                   "itself")
      ->type_name("DIR");
}

void AddSolverOptions(CLI::App* command, EstimateOptions* options) {
  command
      ->add_option("--solver", options->solver,
                   "scene: solves for the whole image at once. For comparison: blocks, the "
                   "paper's method, block by block; functional and grid, the paper's functional "
                   "for the whole image, on the rays of scene points or of the views")
      ->check(CLI::IsMember({"scene", "blocks", "functional", "grid"}))
      ->capture_default_str()
      ->type_name("NAME");
}

void AddFunctionalOptions(CLI::App* command, EstimateOptions* options) {
  const estimator::FunctionalOptions usual;
  command
      ->add_option("--gamma", options->gamma,
                   fmt::format("Weight of the smoothness along scene points (solvers blocks, "
                               "functional, grid); default {:g}",
                               usual.gamma))
      ->check(Finite())
      ->type_name("X");
  command
      ->add_option("--ridge", options->ridge,
                   "Weight mu of the distance to the warped image (solvers blocks, functional, "
                   "grid); default 0.01/(U V)")
      ->check(Finite())
      ->type_name("X");
}

void AddIterationOptions(CLI::App* command, EstimateOptions* options) {
  const estimator::SceneOptions scene;
  const estimator::FunctionalOptions functional;
  command
      ->add_option("--tolerance", options->tolerance,
                   fmt::format("Relative residual at which iterative solvers stop; default {:g} "
                               "(scene with tv), {:g} (blocks) or {:g}",
                               scene.tolerance_or_usual(), estimator::BlockOptions().tolerance,
                               functional.tolerance))
      ->check(Inside(0, 1, "a relative residual"))
      ->type_name("X");
  command
      ->add_option("--max-iterations", options->max_iterations,
                   fmt::format("Maximum number of iterations: in total (scene; default {}; patches "
                               "uses as many again for fine relief), for each channel (default "
                               "{}), or for each block (default {})",
                               scene.max_iterations, functional.max_iterations,
                               estimator::BlockOptions().max_iterations))
      ->check(CLI::Range(1, kMaxIterations))
      ->type_name("N");
  command->add_flag("--double", options->double_precision,
                    "Compute in double precision (solvers scene, functional, grid)");
}

void AddBlockOptions(CLI::App* command, EstimateOptions* options) {
  const std::string usual = estimator::BlockSolverName(estimator::DefaultBlockSolver());
  command
      ->add_option("--block-solver", options->block_solver,
                   fmt::format("Solver of each block (solver blocks): umfpack, cholmod or eigen; "
                               "iterative, for comparison: cg, bicgstab or viennacl; default {}",
                               usual))
      ->check(CLI::IsMember({"umfpack", "cholmod", "eigen", "cg", "bicgstab", "viennacl"}))
      ->type_name("NAME");
  command
      ->add_option(
          "--block-px", options->block_px,
          "Edge of a block (solver blocks); default 16, or the largest that --memory-limit allows")
      ->check(CLI::Range(1, 100000))
      ->type_name("PX");
  CLI::Option* stencil =
      command
          ->add_option("--stencil", options->stencil,
                       "Stencil of the smoothness (solver blocks): warp (default), or paper: the "
                       "six differences of the paper's method")
          ->check(CLI::IsMember({"warp", "paper"}))
          ->type_name("NAME");
  AcceptDeprecatedValues(stencil, &options->common);
  command
      ->add_option("--splat", options->splat,
                   "Of blocks: a ray reaches the two nearest pixels (bilinear, default), or the "
                   "nearest")
      ->check(CLI::IsMember({"nearest", "bilinear"}))
      ->type_name("NAME");
}

void AddRunOptions(CLI::App* command, EstimateOptions* options) {
  AddDeviceOption(command, &options->device);
  command
      ->add_option("--memory-limit", options->memory_limit_mib,
                   "Memory limit of the whole program; the solver scene then works in bands. "
                   "Default of scene: four fifths of the available memory")
      ->check(Between(0, 1e9, "MiB"))
      ->type_name("MIB");
  command
      ->add_option("--checkpoint", options->checkpoint_path,
                   "Keep each solved block in this file (solver blocks), so that the same command "
                   "continues after an interruption; removed once the light field is written")
      ->check(NotEmpty("a file's name"))
      ->type_name("FILE");
}

// An option that only some solvers have.
struct OptionOfSolvers {
  const char* name;
  bool is_given;
  std::vector<std::string> solvers;
};

std::vector<OptionOfSolvers> OptionsOfSolvers(const EstimateOptions& options) {
  const std::vector<std::string> scene = {"scene"}, blocks = {"blocks"};
  const std::vector<std::string> smooth = {"blocks", "functional", "grid"};
  const std::vector<std::string> whole_image = {"scene", "functional", "grid"};
  std::vector<std::string> iterative = whole_image;
  if (options.block_solver &&
      estimator::IsIterative(estimator::BlockSolverFromName(*options.block_solver))) {
    iterative.emplace_back("blocks");
  }
  return {{"--prior", options.prior.has_value(), scene},
          {"--strength", options.strength.has_value(), scene},
          {"--check-blur", options.check_blur, scene},
          {"--photo", options.photo.has_value(), scene},
          {"--tolerance", options.tolerance.has_value(), iterative},
          {"--max-iterations", options.max_iterations.has_value(), iterative},
          {"--double", options.double_precision, whole_image},
          {"--gamma", options.gamma.has_value(), smooth},
          {"--ridge", options.ridge.has_value(), smooth},
          {"--block-solver", options.block_solver.has_value(), blocks},
          {"--block-px", options.block_px.has_value(), blocks},
          {"--stencil", options.stencil.has_value(), blocks},
          {"--splat", options.splat.has_value(), blocks},
          {"--checkpoint", !options.checkpoint_path.empty(), blocks}};
}

// "a", "a or b", "a, b or c".
std::string Either(const std::vector<std::string>& names) {
  if (names.size() < 2) return fmt::format("{}", fmt::join(names, ""));
  return fmt::format("{} or {}", fmt::join(names.begin(), names.end() - 1, ", "), names.back());
}

// The light field's folder is replaced as a whole; a file in it would be lost with the older light
// field.
void RequireBesideLightField(const char* option, const std::string& path,
                             const EstimateOptions& options) {
  if (path.empty()) return;
  const auto resolved = [](const std::string& given) {
    std::error_code failure;
    fs::path found = fs::weakly_canonical(fs::absolute(given), failure);
    if (failure) found = fs::absolute(given).lexically_normal();
    return found.has_filename() ? found : found.parent_path();
  };
  const fs::path inner = resolved(path);
  const fs::path output = resolved(options.output_folder);
  const auto differing = std::mismatch(inner.begin(), inner.end(), output.begin(), output.end());
  if (differing.second == output.end()) {
    throw UsageError(
        fmt::format("{} {}: lies in the light field's folder {}; choose a name outside it", option,
                    path, options.output_folder));
  }
}

}  // namespace

bool EstimateOptions::stores_scene() const {
  if (store != "auto") return store == "scene";
  return solver == "scene" && fill == "solver" && format == "auto" && !quality_target.has_value();
}

std::string EstimateOptions::report_path() const {
  return report_folder.empty() ? "" : (fs::path(report_folder) / kReportName).string();
}

void AddEstimateOptions(CLI::App* command, EstimateOptions* options) {
  const auto begin_group = [command](const char* name) { command->option_defaults()->group(name); };
  begin_group("Input");
  AddInputOptions(command, options);
  begin_group("Quality");
  AddQualityOptions(command, options);
  begin_group("Output");
  AddOutputOptions(command, options);
  begin_group("Solver (for comparison)");
  AddSolverOptions(command, options);
  AddIterationOptions(command, options);
  AddFunctionalOptions(command, options);
  AddBlockOptions(command, options);
  begin_group(kRunGroup);
  AddRunOptions(command, options);
  AddCommonOptions(command, &options->common);
  MoveHelpFlagTo(kRunGroup, command);
  ExcludeSolverOptions(command);
}

void CheckSolverUsage(const EstimateOptions& options) {
  for (const OptionOfSolvers& option : OptionsOfSolvers(options)) {
    const auto& solvers = option.solvers;
    if (!option.is_given ||
        std::find(solvers.begin(), solvers.end(), options.solver) != solvers.end()) {
      continue;
    }
    const bool is_iterations =
        option.name == std::string("--tolerance") || option.name == std::string("--max-iterations");
    throw UsageError(
        fmt::format("{} requires --solver {}{}, the solver is {}", option.name, Either(solvers),
                    options.by_blocks() && is_iterations
                        ? ", or blocks with an iterative --block-solver (cg, bicgstab, viennacl)"
                        : "",
                    options.solver));
  }
  if (options.block_solver == "viennacl" && options.device != "auto") {
    throw UsageError(
        fmt::format("--device {} cannot be used with --block-solver viennacl, which selects a "
                    "device itself (auto)",
                    options.device));
  }
  if (options.solver != "scene" && !options.by_blocks() && options.device.rfind("opencl", 0) == 0) {
    throw UsageError(
        fmt::format("--device {} requires --solver scene or blocks; the solver {} computes on the "
                    "processor (auto or cpu)",
                    options.device, options.solver));
  }
}

void CheckEstimateUsage(const EstimateOptions& options) {
  ViewCounts(options.views);
  CropRect(options.crop);
  const auto needs = [](bool given, bool met, const std::string& what) {
    if (given && !met) throw UsageError(what);
  };
  const bool camera = !options.camera_path.empty();
  const bool aperture_of = !options.aperture_of.empty();
  needs(options.orientation == "displayed", !camera,
        "--orientation displayed: excludes --camera, which describes the sensor as stored; turn "
        "the depth map instead");
  needs(!options.correction.IsEmpty(), options.orientation != "displayed",
        "--dark, --flat and --defects describe the sensor as stored and exclude --orientation "
        "displayed");
  const bool has_depth = !options.depth_path.empty();
  needs(options.orientation == "displayed", has_depth,
        "--orientation displayed: the depth map inside a photograph is stored like its pixels, and "
        "both are used as they are stored; leave the option out, or give DEPTH");
  needs(has_depth && !options.depth.kind.empty() && options.depth.kind != "disparity" &&
            options.depth.kind != "relative",
        camera,
        fmt::format("--depth-kind {} needs --camera; without a camera only a disparity map can be "
                    "used, or a relative one",
                    options.depth.kind));
  needs(!options.sensor_origin.empty(), camera, "--sensor-origin needs a --camera");
  needs(options.lens_position.has_value(), camera, "--lens-position needs a --camera");
  needs(!options.distortion.empty(), camera,
        "--distortion needs a --camera; without one, use thicklens undistort");
  needs(options.ignore_exif, camera, "--ignore-exif needs a --camera, with which EXIF is compared");
  needs(options.st_depth_mm.has_value(), camera, "--st-depth-mm needs a --camera");
  needs(options.grid > 0 || options.sparse, aperture_of, "--grid and --sparse need --aperture-of");
  needs(EffectSelectionOf(options.effects).LeavesOut(Effect::kApertureShape),
        options.aperture_shape.empty() && !aperture_of,
        "--aperture-shape and --aperture-of state the shape of the aperture; without the effect "
        "aperture-shape it is Gaussian");
  CheckSolverUsage(options);
  const bool is_scene = options.store == "scene";
  needs(is_scene, options.solver == "scene",
        fmt::format("--store scene requires --solver scene; the solver {} finds views, and no "
                    "scene that they show",
                    options.solver));
  needs(is_scene, options.fill == "solver",
        "--store scene excludes --fill telea, which fills each view for itself");
  needs(is_scene, options.format == "auto",
        "--format is that of the views' files and excludes --store scene");
  needs(is_scene, !options.quality_target.has_value(),
        "--store scene excludes --quality, --within and --psnr-loss, which know the time of views");
  needs(!options.profile_path.empty(), options.quality_target.has_value(),
        "--profile is only used by --quality, --within or --psnr-loss, and none of them is given");
  RequireBesideLightField("--report", options.report_folder, options);
  RequireBesideLightField("--checkpoint", options.checkpoint_path, options);
}

}  // namespace thicklens::tools
