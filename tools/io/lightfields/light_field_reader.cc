#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <filesystem>
#include <opencv2/core/utility.hpp>
#include <system_error>
#include <utility>

#include "thicklens/base/cancel.h"
#include "thicklens/base/error.h"
#include "thicklens/base/output_file.h"
#include "thicklens/base/parallel.h"
#include "thicklens/base/printable_text.h"
#include "thicklens/io/light_field_io.h"
#include "tools/io/array_file.h"
#include "tools/io/image_file_kind.h"
#include "tools/io/image_names.h"
#include "tools/io/lightfields/layout.h"
#include "tools/io/lightfields/view_grid.h"
#include "tools/io/lightfields/view_names.h"
#include "tools/io/lightfields/view_order.h"
#include "tools/io/lightfields/view_pixels.h"
#include "tools/io/view_files.h"

namespace thicklens::io {
namespace {

namespace fs = std::filesystem;

// All layouts, in the order in which they are tried.
constexpr std::array<ViewLayout, 10> kLayouts = {{
    {"thicklens", "lightfield.yaml", true, OpenOwnFolder},
    {"hci", "input_Cam000.png, input_Cam001.png, ...", true, OpenHciFolder},
    {"stanford", "out_00_00_Y_X_.png, ...", true, OpenStanfordFolder},
    {"names", "names in which a row and a column change", true, OpenNamedFolder},
    {"mat", "a MAT file with a variable LF", false, OpenMatFile},
    {"hdf5", "an HDF5 file with a data set LF", false, OpenHdf5File},
    {"quilt", "_qs8x6a0.75 in the name", false, OpenQuilt},
    {"parts", "an EXR file of several parts", false, OpenImageParts},
    {"lenslets", "eslf in the name", false, OpenLensletImage},
    {"tiles", "views side by side", false, OpenTiledImage},
}};

// Returns the value of --threads, which RunCommand has passed to OpenCV.
int ReadingThreads() { return std::max(1, cv::getNumThreads()); }

// Puts "view (3, 0): " in front of a message about that view.
Error ViewError(int k, int l, const std::string& what) {
  return Error(fmt::format("view ({}, {}): {}", k, l, what));
}

// Reads views of a frame whose view (0, 0) is the view (first_k, first_l) of the files.
class ViewReader {
 public:
  ViewReader(std::string path, const ViewSource& source, int first_k, int first_l)
      : path_(std::move(path)), source_(source), first_k_(first_k), first_l_(first_l) {}

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
        path_, first_k_ + k, first_l_ + l, image.width_px, image.height_px, image.channels,
        frame.s_count, frame.t_count, frame.channels));
  }

 private:
  std::string path_;
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

// ---- Which layout it is.

std::string NamesOfLayouts(bool is_of_folders) {
  std::vector<std::string> names;
  for (const ViewLayout& layout : kLayouts) {
    if (layout.is_of_folders == is_of_folders) names.push_back(layout.name);
  }
  return fmt::format("{}", fmt::join(names, ", "));
}

const ViewLayout& LayoutNamed(const std::string& name) {
  for (const ViewLayout& layout : kLayouts) {
    if (name == layout.name) return layout;
  }
  throw Error(fmt::format("the option layout: {} or {} is expected, found '{}'",
                          NamesOfLayouts(true), NamesOfLayouts(false), PrintableUtf8(name)));
}

// The contents of a folder that has no known layout, in words.
std::string ContentOfFolder(const std::string& folder) {
  const std::vector<std::string> names = ImageNames(folder);
  if (names.empty()) return "found no images";
  std::string content = fmt::format("found {} image(s): {}", names.size(), Listed(names));
  if (const auto proposal = ProposedPattern(names)) {
    content += fmt::format(
        "; {} of them differ in {} number(s), and the option name reads them: '{}'{}",
        proposal->names, proposal->changing, PrintableUtf8(proposal->pattern),
        proposal->changing == 1 ? " ({n} counts row by row; the option grid states the length of a "
                                  "row)"
                                : "");
    if (proposal->is_sign_unclear) {
      content += fmt::format(", or '{}' if the '-' is a minus sign",
                             PrintableUtf8(proposal->other_pattern));
    }
  } else {
    content += "; the option name states how views are named, e.g. 'view_{v}_{u}.jpg'";
  }
  return content;
}

