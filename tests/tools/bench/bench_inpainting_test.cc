// thicklens bench inpainting.
#include <gtest/gtest.h>

#include <cstddef>
#include <fstream>
#include <nlohmann/json.hpp>
#include <string>

#include "support/temporary_folder.h"
#include "tools/support/child_process.h"

namespace thicklens::tools {
namespace {

using ::thicklens::testing::TemporaryFolder;

TEST(BenchInpaintingTest, JudgesAroundOcclusions) {
  const TemporaryFolder folder;
  const std::string file = folder / "rows.json";
  const ProgramResult result = ChildProgram({"bench", "inpainting", "--size-px", "96", "--views",
                                             "3", "--repeat", "1", "--json", file},
                                            folder.path(), 0)
                                   .Wait();
  ASSERT_EQ(result.exit_code, 0) << result.err;
  std::ifstream stream(file);
  const nlohmann::json rows = nlohmann::json::parse(stream)["rows"];
  ASSERT_EQ(rows.size(), 6U);
  for (std::size_t i = 0; i < rows.size(); i += 2) {
    const nlohmann::json &own = rows[i], &telea = rows[i + 1];
    SCOPED_TRACE(own.dump() + telea.dump());
    EXPECT_EQ(own["solver"], telea["solver"]);
    EXPECT_EQ(own["fill"], "solver");
    EXPECT_EQ(telea["fill"], "telea");
    EXPECT_GT(telea["fill_seconds"].get<double>(), 0);
    // Hidden pixels have larger errors than those around them, and these have larger errors than
    // the whole.
    EXPECT_LT(own["psnr_occluded_db"].get<double>(), own["psnr_band_db"].get<double>());
    EXPECT_LT(own["psnr_band_db"].get<double>(), own["psnr_true_views_db"].get<double>());
    // Nothing else changed.
    EXPECT_NE(telea["psnr_occluded_db"], own["psnr_occluded_db"]);
    EXPECT_GT(telea["psnr_occluded_db"].get<double>(), 8);
  }
}

}  // namespace
}  // namespace thicklens::tools
