#include "tools/io/png_pixels.h"

#include <gtest/gtest.h>
#include <spng.h>
#ifdef __linux__
#include <sys/resource.h>
#endif
#include <zlib.h>

#include <algorithm>
#include <cstdint>
#include <cstdlib>
#include <memory>
#include <new>
#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <random>
#include <string>
#include <vector>

#include "tests/support/sanitizers.h"
#include "thicklens/base/error.h"

namespace thicklens::io {
namespace {

// A kind of file that other programs may write.
struct PngKind {
  int colour_type = SPNG_COLOR_TYPE_GRAYSCALE;
  int bits = 8;
  bool interlaced = false;
  bool transparent = false;  // has a tRNS chunk
};

std::string NameOf(const PngKind& kind) {
  return "colour type " + std::to_string(kind.colour_type) + ", " + std::to_string(kind.bits) +
         " bits" + (kind.interlaced ? ", interlaced" : "") +
         (kind.transparent ? ", with tRNS" : "");
}

std::vector<PngKind> AllKinds() {
  std::vector<PngKind> kinds;
  const auto add = [&](int colour_type, const std::vector<int>& depths, bool may_be_transparent) {
    for (const int bits : depths) {
      for (const bool interlaced : {false, true}) {
        kinds.push_back({colour_type, bits, interlaced, false});
        if (may_be_transparent) kinds.push_back({colour_type, bits, interlaced, true});
      }
    }
  };
  add(SPNG_COLOR_TYPE_GRAYSCALE, {1, 2, 4, 8, 16}, true);
  add(SPNG_COLOR_TYPE_TRUECOLOR, {8, 16}, true);
  add(SPNG_COLOR_TYPE_INDEXED, {1, 2, 4, 8}, true);
  add(SPNG_COLOR_TYPE_GRAYSCALE_ALPHA, {8, 16}, false);
  add(SPNG_COLOR_TYPE_TRUECOLOR_ALPHA, {8, 16}, false);
  return kinds;
}

// 13 x 7 px of random values.
std::string RandomFile(const PngKind& kind, unsigned seed) {
  constexpr int kWidthPx = 13, kHeightPx = 7;
  std::mt19937 random(seed);
  const std::unique_ptr<spng_ctx, decltype(&spng_ctx_free)> context(spng_ctx_new(SPNG_CTX_ENCODER),
                                                                    spng_ctx_free);
  spng_set_option(context.get(), SPNG_ENCODE_TO_BUFFER, 1);
  spng_ihdr header{};
  header.width = kWidthPx;
  header.height = kHeightPx;
  header.bit_depth = static_cast<std::uint8_t>(kind.bits);
  header.color_type = static_cast<std::uint8_t>(kind.colour_type);
  header.interlace_method = kind.interlaced ? SPNG_INTERLACE_ADAM7 : SPNG_INTERLACE_NONE;
  EXPECT_EQ(spng_set_ihdr(context.get(), &header), 0);
  if (kind.colour_type == SPNG_COLOR_TYPE_INDEXED) {
    spng_plte palette{};
    palette.n_entries = 1U << kind.bits;
    for (std::uint32_t i = 0; i < palette.n_entries; ++i) {
      palette.entries[i] = {static_cast<std::uint8_t>(random()),
                            static_cast<std::uint8_t>(random()),
                            static_cast<std::uint8_t>(random()), 255};
    }
    EXPECT_EQ(spng_set_plte(context.get(), &palette), 0);
  }
  if (kind.transparent) {
    spng_trns transparency{};
    transparency.n_type3_entries = 2;
    transparency.type3_alpha[0] = 7;
    transparency.type3_alpha[1] = 200;
    EXPECT_EQ(spng_set_trns(context.get(), &transparency), 0);
  }
  const int channels = kind.colour_type == SPNG_COLOR_TYPE_TRUECOLOR         ? 3
                       : kind.colour_type == SPNG_COLOR_TYPE_TRUECOLOR_ALPHA ? 4
                       : kind.colour_type == SPNG_COLOR_TYPE_GRAYSCALE_ALPHA ? 2
                                                                             : 1;
  std::vector<std::uint8_t> rows(
      static_cast<std::size_t>(kHeightPx * ((kWidthPx * channels * kind.bits + 7) / 8)));
  for (std::uint8_t& byte : rows) byte = static_cast<std::uint8_t>(random());
  EXPECT_EQ(spng_encode_image(context.get(), rows.data(), rows.size(), SPNG_FMT_PNG,
                              SPNG_ENCODE_FINALIZE),
            0);
  std::size_t size = 0;
  int error = 0;
  const std::unique_ptr<void, decltype(&std::free)> file(
      spng_get_png_buffer(context.get(), &size, &error), std::free);
  EXPECT_EQ(error, 0);
  return {static_cast<const char*>(file.get()), size};
}

// Decodes with libpng, through OpenCV.
cv::Mat ByOpenCv(const std::string& bytes) {
  cv::Mat image =
      cv::imdecode(std::vector<unsigned char>(bytes.begin(), bytes.end()), cv::IMREAD_UNCHANGED);
  if (image.channels() == 3) cv::cvtColor(image, image, cv::COLOR_BGR2RGB);
  if (image.channels() == 4) cv::cvtColor(image, image, cv::COLOR_BGRA2RGBA);
  return image;
}

bool AreEqual(const cv::Mat& a, const cv::Mat& b) {
  return a.size() == b.size() && a.type() == b.type() && cv::norm(a, b, cv::NORM_INF) == 0;
}

TEST(PngPixels, AreThoseThatOpenCvReads) {
  for (const PngKind& kind : AllKinds()) {
    SCOPED_TRACE(NameOf(kind));
    const std::string bytes = RandomFile(kind, 11);
    std::string why;
    cv::Mat image = DecodePngPixels(bytes, &why);
    EXPECT_EQ(why, "");
    ASSERT_FALSE(image.empty());
    if (kind.colour_type == SPNG_COLOR_TYPE_GRAYSCALE_ALPHA) {
      ASSERT_EQ(image.channels(), 2);  // OpenCV makes RGBA of grey with alpha
      cv::Mat wide(image.size(), CV_MAKETYPE(image.depth(), 4));
      cv::mixChannels(image, wide, {0, 0, 0, 1, 0, 2, 1, 3});
      image = wide;
    }
    const cv::Mat expected = ByOpenCv(bytes);
    EXPECT_TRUE(AreEqual(image, expected))
        << image.channels() << " channels, type " << image.type()
        << "; OpenCV: " << expected.channels() << " channels, type " << expected.type();
  }
}

cv::Mat RandomImage(cv::Size size, int type, std::uint64_t seed) {
  cv::Mat image(size, type);
  cv::RNG random(seed);
  random.fill(image, cv::RNG::UNIFORM, 0, image.depth() == CV_16U ? 65536 : 256);
  return image;
}

TEST(PngPixels, WrittenAreReadByOpenCv) {
  for (const int type : {CV_8UC1, CV_8UC3, CV_8UC4, CV_16UC1, CV_16UC3, CV_16UC4}) {
    for (const PngPacking packing :
         {PngPacking::kFast, PngPacking::kRepetitions, PngPacking::kSmall}) {
      SCOPED_TRACE(type);
      for (const cv::Size size : {cv::Size(1, 1), cv::Size(1, 9), cv::Size(37, 20)}) {
        const cv::Mat image = RandomImage(size, type, 3);
        const std::string bytes = EncodePngPixels(image, packing);
        EXPECT_TRUE(AreEqual(ByOpenCv(bytes), image));
        std::string why;
        EXPECT_TRUE(AreEqual(DecodePngPixels(bytes, &why), image)) << why;
      }
    }
  }
}

TEST(PngPixels, OfAPartOfAnImage) {
  const cv::Mat whole = RandomImage({20, 10}, CV_8UC3, 4);
  const cv::Mat part = whole(cv::Rect(3, 2, 11, 5));
  EXPECT_TRUE(AreEqual(ByOpenCv(EncodePngPixels(part, PngPacking::kFast)), part));
}

TEST(PngPixels, PackedSmallerWhereItIsTried) {
  cv::Mat flat(64, 64, CV_8UC1);
  for (int y = 0; y < flat.rows; ++y) {
    for (int x = 0; x < flat.cols; ++x)
      flat.at<std::uint8_t>(y, x) = static_cast<std::uint8_t>(x * y / 16);
  }
  const std::size_t fast = EncodePngPixels(flat, PngPacking::kFast).size();
  const std::size_t repetitions = EncodePngPixels(flat, PngPacking::kRepetitions).size();
  EXPECT_LT(repetitions, fast);
  EXPECT_LE(EncodePngPixels(flat, PngPacking::kSmall).size(), repetitions);
}

// The file's frame may be whole and its pixels not.
TEST(PngPixels, TellWhatIsWrong) {
  std::string bytes = EncodePngPixels(RandomImage({30, 30}, CV_16UC3, 5), PngPacking::kFast);
  bytes.resize(bytes.size() / 2);
  std::string why;
  EXPECT_TRUE(DecodePngPixels(bytes, &why).empty());
  EXPECT_NE(why, "");
}

std::string BigEndian(std::size_t value) {
  std::string bytes;
  for (int shift = 24; shift >= 0; shift -= 8) bytes += static_cast<char>(value >> shift & 0xFFU);
  return bytes;
}

std::string Chunk(const std::string& type, const std::string& content) {
  const std::string checked = type + content;
  const uLong checksum =
      crc32(0, reinterpret_cast<const Bytef*>(checked.data()), static_cast<uInt>(checked.size()));
  return BigEndian(content.size()) + checked + BigEndian(checksum);
}

constexpr std::size_t kAfterHeader = 33;

TEST(PngPixels, RefusesSidesThatNoImageHas) {
  const std::string bytes = EncodePngPixels(RandomImage({8, 8}, CV_8UC1, 6), PngPacking::kFast);
  for (const std::size_t side : {std::size_t{65536}, std::size_t{1} << 21}) {
    std::string header = bytes.substr(16, 13);
    header.replace(0, 8, BigEndian(side) + BigEndian(side));
    const std::string large =
        bytes.substr(0, 8) + Chunk("IHDR", header) + bytes.substr(kAfterHeader);
    std::string why;
    EXPECT_TRUE(DecodePngPixels(large, &why).empty());
    EXPECT_TRUE(why.find("exceed the maximum") != std::string::npos ||
                why.find("width") != std::string::npos)
        << why;
  }
}

// Texts that unpack to a lot, many of them, empty ones, and a palette that is but a suggestion.
TEST(PngPixels, AreReadWhateverStandsBesideThem) {
  const cv::Mat image = RandomImage({9, 5}, CV_8UC3, 8);
  const std::string bytes = EncodePngPixels(image, PngPacking::kFast);
  std::string many;
  for (int i = 0; i < 20000; ++i) many += Chunk("tEXt", std::string("a\0b", 3));
  const std::string large(std::size_t{70} << 20, 'x');
  for (const std::string& beside :
       {many, Chunk("tEXt", std::string("a\0", 2) + large), Chunk("eXIf", ""), Chunk("PLTE", "ab"),
        Chunk("iCCP", "nothing"), Chunk("tIME", "x")}) {
    std::string with = bytes;
    with.insert(kAfterHeader, beside);
    std::string why;
    EXPECT_TRUE(AreEqual(DecodePngPixels(with, &why), image)) << beside.substr(4, 4) << why;
  }
}

#ifdef __linux__

// Takes all memory that the system still gives under a limit, then decodes with `left` bytes. Exits
// with 0 if the image was decoded or memory was said to be short, and with 1 if the file was
// blamed.
[[noreturn]] void DecodeWithLittleMemory(const std::string& bytes, std::size_t left) {
  void* volatile const reserve = std::malloc(left);
  rlimit limit{};
  limit.rlim_cur = limit.rlim_max = 1 << 20;  // less than the program has already
  setrlimit(RLIMIT_AS, &limit);
  for (std::size_t block = 1 << 20; block >= 16;) {
    void* volatile const kept = std::malloc(block);
    if (kept == nullptr) block /= 2;
  }
  std::free(reserve);
  int code = 1;
  try {
    std::string why;
    code = DecodePngPixels(bytes, &why).empty() ? 1 : 0;
  } catch (const std::bad_alloc&) {
    code = 0;
  } catch (const cv::Exception& error) {
    code = error.code == cv::Error::StsNoMem ? 0 : 1;
  }
  std::_Exit(code);
}

// zlib calls a file damaged if it gets no memory for it.
TEST(PngPixels, BlamesNoFileForTooLittleMemory) {
  if (testing::kIsSanitized) GTEST_SKIP() << "a sanitizer has memory of its own";
  const std::string bytes =
      EncodePngPixels(RandomImage({64, 64}, CV_8UC3, 9), PngPacking::kRepetitions);
  for (std::size_t left = 8 << 10; left <= 120 << 10; left += 8 << 10) {
    EXPECT_EXIT(DecodeWithLittleMemory(bytes, left), ::testing::ExitedWithCode(0), "") << left;
  }
}

#endif

}  // namespace
}  // namespace thicklens::io
