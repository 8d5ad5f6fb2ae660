// Hard cases of estimates: settings, numbers of views and strengths of blur.
#include <algorithm>
#include <cmath>
#include <filesystem>
#include <functional>
#include <string>
#include <utility>
#include <vector>

#include "tools/stress/stress_suite.h"
#include "tools/stress/stress_views.h"

namespace thicklens::tools {
namespace {

namespace fs = std::filesystem;
using Arguments = std::vector<std::string>;

// The disparity of a plane with so much blur that the merely warped photograph differs by more than
// kSolved.
constexpr double kDisparityPx = 1.5;
constexpr double kSolved = 0.03;
const char kSolvedText[] =
    "views differ from the true ones by at most 0.03 of full scale, rms, without a border of 8 px";

ViewOf PlaneViews() { return SlantedSurface(Waves, kDisparityPx, 0); }

void WritePlane(const fs::path& folder, const StressImage& shape) {
  WriteMeanOfViews(folder, shape, PlaneViews());
  WriteDepth(folder, shape, [](int, int) { return kDisparityPx; });
}

StressCase Estimator(
    std::string name, std::string why, std::string required,
    std::function<std::vector<StressRun>(const fs::path&, const Capabilities&)> prepare) {
  return {"estimator/" + std::move(name), std::move(why), std::move(required), std::move(prepare)};
}

// A plane with one more setting, solved in every way that has it; `outcome` states the requirement
// of each.
StressCase WithSetting(std::string name, std::string why, std::string required,
                       const Arguments& setting, const std::function<bool(const Way&)>& has_it,
                       const std::function<Requirement(const Way&)>& outcome) {
  return Estimator(std::move(name), std::move(why), std::move(required),
                   [=](const fs::path& folder, const Capabilities& capabilities) {
                     const StressImage shape;
                     WritePlane(folder, shape);
                     std::vector<StressRun> runs;
                     for (const Way& way : EveryWay(capabilities)) {
                       if (!has_it(way)) continue;
                       Arguments arguments = way.arguments;
                       arguments.insert(arguments.end(), setting.begin(), setting.end());
                       runs.push_back(EstimateOf(shape, arguments, outcome(way)));
                     }
                     return runs;
                   });
}

// The result depends on the solver: solved; or solved as far as possible with `status: partial`; or
// refused because the iterations diverged or blocks are singular. In no case may a light field
// leave the range of the image.
StressCase Either(std::string name, std::string why, const Arguments& setting,
                  const std::function<bool(const Way&)>& has_it, double limit) {
  return WithSetting(
      std::move(name), std::move(why),
      "no view leaves the range of the image's values by more than a stated part of it; if the "
      "iterations did not converge, the summary is partial; or refused by its residual or rcond",
      setting, has_it, [limit](const Way&) {
        return SolvedOrReported(StressImage(), limit, PlaneViews(), kSolved);
      });
}

bool IsSmooth(const Way& way) { return way.solver != "scene"; }
bool IsDirect(const Way& way) { return !way.is_iterative; }
bool IsIterativeBlocks(const Way& way) { return way.solver == "blocks" && way.is_iterative; }

Requirement SolvedPlane(const Way&) {
  return ViewsAre(StressImage(), PlaneViews(), kTruthBorderPx, kSolved);
}
// Without links between its rays a point is hardly better than the warped image.
Requirement HardlyBetterThanWarped(const Way&) {
  return ViewsAre(StressImage(), PlaneViews(), kTruthBorderPx, 0.045);
}
Requirement Within(double limit) { return ViewsWithinImage(StressImage(), limit); }

std::vector<StressCase> Gammas() {
  std::vector<StressCase> cases;
  cases.push_back(WithSetting("gamma-0", "only the ridge links the rays of a point",
                              "refused: gamma, and that it must be above 0", {"--gamma", "0"},
                              IsSmooth, [](const Way&) {
                                return Refused({"--gamma", "> 0", "found 0"});
                              }));
  cases.push_back(WithSetting("gamma-negative", "the functional has no minimum",
                              "refused: gamma, and that it must be above 0", {"--gamma", "-1"},
                              IsSmooth, [](const Way&) {
                                return Refused({"--gamma", "> 0", "found -1"});
                              }));
  for (const char* gamma : {"1e-12", "1e-6", "1e-3"}) {
    cases.push_back(WithSetting(
        std::string("gamma-") + gamma,
        "the rays of a point are nearly independent, or nearly equal",
        "views differ from the true ones by less than 0.045 of full scale, like the warped image",
        {"--gamma", gamma}, IsSmooth, HardlyBetterThanWarped));
  }
  cases.push_back(WithSetting(
      "gamma-1e3", "smoothness outweighs the photograph a thousand times", kSolvedText,
      {"--gamma", "1e3"}, [](const Way& way) { return IsSmooth(way) && !IsIterativeBlocks(way); },
      SolvedPlane));
  cases.push_back(Either("gamma-1e3-iterative-blocks", "the condition is 1e6 and more",
                         {"--gamma", "1e3"}, IsIterativeBlocks, 2));
  // Iterations that cannot converge must report it or be refused; their result must stay bounded.
  cases.push_back(Either("gamma-1e6",
                         "smoothness outweighs the photograph a million times: the "
                         "condition is that of gamma over the ridge",
                         {"--gamma", "1e6"}, IsSmooth, 0.6));
  cases.push_back(Either("gamma-1e12", "smoothness outweighs the photograph beyond any precision",
                         {"--gamma", "1e12"}, IsSmooth, 0.6));
  cases.push_back(WithSetting("gamma-1e12-direct",
                              "the factors of singular blocks are noise, "
                              "however small their residual",
                              "refused: rcond, and its limit", {"--gamma", "1e12"}, IsDirect,
                              [](const Way&) {
                                return Refused({"rcond", "1e-12", "ridge"});
                              }));
  return cases;
}

std::vector<StressCase> Ridges() {
  std::vector<StressCase> cases;
  cases.push_back(
      WithSetting("ridge-0-direct", "without a ridge the system is singular: the case of the paper",
                  "refused: rcond, and its limit", {"--ridge", "0"}, IsDirect, [](const Way&) {
                    return Refused({"rcond", "1e-12", "ridge"});
                  }));
  cases.push_back(WithSetting(
      "ridge-0-whole-image", "without a ridge the system is singular",
      "refused: the ridge, and that it must be above 0", {"--ridge", "0"},
      [](const Way& way) { return way.solver == "functional" || way.solver == "grid"; },
      [](const Way&) {
        return Refused({"--ridge", "> 0", "found 0"});
      }));
  cases.push_back(Either("ridge-0-iterative", "iterations on a singular system", {"--ridge", "0"},
                         IsIterativeBlocks, 0.6));
  cases.push_back(WithSetting("ridge-negative", "the functional has no minimum",
                              "refused: the ridge, and that it must not be below 0",
                              {"--ridge", "-1"}, IsSmooth, [](const Way&) {
                                return Refused({"--ridge", "found -1"});
                              }));
  cases.push_back(WithSetting("ridge-1e-14-direct", "the condition is 1e13 and more",
                              "refused: rcond, and its limit", {"--ridge", "1e-14"}, IsDirect,
                              [](const Way&) {
                                return Refused({"rcond", "1e-12", "ridge"});
                              }));
  cases.push_back(Either(
      "ridge-1e-14", "the condition is 1e13 and more", {"--ridge", "1e-14"},
      [](const Way& way) { return IsSmooth(way) && way.is_iterative; }, 1.5));
  cases.push_back(Either("ridge-1e-8", "the condition is 1e8: beyond float", {"--ridge", "1e-8"},
                         IsSmooth, 1.5));
  // Only the warped photograph remains.
  cases.push_back(
      WithSetting("ridge-1e2", "the ridge outweighs everything: the answer is the starting point",
                  "no view leaves the range of the image's values by more than 0.05 of it",
                  {"--ridge", "1e2"}, IsSmooth, [](const Way&) { return Within(0.05); }));
  return cases;
}

StressImage WithViews(int u_count, int v_count) {
  StressImage shape;
  shape.u_count = u_count;
  shape.v_count = v_count;
  return shape;
}

StressCase Views(const std::string& name, const std::string& why, const StressImage& shape,
                 double disparity_px) {
  return Estimator(
      name, why,
      "views differ from the true ones by at most 0.03 of full scale, rms, without the border",
      [=](const fs::path& folder, const Capabilities& capabilities) {
        const ViewOf view = SlantedSurface(Waves, disparity_px, 0);
        WriteMeanOfViews(folder, shape, view);
        WriteDepth(folder, shape, [=](int, int) { return disparity_px; });
        return ByEveryWay(shape, capabilities, {}, ViewsAre(shape, view, kTruthBorderPx, kSolved));
      });
}

std::vector<StressCase> NumbersOfViews() {
  std::vector<StressCase> cases;
  cases.push_back(Estimator("views-1x1", "one view is the photograph itself",
                            "refused: at least two views are needed",
                            [](const fs::path& folder, const Capabilities& capabilities) {
                              const StressImage shape = WithViews(1, 1);
                              WritePlane(folder, shape);
                              return ByEveryWay(shape, capabilities, {},
                                                Refused({"--views", "1x1", "at least two views"}));
                            }));
  cases.push_back(Views("views-2x2", "no view is in the centre", WithViews(2, 2), 2.5));
  cases.push_back(Views("views-1x5", "no blur in the horizontal direction", WithViews(1, 5), 1));
  cases.push_back(Views("views-3x7", "few views across, many down", WithViews(3, 7), 0.8));
  StressImage small = WithViews(15, 15);
  small.width_px = 22;
  small.height_px = 20;
  StressCase many = Views("views-15x15", "225 unknowns per pixel", small, 0.25);
  // Blocks of the default size would have factors of gigabytes.
  many.prepare = [prepare = many.prepare](const fs::path& folder,
                                          const Capabilities& capabilities) {
    std::vector<StressRun> runs = prepare(folder, capabilities);
    for (StressRun& run : runs) {
      if (std::find(run.arguments.begin(), run.arguments.end(), "blocks") == run.arguments.end()) {
        continue;
      }
      run.arguments.insert(run.arguments.end() - 2, {"--block-px", "2"});
    }
    return runs;
  };
  cases.push_back(std::move(many));
  return cases;
}

// A plane so blurred that little of it is left: the result is bounded, or refused if rays leave the
// image.
StressCase Blurred(const std::string& name, double sigma_px, int size_px) {
  StressImage shape;
  shape.width_px = shape.height_px = size_px;
  const double disparity_px = sigma_px / std::sqrt(2.0 / 3);
  return Estimator(
      name,
      "the blur has a sigma of " + std::to_string(static_cast<int>(sigma_px)) + " px on " +
          std::to_string(size_px) + " px: hardly any frequency remains",
      "views differ from the true ones by at most 0.25 of full scale, rms, and stay within ten "
      "times the range of what remains of the image; or a report that the iterations did not "
      "converge, or that the photograph is not explained",
      [=](const fs::path& folder, const Capabilities& capabilities) {
        const ViewOf view = SlantedSurface(Waves, disparity_px, 0);
        WriteMeanOfViews(folder, shape, view);
        WriteDepth(folder, shape, [=](int, int) { return disparity_px; });
        std::vector<StressRun> runs;
        for (const Way& way : EveryWay(capabilities)) {
          // Blocks factor everything that they link: this takes hours and gives no useful light
          // field.
          if (way.solver == "blocks") continue;
          runs.push_back(EstimateOf(shape, way.arguments, SolvedOrReported(shape, 10, view, 0.25)));
        }
        return runs;
      });
}

std::vector<StressCase> Blurs() {
  std::vector<StressCase> cases;
  cases.push_back(Blurred("blur-of-5-px", 5, 64));
  cases.push_back(Blurred("blur-of-20-px", 20, 96));
  cases.push_back(Blurred("blur-of-60-px", 60, 160));
  cases.push_back(
      Estimator("blur-beyond-the-image", "views move by more than the size of the image",
                "refused: the largest disparity, and its limit",
                [](const fs::path& folder, const Capabilities& capabilities) {
                  const StressImage shape;
                  WriteImage(folder, shape, Waves);
                  WriteDepth(folder, shape, [](int, int) { return 73.0; });
                  return ByEveryWay(shape, capabilities, {}, Refused({"disparity", "73", "40 px"}));
                }));
  return cases;
}

bool IsBlocks(const Way& way) { return way.solver == "blocks"; }
bool IsIterative(const Way& way) { return way.is_iterative; }

std::vector<StressCase> Settings() {
  std::vector<StressCase> cases;
  cases.push_back(
      WithSetting("blocks-of-one-pixel", "no two rays of a point are in one block",
                  "no view leaves the range of the image's values by more than 0.6 of it",
                  {"--block-px", "1"}, IsBlocks, [](const Way&) { return Within(0.6); }));
  cases.push_back(WithSetting("blocks-not-dividing", "blocks of 7 px on 40 x 30", kSolvedText,
                              {"--block-px", "7"}, IsBlocks, SolvedPlane));
  cases.push_back(WithSetting("blocks-larger-than-the-image", "one block of 100 px on 40 x 30",
                              kSolvedText, {"--block-px", "100"}, IsBlocks, SolvedPlane));
  cases.push_back(WithSetting("tolerance-0", "no iteration reaches it",
                              "refused: the tolerance, and its range", {"--tolerance", "0"},
                              IsIterative, [](const Way&) {
                                return Refused({"--tolerance", "above 0", "found 0"});
                              }));
  cases.push_back(Either("tolerance-1e-16", "below every precision", {"--tolerance", "1e-16"},
                         IsIterative, 0.6));
  cases.push_back(Either("one-iteration", "nothing converges in one iteration",
                         {"--max-iterations", "1"}, IsIterative, 1));
  return cases;
}

}  // namespace

std::vector<StressCase> EstimatorStressCases() {
  std::vector<StressCase> all;
  for (std::vector<StressCase> part : {Gammas(), Ridges(), NumbersOfViews(), Blurs(), Settings()}) {
    for (StressCase& hard : part) all.push_back(std::move(hard));
  }
  return all;
}

}  // namespace thicklens::tools
