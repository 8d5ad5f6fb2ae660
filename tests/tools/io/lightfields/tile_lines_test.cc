#include "tools/io/lightfields/tile_lines.h"

#include <gtest/gtest.h>

#include <cmath>
#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <random>
#include <vector>

#include "tools/io/lightfields/image_tiles.h"

namespace thicklens::io {
namespace {

constexpr int kLineViewWidthPx = 80, kLineViewHeightPx = 60;

// A part of a random texture with details of a few pixels, which moves by 1 px per view.
cv::Mat View(int k, int l) {
  static const cv::Mat texture = [] {
    cv::Mat noise(kLineViewHeightPx + 20, kLineViewWidthPx + 20, CV_8UC3);
    std::mt19937 random(7);
    for (int y = 0; y < noise.rows; ++y) {
      for (int x = 0; x < noise.cols; ++x) {
        for (int c = 0; c < 3; ++c)
          noise.at<cv::Vec3b>(y, x)[c] = static_cast<unsigned char>(random() % 256);
      }
    }
    cv::GaussianBlur(noise, noise, {}, 1.0);
    cv::normalize(noise, noise, 0, 255, cv::NORM_MINMAX);
    return noise;
  }();
  return texture(cv::Rect(k, l, kLineViewWidthPx, kLineViewHeightPx)).clone();
}

struct Border {
  int gap_px = 0, first_px = 0;
  int level = 0;
};

template <typename Change>
cv::Mat Tiles(int count, const Border& border, const Change& change) {
  const int step_x = kLineViewWidthPx + border.gap_px, step_y = kLineViewHeightPx + border.gap_px;
  cv::Mat tiles(count * step_y - border.gap_px + 2 * border.first_px,
                count * step_x - border.gap_px + 2 * border.first_px, CV_8UC3,
                cv::Scalar::all(border.level));
  for (int l = 0; l < count; ++l) {
    for (int k = 0; k < count; ++k) {
      cv::Mat view = View(k, l);
      change(&view);
      view.copyTo(tiles(cv::Rect(border.first_px + k * step_x, border.first_px + l * step_y,
                                 kLineViewWidthPx, kLineViewHeightPx)));
    }
  }
  return tiles;
}

cv::Mat Tiles(int count, const Border& border) {
  return Tiles(count, border, [](cv::Mat*) {});
}

cv::Mat ThroughJpeg(const cv::Mat& image, int quality) {
  std::vector<unsigned char> bytes;
  cv::imencode(".jpg", image, bytes, {cv::IMWRITE_JPEG_QUALITY, quality});
  return cv::imdecode(bytes, cv::IMREAD_COLOR);
}

void ExpectLines(const TileLines& lines, int count, const Border& border) {
  for (const auto& [axis, tile_px] :
       {std::pair(lines.across, kLineViewWidthPx), std::pair(lines.down, kLineViewHeightPx)}) {
    EXPECT_EQ(axis.count, count);
    EXPECT_EQ(axis.gap_px, border.gap_px);
    EXPECT_EQ(axis.first_px, border.first_px);
    EXPECT_EQ(axis.tile_px, tile_px);
  }
}

// The columns beside an edge differ from the line's colour by the blocks of JPEG, whose places
// beside the line change: before, the lines seemed to have several widths, and were none.
TEST(TileLinesTest, JpegBlursLines) {
  for (const Border& border : {Border{3, 3, 255}, Border{2, 0, 0}, Border{1, 1, 255},
                               Border{5, 5, 255}, Border{4, 2, 0}}) {
    for (const int quality : {95, 90, 85, 80, 75}) {
      SCOPED_TRACE(::testing::Message()
                   << border.gap_px << " px, level " << border.level << ", quality " << quality);
      ExpectLines(LinesOf(ThroughJpeg(Tiles(5, border), quality), true), 5, border);
    }
  }
}

// White lines beside a white sky have no edge there. Before, they were looked for without the lines
// along the other axis, and not found.
TEST(TileLinesTest, LinesMayHaveTheColourOfTheViewsEdges) {
  for (const int border_px : {0, 3}) {
    const Border border{3, border_px, 255};
    const cv::Mat tiles =
        Tiles(5, border, [](cv::Mat* view) { view->rowRange(0, 20).setTo(cv::Scalar::all(255)); });
    ExpectLines(LinesOf(tiles, false), 5, border);
  }
}

// A photograph has no lines, and neither have views that show some of their own.
TEST(TileLinesTest, TexturesHaveNoLines) {
  const TileLines lines = LinesOf(ThroughJpeg(Tiles(5, {}), 80), true);
  EXPECT_EQ(lines.across.count, 1);
  EXPECT_EQ(lines.down.count, 1);
  EXPECT_EQ(lines.across.first_px, 0);
}

// The margins of objects that fill most of the views are no lines of the views: they move with the
// parallax, by a fraction of a pixel per view.
TEST(TileLinesTest, MarginsOfObjectsAreNoLines) {
  constexpr int kObjectWidthPx = 70, kObjectHeightPx = 52;
  for (const bool is_jpeg : {false, true}) {
    cv::Mat tiles(5 * kLineViewHeightPx, 5 * kLineViewWidthPx, CV_8UC3, cv::Scalar::all(255));
    for (int l = 0; l < 5; ++l) {
      for (int k = 0; k < 5; ++k) {
        cv::Mat view(kLineViewHeightPx, kLineViewWidthPx, CV_8UC3, cv::Scalar::all(255));
        View(0, 0)(cv::Rect(0, 0, kObjectWidthPx, kObjectHeightPx))
            .copyTo(view(cv::Rect(5, 4, kObjectWidthPx, kObjectHeightPx)));
        const cv::Mat move = (cv::Mat_<double>(2, 3) << 1, 0, 0.75 * (2 - k), 0, 1, 0.75 * (2 - l));
        cv::warpAffine(view, view, move, view.size(), cv::INTER_LINEAR, cv::BORDER_REPLICATE);
        view.copyTo(tiles(cv::Rect(k * kLineViewWidthPx, l * kLineViewHeightPx, kLineViewWidthPx,
                                   kLineViewHeightPx)));
      }
    }
    const TileLines lines = LinesOf(is_jpeg ? ThroughJpeg(tiles, 90) : tiles, is_jpeg);
    for (const auto& [axis, view_px] :
         {std::pair(lines.across, kLineViewWidthPx), std::pair(lines.down, kLineViewHeightPx)}) {
      const bool keeps_pitch = axis.tile_px + axis.gap_px == view_px;
      EXPECT_TRUE(axis.count == 1 || keeps_pitch)
          << axis.count << " tiles of " << axis.tile_px << " px, lines of " << axis.gap_px << " px";
    }
  }
}

// A mosaic that was resized has lines of two widths: no tiles of one size fit it.
TEST(TileLinesTest, LinesOfTwoWidthsAreRefused) {
  cv::Mat tiles(5 * kLineViewHeightPx + 17, 5 * kLineViewWidthPx + 17, CV_8UC3,
                cv::Scalar::all(255));
  for (int l = 0, y = 0; l < 5; ++l, y += kLineViewHeightPx + 3 + (l + 1) % 2) {
    for (int k = 0, x = 0; k < 5; ++k, x += kLineViewWidthPx + 3 + (k + 1) % 2) {
      const cv::Rect place =
          cv::Rect(x, y, kLineViewWidthPx, kLineViewHeightPx) & cv::Rect({}, tiles.size());
      View(k, l)(cv::Rect({}, place.size())).copyTo(tiles(place));
    }
  }
  for (const bool is_jpeg : {false, true}) {
    const TileLines lines = LinesOf(is_jpeg ? ThroughJpeg(tiles, 90) : tiles, is_jpeg);
    EXPECT_EQ(lines.across.count, 1) << lines.across.gap_px;
    EXPECT_EQ(lines.down.count, 1) << lines.down.gap_px;
  }
}

// Half of the views' width or height shows nothing. Before, 5 x 6 views were found: two thirds of
// the object lie on each other at the distance of five sixths of a view.
TEST(ImageTiles, AnObjectOnAPlainBackgroundRepeatsItselfOncePerView) {
  for (const int level : {0, 128, 255}) {
    const cv::Mat tiles = Tiles(5, {}, [level](cv::Mat* view) {
      const cv::Mat object = (*view)(cv::Rect(13, 13, 26, 23)).clone();
      view->setTo(cv::Scalar::all(level));
      object.copyTo((*view)(cv::Rect(13, 13, 26, 23)));
    });
    const AxisCounts found = RepetitionsOf(tiles);
    EXPECT_EQ(found.across, 5) << level;
    EXPECT_EQ(found.down, 5) << level;
  }
}

// Without parallax, every odd part of the views repeats itself as well.
TEST(ImageTiles, EqualViewsAreCountedWhole) {
  cv::Mat tiles;
  cv::repeat(View(0, 0), 9, 9, tiles);
  const AxisCounts found = RepetitionsOf(tiles);
  EXPECT_EQ(found.across, 9);
  EXPECT_EQ(found.down, 9);
}

}  // namespace
}  // namespace thicklens::io
