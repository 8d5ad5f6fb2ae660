#include "calib/uncertainty/field_map.h"

#include <fmt/format.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <opencv2/core.hpp>

#include "calib/fit/misfit_causes.h"
#include "calib/uncertainty/astigmatism.h"
#include "calib/uncertainty/axis_focus.h"
#include "calib/uncertainty/colour_focus.h"
#include "calib/uncertainty/evenly_spread.h"
#include "calib/uncertainty/field_astigmatism.h"
#include "calib/uncertainty/systematic_advice.h"
#include "thicklens/base/cancel.h"
#include "thicklens/base/parallel.h"
#include "thicklens/base/pi.h"
#include "thicklens/base/statistics.h"
#include "thicklens/model/lens_aberrations.h"

namespace thicklens::calib {
namespace {

constexpr double kSmallField = 240;  // px; three tiles per side below, five above
constexpr int kModesPerRing = 48;
constexpr std::size_t kMinTiles = 5;
constexpr double kSpreadOverErrors = 4;  // ratio of squares; below it the tiles agree
constexpr double kApart = 6;             // standard deviations between depths of a target
constexpr double kRoughSurface = 4;  // chi^2 per dof of a smooth field above which depths differ
// Part of the mean below which channels are copies. Those of a grey target differ by their noise
// alone, which may be less than 1 % of the light.
constexpr double kColourDifference = 0.001;
// At most this many frames of a longer sweep are mapped, evenly spread: the time to fit one part
// grows with the square of its frames, and all parts' spectra are in memory at once.
constexpr std::size_t kMaxFrames = 128;
// The coarse map in place of the whole one.
constexpr std::size_t kMaxCoarseFrames = 24;
constexpr int kCoarseSide = 3, kCoarseModesPerRing = 24;
constexpr double kCurved = 3;  // standard deviations of a curvature
// A surface describes the tiles if it leaves less than this part of their variance. A plane leaves
// a quarter of that of a step.
constexpr double kUnexplained = 0.1;
// Median over the tiles of chi^2 per degree of freedom of their spectra with one variance for all
// directions. Below it, the astigmatism of the field changes nothing. Simulated sweeps of isotropic
// lenses have 0.7 to 1.5.
constexpr double kMisfitOfOneVariance = 1.5;
// Second moment along one axis of the square of a tile's window, cos^2, over the square of its
// side.
constexpr double kWindowMoment = 0.02;

class Field {
 public:
  Field(const FocusSweep& sweep, const BlurEvidence& evidence, const BlurFitResult& fit,
        FrameStore* store, Calibration* calibration)
      : sweep_(sweep), evidence_(evidence), fit_(fit), store_(*store), result_(*calibration) {
    setup_ = evidence.spectral;
    setup_.modes_per_ring = kModesPerRing;
    KeepUsedFrames();
  }

  // A few large tiles of a few frames, which cost a small part of the map. Only the interval of zf,
  // and the warnings if the tiles differ, remain of them. Colours are compared in the same frames.
  void RunCoarsely() {
    if (evidence_.spectrum < 0 || setup_.frames.size() < 5) return;
    ThinOut(kMaxCoarseFrames);
    setup_.modes_per_ring = kCoarseModesPerRing;
    setup_.read_grey = [this](std::size_t frame) { return store_.Grey(frame); };
    MapTiles(kCoarseSide);
    result_.diagnostics.field = {};
    result_.diagnostics.field.message = "the map was not requested";
    MeasureChannels();
  }

  void Run() {
    FieldMap& map = result_.diagnostics.field;
    if (evidence_.spectrum < 0 || setup_.frames.size() < 5) {
      map.message = "the target must have texture over the whole field";
      return;
    }
    setup_.read_grey = [this](std::size_t frame) { return store_.Grey(frame); };
    // Astigmatism comes first, because it may cause different in-focus object distances over the
    // field.
    if (!evidence_.axial) MeasureAstigmatism(sweep_, evidence_, fit_, &result_);
    MapTiles(setup_.size_px.minCoeff() < kSmallField ? 3 : 5);
    MeasureChannels();
  }

