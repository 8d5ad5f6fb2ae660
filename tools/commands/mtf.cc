// thicklens mtf: the MTF of a camera from the photograph of an edge.
#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <memory>
#include <opencv2/core.hpp>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "thicklens/base/cancel.h"
#include "thicklens/base/error.h"
#include "thicklens/base/output_file.h"
#include "thicklens/base/printable_text.h"
#include "thicklens/calib/slanted_edge.h"
#include "thicklens/calib/sweep_transfer.h"
#include "thicklens/camera.h"
#include "thicklens/image.h"
#include "tools/commands/commands.h"
#include "tools/options/command_frame.h"
#include "tools/options/option_values.h"
#include "tools/report/svg_plot.h"
#include "tools/report/sweep_imaging.h"

namespace thicklens::tools {
namespace {

constexpr double kUmPerMm = 1000;

struct MtfOptions {
  CommonOptions common;
  std::string image_path, camera_path, transfer, output, figure_path;
  std::string roi;
  std::optional<double> pitch_um;
};

// The region of --roi; absent: the whole image. Throws UsageError.
std::optional<cv::Rect> RegionOption(const std::string& text) {
  if (text.empty()) return std::nullopt;
  const std::string form = "x,y,width,height";
  const std::vector<int> px = SplitPixels("--roi", text, ',', form);
  if (px.size() != 4 || px[2] < 1 || px[3] < 1) {
    throw UsageError(
        fmt::format("--roi: {} with width and height above 0 is expected, found '{}'", form, text));
  }
  return cv::Rect(px[0], px[1], px[2], px[3]);
}

// The curve by which the light became the values: stated, of the file, of the camera, or sRGB.
TransferCurve CurveOf(const MtfOptions& options, const Image& image,
                      const std::optional<Camera>& camera) {
  if (!options.transfer.empty()) return TransferCurve::FromName(options.transfer);
  if (const auto stated = image.StatedTransfer()) return *stated;
  if (camera) return camera->sensor.transfer;
  spdlog::warn("{}: it states no transfer curve, and sRGB is assumed; --transfer states another",
               PrintableUtf8(options.image_path));
  return TransferCurve::Srgb();
}

cv::Mat GreyLight(const Image& image, const TransferCurve& curve) {
  const model::LinearImage light = image.ToLight(curve);
  cv::Mat grey(light.height_px, light.width_px, CV_32F);
  const auto channels = static_cast<std::size_t>(light.channels);
  std::size_t at = 0;
  for (int y = 0; y < grey.rows; ++y) {
    for (int x = 0; x < grey.cols; ++x, at += channels) {
      grey.at<float>(y, x) = channels < 3
                                 ? light.values[at]
                                 : 0.2126F * light.values[at] + 0.7152F * light.values[at + 1] +
                                       0.0722F * light.values[at + 2];
    }
  }
  return grey;
}

cv::Mat RegionOf(const cv::Mat& grey, const MtfOptions& options) {
  const auto region = RegionOption(options.roi);
  if (!region) return grey;
  if ((*region & cv::Rect({}, grey.size())) != *region) {
    throw Error(fmt::format("{}: the region {} is not inside of its {} x {} px", options.image_path,
                            options.roi, grey.cols, grey.rows));
  }
  return grey(*region).clone();
}

calib::TransferUnits UnitsOf(const MtfOptions& options, const std::optional<Camera>& camera) {
  if (camera) return calib::TransferUnitsOf(*camera);
  calib::TransferUnits units;
  if (options.pitch_um) units.sensor_lp_per_mm = kUmPerMm / *options.pitch_um;
  return units;
}

std::string Csv(const calib::SlantedEdgeResult& edge, const calib::TransferUnits& units) {
  std::string csv = "frequency_cycles_per_px,frequency_lp_per_mm_on_sensor,transfer,sigma\n";
  for (std::size_t i = 0; i < edge.curve.transfer.size(); ++i) {
    const double frequency = edge.curve.frequency_per_px[i];
    csv += fmt::format(
        "{:.4g},{},{:.6f},{:.6f}\n", frequency,
        units.sensor_lp_per_mm > 0 ? fmt::format("{:.6g}", frequency * units.sensor_lp_per_mm) : "",
        edge.curve.transfer[i], edge.curve.sigma[i]);
  }
  return csv;
}

std::string FigureSvg(const calib::SlantedEdgeResult& edge, const MtfOptions& options) {
  Plot plot;
  plot.id = "mtf";
  plot.title = fmt::format("MTF, {}", PrintableUtf8(options.image_path));
  plot.heading = plot.title;
  plot.x_axis.label = "frequency [cycles/px]";
  plot.y_axis.label = "contrast";
  PlotSeries curve;
  curve.ink = Ink::kFit;
  curve.mark = Mark::kNone;
  curve.stroke = Stroke::kSolid;
  curve.x = edge.curve.frequency_per_px;
  curve.y = edge.curve.transfer;
  PlotBand band;
  band.label = "± 2 standard deviations";
  band.x = curve.x;
  for (std::size_t i = 0; i < curve.y.size(); ++i) {
    band.lo.push_back(curve.y[i] - 2 * edge.curve.sigma[i]);
    band.hi.push_back(curve.y[i] + 2 * edge.curve.sigma[i]);
  }
  plot.bands.push_back(std::move(band));
  plot.series.push_back(std::move(curve));
  plot.lines.push_back({"Nyquist", Ink::kMuted, Stroke::kDotted, true, 0.5});
  return SvgFile(SvgPlot(plot));
}

std::string Text(const calib::SlantedEdgeResult& edge, const calib::TransferUnits& units) {
  std::string text = fmt::format(
      "edge    {:.0f} px long, normal at {:.2f} degrees, contrast {:.3g} of full scale, noise "
      "{:.2g}\n",
      edge.length_px, edge.normal_deg, edge.contrast, edge.noise_sigma);
  for (const auto& [name, level] : {std::pair("MTF50 ", &edge.mtf50), {"MTF10 ", &edge.mtf10}}) {
    text += fmt::format("{}  {}\n", name,
                        *level ? FrequencyText(**level, units)
                               : std::string("above this contrast up to 1 cycle/px"));
  }
  return text + "measured after ISO 12233 at a slanted edge, with the box of the pixel\n";
}

CommandResult Measure(const MtfOptions& options) {
  std::optional<OutputFile> output, figure;
  if (!options.output.empty()) output.emplace(options.output);
  if (!options.figure_path.empty()) figure.emplace(options.figure_path);
  std::optional<Camera> camera;
  if (!options.camera_path.empty()) camera = ReadCamera(options.camera_path);
  const Image image = ReadImage(options.image_path);
  const calib::TransferUnits units = UnitsOf(options, camera);
  const cv::Mat grey = RegionOf(GreyLight(image, CurveOf(options, image, camera)), options);
  const calib::SlantedEdgeResult edge = calib::MeasureSlantedEdge(grey);
  CommandResult result;
  result.summary = {{"status", edge.done ? "ok" : "refused"},
                    {"reason", edge.done ? "" : PrintableUtf8(edge.message)}};
  if (!edge.done) {
    result.refusal = PrintableUtf8(fmt::format("{}: {}", options.image_path, edge.message));
    return result;
  }
  if (edge.is_clipped) {
    spdlog::warn("{}: the bright side of the edge is clipped, and the MTF is too high",
                 PrintableUtf8(options.image_path));
  }
  const cv::Point corner = RegionOption(options.roi).value_or(cv::Rect()).tl();
  result.summary["edge"] = {
      {"centre_px", {edge.centre_px.x() + corner.x, edge.centre_px.y() + corner.y}},
      {"normal_deg", edge.normal_deg},
      {"length_px", edge.length_px},
      {"contrast", edge.contrast},
      {"noise_sigma", edge.noise_sigma},
      {"clipped", edge.is_clipped}};
  result.summary["mtf50"] = FrequencyJson(edge.mtf50, units);
  result.summary["mtf10"] = FrequencyJson(edge.mtf10, units);
  result.summary["curve"] = CurveJson(edge.curve);
  result.summary["edge_spread"] = {{"distance_px", edge.distance_px}, {"level", edge.level}};
  ThrowIfCancelled();
  if (output) output->Commit(Csv(edge, units));
  if (figure) figure->Commit(FigureSvg(edge, options));
  result.is_written = output || figure;
  PrintResult(options.common,
              Text(edge, units) + WrittenText({options.output, options.figure_path}));
  return result;
}

}  // namespace

void AddMtfCommand(CLI::App* program, CommandAction* action) {
  CLI::App* command = program->add_subcommand(
      "mtf", "Modulation transfer (MTF50, MTF10, lp/mm) from the photograph of a slanted edge");
  const auto options = std::make_shared<MtfOptions>();
  command->add_option("image", options->image_path, "Photograph that shows the edge")
      ->required()
      ->type_name("IMAGE");
  command
      ->add_option("--roi", options->roi,
                   "Region that shows one straight edge with an even area on each side")
      ->type_name("X,Y,W,H");
  CLI::Option* camera =
      command
          ->add_option("--camera", options->camera_path,
                       "Camera file, for the pixel pitch, the transfer curve and, if it is "
                       "calibrated, the magnification in the plane of focus")
          ->type_name("CAMERA.yaml");
  command->add_option("--pitch-um", options->pitch_um, "Pixel pitch, instead of a camera")
      ->check(Between(0, kUmPerMm, "micrometres"))
      ->excludes(camera)
      ->type_name("UM");
  command
      ->add_option(
          "--transfer", options->transfer,
          "Transfer curve of the values; default: that of the file, of the camera, or srgb")
      ->check(TransferCurveName())
      ->type_name("CURVE");
  command->add_option("-o,--output", options->output, "Table of the curve to write")
      ->type_name("FILE.csv");
  command->add_option("--figure", options->figure_path, "Figure of the curve to write")
      ->type_name("FILE.svg");
  AddCommonOptions(command, &options->common);
  command->callback([options, action] {
    *action = [options] {
      static_cast<void>(
          RegionOption(options->roi));  // wrong usage ends here, before anything is read
      RequireDistinctFiles({options->output, options->figure_path, options->common.json_path},
                           {options->image_path, options->camera_path});
      RunCommand(options->common, [&] { return Measure(*options); });
    };
  });
}

}  // namespace thicklens::tools
