// Images that are small files and claim to be large.
#include <cstdint>

#include "hostile/hostile_images.h"
#include "hostile/hostile_test.h"
#include "support/sanitizers.h"

namespace thicklens::hostile {
namespace {

class HostileImages : public HostileTest {
 protected:
  // Each image is refused as an image and as a depth map, soon and with little memory.
  void ExpectRefusedSoon(const std::string& name, const std::vector<std::string>& reported) {
    std::vector<std::string> all = {name};
    all.insert(all.end(), reported.begin(), reported.end());
    const std::string limit = testing::kIsSanitized ? "" : "ulimit -v 1200000; ";
    const std::string depth_words = " --depth-kind z --depth-unit mm --camera camera.yaml -o new";
    SCOPED_TRACE(name);
    ExpectRefused(Shell(limit + "\"$T\" estimate " + name + " depth.pfm" + depth_words, 60), 1,
                  all);
    ExpectRefused(Shell(limit + "\"$T\" estimate picture.png " + name + depth_words, 60), 1, all);
  }
};

THICKLENS_SITUATION(HostileImages, HeadersThatAnnounceTwoToThe31Pixels,
                    "PNG, TIFF, PFM, EXR, BMP, PNM and JPEG files of a few bytes announce 2^31 x "
                    "2^31, 2^31 x 1 or 65,535 x 65,535 pixels",
                    "Refused with the file, at once and with little memory") {
  constexpr std::uint32_t kMax = 0x7FFFFFFFU;
  const std::vector<std::pair<std::string, std::string>> files = {
      {"square.png", PngOf(kMax, kMax, 8, 0, Deflated(std::string(1000, '\0')))},
      {"row.png", PngOf(kMax, 1, 16, 6, Deflated(std::string(1000, '\0')))},
      {"large.png", PngOf(60000, 60000, 8, 2, Deflated(std::string(1000, '\0')))},
      {"square.tiff", TiffOf({kMax, kMax, 8, 1, std::string(100, '\0')})},
      {"row.tiff", TiffOf({kMax, 1, 32, 1, std::string(100, '\0')})},
      {"large.tiff", TiffOf({60000, 60000, 32, 1, std::string(100, '\0')})},
      {"square.pfm", "Pf\n2147483647 2147483647\n-1\n" + std::string(100, '\0')},
      {"large.pfm", "Pf\n65535 65535\n-1\n" + std::string(100, '\0')},
      {"square.exr", ExrOf(static_cast<std::int32_t>(kMax - 1))},
      {"large.exr", ExrOf(65534)},
      {"square.bmp", BmpOf(static_cast<std::int32_t>(kMax))},
      {"square.pgm", "P5\n2147483647 2147483647\n255\n" + std::string(100, '\0')},
      {"digits.pgm", "P5\n" + std::string(100000, '9') + " 3\n255\n"},
      {"large.jpg", std::string("\xFF\xD8\xFF\xC0\0\x0B\x08\xFF\xFF\xFF\xFF\x01\x01\x11\0", 15) +
                        std::string(100, '\0')}};
  for (const auto& [name, content] : files) {
    Put(name, content);
    ExpectRefusedSoon(name, {});
  }
}

THICKLENS_SITUATION(
    HostileImages, DecompressionBombs,
    "A PNG and a TIFF file of 400 kB contain 20,000 x 20,000 black pixels, where memory is limited "
    "to 1.2 GB",
    "Refused before it is unpacked, with the file, its size in pixels and the available memory") {
  if (testing::kIsSanitized) GTEST_SKIP() << "a sanitizer takes memory by the terabyte";
  constexpr int kSidePx = 20000;
  const std::string png_rows = DeflatedZeros(std::size_t{kSidePx} * (kSidePx + 1));
  Put("bomb.png", PngOf(kSidePx, kSidePx, 8, 0, png_rows));
  ExpectRefusedSoon("bomb.png", {"20000", "MiB"});
  constexpr int kDeflate = 8;
  Put("bomb.tiff",
      TiffOf({kSidePx, kSidePx, 8, kDeflate, DeflatedZeros(std::size_t{kSidePx} * kSidePx)}));
  ExpectRefusedSoon("bomb.tiff", {"20000", "MiB"});
}

THICKLENS_SITUATION(HostileImages, TextsThatUnpackWithoutEnd,
                    "A PNG of 24 x 16 pixels has a colour profile and a text that unpack to 1 GB "
                    "each, and 100,000 texts",
                    "The image is read; these texts are not unpacked") {
  const std::string pixels = Deflated(std::string(16 * 25, '\1'));
  const std::string unpacked = DeflatedZeros(std::size_t{1} << 30);
  std::string many;
  for (int i = 0; i < 100000; ++i) many += PngChunk("tEXt", std::string("x\0a", 3));
  const std::vector<std::pair<std::string, std::string>> chunks = {
      {"profile.png", PngChunk("iCCP", std::string("x\0\0", 3) + unpacked)},
      {"text.png", PngChunk("zTXt", std::string("x\0\0", 3) + unpacked)},
      {"many.png", many}};
  const std::string limit = testing::kIsSanitized ? "" : "ulimit -v 1000000; ";
  for (const auto& [name, extra] : chunks) {
    SCOPED_TRACE(name);
    Put(name, PngOf(24, 16, 8, 0, pixels, extra));
    ExpectDone(Shell(limit + "\"$T\" compare " + name + " " + name + " --quiet"), {});
  }
}

THICKLENS_SITUATION(HostileImages, DirectoriesThatFormALoop,
                    "The directory of a TIFF file names itself as the next, and strips that lie "
                    "beyond the file",
                    "Read or refused with the file; no endless loop") {
  TiffParts parts{24, 16, 8, 1, std::string(24 * 16, '\x50')};
  parts.next_is_itself = true;
  Put("loop.tiff", TiffOf(parts));
  const Outcome looped = Shell("\"$T\" compare loop.tiff loop.tiff", 60);
  EXPECT_LE(looped.exit_code, 1) << looped.err;
  parts = {24, 16, 8, 1, std::string(24 * 16, '\x50')};
  parts.strip_at = 4000000000U;
  Put("beyond.tiff", TiffOf(parts));
  ExpectRefused(Shell("\"$T\" compare beyond.tiff beyond.tiff", 60), 1, {"beyond.tiff"});
}

}  // namespace
}  // namespace thicklens::hostile
