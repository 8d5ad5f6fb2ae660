#include "thicklens/animation.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "thicklens/base/cancel.h"
#include "thicklens/base/error.h"
#include "thicklens/io/animation_file.h"
#include "thicklens/model/quantised_levels.h"
#include "tools/interface/run_scope.h"
#include "tools/interface/validation.h"

namespace thicklens {
namespace {

constexpr double kPi = 3.14159265358979323846;
constexpr int kMinFrames = 2, kMaxFrames = 1000;
constexpr double kMinSeconds = 0.1, kMaxSeconds = 3600;
// Viewers slow down frames that are shorter.
constexpr double kMinFrameSeconds = 0.02;
constexpr int kMaxQuality = 100;
constexpr int kBits = 8;

// The disparities between which the focus moves, px per view step along u (along v where the views
// are in one column). A few wrong points at either end do not count.
std::pair<double, double> FocusRangePx(const SceneForm& scene) {
  constexpr double kLeftOut = 0.005;
  std::vector<float> sorted = scene.disparity.disparity;
  const auto at = [&sorted](double share) {
    const auto place =
        sorted.begin() +
        static_cast<std::ptrdiff_t>(std::lround(share * static_cast<double>(sorted.size() - 1)));
    std::nth_element(sorted.begin(), place, sorted.end());
    return static_cast<double>(*place);
  };
  const Eigen::Vector2d& step = scene.disparity.step;
  const double px_per_unit = step.x() != 0 ? step.x() : step.y();
  return std::minmax(px_per_unit * at(kLeftOut), px_per_unit * at(1 - kLeftOut));
}

}  // namespace

bool AnimationOptions::IsValid(std::string* why) const {
  using checks::WholeBetween;
  if (!checks::OneOf(why, "kind", AnimationKind::kFocus, kind)) return false;
  if (!WholeBetween(why, "frames", kMinFrames, kMaxFrames, frames)) return false;
  if (!(seconds >= kMinSeconds && seconds <= kMaxSeconds)) {
    return checks::Unexpected(why, "seconds", "a number from 0.1 to 3600", seconds);
  }
  if (!(seconds / frames >= kMinFrameSeconds)) {
    return checks::Fail(why, "frames",
                        fmt::format("{} frames in {:g} s: viewers show a frame for at least {:g} s",
                                    frames, seconds, kMinFrameSeconds));
  }
  if (!WholeBetween(why, "quality", 0, kMaxQuality, quality)) return false;
  if (!checks::Member(why, "aperture", aperture)) return false;
  const bool is_stated = aperture.shape || aperture.radius;
  return kind == AnimationKind::kFocus || !is_stated ||
         checks::Fail(why, "aperture", "a moving viewpoint has none; leave it out");
}

std::string RenderAnimation(const SceneForm& scene, const AnimationOptions& options,
                            const RunControl& control) {
  checks::RequireValid(control);
  checks::RequireValid(options);
  checks::RequireValidInput(scene.frame.source.empty() ? "scene" : scene.frame.source, scene);
  const RunScope run(control);
  const auto progress = run.ProgressOf("rendering");
  const model::LightField& frame = scene.frame;
  const model::QuantisedLevels levels(frame.transfer, kBits);
  const estimator::SceneRenderer renderer(scene);
  const auto [far_px, near_px] = FocusRangePx(scene);
  io::AnimationFile file;
  file.count = options.frames;
  file.width_px = frame.s_count;
  file.height_px = frame.t_count;
  file.seconds = options.seconds;
  file.quality = options.quality;
  file.icc_profile = frame.colour_profile;
  file.frame = [&, far_px = far_px, near_px = near_px](int number) {
    ThrowIfCancelled();
    progress(number, options.frames);
    const double angle = 2 * kPi * number / options.frames;
    if (options.kind == AnimationKind::kParallax) {
      return model::ToEncoded(renderer.View((frame.u_count - 1) / 2.0 * std::cos(angle),
                                            (frame.v_count - 1) / 2.0 * std::sin(angle)),
                              levels);
    }
    FocusOptions focus;
    focus.disparity_px = (far_px + near_px) / 2 - (near_px - far_px) / 2 * std::cos(angle);
    focus.aperture = options.aperture;
    RunControl quiet;  // its notices would be repeated for each frame
    quiet.threads = control.threads;
    quiet.cancel = control.cancel;
    return model::ToEncoded(Refocus(scene, focus, quiet).light(), levels);
  };
  return io::EncodeWebpAnimation(file);
}

}  // namespace thicklens
