#include "thicklens/light_field.h"

#include <fmt/format.h>

#include <array>
#include <cctype>
#include <cstddef>
#include <string>
#include <utility>
#include <vector>

#include "thicklens/base/error.h"
#include "thicklens/base/output_file.h"
#include "thicklens/estimate.h"
#include "thicklens/io/aperture_statement.h"
#include "thicklens/io/confidence_files.h"
#include "thicklens/io/light_field_io.h"
#include "tools/interface/run_scope.h"
#include "tools/interface/validation.h"

namespace thicklens {
namespace {

io::LightFieldReading ReadingOf(const LightFieldReadOptions& options) {
  io::LightFieldReading reading;
  reading.grid = options.hci_grid;
  reading.sparse = options.allow_missing_views;
  if (options.inner_views) {
    reading.u_count = options.inner_views->u;
    reading.v_count = options.inner_views->v;
  }
  reading.crop = options.crop;
  reading.layout = options.layout;
  if (options.layout_counts) {
    reading.layout_u = options.layout_counts->u;
    reading.layout_v = options.layout_counts->v;
  }
  reading.name = options.view_name;
  reading.swap_uv = options.view_order.swap;
  reading.mirror_u = options.view_order.mirror_u;
  reading.mirror_v = options.view_order.mirror_v;
  return reading;
}

// A message of tools/io with the options as the program's user types them: "the option sparse"
// becomes "the option --sparse". Without such names it stays as it is.
std::string WithTypedOptions(const RunScope& scope, std::string text) {
  constexpr std::array<std::pair<const char*, const char*>, 7> kFields = {
      {{"sparse", "allow_missing_views"},
       {"grid", "hci_grid"},
       {"layout", "layout"},
       {"name", "view_name"},
       {"view-order", "view_order"},
       {"views", "inner_views"},
       {"crop", "crop"}}};
  const std::string before = "the option ";
  for (const auto& [word, field] : kFields) {
    const std::string typed = scope.Option(field);
    if (typed == field) continue;
    const std::string searched = before + word;
    for (std::size_t at = text.find(searched); at != std::string::npos;
         at = text.find(searched, at + 1)) {
      const std::size_t end = at + searched.size();
      const bool is_whole =
          end >= text.size() || std::isalpha(static_cast<unsigned char>(text[end])) == 0;
      if (is_whole) text.replace(at, searched.size(), before + typed);
    }
  }
  return text;
}

ChannelOrder OrderOf(const model::LinearImage& image) {
  if (image.channels == 1) return ChannelOrder::kGrey;
  if (image.channels == 3) return ChannelOrder::kRgb;
  throw Error(fmt::format("image: 1 or 3 channels are expected, found {}", image.channels));
}

void RequireValid(const LightField& light_field) {
  checks::RequireValidInput(light_field.source.empty() ? "light field" : light_field.source,
                            light_field);
}

void RequireFormat(LightFieldFormat format) {
  checks::RequireOneOf("format", LightFieldFormat::kScene, format);
}

// Views do not state the scene that they show.
void RequireFormatOfViews(LightFieldFormat format) {
  RequireFormat(format);
  if (format != LightFieldFormat::kScene) return;
  throw OptionError("format",
                    "format: a light field of views cannot be written as its scene; an estimate "
                    "with LightFieldForm::kScene has one");
}

// The confidence has one byte for each ray, or is absent.
void RequireFittingConfidence(const LightFieldEstimate& estimate) {
  const LightField& light_field = estimate.light_field;
  const std::size_t rays = light_field.ViewStart(1, 0, 0);
  if (estimate.confidence.empty() || estimate.confidence.size() == rays) return;
  throw Error(fmt::format(
      "confidence: {} bytes are expected ({}x{} views of {}x{} rays), or none, found {}", rays,
      light_field.u_count, light_field.v_count, light_field.s_count, light_field.t_count,
      estimate.confidence.size()));
}

}  // namespace

LightField ReadLightField(const std::string& folder, const LightFieldReadOptions& options,
                          const RunControl& run) {
  checks::RequireValid(run);
  checks::RequireValid(options);
  RunScope scope(run);
  io::LightFieldFacts facts;
  LightField light_field;
  try {
    light_field = io::ReadLightField(folder, ReadingOf(options), &facts);
  } catch (const Interrupted&) {
    throw;
  } catch (const Error& error) {
    throw Error(WithTypedOptions(scope, error.what()));
  }
  if (!facts.is_plain) scope.Inform(WithTypedOptions(scope, facts.one_line));
  for (const std::string& notice : facts.notices) scope.Warn(WithTypedOptions(scope, notice));
  return light_field;
}

std::vector<std::uint8_t> ReadConfidence(const std::string& folder, const RunControl& run) {
  checks::RequireValid(run);
  const RunScope scope(run);
  return io::ReadConfidence(folder, run.threads);
}

ApertureViews ReadApertureViews(const std::string& folder, const LightFieldReadOptions& options,
                                const RunControl& run) {
  const LightField light_field = ReadLightField(folder, options, run);
  return {model::DescriptionOf(light_field), io::StatesAperture(folder), folder};
}

Image ViewOf(const LightField& light_field, int k, int l) {
  RequireValid(light_field);
  model::LinearImage view = model::ViewImage(light_field, k, l);
  if (!light_field.IsPresent(k, l)) throw Error(fmt::format("view ({}, {}) is missing", k, l));
  const ChannelOrder order = OrderOf(view);
  Image image = Image::FromLight(view.width_px, view.height_px, order, std::move(view.values),
                                 light_field.transfer, fmt::format("view ({}, {})", k, l));
  image.SetColourProfile(light_field.colour_profile);
  return image;
}

OutputFolder ClaimLightFieldFolder(const std::string& folder, LightFieldFormat format) {
  RequireFormat(format);
  if (format == LightFieldFormat::kHci) return io::ClaimHciFolder(folder);
  return OutputFolder(folder, io::kLightFieldMarker, io::LightFieldEntries());
}

std::size_t WriteLightField(OutputFolder* folder, const LightField& light_field,
                            LightFieldFormat format, const RunControl& run) {
  checks::RequireValid(run);
  RequireFormatOfViews(format);
  if (folder == nullptr) throw Error("folder: a claimed folder is expected, found null");
  RequireValid(light_field);
  const RunScope scope(run);
  if (format == LightFieldFormat::kHci) return io::WriteHciLightField(light_field, folder);
  return io::WriteLightField(
      light_field, format == LightFieldFormat::kPng ? io::ViewFormat::kPng : io::ViewFormat::kTiff,
      folder);
}

std::size_t WriteLightField(const std::string& folder, const LightField& light_field,
                            LightFieldFormat format, const RunControl& run) {
  checks::RequireValid(run);
  RequireFormatOfViews(format);
  RequireValid(light_field);
  const RunScope scope(run);
  OutputFolder output = ClaimLightFieldFolder(folder, format);
  const std::size_t clipped = WriteLightField(&output, light_field, format, run);
  ThrowIfCancelled();
  output.Commit();
  return clipped;
}

std::size_t WriteLightField(const std::string& folder, const LightFieldEstimate& estimate,
                            LightFieldFormat format, const RunControl& run) {
  checks::RequireValid(run);
  RequireFormat(format);
  if (format == LightFieldFormat::kScene) {
    if (!estimate.scene) {
      throw Error(
          "scene: the estimate has views and no scene; LightFieldForm::kScene in its options keeps "
          "it");
    }
    WriteSceneForm(folder, *estimate.scene, run);
    return 0;
  }
  if (estimate.scene) {                     // its views were not made
    ClaimLightFieldFolder(folder, format);  // refuses a wrong folder before the work
    const RunScope scope(run);
    LightFieldEstimate rendered;
    rendered.light_field = ViewsOf(*estimate.scene, run);
    rendered.confidence = estimator::RayConfidenceOf(*estimate.scene, run.threads);
    return WriteLightField(folder, rendered, format, run);
  }
  const LightField& light_field = estimate.light_field;
  RequireValid(light_field);
  RequireFittingConfidence(estimate);
  if (format == LightFieldFormat::kHci || estimate.confidence.empty()) {
    return WriteLightField(folder, light_field, format, run);
  }
  const RunScope scope(run);
  OutputFolder output = ClaimLightFieldFolder(folder, format);
  io::LightFieldWriter writer(
      light_field.transfer,
      format == LightFieldFormat::kPng ? io::ViewFormat::kPng : io::ViewFormat::kTiff, &output,
      light_field.colour_profile);
  io::WriteViews(light_field, &writer);
  const auto view_size = static_cast<std::ptrdiff_t>(light_field.view_size());
  for (int i = 0; i < light_field.u_count * light_field.v_count; ++i) {
    ThrowIfCancelled();
    const auto first = estimate.confidence.begin() + i * view_size;
    writer.WriteConfidence(i % light_field.u_count, i / light_field.u_count,
                           {first, first + view_size}, light_field.s_count);
  }
  const std::size_t clipped = writer.Finish(light_field);
  ThrowIfCancelled();
  output.Commit();
  return clipped;
}

}  // namespace thicklens
