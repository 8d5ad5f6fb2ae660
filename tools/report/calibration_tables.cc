#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <string>
#include <vector>

#include "thicklens/base/printable_text.h"
#include "thicklens/calib/error_budget.h"
#include "tools/interface/missing_tolerances.h"
#include "tools/report/calibration_sections.h"
#include "tools/report/calibration_text.h"
#include "tools/report/grid_words.h"
#include "tools/report/page_style.h"
#include "tools/report/rounding.h"

namespace thicklens::tools {
namespace {

using calib::Calibration;
using calib::FocusSweep;

constexpr char kNone[] = "–";
constexpr char kWasNotRun[] = "not run";
constexpr char kTableEnd[] = "</tbody></table></div>\n";

// The head of a column; heads of numbers are aligned right.
struct TableColumn {
  const char* name;
  bool is_number = true;
};

std::string TableBegin(const std::vector<TableColumn>& columns) {
  std::string html = "<div class=\"wide\"><table>\n<thead><tr>";
  for (const TableColumn& column : columns)
    html += fmt::format("<th{}>{}</th>", column.is_number ? " class=\"number\"" : "",
                        EscapeXml(column.name));
  return html + "</tr></thead>\n<tbody>\n";
}

std::string RowHead(const std::string& name) {
  return fmt::format("<tr><th scope=\"row\">{}</th>", EscapeXml(name));
}

// The ranges of zf, d1 and kappa that a cause of error makes.
std::vector<std::string> RangesOf(const calib::ErrorTerm& term, const Calibration& calibration) {
  for (const calib::SystematicPart& part : calibration.diagnostics.systematic_parts) {
    if (!term.is_statistical && part.name == term.name)
      return {PartRange(part.focus_depth_mm), PartRange(part.image_distance_mm),
              PartRange(part.blur_ratio)};
  }
  std::vector<std::string> ranges;
  for (const double half : {term.focus_depth_mm, term.image_distance_mm, term.blur_ratio})
    ranges.push_back(PartRange({-half, half}));
  return ranges;
}

std::string RowName(const ResultRow& row) {
  return RowHead(row.label + (row.unit.empty() ? "" : fmt::format(" [{}]", row.unit)));
}

std::string ErrorsTable(const std::vector<ResultRow>& rows) {
  std::string html = "<h3>Errors against the truth of the simulation</h3>\n" +
                     TableBegin({{"quantity", false},
                                 {"truth"},
                                 {"blur fit"},
                                 {"in standard deviations"},
                                 {"paper's recipe"},
                                 {"sharpness peak"}});
  for (const ResultRow& row : rows) {
    if (!row.truth) continue;
    const double sigma = row.fit ? row.fit->sigma : 0;
    html += RowName(row) + TableCell(RoundedTo(*row.truth, sigma));
    const bool is_found = row.fit && std::isfinite(row.fit->value);
    html += TableCell(is_found ? SignedRoundedTo(row.fit->value - *row.truth, sigma) : kNone,
                      "number chosen");
    html += TableCell(is_found && sigma > 0
                          ? fmt::format("{:+.1f}", (row.fit->value - *row.truth) / sigma)
                          : kNone);
    html += TableCell(row.source ? SignedRoundedTo(*row.source - *row.truth, sigma) : kNone);
    html += TableCell(row.peak ? SignedRoundedTo(row.peak->value - *row.truth, row.peak->sigma)
                               : kNone);
    html += "</tr>\n";
  }
  return html + kTableEnd;
}

// Another method for the in-focus object distance.
struct Way {
  std::string name;
  bool done = false;
  std::string remark;  // the reason, if it was not done
  std::optional<model::Estimate> focus_depth_mm, blur_ratio;
};

std::string NameOfFrame(const Calibration& calibration, int index) {
  if (index < 0 || index >= static_cast<int>(calibration.frames.size())) return "";
  return FrameName(calibration.frames[static_cast<std::size_t>(index)].image);
}

Way SideWay(const std::string& name, const calib::SideFit& side) {
  Way way{name, side.done, side.message, {}, {}};
  if (!side.done) return way;
  way.remark = fmt::format("{} frames", side.frames_used);
  way.focus_depth_mm = side.focus_depth_mm;
  way.blur_ratio = side.blur_ratio;
  return way;
}

std::vector<Way> OtherWays(const Calibration& calibration) {
  std::vector<Way> ways;
  const calib::SourceRecipe& source = calibration.diagnostics.paper_recipe;
  Way raw{"paper's recipe", source.done, source.message, {}, {}};
  if (source.done) {
    raw.remark = fmt::format("depth of {}; κ from {} frames",
                             NameOfFrame(calibration, source.sharpest_frame), source.ratio_frames);
    raw.focus_depth_mm = model::Estimate{source.focus_depth_mm, 0};
    raw.blur_ratio = model::Estimate{source.blur_ratio, 0};
  }
  ways.push_back(raw);
  if (source.done && source.normalised_focus_depth_mm > 0)
    ways.push_back({"paper's recipe, over mean grey",
                    true,
                    "depth of " + NameOfFrame(calibration, source.sharpest_normalised_frame),
                    model::Estimate{source.normalised_focus_depth_mm, 0},
                    {}});
  const calib::SharpnessPeak& peak = calibration.diagnostics.sharpness;
  Way parabola{"peak of the normalised sharpness", peak.done, peak.message, {}, {}};
  if (peak.done) {
    parabola.remark = fmt::format("log-parabola through {} frames", peak.frames_used);
    parabola.focus_depth_mm = model::Estimate{peak.focus_depth_mm, peak.sigma_mm};
  }
  ways.push_back(parabola);
  ways.push_back(SideWay("blur, nearer side only", calibration.diagnostics.nearer));
  ways.push_back(SideWay("blur, farther side only", calibration.diagnostics.farther));
  for (const calib::ChannelFocus& channel : calibration.diagnostics.channels) {
    Way way{
        fmt::format("blur, {} channel only", channel.name), channel.done, channel.message, {}, {}};
    if (channel.done) {
      way.remark.clear();
      way.focus_depth_mm = channel.focus_depth_mm;
    }
    ways.push_back(way);
  }
  return ways;
}

std::string EstimateCell(const std::optional<model::Estimate>& estimate, double sigma_else) {
  if (!estimate || !std::isfinite(estimate->value)) return TableCell(kNone);
  if (UsableSigma(estimate->sigma))
    return TableCell(WithSigma({estimate->value, estimate->sigma, std::nullopt}));
  return TableCell(RoundedTo(estimate->value, sigma_else));
}

double SigmaOf(const std::optional<calib::Result>& result) { return result ? result->sigma : 0; }

// The difference from the fit, with the digits of the larger error.
std::string ApartCell(const std::optional<model::Estimate>& focus_mm,
                      const std::optional<calib::Result>& fit) {
  if (!focus_mm || !fit || !std::isfinite(fit->value)) return TableCell(kNone);
  return TableCell(
      SignedRoundedTo(focus_mm->value - fit->value, std::max(focus_mm->sigma, fit->sigma)));
}

}  // namespace

std::string Typeset(const std::string& text) {
  std::string out;
  for (std::size_t i = 0; i < text.size(); ++i) {
    const bool number_follows =
        i + 1 < text.size() && ((text[i + 1] >= '0' && text[i + 1] <= '9') || text[i + 1] == '.');
    const bool begins = i == 0 || text[i - 1] == ' ' || text[i - 1] == '(' || text[i - 1] == '[';
    if (text.compare(i, 2, "+-") == 0) {
      out += "±";
      ++i;
    } else if (text.compare(i, 4, " .. ") == 0) {
      out += " … ";
      i += 3;
    } else if (text.compare(i, 4, "chi2") == 0) {
      out += "χ²";
      i += 3;
    } else if (text.compare(i, 4, " deg") == 0 && (i + 4 == text.size() || text[i + 4] == ' ')) {
      out += "°";
      i += 3;
    } else if (text[i] == '-' && begins && number_follows) {
      out += "−";
    } else {
      out += text[i];
    }
  }
  return out;
}

std::string WithSigma(const calib::Result& result) {
  if (!std::isfinite(result.value)) return "not determined";
  if (!(result.sigma > 0)) return RoundedTo(result.value, 0) + "\u00A0(held)";
  return fmt::format("{}\u00A0±\u00A0{}", RoundedTo(result.value, result.sigma),
                     RoundedSigma(result.sigma));
}

std::string ResultsSection(const std::vector<ResultRow>& rows, bool has_truth) {
  const bool any_result = std::any_of(rows.begin(), rows.end(), [](const ResultRow& row) {
    return row.fit || row.source || row.peak;
  });
  if (!any_result) return "<h2>Results</h2>\n<p>None.</p>\n";
  std::string html = "<h2>Results</h2>\n" + TableBegin({{"quantity", false},
                                                        {"blur fit ± statistical"},
                                                        {"systematic interval"},
                                                        {"paper's recipe"},
                                                        {"sharpness peak"}});
  for (const ResultRow& row : rows) {
    const double sigma = row.fit ? row.fit->sigma : 0;
    html += RowName(row);
    html += TableCell(row.fit ? WithSigma(*row.fit) : kNone, "number chosen");
    html += TableCell(row.fit && row.fit->systematic
                          ? fmt::format("{} … {}", RoundedTo(row.fit->systematic->x(), sigma),
                                        RoundedTo(row.fit->systematic->y(), sigma))
                          : kNone);
    html += TableCell(row.source ? RoundedTo(*row.source, sigma) : kNone);
    html += TableCell(row.peak ? WithSigma(*row.peak) : kNone) + "</tr>\n";
  }
  html += kTableEnd;
  html +=
      "<p class=\"soft\">Statistical: one standard deviation from noise, readings and the bench "
      "offset. Systematic: the interval that the causes in the table below allow together. The "
      "paper's recipe has no error estimate. A value that is held was stated or assumed, and "
      "not fitted.</p>\n";
  return html + (has_truth ? ErrorsTable(rows) : "");
}

std::string SystematicSection(const FocusSweep& sweep, const Calibration& calibration,
                              bool has_truth) {
  const std::vector<calib::ErrorTerm> terms = calib::ErrorTerms(calibration);
  if (terms.empty()) return "";
  const std::string missing = has_truth ? "" : MissingTolerancesLine(sweep.camera);
  double all = 0;
  for (const calib::ErrorTerm& term : terms) all += term.effect;
  std::string html =
      "<h2>Where the error comes from</h2>\n" + TableBegin({{"cause", false},
                                                            {"share"},
                                                            {"zf [mm]"},
                                                            {"d1 [mm]"},
                                                            {"κ"},
                                                            {"what would reduce it", false}});
  for (const calib::ErrorTerm& term : terms) {
    html += RowHead(term.name) +
            TableCell(all > 0 ? fmt::format("{:.0f} %", 100 * term.effect / all) : kNone);
    for (const std::string& range : RangesOf(term, calibration)) html += TableCell(Typeset(range));
    html += TableCell(Typeset(term.remedy), "words") + "</tr>\n";
  }
  return html + kTableEnd +
         "<p class=\"soft\">Change of each result due to the cause: the largest of a systematic "
         "cause, 1.96 standard deviations of noise, readings and bench offset. The share compares "
         "what the causes do to the blur at the ends of the sweep.</p>\n" +
         (missing.empty() ? "" : fmt::format("<p>{}</p>\n", EscapeXml(AsSentence(missing))));
}

std::string OtherWaysSection(const Calibration& calibration, const std::vector<ResultRow>& rows) {
  std::optional<calib::Result> zf, kappa;
  for (const ResultRow& row : rows) {
    if (row.key == "focus_depth_mm") zf = row.fit;
    if (row.key == "blur_ratio") kappa = row.fit;
  }
  std::string table, missing;
  const auto say = [&](const std::string& what, bool done, const std::string& message) {
    if (!done && message != kWasNotRun)
      missing += fmt::format("<li>{}: {}</li>\n", EscapeXml(what), EscapeXml(Typeset(message)));
  };
  for (const Way& way : OtherWays(calibration)) {
    say(way.name, way.done, way.remark);
    if (!way.done) continue;
    table += RowHead(way.name) + EstimateCell(way.focus_depth_mm, SigmaOf(zf)) +
             ApartCell(way.focus_depth_mm, zf) + EstimateCell(way.blur_ratio, SigmaOf(kappa)) +
             TableCell(way.remark, "soft") + "</tr>\n";
  }
  say("model of the image scale", calibration.diagnostics.scale.done,
      calibration.diagnostics.scale.message);
  say("blur fit", calibration.diagnostics.blur.done, calibration.diagnostics.blur.message);
  std::string html;
  if (!table.empty())
    html +=
        TableBegin({{"method", false}, {"zf [mm]"}, {"from the fit [mm]"}, {"κ"}, {"", false}}) +
        table + kTableEnd;
  for (const std::string& line :
       {MagnificationLine(calibration), DistortionLine(calibration.diagnostics.scale)})
    if (!line.empty())
      html += fmt::format("<p class=\"soft\">From the image scale: {}.</p>\n",
                          EscapeXml(Typeset(line)));
  std::vector<std::string> seen = GridLines(calibration.diagnostics.grid);
  seen.push_back(MarksLine(calibration));
  for (const std::string& line : seen)
    if (!line.empty())
      html += fmt::format("<p class=\"soft\">From the grid or the marks of the target: {}.</p>\n",
                          EscapeXml(Typeset(line)));
  if (!missing.empty()) html += "<p>Without a result:</p>\n<ul>\n" + missing + "</ul>\n";
  return html.empty() ? "" : "<h2>Results of other methods</h2>\n" + html;
}

std::string FieldWords(const Calibration& calibration) {
  std::string items;
  const auto item = [&](const std::string& text) {
    items += fmt::format("<li>{}</li>\n", EscapeXml(Typeset(text)));
  };
  for (const std::string& line : FieldLines(calibration.diagnostics.field)) item(line);
  if (!calibration.diagnostics.channels.empty())
    item("colours: " + ChannelLine(calibration.diagnostics.channels));
  return items.empty() ? "" : "<ul>\n" + items + "</ul>\n";
}

std::string CorrelationSection(const Calibration& calibration) {
  const Eigen::MatrixXd& covariance = calibration.diagnostics.covariance;
  const auto count = static_cast<Eigen::Index>(calibration.diagnostics.covariance_order.size());
  if (count == 0 || covariance.rows() != count || covariance.cols() != count) return "";
  std::vector<TableColumn> columns = {{"correlation", false}};
  for (const std::string& name : calibration.diagnostics.covariance_order)
    columns.push_back({name.c_str()});
  columns.push_back({"standard deviation"});
  std::string html = "<h2>Covariance of the fit</h2>\n" + TableBegin(columns);
  for (Eigen::Index i = 0; i < count; ++i) {
    html += RowHead(calibration.diagnostics.covariance_order[static_cast<std::size_t>(i)]);
    for (Eigen::Index j = 0; j < count; ++j) {
      const double scale = std::sqrt(covariance(i, i) * covariance(j, j));
      html += TableCell(scale > 0 ? fmt::format("{:+.3f}", covariance(i, j) / scale) : kNone);
    }
    const double sigma = std::sqrt(covariance(i, i));
    html += TableCell(std::isfinite(sigma) ? fmt::format("{:.3g}", sigma) : kNone) + "</tr>\n";
  }
  return html + kTableEnd;
}

}  // namespace thicklens::tools
