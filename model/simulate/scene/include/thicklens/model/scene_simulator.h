#ifndef THICKLENS_MODEL_SCENE_SIMULATOR_H_
#define THICKLENS_MODEL_SCENE_SIMULATOR_H_

#include <Eigen/Core>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "thicklens/model/camera.h"
#include "thicklens/model/effect_choice.h"
#include "thicklens/model/light_field.h"
#include "thicklens/model/scene.h"

namespace thicklens::model {

// What is painted on a layer. Every kind but kUniform, kSine and kEdge is a periodic tile that
// holds nothing above half a cycle per px of the picture, measured where the layer's pixels are
// largest: what every view can show without aliasing. A sine finer than that is refused; an edge,
// at its sharpest, has 0.7 % there of the amplitude of one that is infinitely sharp, and less
// beyond.
enum class TextureKind {
  kUniform,
  kSine,  // colour (1 + contrast cos(2 pi (X cos(angle) + Y sin(angle))/period)), (X, Y) as below
  // colour (1 + contrast erf(d/(sqrt(2) sigma))), d the distance behind a straight line through
  // the middle (TextureOptions)
  kEdge,
  kCheckerboard,  // a corner of four squares at X = Y = 0, lower right and upper left bright
  kSiemensStar,   // bright and dark sectors around the middle, the first below the right is bright
  kDeadLeaves,    // discs of many sizes that hide each other, each of a colour of its own
  kNoise,         // amplitude falls as 1/frequency
  kPicture,       // the user's own
};
std::string TextureKindName(TextureKind kind);  // "uniform", "sine", "checkerboard", ...

struct TextureOptions {
  TextureKind kind = TextureKind::kDeadLeaves;
  // Mean radiance, RGB in linear light, 1 at full scale. A picture keeps its own colours.
  Eigen::Vector3d colour{0.5, 0.5, 0.5};
  // (bright - dark)/(bright + dark) of sine and squares; leaves have every light between the two;
  // noise has the relative standard deviation contrast/2.
  double contrast = 0.6;
  // Of leaves and noise: 0 all channels alike, 1 each on its own.
  double saturation = 0.5;
  // Radius of the smallest leaf, shortest period of noise, period of a sine, sigma of an edge, side
  // of a square, width of a star's sector half the shorter side of what is seen away from its
  // middle, width of the whole picture; px of the simulated picture at the layer's depth on the
  // axis. 0: chosen (2, 4, 8 px, as sharp as may be, 12 px, 36 bright sectors, as wide as can be
  // seen).
  double feature_size_px = 0;
  // Of a sine: its direction; of an edge: toward its bright side. From the right, positive
  // downward. Edge, star and picture have their middle in that of the outline, or of what is seen.
  double angle_deg = 0;
  std::string picture_path;  // kPicture, for messages
};

// A plane, z = depth_mm + slope . (X, Y): positions from the optical axis in mm, X right, Y down.
// Its 1/z is linear in the picture: (1 - slope . tan(angle of the chief ray))/depth_mm.
struct PlaneOptions {
  double depth_mm = 0;
  Eigen::Vector2d slope{0, 0};  // mm deeper per mm to the right and down
};

// A surface of any shape in place of a plane: 1/z = W(x') at the position x' of the picture at
// which the chief ray shows it, W from a depth map of the scene's size, bilinear between pixel
// centres and beyond the outermost as there. Its texture is painted on x': a picture of the
// map's shape, if nothing else is said, has its pixels where the map has them. Across an edge of
// depth the surface is stretched from one pixel to the next like a sheet of rubber, with what is
// painted between them.
struct DepthMapOptions {
  std::string map_path;        // for messages
  DepthConvention convention;  // kZ or kRange
};

// Which part of its plane a layer fills. In px it is the part that chief rays meet inside these
// positions of the picture; in mm, inside these (X, Y). A mask is a grey picture of the scene's
// size: inside is where its values, bilinear between pixel centres and beyond the outermost as
// there, are at least half of full scale.
struct OutlineOptions {
  enum class Shape { kWhole, kRectangle, kDisc, kMask };
  enum class Unit { kPx, kMm };
  Shape shape = Shape::kWhole;
  Unit unit = Unit::kPx;
  Eigen::Vector2d centre{0, 0};  // in `unit`, as the two below
  Eigen::Vector2d size{0, 0};    // kRectangle
  double radius = 0;             // kDisc
  std::string mask_path;         // kMask, in px; for messages
};

// The mirror image of a lamp in the gloss of a layer: light added to the layer's own, which differs
// from view to view, since the image lies behind the layer. Its radiance is
// strength exp(-|x - centre|^2/(2 sigma^2)) at the position x where chief rays show the point in
// which a ray meets the plane of the image.
struct GlossOptions {
  double depth_mm = 0;              // of the image, > 0; a flat mirror has it behind itself
  Eigen::Vector2d centre_px{0, 0};  // in the picture
  double sigma_px = 0;              // > 0
  double strength = 0;              // radiance of its middle, the same in all channels; >= 0
};

struct SceneLayer {
  std::string name;  // for messages; may be empty
  PlaneOptions plane;
  std::optional<DepthMapOptions> depth;  // the plane is left out then, and the outline is whole
  OutlineOptions outline;
  TextureOptions texture;
  std::vector<GlossOptions> gloss;
};

// What the files that a layer names hold; empty for those that it does not.
struct LayerPixels {
  LinearPicture texture;  // kPicture, in linear light
  LinearPicture mask;     // kMask: one channel, stored values, 1 at full scale
  RawDepthMap depth;      // of SceneLayer::depth
};

// What a picture of a scene can have.
EffectSet PictureEffects();

struct SceneSimulationOptions {
  // Size, pitch, lens; its calibration gives d1, kappa and the lens floor (absent: 0).
  Camera camera;
  std::vector<SceneLayer> layers;  // in any order: along each ray the nearest one is seen
  EffectChoice effects;            // of PictureEffects()
  // Rms error that a finite number of rays may leave in stored values, in 1/255 of full scale; 0:
  // all pixels get as many as may be.
  double sampling_error_grey_levels = 0.2;
  int rays_per_pixel = 600;  // at most
  double wavelength_mm = 550e-6;
  // Noise of the sensor: electrons at full scale (0: no shot noise), and sd of what is read.
  double full_well_electrons = 0, read_noise_electrons = 0;
  // Standard deviation of noise of the stored values, in 1/255 of full scale at 8 and 16 bits.
  double noise_sigma_grey_levels = 0;
  int bits = 8;                  // 8 or 16
  int u_count = 5, v_count = 5;  // views of the true light field
  double uv_depth_mm = 0;        // where its UV plane lies; ST lies in the plane of focus
  std::uint64_t seed = 1;

