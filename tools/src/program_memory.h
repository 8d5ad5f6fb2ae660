#ifndef THICKLENS_TOOLS_PROGRAM_MEMORY_H_
#define THICKLENS_TOOLS_PROGRAM_MEMORY_H_

namespace thicklens::tools {

// To be called first in main: pictures are allocated and freed again by the thousand, and pages
// that are new from the system are dear, most of all on virtual machines. From then on what is
// freed is kept for the next use (pieces of less than 64 MiB), and where the system gives huge
// pages on request (Linux) they are asked for. With another C library than glibc, and under a
// sanitizer, which has a malloc of its own, nothing changes.
void KeepFreedMemory();

}  // namespace thicklens::tools

#endif  // THICKLENS_TOOLS_PROGRAM_MEMORY_H_
