#ifndef THICKLENS_TOOLS_IO_PLUGIN_H_
#define THICKLENS_TOOLS_IO_PLUGIN_H_

#include <string>

// In the file of a library that defines its entry: the identity of its build, which LoadPlugin
// compares with its own before it calls the entry.
#define THICKLENS_STATE_PLUGIN_IDENTITY()                                                   \
  extern "C" __attribute__((visibility("default"))) const char* ThicklensPluginIdentity() { \
    return THICKLENS_PLUGIN_IDENTITY;                                                       \
  }

namespace thicklens::io {

// A library that is loaded when a file first needs it.
struct Plugin {
  const char* file;     // "thicklens_image_library.so"
  const char* entry;    // the function that returns its table of functions
  const char* purpose;  // "reads and writes EXR files", for messages
};

// Loads the library, which is never closed, and returns what its entry returns. It is looked for
// beside the program and where the program is installed, never in the current folder. Throws Error
// if it is missing, cannot be loaded, or belongs to another build, whose objects may have another
// layout.
const void* LoadPlugin(const Plugin& plugin);

// Loads the library at a path, as LoadPlugin does.
const void* LoadPluginAt(const std::string& path, const Plugin& plugin);

}  // namespace thicklens::io

#endif  // THICKLENS_TOOLS_IO_PLUGIN_H_
