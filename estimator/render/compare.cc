#include "thicklens/estimator/compare.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <functional>
#include <limits>
#include <utility>

#include "thicklens/base/error.h"
#include "thicklens/base/parallel.h"
#include "thicklens/estimator/view_geometry.h"

namespace thicklens::estimator {
namespace {

// View steps that differ by more than this share mean other viewpoints, not a calibration error.
constexpr double kStepTolerance = 0.05;

void RequireEqual(const std::string& what, const std::string& reference, const std::string& other,
                  const std::string& cure) {
  if (reference == other) return;
  throw Error(fmt::format(
      "{}: the reference has {}, but the other light field has {}: these must be equal{}", what,
      reference, other, cure));
}

void RequireSameViewpoints(const model::LightField& reference, const model::LightField& other) {
  if (!reference.grid || !other.grid) return;
  const std::array<std::array<double, 2>, 2> steps_mm = {
      {{std::abs(reference.grid->u_step_mm), std::abs(other.grid->u_step_mm)},
       {std::abs(reference.grid->v_step_mm), std::abs(other.grid->v_step_mm)}}};
  const std::array<int, 2> counts = {reference.u_count, reference.v_count};
  for (std::size_t axis = 0; axis < 2; ++axis) {
    const auto [a_mm, b_mm] = steps_mm[axis];
    if (counts[axis] == 1 || std::abs(a_mm - b_mm) <= kStepTolerance * std::max(a_mm, b_mm))
      continue;
    throw Error(
        fmt::format("views in {}: their distance is {:.6g} mm in the reference and {:.6g} mm in "
                    "the other light field: these must agree within {:g} %, because otherwise "
                    "different viewpoints are compared",
                    axis == 0 ? "u" : "v", a_mm, b_mm, 100 * kStepTolerance));
  }
}

void RequireComparable(const model::LightField& reference, const model::LightField& other) {
  const auto counts = [](const model::LightField& light_field) {
    return fmt::format("{}x{} views", light_field.u_count, light_field.v_count);
  };
  const auto size = [](const model::LightField& light_field) {
    return fmt::format("{}x{} px", light_field.s_count, light_field.t_count);
  };
  const auto channels = [](const model::LightField& light_field) {
    return fmt::format("{} channel(s)", light_field.channels);
  };
  RequireEqual("number of views", counts(reference), counts(other),
               " (select the inner views that both have)");
  RequireEqual("size of the views", size(reference), size(other), "");
  RequireEqual("channels", channels(reference), channels(other), "");
  RequireSameViewpoints(reference, other);
}

void RequireFitting(const model::LightField& reference, const DibrInput& dibr) {
  const model::LinearImage& photograph = dibr.photograph;
  if (photograph.width_px != reference.s_count || photograph.height_px != reference.t_count ||
      photograph.channels != reference.channels) {
    throw Error(
        fmt::format("photograph: it has {}x{} px in {} channel(s), but the views have {}x{} px in "
                    "{} channel(s): these must be equal",
                    photograph.width_px, photograph.height_px, photograph.channels,
                    reference.s_count, reference.t_count, reference.channels));
  }
  if (dibr.disparity.width_px != reference.s_count ||
      dibr.disparity.height_px != reference.t_count) {
    throw Error(fmt::format(
        "disparity: it has {}x{} px, but the views have {}x{} px: the sizes must be equal",
        dibr.disparity.width_px, dibr.disparity.height_px, reference.s_count, reference.t_count));
  }
}

// A photograph that is prepared for warping to any view.
struct DibrViews {
  explicit DibrViews(const DibrInput& input)
      : renderer(input.disparity), warper(input.photograph, input.disparity) {}

