// A depth map of another size, part or camera in the pixels of its photograph.
#include "tools/interface/fit_depth.h"

#include <fmt/format.h>

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <tuple>
#include <utility>
#include <vector>

#include "thicklens/base/cancel.h"
#include "thicklens/base/index.h"
#include "thicklens/depth_fit.h"
#include "thicklens/estimator/find_part.h"
#include "thicklens/estimator/project_depth.h"
#include "thicklens/estimator/resample_depth.h"
#include "tools/interface/depth_reports.h"
#include "tools/interface/run_scope.h"
#include "tools/interface/validation.h"
#include "tools/interface/with_file_context.h"

namespace thicklens {
namespace {

constexpr float kNoDepth = std::numeric_limits<float>::quiet_NaN();
constexpr double kPercent = 100;

std::string MapName(const DepthMap& depth) { return depth.source.empty() ? "depth" : depth.source; }

bool IsLength(DepthKind kind) { return kind == DepthKind::kZ || kind == DepthKind::kRange; }

// Lengths as inverse lengths, and back.
void InvertLengths(DepthKind kind, std::vector<float>* values) {
  if (!IsLength(kind)) return;
  for (float& value : *values) value = value > 0 ? 1 / value : kNoDepth;
}

// The photograph as the eye sees it: the edges of dark parts count as those of bright ones.
// Measured on light fields with the truth: with linear light, edges move a tenth more often to a
// wrong place.
model::LinearImage GuideOf(const Image& photo) {
  const Image opaque = photo.channels() == 4 ? photo.WithoutAlpha() : photo;
  model::LinearImage guide = opaque.ToLight(opaque.transfer().value_or(TransferCurve::Srgb()));
  for (float& value : guide.values) value = std::sqrt(std::clamp(value, 0.0F, 1.0F));
  return guide;
}

// The image reduced n times in each direction, by the mean of n x n px; a rest at the end is left.
model::LinearImage Reduced(const model::LinearImage& image, int n) {
  model::LinearImage small{
      std::max(1, image.width_px / n), std::max(1, image.height_px / n), image.channels, {}};
  small.values.assign(Index(small.width_px) * Index(small.height_px) * Index(small.channels), 0);
  const float part = 1.0F / static_cast<float>(n * n);
  for (int y = 0; y < small.height_px; ++y) {
    ThrowIfCancelled();
    for (int x = 0; x < small.width_px; ++x) {
      for (int c = 0; c < small.channels; ++c) {
        float sum = 0;
        for (int v = 0; v < n; ++v) {
          for (int u = 0; u < n; ++u) sum += image.at(x * n + u, y * n + v, c);
        }
        small.values[(Index(y) * Index(small.width_px) + Index(x)) * Index(small.channels) +
                     Index(c)] = sum * part;
      }
    }
  }
  return small;
}

// Whether a map of that size can show the whole photograph: the sizes agree up to rounding of the
// smaller one to whole pixels.
bool HasAspectOf(const DepthMap& depth, const Image& photo) {
  const double width = depth.width_px, height = depth.height_px;
  const double cross = std::abs(width * photo.height_px() - height * photo.width_px());
  return cross < std::max({width, height, static_cast<double>(photo.width_px()),
                           static_cast<double>(photo.height_px())});
}

// ---- The camera that measured the map.

// Inverse depth, 1/mm, along the axis of the depth camera; NaN is a hole.
std::vector<float> InverseDepths(const DepthMap& depth, const std::vector<float>& values,
                                 const std::vector<Eigen::Vector2d>& rays) {
  const DepthMeaning& meaning = depth.meaning;
  if (meaning.kind == DepthKind::kDisparity) {
    throw OptionError(
        "depth_fit.camera",
        "depth_fit.camera: a disparity counts px between views of the photograph and not lengths, "
        "by which a map of another camera is registered: depths in z, range or inverse are "
        "expected");
  }
  constexpr double kPerMetre = 1e-3;
  std::vector<float> inverse(values.size(), kNoDepth);
  for (std::size_t i = 0; i < values.size(); ++i) {
    const auto value = static_cast<double>(values[i]);
    if (std::isnan(value)) continue;
    double found = 0;
    if (meaning.kind == DepthKind::kInverse) {
      found = (meaning.inverse_scale_dpt * value + meaning.inverse_offset_dpt) * kPerMetre;
    } else {
      const double length_mm = value * model::DepthUnitMm(LengthUnitName(meaning.unit));
      const double along_ray =
          meaning.kind == DepthKind::kRange ? std::sqrt(1 + rays[i].squaredNorm()) : 1;
      found = along_ray / length_mm;
    }
    if (found > 0 && std::isfinite(found)) inverse[i] = static_cast<float>(found);
  }
  return inverse;
}

// The direction (x/z, y/z) of each pixel of the map. Inverts the distortion by fixed-point steps.
std::vector<Eigen::Vector2d> RaysOf(const model::LensDistortion& lens) {
  std::vector<Eigen::Vector2d> rays(Index(lens.width_px) * Index(lens.height_px));
  for (int y = 0; y < lens.height_px; ++y) {
    ThrowIfCancelled();
    for (int x = 0; x < lens.width_px; ++x) {
      const Eigen::Vector2d shown(x, y);
      Eigen::Vector2d straight = shown;
      constexpr int kSteps = 50;
      for (int n = 0; n < kSteps; ++n) {
        const Eigen::Vector2d off = shown - lens.Distorted(straight);
        if (!off.allFinite()) {
          straight.setConstant(std::numeric_limits<double>::quiet_NaN());
          break;
        }
        straight += off;
        if (off.cwiseAbs().maxCoeff() < 1e-6) break;
      }
      rays[Index(y) * Index(lens.width_px) + Index(x)] =
          (straight - lens.principal_point_px).cwiseQuotient(lens.focal_length_px);
    }
  }
  return rays;
}

// The map as the photograph's camera sees it, in inverse mm, on a grid as fine as the map's samples
// are in the photograph, with its placement.
std::pair<estimator::DepthSampling, estimator::MapPlacement> SeenByPhoto(
    const DepthMap& depth, const std::vector<float>& values, const DepthCamera& camera,
    const Image& photo) {
  const auto lens_of = [&](const model::LensDistortion& lens, int width_px, int height_px,
                           const char* whose) {
    return WithFileContext(
        fmt::format("{}: {}", camera.source.empty() ? "depth camera" : camera.source, whose),
        [&] { return lens.ScaledTo(width_px, height_px); });
  };
  const model::LensDistortion from =
      lens_of(camera.depth_lens, depth.width_px, depth.height_px, "depth");
  const model::LensDistortion to =
      lens_of(camera.photo_lens, photo.width_px(), photo.height_px(), "photo");
  const std::vector<Eigen::Vector2d> rays = RaysOf(from);
  estimator::DepthSampling map{depth.width_px, depth.height_px, InverseDepths(depth, values, rays),
                               depth.confidence};
  const Eigen::Vector2d ratio = to.focal_length_px.cwiseQuotient(from.focal_length_px);
  const double step = std::max(1.0, ratio.minCoeff());
  const auto width = static_cast<int>(std::ceil(photo.width_px() / step));
  const auto height = static_cast<int>(std::ceil(photo.height_px() / step));
  const estimator::MapPlacement place = estimator::PlaceOn(
      {0, 0}, Eigen::Vector2d(photo.width_px(), photo.height_px()), width, height);
  estimator::SeenSamples seen;
  seen.positions.assign(map.values.size(),
                        Eigen::Vector2d::Constant(std::numeric_limits<double>::quiet_NaN()));
  seen.values.assign(map.values.size(), kNoDepth);
  for (std::size_t i = 0; i < map.values.size(); ++i) {
    if (std::isnan(map.values[i]) || !rays[i].allFinite()) continue;
    const double z = 1 / static_cast<double>(map.values[i]);
    const Eigen::Vector3d there =
        camera.rotation * Eigen::Vector3d(rays[i].x() * z, rays[i].y() * z, z) +
        camera.translation_mm;
    if (!(there.z() > 0)) continue;  // behind the photograph's camera
    const Eigen::Vector2d straight =
        there.head<2>().cwiseProduct(to.focal_length_px) / there.z() + to.principal_point_px;
    seen.positions[i] = (to.Distorted(straight) - place.first_px).cwiseQuotient(place.step_px);
    seen.values[i] = static_cast<float>(1 / there.z());
  }
  return {estimator::ProjectDepth(map, seen, width, height), place};
}

// ---- The place of the map in the photograph.

// Whether the samples are those at the corners, which moves a map that was made of every n-th pixel
// by (n - 1)/2 px.
estimator::MapPlacement DecideSamples(const estimator::DepthSampling& map,
                                      const model::LinearImage& guide,
                                      const estimator::MapPlacement& centred, const DepthFit& fit,
                                      std::string* how, RunScope* run) {
  estimator::MapPlacement cornered = centred;
  cornered.first_px -= (centred.step_px - Eigen::Vector2d::Ones()) / 2;
  if (fit.samples == DepthSamples::kCorner) {
    *how = "samples at the corners, as stated";
    return cornered;
  }
  if (fit.samples == DepthSamples::kCentre) {
    *how = "samples at the centres, as stated";
    return centred;
  }
  constexpr double kPixels = 400000;  // enough for the statistics
  const double pixels = static_cast<double>(guide.width_px) * guide.height_px;
  const int n = std::max(1, std::min(static_cast<int>(std::sqrt(pixels / kPixels)),
                                     static_cast<int>(centred.step_px.minCoeff() / 2)));
  const model::LinearImage small = n > 1 ? Reduced(guide, n) : guide;
  const auto reduced = [n](const estimator::MapPlacement& place) {
    const Eigen::Vector2d half = Eigen::Vector2d::Constant(0.5);
    return estimator::MapPlacement{(place.first_px + half) / n - half, place.step_px / n};
  };
  const double sigma =
      estimator::SigmaBetter(estimator::AgreementOf(map, small, reduced(centred), run->threads()),
                             estimator::AgreementOf(map, small, reduced(cornered), run->threads()));
  constexpr double kDecided = 4;
  if (sigma >= kDecided) {
    *how = fmt::format("samples at the corners, by {:.1f} sigma of the photograph's edges", sigma);
    return cornered;
  }
  *how =
      sigma <= -kDecided
          ? fmt::format("samples at the centres, by {:.1f} sigma of the photograph's edges", -sigma)
          : "samples at the centres, which the photograph's edges do not contradict by four sigma";
  return centred;
}

Error UnknownPart(const DepthMap& depth, const Image& photo, double sigma, const RunScope& run) {
  return Error(
      fmt::format("{}: it is {}x{} px, the image {} is {}x{} px: the sizes must be equal, or the "
                  "aspect ratios, "
                  "{:.4g} and {:.4g}; it is not known which part of the photograph the map shows, "
                  "and the edges "
                  "of both do not decide it ({:.1f} sigma, 4 are needed): state it by {} or, for a "
                  "map of another "
                  "camera, state that camera by {}",
                  MapName(depth), depth.width_px, depth.height_px,
                  photo.source().empty() ? "photo" : photo.source(), photo.width_px(),
                  photo.height_px(), static_cast<double>(depth.width_px) / depth.height_px,
                  static_cast<double>(photo.width_px()) / photo.height_px(), sigma,
                  run.Option("depth_fit.part"), run.Option("depth_fit.camera")));
}

// The part of the photograph that fits the edges of a map of another aspect ratio, if they decide
// it.
estimator::MapPlacement PartByEdges(const DepthMap& depth, const estimator::DepthSampling& map,
                                    const model::LinearImage& guide, const Image& photo,
                                    std::string* how, RunScope* run) {
  const estimator::FoundPart found = estimator::FindPart(map, guide);
  constexpr double kDecided = 4;
  if (!(found.sigma >= kDecided)) throw UnknownPart(depth, photo, found.sigma, *run);
  *how = fmt::format(
      "on the part {:.0f},{:.0f},{:.0f},{:.0f} of the photograph, which its edges "
      "show by {:.1f} sigma; {} states another one",
      found.corner_px.x(), found.corner_px.y(), found.size_px.x(), found.size_px.y(), found.sigma,
      run->Option("depth_fit.part"));
  run->Warn(fmt::format("{}: its aspect ratio is not that of the photograph: it is taken {}",
                        MapName(depth), *how));
  return estimator::PlaceOn(found.corner_px, found.size_px, depth.width_px, depth.height_px);
}

}  // namespace

void DropDoubtful(const DepthFit& fit, DepthMap* depth, RunScope* run) {
  if (depth->confidence.empty()) {
    if (fit.min_confidence > 0) {
      throw OptionError("depth_fit.min_confidence",
                        fmt::format("depth_fit.min_confidence: {} has no confidence that could be "
                                    "compared with {:g}",
                                    MapName(*depth), fit.min_confidence));
    }
    return;
  }
  std::size_t dropped = 0, remaining = 0;
  for (std::size_t i = 0; i < depth->values.size(); ++i) {
    const auto confidence = static_cast<double>(depth->confidence[i]);
    const bool is_value = std::isfinite(depth->values[i]);
    if (confidence > 0 && confidence >= fit.min_confidence) {
      remaining += is_value ? 1 : 0;
      continue;
    }
    dropped += is_value ? 1 : 0;
    depth->values[i] = kNoDepth;
    depth->confidence[i] = 0;
  }
  if (dropped > 0 && remaining == 0) {
    throw Error(fmt::format("{}: no value has a confidence above 0 and of at least {:g} ({})",
                            MapName(*depth), fit.min_confidence,
                            run->Option("depth_fit.min_confidence")));
  }
  run->Inform(fmt::format(
      "{}: {:.1f} % of its values have too little confidence and are no depths", MapName(*depth),
      kPercent * static_cast<double>(dropped) / static_cast<double>(depth->values.size())));
}

DepthMap FitDepth(DepthMap depth, const Image& photo, const DepthFit& fit, std::string* described,
                  const RunControl& control) {
  checks::RequireValid(control);
  checks::RequireValid(depth);
  checks::RequireValid(fit);
  RunScope run(control);
  DropDoubtful(fit, &depth, &run);
  return FitDepthWithin(std::move(depth), photo, fit, described, &run);
}

DepthMap FitDepthWithin(DepthMap depth, const Image& photo, const DepthFit& fit,
                        std::string* described, RunScope* run) {
  checks::RequireValid(depth);
  checks::RequireValid(fit);
  if (described != nullptr) described->clear();
  const auto samples_have_no_effect = [&](const std::string& why) {
    if (fit.samples == DepthSamples::kAuto) return;
    run->Warn(fmt::format("{}: {} has no effect: {}", MapName(depth),
                          run->Option("depth_fit.samples"), why));
  };
  const bool is_equal = depth.width_px == photo.width_px() && depth.height_px == photo.height_px();
  if (is_equal && !fit.part && fit.camera == nullptr) {
    samples_have_no_effect("the map has the size of the photograph");
    return depth;
  }
  // Holes by the marks of the file are reported here: those of the result are NaN.
  model::RawDepthMap raw = MarkedMap(depth, run);
  const model::LinearImage guide = GuideOf(photo);
  estimator::DepthSampling map;
  estimator::MapPlacement place;
  std::string how;
  if (fit.camera != nullptr) {
    samples_have_no_effect("the camera of the map says where its samples are");
    std::tie(map, place) = SeenByPhoto(depth, raw.values, *fit.camera, photo);
    how = fmt::format("registered from the camera of {}, {:.4g} mm beside the photograph's",
                      fit.camera->source.empty() ? "depth_fit.camera" : fit.camera->source,
                      fit.camera->translation_mm.norm());
    depth.meaning = DepthMeaning{};
    depth.meaning.kind = DepthKind::kZ;
    depth.meaning.unit = LengthUnit::kMillimetre;
    depth.is_integer = false;
    depth.near_value.reset();
    depth.holes = {};
  } else {
    map = {depth.width_px, depth.height_px, std::move(raw.values), depth.confidence};
    InvertLengths(depth.meaning.kind, &map.values);
    const model::PixelRect part =
        fit.part.value_or(model::PixelRect{0, 0, photo.width_px(), photo.height_px()});
    if (!fit.part && !HasAspectOf(depth, photo)) {
      place = PartByEdges(depth, map, guide, photo, &how, run);
      how += ", ";
    } else {
      place = estimator::PlaceOn(Eigen::Vector2d(part.x, part.y),
                                 Eigen::Vector2d(part.width, part.height), depth.width_px,
                                 depth.height_px);
    }
    std::string of_samples = "each pixel has the surface that fills most of it";
    if (place.step_px.minCoeff() > 1) {
      place = DecideSamples(map, guide, place, fit, &of_samples, run);
    } else {
      samples_have_no_effect("the map is at least as fine as the photograph");
    }
    how += of_samples;
    if (fit.part) {
      how = fmt::format("on the part {},{},{},{} of the photograph, {}", part.x, part.y, part.width,
                        part.height, how);
    }
  }
  estimator::ResampledDepth found = estimator::ResampleDepth(map, guide, place, run->threads());
  InvertLengths(depth.meaning.kind, &found.values);
  std::size_t without = 0;
  for (const float value : found.values) without += std::isnan(value) ? 1 : 0;
  const auto pixels = static_cast<double>(found.values.size());
  const std::string text = fmt::format(
      "{} x {} px brought to {} x {} px ({}); {:.1f} % of the pixels are between two surfaces, and "
      "the photograph's edges decided {:.1f} % otherwise than the samples; {:.1f} % have no depth",
      depth.width_px, depth.height_px, photo.width_px(), photo.height_px(), how,
      kPercent * found.between_share, kPercent * found.moved_share,
      kPercent * static_cast<double>(without) / pixels);
  run->Inform(fmt::format("{}: {}", MapName(depth), text));
  if (described != nullptr) *described = text;
  if (without == found.values.size()) {
    throw Error(fmt::format(
        "{}: no pixel of the photograph has a depth: the map shows another "
        "part, or all its values are holes ({} and {})",
        MapName(depth), run->Option("depth_fit.part"), run->Option("depth_fit.camera")));
  }
  depth.width_px = photo.width_px();
  depth.height_px = photo.height_px();
  depth.values = std::move(found.values);
  depth.confidence = std::move(found.confidence);
  // Marks are NaN by now, and a value that lies on one between two samples is none.
  depth.holes.hole_values.clear();
  depth.largest_of_type.reset();
  return depth;
}

}  // namespace thicklens