 private:
  // Keeps the frames that are in the fit, and updates them with the fitted blur.
  void KeepUsedFrames() {
    const std::size_t reference = setup_.frames.empty() ? 0 : setup_.frames[setup_.reference].frame;
    std::vector<EstimatorFrame> kept;
    for (const EstimatorFrame& frame : setup_.frames) {
      if (!result_.frames[frame.frame].in_blur_fit) continue;
      EstimatorFrame entry = frame;
      const double depth_mm = DepthMm(frame.frame);
      entry.expected_variance_px2 =
          (fit_.values[kFloorVariance] + FittedDefocusVariance(evidence_.setup, fit_, depth_mm)) /
          (frame.place.scale * frame.place.scale);
      if (frame.frame == reference) setup_.reference = kept.size();
      kept.push_back(entry);
    }
    setup_.frames = std::move(kept);
    // The reference itself may have been rejected; without it there is nothing to refer to.
    if (setup_.frames.empty() || setup_.frames[setup_.reference].frame != reference)
      setup_.frames.clear();
    else
      ThinOut(kMaxFrames);
  }

  void ThinOut(std::size_t most) {
    std::vector<EstimatorFrame> kept;
    std::size_t reference = 0;
    for (const std::size_t f : EvenlySpread(setup_.frames.size(), setup_.reference, most)) {
      if (f == setup_.reference) reference = kept.size();
      kept.push_back(setup_.frames[f]);
    }
    setup_.frames = std::move(kept);
    setup_.reference = reference;
  }

  double EstimatedReading(std::size_t frame) const {
    return result_.frames[frame].reading_mm - result_.frames[frame].reading_error_mm;
  }
  double DepthMm(std::size_t frame) const {
    return evidence_.setup.offset_mm.value +
           model::DirectionSign(sweep_.direction) * EstimatedReading(frame);
  }

  // One variance of an astigmatic lens would depend on the direction of a part's texture.
  FittedRegion BlurOf(const EstimatorRegion& region) const {
    RelativeBlurOptions options =
        SpectralOptions(sweep_.camera.psf, fit_.values[kFloorVariance], 1);
    if (!evidence_.axial) return FitRegion(region, options);
    options.hold_gains = evidence_.axial->gains_are_held;
    const Eigen::Matrix2Xd& variances = evidence_.axial->blur.variances_px2;
    const AxisLeakage leakage =
        MeasureAxisLeakage(setup_, region, variances.maxCoeff() - variances.minCoeff());
    FittedAxes fitted = FitRegionAlongAxes(region, leakage, options);
    return {std::move(fitted.region), MeanOfAxes(fitted.blur)};
  }

  // The in-focus object distance and the blur ratio of one region.
  struct RegionFocus {
    model::Estimate focus_depth_mm, blur_ratio;
    double misfit = 0;  // chi^2 per degree of freedom of its spectra
  };

  // The readings of the frames, corrected and held, for the fit of one part of the field.
  BlurFitSetup HeldReadings() const {
    BlurFitSetup setup = evidence_.setup;
    setup.frames.clear();
    setup.offset_mm.sigma = 0;
    setup.reading_sigma_mm = 0;
    setup.reading_sigma_is_known = false;  // errors from the scatter, not noise alone
    setup.floor_variance_px2 = model::Estimate{fit_.values[kFloorVariance], 0};
    for (const EstimatorFrame& frame : setup_.frames)
      setup.frames.push_back({EstimatedReading(frame.frame), frame.place.scale, std::nullopt});
    return setup;
  }

  // The readings as they were written, with their errors, which are fitted again.
  BlurFitSetup WrittenReadings() const {
    BlurFitSetup setup = HeldReadings();
    for (std::size_t i = 0; i < setup.frames.size(); ++i)
      setup.frames[i].reading_mm = result_.frames[setup_.frames[i].frame].reading_mm;
    setup.reading_sigma_mm = evidence_.setup.reading_sigma_mm;
    setup.reading_sigma_is_known = evidence_.setup.reading_sigma_is_known;
    return setup;
  }

