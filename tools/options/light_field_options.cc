#include "tools/options/light_field_options.h"

#include <fmt/format.h>

#include <tuple>
#include <vector>

#include "thicklens/base/error.h"
#include "thicklens/kernels/device.h"
#include "tools/options/option_values.h"

namespace thicklens::tools {
namespace {

constexpr int kMaxGrid = 1000;

}  // namespace

void AddViewsOption(CLI::App* command, ViewsOption* option, const std::string& help) {
  command->add_option("--views", option->text, help)->type_name("UxV");
}

// The maximum along one axis; long before it the number of rays exceeds any memory.
constexpr int kMaxViews = 99;

std::pair<int, int> ViewCounts(const ViewsOption& option) {
  if (option.text.empty()) return {0, 0};
  const std::string form = "UxV (views across and down, e.g. 7x7)";
  const std::vector<int> counts = SplitWhole("--views", option.text, 'x', form, 1, kMaxViews);
  if (counts.size() != 2) {
    throw UsageError(fmt::format("--views: {} is expected, found '{}'", form, option.text));
  }
  return {counts[0], counts[1]};
}

void AddCropOption(CLI::App* command, CropOption* option) {
  command->add_option("--crop", option->text, "Use only this rectangle, px")
      ->type_name("X,Y,WIDTH,HEIGHT");
}

std::optional<model::PixelRect> CropRect(const CropOption& option) {
  if (option.text.empty()) return std::nullopt;
  const std::string form = "x,y,width,height";
  const std::vector<int> px = SplitPixels("--crop", option.text, ',', form);
  if (px.size() != 4 || px[2] < 1 || px[3] < 1) {
    throw UsageError(fmt::format("--crop: {} with width and height above 0 is expected, found '{}'",
                                 form, option.text));
  }
  return model::PixelRect{px[0], px[1], px[2], px[3]};
}

void AddReadingOptions(CLI::App* command, ReadingOptions* options) {
  command
      ->add_option("--grid", options->grid,
                   "For a folder in the HCI layout: views per row in its numbering; default: as in "
                   "parameters.cfg, or the views form a full square")
      ->check(CLI::Range(1, kMaxGrid))
      ->type_name("N");
  command->add_flag("--sparse", options->sparse, "Accept a light field with missing views");
  AddViewsOption(command, &options->views, "Use only the UxV views in the middle");
  AddCropOption(command, &options->crop);
}

io::LightFieldReading ReadingOf(const ReadingOptions& options) {
  io::LightFieldReading reading;
  reading.grid = options.grid;
  reading.sparse = options.sparse;
  std::tie(reading.u_count, reading.v_count) = ViewCounts(options.views);
  reading.crop = CropRect(options.crop);
  return reading;
}

LightFieldReadOptions LightFieldReadOptionsOf(const ReadingOptions& options) {
  LightFieldReadOptions reading;
  reading.hci_grid = options.grid;
  reading.allow_missing_views = options.sparse;
  const auto [u_count, v_count] = ViewCounts(options.views);
  if (u_count > 0) reading.inner_views = thicklens::ViewCounts{u_count, v_count};
  reading.crop = CropRect(options.crop);
  return reading;
}

void AddDepthOptions(CLI::App* command, const std::string& required, DepthOptions* options) {
  command
      ->add_option(
          "--depth-kind", options->kind,
          required +
              ". Meaning of the depth map: z (along the axis), range (along the pixel's ray) "
              "or disparity (px per view step, near positive, 0 in the plane of focus)")
      ->check(CLI::IsMember({"z", "range", "disparity"}))
      ->type_name("KIND");
  command
      ->add_option("--depth-unit", options->unit,
                   "Unit of z and range: mm, cm, m, or tum5000 (16-bit PNG, metres times 5000)")
      ->check(CLI::IsMember({"mm", "cm", "m", "tum5000"}))
      ->type_name("UNIT");
  command
      ->add_option("--disparity-scale", options->disparity_scale,
                   "Scale of disparities: disparity = scale * value + offset")
      ->check(Finite())
      ->capture_default_str()
      ->type_name("X");
  command
      ->add_option("--disparity-offset", options->disparity_offset_px,
                   "Offset of disparities, see --disparity-scale")
      ->check(Finite())
      ->capture_default_str()
      ->type_name("PX");
}

model::DepthConvention ConventionOf(const DepthOptions& options) {
  if (options.kind.empty()) {
    throw UsageError(
        "--depth-kind is missing: z, range or disparity must be given, a depth map does not state "
        "it "
        "itself");
  }
  model::DepthConvention convention;
  convention.kind = model::DepthKindFromName(options.kind);
  if (convention.kind == model::DepthKind::kDisparity) {
    if (!options.unit.empty()) {
      throw UsageError(fmt::format(
          "--depth-unit {}: a disparity has no unit, it is px per view step; see --disparity-scale",
          options.unit));
    }
    if (options.disparity_scale == 0) {
      throw UsageError(
          "--disparity-scale: must not be 0, everything would lie in the plane of focus");
    }
    convention.disparity_scale = options.disparity_scale;
    convention.disparity_offset_px = options.disparity_offset_px;
    return convention;
  }
  if (options.unit.empty()) {
    throw UsageError(fmt::format(
        "--depth-unit is missing: --depth-kind {} needs mm, cm, m or tum5000", options.kind));
  }
  if (options.disparity_scale != 1 || options.disparity_offset_px != 0) {
    throw UsageError(fmt::format(
        "--disparity-scale and --disparity-offset require --depth-kind disparity, found {}",
        options.kind));
  }
  convention.unit_mm = model::DepthUnitMm(options.unit);
  return convention;
}

DepthMeaning DepthMeaningOf(const DepthOptions& options) {
  const model::DepthConvention convention = ConventionOf(options);
  DepthMeaning meaning;
  meaning.kind = convention.kind;
  for (const auto unit : {LengthUnit::kMillimetre, LengthUnit::kCentimetre, LengthUnit::kMetre,
                          LengthUnit::kTum5000}) {
    if (options.unit == LengthUnitName(unit)) meaning.unit = unit;
  }
  meaning.disparity_scale = options.disparity_scale;
  meaning.disparity_offset_px = options.disparity_offset_px;
  return meaning;
}

void AddApertureShapeOption(CLI::App* command, std::string* text) {
  command
      ->add_option("--aperture-shape", *text,
                   "Transmission of the aperture over the views: uniform, gaussian or disc")
      ->check(CLI::IsMember({"uniform", "gaussian", "disc"}))
      ->type_name("SHAPE");
}

void AddDeviceOption(CLI::App* command, std::string* text) {
  if (text->empty()) *text = "auto";
  const CLI::Validator is_device(
      [](std::string& given) {
        try {
          kernels::ParseDeviceRequest(given);
          return std::string();
        } catch (const Error& error) {
          return std::string(error.what());
        }
      },
      "");
  command
      ->add_option(
          "--device", *text,
          "Device that computes: auto, cpu, opencl, opencl:PLATFORM or opencl:PLATFORM:DEVICE")
      ->check(is_device)
      ->capture_default_str()
      ->type_name("DEVICE");
}

}  // namespace thicklens::tools
