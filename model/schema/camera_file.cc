#include "thicklens/model/camera_file.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <iterator>
#include <memory>
#include <utility>

#include "model/schema/former_blur_ratio.h"
#include "model/schema/yaml_fields.h"
#include "model/schema/yaml_writer.h"
#include "thicklens/base/input_file.h"
#include "thicklens/base/yaml_reader.h"
#include "thicklens/model/measured_psf.h"
#include "thicklens/model/psf_file.h"

namespace thicklens::model {
namespace {

constexpr char kSchema[] = "thicklens/camera/2";
// The blur ratio had another definition in this schema (former_blur_ratio.h).
constexpr char kFormerSchema[] = "thicklens/camera/1";
constexpr int kMaxImageSizePx = 100000;

// Returns the number of a node that is a number or {value: .., tolerance: .., assumed: ..}, and
// stores the statement, if there is one, in the camera.
YamlNode ValueNode(const YamlNode& node, Camera* camera) {
  if (!node.IsMap()) return node;
  node.RequireKeys({"value", "tolerance", "assumed"});
  Provenance statement;
  if (const auto tolerance = node.Find("tolerance"))
    statement.tolerance = tolerance->NonNegativeNumber();
  if (const auto assumed = node.Find("assumed")) statement.assumed = assumed->Boolean();
  if (statement.assumed || statement.tolerance > 0) camera->statements[node.path()] = statement;
  return node.At("value");
}

constexpr const char* kLengthsOfLens[] = {"front_focal_length_mm", "rear_focal_length_mm",
                                          "lens_thickness_mm", "aperture_radius_mm"};
constexpr const char* kDataOfObjective[] = {"magnification", "numerical_aperture",
                                            "tube_lens_focal_length_mm"};
constexpr char kApertureBehindFront[] = "aperture_behind_front_mm";
constexpr char kDistortion[] = "distortion";
constexpr char kMeasuredPsf[] = "measured", kPsfFile[] = "psf_file", kPsfLike[] = "psf_like";

// Returns the first of the keys that the map has; empty: it has none.
template <std::size_t kCount>
std::string FirstKeyOf(const YamlNode& node, const char* const (&keys)[kCount]) {
  const auto found = std::find_if(std::begin(keys), std::end(keys),
                                  [&node](const char* key) { return node.Has(key); });
  return found == std::end(keys) ? "" : *found;
}

// Returns whether the lens is stated by the data of an objective. A mixture of both forms throws
// Error: two statements of one lens could contradict each other.
bool IsObjective(const YamlNode& node) {
  const std::string length = FirstKeyOf(node, kLengthsOfLens);
  const std::string datum = FirstKeyOf(node, kDataOfObjective);
  if (!length.empty() && !datum.empty()) {
    throw node.At(datum).ErrorHere(fmt::format(
        "'{}' is of an objective and '{}' of a lens: state either {}, or {}, not both", datum,
        length, fmt::join(kDataOfObjective, ", "), fmt::join(kLengthsOfLens, ", ")));
  }
  return !datum.empty();
}

void ReadObjective(const YamlNode& node, Camera* camera) {
  Objective objective;
  objective.magnification = ValueNode(node.At("magnification"), camera).PositiveNumber();
  const YamlNode aperture = ValueNode(node.At("numerical_aperture"), camera);
  objective.numerical_aperture = aperture.PositiveNumber();
  if (!(objective.numerical_aperture < 1)) {
    throw aperture.ErrorHere(fmt::format("must be < 1, found {}: immersion is not supported",
                                         objective.numerical_aperture));
  }
  objective.tube_lens_focal_length_mm =
      ValueNode(node.At("tube_lens_focal_length_mm"), camera).PositiveNumber();
  camera->objective = objective;
  camera->lens = LensOfObjective(objective);
}

void ReadDistortionCovariance(const YamlNode& node, LensDistortion* distortion) {
  node.RequireKeys({"order", "rows"});
  const std::vector<std::string> order = distortion->CovarianceOrder();
  const auto names = node.At("order").ElementsExactly(order.size());
  for (std::size_t i = 0; i < order.size(); ++i) names[i].OneOf({order[i]});
  const auto rows = node.At("rows").ElementsExactly(order.size());
  const auto n = static_cast<Eigen::Index>(order.size());
  distortion->covariance.resize(n, n);
  for (Eigen::Index i = 0; i < n; ++i) {
    const auto cells = rows[static_cast<std::size_t>(i)].ElementsExactly(order.size());
    for (Eigen::Index j = 0; j < n; ++j)
      distortion->covariance(i, j) = cells[static_cast<std::size_t>(j)].Number();
  }
  constexpr double kRounding = 1e-6;
  const Eigen::MatrixXd& c = distortion->covariance;
  if (!c.isApprox(c.transpose(), kRounding) || (c.diagonal().array() < 0).any())
    throw node.ErrorHere("a covariance must be symmetric, with variances >= 0");
}

LensDistortion ReadDistortion(const YamlNode& node) {
  if (!node.IsMap()) {
    throw node.ErrorHere(
        "a map with model, size_px, focal_length_px, principal_point_px and coefficients is "
        "expected (thicklens camera init --distortion FILE writes it)");
  }
  node.RequireKeys(
      {"model", "size_px", "focal_length_px", "principal_point_px", "coefficients", "covariance"});
  LensDistortion found;
  found.model = node.At("model").OneOf({"opencv", "fisheye"}) == "fisheye"
                    ? DistortionModel::kFisheye
                    : DistortionModel::kOpenCv;
  const auto size = node.At("size_px").ElementsExactly(2);
  found.width_px = size[0].Integer(1, kMaxImageSizePx);
  found.height_px = size[1].Integer(1, kMaxImageSizePx);
  const auto focal = node.At("focal_length_px").ElementsExactly(2);
  found.focal_length_px = {focal[0].PositiveNumber(), focal[1].PositiveNumber()};
  const auto point = node.At("principal_point_px").ElementsExactly(2);
  found.principal_point_px = {point[0].Number(), point[1].Number()};
  for (const YamlNode& number : node.At("coefficients").Elements())
    found.coefficients.push_back(number.Number());
  if (const auto covariance = node.Find("covariance"))
    ReadDistortionCovariance(*covariance, &found);
  found.source = node.source();
  std::string why;
  if (!found.IsValid(&why)) throw node.ErrorHere(why);
  return found;
}

void ReadLens(const YamlNode& node, Camera* camera) {
  std::vector<std::string> keys(std::begin(kLengthsOfLens), std::end(kLengthsOfLens));
  keys.insert(keys.end(), std::begin(kDataOfObjective), std::end(kDataOfObjective));
  keys.emplace_back(kApertureBehindFront);
  keys.emplace_back(kDistortion);
  node.RequireKeys(keys);
  if (const auto distortion = node.Find(kDistortion))
    camera->distortion = ReadDistortion(*distortion);
  if (const auto behind = node.Find(kApertureBehindFront))
    camera->aperture_behind_front_mm = ValueNode(*behind, camera).Number();
  if (IsObjective(node)) {
    ReadObjective(node, camera);
    return;
  }
  ThickLens& lens = camera->lens;
  lens.front_focal_length_mm = ValueNode(node.At("front_focal_length_mm"), camera).PositiveNumber();
  lens.rear_focal_length_mm = ValueNode(node.At("rear_focal_length_mm"), camera).PositiveNumber();
  lens.lens_thickness_mm = ValueNode(node.At("lens_thickness_mm"), camera).Number();
  lens.aperture_radius_mm = ValueNode(node.At("aperture_radius_mm"), camera).PositiveNumber();
}

void ReadSensor(const YamlNode& node, Camera* camera) {
  node.RequireKeys({"width_px", "height_px", "pixel_pitch_mm", "principal_point_px", "transfer"});
  Sensor& sensor = camera->sensor;
  sensor.width_px = ValueNode(node.At("width_px"), camera).Integer(1, kMaxImageSizePx);
  sensor.height_px = ValueNode(node.At("height_px"), camera).Integer(1, kMaxImageSizePx);
  sensor.pixel_pitch_mm = ValueNode(node.At("pixel_pitch_mm"), camera).PositiveNumber();
  const auto point = node.At("principal_point_px").ElementsExactly(2);
  sensor.principal_point_px = {ValueNode(point[0], camera).Number(),
                               ValueNode(point[1], camera).Number()};
  const YamlNode transfer = node.At("transfer");
  if (transfer.IsMap()) transfer.RequireKeys({"value", "assumed"});  // a curve has no tolerance
  sensor.transfer = ReadTransfer(ValueNode(transfer, camera));
}

std::optional<Estimate> FindEstimate(const YamlNode& parent, const std::string& key,
                                     double (YamlNode::*number)() const) {
  const auto node = parent.Find(key);
  if (!node) return std::nullopt;
  return ReadEstimate(*node, number);
}

Evidence ReadEvidence(const YamlNode& node) {
  node.RequireKeys({"method", "undistorted", "frames_used", "frames_rejected", "chi2_per_dof",
                    "focus_depth_mm", "blur_family", "blur_band", "data_sha256", "version",
                    "date"});
  Evidence evidence;
  evidence.method = node.At("method").Text();
  if (const auto undistorted = node.Find("undistorted"))
    evidence.undistorted = undistorted->Boolean();
  if (const auto used = node.Find("frames_used")) evidence.frames_used = used->Integer(0, 1000000);
  if (const auto rejected = node.Find("frames_rejected")) {
    for (const YamlNode& frame : rejected->Elements()) {
      frame.RequireKeys({"image", "reason"});
      evidence.frames_rejected.push_back({frame.At("image").Text(), frame.At("reason").Text()});
    }
  }
  if (const auto chi2 = node.Find("chi2_per_dof"))
    evidence.chi2_per_dof = chi2->NonNegativeNumber();
  evidence.focus_depth_mm = FindEstimate(node, "focus_depth_mm", &YamlNode::PositiveNumber);
  if (const auto family = node.Find("blur_family"))
    evidence.blur_family = family->OneOf({"gaussian", "disc"});
  if (const auto band = node.Find("blur_band")) evidence.blur_band = band->PositiveNumber();
  if (const auto hash = node.Find("data_sha256")) evidence.data_sha256 = hash->Text();
  if (const auto version = node.Find("version")) evidence.version = version->Text();
  if (const auto date = node.Find("date")) evidence.date = date->Text();
  return evidence;
}

void ReadCovariance(const YamlNode& node, CameraCalibration* calibration) {
  node.RequireKeys({"order", "rows"});
  for (const YamlNode& name : node.At("order").Elements()) {
    std::vector<std::string>& order = calibration->covariance_order;
    const std::string parameter =
        name.OneOf({"image_distance_mm", "blur_ratio", "blur_floor_px", "bench_offset_mm"});
    if (std::find(order.begin(), order.end(), parameter) != order.end())
      throw name.ErrorHere(fmt::format("'{}' is listed twice", parameter));
    order.push_back(parameter);
  }
  const std::size_t n = calibration->covariance_order.size();
  const auto rows = node.At("rows").ElementsExactly(n);
  calibration->covariance.resize(static_cast<Eigen::Index>(n), static_cast<Eigen::Index>(n));
  for (std::size_t i = 0; i < n; ++i) {
    const auto row = rows[i].ElementsExactly(n);
    for (std::size_t j = 0; j < n; ++j) {
      calibration->covariance(static_cast<Eigen::Index>(i), static_cast<Eigen::Index>(j)) =
          row[j].Number();
    }
  }
  const Eigen::MatrixXd& c = calibration->covariance;
  if (n > 0 && !((c - c.transpose()).cwiseAbs().maxCoeff() <= 1e-9 * c.cwiseAbs().maxCoeff())) {
    throw node.ErrorHere("a covariance must be symmetric");
  }
}

FocusPositions ReadFocusPositions(const YamlNode& node) {
  node.RequireKeys({"unit", "positions"});
  FocusPositions found;
  found.unit = node.At("unit").OneOf({"mm", kDioptreUnit, "steps"});
  for (const YamlNode& position : node.At("positions").Elements()) {
    const auto pair = position.ElementsExactly(2);
    found.positions.push_back({pair[0].Number(), pair[1].PositiveNumber()});
  }
  std::string why;
  if (!found.IsValid(&why)) throw node.ErrorHere(why);
  return found;
}

CameraCalibration ReadCalibration(const YamlNode& node) {
  node.RequireKeys({"image_distance_mm", "blur_ratio", "blur_floor_px", "bench_offset_mm",
                    "focus_positions", "covariance", "evidence"});
  CameraCalibration calibration;
  calibration.image_distance_mm = FindEstimate(node, "image_distance_mm", &YamlNode::Number);
  calibration.blur_ratio = FindEstimate(node, "blur_ratio", &YamlNode::NonNegativeNumber);
  calibration.blur_floor_px = FindEstimate(node, "blur_floor_px", &YamlNode::NonNegativeNumber);
  calibration.bench_offset_mm = FindEstimate(node, "bench_offset_mm", &YamlNode::Number);
  if (const auto positions = node.Find("focus_positions"))
    calibration.focus_positions = ReadFocusPositions(*positions);
  if (const auto covariance = node.Find("covariance")) ReadCovariance(*covariance, &calibration);
  calibration.evidence = ReadEvidence(node.At("evidence"));
  return calibration;
}

// `psf: measured` has its shape in `psf_file`, and in `psf_like` the one of the two shapes that
// stands for it in closed forms.
void ReadPsfOf(const YamlNode& root, Camera* camera) {
  const auto psf = root.Find("psf");
  const std::string shape =
      psf ? psf->OneOf({"gaussian", "disc", kMeasuredPsf}) : PsfName(Psf::kGaussian);
  const auto file = root.Find(kPsfFile), like = root.Find(kPsfLike);
  if (shape == kMeasuredPsf) {
    const YamlNode path = root.At(kPsfFile);
    MeasuredPsf measured = ReadPsf(path.ResolvePath(path.Text()));
    measured.file = path.Text();
    camera->measured_psf = std::make_shared<const MeasuredPsf>(std::move(measured));
    camera->psf =
        like && like->OneOf({"gaussian", "disc"}) == "gaussian" ? Psf::kGaussian : Psf::kDisc;
    return;
  }
  if (file || like) {
    throw(file ? *file : *like)
        .ErrorHere(fmt::format("psf is {}: this key is for psf: {}", shape, kMeasuredPsf));
  }
  camera->psf = shape == "disc" ? Psf::kDisc : Psf::kGaussian;
}

class CameraWriter {
 public:
  explicit CameraWriter(const Camera& camera) : camera_(camera) {}

