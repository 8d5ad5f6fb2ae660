// A program that links thicklens::kernels and no other library of the package by name.
#include <cstdio>

#include "thicklens/kernels/device.h"

namespace {

bool Works() {
  const auto backend =
      thicklens::kernels::OpenBackend(thicklens::kernels::ParseDeviceRequest("cpu"), nullptr);
  return backend->name() == "cpu";
}

}  // namespace

int main() {
  if (Works()) return 0;
  std::fprintf(stderr, "thicklens::kernels does not work\n");
  return 1;
}
