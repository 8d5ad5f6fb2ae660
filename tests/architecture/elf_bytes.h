#ifndef THICKLENS_TESTS_ARCHITECTURE_ELF_BYTES_H_
#define THICKLENS_TESTS_ARCHITECTURE_ELF_BYTES_H_

#include <elf.h>

#include <cstddef>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <optional>
#include <string>

namespace thicklens::architecture {

// Returns the structure of an ELF file at the offset, or nothing if the file ends before it does.
template <typename T>
std::optional<T> At(const std::string& bytes, std::size_t offset) {
  T value;
  if (offset > bytes.size() || bytes.size() - offset < sizeof value) return std::nullopt;
  std::memcpy(&value, bytes.data() + offset, sizeof value);
  return value;
}

// Returns the text at the offset, without the 0 that ends it.
inline std::string TextAt(const std::string& bytes, std::size_t offset) {
  if (offset >= bytes.size()) return "";
  return {bytes.c_str() + offset, ::strnlen(bytes.c_str() + offset, bytes.size() - offset)};
}

// Returns the header of an ELF file of this machine's kind, or nothing for any other file.
inline std::optional<Elf64_Ehdr> HeaderOf(const std::string& bytes) {
  const auto header = At<Elf64_Ehdr>(bytes, 0);
  if (!header || std::memcmp(header->e_ident, ELFMAG, SELFMAG) != 0 ||
      header->e_ident[EI_CLASS] != ELFCLASS64 || header->e_ident[EI_DATA] != ELFDATA2LSB) {
    return std::nullopt;
  }
  return header;
}

// Returns the content of an ELF file, or an empty string for any other file.
inline std::string BytesOf(const std::filesystem::path& path) {
  std::ifstream file(path, std::ios::binary);
  char magic[SELFMAG] = {};
  if (!file.read(magic, SELFMAG) || std::memcmp(magic, ELFMAG, SELFMAG) != 0) return "";
  file.seekg(0);
  return {std::istreambuf_iterator<char>(file), {}};
}

}  // namespace thicklens::architecture

#endif  // THICKLENS_TESTS_ARCHITECTURE_ELF_BYTES_H_
