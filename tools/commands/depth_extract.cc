// thicklens depth extract: writes the depth map inside a photograph as a file of its own.
#include <fmt/format.h>
#include <fmt/ranges.h>
#include <spdlog/spdlog.h>

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <opencv2/core/mat.hpp>
#include <string>
#include <utility>
#include <vector>

#include "thicklens/base/cancel.h"
#include "thicklens/base/error.h"
#include "thicklens/base/output_file.h"
#include "thicklens/base/printable_text.h"
#include "thicklens/image.h"
#include "thicklens/io/depth_io.h"
#include "thicklens/io/image_file.h"
#include "tools/commands/commands.h"
#include "tools/options/command_frame.h"
#include "tools/options/option_values.h"

namespace thicklens::tools {
namespace {

struct DepthExtractOptions {
  CommonOptions common;
  std::string photo_path, output;
  bool enlarges = false;
};

enum class DepthFileKind { kPfm, kPng };

// Throws UsageError.
DepthFileKind DepthFileKindOf(const std::string& path) {
  const auto ends_in = [&path](const std::string& ending) {
    return path.size() > ending.size() &&
           path.compare(path.size() - ending.size(), std::string::npos, ending) == 0;
  };
  if (ends_in(".pfm")) return DepthFileKind::kPfm;
  if (ends_in(".png")) return DepthFileKind::kPng;
  throw UsageError(fmt::format("--output {}: a name that ends in .pfm or .png is expected", path));
}

// The bytes of the file, and how its numbers are stated to `estimate`.
struct ExtractedDepth {
  std::string bytes;
  std::string values;  // "32-bit floats, mm"
  std::vector<std::string> options;
};

std::string NameOfKind(model::DepthKind kind) {
  return kind == model::DepthKind::kRange     ? "range"
         : kind == model::DepthKind::kInverse ? "inverse"
                                              : "z";
}

ExtractedDepth AsPfm(const io::EmbeddedDepth& depth) {
  ExtractedDepth file;
  file.bytes = io::EncodePfm(io::DepthsOf(depth));
  const bool is_inverse = depth.kind == model::DepthKind::kInverse;
  file.values = fmt::format("32-bit floats, {}", is_inverse ? "dioptres (1/m)" : "mm");
  file.options = {"--depth-kind", NameOfKind(depth.kind)};
  if (!is_inverse) file.options.insert(file.options.end(), {"--depth-unit", "mm"});
  return file;
}

// Rounds numbers to those that a PNG file of that type holds; holes become 0.
template <typename Number>
std::string PngOfNumbers(const io::EmbeddedDepth& depth, const std::vector<float>& numbers,
                         int type) {
  cv::Mat pixels(depth.map.height_px, depth.map.width_px, type);
  std::size_t at = 0;
  for (int y = 0; y < pixels.rows; ++y) {
    ThrowIfCancelled();
    for (int x = 0; x < pixels.cols; ++x, ++at) {
      const float number = numbers[at];
      pixels.at<Number>(y, x) =
          std::isfinite(number) ? static_cast<Number>(std::lround(number)) : 0;
    }
  }
  return io::EncodeImageFile(pixels, io::ImageFormat::kPng);
}

// Whole mm; 0 is a hole, and 65535 would look like one.
ExtractedDepth AsPngOfLengths(const io::EmbeddedDepth& depth, const std::string& path) {
  const model::RawDepthMap lengths = io::DepthsOf(depth);
  constexpr float kLeast = 0.5F, kMost = 65534.4F;
  for (const float length : lengths.values) {
    if (std::isnan(length) || (length >= kLeast && length <= kMost)) continue;
    throw Error(fmt::format(
        "{}: a depth of {:g} mm: a PNG file holds whole numbers of mm from 1 to 65534; .pfm is "
        "expected",
        path, length));
  }
  ExtractedDepth file;
  file.bytes = PngOfNumbers<std::uint16_t>(depth, lengths.values, CV_16UC1);
  file.values = "unsigned 16-bit integers, mm (rounded)";
  file.options = {"--depth-kind", NameOfKind(depth.kind), "--depth-unit", "mm"};
  return file;
}

// The stored numbers; those of an enlarged map, which lie between them, spread over 16 bits.
ExtractedDepth AsPngOfInverse(const io::EmbeddedDepth& depth, bool is_enlarged,
                              const std::string& path) {
  constexpr double kByte = 255, kFull = 65535;
  const double largest = depth.map.largest_of_type.value_or(1);
  const bool is_stored = !is_enlarged && (largest == kByte || largest == kFull);
  const double factor = is_stored ? 1 : kFull / largest;
  std::vector<float> numbers = depth.map.values;
  bool has_hole = false, has_zero = false;
  for (float& number : numbers) {
    if (std::isnan(number)) {
      has_hole = true;
      continue;
    }
    number = static_cast<float>(factor * static_cast<double>(number));
    has_zero = has_zero || std::lround(number) == 0;
  }
  if (has_hole && has_zero) {
    throw Error(fmt::format(
        "{}: the map has holes and the number 0, which a PNG file cannot distinguish; .pfm is "
        "expected",
        path));
  }
  ExtractedDepth file;
  const bool is_byte = is_stored && largest == kByte;
  file.bytes = is_byte ? PngOfNumbers<std::uint8_t>(depth, numbers, CV_8UC1)
                       : PngOfNumbers<std::uint16_t>(depth, numbers, CV_16UC1);
  file.values = fmt::format("unsigned {}-bit integers{}", is_byte ? 8 : 16,
                            is_stored ? " as they are stored" : "");
  file.options = {"--depth-kind",     "inverse",
                  "--inverse-scale",  fmt::format("{:.9g}", depth.scale / factor),
                  "--inverse-offset", fmt::format("{:.9g}", depth.offset)};
  if (has_zero) file.options.insert(file.options.end(), {"--zero-is", "value"});
  return file;
}

io::EmbeddedDepth DepthInside(const DepthExtractOptions& options) {
  io::EmbeddedDepthSearch found = io::ReadEmbeddedDepthFile(options.photo_path);
  if (!found.depth) {
    throw Error(fmt::format(
        "{}: it holds no depth map (looked for: {}{})", options.photo_path,
        io::EmbeddedDepthForms(),
        found.others.empty() ? "" : fmt::format("; found: {}", fmt::join(found.others, "; "))));
  }
  if (!options.enlarges) return std::move(*found.depth);
  const Image photo = ReadImage(options.photo_path);
  return io::Enlarged(*found.depth, photo.width_px(), photo.height_px(), options.photo_path);
}

CommandResult ExtractDepth(const DepthExtractOptions& options, DepthFileKind kind) {
  OutputFile output(options.output);
  io::EmbeddedDepth depth = DepthInside(options);
  if (!depth.has_unit) {
    depth.warnings.emplace_back(
        "The file states no unit of length: the depths are written as if it were metres, and the "
        "true ones are an unknown multiple of them.");
  }
  for (const std::string& note : depth.notes)
    spdlog::info("{}: {}", PrintableUtf8(options.photo_path), PrintableUtf8(note));
  for (const std::string& warning : depth.warnings)
    spdlog::warn("{}: {}", PrintableUtf8(options.photo_path), PrintableUtf8(warning));
  ThrowIfCancelled();
  const ExtractedDepth file = kind == DepthFileKind::kPfm ? AsPfm(depth)
                              : depth.kind == model::DepthKind::kInverse
                                  ? AsPngOfInverse(depth, options.enlarges, options.output)
                                  : AsPngOfLengths(depth, options.output);
  ThrowIfCancelled();
  output.Commit(file.bytes);
  CommandResult result;
  result.is_written = true;
  const std::string meaning = fmt::format("{}", fmt::join(file.options, " "));
  result.summary = {{"status", "ok"},
                    {"reason", ""},
                    {"photo", options.photo_path},
                    {"output", options.output},
                    {"line", PrintableUtf8(depth.description)},
                    {"form", depth.form},
                    {"size", {depth.map.width_px, depth.map.height_px}},
                    {"kind", NameOfKind(depth.kind)},
                    {"has_unit", depth.has_unit},
                    {"values", file.values},
                    {"options", file.options},
                    {"warnings", nlohmann::json::array()}};
  for (const std::string& warning : depth.warnings)
    result.summary["warnings"].push_back(PrintableUtf8(warning));
  PrintResult(options.common,
              fmt::format("inside       {}\nwritten      {} x {} px, {}\nmeaning      {}{}\n{}",
                          PrintableUtf8(depth.description), depth.map.width_px, depth.map.height_px,
                          file.values, meaning,
                          options.enlarges ? "" : "; --enlarge writes the photograph's size",
                          WrittenText({options.output})));
  return result;
}

}  // namespace

void AddDepthCommand(CLI::App* program, CommandAction* action) {
  CLI::App* depth = program->add_subcommand("depth", "Depth maps inside photographs");
  depth->require_subcommand(1);
  CLI::App* command = depth->add_subcommand(
      "extract",
      "Write the depth map inside a photograph, as phones store it, as a file of its own");
  const auto options = std::make_shared<DepthExtractOptions>();
  command
      ->add_option("photo", options->photo_path, "The photograph (JPEG, HEIC, PNG, WebP or TIFF)")
      ->required()
      ->type_name("PHOTO");
  command
      ->add_option(
          "-o,--output", options->output,
          "File to write: .pfm (mm, or dioptres of an inverse depth) or .png (whole mm, or "
          "the stored numbers of an inverse depth)")
      ->required()
      ->type_name("FILE");
  command->add_flag(
      "--enlarge", options->enlarges,
      "Write the map in the photograph's size, which estimate needs; its edges stay as "
      "coarse as the stored map");
  AddCommonOptions(command, &options->common);
  command->callback([options, action] {
    *action = [options] {
      const DepthFileKind kind = DepthFileKindOf(options->output);
      RequireDistinctFiles({options->output, options->common.json_path}, {options->photo_path});
      RunCommand(options->common, [&] { return ExtractDepth(*options, kind); });
    };
  });
}

}  // namespace thicklens::tools
