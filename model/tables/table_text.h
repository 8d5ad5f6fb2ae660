#ifndef THICKLENS_MODEL_TABLES_TABLE_TEXT_H_
#define THICKLENS_MODEL_TABLES_TABLE_TEXT_H_

#include <optional>
#include <string>

namespace thicklens::model {

// The text of a table, in UTF-8 with line feeds.
struct TableText {
  std::string text;
  std::string encoding;  // "UTF-8", "UTF-16" or "Latin-1"
};

// Decodes UTF-8 and UTF-16 (both byte orders), with or without a byte order mark, and, if the bytes
// are no UTF-8, Latin-1 as Windows extends it. Throws Error, which names `path`, the line and the
// byte, for what is no text.
TableText DecodeTableText(const std::string& bytes, const std::string& path);

// The bytes that DecodeTableText reads as this text in UTF-8 if they are Latin-1; nothing if there
// are none.
std::optional<std::string> InLatin1(const std::string& text);

// A text for messages: its beginning if it is long.
std::string Shown(const std::string& text);

}  // namespace thicklens::model

#endif  // THICKLENS_MODEL_TABLES_TABLE_TEXT_H_
