// The layout of the 4D Light Field Benchmark (Honauer et al., ACCV 2016): input_CamNNN.png, row by
// row, and parameters.cfg. Copies of it with JPEG or other files have the same names.
#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <map>
#include <memory>
#include <sstream>
#include <system_error>

#include "thicklens/base/error.h"
#include "thicklens/base/input_file.h"
#include "thicklens/base/printable_text.h"
#include "tools/io/image_names.h"
#include "tools/io/lightfields/layout.h"
#include "tools/io/lightfields/view_grid.h"
#include "tools/io/lightfields/view_pixels.h"
#include "tools/io/view_files.h"

namespace thicklens::io {
namespace {

namespace fs = std::filesystem;

constexpr int kMaxHciNumber = 999999;
constexpr char kPng[] = ".png";

// The numbers of the views that are in the folder, in their order, and the ending of their files.
struct HciViews {
  std::vector<int> numbers;
  std::string ending = kPng;
  std::vector<std::string>
      others;  // "25 files of .jpg": views of other endings, which are not read
};

// The files of the ending that has the most views; of equally many, PNG, the benchmark's own.
HciViews HciViewsOf(const std::string& folder) {
  std::map<std::string, std::vector<int>> numbers_by_ending;
  std::error_code failure;
  for (const auto& entry : fs::directory_iterator(folder, failure)) {
    const std::string name = entry.path().filename().string();
    if (name.rfind(kHciStem, 0) != 0 || !IsImageName(name)) continue;
    const std::string ending = entry.path().extension().string();
    const int number = std::atoi(name.c_str() + sizeof kHciStem - 1);
    if (number >= 0 && number <= kMaxHciNumber && name == HciFile(number, ending))
      numbers_by_ending[ending].push_back(number);
  }
  if (failure) throw Error(fmt::format("{}: cannot be read: {}", folder, failure.message()));
  HciViews views;
  views.numbers = numbers_by_ending[kPng];
  for (const auto& [ending, numbers] : numbers_by_ending) {
    if (numbers.size() > views.numbers.size()) views = {numbers, ending, {}};
  }
  for (const auto& [ending, numbers] : numbers_by_ending) {
    if (ending != views.ending && !numbers.empty())
      views.others.push_back(fmt::format("{} file(s) of {}", numbers.size(), ending));
  }
  std::sort(views.numbers.begin(), views.numbers.end());
  return views;
}

std::string Trimmed(const std::string& text) {
  const auto begin = text.find_first_not_of(" \t\r");
  if (begin == std::string::npos) return "";
  return text.substr(begin, text.find_last_not_of(" \t\r") - begin + 1);
}

// Returns num_cams_x of the benchmark's parameters.cfg, an INI file, or 0 if there is no such file.
int HciRowLength(const std::string& folder) {
  const std::string path = (fs::path(folder) / kHciMarker).string();
  std::error_code ignored;
  if (!fs::exists(path, ignored)) return 0;
  std::istringstream lines(ReadTextFile(path));
  std::string line;
  for (int number = 1; std::getline(lines, line); ++number) {
    const auto equals = line.find('=');
    if (equals == std::string::npos || Trimmed(line.substr(0, equals)) != "num_cams_x") continue;
    const std::string text = Trimmed(line.substr(equals + 1));
    char* end = nullptr;
    const long value = std::strtol(text.c_str(), &end, 10);
    if (text.empty() || *end != '\0' || value < 1 || value > kMaxHciNumber) {
      throw Error(
          fmt::format("{}:{}: num_cams_x: a whole number from 1 to {} is expected, found '{}'",
                      path, number, kMaxHciNumber, PrintableUtf8(text)));
    }
    return static_cast<int>(value);
  }
  throw Error(fmt::format("{}: num_cams_x is missing; add it, or set the option grid", path));
}

int InferredRowLength(const std::string& folder, const HciViews& views) {
  if (const int length = HciRowLength(folder)) return length;
  const std::vector<int>& numbers = views.numbers;
  const auto count = static_cast<int>(numbers.size());
  const auto edge = static_cast<int>(std::lround(std::sqrt(count)));
  // Copies of the benchmark may count from 1.
  const bool is_first = numbers.front() == 0 || (numbers.front() == 1 && count > 1);
  const bool is_gapless = is_first && numbers.back() - numbers.front() == count - 1;
  if (edge * edge == count && is_gapless) return edge;
  throw Error(
      fmt::format("{}: {} views from {} to {} do not form a full square, and there is no {}: "
                  "the option grid must state how many views the numbering counts per row",
                  folder, count, HciFile(numbers.front(), views.ending),
                  HciFile(numbers.back(), views.ending), kHciMarker));
}

// The views, of which `first` is the number of the first in the first row.
ViewSource HciSource(const LayoutInput& input, const HciViews& views, int row, int first) {
  const std::string& folder = input.path;
  const std::vector<int>& numbers = views.numbers;
  int first_u = row, last_u = 0;
  for (const int number : numbers) {
    first_u = std::min(first_u, (number - first) % row);
    last_u = std::max(last_u, (number - first) % row);
  }
  const int first_v = (numbers.front() - first) / row;
  const int last_v = (numbers.back() - first) / row;

  ViewSource source;
  source.kind = "a folder in the HCI layout";
  if (views.ending != kPng) source.details.push_back(fmt::format("{} files", views.ending));
  if (!views.others.empty()) {
    source.notices.push_back(fmt::format("{}: its views are the {} files of {}; not read: {}",
                                         folder, numbers.size(), views.ending,
                                         fmt::join(views.others, ", ")));
  }
  model::LightField& frame = source.frame;
  frame.u_count = last_u - first_u + 1;
  frame.v_count = last_v - first_v + 1;
  if (first > 0) {
    source.notices.push_back(fmt::format(
        "{}: its views are numbered from {}, not from 0 as in the benchmark: {} is taken as the "
        "first view of the first row",
        folder, first, HciFile(first, views.ending)));
  }
  const auto number_of = [row, first, first_u, first_v](int k, int l) {
    return first + (first_v + l) * row + first_u + k;
  };
  frame.weights = Eigen::ArrayXXd::Zero(frame.v_count, frame.u_count);
  std::vector<std::string> missing;
  for (int l = 0; l < frame.v_count; ++l) {
    for (int k = 0; k < frame.u_count; ++k) {
      const bool there = std::binary_search(numbers.begin(), numbers.end(), number_of(k, l));
      frame.present.push_back(there);
      if (there) frame.weights(l, k) = 1.0 / static_cast<double>(numbers.size());
      if (!there) missing.push_back(HciFile(number_of(k, l), views.ending));
    }
  }
  if (missing.empty()) frame.present.clear();
  if (!missing.empty() && !input.reading->sparse) ThrowMissingViews(folder, missing);
  if (!missing.empty()) source.details.push_back(fmt::format("missing: {}", Listed(missing)));
  source.is_plain = source.details.empty() && first == 0;
  frame.origin.method = "imported";
  source.read = [folder, number_of, ending = views.ending](int k, int l) {
    const std::string path = (fs::path(folder) / HciFile(number_of(k, l), ending)).string();
    return ending == kPng ? ReadPngView(path, model::TransferCurve::Srgb()) : ReadLightOfFile(path);
  };
  return source;
}

}  // namespace

std::optional<ViewSource> OpenHciFolder(const LayoutInput& input) {
  const std::string& folder = input.path;
  const HciViews views = HciViewsOf(folder);
  const std::vector<int>& numbers = views.numbers;
  if (numbers.empty()) {
    if (!input.is_forced) return std::nullopt;
    throw Error(
        fmt::format("{}: not a light field in the HCI layout: neither {}, {} nor another "
                    "view is in it",
                    folder, HciFile(0), HciFile(1)));
  }
  for (const int number : numbers)
    ReportInput((fs::path(folder) / HciFile(number, views.ending)).string());
  const int stated = input.reading->grid > 0 ? input.reading->grid : input.reading->layout_u;
  const int row = stated > 0 ? stated : InferredRowLength(folder, views);
  ViewSource source = HciSource(input, views, row, FirstOfNumbering(numbers, row));
  if (MayStartAtOne(numbers, row))
    source.from_one = std::make_shared<const ViewSource>(HciSource(input, views, row, 1));
  return source;
}

}  // namespace thicklens::io
