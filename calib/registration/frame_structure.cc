#include "calib/registration/frame_structure.h"

#include <fmt/format.h>

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <opencv2/imgproc.hpp>
#include <utility>

#include "calib/sharpness/edge_pixels.h"
#include "thicklens/base/statistics.h"

namespace thicklens::calib {
namespace {

constexpr double kDarkest = 1e-3;  // relative to full scale, added before a logarithm

cv::Mat LogLight(const cv::Mat& grey) {
  cv::Mat light = cv::max(grey, 0) + kDarkest;
  cv::log(light, light);
  return light;
}

// Maps p in a frame to q in the reference: p = centre + shift + scale R (q - centre).
struct PlaceInReference {
  Registration registration;
  Eigen::Vector2d centre;

  Eigen::Vector2d operator()(const Eigen::Vector2d& p) const {
    const double c = std::cos(registration.rotation_rad), s = std::sin(registration.rotation_rad);
    const Eigen::Vector2d d = (p - centre - registration.shift_px) / registration.scale;
    return centre + Eigen::Vector2d(c * d.x() + s * d.y(), -s * d.x() + c * d.y());
  }
};

// Bilinear interpolation; returns false outside the image.
bool SampleAt(const cv::Mat& image, const Eigen::Vector2d& at, double* value) {
  const int x = static_cast<int>(std::floor(at.x())), y = static_cast<int>(std::floor(at.y()));
  if (x < 0 || y < 0 || x + 1 >= image.cols || y + 1 >= image.rows) return false;
  const double u = at.x() - x, v = at.y() - y;
  const auto pixel = [&](int row, int column) {
    return static_cast<double>(image.at<float>(row, column));
  };
  *value = (1 - v) * ((1 - u) * pixel(y, x) + u * pixel(y, x + 1)) +
           v * ((1 - u) * pixel(y + 1, x) + u * pixel(y + 1, x + 1));
  return true;
}

// The mean of values with errors. Their scatter may be larger than these errors.
std::optional<model::Estimate> Combined(const std::vector<model::Estimate>& values) {
  double weights = 0, sum = 0;
  for (const model::Estimate& value : values) {
    weights += 1 / (value.sigma * value.sigma);
    sum += value.value / (value.sigma * value.sigma);
  }
  if (values.size() < 2 || !(weights > 0)) return std::nullopt;
  const double mean = sum / weights;
  double chi2 = 0;
  for (const model::Estimate& value : values)
    chi2 += std::pow((value.value - mean) / value.sigma, 2);
  const double spread = std::max(1.0, chi2 / static_cast<double>(values.size() - 1));
  return model::Estimate{mean, std::sqrt(spread / weights)};
}

class Structure {
 public:
  explicit Structure(const FramePlaces& places) : places_(places) {
    for (const ScaleSample& sample : places.samples) {
      if (!sample.scale_is_from_reading) registered_[sample.frame] = &sample;
    }
  }

  FrameStructureFinding Run() {
    if (places_.used.size() < 5) return result_;
    result_.measured = true;
    FindVignetting();
    FindBands();
    FindFixedStructure();
    return result_;
  }

 private:
  cv::Mat Read(std::size_t frame) const {
    if (places_.tick) places_.tick();
    return places_.read_grey(frame);
  }

  double ReadingOf(std::size_t frame) const { return places_.sweep.frames[frame].reading_mm; }

  std::vector<std::size_t> ByReading() const {
    std::vector<std::size_t> order = places_.used;
    std::stable_sort(order.begin(), order.end(),
                     [this](std::size_t a, std::size_t b) { return ReadingOf(a) < ReadingOf(b); });
    return order;
  }

