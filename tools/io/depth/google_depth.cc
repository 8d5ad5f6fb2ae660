// Depth in photographs as Google's formats state it: GDepth
// (developers.google.com/depthmap-metadata) and Dynamic Depth 1.0.
#include <fmt/format.h>
#include <fmt/ranges.h>

#include <charconv>
#include <cstdint>
#include <system_error>

#include "thicklens/base/error.h"
#include "thicklens/base/printable_text.h"
#include "tools/io/depth/embedded_parts.h"

namespace thicklens::io {
namespace {

constexpr char kGDepth[] = "http://ns.google.com/photos/1.0/depthmap/";
constexpr char kGImage[] = "http://ns.google.com/photos/1.0/image/";
constexpr char kDepthMap[] = "http://ns.google.com/photos/dd/1.0/depthmap/";
constexpr char kCamera[] = "http://ns.google.com/photos/dd/1.0/camera/";
// Dynamic Depth, and the container of newer files.
constexpr const char* kContainers[] = {"http://ns.google.com/photos/dd/1.0/container/",
                                       "http://ns.google.com/photos/1.0/container/"};
constexpr const char* kItems[] = {"http://ns.google.com/photos/dd/1.0/item/",
                                  "http://ns.google.com/photos/1.0/container/item/"};
constexpr char kRdf[] = "http://www.w3.org/1999/02/22-rdf-syntax-ns#";

// The unit of Near and Far, mm; absent: the file says that there is none.
struct GoogleUnit {
  std::optional<double> mm;
  std::string shown;
};

// The fields of one namespace that state how numbers become depths.
class RangeFields {
 public:
  RangeFields(const XmpNode& fields, const char* space, const char* prefix, const std::string& name)
      : fields_(fields), space_(space), prefix_(prefix), name_(name) {}

  void Take(EmbeddedDepth* depth) const {
    const std::string format = Of("Format").value_or("");
    if (format != "RangeInverse" && format != "RangeLinear") {
      throw Error(fmt::format("{}: {}:Format is '{}': RangeInverse or RangeLinear is expected",
                              name_, prefix_, PrintableUtf8(format)));
    }
    const double near = Number("Near", "the depth of the number 0");
    const double far = Number("Far", "the depth of the largest number");
    if (!(near > 0) || !(far > near)) {
      throw Error(
          fmt::format("{0}: {1}:Near is {2:g} and {1}:Far is {3:g}: 0 < Near < Far is "
                      "expected",
                      name_, prefix_, near, far));
    }
    const bool is_axial = IsAxial();
    const GoogleUnit unit = Unit(depth);
    constexpr double kMmPerMetre = 1000;
    const double unit_mm = unit.mm.value_or(kMmPerMetre);
    const double full_scale = depth->map.largest_of_type.value_or(1);
    depth->has_unit = unit.mm.has_value();
    depth->is_inverse = format == "RangeInverse";
    depth->kind = !is_axial           ? model::DepthKind::kRange
                  : depth->is_inverse ? model::DepthKind::kInverse
                                      : model::DepthKind::kZ;
    // RangeInverse: d = far near/(far - v (far - near)) with v from 0 to 1, so that 1/d = 1/near -
    // v (1/near - 1/far). RangeLinear: d = near + v (far - near).
    if (depth->is_inverse) {
      const double near_dpt = kMmPerMetre / (near * unit_mm),
                   far_dpt = kMmPerMetre / (far * unit_mm);
      depth->offset = near_dpt;
      depth->scale = (far_dpt - near_dpt) / full_scale;
    } else {
      depth->offset = near * unit_mm;
      depth->scale = (far - near) * unit_mm / full_scale;
    }
    depth->description = fmt::format(
        "{}, {} from {:g} to {:g}{} along the {}; {}", depth->form, format, near, far, unit.shown,
        is_axial ? "optical axis" : "ray of each pixel", depth->description);
  }

 private:
  std::optional<std::string> Of(const char* field) const { return fields_.Text(space_, field); }

  double Number(const char* field, const std::string& meaning) const {
    return XmpNumberOf(fields_, {space_, prefix_, field}, meaning, name_);
  }

  bool IsAxial() const {
    const std::string type = Of("MeasureType").value_or("OpticalAxis");
    if (type != "OpticalAxis" && type != "OpticRay") {
      throw Error(fmt::format("{}: {}:MeasureType is '{}': OpticalAxis or OpticRay is expected",
                              name_, prefix_, PrintableUtf8(type)));
    }
    return type == "OpticalAxis";
  }

