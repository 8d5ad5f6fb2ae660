#ifndef THICKLENS_MODEL_SCENE_SIMULATOR_H_
#define THICKLENS_MODEL_SCENE_SIMULATOR_H_

#include <Eigen/Core>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "thicklens/base/export.h"
#include "thicklens/base/progress.h"
#include "thicklens/model/camera.h"
#include "thicklens/model/effect_selection.h"
#include "thicklens/model/light_field.h"
#include "thicklens/model/scene.h"

namespace thicklens::model {

// The texture of a layer. All kinds except kUniform, kSine and kEdge are periodic tiles without
// frequencies above half a cycle per px of the image, measured where the layer's pixels are
// largest, so that no view aliases. A sine with a higher frequency throws Error. The sharpest edge
// has at half a cycle per px 0.7 % of the amplitude of an infinitely sharp edge, and less at higher
// frequencies.
enum class TextureKind {
  kUniform,  // the same radiance everywhere
  kSine,  // colour (1 + contrast cos(2 pi (X cos(angle) + Y sin(angle))/period)), (X, Y) as below
  // colour (1 + contrast erf(d/(sqrt(2) sigma))), where d is the distance behind a straight line
  // through the middle (TextureOptions)
  kEdge,
  kCheckerboard,  // a corner of four squares is at X = Y = 0; lower right and upper left are bright
  kSiemensStar,   // bright and dark sectors around the middle; the first sector below the right is
                  // bright
  kDeadLeaves,    // discs of many sizes that occlude each other, each with its own colour
  kNoise,         // the amplitude decreases as 1/frequency
  kImage,         // an image of the user
};
THICKLENS_EXPORT std::string TextureKindName(
    TextureKind kind);  // "uniform", "sine", "checkerboard", ...

// The radiance of a layer's surface.
struct TextureOptions {
  TextureKind kind = TextureKind::kDeadLeaves;  // what is painted on the surface
  // Mean radiance, RGB in linear light, 1 at full scale. An image (kImage) keeps its own colours.
  Eigen::Vector3d colour{0.5, 0.5, 0.5};
  // Value of (bright - dark)/(bright + dark) for a sine, an edge, squares and sectors. Leaves have
  // every radiance between the two. Noise has the relative standard deviation contrast/2.
  double contrast = 0.6;
  // Colour variation of leaves and noise: at 0 all channels are equal, at 1 each channel is
  // independent.
  double saturation = 0.5;
  // Size of the detail, in px of the simulated image at the layer's depth on the axis: radius of
  // the smallest leaf, shortest period of noise, period of a sine, sigma of an edge, side of a
  // square, width of a star's sector (at half the shorter side of the visible part from its middle)
  // or width of the whole image (kImage). The value 0 selects 2 px (leaf), 4 px (noise), 8 px
  // (sine), the sharpest possible edge, 12 px (square), 36 bright sectors, or the width that covers
  // the visible part.
  double feature_size_px = 0;
  // Direction of a sine, or direction toward the bright side of an edge, measured from the right,
  // positive downward. The middle of an edge, a star or an image is that of the outline or, without
  // an outline, of the visible part.
  double angle_deg = 0;
  std::string image_path;  // path of the image (kImage), for messages
};

// A plane z = depth_mm + slope . (X, Y), where X (right) and Y (down) are positions from the
// optical axis in mm. Its 1/z is linear in the image: (1 - slope . tan(angle of the chief
// ray))/depth_mm.
struct PlaneOptions {
  double depth_mm = 0;          // z on the optical axis, from Ap, mm
  Eigen::Vector2d slope{0, 0};  // mm of depth per mm to the right and down
};

// A surface of any shape instead of a plane: 1/z = W(x'), where x' is the image position at which
// the chief ray shows it. W comes from a depth map of the scene's size; it is bilinear between
// pixel centres and constant beyond the outermost ones. The texture is painted on x': by default an
// image (kImage) with the map's aspect ratio has its pixels at those of the map. Across a depth
// edge the surface and its texture are stretched from one pixel to the next.
struct DepthMapOptions {
  std::string map_path;        // for messages
  DepthConvention convention;  // kZ or kRange
};

// The part of its plane that a layer fills. In px it is the part that chief rays meet inside these
// image positions; in mm it is the part inside these (X, Y). A mask is a grey image of the scene's
// size. Its values are bilinear between pixel centres and constant beyond the outermost ones; a
// position is inside where the value is at least half of full scale.
struct OutlineOptions {
  // The whole plane (kWhole), a rectangle, a disc, or what a mask image marks.
  enum class Shape { kWhole, kRectangle, kDisc, kMask };
  // Image positions of chief rays (kPx), or positions on the plane (kMm).
  enum class Unit { kPx, kMm };
  Shape shape = Shape::kWhole;   // shape of the part
  Unit unit = Unit::kPx;         // unit of the lengths below
  Eigen::Vector2d centre{0, 0};  // in `unit`, like `size` and `radius`
  Eigen::Vector2d size{0, 0};    // kRectangle only
  double radius = 0;             // kDisc only
  std::string mask_path;         // kMask only, in px; for messages
};

// The mirror image of a lamp in the gloss of a layer. Its light is added to that of the layer. It
// differs from view to view because the mirror image is behind the layer. Its radiance is strength
// exp(-|x - centre|^2/(2 sigma^2)), where x is the position at which chief rays show the point in
// which a ray meets the plane of the mirror image.
struct GlossOptions {
  double depth_mm = 0;  // depth of the mirror image, > 0; for a flat mirror it is behind the mirror
  Eigen::Vector2d centre_px{0, 0};  // centre in the image
  double sigma_px = 0;              // standard deviation, > 0
  double strength = 0;              // radiance at the centre, the same in all channels; >= 0
};

// One surface of the scene with its outline, texture and gloss.
struct SceneLayer {
  std::string name;                      // for messages; may be empty
  PlaneOptions plane;                    // where the surface is
  std::optional<DepthMapOptions> depth;  // replaces the plane; the outline must then be whole
  OutlineOptions outline;                // the part that is there
  TextureOptions texture;                // its radiance
  std::vector<GlossOptions> gloss;       // mirror images of lamps; may be empty
};

// Contents of the files that a layer names. A field is empty if the layer names no such file.
struct LayerPixels {
  LinearImage texture;  // kImage, in linear light
  LinearImage mask;     // kMask: one channel of encoded values, 1 at full scale
  RawDepthMap depth;    // depth map of SceneLayer::depth
};

// Returns the effects that an image of a scene can have.
THICKLENS_EXPORT EffectSet ImageEffects();

// What SceneSimulator simulates. The defaults are those of the file's schema.
struct SceneSimulationOptions {
  // Image size, pitch and lens. The calibration gives d1, kappa and the blur floor (0 if absent).
  Camera camera;
  std::vector<SceneLayer> layers;  // in any order: each ray shows the nearest layer
  EffectSelectionOptions effects;  // a choice of the effects ImageEffects()
  // Allowed rms error of the encoded values because of the finite number of rays, in 1/255 of full
  // scale. 0: all pixels get rays_per_pixel rays.
  double sampling_error_grey_levels = 0.2;
  int rays_per_pixel = 600;       // maximum number
  double wavelength_mm = 550e-6;  // wavelength of the light, mm, for diffraction
  // Sensor noise: electrons at full scale (0: no shot noise) and standard deviation of the read
  // noise.
  double full_well_electrons = 0, read_noise_electrons = 0;
  // Standard deviation of the noise of the encoded values, in 1/255 of full scale at 8 and 16 bits.
  double noise_sigma_grey_levels = 0;
  int bits = 8;                      // 8 or 16
  int u_count = 5, v_count = 5;      // numbers of views of the true light field
  double uv_depth_mm = 0;            // depth of its UV plane; ST is in the plane of focus
  std::uint64_t seed = 1;            // of textures and noise
  std::vector<std::string> notices;  // of the file, one line each: names that are deprecated

