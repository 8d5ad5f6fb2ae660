#ifndef THICKLENS_TOOLS_MESSAGE_LINE_H_
#define THICKLENS_TOOLS_MESSAGE_LINE_H_

#include <spdlog/formatter.h>

#include <memory>
#include <string>

namespace thicklens::tools {

// A text as one line that a person can read and a terminal only shows: names of files and values
// that stand in a message may be anything, and of any length. Line breaks become blanks, other
// control characters and what is no UTF-8 U+FFFD; of a text that is longer than a page, the middle
// is left out.
std::string MessageLine(const std::string& text);

// Every message of the program has this form: "thicklens: warning: ..." with the text as a
// MessageLine.
std::unique_ptr<spdlog::formatter> MakeMessageFormatter();

}  // namespace thicklens::tools

#endif  // THICKLENS_TOOLS_MESSAGE_LINE_H_
