// Depth maps of another size, brought to the pixels of a photograph. The oracle is a scene whose
// depth and light are closed forms at any position.
#include "thicklens/estimator/resample_depth.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <functional>
#include <limits>
#include <random>
#include <vector>

#include "support/error_message.h"

namespace thicklens::estimator {
namespace {

using testing::ErrorOf;
using ::testing::HasSubstr;

constexpr int kWidth = 120, kHeight = 96;
constexpr double kFar = -1, kNear = 2;
using Form = std::function<double(double x, double y)>;

bool IsOnDisc(double x, double y) { return std::hypot(x - 58.3, y - 47.6) < 27; }
double Disc(double x, double y) { return IsOnDisc(x, y) ? kNear : kFar; }
double Plane(double x, double y) { return 0.4 + 0.013 * x - 0.021 * y; }

// The samples of a map of every `step` pixels whose areas coincide with the photograph's.
DepthSampling SamplesOf(const Form& form, int width, int height) {
  const MapPlacement place = PlaceOn({0, 0}, {kWidth, kHeight}, width, height);
  DepthSampling map{width, height, {}, {}};
  for (int j = 0; j < height; ++j) {
    for (int i = 0; i < width; ++i) {
      map.values.push_back(static_cast<float>(form(place.first_px.x() + i * place.step_px.x(),
                                                   place.first_px.y() + j * place.step_px.y())));
    }
  }
  return map;
}

model::LinearImage PhotoOf(const Form& light, double noise = 0) {
  model::LinearImage photo{kWidth, kHeight, 1, {}};
  std::mt19937 engine(11);
  std::normal_distribution<double> normal(0, 1);
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth; ++x)
      photo.values.push_back(static_cast<float>(light(x, y) + noise * normal(engine)));
  }
  return photo;
}
model::LinearImage PhotoOfDisc(double noise = 0.01) {
  return PhotoOf([](double x, double y) { return IsOnDisc(x, y) ? 0.7 : 0.3; }, noise);
}
double Even(double, double) { return 0.5; }

double ShareOff(const std::vector<float>& values, const Form& truth, double by) {
  int off = 0;
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth; ++x) {
      const auto value = static_cast<double>(values[static_cast<std::size_t>(y * kWidth + x)]);
      if (!(std::abs(value - truth(x, y)) <= by)) ++off;
    }
  }
  return static_cast<double>(off) / (kWidth * kHeight);
}

ResampledDepth Fitted(const DepthSampling& map, const model::LinearImage& photo, int threads = 2) {
  return ResampleDepth(map, photo, PlaceOn({0, 0}, {kWidth, kHeight}, map.width_px, map.height_px),
                       threads);
}

TEST(ResampleDepth, PlanesKeepTheirPlaceAtAnyFactor) {
  // 120/16 = 7.5 and 96/13 = 7.38 are no whole numbers.
  for (const auto& [width, height] : {std::pair(30, 24), std::pair(16, 13), std::pair(240, 192)}) {
    const ResampledDepth found = Fitted(SamplesOf(Plane, width, height), PhotoOf(Even));
    for (int y = 4; y < kHeight - 4; ++y) {
      for (int x = 4; x < kWidth - 4; ++x) {
        EXPECT_NEAR(static_cast<double>(found.values[static_cast<std::size_t>(y * kWidth + x)]),
                    Plane(x, y), 1e-4)
            << width << " x " << height << " at " << x << ", " << y;
      }
    }
  }
}

TEST(ResampleDepth, ThePhotographDecidesWhereASurfaceEnds) {
  const DepthSampling map = SamplesOf(Disc, 15, 12);
  const double with_photo = ShareOff(Fitted(map, PhotoOfDisc()).values, Disc, 0.1);
  const double without = ShareOff(Fitted(map, PhotoOf(Even)).values, Disc, 0.1);
  EXPECT_LT(with_photo, 0.006);
  EXPECT_GT(without, 2 * with_photo);
}

TEST(ResampleDepth, NoValueAppearsBetweenTwoSurfaces) {
  // Averages of areas, so that the samples themselves are mixtures along the rim.
  const DepthSampling fine = SamplesOf(Disc, kWidth, kHeight);
  DepthSampling map{15, 12, {}, {}};
  for (int j = 0; j < map.height_px; ++j) {
    for (int i = 0; i < map.width_px; ++i) {
      double sum = 0;
      for (int v = 0; v < 8; ++v) {
        for (int u = 0; u < 8; ++u)
          sum += static_cast<double>(
              fine.values[static_cast<std::size_t>((j * 8 + v) * kWidth + i * 8 + u)]);
      }
      map.values.push_back(static_cast<float>(sum / 64));
    }
  }
  const ResampledDepth found = Fitted(map, PhotoOfDisc());
  EXPECT_GT(found.mixed_samples, 0U);
  int between = 0;
  for (const float value : found.values) between += value > kFar + 0.75 && value < kNear - 0.75;
  EXPECT_LT(between, 0.003 * kWidth * kHeight);
  EXPECT_LT(ShareOff(found.values, Disc, 0.75), 0.02);
}

TEST(ResampleDepth, ALargerMapGivesTheSurfaceThatFillsMostOfAPixel) {
  const ResampledDepth found = Fitted(SamplesOf(Disc, 3 * kWidth, 3 * kHeight), PhotoOf(Even));
  for (const float value : found.values)
    EXPECT_TRUE(value == static_cast<float>(kFar) || value == static_cast<float>(kNear)) << value;
  EXPECT_LT(ShareOff(found.values, Disc, 0.1), 0.01);
}

