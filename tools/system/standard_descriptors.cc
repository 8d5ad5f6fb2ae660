// Whoever closes a standard descriptor (2>&-, some daemons) gives its number to the next file that
// is opened: what the program, or a library, prints would go into an output.
#include <fcntl.h>
#include <unistd.h>

namespace {

// Whatever is opened gets the lowest number that is free.
void OpenClosedStandardDescriptors(int /*argc*/, char** /*argv*/, char** /*environment*/) {
  for (int descriptor = STDIN_FILENO; descriptor <= STDERR_FILENO; ++descriptor) {
    if (::fcntl(descriptor, F_GETFD) >= 0) continue;
    // Where there is no null device, what takes the number fails when it is written to.
    if (::open("/dev/null", O_RDWR | O_NOCTTY) < 0) static_cast<void>(::open("/", O_RDONLY));
  }
}

// Called by the loader before the constructors of the program's libraries, which may open files.
// Only a program has such a section, so this file is part of the program and of no library.
__attribute__((section(".preinit_array"),
               used)) void (*const kFirstOfAll)(int, char**,
                                                char**) = OpenClosedStandardDescriptors;

}  // namespace
