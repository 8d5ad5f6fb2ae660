// Files of arrays: .mat files of Matlab's Light Field Toolbox (Dansereau), whose variable LF is
// LF(t, s, v, u, c) with the row t and the column s of the view, and the row v and the column u of
// the pixel (LFUtilDecodeLytroFolder.m), and HDF5 files of the first Heidelberg data set (Wanner,
// 2013), whose data set LF has the shape (v, u, y, x, c) and attributes for it (h5read order).
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <limits>
#include <memory>
#include <opencv2/core.hpp>

#include "thicklens/base/cancel.h"
#include "thicklens/base/error.h"
#include "thicklens/base/printable_text.h"
#include "tools/io/array_file.h"
#include "tools/io/lightfields/image_tiles.h"
#include "tools/io/lightfields/layout.h"
#include "tools/io/lightfields/view_grid.h"
#include "tools/io/lightfields/view_pixels.h"

namespace thicklens::io {
namespace {

constexpr char kLf[] = "LF";
constexpr std::uint64_t kMaxViewsAlong = 1000;
constexpr std::uint64_t kMaxPx = 65535;

// The axes of an array: how many elements there are along each, and how far apart they are.
struct ArrayAxis {
  std::size_t count = 1, stride = 0;
};
struct ViewArray {
  ArrayAxis row, column, y, x, channel;  // row and column of the view, then of the pixel
  int colours = 1, weights = 0;          // channels of each kind
  StoredNumber number = StoredNumber::kOther;
  std::vector<unsigned char> bytes;
};

// "3 x 3 x 8 x 10 x 4", in the order of the program that wrote it.
std::string SizeInWords(const StoredArray& array, ArrayFormat format) {
  std::vector<std::uint64_t> size = array.size;
  if (format == ArrayFormat::kHdf5) std::reverse(size.begin(), size.end());
  return size.empty() ? "one" : fmt::format("{}", fmt::join(size, " x "));
}

std::string ContentInWords(const StoredFile& content, ArrayFormat format) {
  std::vector<std::string> names;
  for (const StoredArray& array : content.arrays)
    names.push_back(fmt::format("{} ({}, {})", array.name, SizeInWords(array, format), array.type));
  return names.empty() ? "nothing is in it" : "found " + Listed(names);
}

bool MayBeViews(const StoredArray& array) {
  return array.number != StoredNumber::kOther && (array.size.size() == 4 || array.size.size() == 5);
}

// The axes of a light field.
const char* OrderInWords(ArrayFormat format) {
  return format == ArrayFormat::kMat ? "LF(t, s, v, u, c): row and column of the view, row and "
                                       "column of the pixel, colour"
                                     : "LF of the shape (v, u, y, x, c): row and column of the "
                                       "view, row and column of the pixel, colour";
}

// LF, or the only array that has as many axes as a light field. With stated numbers of views, one
// axis may be that of all views.
const StoredArray& LightFieldOf(const std::string& path, const StoredFile& content,
                                ArrayFormat format, bool are_counts_stated) {
  const char* const order = OrderInWords(format);
  for (const StoredArray& array : content.arrays) {
    if (array.name != kLf) continue;
    if (MayBeViews(array)) return array;
    throw Error(fmt::format(
        "{}: LF is {} ({}); unsigned integers of 8 or 16 bits or floats are expected as {}", path,
        SizeInWords(array, format), array.type, order));
  }
  for (const std::size_t axes : {std::size_t{5}, std::size_t{4}}) {
    if (axes == 4 && !are_counts_stated) break;
    std::vector<const StoredArray*> found;
    for (const StoredArray& array : content.arrays) {
      if (MayBeViews(array) && array.size.size() == axes) found.push_back(&array);
    }
    if (found.size() == 1) return *found.front();
    if (!found.empty()) break;
  }
  throw Error(fmt::format("{}: no light field is in it: an array {} is expected; {}", path, order,
                          ContentInWords(content, format)));
}

// Colour channels and then weights: 1 to 4, or 6 as the toolbox writes without resampling.
bool SetChannels(std::uint64_t channels, ViewArray* views) {
  switch (channels) {
    case 1:
    case 3:
      views->colours = static_cast<int>(channels);
      return true;
    case 2:
    case 4:
      views->colours = static_cast<int>(channels) - 1;
      views->weights = 1;
      return true;
    case 6:
      views->colours = views->weights = 3;
      return true;
    default:
      return false;
  }
}

// Views that are this narrow are colours: an array of four axes is then (n, y, x, c).
constexpr std::uint64_t kMaxColours = 4;

// Throws Error about an array of four axes whose last one is that of the colours.
[[noreturn]] void ThrowViewsInOneAxis(const std::string& path, const StoredArray& array,
                                      ArrayFormat format, std::uint64_t count) {
  const auto edge = static_cast<std::uint64_t>(std::llround(std::sqrt(static_cast<double>(count))));
  const bool is_square = edge * edge == count;
  throw Error(fmt::format(
      "{}: {} has four axes, {}, of which the last would be views {} px wide; if it is that of the "
      "colours and {} views count row by row along the first, the option layout states how many "
      "there are across and down: {}:{}",
      path, PrintableUtf8(array.name), SizeInWords(array, format),
      format == ArrayFormat::kHdf5 ? array.size.front() : array.size.back(), count,
      format == ArrayFormat::kMat ? "mat" : "hdf5",
      is_square ? fmt::format("{}x{}", edge, edge) : "UxV"));
}

// The views of an array; the options may state how many there are across and down.
ViewArray ArrayOf(const std::string& path, const StoredArray& array, ArrayFormat format,
                  AxisCounts stated) {
  std::vector<std::uint64_t> size = array.size;
  ViewArray views;
  views.number = array.number;
  std::array<ArrayAxis*, 5> axes = {&views.row, &views.column, &views.y, &views.x, &views.channel};
  const bool is_hdf = format == ArrayFormat::kHdf5;
  const bool has_four = size.size() == 4;
  const std::uint64_t first = is_hdf ? size.back() : size.front();
  const auto across = static_cast<std::uint64_t>(stated.across);
  const auto down = static_cast<std::uint64_t>(stated.down);
  const bool is_colour = (is_hdf ? size.front() : size.back()) <= kMaxColours;
  const bool is_split = has_four && across > 0 && first == across * down && is_colour;
  if (is_split) {
    // (n, y, x, c): the column counts fastest.
    (is_hdf ? size.back() : size.front()) = across;
    size.insert(is_hdf ? size.end() : size.begin() + 1, down);
    if (!is_hdf) std::swap(axes[0], axes[1]);
  } else if (has_four && is_colour) {
    ThrowViewsInOneAxis(path, array, format, first);
  } else if (has_four && is_hdf) {
    // Grey images have no last axis, which is the first here.
    size.insert(size.begin(), 1);
  }
  if (is_hdf) std::reverse(axes.begin(), axes.end());
  size.resize(axes.size(), 1);
  std::size_t stride = 1;
  for (std::size_t i = 0; i < axes.size(); ++i) {
    *axes[i] = {static_cast<std::size_t>(size[i]), stride};
    stride *= static_cast<std::size_t>(size[i]);
  }
  const bool has_views = views.row.count >= 1 && views.row.count <= kMaxViewsAlong &&
                         views.column.count >= 1 && views.column.count <= kMaxViewsAlong;
  const bool has_pixels = views.y.count >= 1 && views.y.count <= kMaxPx && views.x.count >= 1 &&
                          views.x.count <= kMaxPx;
  if (!has_views || !has_pixels || !SetChannels(views.channel.count, &views)) {
    throw Error(fmt::format(
        "{}: {} has {} x {} views of {} x {} px in {} channels ({}, {}); 1 to {} views along each "
        "axis, 1 to {} px and 1, 2, 3, 4 or 6 channels are expected: the axes may have another "
        "order",
        path, PrintableUtf8(array.name), views.column.count, views.row.count, views.x.count,
        views.y.count, views.channel.count, SizeInWords(array, format), array.type, kMaxViewsAlong,
        kMaxPx));
  }
  // Axes in another order make thousands of views of a few pixels.
  const bool is_swarm = views.row.count * views.column.count > views.y.count * views.x.count;
  if (is_swarm && across == 0) {
    throw Error(fmt::format(
        "{}: {} ({}) has {} x {} views of {} x {} px, fewer pixels than views: the axes may have "
        "another order; expected: {}. If it is right, the option layout states it: {}:{}x{}",
        path, PrintableUtf8(array.name), SizeInWords(array, format), views.column.count,
        views.row.count, views.x.count, views.y.count, OrderInWords(format),
        is_hdf ? "hdf5" : "mat", views.column.count, views.row.count));
  }
  if (across > 0 && (across != views.column.count || down != views.row.count)) {
    throw Error(fmt::format("{}: the option layout states {} x {} views, but {} ({}) has {} x {}",
                            path, across, down, PrintableUtf8(array.name),
                            SizeInWords(array, format), views.column.count, views.row.count));
  }
  return views;
}

template <typename Number>
void CopyView(const ViewArray& views, int k, int l, int first_channel, cv::Mat* view) {
  const auto* const bytes = views.bytes.data();
  const auto channels = static_cast<std::size_t>(view->channels());
  const std::size_t start = static_cast<std::size_t>(l) * views.row.stride +
                            static_cast<std::size_t>(k) * views.column.stride +
                            static_cast<std::size_t>(first_channel) * views.channel.stride;
  for (int y = 0; y < view->rows; ++y) {
    ThrowIfCancelled();
    auto* to = view->ptr<Number>(y);
    for (std::size_t x = 0; x < views.x.count; ++x) {
      for (std::size_t c = 0; c < channels; ++c) {
        const std::size_t at = start + static_cast<std::size_t>(y) * views.y.stride +
                               x * views.x.stride + c * views.channel.stride;
        std::memcpy(to++, bytes + at * sizeof(Number), sizeof(Number));
      }
    }
  }
}

// Some of the channels of the view (k, l).
cv::Mat ChannelsOf(const ViewArray& views, int k, int l, int first_channel, int count) {
  const int depth = views.number == StoredNumber::kUint8    ? CV_8U
                    : views.number == StoredNumber::kUint16 ? CV_16U
                    : views.number == StoredNumber::kFloat  ? CV_32F
                                                            : CV_64F;
  cv::Mat view(static_cast<int>(views.y.count), static_cast<int>(views.x.count),
               CV_MAKETYPE(depth, count));
  if (depth == CV_8U) {
    CopyView<std::uint8_t>(views, k, l, first_channel, &view);
  } else if (depth == CV_16U) {
    CopyView<std::uint16_t>(views, k, l, first_channel, &view);
  } else if (depth == CV_32F) {
    CopyView<float>(views, k, l, first_channel, &view);
  } else {
    CopyView<double>(views, k, l, first_channel, &view);
  }
  return view;
}

// Leaves out the views that have weights of 0 only, and reports such weights in the others.
void ExamineWeights(const std::string& path, const ViewArray& views, ViewSource* source) {
  if (views.weights == 0) return;
  model::LightField& frame = source->frame;
  std::vector<std::string> empty;
  std::vector<bool> present;
  std::size_t without = 0, all = 0;
  for (int l = 0; l < frame.v_count; ++l) {
    for (int k = 0; k < frame.u_count; ++k) {
      const cv::Mat weights = ChannelsOf(views, k, l, views.colours, views.weights).reshape(1);
      const int there = cv::countNonZero(weights);
      present.push_back(there > 0);
      if (there > 0) {
        without += weights.total() - static_cast<std::size_t>(there);
        all += weights.total();
      } else {
        frame.weights(l, k) = 0;
        empty.push_back(fmt::format("view ({}, {})", k, l));
      }
    }
  }
  if (all == 0) throw Error(fmt::format("{}: the weight of every pixel is 0", path));
  if (!empty.empty()) {
    frame.present = present;
    frame.weights /= frame.weights.sum();
    source->details.push_back(fmt::format("left out because their weight is 0: {}", Listed(empty)));
  }
  // The edges of a decoded lenslet image have such pixels.
  constexpr double kMany = 0.01;
  const double share = static_cast<double>(without) / static_cast<double>(all);
  if (share > kMany) {
    source->notices.push_back(fmt::format(
        "{}: {:.1f} % of the pixels of the other views have the weight 0 (no value) and are taken "
        "as stored; the options views and crop leave them out where they are at the edge",
        path, 100 * share));
  }
}

// Sets how the numbers stand for light. Integers without any statement are sRGB, as in images.
StatedTransfer TransferOf(const StoredFile& content, const ViewArray& views, ViewSource* source) {
  const bool is_float =
      views.number == StoredNumber::kFloat || views.number == StoredNumber::kDouble;
  const auto has_task = [&](const char* name) {
    return content.tasks &&
           std::find(content.tasks->begin(), content.tasks->end(), name) != content.tasks->end();
  };
  if (has_task("ColourCorrect")) {
    source->details.push_back("colour-corrected by the toolbox, so that it is taken as sRGB");
    return StatedTransfer::kSrgb;
  }
  if (content.tasks) {
    source->details.push_back("not colour-corrected by the toolbox, so that it is linear light");
    return StatedTransfer::kLinear;
  }
  source->details.push_back(is_float ? "floats are taken as linear light"
                                     : "integers are taken as sRGB");
  return is_float ? StatedTransfer::kLinear : StatedTransfer::kAbsent;
}

// Light of floats that are encoded as sRGB.
void DecodeSrgb(model::LinearImage* image) {
  const model::TransferCurve curve = model::TransferCurve::Srgb();
  for (float& value : image->values) {
    value = static_cast<float>(curve.Decode(std::clamp(static_cast<double>(value), 0.0, 1.0)));
  }
}

// Floats are expected from 0 to 1: others are often levels of integers that were converted.
void ExamineFloats(const std::string& path, const ViewArray& views, ViewSource* source) {
  if (BytesOf(views.number) < 4) return;
  const cv::Mat middle =
      ChannelsOf(views, source->frame.u_count / 2, source->frame.v_count / 2, 0, views.colours);
  double most = 0;
  cv::minMaxIdx(middle.reshape(1), nullptr, &most);
  constexpr double kWhite = 2;
  if (most > kWhite) {
    constexpr double kMinOfLevels = 16, kLevels = 255, kLevelsOf16Bits = 65535;
    const bool are_levels = most > kMinOfLevels && most <= kLevelsOf16Bits;
    source->notices.push_back(fmt::format(
        "{}: its floats go up to {:g}; light from 0 to 1 is expected: views are clipped there when "
        "they are written as integers{}",
        path, most,
        are_levels
            ? fmt::format("; if they are levels, divide them by {}, or store "
                          "them as integers of {} bits, which are read as sRGB",
                          most <= kLevels ? kLevels : kLevelsOf16Bits, most <= kLevels ? 8 : 16)
            : ""));
  }
}

// The statements of the attributes of the Heidelberg data set.
void ExamineAttributes(const std::string& path, const StoredFile& content, const ViewArray& views,
                       ViewSource* source) {
  const std::array<std::pair<const char*, std::size_t>, 5> sizes = {
      {{"vRes", views.row.count},
       {"hRes", views.column.count},
       {"yRes", views.y.count},
       {"xRes", views.x.count},
       {"channels", views.channel.count}}};
  std::vector<std::string> camera;
  for (const auto& [name, value] : content.numbers) {
    for (const auto& [expected, count] : sizes) {
      if (name != expected || value == static_cast<double>(count)) continue;
      source->notices.push_back(fmt::format(
          "{}: its attribute {} is {:g}, but LF has {}: the axes of LF may have another "
          "order than (v, u, y, x, c)",
          path, name, value, count));
    }
    for (const char* known : {"dH", "dV", "focalLength", "shift", "camDistance"}) {
      if (name == known) camera.push_back(fmt::format("{} {:g}", name, value));
    }
  }
  if (!camera.empty())
    source->details.push_back(fmt::format("not used: {}", fmt::join(camera, ", ")));
  for (const StoredArray& array : content.arrays) {
    if (array.name.rfind("GT_", 0) == 0)
      source->details.push_back(fmt::format("{} is in it and not read", PrintableUtf8(array.name)));
  }
}

std::optional<ViewSource> OpenArrays(const LayoutInput& input, ArrayFormat format) {
  const std::optional<ArrayFormat> found = FormatOfArrays(input.path);
  if (found != format) {
    if (!input.is_forced) return std::nullopt;
    throw Error(fmt::format("{}: is {}", input.path,
                            !found                        ? "neither a file of Matlab nor HDF5"
                            : *found == ArrayFormat::kMat ? "a file of Matlab (the layout mat)"
                                                          : "an HDF5 file (the layout hdf5)"));
  }
  ArrayFile file(input.path, format);
  const StoredFile& content = file.content();
  const StoredArray& array =
      LightFieldOf(input.path, content, format, input.is_forced && input.reading->layout_u > 0);
  const auto views = std::make_shared<ViewArray>(
      ArrayOf(input.path, array, format,
              input.is_forced ? AxisCounts{input.reading->layout_u, input.reading->layout_v}
                              : AxisCounts{}));
  views->bytes = file.Read(array);
  ViewSource source;
  source.kind =
      fmt::format("the {} {} of {} file", format == ArrayFormat::kMat ? "variable" : "data set",
                  PrintableUtf8(array.name), format == ArrayFormat::kMat ? "a MAT" : "an HDF5");
  source.frame =
      FullFrame(static_cast<int>(views->column.count), static_cast<int>(views->row.count));
  source.details.push_back(array.type);
  if (input.reading->grid > 0)
    source.details.push_back("the option grid is not used, because the array has rows and columns");
  ImageFacts facts;
  facts.sample_type = array.type;
  facts.transfer = TransferOf(content, *views, &source);
  ExamineWeights(input.path, *views, &source);
  ExamineFloats(input.path, *views, &source);
  if (format == ArrayFormat::kHdf5) {
    ExamineAttributes(input.path, content, *views, &source);
    source.mirrored = "the sets of 2013 count columns backwards: mirror-u";
  }
  source.read = [views, facts, path = input.path](int k, int l) {
    model::LinearImage light =
        LightOfPixels(ChannelsOf(*views, k, l, 0, views->colours), facts, path);
    if (BytesOf(views->number) >= 4 && facts.transfer == StatedTransfer::kSrgb) DecodeSrgb(&light);
    return light;
  };
  return source;
}

}  // namespace

bool IsFileOfArrays(const std::string& path) { return FormatOfArrays(path).has_value(); }

std::optional<ViewSource> OpenMatFile(const LayoutInput& input) {
  return OpenArrays(input, ArrayFormat::kMat);
}

std::optional<ViewSource> OpenHdf5File(const LayoutInput& input) {
  return OpenArrays(input, ArrayFormat::kHdf5);
}

}  // namespace thicklens::io