  std::string Write() {
    out_.Text("name", camera_.name);
    // A reader of the file looks for the measured values first.
    if (camera_.calibration) WriteCalibration(*camera_.calibration);
    WriteLens();
    WriteSensor();
    WritePsf();
    return out_.Finish();
  }

 private:
  const Provenance* StatementOf(const std::string& field) const {
    const auto statement = camera_.statements.find(field);
    return statement == camera_.statements.end() ? nullptr : &statement->second;
  }

  // A measured PSF that has no file cannot be named; its shape is then the one that stands for it.
  void WritePsf() {
    if (camera_.measured_psf == nullptr || camera_.measured_psf->file.empty()) {
      out_.Text("psf", PsfName(camera_.psf));
      return;
    }
    out_.Text("psf", kMeasuredPsf);
    out_.Text(kPsfFile, camera_.measured_psf->file);
    out_.Text(kPsfLike, PsfName(camera_.psf));
  }

  // Writes the entries of the map {value: .., tolerance: .., assumed: ..} that is open, and ends
  // it.
  void FinishStated(double value, const Provenance& statement) {
    out_.Number("value", value);
    if (statement.tolerance != 0) out_.Number("tolerance", statement.tolerance);
    if (statement.assumed) out_.Text("assumed", "true");
    out_.EndMap();
  }

