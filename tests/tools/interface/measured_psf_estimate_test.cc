// Estimates of photographs through apertures that are neither a disc nor a Gaussian.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <complex>
#include <memory>
#include <random>
#include <string>
#include <utility>
#include <vector>

#include "support/test_cameras.h"
#include "thicklens/estimate.h"
#include "thicklens/model/aperture_outline.h"
#include "thicklens/model/light_field_grid.h"
#include "thicklens/model/measured_psf.h"
#include "thicklens/render.h"

namespace thicklens {
namespace {

constexpr int kSidePx = 72, kBorderPx = 14;
constexpr double kFocusMm = 1000;
constexpr double kPi = 3.14159265358979;
constexpr int kWaves = 9;

// An aperture in blur radii, x to the right, y down as the scene sees it: a convex polygon, whose
// transform and moments have closed forms, so that neither photograph nor shape is sampled.
class Aperture {
 public:
  // The part of a regular polygon whose x is below a limit, with its centroid in the middle.
  Aperture(int corners, double rotation_rad, double limit = 2) {
    std::vector<Eigen::Vector2d> all;
    for (int i = 0; i < corners; ++i) {
      const double angle = rotation_rad + 2 * kPi * i / corners;
      all.emplace_back(std::cos(angle), std::sin(angle));
    }
    corners_ = Below(all, {1, 0}, limit);
    const Eigen::Vector2d centroid = model::MomentsOf(corners_).centroid;
    for (Eigen::Vector2d& corner : corners_) corner -= centroid;
    moments_ = model::MomentsOf(corners_);
  }

  double blur_ratio() const { return moments_.Sigma(); }
  // Transform at a frequency in cycles per blur radius, of a light that is displaced by +x.
  std::complex<double> Transfer(const Eigen::Vector2d& f) const {
    return std::conj(model::PolygonTransfer(corners_, moments_, f));
  }

  // The light in cells, each the area of the polygon in it.
  model::MeasuredPsf Psf() const {
    constexpr int kSide = 31;
    model::MeasuredPsf psf;
    psf.step = 2.4 / kSide;
    psf.light = Eigen::ArrayXXd::Zero(kSide, kSide);
    for (int j = 0; j < kSide; ++j) {
      for (int i = 0; i < kSide; ++i) {
        const Eigen::Vector2d low = psf.step * Eigen::Vector2d(i, j).array() - 1.2;
        std::vector<Eigen::Vector2d> part = corners_;
        for (const int axis : {0, 1}) {
          const Eigen::Vector2d normal = Eigen::Vector2d::Unit(axis);
          part = Below(part, normal, low[axis] + psf.step);
          part = Below(part, -normal, -low[axis]);
        }
        if (part.size() > 2) psf.light(j, i) = model::MomentsOf(part).area;
      }
    }
    return Normalised(psf);
  }

 private:
  static std::vector<Eigen::Vector2d> Below(const std::vector<Eigen::Vector2d>& corners,
                                            const Eigen::Vector2d& normal, double limit) {
    std::vector<Eigen::Vector2d> kept;
    for (std::size_t i = 0; i < corners.size(); ++i) {
      const Eigen::Vector2d &here = corners[i], &next = corners[(i + 1) % corners.size()];
      const double beyond = normal.dot(here) - limit, after = normal.dot(next) - limit;
      if (beyond <= 0) kept.push_back(here);
      if (beyond * after < 0) kept.push_back(here + (next - here) * (beyond / (beyond - after)));
    }
    return kept;
  }

  std::vector<Eigen::Vector2d> corners_;
  model::PolygonMoments moments_;
};

Aperture Disc() { return {120, 0}; }
// A disc of which the right side is cut off.
Aperture CatEye() { return {120, 0, 0.05}; }

// The texture of the scene: waves, as seen from the middle of the aperture.
class Texture {
 public:
  explicit Texture(unsigned seed) {
    std::mt19937_64 draws(seed);
    const auto uniform = [&draws] { return static_cast<double>(draws() >> 11) * 0x1p-53; };
    for (int i = 0; i < kWaves; ++i) {
      const double angle = 2 * kPi * uniform(), f = 0.02 + 0.014 * i;
      waves_.push_back(
          {f * Eigen::Vector2d(std::cos(angle), std::sin(angle)), 2 * kPi * uniform()});
    }
  }

  // Returns each wave behind a blur whose transform at a frequency in cycles per px is
  // `transfer`.
  template <class Transfer>
  std::vector<std::complex<double>> Behind(const Transfer& transfer) const {
    std::vector<std::complex<double>> left;
    for (const Wave& wave : waves_) left.push_back(transfer(wave.frequency));
    return left;
  }
  double At(double x, double y, const std::vector<std::complex<double>>& left) const {
    double sum = 0.5;
    for (std::size_t i = 0; i < waves_.size(); ++i) {
      const double phase = 2 * kPi * waves_[i].frequency.dot(Eigen::Vector2d(x, y));
      sum += 0.05 * (left[i] * std::polar(1.0, phase + waves_[i].phase)).imag();
    }
    return sum;
  }