  // Returns whether all members are valid. Otherwise `why`, if not null, gets the reason.
  THICKLENS_EXPORT bool IsValid(std::string* why) const;
};

// Reads a file of the schema thicklens/simulate-scene/1 (docs/file-formats.md). Throws Error if it
// is not valid.
THICKLENS_EXPORT SceneSimulationOptions ReadSceneSimulation(const std::string& path);

// The parameters of a simulated image.
struct SceneTruth {
  double image_distance_mm = 0;                        // d1 from Ap to the sensor, mm
  double focus_depth_mm = 0;                           // zf from Ap, mm
  double blur_ratio = 0;                               // kappa, dimensionless
  double blur_floor_px = 0;                            // sigma of the blur floor, px
  double nearest_depth_mm = 0, farthest_depth_mm = 0;  // minimum and maximum of the depth map
  double largest_blur_sigma_px = 0;       // maximum of defocus alone, over the depth map
  EffectSelectionRecord effects;          // which effects the photograph has
  double sampling_error_grey_levels = 0;  // rms, of the pixels where it is largest
  std::uint64_t seed = 0;                 // of textures and noise
};
THICKLENS_EXPORT std::string SceneTruthToYaml(
    const SceneTruth& truth);  // schema thicklens/scene-truth/1

// Control of a long computation.
struct SceneRun {
  int threads = 0;            // 0: one per core
  ProgressFunction progress;  // gets the rows or views that are done; empty: none
};

// Image formation from a scene of textured surfaces to a photograph and its true light field by the
// geometric optics of the thick lens. The simulator does not use light-field samples: the ray of
// image position x through aperture position A is at depth z at
//   X(z) = (x - cx) z p/K + A (1 - z/zf).
// This line lands A c(z)/p to the left of the chief ray of the point that it meets there ([D37],
// derived here from [S16] with UV on the aperture). The intersection with a plane has a closed
// form. For a depth map, a search goes from pixel to pixel, and the intersection between four
// pixels has a closed form.
//
// A pixel of the photograph is the mean over a set of rays (Hammersley points). Their number
// depends on the blur and the surroundings of the pixel (sampling_plan.h); pixels with equal
// numbers use the same set. The set spreads over the aperture by the camera's PSF (a Gaussian of
// standard deviation kappa r, or a disc of radius 2 kappa r; the second moment of the set is
// exactly (kappa r)^2) and over the pixel box widened by the blur floor. Each effect that is off
// removes its part of the spread. With 600 rays the rms error of the transfer function is 0.01 at
// the highest frequencies, and that of the share of a pixel that an edge occludes is 0.005.
//
// All images are RGB. The same options give the same bits for any number of threads.
class THICKLENS_EXPORT SceneSimulator {
 public:
  // `pixels` has one entry per layer; missing entries are empty. The layers are drawn by `threads`
  // threads (0: one per core). The constructor throws Error if the options are not valid, an image
  // from a file does not fit its layer, a ray misses a plane or meets it in front of the front
  // focal point, a depth map has holes, no layer is whole, a texture cannot be drawn, or an effect
  // is named that an image of a scene cannot have.
  SceneSimulator(const SceneSimulationOptions& options, const std::vector<LayerPixels>& pixels,
                 int threads = 0);
  ~SceneSimulator();
  SceneSimulator(const SceneSimulator&) = delete;
  SceneSimulator& operator=(const SceneSimulator&) = delete;

