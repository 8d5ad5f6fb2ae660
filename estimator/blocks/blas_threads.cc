#include <dlfcn.h>
#include <fmt/format.h>
#include <sys/mman.h>

#include <algorithm>
#include <cstddef>
#include <filesystem>
#include <string>
#include <system_error>

#include "thicklens/estimator/blas.h"

namespace thicklens::estimator {
namespace {

// Returns a function in `scope`, or null. Functions are looked up by name because the BLAS of this
// process is known only at run time.
template <typename Function>
Function* Find(const char* name, void* scope = RTLD_DEFAULT) {
  return reinterpret_cast<Function*>(::dlsym(scope, name));
}

std::string TrueName(const char* file) {
  std::error_code failure;
  const auto path = std::filesystem::canonical(file, failure);
  return failure ? file : path.string();
}

// Names the BLAS of a library and what it depends on. Another BLAS may be in the process as well.
std::string NameOf(void* library, const std::string& file) {
  if (const auto config = Find<char*()>("openblas_get_config", library)) {
    std::string name = config();  // begins with "OpenBLAS" and the version
    while (!name.empty() && name.back() == ' ') name.pop_back();
    const auto threads = Find<int()>("openblas_get_num_threads", library);
    return threads == nullptr ? name : fmt::format("{}, threads: {}", name, threads());
  }
  std::string name = file.find("/blas/") == std::string::npos ? "BLAS" : "reference BLAS";
  if (Find<void()>("ATL_dgemm", library) != nullptr) name = "ATLAS";
  if (Find<void()>("MKL_Get_Version", library) != nullptr) name = "MKL";
  if (Find<void()>("openblas_get_config") != nullptr) {
    name += ", which takes precedence over the OpenBLAS that is also loaded";
  }
  return name;
}

}  // namespace

std::string BlasDescription() {
  Dl_info known;
  void* const dgemm = ::dlsym(RTLD_DEFAULT, "dgemm_");
  if (dgemm == nullptr || ::dladdr(dgemm, &known) == 0 || known.dli_fname == nullptr) return "none";
  const std::string file = TrueName(known.dli_fname);
  void* const library = ::dlopen(known.dli_fname, RTLD_LAZY | RTLD_NOLOAD);
  // A BLAS without a library of its own is part of the program.
  const std::string name = NameOf(library == nullptr ? RTLD_DEFAULT : library, file);
  if (library != nullptr) ::dlclose(library);
  return fmt::format("{} ({})", name, file);
}

void KeepBlasToOneThread() {
  const auto threads = Find<int()>("openblas_get_num_threads");
  const auto set_threads = Find<void(int)>("openblas_set_num_threads");
  const auto end = Find<int()>("blas_thread_shutdown_");  // what OpenBLAS does before a fork
  if (threads == nullptr || set_threads == nullptr) return;
  const int before = threads();
  set_threads(1);
  // A thread starts by allocating this much memory. If there is enough for all threads, each gets
  // it.
  constexpr std::size_t kBytesOfThread = std::size_t{128} << 20;
  const std::size_t bytes = static_cast<std::size_t>(std::max(1, before)) * kBytesOfThread;
  void* const free = ::mmap(nullptr, bytes, PROT_READ | PROT_WRITE,
                            MAP_PRIVATE | MAP_ANONYMOUS | MAP_NORESERVE, -1, 0);
  if (free == MAP_FAILED) return;
  ::munmap(free, bytes);
  if (end != nullptr) end();
}

OneBlasThread::OneBlasThread() {
  const auto threads = Find<int()>("openblas_get_num_threads");
  const auto set_threads = Find<void(int)>("openblas_set_num_threads");
  if (threads == nullptr || set_threads == nullptr) return;
  // Setting the number starts the threads of a BLAS that has none, whatever the number is.
  if (threads() == 1) return;
  threads_before_ = threads();
  set_threads(1);
}

OneBlasThread::~OneBlasThread() {
  if (threads_before_ > 0) Find<void(int)>("openblas_set_num_threads")(threads_before_);
}

}  // namespace thicklens::estimator
