// Light fields in the layouts of other programs. OpenCV writes the images: an encoder of its own.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdlib>
#include <functional>
#include <opencv2/imgcodecs.hpp>
#include <string>
#include <utility>
#include <vector>

#include "support/error_message.h"
#include "support/temporary_folder.h"
#include "thicklens/io/light_field_io.h"
#include "tools/io/lightfields/image_tiles.h"

namespace thicklens::io {
namespace {

using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;
using thicklens::testing::ErrorOf;
using thicklens::testing::TemporaryFolder;

constexpr int kViewWidthPx = 96, kViewHeightPx = 64;

// The scene at (x, y) px: smooth details in both directions.
double Scene(double x, double y) {
  return 128 + 40 * std::sin(0.61 * x + 0.2 * y) + 35 * std::sin(0.17 * x - 0.53 * y + 1) +
         30 * std::sin(0.31 * x + 0.43 * y + 2);
}

// The view `a` steps to the right and `b` steps down: what the middle view shows at x is at
// x - a d. The disparity is that of a plane.
cv::Mat View(double a, double b, double disparity_px = 0.7) {
  cv::Mat view(kViewHeightPx, kViewWidthPx, CV_8UC3);
  for (int y = 0; y < kViewHeightPx; ++y) {
    for (int x = 0; x < kViewWidthPx; ++x) {
      const auto level =
          cv::saturate_cast<uchar>(Scene(x + a * disparity_px, y + b * disparity_px));
      view.at<cv::Vec3b>(y, x) = {level, level, level};
    }
  }
  return view;
}

std::string EncodedTile(const cv::Mat& image, const std::string& ending = ".png") {
  std::vector<unsigned char> bytes;
  cv::imencode(ending, image, bytes);
  return {bytes.begin(), bytes.end()};
}

int LevelAt(const model::LightField& light_field, int k, int l, int x, int y) {
  const double light = model::ViewImage(light_field, k, l).at(x, y, 0);
  return static_cast<int>(std::lround(255 * model::TransferCurve::Srgb().Encode(light)));
}

class LightFieldLayouts : public ::testing::Test {
 protected:
  // A folder of 3 x 3 views; name(v, u) names them, and view(u, v) makes them.
  std::string Folder(const std::function<std::string(int, int)>& name,
                     const std::function<cv::Mat(int, int)>& view, const char* ending = ".png") {
    for (int v = 0; v < 3; ++v) {
      for (int u = 0; u < 3; ++u) folder_.Put("lf/" + name(v, u), EncodedTile(view(u, v), ending));
    }
    return folder_ / "lf";
  }
  // Requires that every view is the one of that place.
  void ExpectViews(const model::LightField& light_field) {
    ASSERT_EQ(light_field.u_count, 3);
    ASSERT_EQ(light_field.v_count, 3);
    for (int l = 0; l < 3; ++l) {
      for (int k = 0; k < 3; ++k) {
        EXPECT_EQ(LevelAt(light_field, k, l, 30, 20), View(k - 1, l - 1).at<cv::Vec3b>(20, 30)[0])
            << k << ", " << l;
      }
    }
  }
  model::LightField Read(const std::string& path, const LightFieldReading& reading = {}) {
    return ReadLightField(path, reading, &facts_);
  }