[[noreturn]] void ThrowNoLayout(const std::string& path, bool is_folder) {
  if (is_folder) {
    throw Error(fmt::format("{}: not a light field: neither {} nor {} nor {} are in it; {}", path,
                            kLightFieldMarker, fmt::format("{}, {}, ...", HciFile(0), HciFile(1)),
                            LayoutNamed("stanford").marks, ContentOfFolder(path)));
  }
  throw Error(fmt::format(
      "{}: is a file; the folder of a light field is expected, or an image of many views: a quilt "
      "(its name states its tiles, e.g. _qs8x6a0.75), lenslets (eslf in the name, or the option "
      "layout: lenslets:14x14), or views side by side, which this image does not show (the option "
      "layout: tiles:9x9), or a MAT or HDF5 file with an array LF",
      path));
}

// Throws Error about a file that is often taken for a light field and is of a kind that is not
// read.
void RefuseOtherKinds(const std::string& path, const std::string& bytes) {
  struct OtherKind {
    std::size_t at;
    const char* mark;
    const char* what;
  };
  constexpr std::array<OtherKind, 6> kKinds = {{
      {0, "\x93NUMPY",
       "an array of NumPy; write it as a data set LF of an HDF5 file (h5py) or a variable LF of a "
       "MAT file (scipy.io.savemat)"},
      {0, "PK\x03\x04",
       "a ZIP archive (NPZ files of NumPy are such); extract its images, or write its array as a "
       "data set LF of an HDF5 file"},
      {0, "GIF8", "a GIF image of at most 256 colours; write its frames as PNG files"},
      {4, "ftyp", "a video; extract its frames as PNG files"},
      {0, "\x1A\x45\xDF\xA3", "a video; extract its frames as PNG files"},
      {0, "\x89LFP",
       "a raw file of a Lytro camera, whose lenslets must be decoded first, for example by the "
       "Light "
       "Field Toolbox for Matlab; its MAT files are read"},
  }};
  for (const OtherKind& kind : kKinds) {
    if (bytes.size() > kind.at &&
        bytes.compare(kind.at, std::string(kind.mark).size(), kind.mark) == 0)
      throw Error(fmt::format("{}: is no light field but {}", path, kind.what));
  }
}

// Opens a file or a folder by the first layout that it has, or by that of the options.
ViewSource OpenSource(const std::string& path, const LightFieldReading& reading) {
  std::error_code ignored;
  LayoutInput input;
  input.path = path;
  input.is_folder = fs::is_directory(path, ignored);
  input.reading = &reading;
  if (!input.is_folder && !fs::exists(path, ignored)) {
    throw Error(fmt::format("{}: does not exist; the folder of a light field is expected", path));
  }
  if (reading.layout_u < 0 || reading.layout_v < 0 ||
      (reading.layout_u > 0) != (reading.layout_v > 0)) {
    throw Error(
        fmt::format("the option layout: two numbers of at least 1 are expected, across and down, "
                    "found {} x {}",
                    reading.layout_u, reading.layout_v));
  }
  const ViewLayout* layout = reading.layout.empty() ? nullptr : &LayoutNamed(reading.layout);
  // A stated pattern of names is that of a folder, or of the parts of a file.
  if (layout == nullptr && !reading.name.empty())
    layout = &LayoutNamed(input.is_folder ? "names" : "parts");
  if (layout != nullptr) {
    if (layout->is_of_folders != input.is_folder) {
      const char* const kind = input.is_folder ? "folder" : "file";
      throw Error(
          fmt::format("{}: is a {}, but the layout {} is that of a {} (layouts of a {}: {})", path,
                      kind, layout->name, input.is_folder ? "file" : "folder", kind,
                      NamesOfLayouts(input.is_folder)));
    }
    input.is_forced = true;
    if (std::optional<ViewSource> source = layout->open(input)) return *std::move(source);
    ThrowNoLayout(path, input.is_folder);
  }
  if (!input.is_folder && !IsFileOfArrays(path)) {
    const std::string bytes = ReadWholeFile(path);
    if (!KindOfImage(bytes)) {
      RefuseOtherKinds(path, bytes);
      ThrowNoLayout(path, false);
    }
  }
  for (const ViewLayout& candidate : kLayouts) {
    if (candidate.is_of_folders != input.is_folder) continue;
    if (std::optional<ViewSource> source = candidate.open(input)) return *std::move(source);
  }
  ThrowNoLayout(path, input.is_folder);
}

