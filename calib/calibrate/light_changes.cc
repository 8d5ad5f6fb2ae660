#include "calib/calibrate/light_changes.h"

#include <algorithm>
#include <cmath>
#include <opencv2/core.hpp>

#include "calib/registration/scale_tracking.h"
#include "thicklens/base/cancel.h"

namespace thicklens::calib {
namespace {

constexpr std::size_t kMinLightFrames = 5;
constexpr int kPlacesPerSide = 96;
constexpr double kMinPower = -2.2, kMaxPower = 0.2;  // of the depth, of the light of a lamp
constexpr double kDarkestValue = 1e-6;

// The part of the target that all frames show, px from the centre of the reference.
struct SharedPart {
  Eigen::Vector2d low{-1e300, -1e300}, high{1e300, 1e300};
};

// Linear light of the colours (or of grey), means over the shared part. What is fixed to the frame
// is taken out, because frames at other scales show the part at other pixels.
std::vector<double> LightOfPart(std::size_t frame, const FocusSweep& sweep,
                                const Registration& registration, const SharedPart& part,
                                FrameStore* store) {
  const cv::Point2d centre = RegionCentre(sweep);
  std::vector<cv::Mat> light;
  if (store->Stored(frame).channels() >= 3) {
    for (int c = 0; c < 3; ++c) light.push_back(store->Channel(frame, c));
  } else {
    light.push_back(store->Grey(frame));
  }
  std::vector<double> sums(light.size());
  int count = 0;
  for (int j = 0; j < kPlacesPerSide; ++j) {
    for (int i = 0; i < kPlacesPerSide; ++i) {
      const Eigen::Vector2d share((i + 0.5) / kPlacesPerSide, (j + 0.5) / kPlacesPerSide);
      const Eigen::Vector2d q = part.low + share.cwiseProduct(part.high - part.low);
      const Eigen::Vector2d p = registration.shift_px + registration.scale * q;
      const int x = static_cast<int>(std::lround(p.x() + centre.x));
      const int y = static_cast<int>(std::lround(p.y() + centre.y));
      if (x < 0 || y < 0 || x >= light.front().cols || y >= light.front().rows) continue;
      ++count;
      for (std::size_t c = 0; c < light.size(); ++c)
        sums[c] += static_cast<double>(light[c].at<float>(y, x));
    }
  }
  for (double& sum : sums) sum = std::max(kDarkestValue, sum / std::max(1, count));
  return sums;
}

// The slope of y against x.
double SlopeOf(const std::vector<double>& x, const std::vector<double>& y) {
  const auto n = static_cast<double>(x.size());
  double mean_x = 0, mean_y = 0, square = 0, product = 0;
  for (std::size_t i = 0; i < x.size(); ++i) {
    mean_x += x[i] / n;
    mean_y += y[i] / n;
  }
  for (std::size_t i = 0; i < x.size(); ++i) {
    square += (x[i] - mean_x) * (x[i] - mean_x);
    product += (x[i] - mean_x) * (y[i] - mean_y);
  }
  return square > 0 ? product / square : 0;
}

double RangeOf(const std::vector<double>& values) {
  const auto [least, most] = std::minmax_element(values.begin(), values.end());
  return *most - *least;
}

}  // namespace

void MeasureLightChanges(const FocusSweep& sweep, const std::vector<ScaleSample>& samples,
                         const std::vector<FrameMeasurement>& frames, bool depths_are_known,
                         double exponent, FrameStore* store, FrameLight* light) {
  std::vector<const ScaleSample*> chosen;
  for (const ScaleSample& sample : samples) {
    if (!sample.scale_is_from_reading && frames[sample.frame].rejection.empty())
      chosen.push_back(&sample);
  }
  if (chosen.size() < kMinLightFrames) return;
  const cv::Point2d centre = RegionCentre(sweep);
  const bool is_whole = !(sweep.roi.width > 0);
  const Eigen::Vector2d size =
      is_whole ? Eigen::Vector2d(sweep.camera.sensor.width_px, sweep.camera.sensor.height_px)
               : Eigen::Vector2d(sweep.roi.width, sweep.roi.height);
  SharedPart part;
  for (const ScaleSample* sample : chosen) {
    const Eigen::Vector2d shift = sample->registration.shift_px;
    const Eigen::Vector2d first = Eigen::Vector2d(-centre.x, -centre.y) - shift;
    const Eigen::Vector2d last = first + size - Eigen::Vector2d::Ones();
    part.low = part.low.cwiseMax(first / sample->scale);
    part.high = part.high.cwiseMin(last / sample->scale);
  }
  if (!((part.high - part.low).minCoeff() > 0)) return;
  std::vector<double> readings, depths, exposure, red, blue;
  for (const ScaleSample* sample : chosen) {
    ThrowIfCancelled();
    Registration registration = sample->registration;
    registration.scale = sample->scale;
    const std::vector<double> means = LightOfPart(sample->frame, sweep, registration, part, store);
    const double depth_mm = frames[sample->frame].depth_mm;
    readings.push_back(sample->reading_mm);
    depths.push_back(depths_are_known && depth_mm > 0 ? std::log2(depth_mm) : 0);
    // The green of a colour frame, which is the least affected by a white balance.
    exposure.push_back(exponent * std::log2(means[means.size() >= 3 ? 1 : 0]));
    if (means.size() < 3) continue;
    red.push_back(exponent * std::log(means[0] / means[1]));
    blue.push_back(exponent * std::log(means[2] / means[1]));
  }
  const double power = std::clamp(SlopeOf(depths, exposure), kMinPower, kMaxPower);
  for (std::size_t i = 0; i < exposure.size(); ++i) exposure[i] -= power * depths[i];
  light->exposure_range_stops = RangeOf(exposure);
  light->exposure_trend_stops = SlopeOf(readings, exposure) * RangeOf(readings);
  if (red.size() < chosen.size()) return;
  light->red_change = std::expm1(RangeOf(red));
  light->blue_change = std::expm1(RangeOf(blue));
}

}  // namespace thicklens::calib
