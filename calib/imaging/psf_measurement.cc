#include "thicklens/calib/psf_measurement.h"

#include <fmt/format.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <mutex>
#include <opencv2/imgproc.hpp>
#include <optional>
#include <random>
#include <vector>

#include "calib/imaging/frame_placement.h"
#include "calib/registration/scale_tracking.h"
#include "thicklens/base/cancel.h"
#include "thicklens/base/error.h"
#include "thicklens/base/parallel.h"
#include "thicklens/base/validity.h"
#include "thicklens/calib/blur_model.h"

namespace thicklens::calib {
namespace {

constexpr double kMinDefocusPx = 2;     // sigma; below it a cell is a small part of a pixel
constexpr double kLargestShare = 0.04;  // of the region's shorter side, of a sigma
constexpr double kOverReference = 3;    // sigma of a frame over that of the reference frame
constexpr int kMinFrames = 4;
constexpr std::size_t kMaxFrames = 20;
constexpr int kPixelsPerFrame = 8000;
constexpr double kHighPassSigmas = 4;  // of the defocus; slower changes are those of the light
constexpr int kStrengths = 14;         // of the smoothness that are compared
constexpr double kSharedPixels = 4;    // pixels whose residuals are alike
constexpr int kSolverSweeps = 400;

// A defocused frame that the measurement uses.
struct UsedFrame {
  std::size_t frame = 0;
  double defocus_px =
      0;             // sigma of the defocus beyond that of the reference frame, px of the frame
  double scale = 1;  // relative to the reference frame
  int side = 1;      // +1: the target is beyond the plane of focus, -1: nearer
};

// The normal equations of one frame for the shares of the cells, divided by the variance of its
// residual.
struct FrameEquations {
  bool done = false;
  Eigen::MatrixXf matrix;
  Eigen::VectorXf right;
  double square = 0;  // sum of the squares of the data
  int pixels = 0;
};

// The integral image of an image, interpolated bilinearly: the exact integral of its pixels as
// squares.
class Integral {
 public:
  explicit Integral(const cv::Mat& image) { cv::integral(image, sums_, CV_64F); }
  // Mean over the square of the side `side` about a point, px.
  double Mean(double x, double y, double side) const {
    const double x0 = x + 0.5 - side / 2, y0 = y + 0.5 - side / 2;
    return (At(x0 + side, y0 + side) - At(x0, y0 + side) - At(x0 + side, y0) + At(x0, y0)) /
           (side * side);
  }

 private:
  double At(double x, double y) const {
    const int i = std::clamp(static_cast<int>(std::floor(x)), 0, sums_.cols - 2);
    const int j = std::clamp(static_cast<int>(std::floor(y)), 0, sums_.rows - 2);
    const double u = x - i, v = y - j;
    const double* upper = sums_.ptr<double>(j);
    const double* lower = sums_.ptr<double>(j + 1);
    return (1 - v) * ((1 - u) * upper[i] + u * upper[i + 1]) +
           v * ((1 - u) * lower[i] + u * lower[i + 1]);
  }
  cv::Mat sums_;
};

cv::Mat HighPass(const cv::Mat& image, double sigma_px) {
  cv::Mat slow;
  cv::GaussianBlur(image, slow, {}, sigma_px, sigma_px, cv::BORDER_REFLECT);
  return image - slow;
}

// [D173] A frame on the far side of focus is I(x) = sum_k c_k T(x - p_k R), T the mean of the sharp
// frame over the square of a cell, p_k the place of the cell in blur radii, R the blur radius, px;
// on the near side the PSF is turned by half a turn, and I(x) = sum_k c_k T(x + p_k R). The c_k >=
// 0 minimise sum (I - sum_k c_k T_k)^2/s^2 + l sum (second differences of c)^2 over the pixels of
// all frames, s^2 the variance of a frame's residual; l is the one of the smallest generalised
// cross-validation. Their errors are the scatter of the frames about the common solution: with the
// gradient g_f of each frame there, the covariance is M^-1 (sum_f g_f g_f^T) M^-1 F/(F - 1), M the
// matrix of the sum. Both sides of the equation pass the same high-pass filter, so that slow
// changes of the light do not count.
class PsfMeasuring {
 public:
  PsfMeasuring(const FocusSweep& sweep, const Calibration& calibration, const PsfOptions& options)
      : sweep_(sweep), calibration_(calibration), options_(options) {}