// ---- The order of the views.

// Exchanges rows and columns, and then counts columns or rows backwards, as the options state.
void Reorder(const LightFieldReading& reading, ViewSource* source) {
  if (!reading.swap_uv && !reading.mirror_u && !reading.mirror_v) return;
  const model::LightField before = source->frame;
  model::LightField& frame = source->frame;
  if (reading.swap_uv) std::swap(frame.u_count, frame.v_count);
  const auto place_before = [swap = reading.swap_uv, mirror_u = reading.mirror_u,
                             mirror_v = reading.mirror_v, u_count = frame.u_count,
                             v_count = frame.v_count](int k, int l) {
    const int column = mirror_u ? u_count - 1 - k : k;
    const int row = mirror_v ? v_count - 1 - l : l;
    return swap ? std::pair(row, column) : std::pair(column, row);
  };
  frame.weights.resize(frame.v_count, frame.u_count);
  frame.present.clear();
  for (int l = 0; l < frame.v_count; ++l) {
    for (int k = 0; k < frame.u_count; ++k) {
      const auto [old_k, old_l] = place_before(k, l);
      frame.weights(l, k) = before.weights(old_l, old_k);
      if (!before.present.empty()) frame.present.push_back(before.IsPresent(old_k, old_l));
    }
  }
  source->read = [read = std::move(source->read), place_before](int k, int l) {
    const auto [old_k, old_l] = place_before(k, l);
    return read(old_k, old_l);
  };
  std::vector<std::string> changes;
  if (reading.swap_uv) changes.emplace_back("rows and columns exchanged");
  if (reading.mirror_u) changes.emplace_back("columns counted backwards");
  if (reading.mirror_v) changes.emplace_back("rows counted backwards");
  source->details.push_back(
      fmt::format("{} as the option view-order states", fmt::join(changes, " and ")));
}

// Whether the views are those of an image that is no light field: every N-th pixel of it, so that
// all shifts between them are about 1/N px.
bool IsPlainImage(const ViewSource& source, const ViewOrderFinding& finding) {
  constexpr double kNear = 0.5;
  const double px = source.plain_disparity_px;
  return px > 0 && finding.least_px > (1 - kNear) * px && finding.most_px < (1 + kNear) * px;
}