  // ---- vignetting ----
  void FindVignetting() {
    constexpr std::size_t kMaxFrames = 8;
    constexpr double kMinChange = 0.004;  // change of scale
    const ScaleSample* reference = nullptr;
    std::vector<const ScaleSample*> others;
    for (const auto& [frame, sample] : registered_) {
      if (sample->scale == 1 && reference == nullptr) {
        reference = sample;
      } else if (std::abs(std::log(sample->scale)) > kMinChange) {
        others.push_back(sample);
      }
    }
    if (reference == nullptr || others.size() < 3) return;
    std::stable_sort(others.begin(), others.end(), [](const ScaleSample* a, const ScaleSample* b) {
      return std::abs(std::log(a->scale)) > std::abs(std::log(b->scale));
    });
    others.resize(std::min(others.size(), kMaxFrames));
    const cv::Mat reference_grey = Read(reference->frame);
    const int factor = std::max(1, std::min(reference_grey.cols, reference_grey.rows) / 48);
    const cv::Mat reference_small = Small(reference_grey, factor);
    std::vector<model::Estimate> found;
    for (const ScaleSample* sample : others) {
      if (const auto value = VignettingOf(*sample, reference_small, factor, reference_grey.size()))
        found.push_back(*value);
    }
    result_.vignetting = Combined(found);
  }

  static cv::Mat Small(const cv::Mat& grey, int factor) {
    cv::Mat small;
    cv::resize(grey, small, cv::Size(grey.cols / factor, grey.rows / factor), 0, 0, cv::INTER_AREA);
    return LogLight(Smoothed(small, 1));
  }

  std::optional<model::Estimate> VignettingOf(const ScaleSample& sample,
                                              const cv::Mat& reference_small, int factor,
                                              cv::Size size) const {
    constexpr int kTerms = 4;
    // Number of pixels of the small images that share their errors.
    constexpr double kCorrelatedPixels = 12;
    const cv::Mat small = Small(Read(sample.frame), factor);
    const Eigen::Vector2d centre(places_.centre.x, places_.centre.y);
    const PlaceInReference place{sample.registration, centre};
    const Eigen::Vector2d corner(std::max(centre.x(), size.width - centre.x()),
                                 std::max(centre.y(), size.height - centre.y()));
    const double corner2 = corner.squaredNorm();
    std::vector<Eigen::Vector4d> rows;
    std::vector<double> values;
    for (int y = 1; y + 1 < small.rows; ++y) {
      for (int x = 1; x + 1 < small.cols; ++x) {
        const Eigen::Vector2d p(factor * (x + 0.5) - 0.5, factor * (y + 0.5) - 0.5);
        const Eigen::Vector2d q = place(p);
        double of_reference = 0;
        const Eigen::Vector2d in_small = ((q.array() + 0.5) / factor - 0.5).matrix();
        if (!SampleAt(reference_small, in_small, &of_reference)) continue;
        const Eigen::Vector2d from = (p - centre) / std::sqrt(corner2);
        rows.emplace_back(1, from.x(), from.y(),
                          ((p - centre).squaredNorm() - (q - centre).squaredNorm()) / corner2);
        values.push_back(static_cast<double>(small.at<float>(y, x)) - of_reference);
      }
    }
    if (rows.size() < 100) return std::nullopt;
    std::vector<double> weights(rows.size(), 1);
    Eigen::Vector4d terms = Eigen::Vector4d::Zero();
    double variance = 0;
    for (int round = 0; round < 6; ++round) {
      Eigen::Matrix4d normal = Eigen::Matrix4d::Zero();
      Eigen::Vector4d right = Eigen::Vector4d::Zero();
      for (std::size_t i = 0; i < rows.size(); ++i) {
        normal += weights[i] * rows[i] * rows[i].transpose();
        right += weights[i] * values[i] * rows[i];
      }
      const Eigen::LDLT<Eigen::Matrix4d> solver(normal);
      terms = solver.solve(right);
      std::vector<double> rests;
      for (std::size_t i = 0; i < rows.size(); ++i)
        rests.push_back(std::abs(values[i] - rows[i].dot(terms)));
      const double scatter = std::max(1e-6, 1.4826 * Median(rests));
      for (std::size_t i = 0; i < rows.size(); ++i)
        weights[i] = 1 / (1 + std::pow(rests[i] / (2 * scatter), 2));
      variance = kCorrelatedPixels * scatter * scatter *
                 solver.solve(Eigen::Matrix4d::Identity())(kTerms - 1, kTerms - 1);
    }
    if (!(variance > 0) || !std::isfinite(variance)) return std::nullopt;
    return model::Estimate{terms[kTerms - 1], std::sqrt(variance)};
  }

