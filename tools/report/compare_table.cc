#include "tools/report/compare_table.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <optional>

namespace thicklens::tools {
namespace {

std::string NumberText(double value, int digits) {
  return std::isfinite(value) ? fmt::format("{:.{}f}", value, digits) : "-";
}

std::string PsnrText(double psnr_db) {
  return psnr_db > 0 && std::isinf(psnr_db) ? "identical" : NumberText(psnr_db, 2);
}

std::string HeadLine() {
  return fmt::format("{:<14}{:>10}{:>9}{:>9}{:>19}\n", "", "PSNR dB", "SSIM", "M-dE94",
                     "edge orientation");
}

std::string Line(const std::string& name, const ImageScores& scores) {
  return fmt::format("{:<14}{:>10}{:>9}{:>9}{:>19}\n", name, PsnrText(scores.psnr_db),
                     NumberText(scores.ssim, 4), NumberText(scores.delta_e94_mean, 3),
                     scores.macade_standin ? NumberText(*scores.macade_standin, 4) : "-");
}

std::string LinesWithDibr(const std::string& name, const ImageScores& scores,
                          const std::optional<ImageScores>& dibr) {
  return Line(name, scores) + (dibr ? Line("  DIBR", *dibr) : "");
}

nlohmann::json FiniteOrNull(double value) {
  return std::isfinite(value) ? nlohmann::json(value) : nlohmann::json(nullptr);
}

nlohmann::json ScoresOrNull(const std::optional<ImageScores>& scores) {
  return scores ? ImageScoresJson(*scores) : nlohmann::json(nullptr);
}

bool IsIdentical(const ImageScores& scores) { return std::isinf(scores.psnr_db); }

std::size_t CountIdentical(const LightFieldScores& scores) {
  return static_cast<std::size_t>(
      std::count_if(scores.views.begin(), scores.views.end(),
                    [](const ViewScores& view) { return IsIdentical(view.scores); }));
}

// The number of views in the means of PSNR, as CompareLightFields counts them.
std::size_t ViewsInPsnrMean(const LightFieldScores& scores) {
  std::size_t own = 0, both = 0;
  for (const ViewScores& view : scores.views) {
    if (IsIdentical(view.scores)) continue;
    ++own;
    if (!view.dibr || !IsIdentical(*view.dibr)) ++both;
  }
  return both > 0 ? both : own;
}

nlohmann::json ViewJson(const ViewScores& view) {
  return {{"u", view.k},
          {"v", view.l},
          {"psnr_db", FiniteOrNull(view.scores.psnr_db)},
          {"identical", IsIdentical(view.scores)},
          {"ssim", FiniteOrNull(view.scores.ssim)},
          {"dibr_psnr_db", view.dibr ? FiniteOrNull(view.dibr->psnr_db) : nlohmann::json(nullptr)}};
}

}  // namespace

std::string ImageScoresText(const ImageScores& scores, int border_px) {
  return HeadLine() + Line(fmt::format("border {} px", border_px), scores);
}

nlohmann::json ImageScoresJson(const ImageScores& scores) {
  return {{"psnr_db", FiniteOrNull(scores.psnr_db)},
          {"identical", IsIdentical(scores)},
          {"ssim", FiniteOrNull(scores.ssim)},
          {"delta_e94_mean", FiniteOrNull(scores.delta_e94_mean)},
          {"macade_standin",
           scores.macade_standin ? FiniteOrNull(*scores.macade_standin) : nlohmann::json(nullptr)}};
}

int ViewsAboveDibr(const LightFieldScores& scores) {
  return static_cast<int>(
      std::count_if(scores.views.begin(), scores.views.end(), [](const ViewScores& view) {
        return view.dibr && view.scores.psnr_db > view.dibr->psnr_db;
      }));
}

std::string LightFieldScoresText(const LightFieldScores& scores, int border_px, bool per_view) {
  const std::size_t views = scores.views.size();
  std::string text =
      fmt::format("{} views of {}x{}, {}x{} px each, border {} px\n", views, scores.u_count,
                  scores.v_count, scores.width_px, scores.height_px, border_px);
  text += HeadLine();
  text += LinesWithDibr("mean", scores.mean, scores.dibr_mean);
  text += LinesWithDibr("centre", scores.centre, scores.dibr_centre);
  text += LinesWithDibr("corner", scores.corner, scores.dibr_corner);
  if (const std::size_t identical = CountIdentical(scores)) {
    text += fmt::format("{} of {} views are identical{}\n", identical, views,
                        identical < views ? " and left out of the means of PSNR" : "");
  }
  if (scores.dibr_mean && ViewsInPsnrMean(scores) < views - CountIdentical(scores)) {
    text += fmt::format(
        "means of PSNR, with and without DIBR, are over the {} of {} views that differ from the "
        "reference in both\n",
        ViewsInPsnrMean(scores), views);
  }
  if (scores.dibr_mean)
    text += fmt::format("views above DIBR (PSNR): {} of {}\n", ViewsAboveDibr(scores), views);
  if (!per_view) return text;
  for (const ViewScores& view : scores.views)
    text += LinesWithDibr(fmt::format("({}, {})", view.k, view.l), view.scores, view.dibr);
  return text;
}

nlohmann::json LightFieldScoresJson(const LightFieldScores& scores, int border_px) {
  nlohmann::json json = {{"status", "ok"},
                         {"reason", ""},
                         {"views", {scores.u_count, scores.v_count}},
                         {"size", {scores.width_px, scores.height_px}},
                         {"border_px", border_px},
                         {"mean", ImageScoresJson(scores.mean)},
                         {"centre", ImageScoresJson(scores.centre)},
                         {"corner", ImageScoresJson(scores.corner)},
                         {"identical_views", CountIdentical(scores)},
                         {"views_in_psnr_mean", ViewsInPsnrMean(scores)},
                         {"per_view", nlohmann::json::array()},
                         {"dibr", nullptr},
                         {"views_above_dibr", nullptr}};
  for (const ViewScores& view : scores.views) json["per_view"].push_back(ViewJson(view));
  if (!scores.dibr_mean) return json;
  json["dibr"] = {{"mean", ScoresOrNull(scores.dibr_mean)},
                  {"centre", ScoresOrNull(scores.dibr_centre)},
                  {"corner", ScoresOrNull(scores.dibr_corner)}};
  json["views_above_dibr"] = ViewsAboveDibr(scores);
  return json;
}

}  // namespace thicklens::tools
