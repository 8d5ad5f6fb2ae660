#include "architecture/symbol_rules.h"

#include <cxxabi.h>

#include <cstdlib>
#include <map>
#include <memory>
#include <regex>

#include "architecture/elf_bytes.h"

namespace thicklens::architecture {
namespace {

// Calls use(symbol, name) for each symbol of the tables of one type (SHT_SYMTAB, SHT_DYNSYM) that
// is not local.
template <typename Use>
void ForEachSymbol(const std::string& bytes, const Elf64_Ehdr& header, Elf64_Word type,
                   const Use& use) {
  // If a file has very many sections, their number is stored in the first one.
  std::size_t sections = header.e_shnum;
  if (sections == 0) {
    const auto first = At<Elf64_Shdr>(bytes, header.e_shoff);
    if (first) sections = first->sh_size;
  }
  for (std::size_t i = 0; i < sections; ++i) {
    const auto section = At<Elf64_Shdr>(bytes, header.e_shoff + i * sizeof(Elf64_Shdr));
    if (!section || section->sh_type != type) continue;
    const auto names =
        At<Elf64_Shdr>(bytes, header.e_shoff + section->sh_link * sizeof(Elf64_Shdr));
    if (!names) continue;
    for (std::size_t at = 0; at + sizeof(Elf64_Sym) <= section->sh_size; at += sizeof(Elf64_Sym)) {
      const auto symbol = At<Elf64_Sym>(bytes, section->sh_offset + at);
      if (!symbol) break;
      if (ELF64_ST_BIND(symbol->st_info) == STB_LOCAL) continue;
      use(*symbol, TextAt(bytes, names->sh_offset + symbol->st_name));
    }
  }
}

}  // namespace

std::string Demangled(const std::string& name) {
  int status = 0;
  const std::unique_ptr<char, void (*)(void*)> text(
      abi::__cxa_demangle(name.c_str(), nullptr, nullptr, &status), std::free);
  return status == 0 ? text.get() : name;
}

std::optional<ObjectSymbols> ReadObject(const std::string& bytes) {
  const auto header = HeaderOf(bytes);
  if (!header || header->e_type != ET_REL) return std::nullopt;
  ObjectSymbols symbols;
  ForEachSymbol(bytes, *header, SHT_SYMTAB, [&](const Elf64_Sym& symbol, const std::string& name) {
    (symbol.st_shndx == SHN_UNDEF ? symbols.used : symbols.defined).insert(name);
  });
  return symbols;
}

std::optional<std::set<std::string>> ReadExportedSymbols(const std::string& bytes) {
  const auto header = HeaderOf(bytes);
  if (!header || header->e_type != ET_DYN) return std::nullopt;
  std::set<std::string> exported;
  ForEachSymbol(bytes, *header, SHT_DYNSYM, [&](const Elf64_Sym& symbol, const std::string& name) {
    if (symbol.st_shndx != SHN_UNDEF) exported.insert(name);
  });
  return exported;
}

std::string SourceOfObject(const std::string& object) {
  static const std::regex form(R"(^(.+)/CMakeFiles/[^/]+\.dir/(.+)\.o$)");
  std::smatch part;
  if (!std::regex_match(object, part, form)) return "";
  return part[1].str() + "/" + part[2].str();
}

std::vector<std::string> WrongArrows(const std::vector<ObjectSymbols>& objects,
                                     const RoomsTable& table) {
  std::map<std::string, std::vector<std::string>> definers;
  for (const ObjectSymbols& object : objects) {
    for (const std::string& name : object.defined) definers[name].push_back(object.source);
  }
  std::vector<std::string> wrong;
  for (const ObjectSymbols& object : objects) {
    const std::optional<std::string> room = table.RoomOf(object.source);
    if (!room) continue;
    for (const std::string& name : object.used) {
      const auto found = definers.find(name);
      if (found == definers.end() || found->second.size() != 1) continue;
      const std::optional<std::string> other = table.RoomOf(found->second.front());
      if (!other || table.MayInclude(*room, *other)) continue;
      wrong.push_back(object.source + ": uses " + Demangled(name) + " of " + found->second.front() +
                      "; the arrow " + *room + " -> " + *other + " is wrong; of ours, " + *room +
                      " may include: itself, " + table.WhatMayInclude(*room));
    }
  }
  return wrong;
}

}  // namespace thicklens::architecture
