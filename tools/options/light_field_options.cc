#include "tools/options/light_field_options.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstddef>
#include <vector>

#include "thicklens/base/error.h"
#include "thicklens/kernels/device.h"
#include "tools/options/option_values.h"

namespace thicklens::tools {
namespace {

constexpr int kMaxLayoutCount = 100;

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

namespace {

// The value of --layout.
struct LayoutRequest {
  std::string name;
  int u_count = 0, v_count = 0;
};

// `dashes` is what stands before the name of the option: "--".
LayoutRequest LayoutOf(const std::string& text, const std::string& dashes) {
  LayoutRequest request;
  if (text.empty()) return request;
  const std::size_t colon = text.find(':');
  request.name = text.substr(0, colon);
  const std::vector<std::string> names = io::LightFieldLayouts();
  if (std::find(names.begin(), names.end(), request.name) == names.end()) {
    throw UsageError(
        fmt::format("{}layout: {} is expected, found '{}'", dashes, fmt::join(names, ", "), text));
  }
  if (colon == std::string::npos) return request;
  const std::string form = "NAME:UxV (numbers across and down, e.g. lenslets:14x14)";
  const std::vector<int> counts =
      SplitWhole(dashes + "layout", text.substr(colon + 1), 'x', form, 1, kMaxLayoutCount);
  if (counts.size() != 2)
    throw UsageError(fmt::format("{}layout: {} is expected, found '{}'", dashes, form, text));
  request.u_count = counts[0];
  request.v_count = counts[1];
  return request;
}

ViewOrderChange ViewOrderOf(const std::string& text, const std::string& dashes) {
  ViewOrderChange change;
  if (text.empty() || text == "none") return change;
  for (std::size_t begin = 0; begin <= text.size();) {
    const std::size_t end = std::min(text.find(',', begin), text.size());
    const std::string word = text.substr(begin, end - begin);
    bool* const flag = word == "swap"       ? &change.swap
                       : word == "mirror-u" ? &change.mirror_u
                       : word == "mirror-v" ? &change.mirror_v
                                            : nullptr;
    if (flag == nullptr || *flag) {
      throw UsageError(fmt::format(
          "{}view-order: swap, mirror-u and mirror-v, each once, with commas between them, or "
          "none are expected, found '{}'",
          dashes, text));
    }
    *flag = true;
    begin = end + 1;
  }
  return change;
}

}  // namespace

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
  command
      ->add_option(
          "--layout", options->layout,
          fmt::format("Layout of the light field: {}; UxV: views or tiles across and down, "
                      "or pixels of a lenslet; default: recognised",
                      fmt::join(io::LightFieldLayouts(), ", ")))
      ->type_name("NAME[:UxV]");
  command
      ->add_option("--name", options->name,
                   "Names of the views: {v} is the row, {u} the column, {n} a number that counts "
                   "row by row, * any text, e.g. 'view_{v}_{u}.jpg'")
      ->type_name("PATTERN");
  command
      ->add_option("--view-order", options->view_order,
                   "Correct the order of the views: swap (rows and columns), mirror-u (columns "
                   "backwards), mirror-v (rows backwards), or several with commas")
      ->type_name("CHANGES");
}

OptionNames ReadingOptionNames() {
  return {{"hci_grid", "--grid"},     {"allow_missing_views", "--sparse"},
          {"inner_views", "--views"}, {"layout", "--layout"},
          {"view_name", "--name"},    {"view_order", "--view-order"},
          {"crop", "--crop"}};
}

LightFieldReadOptions LightFieldReadOptionsOf(const ReadingOptions& options,
                                              const std::string& dashes) {
  LightFieldReadOptions reading;
  const LayoutRequest layout = LayoutOf(options.layout, dashes);
  reading.layout = layout.name;
  if (layout.u_count > 0)
    reading.layout_counts = thicklens::ViewCounts{layout.u_count, layout.v_count};
  reading.view_name = options.name;
  reading.view_order = ViewOrderOf(options.view_order, dashes);
  reading.hci_grid = options.grid;
  reading.allow_missing_views = options.sparse;
  const auto [u_count, v_count] = ViewCounts(options.views);
  if (u_count > 0) reading.inner_views = thicklens::ViewCounts{u_count, v_count};
  reading.crop = CropRect(options.crop);
  return reading;
}

namespace {
constexpr const char* kRelative = "relative";
}  // namespace

void AddDepthOptions(CLI::App* command, const std::string& required, DepthOptions* options,
                     bool takes_relative) {
  std::vector<std::string> kinds = {"z", "range", "disparity", "inverse"};
  if (takes_relative) kinds.emplace_back("relative");
  command
      ->add_option(
          "--depth-kind", options->kind,
          required +
              ". Meaning of the depth map: z (along the axis), range (along the pixel's ray), "
              "disparity (px per view step, near positive, 0 in the plane of focus)" +
              (takes_relative
                   ? ", inverse (1/z) or relative (1/z up to a scale and an offset, which are "
                     "found from the photograph's blur)"
                   : " or inverse (1/z)"))
      ->check(CLI::IsMember(kinds))
      ->type_name("KIND");
  if (takes_relative) {
    command
        ->add_option("--near-is", options->near_is,
                     "Which values of a relative map are near: large (default) or small")
        ->check(CLI::IsMember({"large", "small"}))
        ->type_name("WHAT");
  }
  command
      ->add_option("--depth-unit", options->unit,
                   "Unit of z and range, and of --depth-near and --depth-far: mm, cm, m, or "
                   "tum5000 (16-bit PNG, metres times 5000)")
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
  command
      ->add_option("--inverse-scale", options->inverse_scale_dpt,
                   "Scale of inverse depths: 1/z in dioptres (1/m) = scale * value + offset")
      ->check(Finite())
      ->capture_default_str()
      ->type_name("DPT");
  command
      ->add_option("--inverse-offset", options->inverse_offset_dpt,
                   "Offset of inverse depths, see --inverse-scale")
      ->check(Finite())
      ->capture_default_str()
      ->type_name("DPT");
  command
      ->add_option(
          "--depth-near", options->near,
          "Inverse depth: depth of the largest value (255, 65535, or 1 of floats), instead "
          "of a scale")
      ->type_name("X");
  command
      ->add_option("--depth-far", options->far,
                   "Inverse depth: depth of the value 0; inf for infinity. A map whose zeros are "
                   "near has the smaller depth here")
      ->type_name("X");
  command
      ->add_option("--hole-value", options->hole_values,
                   "Value that means 'no depth', besides NaN and infinities; may be repeated")
      ->check(Finite())
      ->type_name("X");
  command
      ->add_option("--zero-is", options->zero_is,
                   "Meaning of 0 in an integer map of disparity or inverse depth: hole (default) "
                   "or value")
      ->check(CLI::IsMember({"hole", "value"}))
      ->type_name("WHAT");
  command
      ->add_option("--largest-is", options->largest_is,
                   "Meaning of the largest value of the type, e.g. 65535, in a map of z or range: "
                   "hole if all others are far below it (default), or value")
      ->check(CLI::IsMember({"hole", "value"}))
      ->type_name("WHAT");
  command
      ->add_option("--depth-channel", options->channel,
                   "Name of the channel that holds the depth, e.g. ViewLayer.Depth.Z of an EXR "
                   "file; default: the only one, or the one named Z, depth or disparity")
      ->type_name("NAME");
  command
      ->add_option("--pfm-scale", options->pfm_scale,
                   "The scale in the header of a PFM file: apply it to the values (default, except "
                   "for 1/255) or ignore it")
      ->check(CLI::IsMember({"apply", "ignore"}))
      ->type_name("WHAT");
  command
      ->add_option("--depth-flip", options->flip,
                   "Reverse the rows, the columns or both of the depth map, which its file stores "
                   "the other way")
      ->check(CLI::IsMember({"rows", "columns", "both"}))
      ->type_name("WHAT");
}

namespace {

void CheckOptionsOfKind(const DepthOptions& options, model::DepthKind kind) {
  const auto refuse = [](bool is_given, const std::string& what) {
    if (is_given) throw UsageError(what);
  };
  const bool is_inverse = kind == model::DepthKind::kInverse;
  const bool has_lengths = kind == model::DepthKind::kZ || kind == model::DepthKind::kRange;
  const bool has_ends = options.near.has_value() || options.far.has_value();
  const bool has_scale = options.inverse_scale_dpt != 1 || options.inverse_offset_dpt != 0;
  refuse(!is_inverse && (has_ends || has_scale),
         fmt::format("--inverse-scale, --inverse-offset, --depth-near and --depth-far require "
                     "--depth-kind inverse, found {}",
                     options.kind));
  refuse(has_lengths && !options.zero_is.empty(),
         fmt::format("--zero-is: a {} of 0 is not a depth; --depth-kind disparity or inverse is "
                     "expected",
                     options.kind));
  refuse(!has_lengths && !options.largest_is.empty(),
         fmt::format("--largest-is requires --depth-kind z or range, found {}: there the largest "
                     "value is always a value; see --hole-value",
                     options.kind));
  if (!is_inverse) return;
  refuse(options.near.has_value() != options.far.has_value(),
         "--depth-near and --depth-far belong together");
  refuse(has_ends && has_scale,
         "--depth-near and --depth-far give the scale: --inverse-scale and --inverse-offset cannot "
         "be given as well");
  refuse(has_ends && (options.unit.empty() || options.unit == "tum5000"),
         "--depth-near and --depth-far need --depth-unit mm, cm or m");
  refuse(!has_ends && !options.unit.empty(),
         fmt::format("--depth-unit {}: an inverse depth is in dioptres by --inverse-scale, or "
                     "between --depth-near and --depth-far",
                     options.unit));
  refuse(options.inverse_scale_dpt == 0, "--inverse-scale: must not be 0");
  refuse(has_ends && !(*options.near > 0 && *options.far > 0 && *options.near != *options.far),
         "--depth-near and --depth-far: two different depths above 0 are expected");
  refuse(options.disparity_scale != 1 || options.disparity_offset_px != 0,
         "--disparity-scale and --disparity-offset require --depth-kind disparity, found inverse; "
         "see --inverse-scale");
}

}  // namespace

model::DepthConvention ConventionOf(const DepthOptions& options) {
  if (options.kind.empty()) {
    throw UsageError(
        "--depth-kind is missing: z, range, disparity or inverse must be given, a depth map does "
        "not state it itself");
  }
  model::DepthConvention convention;
  if (!options.near_is.empty() && options.kind != kRelative) {
    throw UsageError(
        fmt::format("--near-is requires --depth-kind relative, found {}; a negative "
                    "scale makes small values near",
                    options.kind));
  }
  if (options.kind == kRelative) {
    DepthOptions disparity = options;
    disparity.kind = "disparity";
    disparity.near_is.clear();
    if (options.disparity_scale != 1 || options.disparity_offset_px != 0) {
      throw UsageError(
          "--disparity-scale and --disparity-offset state what --depth-kind relative finds; with "
          "them the kind is disparity");
    }
    convention = ConventionOf(disparity);
    convention.disparity_scale = options.near_is == "small" ? -1 : 1;
    return convention;
  }
  convention.kind = model::DepthKindFromName(options.kind);
  CheckOptionsOfKind(options, convention.kind);
  if (convention.kind == model::DepthKind::kInverse) {
    convention.inverse_scale_dpt = options.inverse_scale_dpt;
    convention.inverse_offset_dpt = options.inverse_offset_dpt;
    return convention;
  }
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
  if (meaning.kind == DepthKind::kInverse) {
    meaning.inverse_scale_dpt = options.inverse_scale_dpt;
    meaning.inverse_offset_dpt = options.inverse_offset_dpt;
    return meaning;  // the unit is that of near and far
  }
  for (const auto unit : {LengthUnit::kMillimetre, LengthUnit::kCentimetre, LengthUnit::kMetre,
                          LengthUnit::kTum5000}) {
    if (options.unit == LengthUnitName(unit)) meaning.unit = unit;
  }
  meaning.disparity_scale = convention.disparity_scale;
  meaning.disparity_offset_px = convention.disparity_offset_px;
  meaning.is_relative = options.kind == kRelative;
  return meaning;
}

model::DepthFlip DepthFlipOf(const DepthOptions& options) {
  return options.flip.empty() ? model::DepthFlip::kNone : model::DepthFlipFromName(options.flip);
}

DepthReadOptions DepthReadOptionsOf(const DepthOptions& options) {
  const model::DepthConvention convention = ConventionOf(options);
  DepthReadOptions reading;
  reading.channel = options.channel;
  if (options.pfm_scale == "apply") reading.pfm_scale = PfmScale::kApplied;
  if (options.pfm_scale == "ignore") reading.pfm_scale = PfmScale::kIgnored;
  reading.flip = DepthFlipOf(options);
  reading.holes.hole_values = options.hole_values;
  // Networks leave no holes, and their 0 is the farthest value.
  reading.holes.zero_is_value =
      options.zero_is == "value" || (options.kind == kRelative && options.zero_is.empty());
  reading.holes.largest_is_value = options.largest_is == "value";
  if (convention.kind == model::DepthKind::kInverse && options.near) {
    const double unit_mm = model::DepthUnitMm(options.unit);
    reading.near_mm = *options.near * unit_mm;
    reading.far_mm = *options.far * unit_mm;
  }
  return reading;
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
