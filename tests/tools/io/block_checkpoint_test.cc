// Blocks that one run stores and another one finds, and runs that continue after an interruption.
#include "thicklens/io/block_checkpoint.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <chrono>
#include <csignal>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "support/error_message.h"
#include "support/sanitizers.h"
#include "support/temporary_folder.h"
#include "thicklens/io/depth_io.h"
#include "thicklens/io/image_io.h"
#include "tools/support/child_process.h"

namespace thicklens::io {
namespace {

using tools::ChildProgram;
using tools::ProgramResult;
namespace fs = std::filesystem;
using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;
using thicklens::testing::ContentOf;
using thicklens::testing::ErrorOf;
using thicklens::testing::TemporaryFolder;
using Arguments = std::vector<std::string>;

constexpr char kVersion[] = "a version";

estimator::BlockRun SomeRun(const std::string& gamma, const std::vector<float>& image) {
  estimator::BlockRun run;
  run.settings = {{"block_px", "24"}, {"gamma", gamma}};
  run.data = {
      {"image", {{reinterpret_cast<const char*>(image.data()), image.size() * sizeof(float)}}}};
  run.blocks = 3;
  return run;
}

estimator::SolvedBlock SomeBlock() {
  estimator::SolvedBlock solved;
  solved.report = {24, 0, 1, 2, 4, 10, 0.25, 7, 1e-9};
  solved.channels = {{0.5, 1, -2, 0.1}, {0, 0, 3, 4}};
  return solved;
}

class BlockCheckpointTest : public ::testing::Test {
 protected:
  std::string Path() const { return folder_ / "blocks"; }
  TemporaryFolder folder_;
  const std::vector<float> image_ = {1, 2, 3};
};

TEST_F(BlockCheckpointTest, ABlockComesBackAsTheLightFieldHoldsIt) {
  estimator::SolvedBlock iterated = SomeBlock();
  iterated.report.rcond.reset();
  {
    BlockCheckpoint checkpoint(Path(), kVersion);
    EXPECT_FALSE(checkpoint.block_px());
    checkpoint.Begin(SomeRun("1", image_));
    checkpoint.Keep(2, SomeBlock());
    checkpoint.Keep(0, iterated);
    EXPECT_EQ(checkpoint.kept(), 2);
  }
  BlockCheckpoint checkpoint(Path(), kVersion);
  EXPECT_EQ(checkpoint.block_px(), 24);
  checkpoint.Begin(SomeRun("1", image_));
  EXPECT_EQ(checkpoint.kept(), 2);
  EXPECT_FALSE(checkpoint.Find(1));
  const auto found = checkpoint.Find(2);
  ASSERT_TRUE(found);
  const estimator::BlockReport& report = found->report;
  EXPECT_EQ(report.x, 24);
  EXPECT_EQ(report.y, 0);
  EXPECT_EQ(report.width_px, 1);
  EXPECT_EQ(report.height_px, 2);
  EXPECT_EQ(report.unknowns, 4);
  EXPECT_EQ(report.entries, 10);
  EXPECT_EQ(report.rcond, 0.25);
  EXPECT_EQ(report.iterations, 7);
  EXPECT_EQ(report.relative_residual, 1e-9);
  ASSERT_EQ(found->channels.size(), 2U);
  EXPECT_EQ(found->channels[0], (std::vector<double>{0.5, 1, -2, static_cast<double>(0.1F)}));
  EXPECT_EQ(found->channels[1], SomeBlock().channels[1]);
  ASSERT_TRUE(checkpoint.Find(0));
  EXPECT_FALSE(checkpoint.Find(0)->report.rcond);
}

TEST_F(BlockCheckpointTest, AnotherEstimateIsRecognisedByItsDifferences) {
  {
    BlockCheckpoint checkpoint(Path(), kVersion);
    checkpoint.Begin(SomeRun("1", image_));
    checkpoint.Keep(0, SomeBlock());
  }
  const std::string before = ContentOf(Path());
  const auto refusal = [&](const estimator::BlockRun& run) {
    BlockCheckpoint checkpoint(Path(), kVersion);
    const std::string message = ErrorOf([&] { checkpoint.Begin(run); });
    EXPECT_EQ(checkpoint.kept(), 0);
    EXPECT_THAT(message, HasSubstr(Path() + ": holds blocks of another estimate"));
    return message;
  };
  EXPECT_THAT(refusal(SomeRun("2", image_)), HasSubstr("gamma is 1 there and 2 here"));
  EXPECT_THAT(refusal(SomeRun("1", {1, 2, 3.0000002F})), HasSubstr("the image differs"));
  estimator::BlockRun more = SomeRun("1", image_);
  more.settings.insert(more.settings.begin() + 1, {"ridge", "3"});
  EXPECT_THAT(refusal(more), HasSubstr("it does not state 'ridge'"));
  more = SomeRun("1", image_);
  more.blocks = 4;
  EXPECT_THAT(refusal(more), HasSubstr("blocks is 3 there and 4 here"));
  EXPECT_EQ(ContentOf(Path()), before);
}

// A run that ended before its first block was there leaves nothing that binds the next one.
TEST_F(BlockCheckpointTest, WithoutABlockItHoldsNothing) {
  { BlockCheckpoint(Path(), kVersion).Begin(SomeRun("1", image_)); }
  EXPECT_FALSE(fs::exists(Path()));
  { JournalFile(Path(), "thicklens-blocks/1").Append({"[[\"gamma\",\"1\"]]"}); }
  {
    BlockCheckpoint checkpoint(Path(), kVersion);
    checkpoint.Begin(SomeRun("2", image_));
    checkpoint.Keep(0, SomeBlock());
  }
  BlockCheckpoint checkpoint(Path(), kVersion);
  checkpoint.Begin(SomeRun("2", image_));
  EXPECT_EQ(checkpoint.kept(), 1);
}

// Records with right hashes whose content is wrong, which only a person could write.
TEST_F(BlockCheckpointTest, RecordsThatAreNoBlocksAreNotFound) {
  {
    BlockCheckpoint checkpoint(Path(), kVersion);
    checkpoint.Begin(SomeRun("1", image_));
    checkpoint.Keep(1, SomeBlock());
  }
  const std::string whole = ContentOf(Path());
  const std::string right = JournalFile(Path(), "thicklens-blocks/1").Read(1);
  std::string huge = right;
  huge.replace(28, 4, "\xff\xff\xff\x7f");  // of channels
  std::string negative = right;
  negative.replace(0, 4, "\xff\xff\xff\xff");  // its number
  const std::vector<std::string> wrong = {
      "", right.substr(0, 63), right.substr(0, 64), right + "x", right + "four", huge, negative};
  for (std::size_t i = 0; i < wrong.size(); ++i) {
    SCOPED_TRACE(i);
    folder_.Put("blocks", whole);
    { JournalFile(Path(), "thicklens-blocks/1").Append({wrong[i]}); }
    BlockCheckpoint checkpoint(Path(), kVersion);
    checkpoint.Begin(SomeRun("1", image_));
    const bool has_its_number = i >= 1 && i <= 5 && wrong[i].size() >= 64;
    EXPECT_EQ(checkpoint.Find(1).has_value(), !has_its_number);
    EXPECT_FALSE(checkpoint.Find(0));
  }

  for (const std::string first : {"", "{}", "[[1, 2]]", "[[\"version\"", "\xff", "null"}) {
    SCOPED_TRACE(first);
    folder_.Put("other", "");
    {
      JournalFile journal(folder_ / "other", "thicklens-blocks/1");
      journal.Append({first});
      journal.Append({right});
    }
    BlockCheckpoint other(folder_ / "other", kVersion);
    EXPECT_FALSE(other.block_px());
    EXPECT_FALSE(other.device());
    EXPECT_THAT(ErrorOf([&] { other.Begin(SomeRun("1", image_)); }), HasSubstr("another estimate"));
  }
}

TEST_F(BlockCheckpointTest, TheDeviceToAskForIsThatOfTheRun) {
  const std::vector<std::pair<std::string, std::string>> cases = {
      {"cpu", "cpu"},
      {"opencl:0:1", "opencl:0:1"},
      {"opencl:0:1, opencl (a GPU)", "opencl:0:1"},
      {"cpu (opencl:0:0 has no double)", "none"}};
  for (const auto& [device, expected] : cases) {
    estimator::BlockRun run = SomeRun("1", image_);
    run.settings.emplace_back("device", device);
    folder_.Put("blocks", "");
    {
      BlockCheckpoint checkpoint(Path(), kVersion);
      checkpoint.Begin(run);
      checkpoint.Keep(0, SomeBlock());
    }
    EXPECT_EQ(BlockCheckpoint(Path(), kVersion).device().value_or("none"), expected);
  }
}

// ---- the program ----

class ResumedEstimate : public ::testing::Test {
 protected:
  static constexpr int kWidth = 120;
  static constexpr int kHeight = 96;