// States what the shifts between the views say about their order, and returns it.
// `is_stated`: by the option view-order.
ViewOrder ReportOrder(const std::string& path, const ViewSource& source,
                      const model::LightField& light_field, bool is_stated,
                      LightFieldFacts* facts) {
  ViewOrderFinding finding = FindViewOrder(light_field);
  if (finding.order == ViewOrder::kAsStated && IsPlainImage(source, finding)) {
    const std::string why = fmt::format(
        "the shifts between the views, {:.2g} to {:.2g} px, are about those between neighbouring "
        "pixels of one image ({:.2g} px): the size of the lenslets may be wrong",
        finding.least_px, finding.most_px, source.plain_disparity_px);
    finding = {};
    finding.why = why;
  }
  if (finding.order == ViewOrder::kAsStated && !source.doubt.empty()) {
    // Pixels of one lenslet under another number are neighbours in the image, whose shifts have an
    // order too.
    finding = {};
    finding.why = source.doubt;
  } else if (finding.order == ViewOrder::kUndecided && !source.doubt.empty()) {
    finding.why += "; " + source.doubt;
  }
  const std::string mirrored =
      source.mirrored.empty()
          ? "the shifts do not say which of both counts backwards: in the right order near things "
            "have the larger disparity"
          : source.mirrored;
  // An order that is wrong now and was stated is another one than that of the views.
  const auto remedy = [&](const std::string& turns) {
    return is_stated ? "the option view-order states an order that is not that of the views: leave "
                       "it out, or state another"
                     : turns;
  };
  switch (finding.order) {
    case ViewOrder::kUndecided:
      facts->one_line +=
          fmt::format("; whether rows and columns are in order cannot be decided: {}", finding.why);
      break;
    case ViewOrder::kAsStated:
      // The shifts of a scene whose depths are reversed are the same.
      facts->one_line +=
          finding.is_line
              ? "; the shifts between the views agree with their direction; whether they count "
                "backwards cannot be decided: they are in one line"
              : "; the shifts between the views agree with their order (or with that of both rows "
                "and columns backwards, which has the same shifts)";
      break;
    case ViewOrder::kSwapped:
      facts->notices.push_back(fmt::format(
          "{}: rows and columns of the views are exchanged: the scene shifts up or down between "
          "neighbours in a row; {}",
          path, remedy("the option view-order swap exchanges them")));
      break;
    case ViewOrder::kMirrored:
      facts->notices.push_back(fmt::format(
          "{}: the rows or the columns of the views count backwards: disparities have opposite "
          "signs across and down; {} ({})",
          path, remedy("the option view-order mirror-u or mirror-v turns them"), mirrored));
      break;
    case ViewOrder::kSwappedMirrored:
      facts->notices.push_back(fmt::format(
          "{}: rows and columns of the views are exchanged, and one of them counts backwards; {} "
          "({})",
          path, remedy("the option view-order swap,mirror-u or swap,mirror-v turns them"),
          mirrored));
      break;
    case ViewOrder::kIrregular:
      facts->notices.push_back(fmt::format(
          "{}: the shifts between neighbouring views fit no order of rows and columns: the views "
          "may be shuffled, or not rectified",
          path));
  }
  if (finding.step_ratio != 1) {
    facts->notices.push_back(fmt::format(
        "{}: the shifts between views are about {:g} times as large down as across: the steps "
        "between views differ, but one step is taken for both",
        path, finding.step_ratio));
  }
  return finding.order;
}

// ---- Black views.

// A value up to this, linear light, is black: 3 levels of 255 in sRGB, the noise of JPEG.
constexpr float kMaxOfBlack = 0.001F;
// A view is black if no more of its values than this share are brighter: hot pixels.
constexpr double kMaxHotShare = 1e-4;
// Views are judged where the middle one has at least this share of values above this light. In a
// dark scene with a lamp, a view that does not see the lamp is black too, and right.
constexpr float kMinOfOthers = 0.01F;
constexpr double kMinBrightShare = 0.01;
// Views with less than this part of the middle mean are reported: they are hardly within the
// aperture, but they have light.
constexpr double kDim = 0.1;

struct ViewLight {
  double above_black = 0, bright = 0;  // shares of the values
  double mean = 0;
};

ViewLight LightOf(const model::LightField& light_field, int k, int l) {
  ViewLight light;
  for (int channel = 0; channel < light_field.channels; ++channel) {
    const float* const first = light_field.values.data() + light_field.ViewStart(channel, k, l);
    for (std::size_t i = 0; i < light_field.view_size(); ++i) {
      light.above_black += first[i] > kMaxOfBlack ? 1 : 0;
      light.bright += first[i] > kMinOfOthers ? 1 : 0;
      light.mean += std::isfinite(first[i]) ? static_cast<double>(first[i]) : 0;
    }
  }
  const double count = static_cast<double>(light_field.view_size()) * light_field.channels;
  return {light.above_black / count, light.bright / count, light.mean / count};
}

