// thicklens estimate: one picture and its depth map become a light field.
#include "thicklens/estimator/estimate.h"

#include <fmt/format.h>
#include <spdlog/spdlog.h>
#include <sys/resource.h>

#include <algorithm>
#include <chrono>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "build_info.h"
#include "commands.h"
#include "depth_io.h"
#include "image_io.h"
#include "interrupt.h"
#include "light_field_io.h"
#include "light_field_options.h"
#include "option_values.h"
#include "progress_line.h"
#include "thicklens/error.h"
#include "thicklens/kernels/device.h"
#include "thicklens/model/camera_file.h"
#include "thicklens/model/light_field.h"
#include "thicklens/model/output_file.h"
#include "thicklens/model/parallel.h"

namespace thicklens::tools {
namespace {

using Clock = std::chrono::steady_clock;

struct EstimateCommandOptions {
  CommonOptions common;
  std::string picture_path, depth_path, camera_path, output_folder;
  DepthOptions depth;
  ViewsOption views;
  CropOption crop;
  std::string aperture_shape;
  std::string aperture_of;  // a light field whose views are those of the aperture
  int grid = 0;
  bool sparse = false;
  std::string sensor_origin;
  std::optional<double> st_depth_mm;
  std::string transfer;  // empty: sRGB, or the camera's
  std::string solver = "blocks";
  std::string block_solver = estimator::BlockSolverName(estimator::DefaultBlockSolver());
  std::string stencil = "warp";
  std::string splat = "bilinear";
  double gamma = 1;
  std::optional<double> ridge;
  std::optional<int> block_px;
  std::optional<double> memory_limit_mib;
  std::vector<std::string> without;
  std::string device = "auto";
  std::string format = "png";
};

constexpr int kDefaultViews = 7;

double SecondsSince(Clock::time_point start) {
  return std::chrono::duration<double>(Clock::now() - start).count();
}

double PeakResidentMib() {
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  return static_cast<double>(usage.ru_maxrss) / 1024;  // Linux counts KiB
}

model::StoredPicture ReadPhoto(const std::string& path) {
  const model::StoredPicture picture = ToStoredPicture(ReadPictureFile(path));
  if (picture.channels == 4) spdlog::warn("{}: its alpha channel is left out", path);
  return WithoutAlpha(picture);
}

// The share of each view in the photograph, and how many views there are.
Eigen::ArrayXXd ViewWeights(const EstimateCommandOptions& options,
                            const std::optional<model::Camera>& camera) {
  if (!options.aperture_of.empty()) {
    LightFieldReading reading;
    reading.grid = options.grid;
    reading.sparse = options.sparse;
    std::tie(reading.u_count, reading.v_count) = ViewCounts(options.views);
    const model::LightField light_field = ReadLightField(options.aperture_of, reading);
    Eigen::ArrayXXd weights = light_field.weights;
    for (int l = 0; l < light_field.v_count; ++l) {
      for (int k = 0; k < light_field.u_count; ++k) {
        if (!light_field.IsPresent(k, l)) weights(l, k) = 0;
      }
    }
    return weights / weights.sum();
  }
  auto [u_count, v_count] = ViewCounts(options.views);
  if (u_count == 0) u_count = v_count = kDefaultViews;
  const model::ApertureShape usual =
      camera ? model::ApertureShapeOf(camera->psf) : model::ApertureShape::kUniform;
  return model::ApertureWeights(ApertureShapeOr(options.aperture_shape, usual), u_count, v_count);
}

// The camera behind a picture, which may be a part of its sensor, and of that the crop.
std::optional<model::Camera> CameraFor(const EstimateCommandOptions& options, int width_px,
                                       int height_px, const std::optional<model::PixelRect>& crop) {
  if (options.camera_path.empty()) return std::nullopt;
  model::Camera camera = model::ReadCamera(options.camera_path);
  TellAssumedFields(camera);
  if (!options.sensor_origin.empty()) {
    const auto origin = SplitPixels("--sensor-origin", options.sensor_origin, ',', "X,Y");
    if (origin.size() != 2) {
      throw UsageError(
          fmt::format("--sensor-origin: X,Y is expected, found '{}'", options.sensor_origin));
    }
    camera = model::CropCamera(camera, {origin[0], origin[1], width_px, height_px});
  } else if (camera.sensor.width_px != width_px || camera.sensor.height_px != height_px) {
    throw Error(fmt::format(
        "{}: the picture is {}x{} px, the sensor of {} has {}x{} px: they must be equal, or "
        "--sensor-origin say which part of the sensor it is",
        options.picture_path, width_px, height_px, options.camera_path, camera.sensor.width_px,
        camera.sensor.height_px));
  }
  return crop ? model::CropCamera(camera, *crop) : camera;
}

// UV on the aperture, where each view has one transmission; ST in the plane of focus unless a
// depth is given.
model::LightFieldGrid GridFor(const EstimateCommandOptions& options, const model::Camera& camera,
                              const Eigen::ArrayXXd& weights) {
  const model::ApertureSamples samples =
      model::SampleAperture(weights, camera.blur_ratio(), camera.lens.aperture_radius_mm);
  model::LightFieldPlanes planes =
      model::DefaultGrid(camera, samples.u_count, samples.v_count).planes;
  if (options.st_depth_mm) planes.plane_spacing_mm = *options.st_depth_mm;
  return model::GridOnPlanes(camera, planes, samples);
}

// Picture and depth are cut alike. Where only one of them has the crop's size, it was cut before.
void CutToCrop(const EstimateCommandOptions& options, const std::optional<model::PixelRect>& crop,
               model::StoredPicture* picture, model::RawDepthMap* map) {
  if (!crop) return;
  const auto was_cut = [&](int width_px, int height_px, const std::string& path) {
    const bool cut = width_px == crop->width && height_px == crop->height &&
                     (picture->width_px != map->width_px || picture->height_px != map->height_px);
    if (cut) spdlog::warn("{}: has the size of --crop and is taken as it is", path);
    return cut;
  };
  const bool cut_picture = !was_cut(picture->width_px, picture->height_px, options.picture_path);
  const bool cut_map = !was_cut(map->width_px, map->height_px, options.depth_path);
  if (cut_picture) *picture = model::CropPicture(*picture, *crop);
  if (cut_map) *map = model::CropDepth(*map, *crop);
}

// Nothing that is given is left out without a word.
void CheckUsage(const EstimateCommandOptions& options) {
  ViewCounts(options.views);
  CropRect(options.crop);
  const auto needs = [](bool given, bool met, const std::string& what) {
    if (given && !met) throw UsageError(what);
  };
  const bool camera = !options.camera_path.empty();
  const bool aperture_of = !options.aperture_of.empty();
  needs(!options.sensor_origin.empty(), camera, "--sensor-origin needs a --camera");
  needs(options.st_depth_mm.has_value(), camera, "--st-depth-mm needs a --camera");
  needs(!options.transfer.empty(), !camera,
        "--transfer is for pictures without a --camera, which says it");
  needs(options.grid > 0 || options.sparse, aperture_of, "--grid and --sparse need --aperture-of");
  needs(!options.aperture_shape.empty(), !aperture_of,
        "--aperture-shape and --aperture-of exclude each other");
}

// A depth far from what the camera is focused at is possible, but more often its unit is wrong.
void TellUnlikelyDepth(const EstimateCommandOptions& options, const model::Camera& camera,
                       const model::DepthStatistics& depth) {
  constexpr double kUsual = 4;
  const double focus_depth_mm = camera.focus_depth_mm();
  if (depth.median_mm <= kUsual * focus_depth_mm && depth.median_mm >= focus_depth_mm / kUsual) {
    return;
  }
  spdlog::warn(
      "{}: the median depth is {:.6g} mm, the camera is focused at {:.6g} mm; is --depth-unit "
      "right?",
      options.depth_path, depth.median_mm, focus_depth_mm);
}

struct Prepared {
  estimator::EstimateInput input;
  PreparedDepth depth;
};

Prepared Prepare(const EstimateCommandOptions& options) {
  const auto crop = CropRect(options.crop);
  model::StoredPicture stored = ReadPhoto(options.picture_path);
  model::RawDepthMap map = ReadDepthMap(options.depth_path);
  const int full_width_px = std::max(stored.width_px, map.width_px);
  const int full_height_px = std::max(stored.height_px, map.height_px);
  CutToCrop(options, crop, &stored, &map);
  if (map.width_px != stored.width_px || map.height_px != stored.height_px) {
    throw Error(fmt::format("{}: it is {}x{} px, the picture {} {}x{} px: the sizes must be equal",
                            options.depth_path, map.width_px, map.height_px, options.picture_path,
                            stored.width_px, stored.height_px));
  }
  Prepared prepared;
  estimator::EstimateInput& input = prepared.input;
  input.camera = CameraFor(options, full_width_px, full_height_px, crop);
  input.transfer =
      input.camera
          ? input.camera->sensor.transfer
          : model::TransferCurve::FromName(options.transfer.empty() ? "srgb" : options.transfer);
  input.picture = model::ToLinear(stored, input.transfer);
  input.weights = ViewWeights(options, input.camera);
  if (input.weights.size() < 2) {
    throw Error(
        "--views: 1x1 is no light field: one view is the picture itself; it must be at least two "
        "views, e.g. 3x3");
  }
  for (const auto& [count, axis] : {std::pair{input.weights.cols(), "u (across)"},
                                    std::pair{input.weights.rows(), "v (down)"}}) {
    if (count == 1) spdlog::warn("--views: one view along {}: no blur is modelled that way", axis);
  }
  if (input.camera) input.grid = GridFor(options, *input.camera, input.weights);
  prepared.depth = PrepareDepth(map, options.depth_path, options.depth, input.picture.width_px,
                                input.picture.height_px, input.camera ? &*input.camera : nullptr,
                                input.grid ? &*input.grid : nullptr);
  input.disparity = prepared.depth.disparity;
  if (prepared.depth.depth && options.depth.kind != "disparity") {
    TellUnlikelyDepth(options, *input.camera, *prepared.depth.depth);
  }
  return prepared;
}

estimator::BlockOptions SolverOptions(const EstimateCommandOptions& options,
                                      ProgressLine* progress) {
  estimator::BlockOptions solver;
  solver.solver = estimator::BlockSolverFromName(options.block_solver);
  solver.stencil = estimator::StencilFromName(options.stencil);
  solver.splat = options.splat == "nearest" ? kernels::Splat::kNearest : kernels::Splat::kBilinear;
  solver.gamma = options.gamma;
  solver.ridge = options.ridge;
  solver.block_px = options.block_px;
  solver.memory_limit_mib = options.memory_limit_mib;
  solver.falloff =
      std::find(options.without.begin(), options.without.end(), "falloff") == options.without.end();
  solver.threads = options.common.threads;
  solver.progress = [progress](int done, int total) {
    ThrowIfInterrupted();
    progress->Show(done, total);
  };
  return solver;
}

struct Times {
  double setup = 0, solve = 0, views = 0, total = 0;
};

nlohmann::json Summary(const EstimateCommandOptions& options, const Prepared& prepared,
                       const estimator::EstimateSummary& estimate,
                       const model::LightField& light_field, const Times& seconds,
                       double clipped_fraction) {
  const model::LightFieldOrigin& origin = light_field.origin;
  nlohmann::json summary = {{"status", "ok"},
                            {"reason", ""},
                            {"output", options.output_folder},
                            {"solver", options.solver},
                            {"block_solver", origin.block_solver},
                            {"stencil", origin.stencil},
                            {"splat", origin.splat},
                            {"prior", "ridge"},
                            {"gamma", estimate.gamma},
                            {"ridge", estimate.ridge},
                            {"device", estimate.device},
                            {"threads", estimate.threads},
                            {"views", {light_field.u_count, light_field.v_count}},
                            {"size", {light_field.s_count, light_field.t_count}},
                            {"channels", light_field.channels},
                            {"block_px", estimate.block_px},
                            {"blocks", estimate.blocks.size()},
                            {"seconds",
                             {{"setup", seconds.setup},
                              {"solve", seconds.solve},
                              {"views", seconds.views},
                              {"total", seconds.total}}},
                            {"peak_rss_mib", PeakResidentMib()},
                            {"predicted_memory_mib", estimate.predicted_memory_mib},
                            {"iterations", nullptr},  // a direct solver has none
                            {"relative_residual", estimate.relative_residual},
                            {"rcond_min", estimate.rcond_min},
                            {"effects", origin.effects},
                            {"holes_filled", prepared.depth.holes},
                            {"clipped_fraction", clipped_fraction}};
  if (prepared.depth.depth) {
    summary["depth"] = {{"min_mm", prepared.depth.depth->min_mm},
                        {"median_mm", prepared.depth.depth->median_mm},
                        {"max_mm", prepared.depth.depth->max_mm}};
  }
  return summary;
}

std::string DisparityRange(const estimator::DisparityMap& map) {
  const auto [least, most] = std::minmax_element(map.disparity.begin(), map.disparity.end());
  return fmt::format("{:.3f} .. {:.3f} px per view step", *least * map.step.x(),
                     *most * map.step.x());
}

std::string SummaryText(const nlohmann::json& summary, const Prepared& prepared) {
  std::string text;
  if (prepared.depth.depth) {
    const model::DepthStatistics& depth = *prepared.depth.depth;
    text += fmt::format("depth        {:.6g} .. {:.6g} mm, median {:.6g} mm\n", depth.min_mm,
                        depth.max_mm, depth.median_mm);
  }
  text += fmt::format("disparity    {}\n", DisparityRange(prepared.depth.disparity));
  if (prepared.depth.holes > 0) {
    text += fmt::format("holes        {} px, filled from the farthest neighbour\n",
                        prepared.depth.holes);
  }
  text += fmt::format("light field  {} x {} views of {} x {} px, {} channel(s)\n",
                      summary["views"][0].get<int>(), summary["views"][1].get<int>(),
                      summary["size"][0].get<int>(), summary["size"][1].get<int>(),
                      summary["channels"].get<int>());
  text +=
      fmt::format("solver       {} blocks of {} px, {} ({} stencil), gamma {:g}, ridge {:.3g}\n",
                  summary["blocks"].get<int>(), summary["block_px"].get<int>(),
                  summary["block_solver"].get<std::string>(), summary["stencil"].get<std::string>(),
                  summary["gamma"].get<double>(), summary["ridge"].get<double>());
  text += fmt::format("device       {}, {} thread(s)\n", summary["device"].get<std::string>(),
                      summary["threads"].get<int>());
  text +=
      fmt::format("accuracy     relative residual {:.1e}, smallest rcond {:.1e}\n",
                  summary["relative_residual"].get<double>(), summary["rcond_min"].get<double>());
  const nlohmann::json& seconds = summary["seconds"];
  text += fmt::format("time         {:.2f} s: set-up {:.2f}, solve {:.2f}, views {:.2f}\n",
                      seconds["total"].get<double>(), seconds["setup"].get<double>(),
                      seconds["solve"].get<double>(), seconds["views"].get<double>());
  text += fmt::format("memory       {:.0f} MiB at most ({:.0f} forecast)\n",
                      summary["peak_rss_mib"].get<double>(),
                      summary["predicted_memory_mib"].get<double>());
  if (summary["clipped_fraction"].get<double>() > 0) {
    text += fmt::format(
        "clipped      {:.2f} % of the values, by the views' files (--format tiff "
        "keeps them)\n",
        100 * summary["clipped_fraction"].get<double>());
  }
  return text;
}

CommandResult Estimate(const EstimateCommandOptions& options) {
  const auto start = Clock::now();
  ProgressLine progress("estimating", options.common.quiet);
  const estimator::BlockOptions solver = SolverOptions(options, &progress);
  std::string why;
  if (!solver.IsValid(&why)) throw Error(why);
  model::OutputFolder folder(options.output_folder, kLightFieldMarker, LightFieldEntries());
  const Prepared prepared = Prepare(options);
  ThrowIfInterrupted();

  std::string notice;
  const auto backend = kernels::OpenBackend(kernels::ParseDeviceRequest(options.device), &notice,
                                            ThrowIfInterrupted);
  if (!notice.empty()) spdlog::warn("{}", notice);
  spdlog::debug("device: {}", backend->description());

  Times seconds;
  const double before = SecondsSince(start);
  estimator::EstimateSummary estimate;
  model::LightField light_field =
      estimator::EstimateByBlocks(prepared.input, solver, backend.get(), &estimate);
  seconds.setup = before + estimate.setup_seconds;
  seconds.solve = estimate.solve_seconds;
  light_field.origin.seconds = seconds.setup + seconds.solve;
  light_field.origin.version = Version();
  light_field.origin.date = NowIso8601();

  const auto views_start = Clock::now();
  const std::size_t clipped = WriteLightField(
      light_field, options.format == "tiff" ? ViewFormat::kTiff : ViewFormat::kPng, &folder);
  ThrowIfInterrupted();
  folder.Commit();
  seconds.views = SecondsSince(views_start);
  seconds.total = SecondsSince(start);

  CommandResult result;
  result.summary =
      Summary(options, prepared, estimate, light_field, seconds,
              static_cast<double>(clipped) / static_cast<double>(light_field.values.size()));
  PrintResult(options.common, SummaryText(result.summary, prepared));
  return result;
}

void AddInputOptions(CLI::App* command, EstimateCommandOptions* options) {
  command->add_option("picture", options->picture_path, "The photograph")
      ->required()
      ->type_name("IMAGE");
  command->add_option("depth", options->depth_path, "Its depth map, pixel by pixel")
      ->required()
      ->type_name("DEPTH");
  command
      ->add_option("--camera", options->camera_path,
                   "The calibrated camera; not needed for a disparity map")
      ->type_name("CAMERA.yaml");
  command
      ->add_option("--sensor-origin", options->sensor_origin,
                   "Where on the camera's sensor a picture of a part of it begins, px")
      ->type_name("X,Y");
  command->add_option("-o,--output", options->output_folder, "Folder for the light field")
      ->required()
      ->type_name("LF");
  AddDepthOptions(command, &options->depth);
  AddCropOption(command, &options->crop);
  command
      ->add_option("--transfer", options->transfer,
                   "Without a camera: how light became stored values: linear, srgb (default) or "
                   "gamma-2.2")
      ->check(CLI::IsMember({"linear", "srgb", "gamma-2.2"}))
      ->type_name("NAME");
}

void AddLightFieldOptions(CLI::App* command, EstimateCommandOptions* options) {
  AddViewsOption(command, &options->views, "Views across and down; default 7x7");
  AddApertureShapeOption(command, &options->aperture_shape);
  command
      ->add_option("--aperture-of", options->aperture_of,
                   "Take the views, and which of them the photograph saw, from this light field")
      ->type_name("LF");
  command->add_option("--grid", options->grid, "Of --aperture-of: row length of the HCI numbering")
      ->check(CLI::Range(1, 1000))
      ->type_name("N");
  command->add_flag("--sparse", options->sparse, "Of --aperture-of: any set of views may be there");
  command
      ->add_option("--st-depth-mm", options->st_depth_mm,
                   "Depth of the ST plane (UV is the aperture); default: the plane of focus")
      ->check(Between(0, 1e9, "millimetres"))
      ->type_name("MM");
  command->add_option("--without", options->without, "Effects to leave out: falloff")
      ->check(CLI::IsMember({"falloff"}))
      ->delimiter(',')
      ->type_name("EFFECT");
  command
      ->add_option("--format", options->format,
                   "Of the views: png (16 bit, stored values) or tiff (float, linear light)")
      ->check(CLI::IsMember({"png", "tiff"}))
      ->capture_default_str()
      ->type_name("NAME");
}

void AddSolverOptions(CLI::App* command, EstimateCommandOptions* options) {
  command->add_option("--solver", options->solver, "blocks: the source's, block by block")
      ->check(CLI::IsMember({"blocks"}))
      ->capture_default_str()
      ->type_name("NAME");
  command->add_option("--block-solver", options->block_solver, "umfpack, cholmod or eigen")
      ->check(CLI::IsMember({"umfpack", "cholmod", "eigen"}))
      ->capture_default_str()
      ->type_name("NAME");
  command
      ->add_option("--block-px", options->block_px,
                   "Edge of the blocks; default 16, or the largest that --memory-limit allows")
      ->check(CLI::Range(1, 100000))
      ->type_name("PX");
  command->add_option("--memory-limit", options->memory_limit_mib, "For the whole program")
      ->check(Between(0, 1e9, "MiB"))
      ->type_name("MIB");
  command->add_option("--gamma", options->gamma, "Weight of the smoothness along scene points")
      ->check(Finite())
      ->capture_default_str()
      ->type_name("X");
  command
      ->add_option("--ridge", options->ridge,
                   "Weight mu of the distance to the warped picture; default 0.01/(U V)")
      ->check(Finite())
      ->type_name("X");
  command
      ->add_option("--stencil", options->stencil,
                   "Of the smoothness: warp, or the source's six differences")
      ->check(CLI::IsMember({"warp", "source"}))
      ->capture_default_str()
      ->type_name("NAME");
  command
      ->add_option("--splat", options->splat,
                   "A ray reaches the nearest pixel, or the two nearest: nearest or bilinear")
      ->check(CLI::IsMember({"nearest", "bilinear"}))
      ->capture_default_str()
      ->type_name("NAME");
  AddDeviceOption(command, &options->device);
}

}  // namespace

void AddEstimateCommand(CLI::App* program, CommandAction* action) {
  CLI::App* command =
      program->add_subcommand("estimate", "The light field of one picture with its depth map");
  const auto options = std::make_shared<EstimateCommandOptions>();
  AddInputOptions(command, options.get());
  AddLightFieldOptions(command, options.get());
  AddSolverOptions(command, options.get());
  AddCommonOptions(command, &options->common);
  command->callback([options, action] {
    *action = [options] {
      CheckUsage(*options);
      RequireDistinctFiles(
          {options->common.json_path, options->output_folder},
          {options->picture_path, options->depth_path, options->camera_path, options->aperture_of});
      RunCommand(options->common, [&] { return Estimate(*options); });
    };
  });
}

}  // namespace thicklens::tools
