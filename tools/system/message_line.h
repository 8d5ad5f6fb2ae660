#ifndef THICKLENS_TOOLS_SYSTEM_MESSAGE_LINE_H_
#define THICKLENS_TOOLS_SYSTEM_MESSAGE_LINE_H_

#include <spdlog/formatter.h>

#include <memory>
#include <string>

namespace thicklens::tools {

// Formats a text as one line that people can read and that cannot control a terminal: file names
// and values in a message may be anything, and of any length. Line breaks become spaces; other
// control characters and broken UTF-8 become U+FFFD. The middle of a text that is longer than a
// page is left out.
std::string MessageLine(const std::string& text);

// Every message of the program has the form "thicklens: warning: ..." with the text as a
// MessageLine.
std::unique_ptr<spdlog::formatter> MakeMessageFormatter();

}  // namespace thicklens::tools

#endif  // THICKLENS_TOOLS_SYSTEM_MESSAGE_LINE_H_
