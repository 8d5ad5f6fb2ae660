#include "thicklens/io/aperture_statement.h"

#include <fmt/format.h>

#include <filesystem>
#include <system_error>

#include "thicklens/base/error.h"
#include "thicklens/base/printable_text.h"
#include "thicklens/estimator/aperture_weights.h"
#include "thicklens/io/light_field_io.h"

namespace thicklens::io {
namespace {

namespace fs = std::filesystem;

// The weights in files are rounded.
constexpr double kRoundedWeight = 1e-6;

Eigen::ArrayXXd SharesOfPresent(Eigen::ArrayXXd weights, const model::LightField& light_field) {
  for (int l = 0; l < light_field.v_count; ++l) {
    for (int k = 0; k < light_field.u_count; ++k) {
      if (!light_field.IsPresent(k, l)) weights(l, k) = 0;
    }
  }
  return weights / weights.sum();
}

}  // namespace

bool StatesAperture(const std::string& light_field_path) {
  std::error_code failure;
  return fs::exists(fs::path(light_field_path) / kLightFieldMarker, failure);
}

Eigen::ArrayXXd ShapeOfPresentViews(model::ApertureShape shape,
                                    const model::LightField& light_field) {
  return SharesOfPresent(model::ApertureWeights(shape, light_field.u_count, light_field.v_count),
                         light_field);
}

Eigen::ArrayXXd OwnWeightsOfPresentViews(const model::LightField& light_field) {
  return SharesOfPresent(light_field.weights, light_field);
}

std::string OwnApertureInWords(const model::LightField& light_field) {
  const std::optional<model::ApertureShape> shape = estimator::ShapeOfWeights(light_field);
  return shape ? model::ApertureShapeName(*shape) : "weights of no known shape";
}

void RequireStatedAperture(const std::string& light_field_path,
                           const model::LightField& light_field, model::ApertureShape shape,
                           const std::string& asked) {
  const Eigen::ArrayXXd stated = OwnWeightsOfPresentViews(light_field);
  const Eigen::ArrayXXd wanted = ShapeOfPresentViews(shape, light_field);
  Eigen::Index l = 0, k = 0;
  if ((stated - wanted).abs().maxCoeff(&l, &k) <= kRoundedWeight) return;
  throw Error(
      fmt::format("{}: weights: this light field states its aperture as {} (view ({}, {}) has a "
                  "share of {:.6g}), but {} gives that view {:.6g}: they must be equal; without "
                  "that shape the stated weights are used",
                  PrintableUtf8((fs::path(light_field_path) / kLightFieldMarker).string()),
                  OwnApertureInWords(light_field), k, l, stated(l, k), asked, wanted(l, k)));
}

std::optional<std::string> DifferentApertures(const std::string& path,
                                              const model::LightField& light_field,
                                              const std::string& other_path,
                                              const model::LightField& other) {
  if (!StatesAperture(path) || !StatesAperture(other_path)) return std::nullopt;
  const auto shape = estimator::ShapeOfWeights(light_field);
  const auto other_shape = estimator::ShapeOfWeights(other);
  if (!shape || !other_shape) return std::nullopt;
  // Several shapes may give the same weights if there are few views.
  const Eigen::ArrayXXd one = ShapeOfPresentViews(*shape, light_field);
  const Eigen::ArrayXXd two = ShapeOfPresentViews(*other_shape, other);
  if (one.rows() == two.rows() && one.cols() == two.cols() &&
      ((one - two).abs() <= kRoundedWeight).all()) {
    return std::nullopt;
  }
  if (*shape == *other_shape) return std::nullopt;  // the views differ
  return fmt::format(
      "{} states a {} aperture, {} a {} one: views from the same places are compared, but an "
      "estimate must be made for the aperture that the photograph was taken through",
      PrintableUtf8(path), model::ApertureShapeName(*shape), PrintableUtf8(other_path),
      model::ApertureShapeName(*other_shape));
}

}  // namespace thicklens::io
