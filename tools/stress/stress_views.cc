#include "tools/stress/stress_views.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <sstream>
#include <utility>

#include "thicklens/base/error.h"
#include "thicklens/base/output_file.h"
#include "thicklens/estimator/block_solver.h"
#include "thicklens/io/depth_io.h"
#include "thicklens/io/image_io.h"
#include "thicklens/io/light_field_io.h"
#include "thicklens/model/light_field.h"
#include "tools/bench/bench_solvers.h"
#include "tools/options/estimate_plan.h"

namespace thicklens::tools {
namespace {

namespace fs = std::filesystem;

constexpr double kTwoPi = 6.283185307179586;
constexpr char kOutput[] = "views";
// Blur and views move light, and the part that leaves the image is lost.
constexpr double kMaxLightLost = 0.1;

int ColourChannels(const StressImage& shape) { return shape.channels == 4 ? 3 : shape.channels; }

// Reads the estimate, and requires that all its values are finite and that its size is the
// requested one.
model::LightField ReadViews(const fs::path& folder, const StressImage& shape) {
  model::LightField views = io::ReadLightField((folder / kOutput).string(), {});
  if (views.s_count != shape.width_px || views.t_count != shape.height_px ||
      views.u_count != shape.u_count || views.v_count != shape.v_count ||
      views.channels != ColourChannels(shape)) {
    throw Error(fmt::format("{} x {} views of {} x {} px with {} channel(s) came out",
                            views.u_count, views.v_count, views.s_count, views.t_count,
                            views.channels));
  }
  const auto broken = std::find_if(views.values.begin(), views.values.end(),
                                   [](float value) { return !std::isfinite(value); });
  if (broken != views.values.end()) throw Error("values of the views are not finite");
  return views;
}

// Calls for each value of a light field: take(channel, a, b, x, y, value).
template <typename Take>
void ForEachValue(const model::LightField& views, int border_px, const Take& take) {
  for (int channel = 0; channel < views.channels; ++channel) {
    for (int l = 0; l < views.v_count; ++l) {
      for (int k = 0; k < views.u_count; ++k) {
        const float* view = views.values.data() + views.ViewStart(channel, k, l);
        for (int y = border_px; y < views.t_count - border_px; ++y) {
          for (int x = border_px; x < views.s_count - border_px; ++x) {
            take(channel, views.u_offset(k), views.v_offset(l), x, y,
                 static_cast<double>(view[y * views.s_count + x]));
          }
        }
      }
    }
  }
}

std::vector<std::string> Words(const std::string& text) {
  std::istringstream stream(text);
  std::vector<std::string> words;
  for (std::string word; stream >> word;) words.push_back(word);
  return words;
}

}  // namespace

double ChannelFactor(int channel) { return channel == 0 ? 1 : channel == 1 ? 0.8 : 0.6; }

double Waves(double x, double y) {
  return 0.5 + 0.15 * std::cos(kTwoPi * (x / 11 + y / 23)) +
         0.1 * std::cos(kTwoPi * (y / 13 - x / 17) + 1) + 0.1 * std::cos(kTwoPi * y / 9 + 2);
}

ViewOf SlantedSurface(const Radiance& radiance, double disparity_px, double slope) {
  return [=](double a, double b, double x, double y) {
    const double centre_x = (x + a * disparity_px) / (1 - a * slope);
    return radiance(centre_x, y + b * (disparity_px + slope * centre_x));
  };
}

void WriteImage(const fs::path& folder, const StressImage& shape, const Radiance& radiance) {
  model::EncodedImage image{shape.width_px, shape.height_px, shape.channels, shape.bits, {}};
  const double full = shape.bits == 8 ? 255 : 65535;
  for (int y = 0; y < shape.height_px; ++y) {
    for (int x = 0; x < shape.width_px; ++x) {
      const double here = radiance(x, y);
      for (int channel = 0; channel < shape.channels; ++channel) {
        const double value = channel == 3 ? 1 : ChannelFactor(channel) * here;
        image.values.push_back(
            static_cast<std::uint16_t>(std::lround(full * std::clamp(value, 0.0, 1.0))));
      }
    }
  }
  WriteFileAtomically((folder / "picture.png").string(), io::EncodePng(image));
}

void WriteMeanOfViews(const fs::path& folder, const StressImage& shape, const ViewOf& view) {
  WriteImage(folder, shape, [&](double x, double y) {
    double sum = 0;
    for (int l = 0; l < shape.v_count; ++l) {
      for (int k = 0; k < shape.u_count; ++k) {
        sum += view(k - (shape.u_count - 1) / 2.0, l - (shape.v_count - 1) / 2.0, x, y);
      }
    }
    return sum / (shape.u_count * shape.v_count);
  });
}

void WriteDepth(const fs::path& folder, const StressImage& shape, const DisparityOf& disparity) {
  model::RawDepthMap map{shape.width_px, shape.height_px, {}, false};
  for (int y = 0; y < shape.height_px; ++y) {
    for (int x = 0; x < shape.width_px; ++x) {
      map.values.push_back(static_cast<float>(disparity(x, y)));
    }
  }
  WriteFileAtomically((folder / "depth.pfm").string(), io::EncodePfm(map));
}

StressRun EstimateOf(const StressImage& shape, const std::vector<std::string>& more,
                     Requirement required) {
  StressRun run;
  run.arguments = {
      "estimate",     "picture.png", "depth.pfm",
      "--depth-kind", "disparity",   "--transfer",
      "linear",       "--views",     fmt::format("{}x{}", shape.u_count, shape.v_count),
      "--format",     "tiff"};
  run.arguments.insert(run.arguments.end(), more.begin(), more.end());
  run.arguments.insert(run.arguments.end(), {"-o", kOutput});
  run.output = kOutput;
  run.required = std::move(required);
  return run;
}

Requirement ViewsAre(const StressImage& shape, const ViewOf& view, int border_px, double limit) {
  return Solved(
      [=](const fs::path& folder, const nlohmann::json&) {
        double sum = 0;
        std::size_t count = 0;
        ForEachValue(ReadViews(folder, shape), border_px,
                     [&](int channel, double a, double b, int x, int y, double value) {
                       const double error = value - ChannelFactor(channel) * view(a, b, x, y);
                       sum += error * error;
                       ++count;
                     });
        return std::sqrt(sum / static_cast<double>(count));
      },
      limit);
}

Requirement ViewsWithinImage(const StressImage& shape, double limit, double brightest) {
  return Solved(
      [=](const fs::path& folder, const nlohmann::json&) {
        const model::EncodedImage image = io::WithoutAlpha(
            io::ToEncodedImage(io::ReadImageFile((folder / "picture.png").string())));
        const auto [least, most] = std::minmax_element(image.values.begin(), image.values.end());
        const double full = image.bits == 8 ? 255 : 65535;
        const double low = *least / full, high = std::max(*most / full, brightest);
        double beyond = 0, sum = 0;
        const model::LightField views = ReadViews(folder, shape);
        ForEachValue(views, 0, [&](int, double, double, int, int, double value) {
          beyond = std::max({beyond, low - value, value - high});
          sum += value;
        });
        double light = 0;
        for (const std::uint16_t value : image.values) light += value / full;
        light *= static_cast<double>(shape.u_count) * shape.v_count;
        if (!(std::abs(sum - light) <= kMaxLightLost * light)) {
          throw Error(fmt::format("the views have {:.2g} of the photograph's light", sum / light));
        }
        // The range of an image without contrast is its level.
        return beyond / (high > low ? high - low : std::max(high, 1 / full));
      },
      limit);
}

Requirement SolvedOrReported(const StressImage& shape, double limit, const ViewOf& truth,
                             double rms_limit) {
  Requirement required = ViewsWithinImage(shape, limit);
  const Requirement solved = truth ? ViewsAre(shape, truth, kTruthBorderPx, rms_limit) : required;
  required.error = [=, within = required.error](const fs::path& folder,
                                                const nlohmann::json& summary) {
    const bool is_direct = summary.at("converged").is_null();
    const bool converged = is_direct || summary["converged"].get<bool>();
    const auto reason = summary.at("reason").get<std::string>();
    // Rays that leave a small image are unexplained, which is a reason of its own.
    const bool is_ok = converged && reason.find("is not explained") == std::string::npos;
    if (summary.at("status") != (is_ok ? "ok" : "partial") || reason.empty() != is_ok) {
      throw Error(fmt::format("converged is {}, status {}, reason '{}'",
                              summary["converged"].dump(), summary["status"].dump(), reason));
    }
    if (converged) {
      const double rms = solved.error(folder, summary);
      if (!(rms <= solved.limit)) {
        throw Error(fmt::format("converged, but off by {:.2g}, more than {:g}", rms, solved.limit));
      }
    }
    return within(folder, summary);
  };
  required.or_refused_with = {"the iterations diverged", "rcond is"};
  return required;
}

Requirement ViewsAreAlike(const StressImage& shape, double limit) {
  return Solved(
      [=](const fs::path& folder, const nlohmann::json&) {
        const model::LightField views = ReadViews(folder, shape);
        double most = 0;
        float brightest = 0;
        for (int channel = 0; channel < views.channels; ++channel) {
          const float* first = views.values.data() + views.ViewStart(channel, 0, 0);
          for (int l = 0; l < views.v_count; ++l) {
            for (int k = 0; k < views.u_count; ++k) {
              const float* view = views.values.data() + views.ViewStart(channel, k, l);
              for (std::size_t i = 0; i < views.view_size(); ++i) {
                most = std::max(most, static_cast<double>(std::abs(view[i] - first[i])));
                brightest = std::max(brightest, view[i]);
              }
            }
          }
        }
        if (!(brightest > 0.1F)) throw Error("the views are black");
        return most;
      },
      limit);
}

Requirement ViewsAreNumbers(const StressImage& shape) {
  return Solved(
      [=](const fs::path& folder, const nlohmann::json&) {
        ReadViews(folder, shape);  // throws otherwise
        return 0.0;
      },
      0);
}

Requirement ViewsAreAll(const StressImage& shape, double radiance, double limit) {
  return Solved(
      [=](const fs::path& folder, const nlohmann::json&) {
        double most = 0;
        ForEachValue(ReadViews(folder, shape), 0,
                     [&](int channel, double, double, int, int, double value) {
                       most = std::max(most, std::abs(value - ChannelFactor(channel) * radiance));
                     });
        return most;
      },
      limit);
}

std::vector<Way> EveryWay(const Capabilities& capabilities) {
  std::vector<estimator::EstimatePlan> plans;
  for (const estimator::EstimatePlan& plan : WholeImagePlans()) {
    for (const bool on_opencl : {false, true}) {
      const bool is_usual = plan.prior == "tv" || plan.prior == "patches";
      if (on_opencl && (plan.solver != "scene" || !is_usual || !capabilities.opencl)) continue;
      for (const bool double_precision : {false, true}) {
        const bool doubled = plan.prior == "patches" && capabilities.opencl_double;
        if (on_opencl && double_precision != doubled) continue;
        if (!capabilities.every_way && double_precision != (plan.prior == "patches")) continue;
        if (!capabilities.every_way && plan.solver == "scene" && !is_usual) continue;
        plans.push_back(plan);
        plans.back().on_opencl = on_opencl;
        plans.back().double_precision = double_precision;
      }
    }
  }
  for (const estimator::BlockSolver solver : estimator::BuiltInBlockSolvers()) {
    // ViennaCL selects a device by itself.
    const bool has_own_device = solver == estimator::BlockSolver::kViennaCl;
    if (has_own_device && !capabilities.opencl) continue;
    const bool is_default = solver == estimator::DefaultBlockSolver();
    if (!capabilities.every_way && !is_default && solver != estimator::BlockSolver::kCg) continue;
    for (const bool on_opencl : {false, true}) {
      if (on_opencl && (!is_default || !capabilities.opencl)) continue;
      estimator::EstimatePlan plan;
      plan.solver = "blocks";
      plan.block_solver = estimator::BlockSolverName(solver);
      plan.on_opencl = on_opencl;
      plans.push_back(plan);
    }
  }
  std::vector<Way> ways;
  for (const estimator::EstimatePlan& plan : plans) {
    Way way;
    way.arguments = Words(PlanArguments(plan));
    way.solver = plan.solver;
    way.is_iterative = plan.block_solver.empty() ||
                       estimator::IsIterative(estimator::BlockSolverFromName(plan.block_solver));
    ways.push_back(std::move(way));
  }
  return ways;
}

std::vector<StressRun> ByEveryWay(const StressImage& shape, const Capabilities& capabilities,
                                  const std::vector<std::string>& more,
                                  const Requirement& required) {
  std::vector<StressRun> runs;
  for (const Way& way : EveryWay(capabilities)) {
    std::vector<std::string> arguments = way.arguments;
    arguments.insert(arguments.end(), more.begin(), more.end());
    runs.push_back(EstimateOf(shape, arguments, required));
  }
  return runs;
}

}  // namespace thicklens::tools