double MiddleOf(const std::vector<ViewLight>& lights, double ViewLight::*what) {
  std::vector<double> values;
  for (const ViewLight& light : lights) values.push_back(light.*what);
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

void LeaveOut(int k, int l, model::LightField* light_field) {
  if (light_field->present.empty()) {
    light_field->present.assign(
        static_cast<std::size_t>(light_field->u_count * light_field->v_count), true);
  }
  light_field->present[static_cast<std::size_t>(l * light_field->u_count + k)] = false;
  light_field->weights(l, k) = 0;
  for (int channel = 0; channel < light_field->channels; ++channel) {
    const auto first = light_field->values.begin() +
                       static_cast<std::ptrdiff_t>(light_field->ViewStart(channel, k, l));
    std::fill(first, first + static_cast<std::ptrdiff_t>(light_field->view_size()), 0.0F);
  }
}

// Leaves out views without light among others that have some, such as those outside the round
// aperture of a plenoptic camera. Our own layout states its views and their weights: a black view
// of it is reported, and the statement is not overruled.
void ExamineDarkViews(bool is_own, model::LightField* light_field, LightFieldFacts* facts) {
  const int count = light_field->u_count * light_field->v_count;
  std::vector<ViewLight> all(static_cast<std::size_t>(count));
  ParallelFor(count, ReadingThreads(), [&](int i) {
    ThrowIfCancelled();
    all[static_cast<std::size_t>(i)] =
        LightOf(*light_field, i % light_field->u_count, i / light_field->u_count);
  });
  std::vector<ViewLight> known;
  for (int i = 0; i < count; ++i) {
    if (light_field->IsPresent(i % light_field->u_count, i / light_field->u_count))
      known.push_back(all[static_cast<std::size_t>(i)]);
  }
  if (known.empty()) return;
  const bool is_bright = MiddleOf(known, &ViewLight::bright) >= kMinBrightShare;
  const double middle_mean = MiddleOf(known, &ViewLight::mean);
  std::vector<std::string> black, dim;
  const bool leaves_out = is_bright && !is_own;
  for (int i = 0; i < count; ++i) {
    const int k = i % light_field->u_count;
    const int l = i / light_field->u_count;
    const ViewLight& light = all[static_cast<std::size_t>(i)];
    if (!light_field->IsPresent(k, l)) continue;
    if (light.above_black <= kMaxHotShare) {
      black.push_back(fmt::format("({}, {})", k, l));
      if (leaves_out) LeaveOut(k, l, light_field);
    } else if (is_bright && light.mean < kDim * middle_mean) {
      dim.push_back(fmt::format("({}, {})", k, l));
    }
  }
  const auto notice = [&](const std::vector<std::string>& views, const char* what) {
    facts->notices.push_back(fmt::format("{}: {} of {} views are {}: {}", light_field->source,
                                         views.size(), known.size(), what, Listed(views)));
  };
  if (!black.empty() && leaves_out) {
    light_field->weights /= light_field->weights.sum();
    facts->left_out = black;
    notice(black, "black and left out");
  } else if (!black.empty() && is_bright) {
    notice(black,
           "black, and kept because lightfield.yaml states them (present there and the option "
           "sparse leave them out)");
  } else if (black.size() < known.size() && !black.empty() && !is_own) {
    notice(black, "black, and kept because the others are dark too");
  }
  if (!dim.empty() && !is_own) {
    notice(dim,
           "darker than a tenth of the others and kept, they may be at the edge of the aperture "
           "(the option views takes the inner ones)");
  }
}

std::string OneLine(const ViewSource& source, const model::LightField& light_field) {
  std::string line = fmt::format("read as {}: {} x {} views of {} x {} px, {}", source.kind,
                                 light_field.u_count, light_field.v_count, light_field.s_count,
                                 light_field.t_count, light_field.channels == 1 ? "grey" : "RGB");
  if (light_field.channels != 1 && light_field.channels != 3)
    line = fmt::format("{} ({} channels)", line, light_field.channels);
  for (const std::string& detail : source.details) line += ", " + detail;
  return line;
}

// Whether neighbouring views have the shifts of some order.
bool IsInOrder(ViewOrder order) {
  return order != ViewOrder::kUndecided && order != ViewOrder::kIrregular;
}

model::LightField ReadSource(const std::string& folder, const LightFieldReading& reading,
                             ViewSource source, LightFieldFacts* facts, ViewOrder* order) {
  *facts = {};
  Reorder(reading, &source);
  model::LightField frame = source.frame;
  if (reading.u_count > 0) {
    frame = NamingTheFolder(
        folder, [&] { return model::InnerViews(frame, reading.u_count, reading.v_count); });
  }
  const ViewReader reader(folder, source, (source.frame.u_count - frame.u_count) / 2,
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
  ParallelFor(frame.u_count * frame.v_count, ReadingThreads(), [&](int i) {
    const int k = i % frame.u_count;
    const int l = i / frame.u_count;
    if (!frame.IsPresent(k, l)) return;
    const bool is_first = std::pair(k, l) == first_place;
    model::LinearImage view = is_first ? std::move(first) : reader.ReadLike(frame, k, l);
    if (reading.crop) view = model::CropImage(view, *reading.crop);
    model::SetView(&light_field, k, l, view);
  });
  light_field.present = present;
  light_field.source = folder;
  facts->kind = source.kind;
  facts->is_own = source.is_own;
  facts->is_plain = source.is_plain;
  facts->notices = source.notices;
  facts->one_line = folder + ": " + OneLine(source, light_field);
  ExamineDarkViews(source.is_own, &light_field, facts);
  *order = source.is_own
               ? ViewOrder::kAsStated
               : ReportOrder(folder, source, light_field,
                             reading.swap_uv || reading.mirror_u || reading.mirror_v, facts);
  std::string why;
  if (!light_field.IsValid(&why)) throw Error(fmt::format("{}: {}", folder, why));
  return light_field;
}

}  // namespace

std::vector<std::string> LightFieldLayouts() {
  std::vector<std::string> names;
  for (const ViewLayout& layout : kLayouts) names.emplace_back(layout.name);
  return names;
}

bool IsLayoutOfFolders(const std::string& layout) { return LayoutNamed(layout).is_of_folders; }

std::string LayoutThatIsStated(const std::string& file) {
  if (const std::optional<ArrayFormat> format = FormatOfArrays(file))
    return *format == ArrayFormat::kMat ? "mat" : "hdf5";
  if (IsNamedQuilt(file)) return "quilt";
  return IsNamedEslf(file) ? "lenslets" : "";
}

model::LightField ReadLightField(const std::string& folder, const LightFieldReading& reading) {
  LightFieldFacts ignored;
  return ReadLightField(folder, reading, &ignored);
}

model::LightField ReadLightField(const std::string& folder, const LightFieldReading& reading,
                                 LightFieldFacts* facts) {
  const ViewSource source = OpenSource(folder, reading);
  ViewOrder order = ViewOrder::kUndecided;
  model::LightField light_field = ReadSource(folder, reading, source, facts, &order);
  if (!source.from_one) return light_field;
  LightFieldFacts facts_from_one;
  ViewOrder order_from_one = ViewOrder::kUndecided;
  model::LightField from_one;
  try {
    from_one = ReadSource(folder, reading, *source.from_one, &facts_from_one, &order_from_one);
  } catch (const Interrupted&) {
    throw;
  } catch (const Error& error) {
    // Counted from 1, the views may not have the stated numbers, for example.
    facts->one_line +=
        fmt::format("; the numbers of the views are counted from 0, and cannot be read from 1 ({})",
                    error.what());
    return light_field;
  }
  const bool is_from_one = IsInOrder(order_from_one) && !IsInOrder(order);
  if (is_from_one) {
    light_field = std::move(from_one);
    *facts = facts_from_one;
  }
  const std::string doubt =
      "the numbers of the views may count from 0 or from 1, with as many missing; ";
  if (is_from_one) {
    facts->notices.push_back(fmt::format(
        "{}: {}the shifts between the views show that they count from 1", folder, doubt));
  } else if (IsInOrder(order) && !IsInOrder(order_from_one)) {
    facts->one_line += "; " + doubt + "the shifts between the views show that they count from 0";
  } else {
    facts->notices.push_back(fmt::format(
        "{}: {}the shifts between the views do not decide it, and they are counted from 0: if that "
        "is wrong, the names of the files must count from 0",
        folder, doubt));
  }
  return light_field;
}

}  // namespace thicklens::io
