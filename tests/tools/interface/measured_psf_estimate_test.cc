// Estimates of photographs through apertures that are neither a disc nor a Gaussian.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <memory>
#include <utility>
#include <vector>

#include "support/test_cameras.h"
#include "thicklens/estimate.h"
#include "thicklens/model/light_field_grid.h"
#include "thicklens/model/measured_psf.h"
#include "thicklens/render.h"

namespace thicklens {
namespace {

constexpr int kSidePx = 72, kBorderPx = 14;
constexpr double kFocusMm = 1000;

// Light over the aperture in blur radii, x to the right, y down as the scene sees it.
using Shape = std::function<double(double x, double y)>;

double Disc(double x, double y) { return x * x + y * y <= 1 ? 1 : 0; }

// A disc of which the right side is cut off; its centroid is in the middle.
double CatEye(double x, double y) {
  const double u = x - 0.3975;
  return u * u + y * y <= 1 && u < 0.05 ? 1 : 0;
}

struct Point {
  double x = 0, y = 0, weight = 0;
};

std::vector<Point> PointsOf(const Shape& shape, double step) {
  std::vector<Point> points;
  double sum = 0;
  for (double y = -1.5 + step / 2; y < 1.5; y += step) {
    for (double x = -1.5 + step / 2; x < 1.5; x += step) {
      const double weight = shape(x, y);
      if (weight > 0) points.push_back({x, y, weight});
      sum += weight;
    }
  }
  for (Point& point : points) point.weight /= sum;
  return points;
}

model::MeasuredPsf PsfOf(const Shape& shape) {
  constexpr int kSide = 31;
  model::MeasuredPsf psf;
  psf.step = 3.0 / kSide;
  psf.light = Eigen::ArrayXXd::Zero(kSide, kSide);
  for (const Point& point : PointsOf(shape, psf.step / 9)) {
    psf.light(static_cast<int>((point.y + 1.5) / psf.step),
              static_cast<int>((point.x + 1.5) / psf.step)) += point.weight;
  }
  return Normalised(psf);
}

// The texture of the scene at a place of the view from the middle of the aperture, px.
double Texture(double x, double y) {
  double sum = 0.5;
  for (int i = 0; i < 9; ++i) {
    const double angle = 2.4 * i, f = 0.02 + 0.014 * i;
    sum += 0.05 * std::sin(2 * 3.14159265358979 * f * (x * std::cos(angle) + y * std::sin(angle)) +
                           1.7 * i);
  }
  return sum;
}

class Photographed {
 public:
  Photographed(const Shape& shape, double depth_mm, int views)
      : psf_(PsfOf(shape)), points_(PointsOf(shape, 0.1)), depth_mm_(depth_mm), views_(views) {
    camera_ = thicklens::testing::TestCameraFocusedAt(
        kFocusMm, "shaped", thicklens::testing::ThinLens(50, 2),
        thicklens::testing::CentredSensor(kSidePx, kSidePx, 0.003, TransferCurve::Linear()),
        {psf_.BlurRatio(), 0});
    camera_.psf = model::Psf::kDisc;
  }

  const model::MeasuredPsf& psf() const { return psf_; }

  // Disparity of a plane for a step of 1 mm on the aperture, px.
  double PxPerMm(double depth_mm) const { return model::DisparityPx(camera_, 1, depth_mm); }

  // The image that the aperture makes of the plane, for a focus at which a step of 1 mm is
  // `px_per_mm`.
  double Blurred(double x, double y, double px_per_mm) const {
    double sum = 0;
    const double radius_mm = camera_.lens.aperture_radius_mm;
    for (const Point& point : points_) {
      sum += point.weight *
             Texture(x + point.x * radius_mm * px_per_mm, y + point.y * radius_mm * px_per_mm);
    }
    return sum;
  }

  Image Photo() const {
    std::vector<float> values;
    for (int y = 0; y < kSidePx; ++y) {
      for (int x = 0; x < kSidePx; ++x)
        values.push_back(static_cast<float>(Blurred(x, y, PxPerMm(depth_mm_))));
    }
    return Image::FromLight(kSidePx, kSidePx, ChannelOrder::kGrey, std::move(values),
                            TransferCurve::Linear());
  }