  // ---- bands ----
  // Means over rows (or columns), from which a parabola is subtracted.
  static std::vector<double> Profile(const cv::Mat& image, bool of_rows) {
    cv::Mat means;
    cv::reduce(image, means, of_rows ? 1 : 0, cv::REDUCE_AVG, CV_64F);
    const auto n = static_cast<Eigen::Index>(means.total());
    Eigen::MatrixXd design(n, 3);
    Eigen::VectorXd values(n);
    for (Eigen::Index i = 0; i < n; ++i) {
      const double u = 2 * (static_cast<double>(i) + 0.5) / static_cast<double>(n) - 1;
      design.row(i) << 1, u, u * u;
      values[i] = means.at<double>(static_cast<int>(i));
    }
    const Eigen::VectorXd rest = values - design * design.colPivHouseholderQr().solve(values);
    return {rest.begin(), rest.end()};
  }

  static double Variance(const std::vector<double>& profile) {
    double sum = 0;
    for (const double value : profile) sum += value * value;
    return sum / static_cast<double>(profile.size());
  }

  // Variance of the row means over that of the column means; 1 for an image of independent parts.
  static double RowsOverColumns(const cv::Mat& image, double* row_deviation,
                                double* column_deviation) {
    const double rows = Variance(Profile(image, true));
    const double columns = Variance(Profile(image, false));
    *row_deviation = std::sqrt(rows);
    *column_deviation = std::sqrt(columns);
    return rows * image.cols / std::max(columns * image.rows, 1e-30);
  }

  // Ratio of the target's size in frame `a` to that in `b`; 1 where it is unknown.
  double ScaleBetween(std::size_t a, std::size_t b) const {
    const auto of_a = registered_.find(a), of_b = registered_.find(b);
    if (of_a == registered_.end() || of_b == registered_.end()) return 1;
    return of_a->second->scale / of_b->second->scale;
  }

  // The image is reduced, because no band is as fine as a pixel of a large sensor.
  static cv::Mat ForBands(const cv::Mat& grey) {
    constexpr int kMaxPx = 1024;
    const int factor = 1 + std::max(grey.cols, grey.rows) / kMaxPx;
    if (factor == 1) return grey;
    cv::Mat small;
    cv::resize(grey, small, cv::Size(grey.cols / factor, grey.rows / factor), 0, 0, cv::INTER_AREA);
    return small;
  }

  void FindBands() {
    constexpr std::size_t kMaxPairs = 12;
    constexpr double kAnisotropy = 10;  // ratio of variances, above chance and usual targets
    const std::vector<std::size_t> order = ByReading();
    const std::size_t pairs = std::min(kMaxPairs, order.size() - 1);
    std::vector<double> ratios, row_deviations, column_deviations;
    cv::Mat mean;
    for (std::size_t k = 0; k < pairs; ++k) {
      const std::size_t i = k * (order.size() - 1) / pairs;
      const cv::Mat grey = Read(order[i]);
      const int width_px = grey.cols;
      const cv::Mat one = LogLight(Smoothed(ForBands(grey), 1));
      const cv::Mat other = LogLight(Smoothed(ForBands(Read(order[i + 1])), 1));
      const double scale = ScaleBetween(order[i], order[i + 1]);
      const double shrunk = static_cast<double>(one.cols) / static_cast<double>(width_px);
      const cv::Matx23d map(scale, 0, (1 - scale) * shrunk * places_.centre.x, 0, scale,
                            (1 - scale) * shrunk * places_.centre.y);
      cv::Mat moved;
      cv::warpAffine(other, moved, map, other.size(), cv::INTER_LINEAR, cv::BORDER_REPLICATE);
      const int margin_x = one.cols / 16, margin_y = one.rows / 16;
      const cv::Rect inner(margin_x, margin_y, one.cols - 2 * margin_x, one.rows - 2 * margin_y);
      double rows = 0, columns = 0;
      ratios.push_back(RowsOverColumns((one - moved)(inner), &rows, &columns));
      row_deviations.push_back(rows);
      column_deviations.push_back(columns);
      mean = mean.empty() ? one.clone() : cv::Mat(mean + one);
    }
    // Bands that differ from frame to frame average out of the mean; a striped target remains.
    double rows = 0, columns = 0;
    const double of_target = RowsOverColumns(mean / static_cast<double>(pairs), &rows, &columns);
    if (of_target > kAnisotropy || of_target < 1 / kAnisotropy) return;
    const double ratio = Median(ratios);
    if (ratio <= kAnisotropy && ratio >= 1 / kAnisotropy) {
      result_.bands = model::Estimate{
          0, FrameStructureFinding::kMinBands / FrameStructureFinding::kSignificant};
      return;
    }
    result_.bands_are_columns = ratio < 1;
    const std::vector<double>& deviations =
        result_.bands_are_columns ? column_deviations : row_deviations;
    // The ratio of two frames contains the bands of both, independent of each other.
    const double of_both = Median(deviations);
    std::vector<double> off;
    for (const double deviation : deviations) off.push_back(std::abs(deviation - of_both));
    const double middle = of_both / std::sqrt(2.0);
    result_.bands = model::Estimate{middle, 1.4826 / std::sqrt(2.0) * Median(off) /
                                                std::sqrt(static_cast<double>(deviations.size()))};
  }