TEST(ResampleDepth, HolesStayHolesAndAreNotAveraged) {
  const float hole = std::numeric_limits<float>::quiet_NaN();
  for (const int factor : {4, 1}) {
    DepthSampling map = SamplesOf(Plane, kWidth / factor, kHeight / factor);
    const int middle_x = map.width_px / 2, middle_y = map.height_px / 2;
    for (int j = middle_y - 2; j < middle_y + 2; ++j) {
      for (int i = middle_x - 2; i < middle_x + 2; ++i)
        map.values[static_cast<std::size_t>(j * map.width_px + i)] = hole;
    }
    const ResampledDepth found = Fitted(map, PhotoOf(Even));
    int holes = 0;
    for (int y = 0; y < kHeight; ++y) {
      for (int x = 0; x < kWidth; ++x) {
        const float value = found.values[static_cast<std::size_t>(y * kWidth + x)];
        if (std::isnan(value)) {
          ++holes;
          EXPECT_LE(std::abs(x - kWidth / 2 + 0.5), 2 * factor) << factor;
          EXPECT_LE(std::abs(y - kHeight / 2 + 0.5), 2 * factor) << factor;
        } else if (x > 3 && y > 3 && x < kWidth - 4 && y < kHeight - 4) {
          EXPECT_NEAR(static_cast<double>(value), Plane(x, y), 0.05) << x << ", " << y;
        }
      }
    }
    EXPECT_NEAR(holes, 16 * factor * factor, 4 * factor * factor) << factor;
  }
}

TEST(ResampleDepth, ConfidenceIsAWeightAndZeroIsAHole) {
  DepthSampling map = SamplesOf(Plane, 30, 24);
  map.confidence.assign(map.values.size(), 1.0F);
  const auto at = static_cast<std::size_t>(12 * 30 + 15);
  map.values[at] = 40;  // an outlier that the confidence knows
  map.confidence[at] = 0;
  const ResampledDepth found = Fitted(map, PhotoOf(Even));
  for (const float value : found.values) EXPECT_FALSE(value > 5) << value;
  EXPECT_EQ(found.confidence.size(), found.values.size());
  // The sample's own pixels are holes, and its neighbours' are not.
  EXPECT_TRUE(std::isnan(found.values[static_cast<std::size_t>(49 * kWidth + 61)]));
  EXPECT_FALSE(std::isnan(found.values[static_cast<std::size_t>(49 * kWidth + 55)]));
  EXPECT_LT(found.confidence[static_cast<std::size_t>(49 * kWidth + 61)], 0.5F);
  EXPECT_EQ(found.confidence[static_cast<std::size_t>(20 * kWidth + 20)], 1.0F);
}

TEST(ResampleDepth, PixelsBeyondTheMapAreHoles) {
  const DepthSampling map{4, 4, std::vector<float>(16, 1.5F), {}};
  const ResampledDepth found =
      ResampleDepth(map, PhotoOf(Even), PlaceOn({20, 10}, {40, 40}, 4, 4), 1);
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth; ++x) {
      const bool is_inside = x >= 20 && x < 60 && y >= 10 && y < 50;
      EXPECT_EQ(std::isnan(found.values[static_cast<std::size_t>(y * kWidth + x)]), !is_inside)
          << x << ", " << y;
    }
  }
}

TEST(ResampleDepth, GivesTheSameBitsOnAnyNumberOfThreads) {
  const DepthSampling map = SamplesOf(Disc, 15, 12);
  const model::LinearImage photo = PhotoOfDisc();
  EXPECT_EQ(Fitted(map, photo, 1).values, Fitted(map, photo, 3).values);
}

TEST(ResampleDepth, RefusesWhatDoesNotFit) {
  DepthSampling map = SamplesOf(Plane, 30, 24);
  EXPECT_THAT(ErrorOf([&] {
                ResampleDepth(map, PhotoOf(Even), {{0, 0}, {0, 4}}, 1);
              }),
              HasSubstr("> 0 is expected"));
  map.values.pop_back();
  EXPECT_THAT(ErrorOf([&] { Fitted(map, PhotoOf(Even)); }), HasSubstr("719 values"));
}

// Many discs, so that many tiles show an edge.
double Discs(double x, double y) {
  return std::hypot(std::fmod(x, 30) - 15, std::fmod(y, 24) - 12) < 9 ? kNear : kFar;
}

TEST(EdgeAgreement, TellsSamplesAtCornersFromThoseAtCentres) {
  const model::LinearImage photo =
      PhotoOf([](double x, double y) { return Discs(x, y) > 0 ? 0.7 : 0.3; }, 0.02);
  const MapPlacement centred = PlaceOn({0, 0}, {kWidth, kHeight}, kWidth / 6, kHeight / 6);
  MapPlacement cornered = centred;
  cornered.first_px.setZero();
  const auto agreement = [&](const DepthSampling& map, const MapPlacement& place) {
    return AgreementOf(map, photo, place, 2);
  };
  const DepthSampling at_centres = SamplesOf(Discs, kWidth / 6, kHeight / 6);
  DepthSampling at_corners = at_centres;
  for (int j = 0; j < at_corners.height_px; ++j) {
    for (int i = 0; i < at_corners.width_px; ++i)
      at_corners.values[static_cast<std::size_t>(j * at_corners.width_px + i)] =
          static_cast<float>(Discs(6 * i, 6 * j));
  }
  EXPECT_GT(SigmaBetter(agreement(at_corners, centred), agreement(at_corners, cornered)), 4);
  EXPECT_LT(SigmaBetter(agreement(at_centres, centred), agreement(at_centres, cornered)), -4);
  // A photograph without edges decides nothing.
  const model::LinearImage even = PhotoOf(Even, 0.02);
  EXPECT_LT(std::abs(SigmaBetter(AgreementOf(at_corners, even, centred, 2),
                                 AgreementOf(at_corners, even, cornered, 2))),
            4);
}

}  // namespace
}  // namespace thicklens::estimator
