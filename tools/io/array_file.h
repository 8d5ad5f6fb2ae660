#ifndef THICKLENS_TOOLS_IO_ARRAY_FILE_H_
#define THICKLENS_TOOLS_IO_ARRAY_FILE_H_

#include <sys/types.h>

#include <optional>
#include <string>
#include <vector>

#include "tools/io/array_library.h"

namespace thicklens::io {

// Finds the format by the first bytes of a file; absent: it is no file of arrays.
std::optional<ArrayFormat> FormatOfArrays(const std::string& path);

// A file of arrays that is read by a process of its own. A damaged file may make that process fail,
// never this one, and its memory is limited to what is left. No two threads may use one object.
class ArrayFile {
 public:
  // Throws Error that begins with the path.
  ArrayFile(const std::string& path, ArrayFormat format);
  ArrayFile(const ArrayFile&) = delete;
  ArrayFile& operator=(const ArrayFile&) = delete;

  const StoredFile& content() const { return content_; }
  // The numbers of one of the arrays, in the byte order of the machine. Call it once. Throws Error
  // that begins with the path, also if they need more memory than there is.
  std::vector<unsigned char> Read(const StoredArray& array);

 private:
  std::string Received(std::size_t most_bytes);
  void Receive(void* bytes, std::size_t count);
  [[noreturn]] void ThrowEnded();

  std::string path_;
  StoredFile content_;
  // Ends the process in the end.
  struct Process {
    pid_t id = -1;
    int socket = -1;
    Process() = default;
    ~Process();
    Process(const Process&) = delete;
    Process& operator=(const Process&) = delete;
  } process_;
};

}  // namespace thicklens::io

#endif  // THICKLENS_TOOLS_IO_ARRAY_FILE_H_
