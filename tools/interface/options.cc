// The checks of every option struct of the interface.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <set>
#include <string>
#include <type_traits>
#include <vector>

#include "thicklens/base/printable_text.h"
#include "thicklens/calibrate.h"
#include "thicklens/compare.h"
#include "thicklens/depth.h"
#include "thicklens/effects.h"
#include "thicklens/estimate.h"
#include "thicklens/explain.h"
#include "thicklens/frames.h"
#include "thicklens/image.h"
#include "thicklens/io/light_field_io.h"
#include "thicklens/kernels/device.h"
#include "thicklens/light_field.h"
#include "thicklens/render.h"
#include "thicklens/solver.h"
#include "thicklens/sweep.h"
#include "tools/interface/validation.h"

namespace thicklens {
namespace {

using namespace checks;  // NOLINT: this file is about nothing else

constexpr int kMaxThreads = 1024;
constexpr int kMaxIterations = 1000000;
constexpr int kMaxPixels = 100000;
constexpr int kMaxViews = 99;   // one way; the number of rays is far beyond any memory before
constexpr int kMaxGrid = 1000;  // row length of the HCI numbering
constexpr char kOneView[] =
    "1x1 is not a light field: one view is the image itself; at least two views are expected, e.g. "
    "3x3";
constexpr double kMaxLengthMm = 1e9;
constexpr double kMaxMemoryMib = 1e9;

bool IsRect(std::string* why, const std::string& field, const PixelRect& rect) {
  return WholeBetween(why, field + ".x", 0, kMaxPixels, rect.x) &&
         WholeBetween(why, field + ".y", 0, kMaxPixels, rect.y) &&
         WholeBetween(why, field + ".width", 1, kMaxPixels, rect.width) &&
         WholeBetween(why, field + ".height", 1, kMaxPixels, rect.height);
}

bool AreViews(std::string* why, const std::string& field, const ViewCounts& views) {
  return WholeBetween(why, field + ".u", 1, kMaxViews, views.u) &&
         WholeBetween(why, field + ".v", 1, kMaxViews, views.v);
}

bool IsDevice(std::string* why, const std::string& device) {
  try {
    kernels::ParseDeviceRequest(device);
    return true;
  } catch (const Error& error) {
    return Fail(why, "device", error.what());
  }
}

bool IsIterative(BlockSolver::Linear linear) {
  return linear == BlockSolver::Linear::kCg || linear == BlockSolver::Linear::kBicgstab ||
         linear == BlockSolver::Linear::kViennaCl;
}

// A statement about the plane of focus, which has no value 0.
bool IsPositiveStatement(std::string* why, const std::string& field,
                         const std::optional<Measured>& number) {
  return !number || (Positive(why, field + ".value", number->value) &&
                     NonNegative(why, field + ".sigma", number->sigma));
}

bool IsStatement(std::string* why, const std::string& field, const Measured& number) {
  return NonNegative(why, field + ".value", number.value) &&
         NonNegative(why, field + ".sigma", number.sigma);
}

}  // namespace

bool RunControl::IsValid(std::string* why) const {
  return WholeBetween(why, "threads", 0, kMaxThreads, threads);
}

bool ImageFileOptions::IsValid(std::string* why) const {
  if (bits != 8 && bits != 16) return Unexpected(why, "bits", "8 or 16", bits);
  return NonNegative(why, "noise_levels", noise_levels);
}

bool DepthMeaning::IsValid(std::string* why) const {
  if (!OneOf(why, "kind", DepthKind::kInverse, kind)) return false;
  if (!OneOf(why, "unit", LengthUnit::kTum5000, unit)) return false;
  if (kind == DepthKind::kInverse) {
    if (unit != LengthUnit::kNone) {
      return Fail(
          why, "unit",
          "an inverse depth has none, its scale gives dioptres; found " + LengthUnitName(unit));
    }
    if (!Finite(why, "inverse_scale_dpt", inverse_scale_dpt)) return false;
    if (inverse_scale_dpt == 0) {
      return Fail(why, "inverse_scale_dpt",
                  "a number that is not 0 is expected: all points would lie at one depth");
    }
    if (!Finite(why, "inverse_offset_dpt", inverse_offset_dpt)) return false;
  } else if (!(inverse_scale_dpt == 1)) {
    return Fail(why, "inverse_scale_dpt", "is for kInverse only");
  } else if (!(inverse_offset_dpt == 0)) {
    return Fail(why, "inverse_offset_dpt", "is for kInverse only");
  }
  if (is_relative && kind != DepthKind::kDisparity)
    return Fail(why, "is_relative", "is for kDisparity only");
  if (is_relative && !(std::abs(disparity_scale) == 1)) {
    return Unexpected(why, "disparity_scale",
                      "1 or -1, because the scale of a relative map is not known,",
                      disparity_scale);
  }
  if (is_relative && !(disparity_offset_px == 0)) {
    return Unexpected(why, "disparity_offset_px",
                      "0, because the offset of a relative map is not known,", disparity_offset_px);
  }
  if (kind == DepthKind::kDisparity) {
    if (unit != LengthUnit::kNone) {
      return Fail(why, "unit",
                  "a disparity has none, it is px per view step; found " + LengthUnitName(unit));
    }
    if (!Finite(why, "disparity_scale", disparity_scale)) return false;
    if (disparity_scale == 0) {
      return Fail(why, "disparity_scale",
                  "a number that is not 0 is expected: all points would lie in the plane of focus");
    }
    return Finite(why, "disparity_offset_px", disparity_offset_px);
  }
  if (unit == LengthUnit::kNone && kind != DepthKind::kInverse) {
    return Fail(why, "unit", "kZ and kRange need one: mm, cm, m or tum5000; it is never guessed");
  }
  // NaN differs from both defaults.
  if (!(disparity_scale == 1)) {
    return Fail(why, "disparity_scale", "is for kDisparity only");
  }
  if (!(disparity_offset_px == 0)) {
    return Fail(why, "disparity_offset_px", "is for kDisparity only");
  }
  return true;
}

bool DepthMap::IsValid(std::string* why) const {
  if (!WholeBetween(why, "width_px", 1, kMaxPixels, width_px)) return false;
  if (!WholeBetween(why, "height_px", 1, kMaxPixels, height_px)) return false;
  const auto expected = static_cast<std::size_t>(width_px) * static_cast<std::size_t>(height_px);
  if (values.size() != expected) {
    return Fail(
        why, "values",
        fmt::format("{} x {} numbers are expected, found {}", width_px, height_px, values.size()));
  }
  if (!confidence.empty() && confidence.size() != expected) {
    return Fail(why, "confidence",
                fmt::format("{} x {} numbers or none are expected, found {}", width_px, height_px,
                            confidence.size()));
  }
  if (!Member(why, "meaning", meaning)) return false;
  std::string reason;
  return holes.IsValid(meaning.kind, &reason) || Fail(why, "holes", reason);
}

bool DepthReadOptions::IsValid(const DepthMeaning& meaning, std::string* why) const {
  std::string reason;
  if (!holes.IsValid(meaning.kind, &reason)) return Fail(why, "holes", reason);
  if (near_mm.has_value() != far_mm.has_value()) {
    return Fail(why, near_mm ? "far_mm" : "near_mm", "near_mm and far_mm belong together");
  }
  if (!near_mm) return true;
  if (meaning.kind != DepthKind::kInverse) return Fail(why, "near_mm", "is for kInverse only");
  if (!(*near_mm > 0)) return Unexpected(why, "near_mm", "a depth above 0", *near_mm);
  if (!(*far_mm > 0)) return Unexpected(why, "far_mm", "a depth above 0, or infinity", *far_mm);
  return *near_mm != *far_mm ||
         Fail(why, "far_mm", "a depth that differs from near_mm is expected");
}

bool FrameAverageOptions::IsValid(std::string* why) const {
  return OneOf(why, "method", calib::FrameAveraging::kMean, method) &&
         OneOf(why, "raw", model::SweepRaw::kGreen, raw) && IfGiven(full_scale, [why](int white) {
           return WholeBetween(why, "full_scale", 1, 65535, white);
         });
}

bool SweepOverrides::IsValid(std::string* why) const {
  if (offset_unknown && offset_mm) {
    return Fail(why, "offset_mm", "an offset is given, and offset_unknown says that it is not");
  }
  if (offset_unknown && offset_sigma_mm) {
    return Fail(why, "offset_sigma_mm", "an unknown offset has no standard deviation");
  }
  if (!floor_from_calibration.empty() && (floor_px || floor_unknown)) {
    return Fail(why, "floor_from_calibration", "excludes floor_px and floor_unknown");
  }
  if (floor_px && floor_unknown) {
    return Fail(why, "floor_px", "a floor is given, and floor_unknown says that it is not");
  }
  const auto finite = [why](const char* field) {
    return [why, field](double value) { return Finite(why, field, value); };
  };
  const auto non_negative = [why](const char* field) {
    return [why, field](double value) { return NonNegative(why, field, value); };
  };
  return Member(why, "readings", readings) && Member(why, "video", video) &&
         IfGiven(offset_mm, finite("offset_mm")) &&
         IfGiven(offset_sigma_mm, non_negative("offset_sigma_mm")) &&
         IfGiven(reading_sigma_mm, non_negative("reading_sigma_mm")) &&
         IsPositiveStatement(why, "focus_depth_mm", focus_depth_mm) &&
         IsPositiveStatement(why, "working_distance_mm", working_distance_mm) &&
         IsPositiveStatement(why, "image_distance_mm", image_distance_mm) &&
         IsPositiveStatement(why, "optical_tube_length_mm", optical_tube_length_mm) &&
         IsPositiveStatement(why, "magnification", magnification) &&
         IfGiven(target_period_mm,
                 [why](double period) { return Positive(why, "target_period_mm", period); }) &&
         IfGiven(target_grid,
                 [why](const model::TargetGrid& grid) {
                   std::string inner;
                   return grid.IsValid(&inner) || Fail(why, "target_grid", inner);
                 }) &&
         IfGiven(stage_alignment_deg,
                 [why](double angle) { return Positive(why, "stage_alignment_deg", angle); }) &&
         IfGiven(floor_px,
                 [why](const Measured& floor) { return IsStatement(why, "floor_px", floor); }) &&
         IfGiven(roi,
                 [why](const model::RegionOfInterest& region) {
                   return IsRect(why, "roi", {region.x, region.y, region.width, region.height});
                 }) &&
         IfGiven(full_scale,
                 [why](int white) { return WholeBetween(why, "full_scale", 1, 65535, white); }) &&
         IfGiven(raw,
                 [why](model::SweepRaw given) {
                   return OneOf(why, "raw", model::SweepRaw::kGreen, given);
                 }) &&
         IfGiven(direction,
                 [why](model::BenchDirection given) {
                   return OneOf(why, "direction", model::BenchDirection::kToward, given);
                 }) &&
         IfGiven(moves,
                 [why](model::SweepMotion given) {
                   return OneOf(why, "moves", model::SweepMotion::kSensor, given);
                 }) &&
         IfGiven(target, [why](model::SweepTarget given) {
           return OneOf(why, "target", model::SweepTarget::kPoints, given);
         });
}

bool CalibrateOptions::IsValid(std::string* why) const {
  return OneOf(why, "method", CalibrationMethod::kPaper, method) &&
         OneOf(why, "on_refusal", OnRefusal::kReturn, on_refusal);
}

namespace {

bool IsLayout(std::string* why, const LightFieldReadOptions& options) {
  constexpr int kMaxCounts = 100;
  const std::vector<std::string> names = io::LightFieldLayouts();
  if (!options.layout.empty() &&
      std::find(names.begin(), names.end(), options.layout) == names.end()) {
    return Fail(why, "layout",
                fmt::format("must be one of {}, or empty, is '{}'", fmt::join(names, ", "),
                            PrintableUtf8(options.layout)));
  }
  if (!options.layout_counts) return true;
  if (options.layout.empty()) return Fail(why, "layout_counts", "needs a layout");
  return WholeBetween(why, "layout_counts.u", 1, kMaxCounts, options.layout_counts->u) &&
         WholeBetween(why, "layout_counts.v", 1, kMaxCounts, options.layout_counts->v);
}

}  // namespace

bool LightFieldReadOptions::IsValid(std::string* why) const {
  return WholeBetween(why, "hci_grid", 0, kMaxGrid, hci_grid) &&
         IfGiven(inner_views,
                 [why](const ViewCounts& views) { return AreViews(why, "inner_views", views); }) &&
         IfGiven(crop, [why](const PixelRect& rect) { return IsRect(why, "crop", rect); }) &&
         IsLayout(why, *this);
}

bool EffectSelection::IsValid(std::string* why) const {
  if (!OneOf(why, "base", Base::kGiven, base)) return false;
  if (base != Base::kGiven && !given.empty()) {
    return Fail(why, "given", "effects are given, but the base is not kGiven");
  }
  if (tolerance && base != Base::kAuto) {
    return Fail(why, "tolerance",
                "is for automatic effects only: a list of effects, all and none have no tolerance");
  }
  std::string reason;
  if (tolerance && !tolerance->IsValid(&reason)) return Fail(why, "tolerance", reason);
  return true;
}

bool EffectSelection::LeavesOut(Effect effect) const {
  return without.Has(effect) || (base == Base::kGiven && !given.Has(effect));
}

bool SceneSolver::IsValid(std::string* why) const {
  if (!OneOf(why, "prior", Prior::kPatches, prior)) return false;
  if (!OneOf(why, "strength_rule", StrengthRule::kGiven, strength_rule)) return false;
  if (!OneOf(why, "photo", PhotoKind::kSharp, photo)) return false;
  if (strength_rule == StrengthRule::kGiven) {
    if (!Positive(why, "strength", strength)) return false;
  } else if (!(strength == 0)) {  // NaN too
    return Fail(why, "strength", "is for StrengthRule::kGiven only");
  }
  return IfGiven(tolerance, [why](double given) { return Residual(why, "tolerance", given); }) &&
         WholeBetween(why, "max_iterations", 1, kMaxIterations, max_iterations);
}

// The weight of the smoothness along scene points.
static bool IsGamma(std::string* why, double gamma) {
  if (gamma == 0) {
    return Fail(
        why, "gamma",
        "a finite number > 0 is expected, found 0: only the ridge would then relate the rays "
        "of a scene point, and the light field would not follow the scene's geometry");
  }
  return Positive(why, "gamma", gamma);
}

bool BlockSolver::IsValid(std::string* why) const {
  if (!OneOf(why, "linear", Linear::kViennaCl, linear)) return false;
  if (!OneOf(why, "stencil", Stencil::kPaper, stencil)) return false;
  if (!OneOf(why, "splat", Splat::kNearest, splat)) return false;
  if (!IsIterative(linear)) {
    if (tolerance) return Fail(why, "tolerance", "is for iterative linear solvers only");
    if (max_iterations) return Fail(why, "max_iterations", "is for iterative linear solvers only");
  }
  return IsGamma(why, gamma) &&
         IfGiven(ridge, [why](double given) { return NonNegative(why, "ridge", given); }) &&
         IfGiven(
             block_px,
             [why](int given) { return WholeBetween(why, "block_px", 1, kMaxPixels, given); }) &&
         IfGiven(tolerance, [why](double given) { return Residual(why, "tolerance", given); }) &&
         IfGiven(max_iterations, [why](int given) {
           return WholeBetween(why, "max_iterations", 1, kMaxIterations, given);
         });
}

bool FunctionalSolver::IsValid(std::string* why) const {
  return IsGamma(why, gamma) &&
         IfGiven(ridge, [why](double given) { return Positive(why, "ridge", given); }) &&
         Residual(why, "tolerance", tolerance) &&
         WholeBetween(why, "max_iterations", 1, kMaxIterations, max_iterations);
}

bool EstimateOptions::IsValid(std::string* why) const {
  if (views) {
    if (!AreViews(why, "views", *views)) return false;
    if (views->u * views->v < 2 && !aperture.views_of) {
      return Fail(why, "views", kOneView);
    }
  }
  if (crop && !IsRect(why, "crop", *crop)) return false;
  if (!Member(why, "depth_fit", depth_fit)) return false;
  if (lens_position && !std::isfinite(*lens_position)) {
    return Fail(why, "lens_position", fmt::format("must be finite, is {}", *lens_position));
  }
  if (sensor_origin && !(WholeBetween(why, "sensor_origin.x", 0, kMaxPixels, sensor_origin->x) &&
                         WholeBetween(why, "sensor_origin.y", 0, kMaxPixels, sensor_origin->y))) {
    return false;
  }
  if (!OneOf(why, "exif", ExifCheck::kIgnore, exif)) return false;
  if (!OneOf(why, "refine_depth", DepthRefining::kOff, refine_depth)) return false;
  if (aperture.shape &&
      !OneOf(why, "aperture.shape", model::ApertureShape::kDisc, *aperture.shape)) {
    return false;
  }
  if (aperture.views_of != nullptr) {
    const LightField& views_of = aperture.views_of->description;
    if (views_of.u_count < 1 || views_of.v_count < 1) {
      return Fail(why, "aperture.views_of",
                  fmt::format("a light field with views is expected, found {} x {} views",
                              views_of.u_count, views_of.v_count));
    }
    if (views_of.weights.cols() != views_of.u_count ||
        views_of.weights.rows() != views_of.v_count) {
      return Fail(why, "aperture.views_of",
                  fmt::format("a weight for each of the {} x {} views is expected, found {} x {}",
                              views_of.u_count, views_of.v_count, views_of.weights.cols(),
                              views_of.weights.rows()));
    }
  }
  if (st_depth_mm && !AboveUpTo(why, "st_depth_mm", 0, kMaxLengthMm, *st_depth_mm)) return false;
  if (!Member(why, "effects", effects)) return false;
  if (effects.LeavesOut(Effect::kApertureShape) && (aperture.shape || aperture.views_of)) {
    return Fail(why, "aperture",
                "states which shape the aperture has, and effects leave the shape out");
  }
  if (!OneOf(why, "hidden_rays", HiddenRays::kTelea, hidden_rays)) return false;
  if (!OneOf(why, "form", LightFieldForm::kScene, form)) return false;
  if (!OneOf(why, "clipped", ClippedHighlights::kData, clipped)) return false;
  if (memory_limit_mib &&
      !AboveUpTo(why, "memory_limit_mib", 0, kMaxMemoryMib, *memory_limit_mib)) {
    return false;
  }
  if (!IsDevice(why, device)) return false;
  const bool is_opencl = device.rfind("opencl", 0) == 0;
  return std::visit(
      [&](const auto& given) {
        using Given = std::decay_t<decltype(given)>;
        if constexpr (std::is_same_v<Given, std::shared_ptr<const Solver>>) {
          if (given == nullptr) return Fail(why, "solver", "a solver is expected, found null");
          return Member(why, "solver", *given);
        } else if constexpr (std::is_same_v<Given, SolverChooser>) {
          if (!given) return Fail(why, "solver", "a function is expected, found an empty one");
          return true;
        } else {
          if constexpr (std::is_same_v<Given, BlockSolver>) {
            if (given.linear == BlockSolver::Linear::kViennaCl && device != "auto") {
              return Fail(why, "device",
                          "kViennaCl takes a device for itself: auto is expected, found " + device);
            }
          } else if constexpr (!std::is_same_v<Given, SceneSolver>) {
            if (is_opencl) {
              return Fail(why, "device",
                          "this solver computes on the processor: auto or cpu is expected, found " +
                              device);
            }
          }
          return Member(why, "solver", given);
        }
      },
      solver);
}

bool RenderAperture::IsValid(std::string* why) const {
  if (shape && radius) return Fail(why, "radius", "shape and radius exclude each other");
  return IfGiven(radius, [why](double given) { return NonNegative(why, "radius", given); }) &&
         IfGiven(shape, [why](model::ApertureShape given) {
           return OneOf(why, "shape", model::ApertureShape::kDisc, given);
         });
}

bool PhotographOptions::IsValid(std::string* why) const {
  if (!Member(why, "aperture", aperture) || !Member(why, "effects", effects)) return false;
  for (const Effect effect : {Effect::kDefocus, Effect::kApertureShape}) {
    if ((aperture.shape || aperture.radius) && effects.LeavesOut(effect)) {
      return Fail(why, "aperture",
                  fmt::format("this statement needs the effect {}, which is left out",
                              model::EffectName(effect)));
    }
  }
  return IsDevice(why, device);
}

bool FocusOptions::IsValid(std::string* why) const {
  if (depth_mm.has_value() == disparity_px.has_value()) {
    return Fail(why, "depth_mm", "exactly one of depth_mm and disparity_px is expected");
  }
  return IfGiven(
             depth_mm,
             [why](double given) { return AboveUpTo(why, "depth_mm", 0, kMaxLengthMm, given); }) &&
         IfGiven(disparity_px,
                 [why](double given) { return Finite(why, "disparity_px", given); }) &&
         Member(why, "aperture", aperture);
}

bool CompareOptions::IsValid(std::string* why) const {
  if (!WholeBetween(why, "border_px", 0, kMaxPixels, border_px)) return false;
  return !baseline || Member(why, "baseline.depth", baseline->depth);
}

bool ExplainOptions::IsValid(std::string* why) const {
  constexpr int kMaxDepths = 10000;
  constexpr double kMaxTiltDeg = 89;
  if (depth_range.has_value() == depth.has_value()) {
    return Fail(why, "depth_range", "exactly one of depth_range and depth is expected");
  }
  if (depth_range && !Positive(why, "depth_range.near_mm", depth_range->near_mm)) return false;
  if (depth_range && !(depth_range->far_mm > depth_range->near_mm)) {
    return Unexpected(why, "depth_range.far_mm", "a number above near_mm, or infinity",
                      depth_range->far_mm);
  }
  if (depth) {
    if (!Member(why, "depth", *depth)) return false;
    if (depth->meaning.kind == DepthKind::kDisparity) {
      return Fail(why, "depth.meaning.kind",
                  "disparities refer to views, but a camera alone has no views; kZ or kRange is "
                  "expected");
    }
  }
  if (!WholeBetween(why, "depth_count", 2, kMaxDepths, depth_count) ||
      !Member(why, "effects", effects) || !WholeBetween(why, "bits", 1, 32, bits) ||
      !NonNegative(why, "full_well_electrons", full_well_electrons) ||
      !NonNegative(why, "read_noise_electrons", read_noise_electrons)) {
    return false;
  }
  if (read_noise_electrons > 0 && full_well_electrons == 0) {
    return Fail(why, "read_noise_electrons",
                "noise in electrons needs full_well_electrons, the electrons at full scale");
  }
  if (bench) {
    if (!NonNegative(why, "bench.flicker", bench->flicker) ||
        !NonNegative(why, "bench.drift_sigma_px", bench->drift_sigma_px) ||
        !NonNegative(why, "bench.reading_sigma_mm", bench->reading_sigma_mm)) {
      return false;
    }
    if (!(std::abs(bench->tilt_deg) <= kMaxTiltDeg)) {
      return Unexpected(why, "bench.tilt_deg", "a number from -89 to 89", bench->tilt_deg);
    }
    if (measure_costs) {
      return Fail(why, "measure_costs",
                  "not available with a bench, whose effects take hardly any time");
    }
  }
  return IfGiven(uv_depth_mm, [why](double given) { return Finite(why, "uv_depth_mm", given); });
}

bool Solver::IsValid(std::string* /*why*/) const { return true; }

OptionError::OptionError(std::string field, const std::string& message)
    : Error(message), field_(std::move(field)) {}
OptionError::~OptionError() = default;

}  // namespace thicklens
