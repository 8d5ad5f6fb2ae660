// thicklens render: renders images from a light field, or converts it to another layout.
#include "thicklens/render.h"

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <limits>
#include <memory>
#include <optional>
#include <sstream>
#include <string>
#include <utility>
#include <vector>

#include "thicklens/animation.h"
#include "thicklens/base/cancel.h"
#include "thicklens/base/error.h"
#include "thicklens/base/output_file.h"
#include "thicklens/base/stopwatch.h"
#include "thicklens/image.h"
#include "thicklens/light_field.h"
#include "thicklens/scene_form.h"
#include "tools/commands/commands.h"
#include "tools/options/command_frame.h"
#include "tools/options/effect_options.h"
#include "tools/options/interface_options.h"
#include "tools/options/light_field_options.h"
#include "tools/options/option_values.h"

namespace thicklens::tools {
namespace {

namespace fs = std::filesystem;

constexpr int kMosaicGapPx = 2;
constexpr int kEpipolarRepeatPx = 8;  // one line per view would be too thin to see
constexpr double kMaxLengthMm = 1e9;
constexpr int kDefaultBits = 8;

struct RenderOptions {
  CommonOptions common;
  std::string light_field, output;
  ReadingOptions reading;
  // Exactly one of these says what to render.
  bool as_captured = false;
  std::string view;
  std::optional<double> focus_mm, focus_disparity_px;
  bool mosaic = false;
  bool is_epi = false;
  std::string epi;
  std::string convert;
  std::string animate;
  // Settings of the rendering.
  std::string aperture_shape;
  std::optional<double> aperture_radius;
  EffectOptions effects;
  std::optional<double> noise_levels;
  std::optional<int> bits;
  std::optional<std::int64_t> seed;
  std::optional<int> frames;
  std::optional<double> seconds;
  std::string device = "auto";
};

bool IsFocused(const RenderOptions& options) {
  return options.focus_mm || options.focus_disparity_px;
}

// --- The command line.

constexpr char kWhatToRender[] =
    "--as-captured, --view, --focus, --focus-disparity, --mosaic, --epi, --convert, --animate";

std::vector<std::string> AskedFor(const RenderOptions& options) {
  std::vector<std::string> asked;
  if (options.as_captured) asked.emplace_back("--as-captured");
  if (!options.view.empty()) asked.emplace_back("--view");
  if (options.focus_mm) asked.emplace_back("--focus");
  if (options.focus_disparity_px) asked.emplace_back("--focus-disparity");
  if (options.mosaic) asked.emplace_back("--mosaic");
  if (options.is_epi) asked.emplace_back("--epi");
  if (!options.convert.empty()) asked.emplace_back("--convert");
  if (!options.animate.empty()) asked.emplace_back("--animate");
  return asked;
}

void RefuseUnless(bool fits, bool given, const char* option, const char* goes_with) {
  if (given && !fits) throw UsageError(fmt::format("{}: requires {}", option, goes_with));
}

// Whether the folder is read as thicklens stores it, without another order of the views.
bool IsReadAsStored(const LightFieldReadOptions& reading) {
  return (reading.layout.empty() || reading.layout == "thicklens") && reading.view_name.empty() &&
         reading.hci_grid == 0 && !reading.view_order.swap && !reading.view_order.mirror_u &&
         !reading.view_order.mirror_v;
}

void CheckUsage(RenderOptions* options) {
  std::vector<std::string> asked = AskedFor(*options);
  if (asked.empty() && options->aperture_radius) {  // another aperture, otherwise as captured
    options->as_captured = true;
    asked = AskedFor(*options);
  }
  if (asked.size() != 1) {
    throw UsageError(
        fmt::format("exactly one of {} is expected, found {}", kWhatToRender,
                    asked.empty() ? "none" : fmt::format("{}", fmt::join(asked, ", "))));
  }
  const bool averages = options->as_captured || IsFocused(*options) || options->animate == "focus";
  const char* const kAverages = "--as-captured, --focus, --focus-disparity or --animate focus";
  RefuseUnless(averages, !options->aperture_shape.empty(), "--aperture-shape", kAverages);
  RefuseUnless(averages, options->aperture_radius.has_value(), "--aperture", kAverages);
  if (!options->aperture_shape.empty() && options->aperture_radius)
    throw UsageError("--aperture and --aperture-shape: give at most one of them");
  RefuseUnless(options->as_captured, options->effects.effects.has_value(), "--effects",
               "--as-captured");
  RefuseUnless(options->as_captured, options->effects.without.has_value(), "--without",
               "--as-captured");
  RefuseUnless(options->as_captured, options->effects.tolerance.has_value(), "--effect-tolerance",
               "--as-captured");
  RefuseUnless(!options->animate.empty(), options->frames.has_value(), "--frames", "--animate");
  RefuseUnless(!options->animate.empty(), options->seconds.has_value(), "--seconds", "--animate");
  const LightFieldReadOptions reading = LightFieldReadOptionsOf(options->reading);
  if (!options->animate.empty() && (!IsReadAsStored(reading) || reading.inner_views ||
                                    reading.crop || reading.allow_missing_views)) {
    throw UsageError(
        "--animate shows the whole light field as it is stored, and excludes --views, --crop, "
        "--sparse, --layout, --name, --grid and --view-order");
  }
  const bool is_image = options->convert.empty() && options->animate.empty();
  const char* const kImages = "an image as output, not --convert or --animate";
  RefuseUnless(is_image, options->noise_levels.has_value(), "--noise", kImages);
  RefuseUnless(is_image, options->bits.has_value(), "--bits", kImages);
  RefuseUnless(is_image, options->seed.has_value(), "--seed", kImages);
}

struct ViewPlace {
  bool centre = false;
  double u = 0, v = 0;
  bool is_whole() const { return u == std::floor(u) && v == std::floor(v); }
};

constexpr int kMaxViewIndex = 9999;

ViewPlace ParseView(const std::string& text) {
  if (text == "centre") return {true, 0, 0};
  const std::string form = "u,v (view indices from 0) or centre";
  const std::vector<double> place = SplitNumbers("--view", text, ',', form);
  const auto fits = [](double index) { return index >= 0 && index <= kMaxViewIndex; };
  if (place.size() != 2 || !fits(place[0]) || !fits(place[1])) {
    throw UsageError(fmt::format("--view: {} is expected, each from 0 to {}, found '{}'", form,
                                 kMaxViewIndex, text));
  }
  return {false, place[0], place[1]};
}

// An epipolar line: one row or column of all views in a row or column of views; the middle ones by
// default.
struct EpiLine {
  bool is_row = true;
  std::optional<int> line, view;
};

EpiLine ParseEpi(const std::string& text) {
  EpiLine epi;
  std::istringstream parts(text);
  for (std::string part; std::getline(parts, part, ',');) {
    const auto equals = part.find('=');
    const std::string name = part.substr(0, equals);
    const bool first = !epi.line;
    const bool known = first ? name == "row" || name == "column" : name == (epi.is_row ? "v" : "u");
    if (equals == std::string::npos || !known || epi.view) {
      throw UsageError(fmt::format(
          "--epi: row=T, row=T,v=L, column=S or column=S,u=K is expected, found '{}'", text));
    }
    const std::vector<int> value = SplitPixels("--epi", part.substr(equals + 1), ',', name);
    if (first) epi.is_row = name == "row";
    (first ? epi.line : epi.view) = value.front();
  }
  return epi;
}

// --- What is rendered.

struct Rendering {
  Image image;
  std::string what;  // for the text output
  nlohmann::json details;
  std::string effects{};                  // for the text output, a line of its own; may be empty
  std::vector<std::string> effects_on{};  // of a photograph
};

OptionNames RenderOptionNames() {
  OptionNames names = {{"aperture", "--aperture and --aperture-shape"},
                       {"aperture.shape", "--aperture-shape"},
                       {"aperture.radius", "--aperture"},
                       {"effects", "--effects"},
                       {"effects.without", "--without"},
                       {"effects.tolerance", "--effect-tolerance"},
                       {"depth_mm", "--focus"},
                       {"disparity_px", "--focus-disparity"},
                       {"device", "--device"},
                       {"noise_levels", "--noise"},
                       {"bits", "--bits"}};
  return names.Add(ReadingOptionNames());
}

RenderAperture ApertureOf(const RenderOptions& options) {
  RenderAperture aperture;
  if (!options.aperture_shape.empty()) {
    aperture.shape = model::ApertureShapeFromName(options.aperture_shape);
  }
  aperture.radius = options.aperture_radius;
  return aperture;
}

void AddAperture(const RenderOptions& options, const LightField& light_field,
                 const RenderSummary& found, nlohmann::json* details) {
  if (options.aperture_radius) {
    const char* const key = light_field.camera ? "aperture_radius_mm" : "aperture_radius_steps";
    (*details)[key] = *options.aperture_radius;
  }
  if (!found.aperture_shape.empty()) (*details)["aperture_shape"] = found.aperture_shape;
  if (!found.aperture_from.empty()) (*details)["aperture_from"] = found.aperture_from;
}

std::string ApertureText(const RenderOptions& options, const LightField& light_field,
                         const RenderSummary& found) {
  if (options.aperture_radius) {
    return fmt::format("an aperture of {:g} {}", *options.aperture_radius,
                       light_field.camera ? "mm" : "view steps");
  }
  if (found.aperture_from == "assumed") return "a uniform aperture (assumed)";
  return found.aperture_shape == "own"       ? "the light field's own aperture"
         : found.aperture_shape == "pinhole" ? "a pinhole"
                                             : fmt::format("a {} aperture", found.aperture_shape);
}

Rendering RenderPhotograph(const RenderOptions& options, const LightField& light_field,
                           const RunControl& run) {
  PhotographOptions asked;
  asked.aperture = ApertureOf(options);
  asked.effects = EffectSelectionOf(options.effects);
  asked.device = options.device;
  RenderSummary found;
  Rendering rendering;
  rendering.image = thicklens::RenderPhotograph(light_field, asked, run, &found);
  spdlog::debug("device: {}", found.device_description);
  rendering.effects_on = found.effects.on.Names();
  rendering.details = {{"rendered", "as-captured"},
                       {"device", found.device},
                       {"effects", rendering.effects_on},
                       {"effect_impacts", EffectsJson(found.effects)}};
  AddAperture(options, light_field, found, &rendering.details);
  rendering.what = "photograph through " + ApertureText(options, light_field, found);
  if (!found.effects.findings.empty()) rendering.effects = EffectsText(found.effects);
  return rendering;
}

// The light field of a folder: its views, or the scene that they show, without values.
struct Source {
  LightField light_field;
  std::optional<SceneForm> scene;
};

// Whether what is asked for is rendered from the scene itself. Other images need all views.
bool IsOfTheScene(const RenderOptions& options) {
  return options.convert.empty() && (IsFocused(options) || !options.view.empty());
}

// Reads what the rendering needs.
Source ReadSource(const RenderOptions& options, const RunControl& run) {
  const LightFieldReadOptions reading = LightFieldReadOptionsOf(options.reading);
  Source source;
  if (!IsReadAsStored(reading) || !IsOfTheScene(options) || !IsSceneForm(options.light_field)) {
    source.light_field = ReadLightField(options.light_field, reading, run);
    return source;
  }
  source.scene = ReadSceneForm(options.light_field, run);
  LightField& frame = source.scene->frame;
  // Inner views are at the same places on the aperture, and a part of each is cut out at the end.
  if (reading.inner_views)
    frame = model::InnerViews(frame, reading.inner_views->u, reading.inner_views->v);
  source.light_field = reading.crop ? model::CropViews(frame, *reading.crop) : frame;
  return source;
}

Rendering RenderFocused(const RenderOptions& options, const Source& source, const RunControl& run) {
  const LightField& light_field = source.light_field;
  FocusOptions asked;
  asked.depth_mm = options.focus_mm;
  asked.disparity_px = options.focus_disparity_px;
  asked.aperture = ApertureOf(options);
  RenderSummary found;
  Rendering rendering;
  rendering.image = source.scene ? Refocus(*source.scene, asked, run, &found)
                                 : Refocus(light_field, asked, run, &found);
  const Eigen::Vector2d& disparity_px = found.disparity_px;
  rendering.details = {{"rendered", "focus"},
                       {"disparity_px", {disparity_px.x(), disparity_px.y()}}};
  if (options.focus_mm) rendering.details["focus_depth_mm"] = *options.focus_mm;
  AddAperture(options, light_field, found, &rendering.details);
  rendering.what = options.focus_mm
                       ? fmt::format("focus at {:g} mm (disparity {:.4g} px per view step)",
                                     *options.focus_mm, disparity_px.x())
                       : fmt::format("focus at disparity {:g} px per view step", disparity_px.x());
  rendering.what += " through " + ApertureText(options, light_field, found);
  return rendering;
}

Rendering RenderView(const RenderOptions& options, const Source& source) {
  const LightField& light_field = source.light_field;
  ViewPlace place = ParseView(options.view);
  if (place.centre) {
    place.u = (light_field.u_count - 1) / 2.0;
    place.v = (light_field.v_count - 1) / 2.0;
    if (!source.scene && !place.is_whole()) {
      throw Error(
          fmt::format("--view centre: {} has {}x{} views, with none in the middle; give --view "
                      "u,v",
                      options.light_field, light_field.u_count, light_field.v_count));
    }
  }
  const double u = place.u, v = place.v;
  if (u > light_field.u_count - 1 || v > light_field.v_count - 1) {
    throw Error(
        fmt::format("--view {:g},{:g}: {} has {}x{} views: u must be from 0 to {}, v from 0 to "
                    "{}",
                    u, v, options.light_field, light_field.u_count, light_field.v_count,
                    light_field.u_count - 1, light_field.v_count - 1));
  }
  Rendering rendering;
  rendering.what = fmt::format("view ({:g}, {:g})", u, v);
  rendering.details = {{"rendered", "view"}, {"u", u}, {"v", v}};
  if (place.is_whole()) {
    rendering.details["u"] = static_cast<int>(u);
    rendering.details["v"] = static_cast<int>(v);
  }
  if (source.scene) {
    rendering.image = thicklens::RenderView(*source.scene, u, v);
    return rendering;
  }
  if (!place.is_whole()) {
    const std::string what = fmt::format("--view {:g},{:g}: ", u, v);
    if (IsSceneForm(options.light_field)) {
      throw Error(what +
                  "views between the views exclude --layout, --name, --grid and "
                  "--view-order");
    }
    throw Error(fmt::format(
        "{}{} holds views, and none between them; give whole numbers, or estimate it with --store "
        "scene",
        what, options.light_field));
  }
  const auto k = static_cast<int>(u), l = static_cast<int>(v);
  if (!light_field.IsPresent(k, l))
    throw Error(fmt::format("--view {},{}: {} has no such view", k, l, options.light_field));
  rendering.image = ViewOf(light_field, k, l);
  return rendering;
}

int Chosen(const std::string& name, const std::optional<int>& asked, int count,
           const std::string& light_field) {
  if (!asked) return count / 2;
  if (*asked < count) return *asked;
  throw Error(fmt::format("--epi: {} is {}: in {} it must be from 0 to {}", name, *asked,
                          light_field, count - 1));
}

Rendering RenderEpi(const RenderOptions& options, const LightField& light_field) {
  const EpiLine epi = ParseEpi(options.epi);
  const std::string& name = options.light_field;
  if (epi.is_row) {
    const int t = Chosen("row", epi.line, light_field.t_count, name);
    const int l = Chosen("v", epi.view, light_field.v_count, name);
    return {RenderEpipolarRow(light_field, t, l, kEpipolarRepeatPx),
            fmt::format("row {} of the views in row {}, one above the other", t, l),
            {{"rendered", "epi"}, {"row", t}, {"v", l}}};
  }
  const int s = Chosen("column", epi.line, light_field.s_count, name);
  const int k = Chosen("u", epi.view, light_field.u_count, name);
  return {RenderEpipolarColumn(light_field, s, k, kEpipolarRepeatPx),
          fmt::format("column {} of the views in column {}, side by side", s, k),
          {{"rendered", "epi"}, {"column", s}, {"u", k}}};
}

Rendering RenderAny(const RenderOptions& options, const Source& source, const RunControl& run) {
  const LightField& light_field = source.light_field;
  if (options.as_captured) return RenderPhotograph(options, light_field, run);
  if (IsFocused(options)) return RenderFocused(options, source, run);
  if (options.is_epi) return RenderEpi(options, light_field);
  if (!options.mosaic) return RenderView(options, source);
  return {
      RenderMosaic(light_field, kMosaicGapPx), "all views side by side", {{"rendered", "mosaic"}}};
}

void AddToSummary(const RenderOptions& options, const LightField& light_field,
                  double clipped_fraction, double seconds, nlohmann::json* summary) {
  summary->update({{"status", "ok"},
                   {"reason", ""},
                   {"light_field", options.light_field},
                   {"output", options.output},
                   {"views", {light_field.u_count, light_field.v_count}},
                   {"size", {light_field.s_count, light_field.t_count}},
                   {"channels", light_field.channels},
                   {"clipped_fraction", clipped_fraction},
                   {"seconds", seconds}});
}

std::string ClippedText(double fraction) {
  return fraction > 0 ? fmt::format("clipped: {:.3g} % of the values\n", 100 * fraction)
                      : "clipped: no values\n";
}

// The description in the file: "photograph through ...; effects: defocus, falloff".
std::string Description(const RenderOptions& options, const Rendering& rendering) {
  if (!options.as_captured) return rendering.what;
  return fmt::format("{}; effects: {}", rendering.what,
                     rendering.effects_on.empty()
                         ? "none"
                         : fmt::format("{}", fmt::join(rendering.effects_on, ", ")));
}

constexpr int kFloatBits = 32;

bool HoldsLight(ImageFileFormat format) {
  return format == ImageFileFormat::kExr || format == ImageFileFormat::kPfm;
}

std::string BitsText(const ImageFileOptions& file) {
  if (HoldsLight(file.format)) return "linear light as floats";
  return fmt::format("{} bit", file.bits);
}

// Refuses before anything is computed what the kind of file cannot hold.
void RequireHeld(const RenderOptions& options, const ImageFileOptions& file) {
  const bool has_8_bits = file.format == ImageFileFormat::kJpeg ||
                          file.format == ImageFileFormat::kWebp ||
                          file.format == ImageFileFormat::kBmp;
  if (has_8_bits && file.bits != 8) {
    throw UsageError(
        fmt::format("--bits: {} has 8 bits per value, found {}; .png, .tif and .ppm hold 16",
                    options.output, file.bits));
  }
  if (HoldsLight(file.format) && options.bits) {
    throw UsageError(fmt::format("--bits: {} holds floats; leave the option out", options.output));
  }
  if (HoldsLight(file.format) && options.noise_levels) {
    throw UsageError(fmt::format(
        "--noise: {} holds floats, to which no noise of rounding is added; leave the option out",
        options.output));
  }
}

CommandResult RenderImage(const RenderOptions& options) {
  const auto start = Clock::now();
  ImageFileOptions file;
  try {
    file.format = ImageFormatOfName(options.output);
  } catch (const Error& error) {
    throw UsageError(error.what());
  }
  file.bits = options.bits.value_or(kDefaultBits);
  file.noise_levels = options.noise_levels.value_or(0);
  file.seed = static_cast<std::uint64_t>(options.seed.value_or(0));
  RequireHeld(options, file);
  OutputFile output(options.output);
  const CommandRun run(options.common, RenderOptionNames());
  const Source source = ReadSource(options, run.control());
  const LightField& light_field = source.light_field;
  ThrowIfCancelled();
  Rendering rendering =
      WithOptionNames(run.names(), [&] { return RenderAny(options, source, run.control()); });
  if (source.scene && LightFieldReadOptionsOf(options.reading).crop)
    rendering.image = rendering.image.Cropped(*LightFieldReadOptionsOf(options.reading).crop);
  ThrowIfCancelled();

  file.description = Description(options, rendering);
  const Image& image = rendering.image;
  const EncodedImageFile encoded =
      WithOptionNames(run.names(), [&] { return EncodeImage(image, file); });
  output.Commit(encoded.bytes);

  const double fraction = static_cast<double>(encoded.clipped_values) /
                          static_cast<double>(image.light().values.size());
  CommandResult result;
  result.is_written = true;
  result.summary = std::move(rendering.details);
  result.summary.update({{"width_px", image.width_px()},
                         {"height_px", image.height_px()},
                         {"bits", HoldsLight(file.format) ? kFloatBits : file.bits},
                         {"noise_levels", file.noise_levels},
                         {"seed", file.seed}});
  AddToSummary(options, light_field, fraction, SecondsSince(start), &result.summary);
  const std::string noise = file.noise_levels > 0 ? fmt::format(", noise {:g}/255 (seed {})",
                                                                file.noise_levels, file.seed)
                                                  : "";
  PrintResult(
      options.common,
      fmt::format("{}\n{} x {} views -> {} x {} px, {} channel(s), {}{}: {}\n{}", rendering.what,
                  light_field.u_count, light_field.v_count, image.width_px(), image.height_px(),
                  image.channels(), BitsText(file), noise, options.output, ClippedText(fraction)) +
          rendering.effects);
  return result;
}

CommandResult Convert(const RenderOptions& options) {
  const auto start = Clock::now();
  const LightFieldFormat format = options.convert == "hci"              ? LightFieldFormat::kHci
                                  : options.convert == "thicklens-tiff" ? LightFieldFormat::kTiff
                                                                        : LightFieldFormat::kPng;
  OutputFolder folder = ClaimLightFieldFolder(options.output, format);
  const CommandRun run(options.common, RenderOptionNames());
  const LightField light_field =
      ReadLightField(options.light_field, LightFieldReadOptionsOf(options.reading), run.control());
  const std::size_t clipped = WriteLightField(&folder, light_field, format, run.control());
  ThrowIfCancelled();
  folder.Commit();

  const double fraction =
      static_cast<double>(clipped) / static_cast<double>(light_field.values.size());
  CommandResult result;
  result.is_written = true;
  result.summary = {{"rendered", "convert"}, {"layout", options.convert}};
  AddToSummary(options, light_field, fraction, SecondsSince(start), &result.summary);
  PrintResult(
      options.common,
      fmt::format("{} x {} views of {} x {} px, {} channel(s), as {}: {}\n{}", light_field.u_count,
                  light_field.v_count, light_field.s_count, light_field.t_count,
                  light_field.channels, options.convert, options.output, ClippedText(fraction)));
  return result;
}

// --- Animations.

OptionNames AnimationOptionNames() {
  OptionNames names = RenderOptionNames();
  return names.Add({{"frames", "--frames"}, {"seconds", "--seconds"}});
}

CommandResult Animate(const RenderOptions& options) {
  const auto start = Clock::now();
  constexpr char kEnding[] = ".webp";
  if (fs::path(options.output).extension() != kEnding) {
    throw UsageError(fmt::format("-o {}: an animation is a WebP file; its name must end in {}",
                                 options.output, kEnding));
  }
  AnimationOptions asked;
  asked.kind = options.animate == "focus" ? AnimationKind::kFocus : AnimationKind::kParallax;
  asked.frames = options.frames.value_or(asked.frames);
  asked.seconds = options.seconds.value_or(asked.seconds);
  asked.aperture = ApertureOf(options);
  OutputFile output(options.output);
  const CommandRun run(options.common, AnimationOptionNames());
  if (!IsSceneForm(options.light_field)) {
    throw Error(fmt::format(
        "{}: an animation shows views between the views, which only a light field has that is "
        "stored as its scene (estimate --store scene)",
        options.light_field));
  }
  const SceneForm scene = ReadSceneForm(options.light_field, run.control());
  const std::string bytes =
      WithOptionNames(run.names(), [&] { return RenderAnimation(scene, asked, run.control()); });
  ThrowIfCancelled();
  output.Commit(bytes);

  CommandResult result;
  result.is_written = true;
  result.summary = {{"rendered", "animation"},
                    {"kind", options.animate},
                    {"frames", asked.frames},
                    {"animation_seconds", asked.seconds}};
  AddToSummary(options, scene.frame, 0, SecondsSince(start), &result.summary);
  PrintResult(options.common,
              fmt::format("{} in {} frames of {} x {} px, {:g} s: {}\n",
                          options.animate == "focus" ? "focus from far to near and back"
                                                     : "viewpoint once around the aperture",
                          asked.frames, scene.frame.s_count, scene.frame.t_count, asked.seconds,
                          options.output));
  return result;
}

// --- Its options.

void AddWhatToRender(CLI::App* command, RenderOptions* options) {
  command->add_flag("--as-captured", options->as_captured, "Photograph through the whole aperture");
  command
      ->add_option(
          "--view", options->view,
          "One view: its indices from 0, or centre; numbers between them for a light field "
          "that is stored as its scene")
      ->type_name("U,V");
  command
      ->add_option("--focus", options->focus_mm,
                   "Photograph refocused at this depth; needs a camera")
      ->check(Between(0, kMaxLengthMm, "millimetres"))
      ->type_name("MM");
  command
      ->add_option("--focus-disparity", options->focus_disparity_px,
                   "Photograph refocused at this disparity, px per view step, near positive")
      ->check(Finite())
      ->type_name("PX");
  command->add_flag("--mosaic", options->mosaic, "All views side by side");
  command
      ->add_option("--epi", options->epi,
                   "Epipolar image: row=T[,v=L] or column=S[,u=K]; the middle row without a value")
      ->expected(0, 1)
      ->type_name("LINE");
  command
      ->add_option("--convert", options->convert,
                   "Convert the light field to a folder: thicklens (16-bit PNG), thicklens-tiff "
                   "(float) or hci (8-bit PNG in the layout of the HCI benchmark)")
      ->check(CLI::IsMember({"thicklens", "hci", "thicklens-tiff"}))
      ->type_name("LAYOUT");
  command
      ->add_option(
          "--animate", options->animate,
          "Animation that repeats, as a WebP file: parallax (the viewpoint goes around the "
          "aperture) or focus (it goes from far to near and back); of a light field that "
          "is stored as its scene")
      ->check(CLI::IsMember({"parallax", "focus"}))
      ->type_name("WHAT");
}

void AddHowToRender(CLI::App* command, RenderOptions* options) {
  AddApertureShapeOption(command, &options->aperture_shape);
  command
      ->add_option("--aperture", options->aperture_radius,
                   "Radius of another aperture, in mm with a camera, otherwise in view steps; "
                   "implies --as-captured if nothing else is requested")
      ->check(NonNegative())
      ->type_name("R");
  AddEffectOptions(command, &options->effects);
  AddFormerEffectTolerance(command, &options->effects, &options->common);
  command
      ->add_option("--noise", options->noise_levels,
                   "Add normally distributed noise of N/255 to the encoded values")
      ->check(NonNegative())
      ->type_name("N");
  command->add_option("--seed", options->seed, "Seed of the noise; default 0")
      ->check(CLI::Range(std::int64_t{0}, std::numeric_limits<std::int64_t>::max()))
      ->type_name("N");
  command->add_option("--bits", options->bits, "Bits per value of the image: 8 (default) or 16")
      ->check(CLI::IsMember({8, 16}))
      ->type_name("N");
  command->add_option("--frames", options->frames, "Frames of the animation; default 36")
      ->check(CLI::Range(2, 1000))
      ->type_name("N");
  command->add_option("--seconds", options->seconds, "Length of the animation; default 3")
      ->check(CLI::Range(0.1, 3600.0))
      ->type_name("S");
  AddDeviceOption(command, &options->device);
}

}  // namespace

void AddRenderCommand(CLI::App* program, CommandAction* action) {
  CLI::App* command = program->add_subcommand(
      "render", "Render images from a light field, or convert it to another layout");
  const auto options = std::make_shared<RenderOptions>();
  command
      ->add_option("light_field", options->light_field,
                   "Folder of a light field, in the layout of thicklens or HCI")
      ->required()
      ->type_name("LF");
  command
      ->add_option("-o,--output", options->output,
                   "Image file to write, of the kind that its ending names (.png .jpg .tif .exr "
                   ".webp .bmp .ppm .pfm); "
                   "with --convert a folder, with --animate a .webp file")
      ->required()
      ->type_name("OUT");
  AddWhatToRender(command, options.get());
  AddHowToRender(command, options.get());
  AddReadingOptions(command, &options->reading);
  AddCommonOptions(command, &options->common);
  command->callback([options, action, command] {
    options->is_epi = command->count("--epi") > 0;
    *action = [options] {
      CheckUsage(options.get());
      if (!options->view.empty()) ParseView(options->view);
      ParseEpi(options->epi);
      LightFieldReadOptionsOf(options->reading);  // reports wrong usage before any work begins
      RequireDistinctFiles({options->common.json_path, options->output}, {options->light_field});
      RunCommand(options->common, [&] {
        if (!options->animate.empty()) return Animate(*options);
        return options->convert.empty() ? RenderImage(*options) : Convert(*options);
      });
    };
  });
}

}  // namespace thicklens::tools