  GoogleUnit Unit(EmbeddedDepth* depth) const {
    const bool is_gdepth = prefix_ == "GDepth";
    const std::optional<std::string> stated = Of("Units");
    if (!stated && is_gdepth) {
      depth->notes.emplace_back("GDepth:Units is absent, which stands for metres.");
      return {1000.0, " m"};
    }
    const std::string text = stated.value_or("None");
    if (text == "m" || text == "Meters" || text == "meters") return {1000.0, " m"};
    if (text == "mm") return {1.0, " mm"};
    if (text == "cm") return {10.0, " cm"};
    if (text == "None" || text == "none") return {std::nullopt, " (no unit)"};
    throw Error(fmt::format("{}: {}:Units is '{}': {} is expected", name_, prefix_,
                            PrintableUtf8(text), is_gdepth ? "m or mm" : "Meters or None"));
  }

  const XmpNode& fields_;
  const char* space_;
  const std::string prefix_;
  const std::string& name_;
};

// An item of the directory of a container: a file behind the photograph.
struct ContainerItem {
  std::string mime, semantic, uri;
  std::optional<std::string> length, padding;
  std::size_t begin = 0, size = 0;  // in the file; size 0: none of its own
};

// "" and absent are 0. Throws Error.
std::size_t BytesOf(const std::optional<std::string>& text, const char* field, std::size_t number,
                    const std::string& name) {
  if (!text || text->empty()) return 0;
  std::uint64_t value = 0;
  const char* const end = text->data() + text->size();
  const auto [rest, status] = std::from_chars(text->data(), end, value);
  if (status != std::errc() || rest != end) {
    throw Error(
        fmt::format("{}: Item:{} of item {} of the container is '{}': a number of bytes is "
                    "expected",
                    name, field, number, PrintableUtf8(*text)));
  }
  return static_cast<std::size_t>(value);
}

std::vector<ContainerItem> ItemsIn(const XmpNode& xmp) {
  std::vector<const XmpNode*> nodes;
  for (const char* container : kContainers) {
    for (const XmpNode* directory : xmp.FindAll(container, "Directory")) {
      std::vector<const XmpNode*> found = directory->FindAll(container, "Item");
      if (found.empty()) found = directory->FindAll(kRdf, "li");
      nodes.insert(nodes.end(), found.begin(), found.end());
    }
  }
  std::vector<ContainerItem> items;
  for (const XmpNode* node : nodes) {
    ContainerItem item;
    for (const char* space : kItems) {
      if (const auto text = node->Text(space, "Mime")) item.mime = *text;
      if (const auto text = node->Text(space, "Semantic")) item.semantic = *text;
      if (const auto text = node->Text(space, "DataURI")) item.uri = *text;
      if (const auto text = node->Text(space, "URI")) item.uri = *text;
      if (const auto text = node->Text(space, "Length")) item.length = *text;
      if (const auto text = node->Text(space, "Padding")) item.padding = *text;
    }
    items.push_back(item);
  }
  return items;
}

// The first item is the photograph; the others follow it in their order, each with its padding.
void PlaceItems(const PhotoParts& photo, std::vector<ContainerItem>* items) {
  std::size_t at = photo.end;
  const std::size_t all = photo.bytes->size();
  for (std::size_t i = 0; i < items->size(); ++i) {
    ContainerItem& item = (*items)[i];
    const std::size_t size = i == 0 ? 0 : BytesOf(item.length, "Length", i + 1, photo.name);
    const std::size_t padding = BytesOf(item.padding, "Padding", i + 1, photo.name);
    if (size > all - at || padding > all - at - size) {
      throw Error(fmt::format(
          "{}: item {} of the container ({}) has {} bytes and a padding of {} at {}: the file ends "
          "at {}; was it cut, or saved again by a program that dropped what is behind the "
          "photograph?",
          photo.name, i + 1, PrintableUtf8(item.semantic.empty() ? item.uri : item.semantic), size,
          padding, at, all));
    }
    item.begin = at;
    item.size = size;
    at += size + padding;
  }
}

std::string ItemNames(const std::vector<ContainerItem>& items) {
  std::vector<std::string> names;
  for (const ContainerItem& item : items)
    names.push_back(fmt::format("'{}'", item.uri.empty() ? item.semantic : item.uri));
  return PrintableUtf8(fmt::format("{}", fmt::join(names, ", ")));
}

// The item that the fields of a DepthMap name, or, without them, one that states to be depth; null:
// there is none.
const ContainerItem* DepthItem(const std::vector<ContainerItem>& items, const std::string& uri,
                               const std::string& semantic) {
  for (const ContainerItem& item : items) {
    if (!uri.empty() && item.uri == uri) return &item;
  }
  for (const ContainerItem& item : items) {
    if (!semantic.empty() && item.semantic == semantic) return &item;
  }
  return nullptr;
}

// Phones store the photograph as it was beside one with artificial blur.
void WarnOfArtificialBlur(const XmpNode& xmp, EmbeddedDepth* depth) {
  if (xmp.Find(kGImage, "Data") == nullptr && xmp.Find(kGImage, "Mime") == nullptr) return;
  depth->warnings.emplace_back(
      "The file also holds a photograph in GImage:Data, as phones store the unprocessed one beside "
      "a portrait with artificial blur: such blur is not that of a camera; take the unprocessed "
      "photograph.");
}

}  // namespace

bool HasGoogleDepthFields(const std::string& packet) {
  return packet.find(kGDepth) != std::string::npos || packet.find(kDepthMap) != std::string::npos;
}

std::optional<EmbeddedDepth> GDepthOf(const PhotoParts& photo) {
  const XmpNode& xmp = photo.xmp;
  const bool is_there = xmp.Find(kGDepth, "Format") != nullptr ||
                        xmp.Find(kGDepth, "Near") != nullptr ||
                        xmp.Find(kGDepth, "Data") != nullptr;
  if (!is_there) return std::nullopt;
  const std::optional<std::string> data = xmp.Text(kGDepth, "Data");
  if (!data) {
    if (!ItemsIn(xmp).empty()) return std::nullopt;  // the map is an item of the container
    throw Error(fmt::format(
        "{}: GDepth:Format and its kin are there, GDepth:Data is missing: the map itself, which "
        "programs drop that know no extended XMP; take the file as the camera wrote it",
        photo.name));
  }
  const std::string place = photo.name + ": GDepth:Data";
  EmbeddedDepth depth =
      OfStoredImage(DecodeBase64(*data, place), xmp.Text(kGDepth, "Mime").value_or(""), place);
  depth.form = "GDepth";
  RangeFields(xmp, kGDepth, "GDepth", photo.name).Take(&depth);
  WarnOfArtificialBlur(xmp, &depth);
  return depth;
}

std::optional<EmbeddedDepth> DynamicDepthOf(const PhotoParts& photo,
                                            std::vector<std::string>* others) {
  const XmpNode& xmp = photo.xmp;
  const XmpNode* fields = xmp.Find(kCamera, "DepthMap");
  if (fields == nullptr && xmp.Find(kDepthMap, "Near") != nullptr) fields = &xmp;
  std::vector<ContainerItem> items = ItemsIn(xmp);
  const std::string uri = fields ? fields->Text(kDepthMap, "DepthURI").value_or("") : "";
  const std::string semantic =
      fields ? fields->Text(kDepthMap, "ItemSemantic").value_or("Depth") : "Depth";
  const ContainerItem* item = DepthItem(items, uri, semantic);
  if (fields == nullptr && item == nullptr) return std::nullopt;
  if (item == nullptr) {
    throw Error(fmt::format(
        "{}: DepthMap:DepthURI is '{}' and DepthMap:ItemSemantic '{}': an item of this name is "
        "expected in Container:Directory, which has {}",
        photo.name, PrintableUtf8(uri), PrintableUtf8(semantic),
        items.empty() ? "none" : ItemNames(items)));
  }
  const bool has_gdepth = xmp.Find(kGDepth, "Near") != nullptr;
  if (fields == nullptr && !has_gdepth) {
    others->push_back(
        "an item of the container that states to be depth, without DepthMap:Near and DepthMap:Far, "
        "by which its numbers would be depths");
    return std::nullopt;
  }
  if (!photo.is_jpeg) {
    others->push_back("Dynamic Depth, which is read from JPEG files only");
    return std::nullopt;
  }
  PlaceItems(photo, &items);
  if (item->size == 0) {
    throw Error(fmt::format(
        "{}: Item:Length of the item '{}' of the container is {}: the number of its bytes behind "
        "the photograph is expected",
        photo.name, PrintableUtf8(item->uri.empty() ? item->semantic : item->uri),
        item->length ? "'" + PrintableUtf8(*item->length) + "'" : "missing"));
  }
  EmbeddedDepth depth =
      OfStoredImage(photo.bytes->substr(item->begin, item->size), item->mime,
                    fmt::format("{}: item '{}' of the container", photo.name,
                                PrintableUtf8(item->uri.empty() ? item->semantic : item->uri)));
  depth.form = "Dynamic Depth";
  RangeFields(fields ? *fields : xmp, fields ? kDepthMap : kGDepth, fields ? "DepthMap" : "GDepth",
              photo.name)
      .Take(&depth);
  WarnOfArtificialBlur(xmp, &depth);
  return depth;
}

}  // namespace thicklens::io