  PsfMeasurement Run() {
    const std::string why = Prepare();
    if (!why.empty()) return Ended(why);
    equations_.resize(frames_.size());
    int done = 0;
    std::mutex mutex;
    ParallelFor(static_cast<int>(frames_.size()), options_.threads, [&](int i) {
      const auto index = static_cast<std::size_t>(i);
      equations_[index] = EquationsOf(frames_[index]);
      const std::lock_guard<std::mutex> lock(mutex);
      if (options_.progress) options_.progress(++done, static_cast<int>(frames_.size()));
    });
    for (std::size_t i = equations_.size(); i-- > 0;) {
      if (equations_[i].done) continue;
      equations_.erase(equations_.begin() + static_cast<std::ptrdiff_t>(i));
      frames_.erase(frames_.begin() + static_cast<std::ptrdiff_t>(i));
    }
    if (frames_.size() < kMinFrames) {
      return Ended(
          fmt::format("{} defocused frames could be aligned with the sharp one, but {} "
                      "are needed",
                      frames_.size(), kMinFrames));
    }
    Solve();
    return Result();
  }

 private:
  PsfMeasurement Ended(const std::string& why) {
    PsfMeasurement ended;
    ended.message = why;
    return ended;
  }

  // Chooses the frames. Returns why there is no measurement; empty: there is one.
  std::string Prepare() {
    const std::optional<BlurModel> law = BlurModel::Of(sweep_, calibration_);
    const auto& zf = calibration_.summary.focus_depth_mm;
    if (!law || !zf || !calibration_.summary.blur_ratio ||
        !(calibration_.summary.blur_ratio->value > 0))
      return "the calibration has no blur law, whose shape is to be measured";
    blur_ratio_ = calibration_.summary.blur_ratio->value;
    const double floor_px = law->SigmaPx(zf->value);
    const auto defocus = [&](std::size_t i) {
      const double sigma_px = law->SigmaPx(calibration_.frames[i].depth_mm);
      return std::sqrt(std::max(0.0, sigma_px * sigma_px - floor_px * floor_px));
    };
    std::vector<std::size_t> usable;
    for (std::size_t i = 0; i < calibration_.frames.size(); ++i) {
      const FrameMeasurement& frame = calibration_.frames[i];
      if (frame.rejection.empty() && IsDepth(frame.depth_mm) &&
          ScaleOfFrame(calibration_, i, sweep_.direction))
        usable.push_back(i);
    }
    if (usable.empty()) return "no frame has a depth and an image scale";
    reference_ = *std::min_element(usable.begin(), usable.end(), [&](std::size_t a, std::size_t b) {
      return defocus(a) < defocus(b);
    });
    ChooseFrames(usable, defocus, zf->value);
    if (frames_.size() < kMinFrames) {
      return fmt::format(
          "{} frames have a defocus from {} px to {:.3g} px (sigma), which shows the "
          "shape, but {} are needed: the sweep should reach farther from focus",
          frames_.size(), kMinDefocusPx, LargestDefocusPx(), kMinFrames);
    }
    reference_grey_ = LinearGrey(sweep_.read_frame(reference_), sweep_, reference_);
    return "";
  }

  double LargestDefocusPx() const {
    const cv::Size size(sweep_.roi.width > 0 ? sweep_.roi.width : sweep_.camera.sensor.width_px,
                        sweep_.roi.height > 0 ? sweep_.roi.height : sweep_.camera.sensor.height_px);
    return kLargestShare * std::min(size.width, size.height);
  }