  // ---- fixed structure ----
  static cv::Mat Fine(const cv::Mat& grey) {
    const cv::Mat light = LogLight(grey);
    return Smoothed(light, 1) - Smoothed(light, 3);
  }

  void FindFixedStructure() {
    constexpr std::size_t kMaxPairs = 3;
    std::vector<const ScaleSample*> order;
    for (const auto& [frame, sample] : registered_) order.push_back(sample);
    if (order.size() < 6) return;
    std::stable_sort(order.begin(), order.end(), [](const ScaleSample* a, const ScaleSample* b) {
      return a->scale < b->scale;
    });
    std::map<std::pair<int, int>, double> at;  // excess of the product, by the shift
    std::size_t pairs = 0;
    for (std::size_t k = 0; k < kMaxPairs; ++k) {
      const ScaleSample& small = *order[k];
      const ScaleSample& large = *order[order.size() - 1 - k];
      if (AddProducts(small, large, &at)) ++pairs;
    }
    if (pairs == 0) return;
    std::vector<double> beside;
    for (const auto& [shift, product] : at) {
      if (shift != std::pair(0, 0)) beside.push_back(product / static_cast<double>(pairs));
    }
    double mean = 0, squares = 0;
    const auto count = static_cast<double>(beside.size());
    for (const double product : beside) mean += product / count;
    for (const double product : beside) squares += (product - mean) * (product - mean);
    const double sigma = std::sqrt(squares / (count - 1));
    const double variance = at[{0, 0}] / static_cast<double>(pairs) - mean;
    const double size = std::sqrt(std::max(variance, 0.0));
    // Near 0 the derivative of the root grows without bound.
    result_.fixed_structure =
        model::Estimate{size, std::min(sigma / std::max(2 * size, 1e-12), std::sqrt(sigma))};
  }

  // Adds the products at the same place and at places beside it, where the target moved by enough
  // between the two frames.
  bool AddProducts(const ScaleSample& one, const ScaleSample& other,
                   std::map<std::pair<int, int>, double>* at) const {
    constexpr double kFarPx = 6;
    constexpr int kStepPx = 11, kBesidePx = 5, kReachPx = 2 * kStepPx + kBesidePx;
    constexpr double kMinPart = 0.2;  // part of the field
    const cv::Mat a = Fine(Read(one.frame));
    const cv::Mat b = Fine(Read(other.frame));
    const Eigen::Vector2d centre(places_.centre.x, places_.centre.y);
    const PlaceInReference place_a{one.registration, centre}, place_b{other.registration, centre};
    cv::Mat far = cv::Mat::zeros(a.size(), CV_32F);
    double pixels = 0;
    for (int y = kReachPx; y + kReachPx < a.rows; ++y) {
      for (int x = kReachPx; x + kReachPx < a.cols; ++x) {
        const Eigen::Vector2d p(x, y);
        if (!((place_a(p) - place_b(p)).norm() > kFarPx)) continue;
        far.at<float>(y, x) = 1;
        ++pixels;
      }
    }
    if (!(pixels > kMinPart * static_cast<double>(a.total()))) return false;
    const cv::Rect inner(kReachPx, kReachPx, a.cols - 2 * kReachPx, a.rows - 2 * kReachPx);
    const cv::Mat masked = a.mul(far)(inner);
    const auto product = [&](int dx, int dy) {
      return masked.dot(b(inner + cv::Point(dx, dy))) / pixels;
    };
    // The remainder of a strongly blurred target is coarse, and looks alike a few pixels further
    // away.
    for (int dy = -2 * kStepPx; dy <= 2 * kStepPx; dy += kStepPx) {
      for (int dx = -2 * kStepPx; dx <= 2 * kStepPx; dx += kStepPx) {
        const double around = product(dx - kBesidePx, dy) + product(dx + kBesidePx, dy) +
                              product(dx, dy - kBesidePx) + product(dx, dy + kBesidePx);
        (*at)[{dx, dy}] += product(dx, dy) - 0.25 * around;
      }
    }
    return true;
  }

