#include "tools/io/plain_tiff.h"

#include <gtest/gtest.h>

#include <filesystem>
#include <opencv2/imgcodecs.hpp>
#include <random>
#include <string>
#include <utility>
#include <vector>

#include "support/temporary_folder.h"
#include "thicklens/base/error.h"

namespace thicklens::io {
namespace {

using testing::TemporaryFolder;

model::LinearImage Noise(int width, int height, int channels) {
  model::LinearImage image{width, height, channels, {}};
  std::mt19937 engine(2);
  std::uniform_real_distribution<float> uniform(-0.5F, 3.0F);
  for (int i = 0; i < width * height * channels; ++i) image.values.push_back(uniform(engine));
  return image;
}

// Another library reads the files. The sizes are one pixel, one row, several strips, and strips
// that do not divide the height.
TEST(FloatTiff, IsReadBackBitForBit) {
  TemporaryFolder folder;
  for (const int channels : {1, 3}) {
    for (const auto& [width, height] :
         std::vector<std::pair<int, int>>{{1, 1}, {5, 3}, {1, 70000}, {70000, 2}, {301, 407}}) {
      SCOPED_TRACE(std::to_string(width) + "x" + std::to_string(height));
      const model::LinearImage image = Noise(width, height, channels);
      const std::string path = folder.Put("view.tiff");
      WriteFloatTiff(image, path, "view.tiff");
      const cv::Mat read = cv::imread(path, cv::IMREAD_UNCHANGED);
      ASSERT_EQ(read.type(), CV_32FC(channels));
      ASSERT_EQ(read.cols, width);
      ASSERT_EQ(read.rows, height);
      for (int y = 0; y < height; ++y) {
        for (int x = 0; x < width; ++x) {
          for (int c = 0; c < channels; ++c) {  // blue comes first there
            ASSERT_EQ(read.ptr<float>(y)[channels * x + channels - 1 - c], image.at(x, y, c));
          }
        }
      }
    }
  }
}

TEST(FloatTiff, HoldsLittleBesidesTheValues) {
  TemporaryFolder folder;
  const std::string path = folder.Put("view.tiff");
  WriteFloatTiff(Noise(301, 407, 3), path, "view.tiff");
  EXPECT_LT(std::filesystem::file_size(path), 4u * 3 * 301 * 407 + 1000);
  EXPECT_GT(std::filesystem::file_size(path), 4u * 3 * 301 * 407);
}

TEST(FloatTiff, WriteErrorsHaveTheNameThatIsShown) {
  TemporaryFolder folder;
  const auto message = [&](const std::string& path) {
    try {
      WriteFloatTiff(Noise(301, 407, 3), path, "lf/view.tiff");
    } catch (const Error& error) {
      return std::string(error.what());
    }
    return std::string();
  };
  EXPECT_EQ(message(folder.Put("view.tiff") + "/none"),
            "lf/view.tiff: cannot be written: Not a directory");
  if (std::filesystem::exists("/dev/full")) {
    EXPECT_EQ(message("/dev/full"), "lf/view.tiff: cannot be written: No space left on device");
  }
}

}  // namespace
}  // namespace thicklens::io
