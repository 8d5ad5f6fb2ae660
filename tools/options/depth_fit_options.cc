// The options of a depth map of another size, part or camera.
#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <memory>
#include <vector>

#include "tools/options/light_field_options.h"
#include "tools/options/option_values.h"

namespace thicklens::tools {
namespace {

// The four whole numbers of --depth-crop, of which the first two may be negative.
model::PixelRect RectangleOf(const std::string& text) {
  std::vector<int> numbers;
  const char* at = text.data();
  const char* const end = at + text.size();
  while (at < end) {
    int number = 0;
    const auto [next, failure] = std::from_chars(at, end, number);
    if (failure != std::errc()) break;
    numbers.push_back(number);
    at = next;
    if (at < end && *at == ',') ++at;
  }
  constexpr int kMaximum = 1000000;
  if (at != end || numbers.size() != 4 || std::count(text.begin(), text.end(), ',') != 3 ||
      numbers[2] < 1 || numbers[3] < 1 || std::any_of(numbers.begin(), numbers.end(), [](int n) {
        return n > kMaximum || n < -kMaximum;
      })) {
    throw UsageError(fmt::format(
        "--depth-crop: X,Y,W,H in px of the photograph, with W and H above 0, is expected, found "
        "'{}'",
        text));
  }
  return {numbers[0], numbers[1], numbers[2], numbers[3]};
}

}  // namespace

void AddDepthFitOptions(CLI::App* command, DepthFitOptions* options) {
  command
      ->add_option("--depth-crop", options->part,
                   "The rectangle of the photograph that DEPTH shows, px; may be larger than the "
                   "photograph. Default: the whole photograph")
      ->type_name("X,Y,W,H");
  command
      ->add_option(
          "--depth-camera", options->camera_path,
          "The camera that measured DEPTH and where it stands, for a map of another camera "
          "than the photograph's")
      ->type_name("FILE.yaml");
  command
      ->add_option("--depth-samples", options->samples,
                   "Where the values of a smaller map were measured: centre of its pixels, corner "
                   "(every n-th pixel was taken), or auto: at the centres, unless the photograph's "
                   "edges show otherwise (default)")
      ->check(CLI::IsMember({"auto", "centre", "corner"}))
      ->type_name("WHERE");
  command
      ->add_option("--depth-confidence", options->confidence_path,
                   "Confidence of each value of DEPTH, of its size: its weight, and no depth where "
                   "it is 0")
      ->type_name("FILE");
  command
      ->add_option(
          "--confidence-full", options->confidence_full,
          "Value of full confidence; default: the largest of the file's integer type, or 1 "
          "of floats")
      ->check(Finite())
      ->type_name("X");
  command
      ->add_option("--min-confidence", options->min_confidence,
                   "Values of less confidence, as a share of the full one, are no depth; default 0")
      ->check(CLI::Range(0.0, 1.0))
      ->type_name("SHARE");
}

DepthFit DepthFitOf(const DepthFitOptions& options) {
  DepthFit fit;
  if (!options.part.empty() && !options.camera_path.empty()) {
    throw UsageError(
        "--depth-crop and --depth-camera cannot be given together: the camera states "
        "which part of the photograph the map shows");
  }
  if (options.confidence_path.empty() && (options.confidence_full || options.min_confidence)) {
    throw UsageError("--confidence-full and --min-confidence require --depth-confidence");
  }
  if (options.confidence_full && !(*options.confidence_full > 0)) {
    throw UsageError(fmt::format("--confidence-full: a number above 0 is expected, found {:g}",
                                 *options.confidence_full));
  }
  if (!options.part.empty()) fit.part = RectangleOf(options.part);
  if (options.samples == "centre") fit.samples = DepthSamples::kCentre;
  if (options.samples == "corner") fit.samples = DepthSamples::kCorner;
  fit.min_confidence = options.min_confidence.value_or(0);
  return fit;
}

void ReadConfidenceInto(const DepthFitOptions& options, DepthMap* depth) {
  if (options.confidence_path.empty()) return;
  ReadDepthConfidence(options.confidence_path, options.confidence_full, depth);
}

}  // namespace thicklens::tools