  const FramePlaces& places_;
  std::map<std::size_t, const ScaleSample*> registered_;
  FrameStructureFinding result_;
};

bool IsExcludedBy(const std::optional<model::Estimate>& found, double least) {
  return found && std::abs(found->value) + 2 * found->sigma < least;
}

}  // namespace

bool VignettingIsExcluded(const FrameStructureFinding& structure) {
  return IsExcludedBy(structure.vignetting, FrameStructureFinding::kMinVignetting);
}
bool FixedStructureIsExcluded(const FrameStructureFinding& structure) {
  return IsExcludedBy(structure.fixed_structure, FrameStructureFinding::kMinFixed);
}

bool BandsExplain(const FrameStructureFinding& structure, std::size_t missing, std::size_t frames) {
  // Standard deviation of the bands, share of the frames that is then missing.
  constexpr std::array<std::pair<double, double>, 6> kCosts = {
      {{0, 0}, {0.02, 0.13}, {0.04, 0.22}, {0.07, 0.32}, {0.1, 0.48}, {0.21, 0.9}}};
  constexpr double kMargin = 1.5;
  if (!structure.HasBands() || frames == 0) return false;
  const double bands = structure.bands->value;
  double cost = kCosts.back().second;
  for (std::size_t i = 1; i < kCosts.size(); ++i) {
    const auto [left, low] = kCosts[i - 1];
    const auto [right, high] = kCosts[i];
    if (bands < right) {
      cost = low + (high - low) * (bands - left) / (right - left);
      break;
    }
  }
  return static_cast<double>(missing) <= kMargin * cost * static_cast<double>(frames);
}

std::string BandsInWords(const FrameStructureFinding& structure) {
  if (!structure.HasBands()) return "";
  return fmt::format(
      "whole {0} brighten together by {1:.2g} % (standard deviation), at another place in each "
      "frame: the lamp flickers under a rolling shutter; expose for whole periods of the lamp, or "
      "use a steady lamp",
      structure.bands_are_columns ? "columns" : "rows", 100 * structure.bands->value);
}

FrameStructureFinding MeasureStructure(const FramePlaces& places) {
  return Structure(places).Run();
}

std::string StructureInWords(const FrameStructureFinding& structure) {
  std::vector<std::string> found;
  if (structure.HasBands()) found.push_back(BandsInWords(structure));
  if (structure.HasVignetting()) {
    const double corner = std::exp(structure.vignetting->value) - 1;
    found.push_back(fmt::format(
        "in every frame the corners are {:.2g} % {} than the centre (vignetting, or a lamp that "
        "moves with the camera); divide the frames by a photograph of an evenly lit white sheet "
        "(--flat)",
        100 * std::abs(corner), corner < 0 ? "darker" : "brighter"));
  }
  if (structure.HasFixedStructure()) {
    found.push_back(fmt::format(
        "fine structure of {:.2g} % (standard deviation) stays at the same place in every frame "
        "(dust on the sensor, hot pixels, an overlay); clean the sensor, or divide the frames by a "
        "photograph of an evenly lit white sheet",
        100 * structure.fixed_structure->value));
  }
  return fmt::format("{}", fmt::join(found, "; and "));
}

}  // namespace thicklens::calib
