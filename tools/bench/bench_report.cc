#include "tools/bench/bench_report.h"

#include <cstddef>

namespace thicklens::tools {
namespace {

constexpr char kTableName[] = "prices.csv";  // a folder with this file was written by this program
constexpr char kPageName[] = "index.html";

}  // namespace

void AddBenchReportOption(CLI::App* command, std::string* folder) {
  command
      ->add_option("--report", *folder,
                   "Folder for index.html, a page with the plots, their figures as SVG, and "
                   "prices.csv")
      ->type_name("DIR");
}

BenchReport::BenchReport(const std::string& folder) {
  if (folder.empty()) return;
  folder_.emplace(folder, kTableName,
                  std::vector<std::string>{kPageName, kTableName, "figures/*.svg"});
}

void BenchReport::Commit(const std::string& page, const std::string& csv,
                         const std::vector<Plot>& figures) {
  if (!folder_) return;
  folder_->Write(kPageName, page);
  folder_->Write(kTableName, csv);
  for (const Plot& figure : figures) {
    folder_->Write("figures/" + figure.id + ".svg", SvgFile(SvgPlot(figure)));
  }
  folder_->Commit();
}

PlotSeries FrontLine(const std::vector<double>& costs, const std::vector<double>& errors) {
  PlotSeries line;
  line.label = "Pareto front: no other is both faster and better";
  line.ink = Ink::kData;
  line.mark = Mark::kNone;
  line.stroke = Stroke::kSolid;
  line.thin = true;
  for (std::size_t i = 0; i < costs.size(); ++i) {
    if (i > 0) {
      line.x.push_back(costs[i]);
      line.y.push_back(errors[i - 1]);
    }
    line.x.push_back(costs[i]);
    line.y.push_back(errors[i]);
  }
  return line;
}

}  // namespace thicklens::tools
