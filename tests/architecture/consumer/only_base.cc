// A program that links thicklens::base and no other library of the package by name.
#include <cstdio>

#include "thicklens/base/error.h"
#include "thicklens/base/output_file.h"

namespace {

// Throws in the library, and catches here.
bool Works() {
  try {
    thicklens::ReadWholeFile("no such file");
  } catch (const thicklens::Error&) {
    return true;
  }
  return false;
}

}  // namespace

int main() {
  if (Works()) return 0;
  std::fprintf(stderr, "thicklens::base does not work\n");
  return 1;
}