  ResumedEstimate() {
    model::EncodedImage image{kWidth, kHeight, 3, 8, {}};
    model::RawDepthMap depth{kWidth, kHeight, {}, false};
    for (int i = 0; i < kWidth * kHeight; ++i) {
      for (int c = 0; c < 3; ++c) {
        image.values.push_back(static_cast<std::uint16_t>((i * 37 + i / kWidth * 11 + c) % 251));
      }
      depth.values.push_back(static_cast<float>(i % kWidth) * 0.01F - 0.5F);
    }
    folder_.Put("picture.png", EncodePng(image));
    folder_.Put("depth.pfm", EncodePfm(depth));
  }

  Arguments Estimate(const std::string& output, const Arguments& more) const {
    Arguments all = {"estimate",
                     folder_ / "picture.png",
                     folder_ / "depth.pfm",
                     "--depth-kind",
                     "disparity",
                     "--views",
                     "5x5",
                     "--device",
                     "cpu",
                     "--threads",
                     "2",
                     "--solver",
                     "blocks",
                     "--format",
                     "tiff",
                     "-o",
                     folder_ / output};
    all.insert(all.end(), more.begin(), more.end());
    return all;
  }
  ProgramResult Run(const Arguments& arguments) const {
    return ChildProgram(arguments, scratch_.path(), 0).Wait();
  }
  std::string Checkpoint() const { return folder_ / "blocks"; }
  // Begins the estimate and ends it by a signal once a few blocks are there.
  ProgramResult StopHalfway(int signal, const Arguments& more) const {
    ChildProgram program(Estimate("lf", more), scratch_.path(), 0);
    std::error_code ignored;
    while (program.Running() &&
           (!fs::exists(Checkpoint()) || fs::file_size(Checkpoint(), ignored) < 500000)) {
      std::this_thread::sleep_for(std::chrono::milliseconds(1));
    }
    program.Send(SIGSTOP);
    EXPECT_TRUE(program.Running()) << "it was done before it could be stopped";
    program.Send(signal);
    program.Send(SIGCONT);
    return program.Wait();
  }
  void ExpectSameViews(const std::string& a, const std::string& b) const {
    int views = 0;
    for (const auto& entry : fs::directory_iterator(folder_ / a + "/views")) {
      const std::string name = "/views/" + entry.path().filename().string();
      EXPECT_EQ(ContentOf(folder_ / a + name), ContentOf(folder_ / b + name)) << name;
      ++views;
    }
    EXPECT_EQ(views, 25);
  }