  template <class Defocus>
  void ChooseFrames(const std::vector<std::size_t>& usable, const Defocus& defocus, double zf_mm) {
    const double reference_scale = *ScaleOfFrame(calibration_, reference_, sweep_.direction);
    const double reference_px = defocus(reference_);
    for (const std::size_t i : usable) {
      UsedFrame frame;
      frame.frame = i;
      frame.scale = *ScaleOfFrame(calibration_, i, sweep_.direction) / reference_scale;
      frame.side = calibration_.frames[i].depth_mm > zf_mm ? 1 : -1;
      const double own_px = defocus(i), shared_px = frame.scale * reference_px;
      if (!(own_px > kMinDefocusPx) || !(own_px > kOverReference * shared_px) ||
          !(own_px < LargestDefocusPx()))
        continue;
      frame.defocus_px = std::sqrt(own_px * own_px - shared_px * shared_px);
      frames_.push_back(frame);
    }
    if (frames_.size() <= kMaxFrames) return;
    std::vector<UsedFrame> spread;
    for (std::size_t k = 0; k < kMaxFrames; ++k)
      spread.push_back(frames_[k * (frames_.size() - 1) / (kMaxFrames - 1)]);
    frames_ = std::move(spread);
  }

  Eigen::Index cells() const { return options_.side * options_.side; }
  double CellPx(const UsedFrame& frame) const {
    return 2 * options_.reach_sigmas * frame.defocus_px / options_.side;
  }

  FrameEquations EquationsOf(const UsedFrame& frame) const {
    FrameEquations equations;
    const cv::Mat grey = LinearGrey(sweep_.read_frame(frame.frame), sweep_, frame.frame);
    const auto map = PlaceFrame(reference_grey_, grey, frame.scale, RegionCentre(sweep_));
    if (!map) return equations;
    // The sharp frame as it would be at this frame's scale.
    cv::Mat sharp, shown, inverse;
    cv::invertAffineTransform(*map, inverse);
    cv::warpAffine(reference_grey_, sharp, inverse, grey.size(),
                   cv::INTER_CUBIC | cv::WARP_INVERSE_MAP, cv::BORDER_REFLECT);
    cv::warpAffine(cv::Mat::ones(grey.size(), CV_8U), shown, inverse, grey.size(),
                   cv::INTER_NEAREST | cv::WARP_INVERSE_MAP, cv::BORDER_CONSTANT, 0);
    const cv::Rect inside = Inside(shown, frame);
    if (inside.area() < 4 * static_cast<int>(cells())) return equations;
    const double gain = cv::mean(sharp(inside))[0] / cv::mean(grey(inside))[0];
    if (!(gain > 0) || !std::isfinite(gain)) return equations;
    const double slow_px = kHighPassSigmas * frame.defocus_px;
    FillEquations(HighPass(gain * grey, slow_px), Integral(HighPass(sharp, slow_px)), inside, frame,
                  &equations);
    return equations;
  }

  // The pixels whose whole PSF lies in the part that both frames show.
  cv::Rect Inside(const cv::Mat& shown, const UsedFrame& frame) const {
    const cv::Rect all = cv::boundingRect(shown);
    const int margin =
        static_cast<int>(std::ceil((options_.reach_sigmas + 1) * frame.defocus_px)) + 2;
    return {all.x + margin, all.y + margin, std::max(0, all.width - 2 * margin),
            std::max(0, all.height - 2 * margin)};
  }

