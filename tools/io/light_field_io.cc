#include "thicklens/io/light_field_io.h"

#include <fmt/format.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <filesystem>
#include <functional>
#include <map>
#include <opencv2/core/utility.hpp>
#include <opencv2/imgproc.hpp>
#include <sstream>
#include <system_error>
#include <utility>

#include "thicklens/base/cancel.h"
#include "thicklens/base/error.h"
#include "thicklens/base/input_file.h"
#include "thicklens/base/parallel.h"
#include "thicklens/base/printable_text.h"
#include "thicklens/base/stopwatch.h"
#include "thicklens/io/image_file.h"
#include "thicklens/io/image_io.h"
#include "thicklens/model/camera_file.h"
#include "thicklens/model/light_field_file.h"
#include "tools/io/confidence_file_name.h"
#include "tools/io/float_tiff.h"
#include "tools/io/hci_views.h"
#include "tools/io/image_file_kind.h"
#include "tools/io/image_metadata.h"

namespace thicklens::io {

const char kLightFieldMarker[] = "lightfield.yaml";
const char kHciMarker[] = "parameters.cfg";

namespace {

namespace fs = std::filesystem;

constexpr char kCameraFile[] = "camera.yaml";
constexpr char kViewsFolder[] = "views";
constexpr char kHciStem[] = "input_Cam";
constexpr int kMaxHciNumber = 999999;
constexpr char kHciSignature[] = "# Written by thicklens.\n";

// Returns the value of --threads, which RunCommand has passed to OpenCV.
int Threads() { return std::max(1, cv::getNumThreads()); }

// A light field without its values, and how to read them.
struct ViewSource {
  std::string folder;
  model::LightField frame;
  // Reads the view (k, l) of the frame in linear light; called from several threads.
  std::function<model::LinearImage(int k, int l)> read;
};

std::string NameOf(ViewFormat format) { return format == ViewFormat::kPng ? "png" : "tiff"; }

// Puts "view (3, 0): " in front of a message about that view.
Error ViewError(int k, int l, const std::string& what) {
  return Error(fmt::format("view ({}, {}): {}", k, l, what));
}

model::LinearImage ReadPngView(const std::string& path, const model::TransferCurve& transfer) {
  return model::ToLinear(WithoutAlpha(ToEncodedImage(ReadImageFile(path))), transfer);
}

model::LinearImage ReadTiffView(const std::string& path) {
  const std::string bytes = ReadWholeFile(path);
  if (KindOfImage(bytes) != ImageFileKind::kTiff) {
    throw Error(fmt::format("{}: cannot be decoded as a TIFF file ({} bytes)", path, bytes.size()));
  }
  const cv::Mat image = DecodeImageFile(bytes, path).pixels;
  if (image.type() != CV_32FC1 && image.type() != CV_32FC3) {
    throw Error(fmt::format(
        "{}: float values in 1 or 3 channels are expected, found {} channel(s) of {} bits{}", path,
        image.channels(), 8 * image.elemSize1(), image.depth() >= CV_32F ? ", float" : ""));
  }
  model::LinearImage light{image.cols, image.rows, image.channels(), {}};
  light.values.reserve(image.total() * static_cast<std::size_t>(image.channels()));
  for (int y = 0; y < image.rows; ++y) {
    ThrowIfCancelled();
    const auto* row = image.ptr<float>(y);
    light.values.insert(light.values.end(), row,
                        row + static_cast<std::ptrdiff_t>(image.cols) * image.channels());
  }
  return light;
}

std::string Listed(const std::vector<std::string>& names) {
  constexpr std::size_t kShown = 5;
  const std::vector<std::string> shown(
      names.begin(), names.begin() + static_cast<std::ptrdiff_t>(std::min(kShown, names.size())));
  const std::string more =
      names.size() > kShown ? fmt::format(" and {} more", names.size() - kShown) : "";
  return fmt::format("{}{}", fmt::join(shown, ", "), more);
}

Error MissingViews(const std::string& folder, const std::vector<std::string>& names) {
  return Error(
      fmt::format("{}: missing: {}; the option sparse accepts a light field with views missing",
                  folder, Listed(names)));
}

// ---- The layout of thicklens.

std::string ViewFile(int k, int l, const std::string& format) {
  return fmt::format("{}/{}.{}", kViewsFolder, model::ViewFileStem(k, l), format);
}

// Includes the views that were not requested: the light field as a whole is the input.
void ReportFilesOf(const std::string& folder, const model::LightFieldDescription& description) {
  const model::LightField& frame = description.light_field;
  for (int l = 0; l < frame.v_count; ++l) {
    for (int k = 0; k < frame.u_count; ++k) {
      if (!frame.IsPresent(k, l)) continue;
      ReportInput((fs::path(folder) / ViewFile(k, l, description.view_format)).string());
      if (!description.has_confidence) continue;
      ReportInput((fs::path(folder) / ConfidenceFileName(k, l)).string());
    }
  }
}

// All views have the profile of the photograph, or none.
std::string ProfileOfViews(const std::string& folder, const model::LightField& frame) {
  for (int l = 0; l < frame.v_count; ++l) {
    for (int k = 0; k < frame.u_count; ++k) {
      if (!frame.IsPresent(k, l)) continue;
      try {
        return ColourProfileOf(ReadWholeFile((fs::path(folder) / ViewFile(k, l, "png")).string()));
      } catch (const Interrupted&) {
        throw;
      } catch (const Error&) {
        return "";  // whoever reads the view says why it cannot be read
      }
    }
  }
  return "";
}

ViewSource OpenOwn(const std::string& folder, bool sparse) {
  const std::string description_path = (fs::path(folder) / kLightFieldMarker).string();
  const model::LightFieldDescription description =
      model::ReadLightFieldDescription(description_path);
  ViewSource source;
  source.folder = folder;
  source.frame = description.light_field;
  model::LightField& frame = source.frame;
  if (!description.camera_file.empty()) {
    const std::string camera = (fs::path(folder) / description.camera_file).string();
    frame.camera = model::ReadCamera(camera);
    const model::Sensor& sensor = frame.camera->sensor;
    if (sensor.width_px != frame.s_count || sensor.height_px != frame.t_count) {
      throw Error(fmt::format(
          "{}: its sensor has {}x{} px, the views of {} have {}x{}: the sizes must be equal",
          camera, sensor.width_px, sensor.height_px, description_path, frame.s_count,
          frame.t_count));
    }
  }
  std::vector<std::string> missing;
  for (int l = 0; l < frame.v_count; ++l) {
    for (int k = 0; k < frame.u_count; ++k) {
      if (!frame.IsPresent(k, l)) missing.push_back(fmt::format("view ({}, {})", k, l));
    }
  }
  if (!missing.empty() && !sparse) throw MissingViews(folder, missing);
  ReportFilesOf(folder, description);

  const bool is_png = description.view_format == "png";
  if (is_png) frame.colour_profile = ProfileOfViews(folder, frame);
  source.read = [folder, is_png, format = description.view_format, transfer = frame.transfer](
                    int k, int l) {
    const std::string path = (fs::path(folder) / ViewFile(k, l, format)).string();
    return is_png ? ReadPngView(path, transfer) : ReadTiffView(path);
  };
  return source;
}

// ---- The HCI layout.

std::string HciFile(int number) { return fmt::format("{}{:03}.png", kHciStem, number); }

}  // namespace

std::vector<int> HciNumbers(const std::string& folder) {
  std::vector<int> numbers;
  std::error_code failure;
  for (const auto& entry : fs::directory_iterator(folder, failure)) {
    const std::string name = entry.path().filename().string();
    if (name.rfind(kHciStem, 0) != 0) continue;
    const int number = std::atoi(name.c_str() + sizeof kHciStem - 1);
    if (number >= 0 && number <= kMaxHciNumber && name == HciFile(number))
      numbers.push_back(number);
  }
  if (failure) throw Error(fmt::format("{}: cannot be read: {}", folder, failure.message()));
  std::sort(numbers.begin(), numbers.end());
  return numbers;
}

namespace {

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

int InferredRowLength(const std::string& folder, const std::vector<int>& numbers) {
  if (const int length = HciRowLength(folder)) return length;
  const auto count = static_cast<int>(numbers.size());
  const auto edge = static_cast<int>(std::lround(std::sqrt(count)));
  if (edge * edge == count && numbers.back() == count - 1) return edge;
  throw Error(
      fmt::format("{}: {} views from {} to {} do not form a full square, and there is no {}: "
                  "the option grid must state how many views the numbering counts per row",
                  folder, count, HciFile(numbers.front()), HciFile(numbers.back()), kHciMarker));
}

ViewSource OpenHci(const std::string& folder, int grid, bool sparse) {
  const std::vector<int> numbers = HciNumbers(folder);
  if (numbers.empty()) {
    throw Error(fmt::format("{}: not a light field: neither {} nor {}, {}, ... are in it", folder,
                            kLightFieldMarker, HciFile(0), HciFile(1)));
  }
  for (const int number : numbers) ReportInput((fs::path(folder) / HciFile(number)).string());
  const int row = grid > 0 ? grid : InferredRowLength(folder, numbers);
  int first_u = row, last_u = 0;
  for (const int number : numbers) {
    first_u = std::min(first_u, number % row);
    last_u = std::max(last_u, number % row);
  }
  const int first_v = numbers.front() / row;
  const int last_v = numbers.back() / row;

  ViewSource source;
  source.folder = folder;
  model::LightField& frame = source.frame;
  frame.u_count = last_u - first_u + 1;
  frame.v_count = last_v - first_v + 1;
  const auto number_of = [row, first_u, first_v](int k, int l) {
    return (first_v + l) * row + first_u + k;
  };
  frame.weights = Eigen::ArrayXXd::Zero(frame.v_count, frame.u_count);
  std::vector<std::string> missing;
  for (int l = 0; l < frame.v_count; ++l) {
    for (int k = 0; k < frame.u_count; ++k) {
      const bool there = std::binary_search(numbers.begin(), numbers.end(), number_of(k, l));
      frame.present.push_back(there);
      if (there) frame.weights(l, k) = 1.0 / static_cast<double>(numbers.size());
      if (!there) missing.push_back(HciFile(number_of(k, l)));
    }
  }
  if (missing.empty()) frame.present.clear();
  if (!missing.empty() && !sparse) throw MissingViews(folder, missing);
  frame.origin.method = "imported";
  source.read = [folder, number_of](int k, int l) {
    return ReadPngView((fs::path(folder) / HciFile(number_of(k, l))).string(),
                       model::TransferCurve::Srgb());
  };
  return source;
}

// ---- Both layouts.

// Reads views of a frame whose view (0, 0) is the view (first_k, first_l) of the files.
class ViewReader {
 public:
  ViewReader(const ViewSource& source, int first_k, int first_l)
      : source_(source), first_k_(first_k), first_l_(first_l) {}

