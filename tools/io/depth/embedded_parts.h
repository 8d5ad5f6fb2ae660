#ifndef THICKLENS_TOOLS_IO_DEPTH_EMBEDDED_PARTS_H_
#define THICKLENS_TOOLS_IO_DEPTH_EMBEDDED_PARTS_H_

#include <cstddef>
#include <optional>
#include <string>
#include <vector>

#include "thicklens/io/depth_io.h"
#include "tools/io/depth/xmp_tree.h"

// One reader per form of embedded depth; embedded.cc asks them in turn. Each throws Error that
// begins with `name`.
namespace thicklens::io {

// A field of XMP that states something about a depth map: "GDepth:Near" in a namespace.
struct XmpField {
  std::string space, prefix, name;

  std::string Shown() const { return prefix + ":" + name; }
};

// The number of the field. Throws Error that names file, field and value if it is missing or not a
// finite number; `meaning` says in words what it should be.
double XmpNumberOf(const XmpNode& xmp, const XmpField& field, const std::string& meaning,
                   const std::string& name);

// Decodes base64 with white space in it. Throws Error that begins with `name` if it is another
// text.
std::string DecodeBase64(const std::string& text, const std::string& name);

// Takes the map out of the bytes of an image, PNG or JPEG, that is part of another file; `name`
// names both. A Mime that states another kind is a remark.
EmbeddedDepth OfStoredImage(const std::string& bytes, const std::string& mime,
                            const std::string& name);

// The metadata of a photograph, and the place of what is behind its photograph.
struct PhotoParts {
  const std::string* bytes = nullptr;
  std::string name;
  XmpNode xmp;           // the packet, and the extended one below it
  std::size_t end = 0;   // of the photograph in the file
  bool is_jpeg = false;  // others have nothing behind the photograph
};

// Whether a packet, which may be damaged, has fields of GDepth or of a DepthMap.
bool HasGoogleDepthFields(const std::string& packet);
// Google's GDepth, the map in the XMP itself.
std::optional<EmbeddedDepth> GDepthOf(const PhotoParts& photo);
// Google's Dynamic Depth, or a directory whose item states that it is depth: the map is behind the
// photograph. `others` gets items that look like depth and state no range.
std::optional<EmbeddedDepth> DynamicDepthOf(const PhotoParts& photo,
                                            std::vector<std::string>* others);

// Whether the XMP of an image states that the image is Apple's depth or disparity.
bool IsAppleDepth(const XmpNode& xmp);
// States the meaning of the numbers of such an image.
void TakeAppleMeaning(const XmpNode& xmp, const std::string& name, EmbeddedDepth* depth);

}  // namespace thicklens::io

#endif  // THICKLENS_TOOLS_IO_DEPTH_EMBEDDED_PARTS_H_
