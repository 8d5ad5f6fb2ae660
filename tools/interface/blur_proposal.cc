#include "tools/interface/blur_proposal.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "thicklens/model/light_field_grid.h"
#include "thicklens/model/thick_lens.h"

namespace thicklens {
namespace {

std::string NarrowerBlurText(const estimator::BlurCheck& check,
                             const BlurProposal::NarrowerBlur& proposed,
                             const estimator::EstimateInput& input, const RunScope& run) {
  const std::string change =
      proposed.disparity_scale
          ? fmt::format("{} {:.4g} {} {:.4g}", run.Option("depth.meaning.disparity_scale"),
                        *proposed.disparity_scale, run.Option("depth.meaning.disparity_offset_px"),
                        *proposed.disparity_offset_px)
          : fmt::format("a blur_ratio of {:.3g} instead of {:.3g}, or an aperture as much smaller",
                        *proposed.blur_ratio, input.camera->blur_ratio());
  return fmt::format("a blur at most about {:.2g} times as wide{} ({}) leaves {:.0f} % of that",
                     check.narrower_blur->blur_scale,
                     check.narrower_blur_at_end ? ", the smallest that was tried" : "", change,
                     100 * check.narrower_blur->unexplained);
}

std::string OtherFocusText(const estimator::BlurCheck& check,
                           const BlurProposal::OtherFocus& proposed,
                           const estimator::EstimateInput& input, const RunScope& run) {
  const std::string change =
      proposed.disparity_offset_px
          ? fmt::format("{} {:.4g}", run.Option("depth.meaning.disparity_offset_px"),
                        *proposed.disparity_offset_px)
          : fmt::format("a plane of focus at {} instead of {:.4g} mm",
                        std::isfinite(*proposed.focus_depth_mm)
                            ? fmt::format("{:.4g} mm", *proposed.focus_depth_mm)
                            : "infinity",
                        input.camera->focus_depth_mm());
  return fmt::format("{}{} ({:+.2g} px of disparity per view step) leaves {:.0f} % of it", change,
                     check.other_focus_at_end ? ", the farthest that was tried," : "",
                     check.other_focus->focus_offset_px, 100 * check.other_focus->unexplained);
}

}  // namespace

double FocusDepthForOffsetMm(const estimator::EstimateInput& input, double offset_px) {
  const model::Camera& camera = *input.camera;
  const model::ApertureSamples samples =
      model::SampleAperture(input.weights, camera.blur_ratio(), camera.lens.aperture_radius_mm);
  const double step_mm = std::max(samples.u_step_mm, samples.v_step_mm);
  const double scale_mm =
      model::DefocusScaleMm(camera.lens, camera.calibration->image_distance_mm->value);
  const double inverse =
      1 / camera.focus_depth_mm() - offset_px * camera.sensor.pixel_pitch_mm / (step_mm * scale_mm);
  return inverse > 0 ? 1 / inverse : std::numeric_limits<double>::infinity();
}

BlurProposal ProposalOf(const estimator::BlurCheck& check, const estimator::EstimateInput& input,
                        const DepthMeaning& meaning) {
  const bool in_disparity = meaning.kind == DepthKind::kDisparity;
  BlurProposal proposal;
  if (check.narrower_blur) {
    const double scale = check.narrower_blur->blur_scale;
    BlurProposal::NarrowerBlur& blur = proposal.narrower_blur.emplace();
    if (in_disparity) {
      blur.disparity_scale = scale * meaning.disparity_scale;
      blur.disparity_offset_px = scale * meaning.disparity_offset_px;
    } else {
      blur.blur_ratio = scale * input.camera->blur_ratio();
    }
  }
  if (check.other_focus) {
    const double offset_px = check.other_focus->focus_offset_px;
    BlurProposal::OtherFocus& focus = proposal.other_focus.emplace();
    if (in_disparity) {
      focus.disparity_offset_px = meaning.disparity_offset_px + offset_px;
    } else {
      focus.focus_depth_mm = FocusDepthForOffsetMm(input, offset_px);
    }
  }
  return proposal;
}

std::string BlurWarning(const estimator::BlurCheck& check, const BlurProposal& proposal,
                        const estimator::EstimateInput& input, const RunScope& run) {
  const bool both = proposal.narrower_blur && proposal.other_focus;
  if (!proposal.narrower_blur && !proposal.other_focus) return "";
  std::string text = fmt::format(
      "the photograph is sharper than camera and depth predict: {} of {} blocks are not explained "
      "beyond their noise; ",
      check.unexplained_blocks, check.blocks);
  if (proposal.narrower_blur) text += NarrowerBlurText(check, *proposal.narrower_blur, input, run);
  if (both) text += "; ";
  if (proposal.other_focus) text += OtherFocusText(check, *proposal.other_focus, input, run);
  if (both) text += "; the photograph does not show which of the two is right";
  return text + "; none of this was applied";
}

}  // namespace thicklens