  model::LinearImage Read(int k, int l) const {
    ThrowIfCancelled();
    try {
      return source_.read(first_k_ + k, first_l_ + l);
    } catch (const Interrupted&) {
      throw;
    } catch (const Error& error) {
      throw ViewError(first_k_ + k, first_l_ + l, error.what());
    }
  }

  // Reads a view likewise, and requires the size and channels of the frame.
  model::LinearImage ReadLike(const model::LightField& frame, int k, int l) const {
    model::LinearImage image = Read(k, l);
    RequireLike(frame, k, l, image);
    return image;
  }

  // Throws Error unless the view has the size and channels of the frame.
  void RequireLike(const model::LightField& frame, int k, int l,
                   const model::LinearImage& image) const {
    if (image.width_px == frame.s_count && image.height_px == frame.t_count &&
        image.channels == frame.channels) {
      return;
    }
    throw Error(fmt::format(
        "{}: view ({}, {}) has {}x{} px in {} channel(s), the light field {}x{} in {}: they must "
        "be equal",
        source_.folder, first_k_ + k, first_l_ + l, image.width_px, image.height_px, image.channels,
        frame.s_count, frame.t_count, frame.channels));
  }

 private:
  const ViewSource& source_;
  int first_k_, first_l_;
};

std::pair<int, int> FirstPresent(const model::LightField& frame) {
  for (int l = 0; l < frame.v_count; ++l) {
    for (int k = 0; k < frame.u_count; ++k) {
      if (frame.IsPresent(k, l)) return {k, l};
    }
  }
  return {0, 0};
}

// Puts the folder's name in front of a message about a request that the light field does not fit.
template <typename Work>
auto NamingTheFolder(const std::string& folder, const Work& work) {
  try {
    return work();
  } catch (const Interrupted&) {
    throw;
  } catch (const Error& error) {
    throw Error(fmt::format("{}: {}", folder, error.what()));
  }
}

// Throws Error unless image files can store such views.
void RequireStorable(int channels) {
  if (channels != 1 && channels != 3) {
    throw Error(fmt::format(
        "light field: channels is {}: image files of views have 1 (grey) or 3 (RGB)", channels));
  }
}

void RequireValid(const model::LightField& light_field) {
  std::string why;
  if (!light_field.IsValid(&why)) throw Error("light field: " + why);
  RequireStorable(light_field.channels);
}

// Calls write(k, l, image) for every view that is present, on several threads.
void ForEachView(const model::LightField& light_field,
                 const std::function<void(int, int, const model::LinearImage&)>& write) {
  ParallelFor(light_field.u_count * light_field.v_count, Threads(), [&](int i) {
    ThrowIfCancelled();
    const int k = i % light_field.u_count;
    const int l = i / light_field.u_count;
    if (light_field.IsPresent(k, l)) write(k, l, model::ViewImage(light_field, k, l));
  });
}

// Writes the parameters that the benchmark's tools use, as far as they are known. Their cameras are
// pinholes, for which d = baseline_mm focal_length_mm (1/z - 1/zf)
// image_resolution_px/sensor_size_mm. The focal length is K = f1 zf/(zf - f1), the scale of chief
// rays, and the baseline is the step between views on the aperture, so that this is d(z) = da K
// (1/z - 1/zf)/p. Derived here [D22].
std::string HciParameters(const model::LightField& light_field) {
  const double larger_side_px = std::max(light_field.s_count, light_field.t_count);
  std::string intrinsics, extrinsics;
  if (light_field.camera) {
    const model::Camera& camera = *light_field.camera;
    const double pitch_mm = camera.sensor.pixel_pitch_mm;
    intrinsics += fmt::format("focal_length_mm = {}\n", camera.focal_scale_px() * pitch_mm);
    intrinsics += fmt::format("sensor_size_mm = {}\n", larger_side_px * pitch_mm);
    const model::LightFieldGrid& grid = *light_field.grid;
    const Eigen::Vector2d step_mm = model::ApertureStepsMm(grid, camera);
    const double baseline_mm = std::abs(step_mm.x() != 0 ? step_mm.x() : step_mm.y());
    if (baseline_mm > 0) extrinsics += fmt::format("baseline_mm = {}\n", baseline_mm);
    const double focus_depth_m = camera.focus_depth_mm() / 1000;
    if (std::isfinite(focus_depth_m))
      extrinsics += fmt::format("focus_distance_m = {}\n", focus_depth_m);
  }
  return kHciSignature +
         fmt::format(
             "[intrinsics]\nimage_resolution_x_px = {}\nimage_resolution_y_px = {}\n{}\n"
             "[extrinsics]\nnum_cams_x = {}\nnum_cams_y = {}\n{}",
             light_field.s_count, light_field.t_count, intrinsics, light_field.u_count,
             light_field.v_count, extrinsics);
}

}  // namespace

model::LightField ReadLightField(const std::string& folder, const LightFieldReading& reading) {
  std::error_code ignored;
  if (!fs::is_directory(folder, ignored)) {
    throw Error(fmt::format("{}: {}; the folder of a light field is expected", folder,
                            fs::exists(folder, ignored) ? "is a file" : "does not exist"));
  }
  const ViewSource source = fs::exists(fs::path(folder) / kLightFieldMarker, ignored)
                                ? OpenOwn(folder, reading.sparse)
                                : OpenHci(folder, reading.grid, reading.sparse);
  model::LightField frame = source.frame;
  if (reading.u_count > 0) {
    frame = NamingTheFolder(
        folder, [&] { return model::InnerViews(frame, reading.u_count, reading.v_count); });
  }
  const ViewReader reader(source, (source.frame.u_count - frame.u_count) / 2,
                          (source.frame.v_count - frame.v_count) / 2);
  const std::pair<int, int> first_place = FirstPresent(frame);
  model::LinearImage first = reader.Read(first_place.first, first_place.second);
  if (frame.s_count == 0) {  // the size is known only from the views themselves
    frame.s_count = first.width_px;
    frame.t_count = first.height_px;
    frame.channels = first.channels;
  }
  model::LightField light_field =
      reading.crop ? NamingTheFolder(folder, [&] { return CropViews(frame, *reading.crop); })
                   : frame;
  // Memory is allocated only after a view was found to have the stated size: a wrong size could
  // exhaust the memory.
  reader.RequireLike(frame, first_place.first, first_place.second, first);
  light_field.values.assign(light_field.ViewStart(light_field.channels, 0, 0), 0.0F);
  // Several threads cannot set bits of one std::vector<bool>.
  const std::vector<bool> present = std::exchange(light_field.present, {});
  ParallelFor(frame.u_count * frame.v_count, Threads(), [&](int i) {
    const int k = i % frame.u_count;
    const int l = i / frame.u_count;
    if (!frame.IsPresent(k, l)) return;
    const bool is_first = std::pair(k, l) == first_place;
    model::LinearImage view = is_first ? std::move(first) : reader.ReadLike(frame, k, l);
    if (reading.crop) view = model::CropImage(view, *reading.crop);
    model::SetView(&light_field, k, l, view);
  });
  light_field.present = present;
  std::string why;
  if (!light_field.IsValid(&why)) throw Error(fmt::format("{}: {}", folder, why));
  light_field.source = folder;
  return light_field;
}

std::vector<std::string> LightFieldEntries() {
  std::vector<std::string> entries = {kLightFieldMarker, kCameraFile};
  for (const char* v : {"[0-9][0-9]", "[0-9][0-9][0-9]"}) {
    for (const char* u : {"[0-9][0-9]", "[0-9][0-9][0-9]"}) {
      for (const char* format : {"png", "tiff"})
        entries.push_back(fmt::format("{}/view_{}_{}.{}", kViewsFolder, v, u, format));
      entries.push_back(fmt::format("{}/view_{}_{}.png", kConfidenceFolder, v, u));
    }
  }
  return entries;
}

LightFieldWriter::LightFieldWriter(const model::TransferCurve& transfer, ViewFormat format,
                                   OutputFolder* folder, std::string icc_profile)
    : transfer_(transfer), icc_profile_(std::move(icc_profile)), format_(format), folder_(folder) {
  constexpr int kBits = 16;
  if (format_ == ViewFormat::kPng) levels_.emplace(transfer, kBits);
}

double LightFieldWriter::BytesForView(double values) const {
  constexpr double kPngBytes = 10;  // encoded values, their rows, and the growing file
  return format_ == ViewFormat::kTiff ? 0 : values * kPngBytes;
}

void LightFieldWriter::WriteView(int k, int l, const model::LinearImage& view) {
  RequireStorable(view.channels);
  const auto start = Clock::now();
  const std::string name = ViewFile(k, l, NameOf(format_));
  std::size_t clipped = 0;
  if (format_ == ViewFormat::kTiff) {
    folder_->WriteWith(name, [&view](const std::string& path, const std::string& shown) {
      WriteFloatTiff(view, path, shown);
    });
  } else {
    folder_->Write(name, EncodePng(model::ToEncoded(view, *levels_), icc_profile_));
    clipped = CountClipped(view, transfer_, levels_->bits());
  }
  const std::lock_guard<std::mutex> lock(mutex_);
  clipped_ += clipped;
  seconds_ += SecondsSince(start);
}

void LightFieldWriter::WriteConfidence(int k, int l, const std::vector<std::uint8_t>& confidence,
                                       int width_px) {
  const auto start = Clock::now();
  folder_->Write(ConfidenceFileName(k, l), EncodeBytesPng(confidence, width_px));
  std::array<std::size_t, 256> counts{};
  for (const std::uint8_t value : confidence) ++counts[value];
  const std::lock_guard<std::mutex> lock(mutex_);
  has_confidence_ = true;
  for (std::size_t i = 0; i < counts.size(); ++i) confidence_counts_[i] += counts[i];
  seconds_ += SecondsSince(start);
}

std::size_t LightFieldWriter::Finish(const model::LightField& light_field) {
  model::LightFieldDescription description;
  description.view_format = NameOf(format_);
  description.has_confidence = has_confidence_;
  if (light_field.camera) {
    description.camera_file = kCameraFile;
    folder_->Write(kCameraFile, model::CameraToYaml(*light_field.camera));
  }
  description.light_field = model::DescriptionOf(light_field);
  folder_->Write(kLightFieldMarker, model::LightFieldDescriptionToYaml(description));
  return clipped_;
}

void WriteViews(const model::LightField& light_field, LightFieldWriter* writer) {
  RequireValid(light_field);
  ForEachView(light_field,
              [&](int k, int l, const model::LinearImage& view) { writer->WriteView(k, l, view); });
}

std::size_t WriteLightField(const model::LightField& light_field, ViewFormat format,
                            OutputFolder* folder) {
  LightFieldWriter writer(light_field.transfer, format, folder, light_field.colour_profile);
  WriteViews(light_field, &writer);
  return writer.Finish(light_field);
}

OutputFolder ClaimHciFolder(const std::string& path) {
  const fs::path parameters = fs::path(path) / kHciMarker;
  std::error_code ignored;
  if (fs::exists(parameters, ignored) &&
      ReadOwnFile(parameters.string(), kMaxTextBytes).rfind(kHciSignature, 0) != 0) {
    throw Error(
        fmt::format("{}: this folder holds a light field that thicklens did not write and is not "
                    "replaced; choose another name",
                    path));
  }
  constexpr int kMaxViews = 10000;
  std::vector<std::string> entries = {kHciMarker};
  for (int i = 0; i < kMaxViews; ++i) entries.push_back(HciFile(i));
  return OutputFolder(path, kHciMarker, entries);
}

std::size_t WriteHciLightField(const model::LightField& light_field, OutputFolder* folder) {
  RequireValid(light_field);
  constexpr int kBits = 8;
  const model::TransferCurve srgb = model::TransferCurve::Srgb();
  const model::QuantisedLevels levels(srgb, kBits);
  std::atomic<std::size_t> clipped{0};
  ForEachView(light_field, [&](int k, int l, const model::LinearImage& view) {
    folder->Write(HciFile(l * light_field.u_count + k), EncodePng(model::ToEncoded(view, levels)));
    clipped += CountClipped(view, srgb, kBits);
  });
  folder->Write(kHciMarker, HciParameters(light_field));
  return clipped;
}

std::size_t CountClipped(const model::LinearImage& image, const model::TransferCurve& transfer,
                         int bits) {
  const double half_level = 0.5 / (bits == 8 ? 255.0 : 65535.0);
  const auto least = static_cast<float>(transfer.Decode(-half_level));
  const auto most = static_cast<float>(transfer.Decode(1 + half_level));
  return static_cast<std::size_t>(
      std::count_if(image.values.begin(), image.values.end(),
                    [=](float light) { return !(light >= least && light <= most); }));
}

}  // namespace thicklens::io