  void FillEquations(const cv::Mat& data, const Integral& sharp, const cv::Rect& inside,
                     const UsedFrame& frame, FrameEquations* equations) const {
    constexpr int kBlock = 500;  // rows of the design at a time
    const double cell_px = CellPx(frame);
    const int half = options_.side / 2;
    std::mt19937_64 draws(frame.frame + 1);
    std::uniform_int_distribution<int> column(inside.x, inside.x + inside.width - 1);
    std::uniform_int_distribution<int> line(inside.y, inside.y + inside.height - 1);
    Eigen::MatrixXf matrix = Eigen::MatrixXf::Zero(cells(), cells());
    Eigen::VectorXf right = Eigen::VectorXf::Zero(cells());
    Eigen::MatrixXf block(kBlock, cells());
    Eigen::VectorXf values(kBlock);
    for (int begin = 0; begin < kPixelsPerFrame; begin += kBlock) {
      ThrowIfCancelled();
      for (int n = 0; n < kBlock; ++n) {
        const int x = column(draws), y = line(draws);
        values[n] = data.at<float>(y, x);
        Eigen::Index k = 0;
        for (int j = -half; j <= half; ++j) {
          for (int i = -half; i <= half; ++i) {
            block(n, k++) = static_cast<float>(
                sharp.Mean(x - frame.side * i * cell_px, y - frame.side * j * cell_px, cell_px));
          }
        }
      }
      matrix.selfadjointView<Eigen::Lower>().rankUpdate(block.transpose());
      right += block.transpose() * values;
      equations->square += values.cast<double>().squaredNorm();
    }
    equations->matrix = matrix.selfadjointView<Eigen::Lower>();
    equations->right = right;
    equations->pixels = kPixelsPerFrame;
    equations->done = equations->square > 0;
  }

  // Second differences of neighbouring cells; beyond the PSF there is no light.
  Eigen::MatrixXd Smoothness() const {
    const int side = options_.side;
    Eigen::MatrixXd smooth = Eigen::MatrixXd::Zero(cells(), cells());
    const auto index = [side](int i, int j) { return static_cast<Eigen::Index>(j * side + i); };
    for (int j = 0; j < side; ++j) {
      for (int i = 0; i < side; ++i) {
        Eigen::VectorXd row = Eigen::VectorXd::Zero(cells());
        row[index(i, j)] = 4;
        for (const auto& [u, v] : {std::pair(i - 1, j), {i + 1, j}, {i, j - 1}, {i, j + 1}}) {
          if (u >= 0 && v >= 0 && u < side && v < side) row[index(u, v)] = -1;
        }
        smooth.selfadjointView<Eigen::Lower>().rankUpdate(row);
      }
    }
    return smooth.selfadjointView<Eigen::Lower>();
  }

  // Weights by the residual of each frame about the common solution, twice.
  void Solve() {
    const auto count = static_cast<Eigen::Index>(equations_.size());
    Eigen::VectorXd weights(count);
    for (Eigen::Index f = 0; f < count; ++f) {
      const FrameEquations& of = equations_[static_cast<std::size_t>(f)];
      weights[f] = of.pixels / of.square;
    }
    const Eigen::MatrixXd smooth = Smoothness();
    for (int round = 0; round < 3; ++round) {
      ThrowIfCancelled();
      Sum(weights);
      if (round == 0) ChooseStrength(smooth);
      SolveNonNegative(matrix_ + strength_ * smooth);
      for (Eigen::Index f = 0; f < count; ++f)
        weights[f] = 1 / ResidualVariance(equations_[static_cast<std::size_t>(f)]);
    }
    FindErrors(matrix_ + strength_ * smooth, weights);
  }

  void Sum(const Eigen::VectorXd& weights) {
    matrix_ = Eigen::MatrixXd::Zero(cells(), cells());
    right_ = Eigen::VectorXd::Zero(cells());
    square_ = pixels_ = 0;
    for (Eigen::Index f = 0; f < weights.size(); ++f) {
      const FrameEquations& of = equations_[static_cast<std::size_t>(f)];
      matrix_ += weights[f] * of.matrix.cast<double>();
      right_ += weights[f] * of.right.cast<double>();
      square_ += weights[f] * of.square;
      pixels_ += of.pixels;
    }
  }

  double ResidualVariance(const FrameEquations& of) const {
    const double left = of.square - 2 * shares_.dot(of.right.cast<double>()) +
                        shares_.dot(of.matrix.cast<double>() * shares_);
    return std::max(left, 1e-6 * of.square) / of.pixels;
  }

