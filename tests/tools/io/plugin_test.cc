// Libraries that the program loads, see tests/tools/faults/other_build.cc.
#include "tools/io/plugin.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>

#include "support/error_message.h"

namespace thicklens::io {
namespace {

using ::testing::AllOf;
using testing::ErrorOf;
using ::testing::HasSubstr;

std::string RefusalOfLibrary(const std::string& library) {
  return ErrorOf([&] {
    LoadPluginAt(library, {"thicklens_image_library.so", "ThicklensImageLibrary", "reads images"});
  });
}

TEST(Plugin, ALibraryOfAnotherBuildIsRefusedByName) {
  EXPECT_THAT(RefusalOfLibrary(THICKLENS_OTHER_BUILD),
              AllOf(HasSubstr(THICKLENS_OTHER_BUILD), HasSubstr("belongs to another build"),
                    HasSubstr("0.0.0-of-another-build"), HasSubstr("reads images")));
  EXPECT_THAT(RefusalOfLibrary(THICKLENS_OLD_BUILD),
              AllOf(HasSubstr(THICKLENS_OLD_BUILD), HasSubstr("belongs to another build"),
                    HasSubstr("none")));
}

TEST(Plugin, AMissingLibraryIsRefusedByName) {
  EXPECT_THAT(RefusalOfLibrary(""),
              AllOf(HasSubstr("thicklens_image_library.so"), HasSubstr("cannot be loaded")));
}

}  // namespace
}  // namespace thicklens::io
