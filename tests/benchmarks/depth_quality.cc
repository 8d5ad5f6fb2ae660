// Measures what a depth map that is not exact costs: the photograph of a light field with true
// views is estimated with its depth map in every state in which people have them, and all views are
// compared with the truth.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <exception>
#include <filesystem>
#include <fstream>
#include <functional>
#include <iostream>
#include <limits>
#include <nlohmann/json.hpp>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>
#include <optional>
#include <random>
#include <string>
#include <utility>
#include <vector>

#include "thicklens/base/error.h"
#include "thicklens/depth.h"
#include "thicklens/estimate.h"
#include "thicklens/estimator/compare.h"
#include "thicklens/light_field.h"

namespace thicklens {
namespace {

constexpr std::uint64_t kNoiseSeed = 1, kDepthSeed = 5;

struct Arguments {
  std::vector<std::string> folders = {THICKLENS_SHARED_DATA_DIR "/lf_antinous"};
  std::vector<std::string> maps;
  std::string prior = "tv", other, json_path, refine = "auto";
  bool as_gaussian = false;
  int border_px = 20;
  int threads = 0;
};

struct Row {
  std::string light_field, map;
  double psnr_db = std::numeric_limits<double>::quiet_NaN();
  double error_px = 0, seconds = 0;
  std::string remark;
};

// One state of a map: its name, and what makes it of the exact one.
struct Degradation {
  std::string name;
  std::function<cv::Mat(const cv::Mat& exact, const cv::Mat& other)> make;
  bool is_relative = false;  // neither its scale nor its offset is known
};

// Returns the map from every n-th sample of every n-th row, enlarged plainly, as image programs do
// it: the result is displaced by half of the n - 1 px that are left out between two samples.
cv::Mat AtPartOfSize(const cv::Mat& exact, int n, int interpolation) {
  cv::Mat small((exact.rows + n - 1) / n, (exact.cols + n - 1) / n, CV_32F);
  for (int y = 0; y < small.rows; ++y) {
    for (int x = 0; x < small.cols; ++x) small.at<float>(y, x) = exact.at<float>(y * n, x * n);
  }
  cv::Mat full;
  cv::resize(small, full, {small.cols * n, small.rows * n}, 0, 0, interpolation);
  return full(cv::Rect(0, 0, exact.cols, exact.rows)).clone();
}

// Discs of 3 to 19 px radius without a depth, up to the share.
cv::Mat WithHoles(const cv::Mat& exact, double share) {
  cv::Mat holes = cv::Mat::zeros(exact.size(), CV_8U);
  std::mt19937_64 engine(kDepthSeed);
  const auto below = [&engine](int limit) {
    return static_cast<int>(engine() % static_cast<std::uint64_t>(limit));
  };
  constexpr int kMinPx = 3, kRangePx = 17;
  while (cv::countNonZero(holes) < share * static_cast<double>(exact.total())) {
    const cv::Point centre(below(exact.cols), below(exact.rows));
    cv::circle(holes, centre, kMinPx + below(kRangePx), 1, cv::FILLED);
  }
  cv::Mat map = exact.clone();
  map.setTo(std::numeric_limits<float>::quiet_NaN(), holes);
  return map;
}

cv::Mat Shifted(const cv::Mat& exact, int right_px) {
  cv::Mat larger;
  cv::copyMakeBorder(exact, larger, 0, 0, right_px, 0, cv::BORDER_REPLICATE);
  return larger(cv::Rect(0, 0, exact.cols, exact.rows)).clone();
}

cv::Mat WithNoise(const cv::Mat& exact, double sigma_px) {
  cv::Mat map = exact.clone();
  std::mt19937_64 engine(kDepthSeed);
  std::normal_distribution<double> normal(0, sigma_px);
  for (int y = 0; y < map.rows; ++y) {
    for (int x = 0; x < map.cols; ++x) map.at<float>(y, x) += static_cast<float>(normal(engine));
  }
  return map;
}

// The grey levels of a network's map: near is bright, and nothing else is known.
cv::Mat AsGreyLevels(const cv::Mat& exact) {
  double least = 0, most = 0;
  cv::minMaxLoc(exact, &least, &most);
  cv::Mat levels;
  constexpr double kLevels = 255;
  exact.convertTo(levels, CV_8U, kLevels / (most - least), -least * kLevels / (most - least));
  levels.convertTo(levels, CV_32F);
  return levels;
}

const std::vector<Degradation>& AllDegradations() {
  using cv::Mat;
  static const std::vector<Degradation> all = {
      {"exact", [](const Mat& map, const Mat&) { return map.clone(); }},
      {"quarter-nearest",
       [](const Mat& map, const Mat&) { return AtPartOfSize(map, 4, cv::INTER_NEAREST); }},
      {"quarter-linear",
       [](const Mat& map, const Mat&) { return AtPartOfSize(map, 4, cv::INTER_LINEAR); }},
      {"eighth-linear",
       [](const Mat& map, const Mat&) { return AtPartOfSize(map, 8, cv::INTER_LINEAR); }},
      {"blurred-2px",
       [](const Mat& map, const Mat&) {
         Mat blurred;
         cv::GaussianBlur(map, blurred, {}, 2);
         return blurred;
       }},
      {"shifted-2px", [](const Mat& map, const Mat&) { return Shifted(map, 2); }},
      {"dilated-3px",
       [](const Mat& map, const Mat&) {
         Mat dilated;
         cv::dilate(map, dilated, Mat::ones(7, 7, CV_8U));
         return dilated;
       }},
      {"holes-20%", [](const Mat& map, const Mat&) { return WithHoles(map, 0.2); }},
      {"scale-1.1", [](const Mat& map, const Mat&) { return Mat(map * 1.1); }},
      {"scale-0.9", [](const Mat& map, const Mat&) { return Mat(map * 0.9); }},
      {"offset-0.2", [](const Mat& map, const Mat&) { return Mat(map + 0.2); }},
      {"relative-8bit", [](const Mat& map, const Mat&) { return AsGreyLevels(map); }, true},
      {"noise-0.2", [](const Mat& map, const Mat&) { return WithNoise(map, 0.2); }},
      {"flipped",
       [](const Mat& map, const Mat&) {
         Mat flipped;
         cv::flip(map, flipped, 0);
         return flipped;
       }},
      {"rotated",
       [](const Mat& map, const Mat&) {
         Mat rotated;
         cv::rotate(map, rotated, cv::ROTATE_180);
         return rotated;
       }},
      {"of-another",
       [](const Mat& map, const Mat& other) {
         if (other.size() == map.size()) return other;
         Mat resized;
         cv::resize(other, resized, map.size(), 0, 0, cv::INTER_NEAREST);
         return resized;
       }},
  };
  return all;
}

// A light field with true views: its photograph, and the exact map.
struct TrueScene {
  LightField views;
  Image photo;
  cv::Mat disparity;
};

cv::Mat ReadMap(const std::string& folder) {
  DepthMeaning meaning;
  meaning.kind = DepthKind::kDisparity;
  DepthMap map = ReadDepth(folder + "/gt_disp_lowres.pfm", meaning);
  return cv::Mat(map.height_px, map.width_px, CV_32F, map.values.data()).clone();
}

// The photograph is the weighted mean of the views in linear light, encoded, with noise of 1/255,
// and rounded to 8 bits.
TrueScene ReadScene(const std::string& folder, const Arguments& arguments) {
  LightFieldReadOptions reading;
  reading.hci_grid = 9;
  TrueScene scene{ReadLightField(folder, reading), {}, ReadMap(folder)};
  const LightField& views = scene.views;
  const Eigen::ArrayXXd weights = model::ApertureWeights(
      arguments.as_gaussian ? model::ApertureShape::kGaussian : model::ApertureShape::kUniform,
      views.u_count, views.v_count);
  std::vector<double> mean;
  for (int l = 0; l < views.v_count; ++l) {
    for (int k = 0; k < views.u_count; ++k) {
      const model::LinearImage view = model::ViewImage(views, k, l);
      mean.resize(view.values.size(), 0.0);
      for (std::size_t i = 0; i < mean.size(); ++i)
        mean[i] += weights(l, k) * static_cast<double>(view.values[i]);
    }
  }
  constexpr double kLevels = 255;
  std::mt19937_64 engine(kNoiseSeed);
  std::normal_distribution<double> normal(0, 1 / kLevels);
  std::vector<std::uint16_t> stored;
  stored.reserve(mean.size());
  for (const double light : mean) {
    const double value = views.transfer.Encode(light) + normal(engine);
    stored.push_back(
        static_cast<std::uint16_t>(std::lround(std::clamp(value, 0.0, 1.0) * kLevels)));
  }
  scene.photo = Image::FromEncoded(views.s_count, views.t_count,
                                   views.channels == 1 ? ChannelOrder::kGrey : ChannelOrder::kRgb,
                                   8, std::move(stored), views.transfer);
  return scene;
}

// The rms error of the disparities that were used, px per view step.
double ErrorPx(const estimator::DisparityMap& used, const cv::Mat& exact) {
  const cv::Mat map(exact.size(), CV_32F, const_cast<float*>(used.disparity.data()));
  return cv::norm(map, exact, cv::NORM_L2) / std::sqrt(static_cast<double>(exact.total()));
}

Row Measure(const TrueScene& scene, const Degradation& degradation, const cv::Mat& map,
            const Arguments& arguments) {
  DepthMap depth;
  depth.width_px = map.cols;
  depth.height_px = map.rows;
  depth.values.assign(map.begin<float>(), map.end<float>());
  depth.meaning.kind = DepthKind::kDisparity;
  depth.meaning.is_relative = degradation.is_relative;
  EstimateOptions options;
  options.views = ViewCounts{scene.views.u_count, scene.views.v_count};
  options.aperture.shape =
      arguments.as_gaussian ? model::ApertureShape::kGaussian : model::ApertureShape::kUniform;
  SceneSolver solver;
  solver.prior = arguments.prior == "patches" ? Prior::kPatches : Prior::kTotalVariation;
  options.solver = solver;
  if (arguments.refine == "on") options.refine_depth = DepthRefining::kOn;
  if (arguments.refine == "off") options.refine_depth = DepthRefining::kOff;
  RunControl run;
  run.threads = arguments.threads;
  Row row;
  row.map = degradation.name;
  const auto start = std::chrono::steady_clock::now();
  try {
    const LightFieldEstimate estimate =
        EstimateLightField(scene.photo, std::move(depth), std::nullopt, options, run);
    row.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
    row.psnr_db =
        estimator::CompareLightFields(scene.views, estimate.light_field, arguments.border_px,
                                      std::nullopt, arguments.threads)
            .mean.psnr_db;
    row.error_px = ErrorPx(estimate.problem->input().disparity, scene.disparity);
    row.remark = estimate.summary.partial_reason.empty()
                     ? fmt::format("{} warning(s)", estimate.summary.warnings.size())
                     : "partial: " + estimate.summary.partial_reason;
    if (const auto& refined = estimate.diagnostics.depth_refinement)
      row.remark += fmt::format("; {} ({:.2f} s)", refined->message, refined->seconds);
    if (const auto& values = estimate.diagnostics.depth_values)
      row.remark += fmt::format("; {} ({:.2f} s)", values->message, values->seconds);
  } catch (const Interrupted&) {
    throw;
  } catch (const Error& error) {
    row.remark = std::string("refused: ") + error.what();
  }
  return row;
}

std::vector<std::string> NamesOfMaps() {
  std::vector<std::string> names;
  for (const Degradation& degradation : AllDegradations()) names.push_back(degradation.name);
  return names;
}

void AddOptions(CLI::App* app, Arguments* arguments) {
  app->add_option("folders", arguments->folders,
                  "light fields in the HCI layout with gt_disp_lowres.pfm (lf_antinous)");
  app->add_option("--map", arguments->maps, "states of the map (all)")
      ->check(CLI::IsMember(NamesOfMaps()));
  app->add_option("--prior", arguments->prior, "of the solver (tv)")
      ->check(CLI::IsMember({"tv", "patches"}));
  app->add_flag("--gaussian", arguments->as_gaussian, "instead of a uniform aperture");
  app->add_option("--other", arguments->other,
                  "folder of the light field whose map is of-another (lf_backgammon)");
  app->add_option("--refine-depth", arguments->refine, "auto (default), on or off")
      ->check(CLI::IsMember({"auto", "on", "off"}));
  app->add_option("--border", arguments->border_px, "px that are left out (20)")
      ->check(CLI::Range(0, 100));
  app->add_option("--threads", arguments->threads, "0: one per core")->check(CLI::Range(0, 1024));
  app->add_option("--json", arguments->json_path, "writes the rows, too");
}

void Run(const Arguments& arguments) {
  const std::string other_folder =
      arguments.other.empty() ? THICKLENS_SHARED_DATA_DIR "/lf_backgammon" : arguments.other;
  nlohmann::json rows = nlohmann::json::array();
  std::cout
      << "PSNR of all views in dB; error of the disparity that was used, rms in px per view "
         "step\n| light field | map | PSNR | error | s | remark |\n|---|---|---|---|---|---|\n";
  for (const std::string& folder : arguments.folders) {
    if (!std::filesystem::exists(folder)) {
      std::cout << fmt::format("{} is not there: its rows are left out\n", folder);
      continue;
    }
    const TrueScene scene = ReadScene(folder, arguments);
    cv::Mat other;
    for (const Degradation& degradation : AllDegradations()) {
      const bool is_asked =
          arguments.maps.empty() || std::find(arguments.maps.begin(), arguments.maps.end(),
                                              degradation.name) != arguments.maps.end();
      if (!is_asked) continue;
      if (degradation.name == "of-another") {
        if (!std::filesystem::exists(other_folder)) {
          std::cout << fmt::format("{} is not there: of-another is left out\n", other_folder);
          continue;
        }
        other = ReadMap(other_folder);
      }
      Row row = Measure(scene, degradation, degradation.make(scene.disparity, other), arguments);
      row.light_field = std::filesystem::path(folder).filename().string();
      std::cout << fmt::format("| {} | {} | {:.2f} | {:.3f} | {:.1f} | {} |\n", row.light_field,
                               row.map, row.psnr_db, row.error_px, row.seconds, row.remark)
                << std::flush;
      rows.push_back({{"light_field", row.light_field},
                      {"map", row.map},
                      {"psnr_db", row.psnr_db},
                      {"error_px", row.error_px},
                      {"seconds", row.seconds},
                      {"remark", row.remark}});
    }
  }
  if (arguments.json_path.empty()) return;
  std::ofstream out(arguments.json_path);
  out << nlohmann::json({{"rows", rows}}).dump(2) << "\n";
  if (!out) throw Error(arguments.json_path + ": cannot be written");
}

}  // namespace
}  // namespace thicklens

int main(int argc, char** argv) {
  CLI::App app{"Light fields estimated with inexact depth maps against the truth"};
  thicklens::Arguments arguments;
  thicklens::AddOptions(&app, &arguments);
  CLI11_PARSE(app, argc, argv);
  try {
    thicklens::Run(arguments);
  } catch (const std::exception& error) {
    std::cerr << "error: " << error.what() << "\n";
    return 1;
  }
  return 0;
}