  // Generalised cross-validation over the common eigenvectors of both matrices, without the
  // constraint: V = RSS/(1 - degrees/pixels)^2.
  void ChooseStrength(const Eigen::MatrixXd& smooth) {
    const Eigen::GeneralizedSelfAdjointEigenSolver<Eigen::MatrixXd> pencil(matrix_, smooth);
    const Eigen::VectorXd values = pencil.eigenvalues().cwiseMax(0);
    const Eigen::VectorXd along = pencil.eigenvectors().transpose() * right_;
    const double independent = pixels_ / kSharedPixels;
    double best = std::numeric_limits<double>::infinity();
    const double largest = values.maxCoeff();
    for (int i = 0; i < kStrengths; ++i) {
      const double strength = largest * std::pow(10.0, -0.5 * i);
      double residual = square_, degrees = 0;
      for (Eigen::Index k = 0; k < values.size(); ++k) {
        const double part = 1 / (values[k] + strength);
        residual += along[k] * along[k] * part * (values[k] * part - 2);
        degrees += values[k] * part;
      }
      const double score = residual / std::pow(1 - std::min(0.99, degrees / independent), 2);
      if (!(score < best)) continue;
      best = score;
      strength_ = strength;
    }
  }

  // Coordinate descent; each step is the exact minimum along one share.
  void SolveNonNegative(const Eigen::MatrixXd& matrix) {
    shares_ = matrix.ldlt().solve(right_).cwiseMax(0);
    Eigen::VectorXd gradient = matrix * shares_ - right_;
    for (int sweep = 0; sweep < kSolverSweeps; ++sweep) {
      ThrowIfCancelled();
      double moved = 0;
      for (Eigen::Index k = 0; k < shares_.size(); ++k) {
        const double next = std::max(0.0, shares_[k] - gradient[k] / matrix(k, k));
        const double step = next - shares_[k];
        if (step == 0) continue;
        gradient += step * matrix.col(k);
        shares_[k] = next;
        moved = std::max(moved, std::abs(step));
      }
      if (moved < 1e-7 * shares_.maxCoeff()) break;
    }
  }

  // Shares at the bound are held there.
  void FindErrors(const Eigen::MatrixXd& matrix, const Eigen::VectorXd& weights) {
    std::vector<Eigen::Index> free;
    for (Eigen::Index k = 0; k < shares_.size(); ++k) {
      if (shares_[k] > 0) free.push_back(k);
    }
    errors_ = Eigen::VectorXd::Zero(cells());
    if (free.empty()) return;
    const Eigen::LDLT<Eigen::MatrixXd> solver(Eigen::MatrixXd(matrix(free, free)));
    const auto count = static_cast<double>(equations_.size());
    Eigen::VectorXd squares = Eigen::VectorXd::Zero(static_cast<Eigen::Index>(free.size()));
    Eigen::MatrixXd gradients(cells(), weights.size());
    for (Eigen::Index f = 0; f < weights.size(); ++f) {
      const FrameEquations& of = equations_[static_cast<std::size_t>(f)];
      gradients.col(f) =
          weights[f] * (of.right.cast<double>() - of.matrix.cast<double>() * shares_);
    }
    // The smoothness takes its part of the sum of the gradients, which therefore is not 0.
    gradients.colwise() -= Eigen::VectorXd(gradients.rowwise().mean());
    for (Eigen::Index f = 0; f < weights.size(); ++f)
      squares += solver.solve(Eigen::VectorXd(gradients(free, f))).cwiseAbs2();
    for (std::size_t k = 0; k < free.size(); ++k) {
      errors_[free[k]] = std::sqrt(squares[static_cast<Eigen::Index>(k)] * count / (count - 1));
    }
  }

