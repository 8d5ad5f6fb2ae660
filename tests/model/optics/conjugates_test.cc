#include "thicklens/model/conjugates.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cctype>
#include <cmath>
#include <limits>
#include <string>

#include "support/error_message.h"
#include "support/matrix_lens.h"

namespace thicklens::model {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::StartsWith;
using ::thicklens::testing::ErrorOf;
using ::thicklens::testing::MatrixLens;
using ::thicklens::testing::MatrixLenses;

constexpr ConjugateKind kAllConjugates[] = {
    ConjugateKind::kFocusDepth, ConjugateKind::kImageDistance, ConjugateKind::kTubeLength,
    ConjugateKind::kMagnification};
// Planes of focus, in front focal lengths, from a microscope's to a photograph's.
constexpr double kFocusInFocalLengths[] = {1.02, 1.3, 2, 4.7, 20};
constexpr double kRimMm = 3.2;

ThickLens LensOfConjugates() { return {12.5, 12.8, 3.0, 4.46}; }

// The quantity of each kind for the lens and its plane of focus, from rays that are traced from
// surface to surface.
double TracedConjugate(const MatrixLens& lens, double focus_depth_mm, ConjugateKind kind) {
  const double image_distance_mm = lens.ConjugateMm(focus_depth_mm);
  switch (kind) {
    case ConjugateKind::kFocusDepth:
      return focus_depth_mm;
    case ConjugateKind::kImageDistance:
      return image_distance_mm;
    case ConjugateKind::kTubeLength:
      return lens.front_principal_mm() + image_distance_mm - lens.rear_focal_point_mm();
    case ConjugateKind::kMagnification:
      return -lens.Landing(1, focus_depth_mm, kRimMm, image_distance_mm);
  }
  return std::nan("");
}

class ConjugatesOfTracedLens : public ::testing::TestWithParam<MatrixLens> {};

INSTANTIATE_TEST_SUITE_P(Lenses, ConjugatesOfTracedLens, ::testing::ValuesIn(MatrixLenses()),
                         [](const ::testing::TestParamInfo<MatrixLens>& lens) {
                           std::string name = lens.param.name();
                           for (char& c : name) {
                             if (std::isalnum(static_cast<unsigned char>(c)) == 0) c = '_';
                           }
                           return name;
                         });

TEST_P(ConjugatesOfTracedLens, EachGivesThePlaneOfFocus) {
  const ThickLens lens = GetParam().AsThickLens(kRimMm);
  for (const double focus_in_f : kFocusInFocalLengths) {
    const double focus_depth_mm = focus_in_f * lens.front_focal_length_mm;
    for (const ConjugateKind kind : kAllConjugates) {
      SCOPED_TRACE(static_cast<int>(kind));
      const double traced = TracedConjugate(GetParam(), focus_depth_mm, kind);
      const Estimate found = FocusDepthOf(lens, {kind, {traced, 0}, "traced"});
      EXPECT_NEAR(found.value, focus_depth_mm, 1e-10 * focus_depth_mm);
      EXPECT_EQ(found.sigma, 0);
    }
  }
}

TEST_P(ConjugatesOfTracedLens, MagnificationIsThatOfTheTracedRay) {
  const ThickLens lens = GetParam().AsThickLens(kRimMm);
  for (const double focus_in_f : kFocusInFocalLengths) {
    const double focus_depth_mm = focus_in_f * lens.front_focal_length_mm;
    const double traced =
        TracedConjugate(GetParam(), focus_depth_mm, ConjugateKind::kMagnification);
    EXPECT_NEAR(MagnificationAtFocus(lens, focus_depth_mm), traced, 1e-10 * traced);
  }
}

TEST(Conjugates, AgreeWithTheFormulasOfTheLens) {
  const ThickLens lens = LensOfConjugates();
  for (const double focus_depth_mm : {13.0, 40.0, 640.0}) {
    const double d1_mm = ImageDistanceMm(lens, focus_depth_mm);
    const double m = -ChiefRayMagnification(lens, d1_mm, focus_depth_mm);
    const auto depth_mm = [&](ConjugateKind kind, double value) {
      return FocusDepthOf(lens, {kind, {value, 0}, ""}).value;
    };
    const double tolerance_mm = 1e-10 * focus_depth_mm;
    EXPECT_NEAR(depth_mm(ConjugateKind::kImageDistance, d1_mm), FocusDepthMm(lens, d1_mm),
                tolerance_mm);
    EXPECT_NEAR(depth_mm(ConjugateKind::kTubeLength, d1_mm - 3.0 - 12.8), focus_depth_mm,
                tolerance_mm);
    EXPECT_NEAR(depth_mm(ConjugateKind::kMagnification, m), focus_depth_mm, tolerance_mm);
    EXPECT_NEAR(MagnificationAtFocus(lens, focus_depth_mm), m, 1e-12 * m);
  }
}

TEST(Conjugates, SigmaIsThatOfTheValueTimesTheDerivative) {
  const ThickLens lens = LensOfConjugates();
  const struct {
    ConjugateKind kind;
    double value;
  } stated[] = {{ConjugateKind::kFocusDepth, 40},      {ConjugateKind::kImageDistance, 22},
                {ConjugateKind::kImageDistance, 15.9}, {ConjugateKind::kTubeLength, 5},
                {ConjugateKind::kTubeLength, 160},     {ConjugateKind::kMagnification, 0.1},
                {ConjugateKind::kMagnification, 10}};
  for (const auto& of : stated) {
    SCOPED_TRACE(of.value);
    const double sigma = 0.02, step = 1e-6 * of.value;
    const auto depth_mm = [&](double value) {
      return FocusDepthOf(lens, {of.kind, {value, sigma}, ""}).value;
    };
    const double slope = (depth_mm(of.value + step) - depth_mm(of.value - step)) / (2 * step);
    const Estimate found = FocusDepthOf(lens, {of.kind, {of.value, sigma}, ""});
    EXPECT_NEAR(found.sigma, std::abs(slope) * sigma, 1e-6 * found.sigma);
    EXPECT_GT(found.sigma, 0);
  }
}

TEST(Conjugates, ImpossibleValuesNameTheStatementAndTheLimit) {
  const ThickLens lens = LensOfConjugates();
  const auto error = [&](ConjugateKind kind, double value, double sigma = 0) {
    return ErrorOf([&] { FocusDepthOf(lens, {kind, {value, sigma}, "the.key"}); });
  };
  for (const double nearer_mm : {12.5, 3.0, -640.0}) {
    EXPECT_THAT(error(ConjugateKind::kFocusDepth, nearer_mm),
                AllOf(StartsWith("the.key is "),
                      HasSubstr("larger than the front focal length (12.5 mm)")));
  }
  EXPECT_EQ(error(ConjugateKind::kFocusDepth, 12.6), "(no error)");
  // At d1 = rho + f2 the focus is at infinity.
  EXPECT_THAT(error(ConjugateKind::kImageDistance, 15.7),
              AllOf(StartsWith("the.key is 15.7: "), HasSubstr("larger than 15.8 mm")));
  EXPECT_THAT(error(ConjugateKind::kImageDistance, 3 + 12.8), HasSubstr("a focus at infinity"));
  EXPECT_EQ(error(ConjugateKind::kImageDistance, 15.9), "(no error)");
  for (const double none : {0.0, -160.0}) {
    EXPECT_THAT(error(ConjugateKind::kTubeLength, none), HasSubstr("larger than 0 mm"));
    EXPECT_THAT(error(ConjugateKind::kMagnification, none),
                AllOf(StartsWith("the.key is "), HasSubstr("must be > 0")));
  }
  const double nan = std::nan(""), infinity = std::numeric_limits<double>::infinity();
  for (const ConjugateKind kind : kAllConjugates) {
    for (const double wrong : {nan, infinity}) {
      EXPECT_THAT(error(kind, wrong), HasSubstr("must be finite"));
      EXPECT_THAT(error(kind, 40, wrong), HasSubstr("a standard deviation >= 0"));
    }
    EXPECT_THAT(error(kind, 40, -1), HasSubstr("a standard deviation >= 0"));
  }
  EXPECT_THAT(error(static_cast<ConjugateKind>(9), 40), HasSubstr("not known"));
}

TEST(Conjugates, NothingNearerThanTheFocalPointHasAMagnification) {
  const ThickLens lens = LensOfConjugates();
  for (const double nearer_mm : {12.5, 2.0, -40.0, std::nan("")}) {
    EXPECT_THAT(ErrorOf([&] { MagnificationAtFocus(lens, nearer_mm); }),
                HasSubstr("larger than the front focal length (12.5)"));
  }
}

}  // namespace
}  // namespace thicklens::model
