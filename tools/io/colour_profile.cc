// ICC profiles, by Little CMS.
#include "tools/io/colour_profile.h"

#include <fmt/format.h>
#include <lcms2.h>

#include <cmath>
#include <memory>
#include <opencv2/core.hpp>
#include <string>
#include <type_traits>
#include <vector>

#include "thicklens/base/cancel.h"
#include "thicklens/base/error.h"
#include "thicklens/base/printable_text.h"
#include "thicklens/model/transfer_curve.h"

namespace thicklens::io {
namespace {

using Context = std::unique_ptr<std::remove_pointer_t<cmsContext>, void (*)(cmsContext)>;
using Profile = std::unique_ptr<void, cmsBool (*)(cmsHPROFILE)>;
using Transform = std::unique_ptr<void, void (*)(cmsHTRANSFORM)>;

// Each call has a context of its own: threads share nothing.
Context NewContext() { return {cmsCreateContext(nullptr, nullptr), cmsDeleteContext}; }

Profile Opened(const Context& context, const std::string& bytes) {
  return {cmsOpenProfileFromMemTHR(context.get(), bytes.data(),
                                   static_cast<cmsUInt32Number>(bytes.size())),
          cmsCloseProfile};
}

bool HasColours(const ImageFacts& facts) { return facts.channels.size() >= 3; }

// Whether the profile is for images with these channels.
bool IsFor(const ImageFacts& facts, cmsHPROFILE profile) {
  const cmsColorSpaceSignature space = cmsGetColorSpace(profile);
  return space == (HasColours(facts) ? cmsSigRgbData : cmsSigGrayData);
}

// The curves from values to light: of red, green and blue, or of grey. Empty: the profile has
// tables of colours instead.
std::vector<const cmsToneCurve*> CurvesOf(const ImageFacts& facts, cmsHPROFILE profile) {
  if (HasColours(facts) && cmsIsMatrixShaper(profile) == 0) return {};
  std::vector<cmsTagSignature> tags = {cmsSigGrayTRCTag};
  if (HasColours(facts)) tags = {cmsSigRedTRCTag, cmsSigGreenTRCTag, cmsSigBlueTRCTag};
  std::vector<const cmsToneCurve*> curves;
  for (const cmsTagSignature tag : tags) {
    const auto* curve = static_cast<const cmsToneCurve*>(cmsReadTag(profile, tag));
    if (curve == nullptr) return {};
    curves.push_back(curve);
  }
  return curves;
}

// Whether the curves and `transfer` differ by less than half a level of 8 bits, in encoded values.
// The darkest levels are left out: there, the tables of profiles are coarse.
bool Agree(const std::vector<const cmsToneCurve*>& curves, const model::TransferCurve& transfer) {
  constexpr int kLevels = 255, kDarkest = 8;
  constexpr double kHalfLevel = 0.5 / kLevels;
  for (const cmsToneCurve* curve : curves) {
    for (int level = kDarkest; level <= kLevels; ++level) {
      const double value = static_cast<double>(level) / kLevels;
      const double light = cmsEvalToneCurveFloat(curve, static_cast<cmsFloat32Number>(value));
      if (!(std::abs(transfer.Encode(light) - value) < kHalfLevel)) return false;
    }
  }
  return true;
}

// The exponent of the curve at middle values.
double ExponentOf(const cmsToneCurve* curve) {
  constexpr float kMiddle = 0.5F;
  return std::log(static_cast<double>(cmsEvalToneCurveFloat(curve, kMiddle))) / std::log(0.5);
}

}  // namespace

void TakeProfileTransfer(ImageFacts* facts) {
  if (facts->icc_profile.empty()) return;
  const Context context = NewContext();
  const Profile profile = Opened(context, facts->icc_profile);
  if (profile == nullptr || !IsFor(*facts, profile.get())) {
    facts->notes.emplace_back(
        profile == nullptr
            ? "Its colour profile is damaged and is not used."
            : "Its colour profile is for other channels than it has, and is not used.");
    return;
  }
  facts->transfer = StatedTransfer::kAbsent;
  const std::vector<const cmsToneCurve*> curves = CurvesOf(*facts, profile.get());
  if (curves.empty()) return;
  if (Agree(curves, model::TransferCurve::Srgb())) {
    facts->transfer = StatedTransfer::kSrgb;
  } else if (Agree(curves, model::TransferCurve::Linear())) {
    facts->transfer = StatedTransfer::kLinear;
  } else if (const double gamma = ExponentOf(curves.front());
             gamma > 0.1 && gamma < 10 && Agree(curves, model::TransferCurve::Gamma(gamma))) {
    facts->transfer = StatedTransfer::kGamma;
    facts->gamma = gamma;
  }
}

void ConvertFromProfile(ImageFacts* facts, cv::Mat* photograph) {
  if (facts->icc_profile.empty() || facts->transfer != StatedTransfer::kAbsent) return;
  const Context context = NewContext();
  const Profile profile = Opened(context, facts->icc_profile);
  if (profile == nullptr || !IsFor(*facts, profile.get())) return;
  const Profile srgb(cmsCreate_sRGBProfileTHR(context.get()), cmsCloseProfile);
  cv::Mat wide = *photograph;
  if (wide.depth() == CV_8U) wide.convertTo(wide, CV_16U, 257);
  const int channels = wide.channels();
  const bool is_grey = channels <= 2;
  const cmsUInt32Number from = is_grey ? TYPE_GRAY_16 : channels == 4 ? TYPE_RGBA_16 : TYPE_RGB_16;
  const cmsUInt32Number to = channels == 4 ? TYPE_RGBA_16 : TYPE_RGB_16;
  const Transform transform(
      cmsCreateTransformTHR(context.get(), profile.get(), from, srgb.get(), to,
                            INTENT_RELATIVE_COLORIMETRIC, cmsFLAGS_NOCACHE | cmsFLAGS_COPY_ALPHA),
      cmsDeleteTransform);
  if (transform == nullptr) {
    throw Error(fmt::format("its colour profile '{}' cannot be used: convert the image to sRGB",
                            PrintableUtf8(facts->icc_description)));
  }
  cv::Mat converted(wide.size(), CV_MAKETYPE(CV_16U, channels == 4 ? 4 : 3));
  for (int y = 0; y < wide.rows; ++y) {
    ThrowIfCancelled();
    cmsDoTransform(transform.get(), wide.ptr(y), converted.ptr(y),
                   static_cast<cmsUInt32Number>(wide.cols));
  }
  if (is_grey) cv::extractChannel(converted, converted, 1);  // all three are equal
  *photograph = converted;
  facts->transfer = StatedTransfer::kSrgb;
  facts->notes.push_back(
      fmt::format("Its colour profile '{}' has no curve that fits all its values: the image was "
                  "converted to sRGB of 16 bits.",
                  facts->icc_description.empty() ? "without a name" : facts->icc_description));
  facts->icc_profile.clear();
}

}  // namespace thicklens::io
