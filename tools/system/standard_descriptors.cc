// If a standard descriptor is closed at the start (2>&-, some daemons), the next file that is
// opened gets its number, and text that the program or a library prints would go into an output
// file.
#include <fcntl.h>
#include <unistd.h>

namespace {

// A file that is opened gets the lowest free number.
void OpenClosedStandardDescriptors(int /*argc*/, char** /*argv*/, char** /*environment*/) {
  for (int descriptor = STDIN_FILENO; descriptor <= STDERR_FILENO; ++descriptor) {
    if (::fcntl(descriptor, F_GETFD) >= 0) continue;
    // If there is no null device, a directory takes the number, and writing to it fails.
    if (::open("/dev/null", O_RDWR | O_NOCTTY) < 0) static_cast<void>(::open("/", O_RDONLY));
  }
}

// The loader calls this before the constructors of the program's libraries, which may open files.
// Only a program can have such a section, so this file is part of the program and of no library.
__attribute__((section(".preinit_array"),
               used)) void (*const kFirstOfAll)(int, char**,
                                                char**) = OpenClosedStandardDescriptors;

}  // namespace