  void Stated(const std::string& section, const std::string& key, double value) {
    if (const Provenance* statement = StatementOf(section + key)) {
      out_.BeginMapInLine(key);
      FinishStated(value, *statement);
    } else {
      out_.Number(key, value);
    }
  }

  void StatedElement(const std::string& field, double value) {
    if (const Provenance* statement = StatementOf(field)) {
      out_.BeginMapInLine();
      FinishStated(value, *statement);
    } else {
      out_.Element(value);
    }
  }

  void WriteLens() {
    out_.BeginMap("lens");
    if (const auto& objective = camera_.objective) {
      Stated("lens.", "magnification", objective->magnification);
      Stated("lens.", "numerical_aperture", objective->numerical_aperture);
      Stated("lens.", "tube_lens_focal_length_mm", objective->tube_lens_focal_length_mm);
    } else {
      Stated("lens.", "front_focal_length_mm", camera_.lens.front_focal_length_mm);
      Stated("lens.", "rear_focal_length_mm", camera_.lens.rear_focal_length_mm);
      Stated("lens.", "lens_thickness_mm", camera_.lens.lens_thickness_mm);
      Stated("lens.", "aperture_radius_mm", camera_.lens.aperture_radius_mm);
    }
    if (camera_.aperture_behind_front_mm)
      Stated("lens.", kApertureBehindFront, *camera_.aperture_behind_front_mm);
    if (camera_.distortion) WriteDistortion(*camera_.distortion);
    out_.EndMap();
  }

