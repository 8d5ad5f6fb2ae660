#ifndef THICKLENS_MODEL_LIGHT_FIELD_FILE_H_
#define THICKLENS_MODEL_LIGHT_FIELD_FILE_H_

#include <Eigen/Core>
#include <optional>
#include <string>

#include "thicklens/base/export.h"
#include "thicklens/model/light_field.h"

namespace thicklens::model {

// How the planes of a light field are stored that is kept as its scene.
struct ScenePlanes {
  int radiance_bits = 32;  // 32: floats, linear light; 16: values that the transfer curve encoded
  Eigen::Vector2d disparity_step{1, 1};  // px per view step along u and v, per unit of disparity
  bool has_colour_profile = false;       // the ICC profile of views is in a file
};

// Content of lightfield.yaml (docs/file-formats.md): a light field without its values. The schema
// is thicklens/light-field/1 if it is stored as views, and thicklens/light-field/2 as its scene.
// The camera has a file of its own in the same folder.
struct LightFieldDescription {
  LightField light_field;  // without values and without `camera`
  // "png" (16 bit, encoded values) or "tiff" (float, linear light); empty: stored as its scene.
  std::string view_format;
  // True: each ray has a confidence in confidence/view_VV_UU.png, or each point of the scene in
  // confidence.png.
  bool has_confidence = false;
  std::string camera_file;           // path relative to the description; empty: no camera
  std::optional<ScenePlanes> scene;  // present if and only if it is stored as its scene
};

// Names of the files of a light field that is stored as its scene, in its folder.
constexpr char kSceneRadianceFile[] = "scene/radiance.tiff";      // light of the points, S x T px
constexpr char kSceneDisparityFile[] = "scene/disparity.tiff";    // their disparity, floats
constexpr char kSceneConfidenceFile[] = "scene/confidence.png";   // their confidence, 8 bits
constexpr char kSceneProfileFile[] = "scene/colour-profile.icc";  // of views

// File name "view_VV_UU" of the view (k, l) without its extension. Each number has two digits, more
// where needed.
THICKLENS_EXPORT std::string ViewFileStem(int k, int l);

// Unknown keys, wrong types and values out of range throw Error with file:line:column;
// `source_name` is the file name in these messages.
THICKLENS_EXPORT LightFieldDescription ReadLightFieldDescription(const std::string& path);
// Reads the text of a description. `source_name` is the file name in messages. Throws Error as
// ReadLightFieldDescription does.
THICKLENS_EXPORT LightFieldDescription ParseLightFieldDescription(const std::string& text,
                                                                  const std::string& source_name);
// The YAML text of a description. Throws Error if a number is not finite.
THICKLENS_EXPORT std::string LightFieldDescriptionToYaml(const LightFieldDescription& description);

}  // namespace thicklens::model

#endif  // THICKLENS_MODEL_LIGHT_FIELD_FILE_H_