  // Returns the fitted blur of one region.
  std::optional<FittedRegion> FittedBlurOf(const EstimatorRegion& region,
                                           std::string* message) const {
    if (region.frames.size() < 5 || region.modes.size() < 8) {
      *message = "it has too little texture, or too few frames show it";
      return std::nullopt;
    }
    FittedRegion fitted = BlurOf(region);
    if (fitted.blur.done) return fitted;
    *message = fitted.blur.message;
    return std::nullopt;
  }

  // Returns zf and kappa of one region, with the corrected readings and the fitted floor.
  std::optional<RegionFocus> FocusOf(const EstimatorRegion& region, std::string* message) const {
    const auto fitted = FittedBlurOf(region, message);
    return fitted ? FocusOf(*fitted, HeldReadings(), message) : std::nullopt;
  }

  static std::optional<RegionFocus> FocusOf(const FittedRegion& fitted, BlurFitSetup setup,
                                            std::string* message) {
    setup.estimators = {AsSamples(fitted.blur, fitted.region)};
    const BlurFitResult fit = FitBlur(setup);
    *message = fit.message;
    if (!fit.done) return std::nullopt;
    const auto estimate = [&fit](BlurParameter parameter) {
      return model::Estimate{fit.values[parameter],
                             std::sqrt(fit.covariance(parameter, parameter))};
    };
    return RegionFocus{estimate(kFocusDepth), estimate(kBlurRatio), fitted.blur.chi2_per_dof};
  }

  void MapTiles(int side) {
    FieldMap& map = result_.diagnostics.field;
    const double part = 2.0 / (side + 1);  // neighbours overlap by half
    map.columns = map.rows = side;
    std::vector<EstimatorRegion> regions;
    std::vector<std::size_t> tile_of;
    for (int row = 0; row < side; ++row) {
      for (int column = 0; column < side; ++column) {
        const Eigen::Vector2d place =
            kWholeField * 0.5 * part *
            Eigen::Vector2d(column - 0.5 * (side - 1), row - 0.5 * (side - 1));
        FieldTile tile;
        auto region = PlanRegion(setup_, kWholeField * part, place);
        if (region) {
          tile.centre_px = region->window.centre_px + sweep_.camera.sensor.principal_point_px;
          tile_of.push_back(map.tiles.size());
          regions.push_back(std::move(*region));
        } else {
          tile.message = "too few frames show this part";
        }
        map.tiles.push_back(tile);
      }
    }
    if (regions.empty()) {
      map.message = "too few frames show the same parts of the target";
      return;
    }
    MeasureRegions(setup_, &regions);
    std::vector<double> misfits(regions.size(), 0);
    ParallelFor(static_cast<int>(regions.size()), setup_.threads, [&](int i) {
      const auto index = static_cast<std::size_t>(i);
      FieldTile& tile = map.tiles[tile_of[index]];
      if (const auto focus = FocusOf(regions[index], &tile.message)) {
        tile.done = true;
        tile.focus_depth_mm = focus->focus_depth_mm;
        tile.blur_ratio = focus->blur_ratio;
        misfits[index] = focus->misfit;
      }
    });
    std::vector<std::size_t> fitted;
    for (std::size_t i = 0; i < map.tiles.size(); ++i) {
      if (map.tiles[i].done) fitted.push_back(i);
    }
    map.done = fitted.size() >= kMinTiles;
    map.message = map.done ? "done"
                           : fmt::format("{} parts of the field could be fitted, but {} are needed",
                                         fitted.size(), kMinTiles);
    if (!map.done) return;
    // The tiles of a lens whose constant astigmatism is modelled have two variances already.
    if (evidence_.axial || Median(misfits) > kMisfitOfOneVariance)
      MeasureFieldAstigmatism(regions, tile_of, part);
    DescribeSurface(fitted, part);
  }

  // The second moments of a tile's window along x and y about its middle, px^2.
  Eigen::Vector2d WindowMomentsPx2(double part) const {
    return kWindowMoment * std::pow(kWholeField * part, 2) * setup_.size_px.cwiseAbs2();
  }

