#ifndef THICKLENS_TOOLS_IO_PLUGIN_H_
#define THICKLENS_TOOLS_IO_PLUGIN_H_

#include <string>

namespace thicklens::io {

// A library that is loaded when a file first needs it.
struct Plugin {
  const char* file;     // "thicklens_image_library.so"
  const char* entry;    // the function that returns its table of functions
  const char* purpose;  // "reads and writes EXR files", for messages
};

// Loads the library, which is never closed, and returns what its entry returns. It is looked for
// beside the program and where the program is installed, never in the current folder. Throws Error
// if it is missing or cannot be loaded.
const void* LoadPlugin(const Plugin& plugin);

}  // namespace thicklens::io

#endif  // THICKLENS_TOOLS_IO_PLUGIN_H_