  PsfMeasurement Result() {
    PsfMeasurement result;
    if (!(shares_.sum() > 0)) return Ended("the frames show no PSF with positive light");
    const int side = options_.side;
    model::MeasuredPsf& psf = result.psf;
    psf.light.resize(side, side);
    psf.sigma.resize(side, side);
    for (int j = 0; j < side; ++j) {
      for (int i = 0; i < side; ++i) {
        psf.light(j, i) = shares_[j * side + i];
        psf.sigma(j, i) = errors_[j * side + i];
      }
    }
    psf = Normalised(std::move(psf));
    // In blur radii: sigma of the defocus is kappa in them.
    psf.step = 2 * options_.reach_sigmas * blur_ratio_ / side;
    MoveCentroid(&psf);
    psf.step *= blur_ratio_ / psf.BlurRatio();
    const Eigen::Vector2d ratios = psf.AxisSigmas() / psf.BlurRatio();
    result.sigma_x_ratio = ratios.x();
    result.sigma_y_ratio = ratios.y();
    result.frames = static_cast<int>(frames_.size());
    result.nearer = static_cast<int>(std::count_if(
        frames_.begin(), frames_.end(), [](const UsedFrame& frame) { return frame.side < 0; }));
    result.farther = result.frames - result.nearer;
    std::string why;
    if (!psf.IsValid(&why)) return Ended("the measured PSF cannot be used: " + why);
    result.done = true;
    result.message = "done";
    return result;
  }

  // Moves the shares by a part of a cell, bilinearly, until the centroid is in the middle.
  static void MoveCentroid(model::MeasuredPsf* psf) {
    for (int round = 0; round < 4; ++round) {
      const Eigen::Vector2d off = psf->Centroid() / psf->step;
      if (off.norm() < 1e-9) return;
      const Eigen::Index side = psf->light.rows();
      const auto moved = [&](const Eigen::ArrayXXd& from, bool squares) {
        Eigen::ArrayXXd to = Eigen::ArrayXXd::Zero(side, side);
        for (Eigen::Index j = 0; j < side; ++j) {
          for (Eigen::Index i = 0; i < side; ++i) {
            const double x = static_cast<double>(i) + off.x(), y = static_cast<double>(j) + off.y();
            const auto left = static_cast<Eigen::Index>(std::floor(x));
            const auto top = static_cast<Eigen::Index>(std::floor(y));
            for (const Eigen::Index v : {top, top + 1}) {
              for (const Eigen::Index u : {left, left + 1}) {
                if (u < 0 || v < 0 || u >= side || v >= side) continue;
                const double weight = (1 - std::abs(x - static_cast<double>(u))) *
                                      (1 - std::abs(y - static_cast<double>(v)));
                to(j, i) += squares ? weight * from(v, u) * from(v, u) : weight * from(v, u);
              }
            }
          }
        }
        return to;
      };
      psf->light = moved(psf->light, false);
      psf->sigma = moved(psf->sigma, true).sqrt();
      *psf = Normalised(std::move(*psf));
    }
  }

  const FocusSweep& sweep_;
  const Calibration& calibration_;
  const PsfOptions& options_;
  double blur_ratio_ = 0;
  std::size_t reference_ = 0;
  cv::Mat reference_grey_;
  std::vector<UsedFrame> frames_;
  std::vector<FrameEquations> equations_;
  Eigen::MatrixXd matrix_;
  Eigen::VectorXd right_, shares_, errors_;
  double square_ = 0, pixels_ = 0, strength_ = 0;
};

}  // namespace

bool PsfOptions::IsValid(std::string* why) const {
  constexpr int kMinSide = 7, kMaxSide = 41;
  if (side < kMinSide || side > kMaxSide || side % 2 == 0) {
    return Fail(why, fmt::format("side is {}: an odd number from {} to {} is expected", side,
                                 kMinSide, kMaxSide));
  }
  if (!(reach_sigmas >= 1.5) || !(reach_sigmas <= 4))
    return Fail(why, fmt::format("reach_sigmas is {}: 1.5 to 4 is expected", reach_sigmas));
  return true;
}

PsfMeasurement MeasurePsf(const FocusSweep& sweep, const Calibration& calibration,
                          const PsfOptions& options) {
  std::string why;
  if (!options.IsValid(&why)) throw Error("PSF: " + why);
  return PsfMeasuring(sweep, calibration, options).Run();
}

}  // namespace thicklens::calib
