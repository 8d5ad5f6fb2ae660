#ifndef THICKLENS_TOOLS_IO_ARRAYS_ARRAYS_H_
#define THICKLENS_TOOLS_IO_ARRAYS_ARRAYS_H_

#include <cstddef>
#include <functional>
#include <stdexcept>
#include <string>

#include "tools/io/array_library.h"

// The parts of the library that array_library.h describes. They are not linked with the program's
// own libraries: a reason is a std::runtime_error.
namespace thicklens::io {

using ArrayRefusal = std::runtime_error;
using PutBytes = std::function<void(const void* bytes, std::size_t count)>;

// An open file of arrays.
class ArraySource {
 public:
  virtual ~ArraySource() = default;
  virtual StoredFile Content() = 0;
  virtual void Read(const std::string& name, const PutBytes& put) = 0;
};

// Neither is ever closed: damaged files make the libraries fail then.
ArraySource* OpenMatArrays(const std::string& path);
ArraySource* OpenHdfArrays(const std::string& path);
void PrepareHdf();

}  // namespace thicklens::io

#endif  // THICKLENS_TOOLS_IO_ARRAYS_ARRAYS_H_
