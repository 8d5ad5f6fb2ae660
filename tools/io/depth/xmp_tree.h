#ifndef THICKLENS_TOOLS_IO_DEPTH_XMP_TREE_H_
#define THICKLENS_TOOLS_IO_DEPTH_XMP_TREE_H_

#include <optional>
#include <string>
#include <vector>

namespace thicklens::io {

// A property of an XMP packet, which is RDF in XML (ISO 16684-1). An attribute and an element of
// the same name mean the same and are kept alike.
struct XmpNode {
  std::string space;  // the URI of the namespace
  std::string name;   // without its prefix
  std::string text;
  std::vector<XmpNode> inner;

  // Returns the first property of this name below this one, at any depth; null: there is none.
  const XmpNode* Find(const std::string& of_space, const std::string& of_name) const;
  // Likewise all of them, in their order; nothing is searched below a property that is found.
  std::vector<const XmpNode*> FindAll(const std::string& of_space,
                                      const std::string& of_name) const;
  // The text of the property, without white space around it; absent: there is none.
  std::optional<std::string> Text(const std::string& of_space, const std::string& of_name) const;
};

// Reads a packet. Throws Error that begins with `name` if it is no XML, declares entities or is
// nested deeper than any packet.
XmpNode ParseXmp(const std::string& packet, const std::string& name);

}  // namespace thicklens::io

#endif  // THICKLENS_TOOLS_IO_DEPTH_XMP_TREE_H_
