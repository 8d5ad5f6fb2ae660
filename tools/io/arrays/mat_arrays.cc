// Variables of Matlab's files. MAT 7.3 is read as the HDF5 file that it is. MAT 5 is read here and
// not by libmatio 1.5.23, which returns zeros for the rest of a truncated file, and the bytes of
// other variables if a variable states more numbers than it has. The format is that of MathWorks'
// "MAT-File Format": elements of a type, a length and so many bytes.
#include <fcntl.h>
#include <hdf5.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <unistd.h>
#include <zlib.h>

#include <algorithm>
#include <array>
#include <cstring>
#include <limits>
#include <memory>
#include <set>

#include "tools/io/arrays/arrays.h"

namespace thicklens::io {
namespace {

constexpr std::size_t kHeaderBytes = 128;
constexpr std::size_t kMaxVariables = 1000;
constexpr std::size_t kMaxAxes = 32;
constexpr std::size_t kMaxLetters = 200;
// Bytes of a variable that are inflated to find its name and size, and those of a structure.
constexpr std::size_t kStartBytes = 4096;
// After a variable, in its compressed bytes.
constexpr std::size_t kPaddingBytes = 8;
constexpr std::size_t kMaxOptionsBytes = std::size_t{64} << 20;

// Types of elements, and classes of variables.
enum MatType : std::uint32_t {
  kMiInt8 = 1,
  kMiUint8 = 2,
  kMiInt16 = 3,
  kMiUint16 = 4,
  kMiInt32 = 5,
  kMiUint32 = 6,
  kMiSingle = 7,
  kMiDouble = 9,
  kMiMatrix = 14,
  kMiCompressed = 15,
  kMiUtf8 = 16,
};
enum MatClass : std::uint32_t {
  kMxCell = 1,
  kMxStruct = 2,
  kMxChar = 4,
  kMxDouble = 6,
  kMxSingle = 7,
  kMxUint8 = 9,
  kMxUint16 = 11,
};

struct Bytes {
  const unsigned char* first = nullptr;
  std::size_t count = 0;
};
struct Element {
  std::uint32_t type = 0;
  Bytes data;
};

template <typename Number>
Number NumberAt(const unsigned char* at, bool is_swapped) {
  std::array<unsigned char, sizeof(Number)> bytes;
  std::copy(at, at + sizeof(Number), bytes.begin());
  if (is_swapped) std::reverse(bytes.begin(), bytes.end());
  Number number;
  std::memcpy(&number, bytes.data(), sizeof number);
  return number;
}

// Elements that follow each other.
class Elements {
 public:
  Elements(Bytes bytes, bool is_swapped) : bytes_(bytes), is_swapped_(is_swapped) {}

  bool AtEnd() const { return at_ >= bytes_.count; }
  // With `may_end` the bytes are the start of more, and the element may end beyond them.
  Element Next(bool may_end = false) {
    constexpr std::size_t kTag = 8, kSmall = 4;
    if (bytes_.count - at_ < kTag) throw ArrayRefusal("it ends within a variable");
    const unsigned char* const tag = bytes_.first + at_;
    Element element;
    element.type = NumberAt<std::uint32_t>(tag, is_swapped_);
    // An element of at most 4 bytes has them in its tag.
    if (element.type >> 16U != 0) {
      element.data = {tag + kSmall, element.type >> 16U};
      element.type &= 0xFFFFU;
      if (element.data.count > kSmall) throw ArrayRefusal("an element has a wrong length");
      at_ += kTag;
      return element;
    }
    std::size_t length = NumberAt<std::uint32_t>(tag + kSmall, is_swapped_);
    const std::size_t left = bytes_.count - at_ - kTag;
    if (length > left && !may_end) {
      throw ArrayRefusal("it ends within a variable: " + std::to_string(length) +
                         " bytes are stated, " + std::to_string(left) + " are left");
    }
    length = std::min(length, left);
    element.data = {tag + kTag, length};
    const std::size_t padded = element.type == kMiCompressed ? length : (length + 7) / 8 * 8;
    at_ = std::min(bytes_.count, at_ + kTag + padded);
    return element;
  }
  Element Next(std::uint32_t type, const char* what) {
    const Element element = Next();
    if (element.type != type) throw ArrayRefusal(std::string("a variable has no ") + what);
    return element;
  }

