#ifndef THICKLENS_TOOLS_SYSTEM_PROGRAM_MEMORY_H_
#define THICKLENS_TOOLS_SYSTEM_PROGRAM_MEMORY_H_

namespace thicklens::tools {

// Keeps freed memory for the next use. Call it first in main: images are allocated and freed by the
// thousand, and new pages from the system are expensive, most of all on virtual machines. Pieces of
// less than 64 MiB are kept, and huge pages are requested where the system gives them on request
// (Linux). With another C library than glibc, and under a sanitizer, which has a malloc of its own,
// nothing changes.
void KeepFreedMemory();

}  // namespace thicklens::tools

#endif  // THICKLENS_TOOLS_SYSTEM_PROGRAM_MEMORY_H_
