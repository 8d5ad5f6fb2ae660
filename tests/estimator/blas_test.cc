#include "thicklens/estimator/blas.h"

#include <dlfcn.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <string>

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

}  // namespace
}  // namespace thicklens::estimator