 private:
  Bytes bytes_;
  std::size_t at_ = 0;
  bool is_swapped_ = false;
};

// The head of a variable, and the place where its contents follow.
struct Variable {
  std::uint32_t kind = 0;
  bool is_complex = false, is_logical = false;
  std::vector<std::uint64_t> size;
  std::string name;
  Elements contents;

  std::uint64_t Count() const {
    std::uint64_t count = 1;
    for (const std::uint64_t along : size) {
      if (along > 0 && count > std::numeric_limits<std::uint64_t>::max() / along)
        throw ArrayRefusal(name + " is too large");
      count *= along;
    }
    return count;
  }
};

Variable VariableOf(Bytes matrix, bool is_swapped) {
  Variable variable{0, false, false, {}, "", Elements(matrix, is_swapped)};
  Elements& elements = variable.contents;
  const Element flags = elements.Next(kMiUint32, "flags");
  if (flags.data.count != 8) throw ArrayRefusal("a variable has no flags");
  const auto bits = NumberAt<std::uint32_t>(flags.data.first, is_swapped);
  variable.kind = bits & 0xFFU;
  variable.is_complex = (bits & 0x800U) != 0;
  variable.is_logical = (bits & 0x200U) != 0;
  const Element size = elements.Next(kMiInt32, "size");
  if (size.data.count / 4 > kMaxAxes) throw ArrayRefusal("a variable has too many axes");
  for (std::size_t i = 0; i + 4 <= size.data.count; i += 4) {
    const auto count = NumberAt<std::int32_t>(size.data.first + i, is_swapped);
    if (count < 0) throw ArrayRefusal("a variable has a negative size");
    variable.size.push_back(static_cast<std::uint64_t>(count));
  }
  const Element name = elements.Next();
  variable.name.assign(reinterpret_cast<const char*>(name.data.first),
                       std::min(name.data.count, kMaxLetters));
  return variable;
}

StoredNumber NumberOf(const Variable& variable) {
  if (variable.is_complex || variable.is_logical) return StoredNumber::kOther;
  switch (variable.kind) {
    case kMxUint8:
      return StoredNumber::kUint8;
    case kMxUint16:
      return StoredNumber::kUint16;
    case kMxSingle:
      return StoredNumber::kFloat;
    case kMxDouble:
      return StoredNumber::kDouble;
    default:
      return StoredNumber::kOther;
  }
}

std::string WordsOf(const Variable& variable) {
  if (variable.is_complex) return "complex numbers";
  if (variable.is_logical) return "logical values";
  constexpr std::array<const char*, 16> kWords = {"no numbers",
                                                  "cells",
                                                  "a structure",
                                                  "an object",
                                                  "text",
                                                  "a sparse matrix",
                                                  "64-bit floats",
                                                  "32-bit floats",
                                                  "signed 8-bit integers",
                                                  "unsigned 8-bit integers",
                                                  "signed 16-bit integers",
                                                  "unsigned 16-bit integers",
                                                  "signed 32-bit integers",
                                                  "unsigned 32-bit integers",
                                                  "signed 64-bit integers",
                                                  "unsigned 64-bit integers"};
  return kWords[variable.kind < kWords.size() ? variable.kind : 0];
}

// Bytes of a number of an element; 0: none.
std::size_t BytesOfType(std::uint32_t type) {
  switch (type) {
    case kMiInt8:
    case kMiUint8:
    case kMiUtf8:
      return 1;
    case kMiInt16:
    case kMiUint16:
      return 2;
    case kMiInt32:
    case kMiUint32:
    case kMiSingle:
      return 4;
    case kMiDouble:
      return 8;
    default:
      return 0;
  }
}

double ValueAt(const unsigned char* at, std::uint32_t type, bool is_swapped) {
  switch (type) {
    case kMiInt8:
      return static_cast<signed char>(*at);
    case kMiInt16:
      return NumberAt<std::int16_t>(at, is_swapped);
    case kMiUint16:
      return NumberAt<std::uint16_t>(at, is_swapped);
    case kMiInt32:
      return NumberAt<std::int32_t>(at, is_swapped);
    case kMiUint32:
      return NumberAt<std::uint32_t>(at, is_swapped);
    case kMiSingle:
      return static_cast<double>(NumberAt<float>(at, is_swapped));
    case kMiDouble:
      return NumberAt<double>(at, is_swapped);
    default:
      return *at;
  }
}

// Passes the numbers on as those of the variable's class: Matlab stores them in the smallest type
// that holds all of them.
template <typename Number>
void PutAs(const Element& element, bool is_swapped, const PutBytes& put) {
  const std::size_t each = BytesOfType(element.type);
  std::vector<Number> numbers(element.data.count / each);
  for (std::size_t i = 0; i < numbers.size(); ++i) {
    const double value = ValueAt(element.data.first + i * each, element.type, is_swapped);
    if constexpr (std::numeric_limits<Number>::is_integer) {
      if (!(value >= 0 && value <= std::numeric_limits<Number>::max()))
        throw ArrayRefusal("a number does not fit into its type");
    }
    numbers[i] = static_cast<Number>(value);
  }
  put(numbers.data(), numbers.size() * sizeof(Number));
}

std::string TextOf(Bytes matrix, bool is_swapped) {
  Variable text = VariableOf(matrix, is_swapped);
  if (text.kind != kMxChar || text.Count() > kMaxLetters || text.contents.AtEnd()) return "";
  const Element letters = text.contents.Next();
  const std::size_t each = BytesOfType(letters.type);
  std::string result;
  for (std::size_t i = 0; each > 0 && i + each <= letters.data.count; i += each) {
    result += static_cast<char>(
        static_cast<int>(ValueAt(letters.data.first + i, letters.type, is_swapped)) & 0x7F);
  }
  return result;
}

enum class Inflate {
  kStart,  // the first bytes only: they may be damaged
  kWhole   // to the end of the stream, whose checksum is then right; padding is left out
};

// Inflates at most so many bytes.
std::vector<unsigned char> Inflated(Bytes compressed, std::size_t most_bytes, Inflate part) {
  std::vector<unsigned char> bytes(most_bytes);
  std::array<unsigned char, 4096> beyond;
  z_stream stream{};
  if (inflateInit(&stream) != Z_OK) throw ArrayRefusal("zlib cannot begin");
  const std::unique_ptr<z_stream, int (*)(z_stream*)> end(&stream, inflateEnd);
  std::size_t in = 0, out = 0, beyond_out = 0;
  int result = Z_OK;
  while (result == Z_OK && (part == Inflate::kWhole || out < bytes.size())) {
    constexpr std::size_t kAtOnce = std::size_t{1} << 28;
    const bool is_beyond = out == bytes.size();
    const std::size_t in_now = std::min(compressed.count - in, kAtOnce);
    const std::size_t out_now = is_beyond ? beyond.size() : std::min(bytes.size() - out, kAtOnce);
    stream.next_in = const_cast<unsigned char*>(compressed.first + in);  // NOLINT: zlib reads it
    stream.avail_in = static_cast<uInt>(in_now);
    stream.next_out = is_beyond ? beyond.data() : bytes.data() + out;
    stream.avail_out = static_cast<uInt>(out_now);
    result = inflate(&stream, Z_NO_FLUSH);
    in += in_now - stream.avail_in;
    (is_beyond ? beyond_out : out) += out_now - stream.avail_out;
    // A stream may go on for a thousand times its size.
    if (beyond_out > kPaddingBytes)
      throw ArrayRefusal("the compressed bytes of a variable hold more than it states");
  }
  if (result != Z_OK && result != Z_STREAM_END && result != Z_BUF_ERROR)
    throw ArrayRefusal("the compressed bytes of a variable are damaged");
  if (part == Inflate::kWhole && result != Z_STREAM_END)
    throw ArrayRefusal("it ends within the compressed bytes of a variable");
  bytes.resize(out);
  return bytes;
}

class MatArrays : public ArraySource {
 public:
  explicit MatArrays(const std::string& path) {
    const int file = open(path.c_str(), O_RDONLY | O_CLOEXEC);
    struct stat status {};
    if (file < 0 || fstat(file, &status) != 0) throw ArrayRefusal("it cannot be opened");
    bytes_.count = static_cast<std::size_t>(status.st_size);
    if (bytes_.count < kHeaderBytes) throw ArrayRefusal("it ends within its header");
    void* const map = mmap(nullptr, bytes_.count, PROT_READ, MAP_PRIVATE, file, 0);
    if (map == MAP_FAILED) throw ArrayRefusal("it cannot be mapped into memory");
    bytes_.first = static_cast<const unsigned char*>(map);
    // "IM" by a machine with the lowest byte first, as all on which this program runs.
    is_swapped_ = bytes_.first[kHeaderBytes - 2] == 'M';
  }

