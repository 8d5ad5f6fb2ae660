#include "tools/interface/contradiction.h"

#include <fmt/format.h>

#include <cmath>
#include <utility>

#include "thicklens/base/stopwatch.h"

namespace thicklens {
namespace {

using estimator::DepthCause;
using estimator::DepthCauseTrial;

model::DepthFlip FlipOf(DepthCause cause) {
  return cause == DepthCause::kRows      ? model::DepthFlip::kRows
         : cause == DepthCause::kColumns ? model::DepthFlip::kColumns
                                         : model::DepthFlip::kBoth;
}

std::string FlippedText(const DepthOrigin& depth, DepthCause cause, const RunScope& run) {
  const model::DepthFlip flip = model::Combined(depth.flip, FlipOf(cause));
  const std::string how = cause == DepthCause::kRows      ? "upside down"
                          : cause == DepthCause::kColumns ? "with left and right exchanged"
                                                          : "turned by 180 degrees";
  return fmt::format("it is stored {} ({} reads it the other way)", how,
                     flip == model::DepthFlip::kNone
                         ? fmt::format("without {} the program", run.Option("depth.flip"))
                         : fmt::format("{} {}", run.Option("depth.flip"), DepthFlipName(flip)));
}

// The options that make scale * d + offset of the map's present disparities d.
std::string ValuesText(const DepthOrigin& depth, double scale, double offset_px,
                       const RunScope& run) {
  return fmt::format("{} {:.3g} {} {:.3g}", run.Option("depth.meaning.disparity_scale"),
                     scale * depth.meaning.disparity_scale,
                     run.Option("depth.meaning.disparity_offset_px"),
                     scale * depth.meaning.disparity_offset_px + offset_px);
}

// A negative scale exchanges near and far.
std::string ScaleOffsetText(const DepthOrigin& depth, const DepthCauseTrial& cause,
                            const RunScope& run) {
  const bool is_reversed = cause.scale < 0;
  if (depth.meaning.kind == DepthKind::kDisparity) {
    return is_reversed ? "near and far are exchanged, and the offset is wrong"
                       : "scale and offset are wrong";
  }
  const std::string focus =
      fmt::format("the camera is focused elsewhere (are its focus distance and {} right?)",
                  run.Option("lens_position"));
  return is_reversed ? fmt::format("near and far are exchanged (is {} right?), and {}",
                                   run.Option("depth.meaning.kind"), focus)
                     : fmt::format(
                           "the predicted blur needs a factor of about {:.2g} (are {} and "
                           "the camera's aperture right?), and {}",
                           cause.scale, run.Option("depth.meaning.unit"), focus);
}

std::string CauseText(const DepthOrigin& depth, const DepthCauseTrial& cause, const RunScope& run) {
  const bool is_disparity = depth.meaning.kind == DepthKind::kDisparity;
  const auto values = [&] {
    return is_disparity ? fmt::format(" ({})", ValuesText(depth, cause.scale, cause.offset_px, run))
                        : "";
  };
  switch (cause.cause) {
    case DepthCause::kRows:
    case DepthCause::kColumns:
    case DepthCause::kBoth:
      return FlippedText(depth, cause.cause, run);
    case DepthCause::kQuarterRight:
    case DepthCause::kQuarterLeft:
      return fmt::format(
          "it has to be turned by 90 degrees {} (or the photograph is stored turned: {})",
          cause.cause == DepthCause::kQuarterRight ? "clockwise" : "counter-clockwise",
          run.Option("photo.orientation"));
    case DepthCause::kShift:
      return fmt::format(
          "it lies beside the photograph and has to move by about {} px to the {} and {} px {} ({} "
          "states which part of the photograph it covers, {} the camera that it was captured by)",
          std::abs(cause.shift_x_px), cause.shift_x_px < 0 ? "left" : "right",
          std::abs(cause.shift_y_px), cause.shift_y_px < 0 ? "up" : "down",
          run.Option("depth_fit.part"), run.Option("depth_fit.camera"));
    case DepthCause::kSign:
      return "near and far are exchanged" +
             (is_disparity ? values()
                           : fmt::format(" (is {} right?)", run.Option("depth.meaning.kind")));
    case DepthCause::kScale:
      return is_disparity ? fmt::format(
                                "its scale is wrong, or the aperture is, by a factor of about "
                                "{:.2g}{}",
                                cause.scale, values())
                          : fmt::format(
                                "the predicted blur needs a factor of about {:.2g}: its unit ({}) "
                                "or the camera's aperture is wrong",
                                cause.scale, run.Option("depth.meaning.unit"));
    case DepthCause::kOffset:
      return is_disparity ? fmt::format("its offset is wrong by about {:.2g} px per view step{}",
                                        cause.offset_px, values())
                          : fmt::format(
                                "the camera is focused elsewhere, by {:.2g} px of disparity per "
                                "view step (are its focus distance and {} right?)",
                                cause.offset_px, run.Option("lens_position"));
    case DepthCause::kScaleOffset:
      return ScaleOffsetText(depth, cause, run) + values();
    case DepthCause::kSharp:
      return fmt::format("the photograph is sharp at all depths ({} sharp)",
                         run.Option("solver.photo"));
    case DepthCause::kOtherImage:
      return fmt::format(
          "it belongs to another image, or to another part of this one (are {} and the photograph "
          "the files of one capture?)",
          depth.name);
    case DepthCause::kNone:
      break;
  }
  return "";
}

}  // namespace

void FindContradiction(const PreparedProblem& prepared, bool is_in_doubt, RunScope* run,
                       LightFieldEstimate* estimate) {
  EstimateDiagnostics& found = estimate->diagnostics;
  constexpr double kMaxGuessed = 0.5;
  if (found.holes_share > kMaxGuessed) {
    // Areas that were filled in are no statement of the map.
    estimator::DepthContradiction skipped;
    skipped.values_untested = fmt::format(
        "{:.0f} % of the depth is guessed, because the map has no "
        "values there",
        100 * found.holes_share);
    skipped.message =
        "the depth cannot be compared with the photograph: " + skipped.values_untested;
    skipped.trials.emplace_back();
    found.contradiction = std::move(skipped);
    return;
  }
  const auto start = Clock::now();
  estimator::DepthContradictionOptions check;
  check.falloff = prepared.effects.on.Has(Effect::kFalloff);
  check.compression_sigma = found.compression_sigma.value_or(0);
  check.photo_aperture = found.used_photo_aperture;
  // A photograph that shows the predicted blur says nothing against the values.
  const bool shows_blur =
      found.photo_aperture && found.photo_aperture->share &&
      found.photo_aperture->verdict == estimator::PhotoAperture::Verdict::kCaptured &&
      std::abs(*found.photo_aperture->share - 1) <= 0.2;
  check.check_values = is_in_doubt || !shows_blur;
  check.threads = run->threads();
  try {
    found.contradiction = estimator::CheckContradiction(*prepared.input, check);
  } catch (const Interrupted&) {
    throw;
  } catch (const Error& error) {
    run->Detail(fmt::format("whether the photograph contradicts the depth was not checked: {}",
                            error.what()));
  }
  estimate->summary.seconds.contradiction = SecondsSince(start);
}

std::string ContradictionText(const DepthOrigin& depth, const estimator::DepthContradiction& found,
                              const RunScope& run) {
  if (!found.is_contradicted || found.causes.empty()) return "";
  std::string text =
      fmt::format("{}: the photograph contradicts the depth: {}; most likely {}", depth.name,
                  found.message, CauseText(depth, found.causes.front(), run));
  for (std::size_t i = 1; i < found.causes.size(); ++i)
    text += fmt::format("; about as likely, {}", CauseText(depth, found.causes[i], run));
  if (found.is_sign_open) {
    const DepthCauseTrial& cause = found.causes.front();
    text += fmt::format(
        "; or the same with the opposite sign{}: blur alone is the same on both sides of the plane "
        "of focus, and the edges of the photograph do not decide by 4 standard deviations; a part "
        "that is known to lie before or behind that plane would",
        depth.meaning.kind == DepthKind::kDisparity
            ? fmt::format(" ({})", ValuesText(depth, -cause.scale, -cause.offset_px, run))
            : "");
  }
  return text;
}

}  // namespace thicklens