  void Numbers(const char* key, const double* numbers, std::size_t count) {
    out_.BeginListInLine(key);
    for (std::size_t i = 0; i < count; ++i) out_.Element(numbers[i]);
    out_.EndList();
  }

  void WriteDistortion(const LensDistortion& distortion) {
    out_.BeginMap(kDistortion);
    out_.Text("model", DistortionModelName(distortion.model));
    out_.BeginListInLine("size_px");
    out_.Element(distortion.width_px);
    out_.Element(distortion.height_px);
    out_.EndList();
    Numbers("focal_length_px", distortion.focal_length_px.data(), 2);
    Numbers("principal_point_px", distortion.principal_point_px.data(), 2);
    Numbers("coefficients", distortion.coefficients.data(), distortion.coefficients.size());
    if (distortion.covariance.size() > 0) {
      out_.BeginMap("covariance");
      out_.List("order", distortion.CovarianceOrder());
      WriteRows(distortion.covariance);
      out_.EndMap();
    }
    out_.EndMap();
  }

  void WriteSensor() {
    const Sensor& sensor = camera_.sensor;
    out_.BeginMap("sensor");
    Stated("sensor.", "width_px", sensor.width_px);
    Stated("sensor.", "height_px", sensor.height_px);
    Stated("sensor.", "pixel_pitch_mm", sensor.pixel_pitch_mm);
    out_.BeginListInLine("principal_point_px");
    StatedElement("sensor.principal_point_px[0]", sensor.principal_point_px.x());
    StatedElement("sensor.principal_point_px[1]", sensor.principal_point_px.y());
    out_.EndList();
    WriteTransfer();
    out_.EndMap();
  }