  StoredFile Content() override {
    StoredFile content;
    std::set<std::string> names;
    Elements elements({bytes_.first + kHeaderBytes, bytes_.count - kHeaderBytes}, is_swapped_);
    while (!elements.AtEnd() && elements_.size() < kMaxVariables) {
      const Element element = elements.Next();
      if (element.type != kMiCompressed && element.type != kMiMatrix) continue;
      if (element.data.count == 0) continue;
      std::vector<unsigned char> start;
      const Variable variable = VariableOf(StartOf(element, &start), is_swapped_);
      // Read finds a variable by its name.
      if (!names.insert(variable.name).second)
        throw ArrayRefusal("two of its variables have the name '" + variable.name + "'");
      content.arrays.push_back(
          {variable.name, variable.size, NumberOf(variable), WordsOf(variable)});
      elements_.push_back(element);
    }
    for (std::size_t i = 0; i < elements_.size(); ++i) {
      if (content.arrays[i].name != "DecodeOptions") continue;
      std::vector<unsigned char> whole;
      content.tasks = TasksOf(WholeOf(elements_[i], kMaxOptionsBytes, &whole));
    }
    return content;
  }

  void Read(const std::string& name, const PutBytes& put) override {
    for (const Element& element : elements_) {
      std::vector<unsigned char> start, whole;
      if (VariableOf(StartOf(element, &start), is_swapped_).name != name) continue;
      const Bytes matrix = WholeOf(element, std::numeric_limits<std::uint32_t>::max(), &whole);
      Variable variable = VariableOf(matrix, is_swapped_);
      const Element numbers = variable.contents.Next();
      const std::size_t each = BytesOfType(numbers.type);
      if (each == 0 || numbers.data.count % each != 0 ||
          numbers.data.count / each != variable.Count()) {
        throw ArrayRefusal("the size of " + name + " states " + std::to_string(variable.Count()) +
                           " numbers, its data are " + std::to_string(numbers.data.count) +
                           " bytes");
      }
      Put(numbers, NumberOf(variable), put);
      return;
    }
    throw ArrayRefusal(name + " is not in it");
  }