 private:
  struct Wave {
    Eigen::Vector2d frequency;
    double phase = 0;
  };
  std::vector<Wave> waves_;
};

class Photographed {
 public:
  Photographed(const Aperture& aperture, double depth_mm, int views, unsigned seed = 1)
      : aperture_(aperture),
        texture_(seed),
        psf_(aperture.Psf()),
        depth_mm_(depth_mm),
        views_(views) {
    camera_ = thicklens::testing::TestCameraFocusedAt(
        kFocusMm, "shaped", thicklens::testing::ThinLens(50, 2),
        thicklens::testing::CentredSensor(kSidePx, kSidePx, 0.003, TransferCurve::Linear()),
        {aperture.blur_ratio(), 0});
    camera_.psf = model::Psf::kDisc;
  }

  const model::MeasuredPsf& psf() const { return psf_; }

  // Disparity of a plane for a step of 1 mm on the aperture, px.
  double PxPerMm(double depth_mm) const { return model::DisparityPx(camera_, 1, depth_mm); }

  // Returns the texture's waves in the image of the plane, for a focus at which a step of
  // 1 mm on the aperture is `px_per_mm`.
  std::vector<std::complex<double>> Blur(double px_per_mm) const {
    const double radius_px = camera_.lens.aperture_radius_mm * px_per_mm;
    return texture_.Behind(
        [&](const Eigen::Vector2d& f) { return aperture_.Transfer(radius_px * f); });
  }

  Image Photo() const {
    const auto blur = Blur(PxPerMm(depth_mm_));
    std::vector<float> values;
    for (int y = 0; y < kSidePx; ++y) {
      for (int x = 0; x < kSidePx; ++x)
        values.push_back(static_cast<float>(texture_.At(x, y, blur)));
    }
    return Image::FromLight(kSidePx, kSidePx, ChannelOrder::kGrey, std::move(values),
                            TransferCurve::Linear());
  }

  // The estimate with a PSF as the measured one; null: with the disc.
  LightField Estimate(const model::MeasuredPsf* psf, const AnySolver& solver = SceneSolver{},
                      const std::string& device = "cpu") const {
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
    options.device = device;
    options.solver = solver;
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
    const std::vector<std::complex<double>> sharp(kWaves, 1);
    for (int l = 0; l < found.v_count; ++l) {
      for (int k = 0; k < found.u_count; ++k) {
        const model::LinearImage view = model::ViewImage(found, k, l);
        for (int y = kBorderPx; y < kSidePx - kBorderPx; ++y) {
          for (int x = kBorderPx; x < kSidePx - kBorderPx; ++x) {
            const double truth =
                texture_.At(x + (k - (found.u_count - 1) / 2.0) * step_mm.x() * px_per_mm,
                            y + (l - (found.v_count - 1) / 2.0) * step_mm.y() * px_per_mm, sharp);
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
    const auto blur = Blur(PxPerMm(depth_mm_) - PxPerMm(half_mm));
    double squares = 0;
    int count = 0;
    for (int y = kBorderPx; y < kSidePx - kBorderPx; ++y) {
      for (int x = kBorderPx; x < kSidePx - kBorderPx; ++x) {
        const double off =
            image.values[static_cast<std::size_t>(y * kSidePx + x)] - texture_.At(x, y, blur);
        squares += off * off;
        ++count;
      }
    }
    return -10 * std::log10(squares / count);
  }

 private:
  Aperture aperture_;
  Texture texture_;
  model::MeasuredPsf psf_;
  double depth_mm_;
  int views_;
  Camera camera_;
};

TEST(MeasuredPsfEstimate, OfACutOffApertureIsBetterThanWithADisc) {
  const Photographed scene(CatEye(), 890, 7);
  const LightField disc = scene.Estimate(nullptr), measured = scene.Estimate(&scene.psf());
  EXPECT_GT(scene.ViewsDb(measured), scene.ViewsDb(disc) + 3);
  EXPECT_GT(scene.RefocusedDb(measured), scene.RefocusedDb(disc) + 3);
  // The sides of the shape are not exchanged: turned by half a turn it describes the photograph
  // worse.
  model::MeasuredPsf turned = scene.psf();
  turned.light = turned.light.reverse().eval();
  EXPECT_GT(scene.ViewsDb(measured), scene.ViewsDb(scene.Estimate(&turned)) + 3);
}

// A disc that was measured gives nearly the results of the disc, whose views are all or nothing at
// the rim.
TEST(MeasuredPsfEstimate, OfADiscIsThatOfTheDisc) {
  const Photographed scene(Disc(), 890, 7);
  const LightField disc = scene.Estimate(nullptr), measured = scene.Estimate(&scene.psf());
  EXPECT_GT(scene.ViewsDb(measured), scene.ViewsDb(disc) - 0.5);
  EXPECT_GT(scene.RefocusedDb(measured), scene.RefocusedDb(disc) - 0.5);
}

}  // namespace
}  // namespace thicklens
