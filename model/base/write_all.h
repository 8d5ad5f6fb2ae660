#ifndef THICKLENS_MODEL_BASE_WRITE_ALL_H_
#define THICKLENS_MODEL_BASE_WRITE_ALL_H_

#include <unistd.h>

#include <cerrno>
#include <cstddef>
#include <string>

#include "model/base/output_target.h"

namespace thicklens {

// Writes the whole content to `fd`. Throws Error, which names `shown`.
inline void WriteAll(int fd, const std::string& content, const std::string& shown) {
  std::size_t done = 0;
  while (done < content.size()) {
    const ssize_t n = ::write(fd, content.data() + done, content.size() - done);
    if (n < 0 && errno == EINTR) continue;
    if (n < 0) throw CannotBeWritten(shown, errno);
    done += static_cast<std::size_t>(n);
  }
}

}  // namespace thicklens

#endif  // THICKLENS_MODEL_BASE_WRITE_ALL_H_