 private:
  // The first bytes of a variable's contents.
  Bytes StartOf(const Element& element, std::vector<unsigned char>* bytes) const {
    if (element.type == kMiMatrix) return element.data;
    *bytes = Inflated(element.data, kStartBytes, Inflate::kStart);
    return Elements({bytes->data(), bytes->size()}, is_swapped_).Next(true).data;
  }

  // All bytes of a variable's contents.
  Bytes WholeOf(const Element& element, std::size_t most_bytes,
                std::vector<unsigned char>* bytes) const {
    if (element.type == kMiMatrix) return element.data;
    constexpr std::size_t kTag = 8, kMaxOfAByte = 1032;
    const std::vector<unsigned char> tag = Inflated(element.data, kTag, Inflate::kStart);
    if (tag.size() < kTag) throw ArrayRefusal("it ends within a variable");
    const std::size_t length = NumberAt<std::uint32_t>(tag.data() + 4, is_swapped_);
    if (length > most_bytes || length / kMaxOfAByte > element.data.count) {
      throw ArrayRefusal(std::to_string(element.data.count) + " bytes cannot hold the " +
                         std::to_string(length) + " bytes of a variable");
    }
    *bytes = Inflated(element.data, kTag + length, Inflate::kWhole);
    const Element matrix = Elements({bytes->data(), bytes->size()}, is_swapped_).Next();
    if (matrix.type != kMiMatrix) throw ArrayRefusal("compressed bytes hold no variable");
    return matrix.data;
  }