  bool IsValid(std::string* why) const;
};

// Reads schema thicklens/simulate-scene/1 (docs/file-formats.md).
SceneSimulationOptions ReadSceneSimulation(const std::string& path);

// What a simulated picture was made with.
struct SceneTruth {
  double image_distance_mm = 0;
  double focus_depth_mm = 0;
  double blur_ratio = 0;
  double blur_floor_px = 0;
  double nearest_depth_mm = 0, farthest_depth_mm = 0;  // of the depth map
  double largest_blur_sigma_px = 0;                    // of defocus alone, over the depth map
  EffectRecord effects;
  double sampling_error_grey_levels = 0;  // rms, of the pixels where it is largest
  std::uint64_t seed = 0;
};
std::string SceneTruthToYaml(const SceneTruth& truth);  // schema thicklens/scene-truth/1

// How a long computation runs. `progress` is called from any thread, one call at a time; what it
// throws ends the computation and passes to the caller.
struct SceneRun {
  int threads = 0;  // 0: one per core
  std::function<void(int done, int total)> progress;
};

// Image formation from a scene of textured surfaces to a photograph and its true light field, by
// the geometric optics of the thick lens. It knows no light-field samples: the ray of picture
// position x through aperture position A meets depth z at
//   X(z) = (x - cx) z p/K + A (1 - z/zf),
// the line that lands A c(z)/p to the left of the chief ray of what it meets there ([D37], derived
// here from [S16] with UV on the aperture). A plane is met in closed form, a depth map by a search
// from pixel to pixel and in closed form between four of them.
//
// A pixel of the photograph is the mean over a set of rays (Hammersley points), as many as its blur
// and its surroundings ask for (see sampling_plan.h); pixels with as many have the same set. It
// spreads over the aperture by the camera's PSF (Gaussian of standard deviation kappa r, or disc of
// radius 2 kappa r; the set's second moment is exactly (kappa r)^2) and over the pixel box widened
// by the lens floor; each effect that is off takes its part of the set with it. With 600 rays the
// transfer function is off by 0.01 at the highest frequencies and the share of a pixel that an edge
// hides by 0.005, rms.
//
// Everything is RGB. The same options give the same bits on any number of threads.
class SceneSimulator {
 public:
  // `pixels`: one entry a layer; missing ones are empty. Throws Error if the options are not valid,
  // a file's picture is not what its layer needs, a ray can miss or meet behind the front focal
  // point one of the planes, a depth map has holes, no layer is whole, a texture cannot be drawn,
  // or an effect is named that a picture of a scene cannot have. `threads` (0: one per core) draw
  // the layers.
  SceneSimulator(const SceneSimulationOptions& options, const std::vector<LayerPixels>& pixels,
                 int threads = 0);
  ~SceneSimulator();
  SceneSimulator(const SceneSimulator&) = delete;
  SceneSimulator& operator=(const SceneSimulator&) = delete;

  const EffectDecision& effects() const;      // of the photograph
  const EffectSet& effects_of_views() const;  // pixel box, lens floor, diffraction, as chosen
  // Rms of the photograph's pixels where it is largest, of stored values, in 1/255.
  double sampling_error_grey_levels() const;
  // Of the photograph: what it costs.
  double mean_rays_per_pixel() const;
  // As what Store writes is to be understood: linear if its transfer curve was left out.
  const Camera& camera() const;

  // Linear light before noise and quantisation: 1 for the radiance 1 at the principal point.
  LinearPicture RenderNoiseless(const SceneRun& run) const;
  // What the camera stores of it: noise, transfer curve, rounding, clipping.
  StoredPicture Store(const LinearPicture& noiseless) const;

  // z in mm of what the chief ray of each pixel's centre meets.
  RawDepthMap RenderDepth() const;
  SceneTruth Truth(const RawDepthMap& depth) const;

  // Radiance as seen from one aperture position, mm: with effects_of_views(), neither defocus nor
  // fall-off.
  LinearPicture RenderView(const Eigen::Vector2d& aperture_mm, const SceneRun& run) const;
  // Such views on GridOnPlanes, UV as the options say. Off the aperture a view is seen from a point
  // of UV, and its rays cross the aperture in different places. Throws Error if one of them crosses
  // farther than 4 standard deviations (kappa r per axis) from the middle: textures end there.
  LightField RenderLightField(int u_count, int v_count, const SceneRun& run) const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace thicklens::model

#endif  // THICKLENS_MODEL_SCENE_SIMULATOR_H_
