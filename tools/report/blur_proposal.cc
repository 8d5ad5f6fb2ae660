#include "tools/report/blur_proposal.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "thicklens/model/light_field_grid.h"
#include "thicklens/model/thick_lens.h"

namespace thicklens::tools {
namespace {

using estimator::BlurTrial;
using nlohmann::json;

json TrialJson(const BlurTrial& trial) {
  return {{"blur_scale", trial.blur_scale},
          {"focus_offset_px", trial.focus_offset_px},
          {"score", trial.score},
          {"unexplained", trial.unexplained},
          {"compared_share", trial.compared_share}};
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

BlurProposal::BlurProposal(const estimator::BlurCheck& check, const estimator::EstimateInput& input,
                           const DepthOptions& depth)
    : check_(check), depth_(depth), in_disparity_(depth.kind == "disparity") {
  if (in_disparity_) return;
  blur_ratio_ = input.camera->blur_ratio();
  focus_depth_mm_ = input.camera->focus_depth_mm();
  if (check.narrower_blur) narrower_ratio_ = check.narrower_blur->blur_scale * blur_ratio_;
  if (check.other_focus) {
    other_depth_mm_ = FocusDepthForOffsetMm(input, check.other_focus->focus_offset_px);
  }
}

std::string BlurProposal::NarrowerBlur() const {
  const double scale = check_.narrower_blur->blur_scale;
  const std::string change =
      in_disparity_
          ? fmt::format("--disparity-scale {:.4g} --disparity-offset {:.4g}",
                        scale * depth_.disparity_scale, scale * depth_.disparity_offset_px)
          : fmt::format(
                "a blur_ratio of {:.3g} instead of {:.3g}, or an aperture as much "
                "smaller",
                narrower_ratio_, blur_ratio_);
  return fmt::format("a blur at most about {:.2g} times as wide{} ({}) leaves {:.0f} % of that",
                     scale, check_.narrower_blur_at_end ? ", the smallest that was tried" : "",
                     change, 100 * check_.narrower_blur->unexplained);
}

std::string BlurProposal::OtherFocus() const {
  const double offset_px = check_.other_focus->focus_offset_px;
  const std::string change =
      in_disparity_
          ? fmt::format("--disparity-offset {:.4g}", depth_.disparity_offset_px + offset_px)
          : fmt::format("a plane of focus at {} instead of {:.4g} mm",
                        std::isfinite(other_depth_mm_) ? fmt::format("{:.4g} mm", other_depth_mm_)
                                                       : "infinity",
                        focus_depth_mm_);
  return fmt::format("{}{} ({:+.2g} px of disparity per view step) leaves {:.0f} % of it", change,
                     check_.other_focus_at_end ? ", the farthest that was tried," : "", offset_px,
                     100 * check_.other_focus->unexplained);
}

std::string BlurProposal::Warning() const {
  if (!check_.narrower_blur && !check_.other_focus) return "";
  std::string text = fmt::format(
      "the photograph is sharper than camera and depth predict: {} of {} blocks are not explained "
      "beyond their noise; ",
      check_.unexplained_blocks, check_.blocks);
  if (check_.narrower_blur) text += NarrowerBlur();
  if (check_.narrower_blur && check_.other_focus) text += "; ";
  if (check_.other_focus) text += OtherFocus();
  if (check_.narrower_blur && check_.other_focus) {
    text += "; the photograph does not show which of the two is right";
  }
  return text + "; none of this was applied";
}

std::string BlurProposal::Summary() const {
  return fmt::format("{} ({} solve(s), {:.1f} s)", check_.message, check_.trials.size(),
                     check_.seconds);
}

json BlurProposal::Json() const {
  json out = {{"message", check_.message},
              {"noise_sigma", check_.noise_sigma},
              {"blocks", check_.blocks},
              {"unexplained_blocks", check_.unexplained_blocks},
              {"size", {check_.width_px, check_.height_px}},
              {"halvings", check_.halvings},
              {"iterations", check_.iterations},
              {"seconds", check_.seconds},
              {"evaluations", json::array()},
              {"proposal", nullptr}};
  for (const BlurTrial& trial : check_.trials) out["evaluations"].push_back(TrialJson(trial));
  if (check_.narrower_blur) {
    json blur = TrialJson(*check_.narrower_blur);
    blur["at_end"] = check_.narrower_blur_at_end;
    if (in_disparity_) {
      blur["disparity_scale"] = blur["blur_scale"].get<double>() * depth_.disparity_scale;
      blur["disparity_offset_px"] = blur["blur_scale"].get<double>() * depth_.disparity_offset_px;
    } else {
      blur["blur_ratio"] = narrower_ratio_;
    }
    out["proposal"]["narrower_blur"] = blur;
  }
  if (check_.other_focus) {
    json focus = TrialJson(*check_.other_focus);
    focus["at_end"] = check_.other_focus_at_end;
    if (in_disparity_) {
      focus["disparity_offset_px"] =
          depth_.disparity_offset_px + check_.other_focus->focus_offset_px;
    } else {
      focus["focus_depth_mm"] = other_depth_mm_;  // null: infinity
    }
    out["proposal"]["other_focus"] = focus;
  }
  return out;
}

}  // namespace thicklens::tools