  void Put(const Element& numbers, StoredNumber number, const PutBytes& put) const {
    const bool is_as_stored = (number == StoredNumber::kUint8 && numbers.type == kMiUint8) ||
                              (number == StoredNumber::kUint16 && numbers.type == kMiUint16) ||
                              (number == StoredNumber::kFloat && numbers.type == kMiSingle) ||
                              (number == StoredNumber::kDouble && numbers.type == kMiDouble);
    if (is_as_stored && !is_swapped_) return put(numbers.data.first, numbers.data.count);
    switch (number) {
      case StoredNumber::kUint8:
        return PutAs<std::uint8_t>(numbers, is_swapped_, put);
      case StoredNumber::kUint16:
        return PutAs<std::uint16_t>(numbers, is_swapped_, put);
      case StoredNumber::kFloat:
        return PutAs<float>(numbers, is_swapped_, put);
      case StoredNumber::kDouble:
        return PutAs<double>(numbers, is_swapped_, put);
      default:
        throw ArrayRefusal("it has no numbers");
    }
  }

  // The texts in the cells of the field OptionalTasks; absent if there is no such field.
  std::optional<std::vector<std::string>> TasksOf(Bytes matrix) const {
    Variable options = VariableOf(matrix, is_swapped_);
    if (options.kind != kMxStruct) return std::nullopt;
    const Element length = options.contents.Next(kMiInt32, "length of names");
    const Element names = options.contents.Next(kMiInt8, "names of fields");
    const std::size_t each =
        length.data.count == 4 ? NumberAt<std::uint32_t>(length.data.first, is_swapped_) : 0;
    for (std::size_t at = 0; each > 0 && at + each <= names.data.count; at += each) {
      const Element field = options.contents.Next(kMiMatrix, "fields");
      const auto* const letters = reinterpret_cast<const char*>(names.data.first + at);
      if (std::string(letters, strnlen(letters, each)) != "OptionalTasks") continue;
      std::vector<std::string> tasks;
      if (field.data.count == 0) return tasks;
      Variable cells = VariableOf(field.data, is_swapped_);
      if (cells.kind == kMxChar) tasks.push_back(TextOf(field.data, is_swapped_));
      while (cells.kind == kMxCell && !cells.contents.AtEnd()) {
        const Element cell = cells.contents.Next(kMiMatrix, "cells");
        if (cell.data.count > 0) tasks.push_back(TextOf(cell.data, is_swapped_));
      }
      return tasks;
    }
    return std::nullopt;
  }

  Bytes bytes_;
  bool is_swapped_ = false;
  std::vector<Element> elements_;
};

}  // namespace

ArraySource* OpenMatArrays(const std::string& path) {
  if (H5Fis_hdf5(path.c_str()) > 0) return OpenHdfArrays(path);
  return new MatArrays(path);
}

}  // namespace thicklens::io