  DisparityRenderer renderer;
  ImageWarper warper;
};

ViewScores CompareView(const model::LightField& reference, const model::LightField& other, int k,
                       int l, int border_px, const std::optional<DibrViews>& dibr) {
  const model::EncodedValues truth =
      model::EncodedValuesOf(model::ViewImage(reference, k, l), reference.transfer);
  ViewScores view;
  view.u = k;
  view.v = l;
  view.scores = CompareImages(
      truth, model::EncodedValuesOf(model::ViewImage(other, k, l), reference.transfer), border_px);
  if (!dibr) return view;
  const ViewDisparity seen = dibr->renderer.Render(reference.u_offset(k), reference.v_offset(l));
  view.dibr = CompareImages(
      truth, model::EncodedValuesOf(dibr->warper.Warp(seen), reference.transfer), border_px);
  return view;
}

using Scores = std::vector<ImageScores>;

bool HasFinitePsnr(const ImageScores& scores) { return !std::isinf(scores.psnr_db); }

// Selects the views that a mean of PSNRs is over: the views that differ from the reference, so that
// one perfect view does not hide the others. For two means that are shown together, these are the
// views that differ in both, unless there are none. `beside` may be empty.
std::vector<bool> ViewsOfPsnrMean(const Scores& scores, const Scores& beside) {
  std::vector<bool> own, both;
  for (std::size_t i = 0; i < scores.size(); ++i) {
    own.push_back(HasFinitePsnr(scores[i]));
    both.push_back(own.back() && (beside.empty() || HasFinitePsnr(beside[i])));
  }
  return std::find(both.begin(), both.end(), true) == both.end() ? own : both;
}

ImageScores MeanOf(const Scores& scores, const Scores& beside) {
  ImageScores mean;
  const std::vector<bool> in_psnr = ViewsOfPsnrMean(scores, beside);
  int psnrs = 0;
  int standins = 0;
  double standin_sum = 0;
  for (std::size_t i = 0; i < scores.size(); ++i) {
    const ImageScores& one = scores[i];
    mean.ssim += one.ssim;
    mean.delta_e94_mean += one.delta_e94_mean;
    if (in_psnr[i]) {
      mean.psnr_db += one.psnr_db;
      ++psnrs;
    }
    if (one.macade_standin) {
      standin_sum += *one.macade_standin;
      ++standins;
    }
  }
  const auto count = static_cast<double>(scores.size());
  mean.ssim /= count;
  mean.delta_e94_mean /= count;
  mean.psnr_db = psnrs > 0 ? mean.psnr_db / psnrs : std::numeric_limits<double>::infinity();
  if (standins > 0) mean.macade_standin = standin_sum / standins;
  return mean;
}

// Squared distance from the middle of the views, in view steps; exact.
double DistanceSquared(const model::LightField& light_field, const ViewScores& view) {
  const double a = light_field.u_offset(view.u);
  const double b = light_field.v_offset(view.v);
  return a * a + b * b;
}

// Scores of all views, of the views nearest to the middle, and of the views farthest from it.
struct Groups {
  Scores all, centre, corner;
};
using ScoresOfView = std::function<const ImageScores&(const ViewScores&)>;
Groups GroupsOf(const model::LightField& light_field, const std::vector<ViewScores>& views,
                const ScoresOfView& scores_of) {
  double nearest = std::numeric_limits<double>::infinity();
  double farthest = 0;
  for (const ViewScores& view : views) {
    nearest = std::min(nearest, DistanceSquared(light_field, view));
    farthest = std::max(farthest, DistanceSquared(light_field, view));
  }
  Groups groups;
  for (const ViewScores& view : views) {
    const double distance = DistanceSquared(light_field, view);
    groups.all.push_back(scores_of(view));
    if (distance == nearest) groups.centre.push_back(scores_of(view));
    if (distance == farthest) groups.corner.push_back(scores_of(view));
  }
  return groups;
}

}  // namespace

LightFieldScores CompareLightFields(const model::LightField& reference,
                                    const model::LightField& other, int border_px,
                                    const std::optional<DibrInput>& dibr, int threads) {
  RequireComparable(reference, other);
  if (dibr) RequireFitting(reference, *dibr);
  std::vector<std::pair<int, int>> common;
  for (int l = 0; l < reference.v_count; ++l) {
    for (int k = 0; k < reference.u_count; ++k) {
      if (reference.IsPresent(k, l) && other.IsPresent(k, l)) common.emplace_back(k, l);
    }
  }
  if (common.empty())
    throw Error("the two light fields have no view in common: at least one is needed");

  std::optional<DibrViews> dibr_views;
  if (dibr) dibr_views.emplace(*dibr);
  LightFieldScores result;
  result.views.resize(common.size());
  ParallelFor(static_cast<int>(common.size()), threads, [&](int i) {
    const auto index = static_cast<std::size_t>(i);
    const auto [k, l] = common[index];
    try {
      result.views[index] = CompareView(reference, other, k, l, border_px, dibr_views);
    } catch (const Interrupted&) {
      throw;
    } catch (const Error& error) {
      throw Error(fmt::format("view ({}, {}): {}", k, l, error.what()));
    }
  });
  const Groups own =
      GroupsOf(reference, result.views,
               [](const ViewScores& view) -> const ImageScores& { return view.scores; });
  Groups warped;
  if (dibr) {
    warped = GroupsOf(reference, result.views,
                      [](const ViewScores& view) -> const ImageScores& { return *view.dibr; });
    result.dibr_mean = MeanOf(warped.all, own.all);
    result.dibr_centre = MeanOf(warped.centre, own.centre);
    result.dibr_corner = MeanOf(warped.corner, own.corner);
  }
  result.mean = MeanOf(own.all, warped.all);
  result.centre = MeanOf(own.centre, warped.centre);
  result.corner = MeanOf(own.corner, warped.corner);
  return result;
}

}  // namespace thicklens::estimator