  void MeasureFieldAstigmatism(const std::vector<EstimatorRegion>& regions,
                               const std::vector<std::size_t>& tile_of, double part) {
    FieldMap& map = result_.diagnostics.field;
    const BlurFitSetup readings = HeldReadings();
    RelativeBlurOptions options =
        SpectralOptions(sweep_.camera.psf, fit_.values[kFloorVariance], 1);
    options.hold_gains = evidence_.axial && evidence_.axial->gains_are_held;
    std::vector<std::optional<TileFoci>> found(regions.size());
    ParallelFor(static_cast<int>(regions.size()), setup_.threads, [&](int i) {
      const auto index = static_cast<std::size_t>(i);
      if (map.tiles[tile_of[index]].done)
        found[index] = FociOfTile(setup_, regions[index], readings, options);
    });
    std::vector<TileFoci> tiles;
    for (const std::optional<TileFoci>& tile : found) {
      if (tile) tiles.push_back(*tile);
    }
    const auto law = FitFieldAstigmatism(tiles, model::FarthestCornerPx(sweep_.camera.sensor),
                                         WindowMomentsPx2(part));
    if (!law) return;
    map.field_astigmatism_mm = law->at_corner_mm;
    for (std::size_t i = 0; i < found.size(); ++i) {
      if (!found[i]) continue;
      map.tiles[tile_of[i]].sagittal = found[i]->sagittal;
      map.tiles[tile_of[i]].tangential = found[i]->tangential;
    }
    WidenByFieldAstigmatism(sweep_.camera.lens, &result_);
  }

  // [D85] zf = c + gx X + gy Y + q R^2, X and Y mm on the target. Tilt can be measured only
  // together with curvature: without the quadratic term an off-centre field would resemble a tilted
  // one.
  void DescribeSurface(const std::vector<std::size_t>& fitted, double part) {
    FieldMap& map = result_.diagnostics.field;
    const bool with_curvature = fitted.size() >= 6;
    const Eigen::Index terms = with_curvature ? 4 : 3;
    const auto n = static_cast<Eigen::Index>(fitted.size());
    const double mm_per_px = TargetPixelMm();
    Eigen::MatrixXd design(n, terms);
    Eigen::VectorXd value(n), weight(n);
    double farthest2 = 0;  // of the outermost tile, mm^2 on the target
    for (Eigen::Index i = 0; i < n; ++i) {
      const FieldTile& tile = map.tiles[fitted[static_cast<std::size_t>(i)]];
      const Eigen::Vector2d x_mm =
          mm_per_px * (tile.centre_px - sweep_.camera.sensor.principal_point_px);
      design(i, 0) = 1;
      design(i, 1) = x_mm.x();
      design(i, 2) = x_mm.y();
      if (with_curvature) design(i, 3) = x_mm.squaredNorm();
      value[i] = tile.focus_depth_mm.value;
      weight[i] = 1 / std::pow(std::max(tile.focus_depth_mm.sigma, 1e-9), 2);
      farthest2 = std::max(farthest2, x_mm.squaredNorm());
    }
    const Eigen::MatrixXd normal = design.transpose() * weight.asDiagonal() * design;
    const Eigen::LDLT<Eigen::MatrixXd> solver(normal);
    const Eigen::VectorXd surface = solver.solve(design.transpose() * weight.asDiagonal() * value);
    const Eigen::VectorXd rest = value - design * surface;
    const double freedom = static_cast<double>(n - terms);
    const double chi2 = freedom > 0 ? (rest.array().square() * weight.array()).sum() / freedom : 1;
    const Eigen::MatrixXd covariance =
        std::max(1.0, chi2) * solver.solve(Eigen::MatrixXd::Identity(terms, terms));
    const auto degrees = [&](Eigen::Index term) {
      const double slope = surface[term];
      return model::Estimate{std::atan(slope) * 180 / kPi,
                             std::sqrt(covariance(term, term)) / (1 + slope * slope) * 180 / kPi};
    };
    map.tilt_right_deg = degrees(1);
    map.tilt_down_deg = degrees(2);
    if (with_curvature) {
      map.curvature_mm =
          model::Estimate{surface[3] * farthest2, std::sqrt(covariance(3, 3)) * farthest2};
    }
    FindClusters(fitted, chi2);
    const std::vector<std::string> warnings = FieldWarnings(result_);
    result_.summary.warnings.insert(result_.summary.warnings.end(), warnings.begin(),
                                    warnings.end());
    Surface found;
    found.axis_mm = surface[0];
    found.axis_sigma_mm = std::sqrt(covariance(0, 0));
    if (with_curvature) {
      // A tile shows the mean of its window, on which R^2 is larger than at the centre [D157].
      const double moment_mm2 = mm_per_px * mm_per_px * WindowMomentsPx2(part).sum();
      Eigen::VectorXd axis = Eigen::VectorXd::Zero(terms);
      axis[0] = 1;
      axis[3] = -moment_mm2;
      found.axis_mm = axis.dot(surface);
      found.axis_sigma_mm = std::sqrt(axis.dot(covariance * axis));
      found.is_curved = std::abs(surface[3]) > kCurved * std::sqrt(covariance(3, 3));
    }
    found.rest_mm = rest;
    WidenBySpread(fitted, found);
  }