  void WriteTransfer() {
    const std::string name = camera_.sensor.transfer.Name();
    const Provenance* statement = StatementOf("sensor.transfer");
    if (statement == nullptr || !statement->assumed) {
      out_.Text("transfer", name);
      return;
    }
    out_.BeginMapInLine("transfer");
    out_.Text("value", name);
    out_.Text("assumed", "true");
    out_.EndMap();
  }

  void MeasuredIfAny(const char* key, const std::optional<Estimate>& estimate) {
    if (estimate) out_.Measured(key, *estimate);
  }

  void WriteCalibration(const CameraCalibration& calibration) {
    out_.BeginMap("calibration");
    MeasuredIfAny("image_distance_mm", calibration.image_distance_mm);
    MeasuredIfAny("blur_ratio", calibration.blur_ratio);
    MeasuredIfAny("blur_floor_px", calibration.blur_floor_px);
    MeasuredIfAny("bench_offset_mm", calibration.bench_offset_mm);
    if (calibration.focus_positions) WriteFocusPositions(*calibration.focus_positions);
    if (!calibration.covariance_order.empty()) WriteCovariance(calibration);
    WriteEvidence(calibration.evidence);
    out_.EndMap();
  }

  // Each position is a pair: what the scale or the drive shows, and d1 there, mm.
  void WriteFocusPositions(const FocusPositions& found) {
    out_.BeginMap("focus_positions");
    out_.Text("unit", found.unit);
    out_.BeginList("positions");
    for (const FocusPositions::Position& position : found.positions) {
      out_.BeginListInLine();
      out_.Element(position.reading);
      out_.Element(position.image_distance_mm);
      out_.EndList();
    }
    out_.EndList();
    out_.EndMap();
  }

