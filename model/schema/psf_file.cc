#include "thicklens/model/psf_file.h"

#include <fmt/format.h>

#include <vector>

#include "model/schema/yaml_writer.h"
#include "thicklens/base/cancel.h"
#include "thicklens/base/input_file.h"
#include "thicklens/base/yaml_reader.h"

namespace thicklens::model {
namespace {

constexpr char kPsfSchema[] = "thicklens/psf/1";
constexpr std::size_t kMaxRows = 255;

Eigen::ArrayXXd ReadRows(const YamlNode& node) {
  const std::vector<YamlNode> rows = node.Elements();
  if (rows.empty() || rows.size() > kMaxRows) {
    throw node.ErrorHere(fmt::format("found {} rows: an odd number from 3 to {} is expected",
                                     rows.size(), kMaxRows));
  }
  const auto side = static_cast<Eigen::Index>(rows.size());
  Eigen::ArrayXXd values(side, side);
  for (Eigen::Index j = 0; j < side; ++j) {
    ThrowIfCancelled();
    const YamlNode& row = rows[static_cast<std::size_t>(j)];
    const std::vector<YamlNode> numbers = row.Elements();
    if (numbers.size() != rows.size()) {
      throw row.ErrorHere(fmt::format("found {} numbers in a row of {} rows: it must be square",
                                      numbers.size(), rows.size()));
    }
    for (Eigen::Index i = 0; i < side; ++i)
      values(j, i) = numbers[static_cast<std::size_t>(i)].NonNegativeNumber();
  }
  return values;
}

void WriteRows(const std::string& key, const Eigen::ArrayXXd& values, YamlWriter* out) {
  out->BeginList(key);
  for (Eigen::Index j = 0; j < values.rows(); ++j) {
    out->BeginListInLine();
    for (Eigen::Index i = 0; i < values.cols(); ++i) out->Element(values(j, i));
    out->EndList();
  }
  out->EndList();
}

}  // namespace

MeasuredPsf ParsePsf(const std::string& text, const std::string& source_name) {
  const YamlNode root = YamlNode::Parse(text, source_name);
  root.RequireSchema(kPsfSchema);
  root.RequireKeys({"schema", "step", "blur_ratio", "light", "sigma"});
  MeasuredPsf psf;
  psf.step = root.At("step").PositiveNumber();
  const YamlNode light = root.At("light");
  psf.light = ReadRows(light);
  if (const auto sigma = root.Find("sigma")) psf.sigma = ReadRows(*sigma);
  if (!(psf.light.sum() > 0)) throw light.ErrorHere("all shares are 0: a sum > 0 is expected");
  psf = Normalised(std::move(psf));
  std::string why;
  if (!psf.IsValid(&why)) throw light.ErrorHere(why);
  return psf;
}

MeasuredPsf ReadPsf(const std::string& path) { return ParsePsf(ReadTextFile(path), path); }

std::string PsfToYaml(const MeasuredPsf& psf) {
  YamlWriter out(kPsfSchema);
  out.Number("step", psf.step);
  // For the reader: it follows from the light.
  out.Number("blur_ratio", psf.BlurRatio());
  WriteRows("light", psf.light, &out);
  if (psf.sigma.size() > 0) WriteRows("sigma", psf.sigma, &out);
  return out.Finish();
}

}  // namespace thicklens::model