  // Returns the size of a reference pixel on the target: p z f2/(f1 D).
  double TargetPixelMm() const {
    const model::ThickLens& lens = sweep_.camera.lens;
    const double zf = fit_.values[kFocusDepth];
    const double d1_mm = model::ImageDistanceMm(lens, zf);
    const double depth_mm = DepthMm(setup_.frames[setup_.reference].frame);
    return sweep_.camera.sensor.pixel_pitch_mm /
           std::abs(model::ChiefRayMagnification(lens, d1_mm, depth_mm));
  }

  // Finds the depths of a stepped target: where no smooth surface describes the tiles, they are
  // divided at the gaps between their depths.
  void FindClusters(std::vector<std::size_t> fitted, double chi2) {
    FieldMap& map = result_.diagnostics.field;
    std::sort(fitted.begin(), fitted.end(), [&](std::size_t a, std::size_t b) {
      return map.tiles[a].focus_depth_mm.value < map.tiles[b].focus_depth_mm.value;
    });
    const double scatter = std::sqrt(std::max(1.0, chi2));
    std::vector<std::vector<std::size_t>> groups(1);
    for (std::size_t i = 0; i < fitted.size(); ++i) {
      const model::Estimate& here = map.tiles[fitted[i]].focus_depth_mm;
      if (i > 0 && chi2 > kRoughSurface) {
        const model::Estimate& before = map.tiles[fitted[i - 1]].focus_depth_mm;
        const double gap_mm = here.value - before.value;
        const double range_mm = map.tiles[fitted.back()].focus_depth_mm.value -
                                map.tiles[fitted.front()].focus_depth_mm.value;
        // A gap of a third of the whole range exceeds any in a smooth field.
        if (gap_mm > kApart * std::hypot(here.sigma, before.sigma) && gap_mm > range_mm / 3)
          groups.emplace_back();
      }
      groups.back().push_back(fitted[i]);
    }
    for (const std::vector<std::size_t>& group : groups) {
      DepthCluster cluster;
      double weights = 0;
      for (const std::size_t t : group) {
        FieldTile& tile = map.tiles[t];
        tile.cluster = static_cast<int>(map.clusters.size());
        const double weight = 1 / std::pow(std::max(tile.focus_depth_mm.sigma, 1e-9), 2);
        cluster.focus_depth_mm.value += weight * tile.focus_depth_mm.value;
        weights += weight;
      }
      cluster.focus_depth_mm.value /= weights;
      cluster.focus_depth_mm.sigma = scatter / std::sqrt(weights);
      cluster.tiles = static_cast<int>(group.size());
      map.clusters.push_back(cluster);
    }
  }

  // The surface of the field: zf on the axis with its error, which contains the scatter of the
  // tiles about the surface, whether it is curved beyond doubt, and the tiles minus the surface.
  struct Surface {
    double axis_mm = 0, axis_sigma_mm = 0;
    bool is_curved = false;
    Eigen::VectorXd rest_mm;
  };