  TemporaryFolder folder_;
  LightFieldFacts facts_;
};

std::string RowAndColumn(int v, int u) {
  return "view_" + std::to_string(v) + "_" + std::to_string(u) + ".png";
}
cv::Mat InOrder(int u, int v) { return View(u - 1, v - 1); }

TEST_F(LightFieldLayouts, NamesWithTwoChangingNumbersAreRowAndColumn) {
  ExpectViews(Read(Folder(RowAndColumn, InOrder)));
  EXPECT_THAT(facts_.one_line, AllOf(HasSubstr("view_{v}_{u}.png"), HasSubstr("3 x 3 views"),
                                     HasSubstr("agree with their order")));
  EXPECT_THAT(facts_.notices, IsEmpty());
}

TEST_F(LightFieldLayouts, APatternStatesTheNames) {
  LightFieldReading reading;
  reading.name = "c{u} r{v}*";
  ExpectViews(Read(
      Folder(
          [](int v, int u) { return "c" + std::to_string(u) + " r" + std::to_string(v) + "x.png"; },
          InOrder),
      reading));
  for (const char* wrong : {"view_{v}.png", "view_{a}_{u}.png", "view", "{u}_{u}_{v}"}) {
    reading.name = wrong;
    EXPECT_THAT(ErrorOf([&] { Read(folder_ / "lf", reading); }), HasSubstr("the option name"));
  }
  reading.name = "other_{v}_{u}.png";
  EXPECT_THAT(ErrorOf([&] { Read(folder_ / "lf", reading); }),
              AllOf(HasSubstr("no name fits"), HasSubstr("c{u} r{v}x.png")));
}

TEST_F(LightFieldLayouts, OneChangingNumberIsProposedOnly) {
  const std::string path = Folder(
      [](int v, int u) { return "frame_" + std::to_string(3 * v + u + 10) + ".png"; }, InOrder);
  EXPECT_THAT(ErrorOf([&] { Read(path); }), HasSubstr("frame_{n}.png"));
  LightFieldReading reading;
  reading.name = "frame_{n}.png";
  ExpectViews(Read(path, reading));
}

// Coordinates around the middle view. Before, the views with a '-' were lost.
TEST_F(LightFieldLayouts, NamesMayHaveNegativeCoordinates) {
  const auto name = [](int v, int u) {
    return "cam_" + std::to_string(v - 1) + "_" + std::to_string(u - 1) + ".png";
  };
  const std::string path = Folder(name, InOrder);
  ExpectViews(Read(path));
  EXPECT_THAT(facts_.one_line, AllOf(HasSubstr("'cam_{v}_{u}.png'"), Not(HasSubstr("not views"))));
  LightFieldReading reading;
  reading.name = "cam_{v}_{u}.png";
  ExpectViews(Read(path, reading));
}

// "img--1-0.png" and "img-0--1.png" are of one kind, and "img-1-0.png" and "img0--1.png" of
// another. Before, the former were taken for two kinds.
TEST_F(LightFieldLayouts, ADashMayBeBeforeASign) {
  for (const std::string start : {"img-", "img"}) {
    TemporaryFolder folder;
    for (int v = -1; v < 2; ++v) {
      for (int u = -1; u < 2; ++u) {
        folder.Put("lf/" + start + std::to_string(v) + "-" + std::to_string(u) + ".png",
                   EncodedTile(View(u, v)));
      }
    }
    // Other images, fewer or as many, do not decide for these.
    folder.Put("lf/mask_-1_-1.png", EncodedTile(View(0, 0)));
    folder.Put("lf/mask_0_1.png", EncodedTile(View(0, 0)));
    ExpectViews(Read(folder / "lf"));
    EXPECT_THAT(facts_.one_line, HasSubstr("'" + start + "{v}-{u}.png'"));
  }
}

// A '-' after a digit or a letter separates, and of "a_-1" alone nobody knows.
TEST_F(LightFieldLayouts, ADashMaySeparateNumbers) {
  ExpectViews(Read(Folder(
      [](int v, int u) { return "IMG-" + std::to_string(v) + "-" + std::to_string(u) + ".png"; },
      InOrder)));
  EXPECT_THAT(facts_.one_line, HasSubstr("'IMG-{v}-{u}.png'"));
  TemporaryFolder unclear;
  for (int v = 1; v < 4; ++v) {
    for (int u = 0; u < 3; ++u) {
      unclear.Put("lf/a_-" + std::to_string(v) + "_" + std::to_string(u) + ".png",
                  EncodedTile(InOrder(u, v - 1)));
    }
  }
  EXPECT_THAT(ErrorOf([&] { Read(unclear / "lf"); }),
              AllOf(HasSubstr("'a_-{v}_{u}.png'"), HasSubstr("'a_{v}_{u}.png'")));
  LightFieldReading reading;
  reading.name = "a_-{v}_{u}.png";
  ExpectViews(Read(unclear / "lf", reading));
}

TEST_F(LightFieldLayouts, ImagesOfTwoEndingsNeedTheOptionName) {
  const std::string path = Folder(RowAndColumn, InOrder);
  folder_.Put("lf/view_1_1.jpg", EncodedTile(InOrder(1, 1), ".jpg"));
  ExpectViews(Read(path));  // a single one is no second light field
  EXPECT_THAT(facts_.one_line, HasSubstr("not views: view_1_1.jpg"));
  for (int v = 0; v < 3; ++v) {
    for (int u = 0; u < 3; ++u) {
      folder_.Put("lf/view_" + std::to_string(v) + "_" + std::to_string(u) + ".jpg",
                  EncodedTile(InOrder(u, v), ".jpg"));
    }
  }
  EXPECT_THAT(ErrorOf([&] { Read(path); }),
              AllOf(HasSubstr("'view_{v}_{u}.png'"), HasSubstr("'view_{v}_{u}.jpg'")));
  LightFieldReading reading;
  reading.name = "view_{v}_{u}.png";
  ExpectViews(Read(path, reading));
}

// Labels and views of equal size: before, the alphabetically first were read.
TEST_F(LightFieldLayouts, ImagesOfTwoNamesNeedTheOptionName) {
  const auto name_with = [](const std::string& stem) {
    return [stem](int v, int u) {
      return stem + std::to_string(v) + "_" + std::to_string(u) + ".png";
    };
  };
  Folder(name_with("view_"), InOrder);
  const std::string path = Folder(name_with("label_"), [](int, int) { return View(0, 0); });
  EXPECT_THAT(ErrorOf([&] { Read(path); }),
              AllOf(HasSubstr("'view_{v}_{u}.png'"), HasSubstr("'label_{v}_{u}.png'"),
                    HasSubstr("the option name")));
  LightFieldReading reading;
  reading.name = "view_{v}_{u}.png";
  ExpectViews(Read(path, reading));
  EXPECT_THAT(facts_.notices, IsEmpty());
}

TEST_F(LightFieldLayouts, ASmallerGridOfOtherNamesIsReported) {
  const std::string path = Folder(RowAndColumn, InOrder);
  for (const char* place : {"0_0", "0_1", "1_0", "1_1"})
    folder_.Put("lf/thumb_" + std::string(place) + ".png", EncodedTile(View(0, 0)));
  ExpectViews(Read(path));
  EXPECT_THAT(facts_.notices, ElementsAre(HasSubstr("thumb_{v}_{u}.png")));
}

// Masks of some views are no light field, but may be as many as half of the views.
TEST_F(LightFieldLayouts, MasksOfSomeViewsAreReported) {
  const std::string path = Folder(RowAndColumn, InOrder);
  for (const char* place : {"0_0", "0_2", "1_1", "2_0", "2_2"})
    folder_.Put("lf/mask_" + std::string(place) + ".png", EncodedTile(View(0, 0)));
  ExpectViews(Read(path));
  EXPECT_THAT(facts_.notices, ElementsAre(HasSubstr("mask_{v}_{u}.png")));
  // Without one of the views, either may be meant.
  std::remove((path + "/view_1_1.png").c_str());
  EXPECT_THAT(ErrorOf([&] { Read(path); }), HasSubstr("'mask_{v}_{u}.png'"));
}

// Before, such an image made every '-' a sign.
TEST_F(LightFieldLayouts, APlusInAnotherNameDecidesNothing) {
  const std::string path = Folder(
      [](int v, int u) { return "view-0" + std::to_string(v) + "-0" + std::to_string(u) + ".png"; },
      InOrder);
  folder_.Put("lf/HDR_1+2.png", EncodedTile(View(0, 0)));
  ExpectViews(Read(path));
  EXPECT_THAT(facts_.one_line,
              AllOf(HasSubstr("'view-{v}-{u}.png'"), HasSubstr("not views: HDR_1+2.png")));
}

// Before, the first number was the row always.
TEST_F(LightFieldLayouts, LettersBeforeNumbersNameTheirAxes) {
  for (const auto& [column, row] : {std::pair("x", "y"), std::pair("u", "_v"),
                                    std::pair("Col_", "_Row_"), std::pair("im c", "r")}) {
    TemporaryFolder folder;
    for (int v = 0; v < 3; ++v) {
      for (int u = 0; u < 3; ++u) {
        folder.Put(
            "lf/" + std::string(column) + std::to_string(u) + row + std::to_string(v) + ".png",
            EncodedTile(InOrder(u, v)));
      }
    }
    ExpectViews(Read(folder / "lf"));
    EXPECT_THAT(facts_.notices, IsEmpty()) << column;
  }
}

TEST_F(LightFieldLayouts, APlusIsASign) {
  const auto with_plus = [](int number) {
    return (number < 0 ? "" : "+") + std::to_string(number);
  };
  ExpectViews(Read(Folder(
      [&](int v, int u) { return "cam_" + with_plus(v - 1) + "_" + with_plus(u - 1) + ".png"; },
      InOrder)));
  EXPECT_THAT(facts_.one_line, HasSubstr("'cam_{v}_{u}.png'"));
  TemporaryFolder next;
  for (int v = 0; v < 3; ++v) {
    for (int u = 0; u < 3; ++u) {
      next.Put("lf/cam" + with_plus(v - 1) + with_plus(u - 1) + ".png", EncodedTile(InOrder(u, v)));
    }
  }
  ExpectViews(Read(next / "lf"));
  EXPECT_THAT(facts_.one_line, AllOf(HasSubstr("'cam{v}{u}.png'"), Not(HasSubstr("not views"))));
}

// Before, the largest group was read: "cam_p{v}_p{u}.png".
TEST_F(LightFieldLayouts, LettersForSignsAreRefused) {
  const auto with_letter = [](int number) {
    return (number < 0 ? "m" : "p") + std::to_string(std::abs(number));
  };
  const std::string path = Folder(
      [&](int v, int u) { return "cam_" + with_letter(v - 1) + "_" + with_letter(u - 1) + ".png"; },
      InOrder);
  EXPECT_THAT(ErrorOf([&] { Read(path); }),
              AllOf(HasSubstr("may be signs"), HasSubstr("cam_m1_m1.png")));
  LightFieldReading reading;
  reading.name = "cam_p{v}_p{u}.png";
  EXPECT_EQ(Read(path, reading).u_count, 2);
  EXPECT_THAT(facts_.notices,
              ::testing::Contains(AllOf(HasSubstr("5 image(s)"), HasSubstr("cam_m1_m1.png"))));
}

// The times of photographs have more digits than a row or a column may have.
TEST_F(LightFieldLayouts, LongNumbersAreNoRowsAndColumns) {
  const std::string path = Folder(
      [](int v, int u) {
        return "2024010112300" + std::to_string(v) + "_" + std::to_string(u) + ".png";
      },
      InOrder);
  EXPECT_THAT(ErrorOf([&] { Read(path); }),
              AllOf(HasSubstr("not a light field"), Not(HasSubstr("{v}_{u}.png"))));
}

// Numbers with gaps count from 0, even if there are as many as full rows would have.
TEST_F(LightFieldLayouts, NumbersWithGapsCountFromZero) {
  for (const int number : {1, 3, 5, 7, 9, 11})
    folder_.Put("lf/" + std::to_string(number) + ".png", EncodedTile(View(0, 0)));
  LightFieldReading reading;
  reading.name = "{n}.png";
  reading.grid = 3;
  reading.sparse = true;
  const model::LightField light_field = Read(folder_ / "lf", reading);
  ASSERT_EQ(light_field.u_count, 3);
  ASSERT_EQ(light_field.v_count, 4);
  for (int number = 0; number < 12; ++number)
    EXPECT_EQ(light_field.IsPresent(number % 3, number / 3), number % 2 == 1) << number;
}

TEST_F(LightFieldLayouts, BothNumbersOfALayoutAreStated) {
  const std::string path = folder_.Put("one.png", EncodedTile(View(0, 0)));
  LightFieldReading reading;
  for (const char* layout : {"tiles", "quilt", "lenslets"}) {
    reading.layout = layout;
    for (const auto& [across, down] : {std::pair(2, 0), std::pair(0, 2), std::pair(-2, -2)}) {
      reading.layout_u = across;
      reading.layout_v = down;
      EXPECT_THAT(ErrorOf([&] { Read(path, reading); }), HasSubstr("the option layout: "))
          << layout << across << down;
    }
  }
}

TEST_F(LightFieldLayouts, StanfordNamesHavePositions) {
  ExpectViews(Read(Folder(
      [](int v, int u) {
        return "out_0" + std::to_string(v) + "_0" + std::to_string(u) + "_" +
               std::to_string(10.5 + 2.0 * v) + "_" + std::to_string(-20.0 + 2.0 * u) + "_.png";
      },
      InOrder)));
  EXPECT_THAT(facts_.one_line,
              AllOf(HasSubstr("a Stanford folder"), HasSubstr("2 per column, 2 per row")));
  EXPECT_THAT(facts_.notices, IsEmpty());
}

TEST_F(LightFieldLayouts, HciNamesMayBeOfJpegFiles) {
  const model::LightField light_field =
      Read(Folder([](int v, int u) { return "input_Cam00" + std::to_string(3 * v + u) + ".jpg"; },
                  InOrder, ".jpg"));
  EXPECT_EQ(light_field.u_count, 3);
  EXPECT_NEAR(LevelAt(light_field, 2, 0, 30, 20), View(1, -1).at<cv::Vec3b>(20, 30)[0], 4);
}

TEST_F(LightFieldLayouts, HciViewsOfTwoKindsOfFilesAreNamed) {
  const auto name = [](int v, int u) { return "input_Cam00" + std::to_string(3 * v + u); };
  const std::string path =
      Folder([&](int v, int u) { return name(v, u) + ".jpg"; }, InOrder, ".jpg");
  // A stray PNG file is not preferred to a full set.
  folder_.Put("lf/" + name(1, 1) + ".png", EncodedTile(InOrder(1, 1)));
  EXPECT_EQ(Read(path).u_count, 3);
  EXPECT_THAT(facts_.notices, ElementsAre(AllOf(HasSubstr("9 files of .jpg"),
                                                HasSubstr("not read: 1 file(s) of .png"))));
  Folder([&](int v, int u) { return name(v, u) + ".png"; }, InOrder);
  ExpectViews(Read(path));
  EXPECT_THAT(facts_.notices, ElementsAre(AllOf(HasSubstr("9 files of .png"),
                                                HasSubstr("not read: 9 file(s) of .jpg"))));
}

TEST_F(LightFieldLayouts, HciNumbersMayBeginAtOne) {
  const std::string path = Folder(
      [](int v, int u) { return "input_Cam00" + std::to_string(3 * v + u + 1) + ".png"; }, InOrder);
  LightFieldReading reading;
  for (const bool is_stated : {false, true}) {
    reading.grid = is_stated ? 3 : 0;
    reading.sparse = is_stated;
    ExpectViews(Read(path, reading));
    EXPECT_THAT(facts_.notices,
                ElementsAre(AllOf(HasSubstr("from 1"), HasSubstr("input_Cam001.png"))));
  }
  std::remove((path + "/input_Cam005.png").c_str());
  const model::LightField light_field = Read(path, reading);
  ASSERT_EQ(light_field.u_count, 3);
  ASSERT_EQ(light_field.v_count, 3);
  EXPECT_FALSE(light_field.IsPresent(1, 1));
  EXPECT_EQ(LevelAt(light_field, 2, 2, 30, 20), View(1, 1).at<cv::Vec3b>(20, 30)[0]);
  reading.name = "input_Cam{n}.png";
  const model::LightField named = Read(path, reading);
  ASSERT_EQ(named.v_count, 3);
  EXPECT_FALSE(named.IsPresent(1, 1));
  EXPECT_THAT(facts_.one_line, HasSubstr("row by row from 1"));
}

// Of 24 views with numbers from 1, the first may be missing, or the last: before, it was the first,
// and every view was at the place of its neighbour.
TEST_F(LightFieldLayouts, ShiftsShowWhetherNumbersCountFromOne) {
  constexpr int kSide = 5;
  LightFieldReading reading;
  reading.grid = kSide;
  reading.sparse = true;
  for (const int first : {0, 1}) {
    for (const char* stem : {"input_Cam0", "frame_"}) {
      TemporaryFolder folder;
      for (int i = 1 - first; i < kSide * kSide - first; ++i) {
        const int number = i + first;
        folder.Put(
            std::string("lf/") + stem + (number < 10 ? "0" : "") + std::to_string(number) + ".png",
            EncodedTile(View(i % kSide - 2, i / kSide - 2)));
      }
      if (stem[0] == 'f') reading.name = "frame_{n}.png";
      const model::LightField light_field = Read(folder / "lf", reading);
      reading.name.clear();
      ASSERT_EQ(light_field.u_count, kSide);
      ASSERT_EQ(light_field.v_count, kSide);
      EXPECT_EQ(light_field.IsPresent(0, 0), first == 1);
      EXPECT_EQ(light_field.IsPresent(4, 4), first == 0);
      EXPECT_EQ(LevelAt(light_field, 1, 2, 30, 20), View(-1, 0).at<cv::Vec3b>(20, 30)[0]);
      EXPECT_THAT(facts_.notices.empty() ? facts_.one_line : facts_.notices.back(),
                  HasSubstr("that they count from " + std::to_string(first)));
      EXPECT_EQ(facts_.notices.empty(), first == 0);
    }
  }
  // Equal views decide nothing.
  TemporaryFolder folder;
  for (int number = 1; number < kSide * kSide; ++number) {
    folder.Put(
        "lf/input_Cam0" + std::string(number < 10 ? "0" : "") + std::to_string(number) + ".png",
        EncodedTile(View(0, 0)));
  }
  EXPECT_FALSE(Read(folder / "lf", reading).IsPresent(0, 0));
  EXPECT_THAT(facts_.notices, ::testing::Contains(HasSubstr("do not decide it")));
}

// Counted from 1, these are 5 x 4 views, which do not have the inner 4 x 5.
TEST_F(LightFieldLayouts, NumbersThatCannotCountFromOneCountFromZero) {
  for (const int number : {3, 6, 8, 11, 12, 13, 15, 18, 20})
    folder_.Put("lf/v" + std::to_string(number) + ".png", EncodedTile(View(0, 0)));
  LightFieldReading reading;
  reading.name = "v{n}.png";
  reading.grid = 5;
  reading.sparse = true;
  reading.u_count = 4;
  reading.v_count = 5;
  const model::LightField light_field = Read(folder_ / "lf", reading);
  EXPECT_EQ(light_field.u_count, 4);
  EXPECT_EQ(light_field.v_count, 5);
  EXPECT_TRUE(light_field.IsPresent(3, 0));
  EXPECT_THAT(facts_.one_line, HasSubstr("cannot be read from 1"));
}

TEST_F(LightFieldLayouts, ViewsThatCountFromOneHaveTheWarningsOfTheirNames) {
  constexpr int kSide = 5;
  for (int i = 0; i < kSide * kSide - 1; ++i) {
    folder_.Put("lf/frame_" + std::to_string(i + 1) + ".png",
                EncodedTile(View(i % kSide - 2, i / kSide - 2)));
  }
  folder_.Put("lf/frame_m3.png", EncodedTile(View(0, 0)));
  LightFieldReading reading;
  reading.name = "frame_{n}.png";
  reading.grid = kSide;
  reading.sparse = true;
  EXPECT_TRUE(Read(folder_ / "lf", reading).IsPresent(0, 0));
  EXPECT_THAT(facts_.notices, ::testing::Contains(HasSubstr("that they count from 1")));
  EXPECT_THAT(facts_.notices, ::testing::Contains(HasSubstr("frame_m3.png")));
}

// The numbers of views state the length of a row, also where only inner views are there.
TEST_F(LightFieldLayouts, InnerViewsOfAStatedNumberingAreRead) {
  LightFieldReading reading;
  reading.name = "v{n}.png";
  reading.layout = "names";
  reading.layout_u = reading.layout_v = 5;
  const auto name = [](int v, int u) { return "v" + std::to_string(5 * v + u + 6) + ".png"; };
  ExpectViews(Read(Folder(name, InOrder), reading));
  std::remove((folder_ / "lf/v12.png").c_str());
  EXPECT_THAT(ErrorOf([&] { Read(folder_ / "lf", reading); }), HasSubstr("missing"));
  TemporaryFolder gapless;
  for (int number = 0; number < 9; ++number)
    gapless.Put("lf/v" + std::to_string(number) + ".png", EncodedTile(View(0, 0)));
  EXPECT_THAT(ErrorOf([&] { Read(gapless / "lf", reading); }), HasSubstr("states 5 x 5 views"));
}

TEST_F(LightFieldLayouts, BlackViewsAreNamedAndLeftOut) {
  const model::LightField light_field = Read(Folder(RowAndColumn, [](int u, int v) {
    return u == 2 && v == 0 ? cv::Mat(kViewHeightPx, kViewWidthPx, CV_8UC3, cv::Scalar(0, 1, 0))
                            : InOrder(u, v);
  }));
  EXPECT_THAT(facts_.left_out, ElementsAre("(2, 0)"));
  EXPECT_FALSE(light_field.IsPresent(2, 0));
  EXPECT_TRUE(light_field.IsPresent(0, 0));
  EXPECT_NEAR(light_field.weights(0, 0), 1.0 / 8, 1e-12);
  EXPECT_TRUE(light_field.IsValid(nullptr));
}

TEST_F(LightFieldLayouts, BlackViewsOfADarkSceneAreKept) {
  // One lamp in the dark, which the corner views do not see.
  const auto night = [](int u, int v) {
    cv::Mat view(kViewHeightPx, kViewWidthPx, CV_8UC3, cv::Scalar::all(2));
    if (u == 1 || v == 1) view.at<cv::Vec3b>(30, 40) = {255, 255, 255};
    return view;
  };
  const model::LightField light_field = Read(Folder(RowAndColumn, night));
  EXPECT_THAT(facts_.left_out, IsEmpty());
  EXPECT_TRUE(light_field.IsPresent(0, 0));
  EXPECT_THAT(facts_.notices, ElementsAre(AllOf(HasSubstr("4 of 9 views are black, and kept"),
                                                HasSubstr("(0, 0), (2, 0), (0, 2), (2, 2)"))));
  // Without the lamp all views are alike.
  Read(Folder(RowAndColumn, [](int, int) {
    return cv::Mat(kViewHeightPx, kViewWidthPx, CV_8UC3, cv::Scalar::all(2));
  }));
  EXPECT_THAT(facts_.notices, IsEmpty());
}

TEST_F(LightFieldLayouts, HotPixelsDoNotMakeAViewBright) {
  Read(Folder(RowAndColumn, [](int u, int v) {
    if (u != 0 || v != 0) return InOrder(u, v);
    cv::Mat view(kViewHeightPx, kViewWidthPx, CV_8UC3, cv::Scalar::all(1));
    view.at<cv::Vec3b>(30, 40)[1] = 255;
    return view;
  }));
  EXPECT_THAT(facts_.left_out, ElementsAre("(0, 0)"));
}

TEST_F(LightFieldLayouts, DimViewsAreNamedAndKept) {
  const model::LightField light_field = Read(Folder(RowAndColumn, [](int u, int v) {
    return u == 2 && v == 2 ? cv::Mat(InOrder(u, v) * 0.2) : InOrder(u, v);
  }));
  EXPECT_TRUE(light_field.IsPresent(2, 2));
  EXPECT_THAT(facts_.left_out, IsEmpty());
  EXPECT_THAT(facts_.notices,
              ElementsAre(AllOf(HasSubstr("1 of 9 views are darker"), HasSubstr("(2, 2)"))));
}

TEST_F(LightFieldLayouts, ABlackViewOfOurOwnIsNamedAndKept) {
  model::LightField light_field = Read(Folder(RowAndColumn, InOrder));
  for (int c = 0; c < 3; ++c) {
    const auto start =
        light_field.values.begin() + static_cast<std::ptrdiff_t>(light_field.ViewStart(c, 2, 0));
    std::fill(start, start + kViewWidthPx * kViewHeightPx, 0.0F);
  }
  OutputFolder output(folder_ / "own", kLightFieldMarker, LightFieldEntries());
  WriteLightField(light_field, ViewFormat::kPng, &output);
  output.Commit();
  const model::LightField own = Read(folder_ / "own");
  EXPECT_TRUE(own.IsPresent(2, 0));
  EXPECT_NEAR(own.weights(2, 2), 1.0 / 9, 1e-9);
  EXPECT_THAT(facts_.notices,
              ElementsAre(AllOf(HasSubstr("black, and kept"), HasSubstr("(2, 0)"))));
}

TEST_F(LightFieldLayouts, ExchangedRowsAndColumnsAreReportedAndExchanged) {
  const std::string path = Folder(RowAndColumn, [](int u, int v) { return InOrder(v, u); });
  Read(path);
  EXPECT_THAT(facts_.notices, ElementsAre(HasSubstr("view-order swap")));
  LightFieldReading reading;
  reading.swap_uv = true;
  ExpectViews(Read(path, reading));
  EXPECT_THAT(facts_.notices, IsEmpty());
}

TEST_F(LightFieldLayouts, AMirroredDirectionIsReportedAndTurned) {
  const std::string path = Folder(RowAndColumn, [](int u, int v) { return InOrder(u, 2 - v); });
  Read(path);
  EXPECT_THAT(facts_.notices, ElementsAre(HasSubstr("mirror-v")));
  LightFieldReading reading;
  reading.mirror_v = true;
  ExpectViews(Read(path, reading));
  EXPECT_THAT(facts_.notices, IsEmpty());
}

TEST_F(LightFieldLayouts, EqualViewsDecideNothing) {
  Read(Folder(RowAndColumn, [](int, int) { return View(0, 0); }));
  EXPECT_THAT(facts_.notices, IsEmpty());
  EXPECT_THAT(facts_.one_line, HasSubstr("cannot be decided"));
}

TEST_F(LightFieldLayouts, AQuiltBeginsAtItsBottomLeft) {
  cv::Mat quilt(2 * kViewHeightPx, 3 * kViewWidthPx, CV_8UC3);
  for (int i = 0; i < 6; ++i)
    View(i - 2.5, 0)
        .copyTo(quilt(cv::Rect(i % 3 * kViewWidthPx, (1 - i / 3) * kViewHeightPx, kViewWidthPx,
                               kViewHeightPx)));
  const model::LightField light_field =
      Read(folder_.Put("scene_qs3x2a1.5.png", EncodedTile(quilt)));
  ASSERT_EQ(light_field.u_count, 6);
  ASSERT_EQ(light_field.v_count, 1);
  for (int k = 0; k < 6; ++k)
    EXPECT_EQ(LevelAt(light_field, k, 0, 30, 20), View(k - 2.5, 0).at<cv::Vec3b>(20, 30)[0]);
  EXPECT_THAT(facts_.notices, IsEmpty());
  EXPECT_THAT(ErrorOf([&] { Read(folder_.Put("scene_qs5x7a1.png", EncodedTile(quilt))); }),
              HasSubstr("5 x 7 tiles"));
}

TEST_F(LightFieldLayouts, ViewsSideBySideAndLenslets) {
  cv::Mat tiles(3 * kViewHeightPx, 3 * kViewWidthPx, CV_8UC3),
      lenslets(3 * kViewHeightPx, 3 * kViewWidthPx, CV_8UC3);
  for (int l = 0; l < 3; ++l) {
    for (int k = 0; k < 3; ++k) {
      const cv::Mat view = InOrder(k, l);
      view.copyTo(
          tiles(cv::Rect(k * kViewWidthPx, l * kViewHeightPx, kViewWidthPx, kViewHeightPx)));
      for (int y = 0; y < kViewHeightPx; ++y) {
        for (int x = 0; x < kViewWidthPx; ++x)
          lenslets.at<cv::Vec3b>(3 * y + l, 3 * x + k) = view.at<cv::Vec3b>(y, x);
      }
    }
  }
  LightFieldReading reading;
  reading.layout = "tiles";
  reading.layout_u = reading.layout_v = 3;
  ExpectViews(Read(folder_.Put("tiles.png", EncodedTile(tiles)), reading));
  reading = {};
  reading.grid = 3;
  ExpectViews(Read(folder_.Put("x_eslf.png", EncodedTile(lenslets)), reading));
  EXPECT_THAT(facts_.one_line, HasSubstr("lenslets of 3 x 3 px"));
}

// Another number of tiles or of pixels in a lenslet than that of the image.
TEST_F(LightFieldLayouts, WrongNumbersOfViewsAreNotConfirmed) {
  constexpr int kSide = 4;
  cv::Mat tiles(kSide * kViewHeightPx, kSide * kViewWidthPx, CV_8UC3),
      lenslets(kSide * kViewHeightPx, kSide * kViewWidthPx, CV_8UC3);
  for (int l = 0; l < kSide; ++l) {
    for (int k = 0; k < kSide; ++k) {
      const cv::Mat view = View(k, l);
      view.copyTo(
          tiles(cv::Rect(k * kViewWidthPx, l * kViewHeightPx, kViewWidthPx, kViewHeightPx)));
      for (int y = 0; y < kViewHeightPx; ++y) {
        for (int x = 0; x < kViewWidthPx; ++x)
          lenslets.at<cv::Vec3b>(kSide * y + l, kSide * x + k) = view.at<cv::Vec3b>(y, x);
      }
    }
  }
  LightFieldReading reading;
  reading.layout = "tiles";
  reading.layout_u = reading.layout_v = 8;
  Read(folder_.Put("tiles.png", EncodedTile(tiles)), reading);
  EXPECT_THAT(facts_.one_line, Not(HasSubstr("agree with")));
  reading.layout = "lenslets";
  reading.layout_u = reading.layout_v = 3;
  Read(folder_.Put("lenslets.png", EncodedTile(lenslets)), reading);
  EXPECT_THAT(facts_.one_line, Not(HasSubstr("agree with")));
  // Every third pixel of a photograph.
  Read(folder_.Put("photo.png", EncodedTile(View(0, 0))), reading);
  EXPECT_THAT(facts_.one_line, Not(HasSubstr("agree with")));
}

// Pixels of a lenslet side by side, as lenslets of so many px have them.
cv::Mat LensletsOf(int edge_px, int width, int height) {
  cv::Mat lenslets(height * edge_px, width * edge_px, CV_8UC3);
  for (int l = 0; l < edge_px; ++l) {
    for (int k = 0; k < edge_px; ++k) {
      const cv::Mat view = View(k, l);
      for (int y = 0; y < height; ++y) {
        for (int x = 0; x < width; ++x)
          lenslets.at<cv::Vec3b>(edge_px * y + l, edge_px * x + k) = view.at<cv::Vec3b>(y, x);
      }
    }
  }
  return lenslets;
}

// Before, 24 px were taken for two lenslets of 12 px.
TEST_F(LightFieldLayouts, LargeLensletsShowTheirSize) {
  for (const int edge_px : {5, 14, 24, 30})
    EXPECT_EQ(LensletPitchOf(LensletsOf(edge_px, 40, 30)), edge_px);
  LightFieldReading reading;
  reading.layout = "lenslets";
  reading.layout_u = reading.layout_v = 24;
  Read(folder_.Put("lenslets.png", EncodedTile(LensletsOf(24, 40, 30))), reading);
  EXPECT_THAT(facts_.one_line, Not(HasSubstr("steps at every")));
  EXPECT_THAT(facts_.notices, Not(::testing::Contains(HasSubstr("steps at every"))));
  reading.layout_u = reading.layout_v = 12;
  Read(folder_ / "lenslets.png", reading);
  EXPECT_THAT(facts_.notices, ::testing::Contains(AllOf(HasSubstr("12 x 12 px are read"),
                                                        HasSubstr("lenslets:24x24"))));
}

TEST_F(LightFieldLayouts, OneRowDoesNotShowItsDirection) {
  for (int u = 0; u < 5; ++u)
    folder_.Put("lf/v_0_" + std::to_string(u) + ".png", EncodedTile(View(u - 2, 0)));
  LightFieldReading reading;
  reading.name = "v_{v}_{u}.png";
  Read(folder_ / "lf", reading);
  EXPECT_THAT(facts_.one_line, HasSubstr("whether they count backwards cannot be decided"));
  EXPECT_THAT(facts_.notices, IsEmpty());
}

// Our own mosaics have lines between the views, but not around them.
TEST_F(LightFieldLayouts, LinesBetweenTheViewsAreLeftOut) {
  constexpr int kGapPx = 4;
  cv::Mat mosaic(3 * (kViewHeightPx + kGapPx) - kGapPx, 3 * (kViewWidthPx + kGapPx) - kGapPx,
                 CV_8UC3, cv::Scalar::all(0));
  for (int l = 0; l < 3; ++l) {
    for (int k = 0; k < 3; ++k) {
      InOrder(k, l).copyTo(mosaic(cv::Rect(
          k * (kViewWidthPx + kGapPx), l * (kViewHeightPx + kGapPx), kViewWidthPx, kViewHeightPx)));
    }
  }
  const std::string path = folder_.Put("mosaic.png", EncodedTile(mosaic));
  LightFieldReading reading;
  ExpectViews(Read(path, reading));
  EXPECT_THAT(facts_.one_line, HasSubstr("lines of 4 x 4 px"));
  reading.layout = "tiles";
  ExpectViews(Read(path, reading));
  reading.layout_u = reading.layout_v = 3;
  ExpectViews(Read(path, reading));
  reading.layout_v = 2;
  EXPECT_THAT(ErrorOf([&] { Read(path, reading); }),
              AllOf(HasSubstr("states 3 x 2 views"), HasSubstr("tiles:3x3")));
}

// 3 x 3 views with lines between them and a border around them.
cv::Mat Mosaic(cv::Size gap, cv::Size border, int level) {
  const int step_x = kViewWidthPx + gap.width, step_y = kViewHeightPx + gap.height;
  cv::Mat mosaic(3 * step_y - gap.height + 2 * border.height,
                 3 * step_x - gap.width + 2 * border.width, CV_8UC3, cv::Scalar::all(level));
  for (int l = 0; l < 3; ++l) {
    for (int k = 0; k < 3; ++k) {
      InOrder(k, l).copyTo(mosaic(cv::Rect(border.width + k * step_x, border.height + l * step_y,
                                           kViewWidthPx, kViewHeightPx)));
    }
  }
  return mosaic;
}

// Before, a border around the image made it one without lines, and views contained them.
TEST_F(LightFieldLayouts, BordersAroundTheViewsAreLeftOut) {
  LightFieldReading reading;
  reading.layout = "tiles";
  reading.layout_u = reading.layout_v = 3;
  const cv::Size none(0, 0), two(2, 2), four(4, 4);
  for (const int level : {0, 255}) {
    // montage -geometry +2+2; lines and a rim of one width; a rim alone; lines in one direction.
    for (const auto& [gap, border] :
         {std::pair(four, two), std::pair(two, two), std::pair(none, four),
          std::pair(cv::Size(3, 0), none), std::pair(cv::Size(0, 2), cv::Size(0, 1))}) {
      SCOPED_TRACE(::testing::Message() << gap << ", " << border << ", " << level);
      ExpectViews(Read(folder_.Put("m.png", EncodedTile(Mosaic(gap, border, level))), reading));
      EXPECT_THAT(facts_.one_line, HasSubstr("left out"));
    }
  }
  ExpectViews(Read(folder_.Put("m.png", EncodedTile(Mosaic(four, two, 0)))));
  EXPECT_THAT(facts_.one_line, HasSubstr("lines of 4 x 4 px divide the views within a border of 2 "
                                         "x 2 px"));
  const cv::Mat uneven = Mosaic(none, four, 0)(cv::Rect(2, 0, 3 * kViewWidthPx + 6, 200)).clone();
  ExpectViews(Read(folder_.Put("m.png", EncodedTile(uneven)), reading));
  // Lines on the right of each view only may be an edge of the views.
  const cv::Mat right =
      Mosaic({2, 0}, {2, 0}, 0)(cv::Rect(2, 0, 3 * kViewWidthPx + 6, 192)).clone();
  EXPECT_EQ(Read(folder_.Put("m.png", EncodedTile(right)), reading).s_count, kViewWidthPx + 2);
  EXPECT_THAT(facts_.notices, ::testing::Contains(HasSubstr("uniform edge of 2 x 0 px")));
  reading.layout_u = 5;
  EXPECT_THAT(
      ErrorOf([&] { Read(folder_.Put("m.png", EncodedTile(Mosaic(none, two, 0))), reading); }),
      AllOf(HasSubstr("288 x 192 px (of 292 x 196 px"), HasSubstr("5 x 3 views")));
}

// The views outside a round aperture are black, and no border.
TEST_F(LightFieldLayouts, BlackViewsAroundTheOthersAreNoBorder) {
  constexpr int kSide = 5;
  cv::Mat tiles(kSide * kViewHeightPx, kSide * kViewWidthPx, CV_8UC3, cv::Scalar::all(0));
  for (int l = 1; l < kSide - 1; ++l) {
    for (int k = 1; k < kSide - 1; ++k) {
      View(k - 2, l - 2)
          .copyTo(
              tiles(cv::Rect(k * kViewWidthPx, l * kViewHeightPx, kViewWidthPx, kViewHeightPx)));
    }
  }
  LightFieldReading reading;
  reading.layout = "tiles";
  reading.layout_u = reading.layout_v = kSide;
  const model::LightField light_field = Read(folder_.Put("tiles.png", EncodedTile(tiles)), reading);
  EXPECT_EQ(light_field.u_count, kSide);
  EXPECT_EQ(light_field.s_count, kViewWidthPx);
  EXPECT_EQ(LevelAt(light_field, 1, 3, 30, 20), View(-1, 1).at<cv::Vec3b>(20, 30)[0]);
}

// Views side by side, of which each was changed.
cv::Mat SideBySide(int across, int down, const std::function<void(cv::Mat*)>& change) {
  cv::Mat tiles(down * kViewHeightPx, across * kViewWidthPx, CV_8UC3);
  for (int l = 0; l < down; ++l) {
    for (int k = 0; k < across; ++k) {
      cv::Mat view = View(k, l, 0.2);
      change(&view);
      view.copyTo(
          tiles(cv::Rect(k * kViewWidthPx, l * kViewHeightPx, kViewWidthPx, kViewHeightPx)));
    }
  }
  return tiles;
}

// The outer views may be black at their outer edges: 4 x 96 px are not 4 x 94 px in a border.
TEST_F(LightFieldLayouts, BlackEdgesOfTheOuterViewsAreNoBorder) {
  LightFieldReading reading;
  reading.layout = "tiles";
  reading.layout_u = reading.layout_v = 4;
  for (const int border_px : {3, 4}) {  // 4 x 94.5 px, 4 x 94 px
    cv::Mat tiles = SideBySide(4, 4, [](cv::Mat*) {});
    tiles.colRange(0, border_px).setTo(cv::Scalar::all(0));
    tiles.colRange(tiles.cols - border_px, tiles.cols).setTo(cv::Scalar::all(0));
    const model::LightField light_field =
        Read(folder_.Put("tiles.png", EncodedTile(tiles)), reading);
    EXPECT_EQ(light_field.s_count, kViewWidthPx) << border_px;
    EXPECT_EQ(LevelAt(light_field, 1, 3, 30, 20), View(1, 3, 0.2).at<cv::Vec3b>(20, 30)[0]);
    EXPECT_THAT(facts_.notices, ::testing::Contains(HasSubstr("part of the outer views")));
  }
  // A border around them is one also where the whole image is divisible.
  cv::Mat bordered(4 * kViewHeightPx, 4 * kViewWidthPx + 8, CV_8UC3, cv::Scalar::all(0));
  SideBySide(4, 4, [](cv::Mat*) {
  }).copyTo(bordered(cv::Rect(4, 0, 4 * kViewWidthPx, 4 * kViewHeightPx)));
  const model::LightField light_field =
      Read(folder_.Put("bordered.png", EncodedTile(bordered)), reading);
  EXPECT_EQ(light_field.s_count, kViewWidthPx);
  EXPECT_EQ(LevelAt(light_field, 1, 3, 30, 20), View(1, 3, 0.2).at<cv::Vec3b>(20, 30)[0]);
  EXPECT_THAT(facts_.one_line, HasSubstr("a border of 4 x 0 px is left out"));
}

// Few views with bars of their own repeat themselves: before, they were taken for any image.
TEST_F(LightFieldLayouts, FewViewsWithBlackBarsAreRecognised) {
  constexpr int kBarPx = 5;
  for (const auto& [across, down] : {std::pair(4, 2), std::pair(2, 4), std::pair(2, 2)}) {
    const cv::Mat tiles = SideBySide(across, down, [](cv::Mat* view) {
      view->rowRange(0, kBarPx).setTo(cv::Scalar::all(0));
      view->rowRange(kViewHeightPx - kBarPx, kViewHeightPx).setTo(cv::Scalar::all(0));
    });
    const model::LightField light_field = Read(folder_.Put("tiles.png", EncodedTile(tiles)));
    EXPECT_EQ(light_field.u_count, across);
    EXPECT_EQ(light_field.v_count, down);
    EXPECT_EQ(light_field.s_count, kViewWidthPx);
    EXPECT_EQ(light_field.t_count, kViewHeightPx - 2 * kBarPx);
    EXPECT_THAT(facts_.notices, ::testing::Contains(AllOf(HasSubstr("96 x 54 of 96 x 64 px"),
                                                          HasSubstr("bars of the views"))));
  }
}

TEST_F(LightFieldLayouts, LinesMayHaveTheNoiseOfJpeg) {
  for (const int level : {0, 255}) {
    const cv::Mat mosaic = Mosaic({2, 2}, {0, 0}, level);
    const model::LightField light_field =
        Read(folder_.Put("mosaic.jpg", EncodedTile(mosaic, ".jpg")));
    EXPECT_EQ(light_field.u_count, 3);
    EXPECT_EQ(light_field.v_count, 3);
    EXPECT_EQ(light_field.s_count, kViewWidthPx);
    EXPECT_EQ(light_field.t_count, kViewHeightPx);
  }
}

TEST_F(LightFieldLayouts, AnotherNumberOfTilesIsNamed) {
  constexpr int kSide = 4;
  cv::Mat tiles(kSide * kViewHeightPx, kSide * kViewWidthPx, CV_8UC3);
  for (int l = 0; l < kSide; ++l) {
    for (int k = 0; k < kSide; ++k) {
      View(k, l, 0.2).copyTo(
          tiles(cv::Rect(k * kViewWidthPx, l * kViewHeightPx, kViewWidthPx, kViewHeightPx)));
    }
  }
  const std::string path = folder_.Put("tiles.png", EncodedTile(tiles));
  LightFieldReading reading;
  reading.layout = "tiles";
  reading.layout_u = reading.layout_v = 8;
  Read(path, reading);
  EXPECT_THAT(facts_.notices,
              ::testing::Contains(AllOf(HasSubstr("states 8 x 8 views"), HasSubstr("tiles:4x4"))));
  reading.layout_u = reading.layout_v = 4;
  Read(path, reading);
  EXPECT_THAT(facts_.notices, IsEmpty());
  reading.layout_u = 5;
  EXPECT_THAT(ErrorOf([&] { Read(path, reading); }), HasSubstr("tiles:4x4"));
}

TEST_F(LightFieldLayouts, PagesMayBeViews) {
  std::vector<cv::Mat> pages;
  for (int i = 0; i < 9; ++i) pages.push_back(InOrder(i % 3, i / 3));
  folder_.Put("other", "");
  const std::string path = folder_ / "pages.tif";
  ASSERT_TRUE(cv::imwritemulti(path, pages));
  EXPECT_THAT(ErrorOf([&] { Read(path); }),
              AllOf(HasSubstr("it has 9 pages"), HasSubstr("parts:3x3")));
  LightFieldReading reading;
  reading.layout = "parts";
  reading.layout_u = reading.layout_v = 3;
  ExpectViews(Read(path, reading));
  for (const int rows : {2, 4}) {
    reading.layout_v = rows;
    EXPECT_THAT(ErrorOf([&] { Read(path, reading); }),
                AllOf(HasSubstr("3 x " + std::to_string(rows) + " views"), HasSubstr("but 9 are"),
                      Not(HasSubstr("sparse"))));
  }
}

TEST_F(LightFieldLayouts, FilesOfOtherKindsAreNamed) {
  for (const auto& [start, what] :
       {std::pair("\x93NUMPY\1", "NumPy"), std::pair("PK\3\4", "ZIP"), std::pair("GIF89a", "GIF"),
        std::pair("\x89LFP", "Lytro"), std::pair("1234ftypisom", "a video")}) {
    const std::string path = folder_.Put("lf.dat", start + std::string(40, ' '));
    EXPECT_THAT(ErrorOf([&] { Read(path); }), HasSubstr(what));
  }
}

TEST_F(LightFieldLayouts, AnUnusedGridIsNamed) {
  LightFieldReading reading;
  reading.grid = 5;
  ExpectViews(Read(Folder(RowAndColumn, InOrder), reading));
  EXPECT_THAT(facts_.one_line, HasSubstr("the option grid is not used"));
}

TEST_F(LightFieldLayouts, WhatDoesNotFitIsNamed) {
  const std::string path = Folder(RowAndColumn, InOrder);
  LightFieldReading reading;
  reading.layout = "quilt";
  EXPECT_THAT(ErrorOf([&] { Read(path, reading); }), HasSubstr("is a folder"));
  reading.layout = "lytro";
  EXPECT_THAT(ErrorOf([&] { Read(path, reading); }), HasSubstr("found 'lytro'"));
  std::remove((path + "/view_1_1.png").c_str());
  EXPECT_THAT(ErrorOf([&] { Read(path); }),
              AllOf(HasSubstr("row 1, column 1"), HasSubstr("sparse")));
  reading = {};
  reading.sparse = true;
  EXPECT_FALSE(Read(path, reading).IsPresent(1, 1));
  EXPECT_THAT(facts_.one_line, HasSubstr("missing: the view in row 1, column 1"));
  folder_.Put("lf/view_999999_7.png", EncodedTile(View(0, 0)));
  EXPECT_THAT(ErrorOf([&] { Read(path); }), HasSubstr("at most"));
  EXPECT_THAT(
      ErrorOf([&] { Read(folder_.Put("a_qs2x2a1.png", EncodedTile(View(0, 0)).substr(0, 99))); }),
      HasSubstr("a_qs2x2a1.png"));
}

}  // namespace
}  // namespace thicklens::io
