#ifndef THICKLENS_BASE_INPUT_FILE_H_
#define THICKLENS_BASE_INPUT_FILE_H_

#include <cstdint>
#include <functional>
#include <string>

#include "thicklens/base/export.h"

namespace thicklens {

// Every input is a regular file (ordinary, with a size) of limited size. A folder, a named pipe, a
// device or a socket throws Error, which names its kind, without waiting for a writer. A process
// substitution, which is a pipe with a name in /dev/fd, throws Error as well.

// Maximum size of text files: YAML, CSV, JSON, parameters.cfg.
constexpr std::uint64_t kMaxTextBytes = std::uint64_t{64} << 20;
// Maximum size of all other files: images and depth maps.
constexpr std::uint64_t kMaxInputBytes = std::uint64_t{4} << 30;

// Returns the whole content of a text file. Throws Error, which names the path and the reason.
THICKLENS_EXPORT std::string ReadTextFile(const std::string& path);

// Returns the whole content of a file that is no input of the run, such as an older output that is
// about to be replaced. Unlike ReadWholeFile (output_file.h) and ReadTextFile it does not call the
// InputWatch. Throws Error, which names the path and the reason, also above `most_bytes`.
THICKLENS_EXPORT std::string ReadOwnFile(const std::string& path,
                                         std::uint64_t most_bytes = kMaxInputBytes);

// Throws Error unless the path leads to a regular file. Opens nothing.
THICKLENS_EXPORT void RequireRegularFile(const std::string& path);

// The kind of a file in words: "a folder", "a named pipe", "a socket", ...; "a file" for a regular
// one. `mode` is st_mode of stat(2).
THICKLENS_EXPORT std::string KindOfFile(unsigned mode);

// A function that is called with the path of each input before it is read, and with the path of
// each file that an input names as soon as the name is read. The calls may come from any thread.
// The function may throw Error, so that a program can refuse to overwrite its inputs. There is one
// for the whole process; empty: none.
using InputWatch = std::function<void(const std::string& path)>;
// Sets the InputWatch. Must not be called while another thread reads.
THICKLENS_EXPORT void WatchInputs(InputWatch watch);
// Calls the InputWatch. Readers of files that name other files call this function.
THICKLENS_EXPORT void ReportInput(const std::string& path);

}  // namespace thicklens

#endif  // THICKLENS_BASE_INPUT_FILE_H_