  // The estimate with a PSF as the measured one; null: with the disc.
  LightField Estimate(const model::MeasuredPsf* psf) const {
    Camera camera = camera_;
    const bool is_measured = psf != nullptr;
    if (is_measured) camera.measured_psf = std::make_shared<const model::MeasuredPsf>(*psf);
    DepthMap depth;
    depth.width_px = depth.height_px = kSidePx;
    depth.values.assign(static_cast<std::size_t>(kSidePx * kSidePx), static_cast<float>(depth_mm_));
    depth.meaning.kind = DepthKind::kZ;
    depth.meaning.unit = LengthUnit::kMillimetre;
    EstimateOptions options;
    options.views = ViewCounts{views_, views_};
    options.device = "cpu";
    LightFieldEstimate estimate = EstimateLightField(Photo(), depth, camera, options);
    EXPECT_EQ(estimate.diagnostics.aperture_shape, is_measured ? "measured" : "disc");
    EXPECT_EQ(estimate.diagnostics.aperture_from, "camera");
    return std::move(estimate.light_field);
  }

  // PSNR of all views against the texture seen from their own places.
  double ViewsDb(const LightField& found) const {
    const Eigen::Vector2d step_mm = model::ApertureStepsMm(*found.grid, camera_);
    const double px_per_mm = PxPerMm(depth_mm_);
    double squares = 0;
    int count = 0;
    for (int l = 0; l < found.v_count; ++l) {
      for (int k = 0; k < found.u_count; ++k) {
        const model::LinearImage view = model::ViewImage(found, k, l);
        for (int y = kBorderPx; y < kSidePx - kBorderPx; ++y) {
          for (int x = kBorderPx; x < kSidePx - kBorderPx; ++x) {
            const double truth =
                Texture(x + (k - (found.u_count - 1) / 2.0) * step_mm.x() * px_per_mm,
                        y + (l - (found.v_count - 1) / 2.0) * step_mm.y() * px_per_mm);
            const double value = view.values[static_cast<std::size_t>(y * kSidePx + x)];
            squares += (value - truth) * (value - truth);
            ++count;
          }
        }
      }
    }
    return -10 * std::log10(squares / count);
  }

  // PSNR of the image that is refocused halfway to the plane, against that of the true aperture.
  double RefocusedDb(const LightField& found) const {
    const double half_mm = 2 / (1 / depth_mm_ + 1 / kFocusMm);
    FocusOptions options;
    options.depth_mm = half_mm;
    const model::LinearImage image = Refocus(found, options).ToLight(TransferCurve::Linear());
    const double px_per_mm = PxPerMm(depth_mm_) - PxPerMm(half_mm);
    double squares = 0;
    int count = 0;
    for (int y = kBorderPx; y < kSidePx - kBorderPx; ++y) {
      for (int x = kBorderPx; x < kSidePx - kBorderPx; ++x) {
        const double off =
            image.values[static_cast<std::size_t>(y * kSidePx + x)] - Blurred(x, y, px_per_mm);
        squares += off * off;
        ++count;
      }
    }
    return -10 * std::log10(squares / count);
  }

 private:
  model::MeasuredPsf psf_;
  std::vector<Point> points_;
  double depth_mm_;
  int views_;
  Camera camera_;
};

TEST(MeasuredPsfEstimate, OfACutOffApertureIsBetterThanWithADisc) {
  const Photographed scene(CatEye, 890, 7);
  const LightField disc = scene.Estimate(nullptr), measured = scene.Estimate(&scene.psf());
  EXPECT_GT(scene.ViewsDb(measured), scene.ViewsDb(disc) + 3);
  EXPECT_GT(scene.RefocusedDb(measured), scene.RefocusedDb(disc) + 3);
  EXPECT_GT(scene.ViewsDb(measured), 30);
  // The sides of the shape are not exchanged: turned by half a turn it describes the photograph
  // worse.
  model::MeasuredPsf turned = scene.psf();
  turned.light = turned.light.reverse().eval();
  EXPECT_GT(scene.ViewsDb(measured), scene.ViewsDb(scene.Estimate(&turned)) + 3);
}

// A disc that was measured gives the results of the disc.
TEST(MeasuredPsfEstimate, OfADiscIsThatOfTheDisc) {
  const Photographed scene(Disc, 890, 7);
  const LightField disc = scene.Estimate(nullptr), measured = scene.Estimate(&scene.psf());
  EXPECT_GT(scene.ViewsDb(measured), scene.ViewsDb(disc) - 0.3);
  EXPECT_GT(scene.RefocusedDb(measured), scene.RefocusedDb(disc) - 0.3);
}

}  // namespace
}  // namespace thicklens
