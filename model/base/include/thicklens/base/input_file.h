#ifndef THICKLENS_BASE_INPUT_FILE_H_
#define THICKLENS_BASE_INPUT_FILE_H_

#include <cstdint>
#include <functional>
#include <string>

namespace thicklens {

// Every file that is read is a regular file (ordinary, with a size) of limited size. A folder, a
// named pipe, a device or a socket is refused by its kind, without waiting for somebody to write to
// it; so is a process substitution, which is a pipe with a name in /dev/fd.

// Texts: YAML, CSV, JSON, parameters.cfg.
constexpr std::uint64_t kMaxTextBytes = std::uint64_t{64} << 20;
// All others: images and depth maps.
constexpr std::uint64_t kMaxInputBytes = std::uint64_t{4} << 30;

// The whole content of a text; throws Error naming the path and the reason.
std::string ReadTextFile(const std::string& path);

// What ReadWholeFile (output_file.h) and ReadTextFile do, for a file that is no input of the run,
// such as an older output that is about to be replaced: the watch is not told.
std::string ReadOwnFile(const std::string& path, std::uint64_t most_bytes = kMaxInputBytes);

// Throws Error unless the path leads to a regular file. Opens nothing.
void RequireRegularFile(const std::string& path);

// "a folder", "a named pipe", "a socket", ...; "a file" for a regular one. `mode` is of stat(2).
std::string KindOfFile(unsigned mode);

// Called with the path of each input before it is read, and of each file that an input names as
// soon as the name is read; from any thread. It may throw Error: a program that must not write over
// what it reads learns here what that is. One for the whole process; empty: none.
using InputWatch = std::function<void(const std::string& path)>;
void WatchInputs(InputWatch watch);  // not while another thread reads
// For readers of files that name other files.
void TellInput(const std::string& path);

}  // namespace thicklens

#endif  // THICKLENS_BASE_INPUT_FILE_H_