  // The fit gives the mean over the field, and zf means that on the axis: of a curved field the
  // results are moved there, and of a tilted one the interval contains the axis with its error.
  // Where no smooth surface describes the tiles, one zf is wrong by their spread beyond their own
  // errors; where the target has several depths, by the largest difference.
  void WidenBySpread(const std::vector<std::size_t>& fitted, const Surface& surface) {
    const FieldMap& map = result_.diagnostics.field;
    const model::ThickLens& lens = sweep_.camera.lens;
    const double zf = fit_.values[kFocusDepth];
    double farthest_mm = 0, squares = 0, errors = 0;
    for (const std::size_t t : fitted) {
      const model::Estimate& focus = map.tiles[t].focus_depth_mm;
      farthest_mm = std::max(farthest_mm, std::abs(focus.value - zf));
      squares += std::pow(focus.value - zf, 2) / static_cast<double>(fitted.size());
      errors += std::pow(focus.sigma, 2) / static_cast<double>(fitted.size());
    }
    if (map.clusters.size() > 1) {
      WidenFocus("depths of the target", farthest_mm,
                 "restrict roi_px to a part of the target at one depth", lens, &result_);
      return;
    }
    const double rest = surface.rest_mm.squaredNorm() / static_cast<double>(fitted.size());
    const bool is_smooth = rest - errors < kUnexplained * (squares - errors);
    const bool has_axis =
        surface.is_curved && is_smooth && surface.axis_mm > lens.front_focal_length_mm;
    const bool is_spread = squares > kSpreadOverErrors * errors;
    const double move_mm = surface.axis_mm - zf;
    Eigen::Vector2d moves_mm(0, 0);
    if (has_axis && !evidence_.known_focus) {
      to_axis_mm_ = {move_mm, surface.axis_sigma_mm};
      MoveFocus(to_axis_mm_, model::DirectionSign(sweep_.direction), lens, &result_);
    } else if (has_axis || (is_spread && is_smooth)) {
      // If the plane of focus is stated, it is not said whether that is the one on the axis.
      const double reach_mm = 2 * surface.axis_sigma_mm;
      moves_mm = {std::min(0.0, move_mm - reach_mm), std::max(0.0, move_mm + reach_mm)};
    } else if (is_spread) {
      moves_mm = std::sqrt(squares - errors) * Eigen::Vector2d(-1, 1);
    }
    if (moves_mm.isZero(0)) return;
    WidenFocusAndRatio("zf over the field", moves_mm, {0, 0},
                       "restrict roi_px to the middle of the field, and set the target parallel to "
                       "the sensor",
                       lens, &result_);
  }

  void MeasureChannels() {
    const std::size_t reference = setup_.frames[setup_.reference].frame;
    if (store_.Stored(reference).channels() < 3) return;
    const cv::Mat red = store_.Channel(reference, 0), blue = store_.Channel(reference, 2);
    const double mean = cv::mean(red)[0] + cv::mean(blue)[0];
    if (!(cv::norm(red, blue, cv::NORM_L1) / static_cast<double>(red.total()) >
          kColourDifference * mean))
      return;
    const char* const names[] = {"red", "green", "blue"};
    setup_.tick = [] { ThrowIfCancelled(); };  // the progress does not count the colours
    std::vector<std::optional<FittedRegion>> blurs;
    for (int channel = 0; channel < 3; ++channel) {
      ChannelFocus focus;
      focus.name = names[channel];
      setup_.read_grey = [this, channel](std::size_t frame) {
        return store_.Channel(frame, channel);
      };
      auto region = PlanRegion(setup_, kWholeField, Eigen::Vector2d::Zero());
      blurs.emplace_back();
      if (region) {
        std::vector<EstimatorRegion> regions = {std::move(*region)};
        MeasureRegions(setup_, &regions);
        blurs.back() = FittedBlurOf(regions[0], &focus.message);
        if (blurs.back()) FillChannel(*blurs.back(), HeldReadings(), &focus);
      }
      result_.diagnostics.channels.push_back(focus);
    }
    if (ColoursDiffer(result_.diagnostics.channels)) FitChannelsAlone(blurs);
    FollowColours(sweep_.camera.lens, sweep_.moves && model::MovesFocus(*sweep_.moves), &result_);
    const std::string words = ColoursInWords(result_);
    if (!words.empty()) result_.summary.warnings.push_back(words);
  }

