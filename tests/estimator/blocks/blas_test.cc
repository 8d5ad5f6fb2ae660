#include "thicklens/estimator/blas.h"

#include <dlfcn.h>
#include <gtest/gtest.h>

#include <cstddef>
#include <cstdlib>
#include <filesystem>
#include <iterator>
#include <string>
#include <vector>

#include "support/sanitizers.h"

namespace thicklens::estimator {
namespace {

TEST(BlasDescription, NamesTheFile) {
  const std::string blas = BlasDescription();
  if (blas == "none") GTEST_SKIP() << "no BLAS in this program";
  const std::size_t begin = blas.rfind('(');
  ASSERT_NE(begin, std::string::npos) << blas;
  EXPECT_GT(begin, 0U);
  ASSERT_EQ(blas.back(), ')') << blas;
  EXPECT_TRUE(std::filesystem::exists(blas.substr(begin + 1, blas.size() - begin - 2))) << blas;
  EXPECT_EQ(blas.find('\n'), std::string::npos);
}

TEST(OneBlasThread, IsOneAndThenWhatItWas) {
  const auto threads =
      reinterpret_cast<int (*)()>(::dlsym(RTLD_DEFAULT, "openblas_get_num_threads"));
  const auto set_threads =
      reinterpret_cast<void (*)(int)>(::dlsym(RTLD_DEFAULT, "openblas_set_num_threads"));
  if (threads == nullptr || set_threads == nullptr) GTEST_SKIP() << "no OpenBLAS in this program";
  set_threads(2);
  const int before = threads();
  {
    const OneBlasThread outer;
    EXPECT_EQ(threads(), 1);
    {
      const OneBlasThread inner;
      EXPECT_EQ(threads(), 1);
    }
    EXPECT_EQ(threads(), 1);
  }
  EXPECT_EQ(threads(), before);
}

int ThreadsOfProcess() {
  const std::filesystem::directory_iterator tasks("/proc/self/task");
  return static_cast<int>(std::distance(begin(tasks), end(tasks)));
}

// C += A B, all of ones; so large that OpenBLAS would use threads for it.
void CheckProduct(int size) {
  using Gemm = void (*)(const char*, const char*, const int*, const int*, const int*, const double*,
                        const double*, const int*, const double*, const int*, const double*,
                        double*, const int*);
  const auto dgemm = reinterpret_cast<Gemm>(::dlsym(RTLD_DEFAULT, "dgemm_"));
  ASSERT_NE(dgemm, nullptr);
  const std::vector<double> ones(static_cast<std::size_t>(size) * static_cast<std::size_t>(size),
                                 1);
  std::vector<double> sums = ones;
  const double one = 1;
  dgemm("N", "N", &size, &size, &size, &one, ones.data(), &size, ones.data(), &size, &one,
        sums.data(), &size);
  for (const double sum : sums) ASSERT_EQ(sum, size + 1);
}

// Alone in a process, where no other test's threads are.
TEST(KeepBlasToOneThread, LeavesNoneThatWaits) {
  if (::dlsym(RTLD_DEFAULT, "blas_thread_shutdown_") == nullptr) GTEST_SKIP() << "no OpenBLAS";
  if (thicklens::testing::kIsSanitized) GTEST_SKIP() << "a sanitizer has threads of its own";
  GTEST_FLAG_SET(death_test_style, "threadsafe");
  EXPECT_EXIT(
      {
        KeepBlasToOneThread();
        EXPECT_EQ(ThreadsOfProcess(), 1);
        {
          const OneBlasThread of_blocks;
          CheckProduct(400);
        }
        EXPECT_EQ(ThreadsOfProcess(), 1);
        KeepBlasToOneThread();  // again does no harm
        CheckProduct(400);
        EXPECT_EQ(ThreadsOfProcess(), 1);
        std::_Exit(::testing::Test::HasFailure() ? 1 : 0);
      },
      ::testing::ExitedWithCode(0), "");
}

}  // namespace
}  // namespace thicklens::estimator
