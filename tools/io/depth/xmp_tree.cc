#include "tools/io/depth/xmp_tree.h"

#include <expat.h>
#include <fmt/format.h>

#include <cstddef>
#include <exception>
#include <limits>
#include <memory>
#include <utility>

#include "thicklens/base/error.h"

namespace thicklens::io {
namespace {

constexpr char kBetween = '\n';  // stands between URI and name; neither has it
constexpr std::size_t kDeepest = 64;

class XmpParser {
 public:
  explicit XmpParser(const std::string& name) : name_(name) { open_.push_back(&root_); }

  XmpNode Parse(const std::string& packet) {
    if (packet.size() > static_cast<std::size_t>(std::numeric_limits<int>::max()))
      throw Error(fmt::format("{}: XMP of {} bytes", name_, packet.size()));
    const std::unique_ptr<XML_ParserStruct, void (*)(XML_Parser)> parser(
        XML_ParserCreateNS("UTF-8", kBetween), XML_ParserFree);
    parser_ = parser.get();
    XML_SetUserData(parser_, this);
    XML_SetElementHandler(parser_, Begin, End);
    XML_SetCharacterDataHandler(parser_, Text);
    XML_SetEntityDeclHandler(parser_, RefuseEntity);
    const auto status =
        XML_Parse(parser_, packet.data(), static_cast<int>(packet.size()), XML_TRUE);
    if (!why_.empty()) throw Error(fmt::format("{}: XMP: {}", name_, why_));
    if (status != XML_STATUS_OK) {
      throw Error(fmt::format("{}: XMP that is not valid XML, line {}, column {}: {}", name_,
                              XML_GetCurrentLineNumber(parser_),
                              XML_GetCurrentColumnNumber(parser_) + 1,
                              XML_ErrorString(XML_GetErrorCode(parser_))));
    }
    return std::move(root_);
  }

 private:
  // No exception may pass through the C library: the first error stops it.
  template <typename Function>
  static void Guarded(void* data, const Function& function) {
    auto* self = static_cast<XmpParser*>(data);
    if (!self->why_.empty()) return;
    try {
      function(self);
    } catch (const std::exception& error) {
      self->Stop(error.what());
    }
  }
  static void Begin(void* data, const XML_Char* name, const XML_Char** attributes) {
    Guarded(data, [&](XmpParser* self) {
      if (self->open_.size() > kDeepest) {
        self->Stop(fmt::format("elements in one another more than {} deep", kDeepest));
        return;
      }
      std::vector<XmpNode>& inner = self->open_.back()->inner;
      inner.push_back(Named(name));
      XmpNode& node = inner.back();
      for (; *attributes != nullptr; attributes += 2) {
        node.inner.push_back(Named(attributes[0]));
        node.inner.back().text = attributes[1];
      }
      // The address stays the same until the element ends: nothing is added beside it before.
      self->open_.push_back(&node);
    });
  }
  static void End(void* data, const XML_Char*) {
    Guarded(data, [](XmpParser* self) { self->open_.pop_back(); });
  }
  static void Text(void* data, const XML_Char* text, int length) {
    Guarded(data, [&](XmpParser* self) {
      self->open_.back()->text.append(text, static_cast<std::size_t>(length));
    });
  }
  static void RefuseEntity(void* data, const XML_Char*, int, const XML_Char*, int, const XML_Char*,
                           const XML_Char*, const XML_Char*, const XML_Char*) {
    static_cast<XmpParser*>(data)->Stop("it declares entities, which no XMP needs");
  }
  void Stop(const std::string& why) {
    why_ = why;
    XML_StopParser(parser_, XML_FALSE);
  }
  static XmpNode Named(const std::string& name) {
    const std::size_t end = name.find(kBetween);
    if (end == std::string::npos) return {"", name, "", {}};
    return {name.substr(0, end), name.substr(end + 1), "", {}};
  }

  const std::string& name_;
  XML_Parser parser_ = nullptr;
  XmpNode root_;
  std::vector<XmpNode*> open_;
  std::string why_;
};

void Collect(const XmpNode& node, const std::string& space, const std::string& name,
             std::vector<const XmpNode*>* found) {
  for (const XmpNode& inner : node.inner) {
    if (inner.name == name && inner.space == space) {
      found->push_back(&inner);
    } else {
      Collect(inner, space, name, found);
    }
  }
}

}  // namespace

const XmpNode* XmpNode::Find(const std::string& of_space, const std::string& of_name) const {
  for (const XmpNode& node : inner) {
    if (node.name == of_name && node.space == of_space) return &node;
    if (const XmpNode* found = node.Find(of_space, of_name)) return found;
  }
  return nullptr;
}

std::vector<const XmpNode*> XmpNode::FindAll(const std::string& of_space,
                                             const std::string& of_name) const {
  std::vector<const XmpNode*> found;
  Collect(*this, of_space, of_name, &found);
  return found;
}

std::optional<std::string> XmpNode::Text(const std::string& of_space,
                                         const std::string& of_name) const {
  const XmpNode* found = Find(of_space, of_name);
  if (found == nullptr) return std::nullopt;
  constexpr char kWhite[] = " \t\r\n";
  const std::size_t begin = found->text.find_first_not_of(kWhite);
  if (begin == std::string::npos) return "";
  return found->text.substr(begin, found->text.find_last_not_of(kWhite) - begin + 1);
}

XmpNode ParseXmp(const std::string& packet, const std::string& name) {
  // Writers fill a packet with zeros at its end.
  std::size_t end = packet.find_last_not_of('\0');
  end = end == std::string::npos ? 0 : end + 1;
  return XmpParser(name).Parse(packet.substr(0, end));
}

}  // namespace thicklens::io