  TemporaryFolder folder_, scratch_;
};

TEST_F(ResumedEstimate, GoesOnToTheSameBits) {
  ASSERT_EQ(Run(Estimate("whole", {})).exit_code, 0);
  for (const int signal : {SIGKILL, SIGINT}) {
    SCOPED_TRACE(signal);
    const ProgramResult stopped = StopHalfway(signal, {"--checkpoint", Checkpoint()});
    ASSERT_NE(stopped.exit_code, 0);
    ASSERT_TRUE(fs::exists(Checkpoint()));
    EXPECT_FALSE(fs::exists(folder_ / "lf"));
    if (signal == SIGINT) {
      EXPECT_THAT(stopped.err, AllOf(HasSubstr("are kept in " + Checkpoint()),
                                     HasSubstr("the same command continues from there")));
    }
    const std::string json = folder_ / "estimate.json";
    const ProgramResult resumed =
        Run(Estimate("lf", {"--checkpoint", Checkpoint(), "--json", json}));
    ASSERT_EQ(resumed.exit_code, 0) << resumed.err;
    const auto summary = nlohmann::json::parse(ContentOf(json));
    const int found = summary["blocks_from_checkpoint"].get<int>();
    EXPECT_GT(found, 0);
    EXPECT_LT(found, summary["blocks"].get<int>());
    EXPECT_THAT(resumed.out, HasSubstr("(" + std::to_string(found) + " from the checkpoint)"));
    EXPECT_FALSE(fs::exists(Checkpoint())) << "it has served";
    ExpectSameViews("whole", "lf");
    fs::remove_all(folder_ / "lf");
  }
}

TEST_F(ResumedEstimate, UnderAMemoryLimitItKeepsTheSizeOfTheBlocks) {
  if (thicklens::testing::kIsSanitized) GTEST_SKIP() << "the sanitizer needs memory of its own";
  const std::string json = folder_ / "estimate.json";
  const auto summary = [&](const Arguments& more) {
    Arguments arguments = Estimate("lf", more);
    arguments.insert(arguments.end(), {"--json", json});
    const ProgramResult result = Run(arguments);
    EXPECT_EQ(result.exit_code, 0) << result.err;
    return nlohmann::json::parse(ContentOf(json));
  };
  const auto least = summary({"--block-px", "8"});
  const int mebibytes = static_cast<int>(least["predicted_memory_mib"].get<double>()) + 40;
  fs::remove_all(folder_ / "lf");
  StopHalfway(SIGKILL, {"--checkpoint", Checkpoint(), "--memory-limit", std::to_string(mebibytes)});
  const std::optional<int> block_px = BlockCheckpoint(Checkpoint(), kVersion).block_px();
  ASSERT_TRUE(block_px);
  const Arguments more = {"--memory-limit", std::to_string(mebibytes + 300)};
  const auto anew = summary(more);
  ASSERT_GT(anew["block_px"].get<int>(), *block_px);
  Arguments resume = more;
  resume.insert(resume.end(), {"--checkpoint", Checkpoint()});
  const auto resumed = summary(resume);
  EXPECT_EQ(resumed["block_px"], *block_px);
  EXPECT_GT(resumed["blocks_from_checkpoint"].get<int>(), 0);
}

TEST_F(ResumedEstimate, GoesOnAfterAFullDisk) {
  constexpr long kBytes = 600000;
  const ProgramResult full =
      ChildProgram(Estimate("lf", {"--checkpoint", Checkpoint()}), scratch_.path(), kBytes).Wait();
  EXPECT_EQ(full.exit_code, 1);
  EXPECT_THAT(full.err, AllOf(HasSubstr("error: " + Checkpoint() + ": cannot be written"),
                              HasSubstr("are kept in " + Checkpoint())));
  const std::string json = folder_ / "estimate.json";
  const ProgramResult resumed = Run(Estimate("lf", {"--checkpoint", Checkpoint(), "--json", json}));
  ASSERT_EQ(resumed.exit_code, 0) << resumed.err;
  EXPECT_GT(nlohmann::json::parse(ContentOf(json))["blocks_from_checkpoint"].get<int>(), 0);
}

TEST_F(ResumedEstimate, RefusesWhatIsOfAnotherEstimateAndLeavesItAlone) {
  ASSERT_NE(StopHalfway(SIGKILL, {"--checkpoint", Checkpoint()}).exit_code, 0);
  const std::string before = ContentOf(Checkpoint());
  const ProgramResult other = Run(Estimate("lf", {"--checkpoint", Checkpoint(), "--gamma", "2"}));
  EXPECT_EQ(other.exit_code, 1);
  EXPECT_THAT(other.err,
              AllOf(HasSubstr("gamma is 1 there and 2 here"), Not(HasSubstr("the same command"))));
  EXPECT_EQ(ContentOf(Checkpoint()), before);
  EXPECT_FALSE(fs::exists(folder_ / "lf"));

  const ProgramResult scene =
      Run({"estimate", folder_ / "picture.png", folder_ / "depth.pfm", "--depth-kind", "disparity",
           "--checkpoint", Checkpoint(), "-o", folder_ / "lf"});
  EXPECT_EQ(scene.exit_code, 2);
  EXPECT_THAT(scene.err, HasSubstr("--checkpoint requires --solver blocks"));
  const ProgramResult none = Run(Estimate("lf", {"--checkpoint", ""}));
  EXPECT_EQ(none.exit_code, 2);
  EXPECT_THAT(none.err, HasSubstr("a file's name is expected"));
  const ProgramResult inside = Run(Estimate("lf", {"--checkpoint", folder_ / "lf/blocks"}));
  EXPECT_EQ(inside.exit_code, 2);
  EXPECT_THAT(inside.err, HasSubstr("lies in the light field's folder"));
  const ProgramResult image = Run(Estimate("lf", {"--checkpoint", folder_ / "picture.png"}));
  EXPECT_EQ(image.exit_code, 2) << image.err;
}

}  // namespace
}  // namespace thicklens::io