  void WriteCovariance(const CameraCalibration& calibration) {
    out_.BeginMap("covariance");
    out_.List("order", calibration.covariance_order);
    WriteRows(calibration.covariance);
    out_.EndMap();
  }

  void WriteRows(const Eigen::MatrixXd& matrix) {
    out_.BeginList("rows");
    for (Eigen::Index i = 0; i < matrix.rows(); ++i) {
      out_.BeginListInLine();
      for (Eigen::Index j = 0; j < matrix.cols(); ++j) out_.Element(matrix(i, j));
      out_.EndList();
    }
    out_.EndList();
  }

  void WriteEvidence(const Evidence& evidence) {
    out_.BeginMap("evidence");
    out_.Text("method", evidence.method);
    if (evidence.undistorted) out_.Text("undistorted", "true");
    out_.Text("frames_used", std::to_string(evidence.frames_used));
    out_.NumberIfAny("chi2_per_dof", evidence.chi2_per_dof);
    MeasuredIfAny("focus_depth_mm", evidence.focus_depth_mm);
    out_.TextIfAny("blur_family", evidence.blur_family);
    out_.NumberIfAny("blur_band", evidence.blur_band);
    out_.TextIfAny("data_sha256", evidence.data_sha256);
    out_.TextIfAny("version", evidence.version);
    out_.TextIfAny("date", evidence.date);
    if (!evidence.frames_rejected.empty()) {
      out_.BeginList("frames_rejected");
      for (const RejectedFrame& frame : evidence.frames_rejected) {
        out_.BeginMapInLine();
        out_.Text("image", frame.image);
        out_.Text("reason", frame.reason);
        out_.EndMap();
      }
      out_.EndList();
    }
    out_.EndMap();
  }

  const Camera& camera_;
  YamlWriter out_{kSchema};
};

}  // namespace

Camera ParseCamera(const std::string& text, const std::string& source_name) {
  const YamlNode root = YamlNode::Parse(text, source_name);
  const bool is_former = root.HasSchema(kFormerSchema);
  if (!is_former) root.RequireSchema(kSchema);
  root.RequireKeys(
      {"schema", "name", "lens", "sensor", "psf", "psf_file", "psf_like", "calibration"});
  Camera camera;
  camera.name = root.At("name").Text();
  ReadLens(root.At("lens"), &camera);
  ReadSensor(root.At("sensor"), &camera);
  ReadPsfOf(root, &camera);
  if (const auto calibration = root.Find("calibration"))
    camera.calibration = ReadCalibration(*calibration);
  // Each number was already checked at its place. The remaining check compares the image distance
  // with the lens, so that an error belongs to the calibration if there is one.
  std::string why;
  if (camera.distortion) {
    try {
      static_cast<void>(
          camera.distortion->ScaledTo(camera.sensor.width_px, camera.sensor.height_px));
    } catch (const Error& error) {
      throw root.At("lens").At(kDistortion).ErrorHere(std::string("for sensor: ") + error.what());
    }
  }
  if (!camera.IsValid(&why)) {
    const auto place = camera.calibration ? root.At("calibration").Find("image_distance_mm")
                                          : std::optional<YamlNode>();
    throw place.value_or(root).ErrorHere(why);
  }
  if (is_former) ConvertFormerBlurRatio(&camera);
  return camera;
}

Camera ReadCamera(const std::string& path) {
  Camera camera = ParseCamera(ReadTextFile(path), path);
  camera.source = path;
  return camera;
}

std::string CameraToYaml(const Camera& camera) { return CameraWriter(camera).Write(); }

Camera WithoutMeasuredPsf(Camera camera) {
  camera.measured_psf.reset();
  return camera;
}

}  // namespace thicklens::model
