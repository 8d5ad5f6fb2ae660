#include "tools/options/effect_options.h"

#include <gtest/gtest.h>

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
TEST(EffectOptions, AToleranceIsForAutoOnly) {
  EffectOptions options;
  options.tolerance = "0.25gl";
  ASSERT_TRUE(EffectSelectionOf(options).tolerance);
  EXPECT_EQ(EffectSelectionOf(options).tolerance->grey_levels, 0.25);
  options.effects = "all";
  EXPECT_FALSE(EffectSelectionOf(options).tolerance);
  EXPECT_TRUE(EffectSelectionOf(options).IsValid(nullptr));
}

}  // namespace
}  // namespace thicklens::tools
