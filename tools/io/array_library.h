#ifndef THICKLENS_TOOLS_IO_ARRAY_LIBRARY_H_
#define THICKLENS_TOOLS_IO_ARRAY_LIBRARY_H_

#include <cstddef>
#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <utility>
#include <vector>

namespace thicklens::io {

// The numbers of an array that are read.
enum class StoredNumber : std::uint8_t {
  kOther,  // any other type, text or structures
  kUint8,
  kUint16,
  kFloat,
  kDouble,
};

// An array in a file, without its numbers.
struct StoredArray {
  std::string name;  // "LF"
  // Elements along each axis. The axis along which neighbours in the file lie is the first, as
  // Matlab has it; numpy and h5dump name the axes in the opposite order.
  std::vector<std::uint64_t> size;
  StoredNumber number = StoredNumber::kOther;
  std::string type;  // in words, "signed 16-bit integers"
};

// The contents of a file of arrays.
struct StoredFile {
  std::vector<StoredArray> arrays;
  std::vector<std::pair<std::string, double>> numbers;  // attributes of the file that are numbers
  // Matlab's Light Field Toolbox: the optional steps that were applied
  // (DecodeOptions.OptionalTasks, such as ColourCorrect). Absent: the file does not state it.
  std::optional<std::vector<std::string>> tasks;
};

// The formats of files of arrays.
enum class ArrayFormat : std::uint8_t {
  kMat,   // Matlab, MAT 5 or MAT 7.3
  kHdf5,  // any other HDF5 file
};

// libhdf5 and a reader of MAT 5 files, in a library of their own, which is loaded when a file first
// needs it. array_file.h calls these functions in a process of their own, because damaged files
// make libhdf5 read and write outside of its memory. `why` gets the reason of a failure.
struct ArrayLibrary {
  // Makes the libraries ready before that process begins.
  void (*prepare)();
  // Returns null if the file cannot be read. The result is never closed.
  void* (*open)(const std::string& path, ArrayFormat format, StoredFile* content, std::string* why);
  // Passes all numbers of an array to `put`, in the byte order of the machine and in their order.
  bool (*read)(void* file, const std::string& name,
               const std::function<void(const void* bytes, std::size_t count)>& put,
               std::string* why);
};

// Bytes of one number; 0 for kOther.
constexpr std::size_t BytesOf(StoredNumber number) {
  return number == StoredNumber::kUint8    ? 1
         : number == StoredNumber::kUint16 ? 2
         : number == StoredNumber::kFloat  ? 4
         : number == StoredNumber::kDouble ? 8
                                           : 0;
}

}  // namespace thicklens::io

#endif  // THICKLENS_TOOLS_IO_ARRAY_LIBRARY_H_
