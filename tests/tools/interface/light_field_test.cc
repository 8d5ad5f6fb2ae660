#include "thicklens/light_field.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "support/error_message.h"
#include "support/temporary_folder.h"
#include "thicklens/calibrate.h"
#include "thicklens/estimate.h"
#include "thicklens/simulate.h"

namespace thicklens {
namespace {

using testing::ErrorOf;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::StartsWith;
using testing::TemporaryFolder;

// 3 x 2 views of 5 x 4 px, whose values all differ.
LightField CountedField(int channels = 1) {
  LightField field = model::MakeLightField(5, 4, 3, 2, channels);
  for (std::size_t i = 0; i < field.values.size(); ++i) {
    field.values[i] = static_cast<float>(i) / 1000.0F;
  }
  return field;
}

LightFieldEstimate CountedEstimate() {
  LightFieldEstimate estimate;
  estimate.light_field = CountedField();
  for (std::size_t i = 0; i < estimate.light_field.values.size(); ++i) {
    estimate.confidence.push_back(static_cast<std::uint8_t>(255 - i));
  }
  return estimate;
}

TEST(LightFieldInterfaceTest, AViewIsTakenFromAValidLightFieldOnly) {
  LightField field = CountedField();
  EXPECT_EQ(ViewOf(field, 2, 1).light().values[0], field.values[field.ViewStart(0, 2, 1)]);
  field.values.clear();
  EXPECT_THAT(ErrorOf([&] { ViewOf(field, 0, 0); }), StartsWith("light field: values: 0 values"));
  EXPECT_THAT(ErrorOf([&] { ViewOf(field, 6, 6); }), StartsWith("light field: values: 0 values"));
  field.source = "fields/window";
  EXPECT_THAT(ErrorOf([&] { ViewOf(field, 0, 0); }), StartsWith("fields/window: values"));
  EXPECT_THAT(ErrorOf([] { ViewOf(CountedField(), 6, 6); }), HasSubstr("does not exist"));
}

TEST(LightFieldInterfaceTest, AMissingViewIsNoBlackImage) {
  LightField field = CountedField();
  field.present = {true, true, true, true, false, true};
  EXPECT_EQ(ErrorOf([&] { ViewOf(field, 1, 1); }), "view (1, 1) is missing");
  EXPECT_EQ(ViewOf(field, 1, 0).width_px(), 5);
}

TEST(LightFieldInterfaceTest, AViewIsGreyOrRgb) {
  EXPECT_EQ(ViewOf(CountedField(3), 0, 0).order(), ChannelOrder::kRgb);
  EXPECT_THAT(ErrorOf([] { ViewOf(CountedField(2), 0, 0); }), HasSubstr("found 2"));
}

TEST(LightFieldInterfaceTest, NothingIsWrittenOfALightFieldThatIsNotValid) {
  const TemporaryFolder folder;
  LightField field = CountedField();
  field.values.pop_back();
  EXPECT_THAT(ErrorOf([&] { WriteLightField(folder / "lf", field); }), HasSubstr("119 values"));
  OutputFolder claimed = ClaimLightFieldFolder(folder / "claimed");
  EXPECT_THAT(ErrorOf([&] { WriteLightField(&claimed, field); }), HasSubstr("119 values"));
  LightFieldEstimate estimate = CountedEstimate();
  estimate.light_field = field;
  EXPECT_THAT(ErrorOf([&] { WriteLightField(folder / "lf", estimate); }), HasSubstr("119 values"));
}

TEST(LightFieldInterfaceTest, TheConfidenceHasOneByteForEachRay) {
  const TemporaryFolder folder;
  for (const std::size_t size : {std::size_t{1}, std::size_t{119}, std::size_t{121}}) {
    LightFieldEstimate estimate = CountedEstimate();
    estimate.confidence.resize(size);
    for (const LightFieldFormat format :
         {LightFieldFormat::kPng, LightFieldFormat::kTiff, LightFieldFormat::kHci}) {
      EXPECT_THAT(ErrorOf([&] { WriteLightField(folder / "lf", estimate, format); }),
                  StartsWith("confidence: 120 bytes are expected"));
    }
  }
  EXPECT_THAT(folder.Entries(), IsEmpty());
}

TEST(LightFieldInterfaceTest, WritingChecksThreadsAndFormat) {
  const TemporaryFolder folder;
  const LightField field = CountedField();
  const LightFieldEstimate estimate = CountedEstimate();
  OutputFolder claimed = ClaimLightFieldFolder(folder / "claimed");
  RunControl run;
  run.threads = -1;
  constexpr auto kPng = LightFieldFormat::kPng;
  EXPECT_THAT(ErrorOf([&] { WriteLightField(folder / "lf", field, kPng, run); }),
              StartsWith("threads: "));
  EXPECT_THAT(ErrorOf([&] { WriteLightField(&claimed, field, kPng, run); }),
              StartsWith("threads: "));
  EXPECT_THAT(ErrorOf([&] { WriteLightField(folder / "lf", estimate, kPng, run); }),
              StartsWith("threads: "));
  const auto unknown = static_cast<LightFieldFormat>(9);
  const std::string refusal = "format: an enumerator is expected, found 9";
  EXPECT_EQ(ErrorOf([&] { ClaimLightFieldFolder(folder / "lf", unknown); }), refusal);
  EXPECT_EQ(ErrorOf([&] { WriteLightField(folder / "lf", field, unknown); }), refusal);
  EXPECT_EQ(ErrorOf([&] { WriteLightField(&claimed, field, unknown); }), refusal);
  EXPECT_EQ(ErrorOf([&] { WriteLightField(folder / "lf", estimate, unknown); }), refusal);
}

TEST(LightFieldInterfaceTest, NullIsAnError) {
  EXPECT_THAT(ErrorOf([] { WriteLightField(static_cast<OutputFolder*>(nullptr), CountedField()); }),
              HasSubstr("found null"));
  EXPECT_THAT(
      ErrorOf([] { SimulateSweep(SweepSimulation(), static_cast<OutputFolder*>(nullptr)); }),
      HasSubstr("found null"));
  EXPECT_THAT(ErrorOf([] { CalibrationRefused refused(nullptr); }), HasSubstr("found null"));
}

TEST(LightFieldInterfaceTest, TheConfidenceIsReadAsItWasWritten) {
  const TemporaryFolder folder;
  const LightFieldEstimate estimate = CountedEstimate();
  WriteLightField(folder / "png", estimate);
  EXPECT_EQ(ReadConfidence(folder / "png"), estimate.confidence);
  RunControl run;
  run.threads = 1;
  WriteLightField(folder / "tiff", estimate, LightFieldFormat::kTiff);
  EXPECT_EQ(ReadConfidence(folder / "tiff", run), estimate.confidence);
  WriteLightField(folder / "hci", estimate, LightFieldFormat::kHci);
  EXPECT_THAT(ReadConfidence(folder / "hci"), IsEmpty());
  WriteLightField(folder / "without", estimate.light_field);
  EXPECT_THAT(ReadConfidence(folder / "without"), IsEmpty());
}

TEST(LightFieldInterfaceTest, AMissingViewNeedsNoConfidence) {
  const TemporaryFolder folder;
  LightFieldEstimate estimate = CountedEstimate();
  estimate.light_field.present = {true, true, true, true, false, true};
  WriteLightField(folder / "lf", estimate);
  EXPECT_EQ(ReadConfidence(folder / "lf"), estimate.confidence);
  std::filesystem::remove(folder / "lf/confidence/view_01_01.png");
  std::vector<std::uint8_t> expected = estimate.confidence;
  std::fill_n(expected.begin() + 4 * 20, 20, std::uint8_t{0});
  EXPECT_EQ(ReadConfidence(folder / "lf"), expected);
}

TEST(LightFieldInterfaceTest, AWrongFileOfConfidenceIsNamed) {
  const TemporaryFolder folder;
  WriteLightField(folder / "lf", CountedEstimate());
  const std::string path = folder / "lf/confidence/view_01_02.png";
  const auto refusal = [&] { return ErrorOf([&] { ReadConfidence(folder / "lf"); }); };
  WriteImage(path,
             Image::FromEncoded(5, 3, ChannelOrder::kGrey, 8, std::vector<std::uint16_t>(15)));
  EXPECT_EQ(refusal(), path + ": it has 5x3 px, the views 5x4: they must be equal");
  WriteImage(path,
             Image::FromEncoded(5, 4, ChannelOrder::kGrey, 16, std::vector<std::uint16_t>(20)));
  EXPECT_EQ(refusal(),
            path + ": a grey image of 8 bits is expected, found 1 channel(s) of 16 bits");
  WriteImage(path, Image::FromEncoded(5, 4, ChannelOrder::kRgb, 8, std::vector<std::uint16_t>(60)));
  EXPECT_EQ(refusal(), path + ": a grey image of 8 bits is expected, found 3 channel(s) of 8 bits");
  std::filesystem::remove(path);
  EXPECT_THAT(refusal(), StartsWith(path + ": "));
  EXPECT_THAT(ErrorOf([&] { ReadConfidence(folder / "none"); }),
              StartsWith(folder / "none: does not exist"));
  RunControl run;
  run.threads = -1;
  EXPECT_THAT(ErrorOf([&] { ReadConfidence(folder / "lf", run); }), StartsWith("threads: "));
}

}  // namespace
}  // namespace thicklens