  const EffectSelection& effects() const;     // effects of the photograph
  const EffectSet& effects_of_views() const;  // the chosen ones of pixel box, blur floor and
                                              // diffraction
  // Rms error of the encoded values of the photograph because of the finite number of rays, where
  // it is largest, in 1/255 of full scale.
  double sampling_error_grey_levels() const;
  // Mean number of rays per pixel of the photograph, which determines the cost.
  double mean_rays_per_pixel() const;
  // The camera with which the output of Store must be interpreted. Its transfer curve is linear if
  // that effect is off.
  const Camera& camera() const;

  // Returns linear light before noise and quantisation. The radiance 1 gives 1 at the principal
  // point.
  LinearImage RenderNoiseless(const SceneRun& run) const;
  // Returns the encoded values of the camera: noise, transfer curve, rounding and clipping are
  // applied.
  EncodedImage Store(const LinearImage& noiseless) const;

  // Returns the depth z, in mm, of the point that the chief ray of each pixel's centre meets.
  RawDepthMap RenderDepth() const;
  // Returns the parameters of the image with the range of `depth`, which RenderDepth made.
  SceneTruth Truth(const RawDepthMap& depth) const;

  // Returns the radiance seen from one aperture position, mm, with effects_of_views() and with
  // neither defocus nor fall-off. Throws Error if the position is on either axis more than 6
  // standard deviations (kappa r) from the middle.
  LinearImage RenderView(const Eigen::Vector2d& aperture_mm, const SceneRun& run) const;
  // Returns such views on GridOnPlanes, with the UV plane of the options. If UV is not the
  // aperture, a view is seen from a point of UV, and its rays cross the aperture at different
  // places. Throws Error if one of them crosses farther than 4 standard deviations (kappa r per
  // axis) from the middle, because textures are drawn only up to there.
  LightField RenderLightField(int u_count, int v_count, const SceneRun& run) const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace thicklens::model

#endif  // THICKLENS_MODEL_SCENE_SIMULATOR_H_
