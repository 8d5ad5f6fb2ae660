// thicklens bench conditioning: condition numbers of the system of each discretisation.
#include "tools/bench/bench_conditioning.h"

#include <fmt/format.h>

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "thicklens/base/cancel.h"
#include "thicklens/estimator/conditioning.h"
#include "tools/bench/bench_machine.h"
#include "tools/options/option_values.h"
#include "tools/system/progress_line.h"

namespace thicklens::tools {
namespace {

using estimator::Conditioning;
using nlohmann::json;

struct BenchConditioningOptions {
  CommonOptions common;
  int size_px = 8;
};

// A setting that differs in one value from the default.
struct Setting {
  std::string changed;  // for the output: the name and the value
  int views = 3;
  double gamma = 1;
  std::optional<double> ridge;  // absent: 0.01/(U V)
  double disparity_px = 0.7;    // in the middle
  double slope = 0.1;           // px of disparity per px across
};

std::vector<Setting> Settings() {
  std::vector<Setting> settings = {{"nothing", 3, 1, {}, 0.7, 0.1}};
  for (const double gamma : {1e-6, 1e-3, 1e3, 1e6, 1e12}) {
    settings.push_back({fmt::format("gamma {:g}", gamma), 3, gamma, {}, 0.7, 0.1});
  }
  for (const double ridge : {0.0, 1e-14, 1e-8, 1e-5, 1e-1}) {
    settings.push_back({fmt::format("ridge {:g}", ridge), 3, 1, ridge, 0.7, 0.1});
  }
  settings.push_back({"no blur", 3, 1, {}, 0, 0});
  for (const double disparity_px : {0.7, 2.0, 4.0}) {
    settings.push_back({fmt::format("disparity {:g} px", disparity_px), 3, 1, {}, disparity_px, 0});
  }
  for (const int views : {2, 5}) {
    settings.push_back({fmt::format("{0} x {0} views", views), views, 1, {}, 0.7, 0.1});
  }
  return settings;
}

struct ConditioningRow {
  Setting setting;
  Conditioning warp, source;
  std::optional<Conditioning> scene_rays;  // absent for a ridge of 0
};

estimator::EstimateInput InputOf(const Setting& setting, int size_px) {
  estimator::EstimateInput input;
  const auto pixels = static_cast<std::size_t>(size_px) * static_cast<std::size_t>(size_px);
  input.image = model::LinearImage{size_px, size_px, 1, std::vector<float>(pixels, 0.5F)};
  input.disparity.width_px = input.disparity.height_px = size_px;
  for (int i = 0; i < size_px * size_px; ++i) {
    input.disparity.disparity.push_back(static_cast<float>(
        setting.disparity_px + setting.slope * (i % size_px - (size_px - 1) / 2.0)));
  }
  input.weights = Eigen::ArrayXXd::Constant(setting.views, setting.views,
                                            1.0 / (setting.views * setting.views));
  return input;
}

ConditioningRow RowOf(const Setting& setting, int size_px) {
  const estimator::EstimateInput input = InputOf(setting, size_px);
  estimator::BlockOptions blocks;
  blocks.gamma = setting.gamma;
  blocks.ridge = setting.ridge;
  ConditioningRow row{setting, ConditioningOfBlock(input, blocks), {}, {}};
  blocks.stencil = estimator::Stencil::kSource;
  row.source = ConditioningOfBlock(input, blocks);
  if (setting.ridge && *setting.ridge == 0) return row;
  estimator::FunctionalOptions functional;
  functional.gamma = setting.gamma;
  functional.ridge = setting.ridge;
  row.scene_rays = ConditioningOfSceneRays(input, functional);
  return row;
}

std::string Cells(const std::optional<Conditioning>& conditioning) {
  if (!conditioning) return fmt::format("{:>10}{:>9}{:>9}", "-", "-", "-");
  const auto error = [](const std::optional<double>& value) {
    return value ? fmt::format("{:.0e}", *value) : std::string("fails");
  };
  return fmt::format("{:>10.1e}{:>9}{:>9}", conditioning->condition(),
                     error(conditioning->float_error), error(conditioning->double_error));
}

json JsonOf(const std::optional<Conditioning>& conditioning) {
  if (!conditioning) return nullptr;
  const auto or_null = [](const std::optional<double>& value) {
    return value ? json(*value) : json();
  };
  return {{"unknowns", conditioning->unknowns},
          {"smallest", conditioning->smallest},
          {"largest", conditioning->largest},
          {"condition", conditioning->condition()},
          {"float_error", or_null(conditioning->float_error)},
          {"double_error", or_null(conditioning->double_error)}};
}

CommandResult BenchConditioning(const BenchConditioningOptions& options) {
  const std::vector<Setting> settings = Settings();
  std::string text = fmt::format(
      "condition of the systems of {0} x {0} px, and the relative errors of a dense solver in "
      "float and\nin double; default: 3 x 3 views, gamma 1, ridge 0.01/(U V), a slope of disparity "
      "about\n0.7 "
      "px\n\n{1:<18}{2:^28}{3:^28}{4:^28}\n{5:<18}{6:>10}{7:>9}{8:>9}{6:>10}{7:>9}{8:>9}{6:>10}{7:>"
      "9}{8:>9}\n",
      options.size_px, "", "rays, warp stencil", "rays, paper's stencil", "scene points", "changed",
      "condition", "float", "double");
  json rows = json::array();
  {
    ProgressLine progress("measuring", options.common.quiet);
    for (std::size_t i = 0; i < settings.size(); ++i) {
      ThrowIfCancelled();
      progress.Show(static_cast<int>(i), static_cast<int>(settings.size()));
      const ConditioningRow row = RowOf(settings[i], options.size_px);
      text += fmt::format("{:<18}{}{}{}\n", row.setting.changed, Cells(row.warp), Cells(row.source),
                          Cells(row.scene_rays));
      rows.push_back({{"changed", row.setting.changed},
                      {"views", {row.setting.views, row.setting.views}},
                      {"gamma", row.setting.gamma},
                      {"ridge", row.setting.ridge ? json(*row.setting.ridge) : json()},
                      {"disparity_px", row.setting.disparity_px},
                      {"slope", row.setting.slope},
                      {"rays_warp", JsonOf(row.warp)},
                      {"rays_source", JsonOf(row.source)},
                      {"scene_points", JsonOf(row.scene_rays)}});
    }
  }
  text +=
      "\nrays: unknowns are all rays, as in blocks and grid; for the paper's stencil, which is not "
      "symmetric,\nsingular values are used. scene points: Id + H A^-1 H^T of functional, at most "
      "about\n1 + 1/(U V ridge). fails: no factorisation.\n";
  PrintResult(options.common, text);
  return {BenchSummary({{"size_px", options.size_px}, {"rows", rows}}), ""};
}

}  // namespace

void AddBenchConditioningCommand(CLI::App* bench, CommandAction* action) {
  CLI::App* command =
      bench->add_subcommand("conditioning",
                            "Condition numbers of the system of each discretisation against gamma, "
                            "ridge, blur and views, and where float fails and double does not");
  const auto options = std::make_shared<BenchConditioningOptions>();
  command->add_option("--size", options->size_px, "Edge of the image, px")
      ->check(Between(3, 12, "pixels"))
      ->capture_default_str()
      ->type_name("PX");
  AddCommonOptions(command, &options->common);
  command->callback([options, action] {
    *action = [options] {
      RunCommand(options->common, [&] { return BenchConditioning(*options); });
    };
  });
}

}  // namespace thicklens::tools
