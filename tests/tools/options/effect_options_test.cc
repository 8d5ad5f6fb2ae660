#include "tools/options/effect_options.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>

#include "tools/options/option_values.h"

namespace thicklens::tools {
namespace {

TEST(EffectOptions, AreHandedToTheInterface) {
  EffectOptions options;
  EXPECT_EQ(EffectSelectionOf(options).base, EffectSelection::Base::kAuto);
  EXPECT_FALSE(EffectSelectionOf(options).tolerance);
  options.effects = "defocus,falloff";
  options.without = "falloff";
  const EffectSelection given = EffectSelectionOf(options);
  EXPECT_EQ(given.base, EffectSelection::Base::kGiven);
  EXPECT_EQ(given.given, (EffectSet{Effect::kDefocus, Effect::kFalloff}));
  EXPECT_EQ(given.without, EffectSet{Effect::kFalloff});
  options.effects = "nonsense";
  EXPECT_THROW(EffectSelectionOf(options), UsageError);
}

// The interface refuses a tolerance where it has no effect, but the command line accepts it.
TEST(EffectOptions, AToleranceIsHandedOnAndRefusedWithoutAuto) {
  EffectOptions options;
  options.tolerance = "0.25gl";
  ASSERT_TRUE(EffectSelectionOf(options).tolerance);
  EXPECT_EQ(EffectSelectionOf(options).tolerance->grey_levels, 0.25);
  EXPECT_TRUE(EffectSelectionOf(options).IsValid(nullptr));
  options.effects = "all";
  std::string why;
  EXPECT_FALSE(EffectSelectionOf(options).IsValid(&why));
  EXPECT_THAT(why, ::testing::HasSubstr("tolerance"));
}

}  // namespace
}  // namespace thicklens::tools