  void FillChannel(const FittedRegion& blur, const BlurFitSetup& setup, ChannelFocus* focus) const {
    const auto found = FocusOf(blur, setup, &focus->message);
    focus->done = found.has_value();
    if (!found) return;
    focus->focus_depth_mm = found->focus_depth_mm;
    // One field is curved alike in all colours, to which the move adds a common error.
    focus->focus_depth_mm.value += to_axis_mm_.value;
    focus->blur_ratio =
        RatioOfColour(found->blur_ratio, found->focus_depth_mm.value,
                      fit_.values[kFocusDepth] + to_axis_mm_.value, sweep_.camera.lens);
  }

  // The law of one plane of focus does not hold for the grey of colours that differ, and what the
  // fit took for errors of the readings is partly that. Each colour follows the law with its own.
  void FitChannelsAlone(const std::vector<std::optional<FittedRegion>>& blurs) {
    std::vector<ChannelFocus> alone = result_.diagnostics.channels;
    const BlurFitSetup written = WrittenReadings();
    for (std::size_t c = 0; c < alone.size(); ++c)
      if (blurs[c]) FillChannel(*blurs[c], written, &alone[c]);
    // The errors that colours share hide small differences.
    if (ColoursDiffer(alone)) result_.diagnostics.channels = std::move(alone);
  }

  const FocusSweep& sweep_;
  const BlurEvidence& evidence_;
  const BlurFitResult& fit_;
  FrameStore& store_;
  Calibration& result_;
  SpectralEstimatorSetup setup_;
  model::Estimate to_axis_mm_{0, 0};  // from the zf of the fit to that on the axis
};

}  // namespace

std::vector<std::string> FieldWarnings(const Calibration& calibration) {
  const FieldMap& map = calibration.diagnostics.field;
  double nearest_mm = std::numeric_limits<double>::infinity(), farthest_mm = -nearest_mm;
  if (map.clusters.size() > 1) {
    std::string depths;
    for (const DepthCluster& cluster : map.clusters) {
      depths += fmt::format("{}{:.2f} mm ({} parts)", depths.empty() ? "" : ", ",
                            cluster.focus_depth_mm.value, cluster.tiles);
      nearest_mm = std::min(nearest_mm, cluster.focus_depth_mm.value);
      farthest_mm = std::max(farthest_mm, cluster.focus_depth_mm.value);
    }
    return {AstigmatismExplains(farthest_mm - nearest_mm, calibration)
                ? fmt::format(
                      "parts of the field come into focus at {}: the astigmatism is as large and "
                      "has this effect if the direction of the texture varies; or the target is "
                      "not at one depth. A target with the same texture in all directions "
                      "distinguishes these causes",
                      depths)
                : fmt::format("the target is not at one depth; parts of the field come into focus "
                              "at {}: restrict roi_px to one of them",
                              depths)};
  }
  const auto significant = [](const std::optional<model::Estimate>& tilt) {
    return tilt && std::abs(tilt->value) > std::max(1.0, 4 * tilt->sigma);
  };
  if (!significant(map.tilt_right_deg) && !significant(map.tilt_down_deg)) return {};
  for (const FieldTile& tile : map.tiles) {
    if (!tile.done) continue;
    nearest_mm = std::min(nearest_mm, tile.focus_depth_mm.value);
    farthest_mm = std::max(farthest_mm, tile.focus_depth_mm.value);
  }
  return {fmt::format(
      "{}the target is tilted against the sensor: {:+.1f} +- {:.1f} degrees toward the right, "
      "{:+.1f} +- {:.1f} toward the bottom (positive: nearer there)",
      AstigmatismExplains(farthest_mm - nearest_mm, calibration)
          ? "the astigmatism makes parts of the field come into focus at different depths, or "
          : "",
      map.tilt_right_deg->value, map.tilt_right_deg->sigma, map.tilt_down_deg->value,
      map.tilt_down_deg->sigma)};
}

void MapField(const FocusSweep& sweep, const BlurEvidence& evidence, const BlurFitResult& fit,
              FrameStore* store, Calibration* calibration) {
  Field(sweep, evidence, fit, store, calibration).Run();
}

void CompareZones(const FocusSweep& sweep, const BlurEvidence& evidence, const BlurFitResult& fit,
                  FrameStore* store, Calibration* calibration) {
  Field(sweep, evidence, fit, store, calibration).RunCoarsely();
}

}  // namespace thicklens::calib
