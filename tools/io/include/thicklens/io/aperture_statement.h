#ifndef THICKLENS_IO_APERTURE_STATEMENT_H_
#define THICKLENS_IO_APERTURE_STATEMENT_H_

#include <Eigen/Core>
#include <optional>
#include <string>

#include "thicklens/base/export.h"
#include "thicklens/model/light_field.h"
#include "thicklens/model/light_field_grid.h"

namespace thicklens::io {

// Returns whether the folder of a light field states the aperture weights of its views. The
// `weights` of lightfield.yaml state them. The HCI layout has no place for them, and its views are
// read as equal weights.
THICKLENS_EXPORT bool StatesAperture(const std::string& light_field_path);

// Returns the weights that `shape` gives to the present views, V x U, sum 1.
THICKLENS_EXPORT Eigen::ArrayXXd ShapeOfPresentViews(model::ApertureShape shape,
                                                     const model::LightField& light_field);
// Returns the light field's own weights of the present views, sum 1.
THICKLENS_EXPORT Eigen::ArrayXXd OwnWeightsOfPresentViews(const model::LightField& light_field);

// The name of the shape whose weights the light field has, or "weights of no known shape".
THICKLENS_EXPORT std::string OwnApertureInWords(const model::LightField& light_field);

// Throws Error with both values if the light field's weights, which its file states, are not those
// of `shape`. `asked` says who asks for that shape: "--aperture-shape gaussian".
THICKLENS_EXPORT void RequireStatedAperture(const std::string& light_field_path,
                                            const model::LightField& light_field,
                                            model::ApertureShape shape, const std::string& asked);

// Returns one line if the files of two light fields state apertures of different shapes: their
// views are the same, but an estimate for an aperture other than the photograph's is worse.
THICKLENS_EXPORT std::optional<std::string> DifferentApertures(const std::string& path,
                                                               const model::LightField& light_field,
                                                               const std::string& other_path,
                                                               const model::LightField& other);

}  // namespace thicklens::io

#endif  // THICKLENS_IO_APERTURE_STATEMENT_H_
