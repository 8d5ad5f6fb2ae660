// thicklens render as a user runs it.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <csignal>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <random>
#include <sstream>
#include <string>
#include <thread>
#include <vector>

#include "support/part_of.h"
#include "support/temporary_folder.h"
#include "support/test_cameras.h"
#include "thicklens/base/output_file.h"
#include "thicklens/io/image_description.h"
#include "thicklens/io/image_io.h"
#include "thicklens/io/light_field_io.h"
#include "thicklens/model/light_field.h"
#include "tools/support/child_process.h"

namespace thicklens::tools {
namespace {

namespace fs = std::filesystem;
using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using thicklens::testing::CentredSensor;
using thicklens::testing::ContentOf;
using thicklens::testing::TemporaryFolder;
using thicklens::testing::TestCamera;
using thicklens::testing::WideLens;
using thicklens::testing::WithMethod;
using Arguments = std::vector<std::string>;

constexpr int kRenderedS = 40, kRenderedT = 30;

// A wide-angle camera, so that fall-off shows.
model::Camera WideCamera() {
  return WithMethod(
      TestCamera("wide", WideLens(), CentredSensor(kRenderedS, kRenderedT, 0.3), {15.94, 0}));
}

model::LightField AtRandom(int u_count, int v_count, unsigned seed) {
  model::LightField light_field =
      model::MakeLightField(kRenderedS, kRenderedT, u_count, v_count, 3);
  std::mt19937 generator(seed);
  std::uniform_real_distribution<float> any(0, 1);
  for (float& value : light_field.values) value = any(generator);
  return light_field;
}

class RenderTest : public ::testing::Test {
 protected:
  std::string Write(const std::string& name, const model::LightField& light_field) const {
    OutputFolder folder(folder_ / name, io::kLightFieldMarker, io::LightFieldEntries());
    io::WriteLightField(light_field, io::ViewFormat::kTiff, &folder);
    folder.Commit();
    return folder_ / name;
  }
  ProgramResult Run(Arguments arguments, long max_file_bytes = 0) const {
    arguments.insert(arguments.begin(), "render");
    return ChildProgram(arguments, scratch_.path(), max_file_bytes).Wait();
  }
  // Renders with the C++ reference, whose results are the same everywhere.
  model::EncodedImage Rendered(Arguments arguments) const {
    const std::string out = folder_ / "rendered.png";
    arguments.insert(arguments.end(), {"--device", "cpu", "-o", out});
    const ProgramResult result = Run(arguments);
    EXPECT_EQ(result.exit_code, 0) << result.err;
    return result.exit_code == 0 ? io::ToEncodedImage(io::ReadImageFile(out))
                                 : model::EncodedImage{};
  }
  // Returns the error of a command that must fail and write nothing; what was read may be reported
  // before it.
  std::string Failure(Arguments arguments, int exit_code = 1) const {
    const std::string older = "older content\n";
    const std::string out = folder_.Put("out/picture.png", older);
    arguments.insert(arguments.end(), {"--device", "cpu", "-o", out});
    const ProgramResult result = Run(arguments);
    EXPECT_EQ(result.exit_code, exit_code) << result.err;
    const std::size_t at = result.err.find("thicklens: error: ");
    EXPECT_NE(at, std::string::npos) << result.err;
    const std::string error = result.err.substr(std::min(at, result.err.size()));
    EXPECT_EQ(std::count(error.begin(), error.end(), '\n'), 1) << result.err;
    EXPECT_THAT(result.out, IsEmpty());
    EXPECT_EQ(ContentOf(out), older);
    EXPECT_EQ(std::distance(fs::directory_iterator(folder_ / "out"), fs::directory_iterator()), 1);
    return error;
  }

  TemporaryFolder folder_;
  TemporaryFolder scratch_;
};

// The plain formula: the weighted mean of the views in linear light, stored and rounded.
model::EncodedImage MeanOfViews(const model::LightField& light_field,
                                const Eigen::ArrayXXd& weights, int bits) {
  model::EncodedImage stored{kRenderedS, kRenderedT, 3, bits, {}};
  for (std::size_t pixel = 0; pixel < light_field.view_size(); ++pixel) {
    for (int channel = 0; channel < 3; ++channel) {
      double light = 0;
      for (int l = 0; l < light_field.v_count; ++l) {
        for (int k = 0; k < light_field.u_count; ++k)
          light += weights(l, k) * light_field.values[light_field.ViewStart(channel, k, l) + pixel];
      }
      const double level = light_field.transfer.Encode(light) * stored.full_scale();
      stored.values.push_back(static_cast<std::uint16_t>(std::lround(level)));
    }
  }
  return stored;
}

int LargestDifference(const model::EncodedImage& a, const model::EncodedImage& b) {
  EXPECT_EQ(a.values.size(), b.values.size());
  EXPECT_EQ(a.width_px, b.width_px);
  EXPECT_EQ(a.bits, b.bits);
  int largest = 0;
  for (std::size_t i = 0; i < std::min(a.values.size(), b.values.size()); ++i)
    largest = std::max(largest, std::abs(a.values[i] - b.values[i]));
  return largest;
}

TEST_F(RenderTest, ThePhotographIsTheWeightedMeanInLinearLight) {
  model::LightField light_field = AtRandom(3, 5, 1);
  light_field.weights = model::ApertureWeights(model::ApertureShape::kGaussian, 3, 5);
  const std::string folder = Write("lf", light_field);
  const auto mean = [&](model::ApertureShape shape, int bits) {
    return MeanOfViews(light_field, model::ApertureWeights(shape, 3, 5), bits);
  };
  // Rounding in float may go the other way where a value is half-way between two levels.
  EXPECT_LE(LargestDifference(Rendered({folder, "--as-captured"}),
                              mean(model::ApertureShape::kGaussian, 8)),
            1);
  EXPECT_LE(LargestDifference(Rendered({folder, "--as-captured", "--bits", "16"}),
                              mean(model::ApertureShape::kGaussian, 16)),
            1);
  EXPECT_LE(LargestDifference(
                Rendered({folder, "--as-captured", "--aperture-shape", "uniform", "--bits", "16"}),
                mean(model::ApertureShape::kUniform, 16)),
            1);
  EXPECT_LE(LargestDifference(
                Rendered({folder, "--as-captured", "--aperture-shape", "disc", "--bits", "16"}),
                mean(model::ApertureShape::kDisc, 16)),
            1);
}

TEST_F(RenderTest, TheProtocolsCommandWorksAsWritten) {
  // 7 x 7 views inside a numbering of 9 a row.
  const model::LightField light_field = AtRandom(7, 7, 2);
  OutputFolder hci = io::ClaimHciFolder(folder_ / "hci");
  io::WriteHciLightField(light_field, &hci);
  hci.Commit();
  fs::create_directories(folder_ / "true");
  for (int l = 0; l < 7; ++l) {
    for (int k = 0; k < 7; ++k) {
      const auto name = [](int number) {
        return "/input_Cam" + std::string(number < 10 ? "00" : "0") + std::to_string(number) +
               ".png";
      };
      fs::copy_file((folder_ / "hci") + name(7 * l + k),
                    (folder_ / "true") + name(9 * (l + 1) + k + 1));
    }
  }
  const std::string out = folder_ / "photo.png";
  const Arguments command = {"--grid",
                             "9",
                             "--as-captured",
                             "--aperture-shape",
                             "uniform",
                             "--noise",
                             "1",
                             "--bits",
                             "8",
                             "--seed",
                             "1",
                             "-o",
                             out};
  Arguments arguments = {folder_ / "true"};
  arguments.insert(arguments.end(), command.begin(), command.end());
  const ProgramResult result = Run(arguments);
  ASSERT_EQ(result.exit_code, 0) << result.err;
  const model::EncodedImage photo = io::ToEncodedImage(io::ReadImageFile(out));
  const model::EncodedImage clean =
      MeanOfViews(light_field, model::ApertureWeights(model::ApertureShape::kUniform, 7, 7), 8);
  double squares = 0;
  ASSERT_EQ(photo.values.size(), clean.values.size());
  for (std::size_t i = 0; i < photo.values.size(); ++i)
    squares += std::pow(photo.values[i] - clean.values[i], 2);
  // Variance 1 of the noise, and 1/12 of each of the two roundings.
  EXPECT_NEAR(squares / static_cast<double>(photo.values.size()), 1 + 2.0 / 12, 0.15);

  const std::string first = ContentOf(out);
  EXPECT_EQ(Run(arguments).exit_code, 0);
  EXPECT_EQ(ContentOf(out), first) << "the seed decides";
  arguments.insert(arguments.end(), {"--threads", "1"});
  EXPECT_EQ(Run(arguments).exit_code, 0);
  EXPECT_EQ(ContentOf(out), first) << "the number of threads does not";
  *(std::find(arguments.begin(), arguments.end(), "--seed") + 1) = "2";
  EXPECT_EQ(Run(arguments).exit_code, 0);
  EXPECT_NE(ContentOf(out), first);
}

TEST_F(RenderTest, RenderedFocusAndClippingAreReported) {
  model::LightField light_field = AtRandom(1, 1, 3);
  for (std::size_t i = 0; i < 90; ++i) light_field.values[i] = i < 45 ? 2.0F : -1.0F;
  const std::string folder = Write("lf", light_field);
  const ProgramResult result =
      Run({folder, "--view", "centre", "-o", folder_ / "v.png", "--json", folder_ / "v.json"});
  ASSERT_EQ(result.exit_code, 0) << result.err;
  EXPECT_THAT(result.out, AllOf(HasSubstr("view (0, 0)"), HasSubstr("40 x 30 px"),
                                HasSubstr("clipped: 2.5 %")));
  const auto json = nlohmann::json::parse(ContentOf(folder_ / "v.json"));
  EXPECT_EQ(json["status"], "ok");
  EXPECT_EQ(json["rendered"], "view");
  EXPECT_DOUBLE_EQ(json["clipped_fraction"], 0.025);
  EXPECT_EQ(json["width_px"], kRenderedS);
  EXPECT_EQ(json["bits"], 8);
  EXPECT_EQ(json["views"], (std::vector<int>{1, 1}));
  EXPECT_THAT(Run({folder, "--view", "0,0", "-o", folder_ / "v.png", "--quiet"}).out, IsEmpty());
}

TEST_F(RenderTest, AViewIsThatView) {
  const model::LightField light_field = AtRandom(3, 5, 4);
  const std::string folder = Write("lf", light_field);
  const auto stored = [&](int k, int l) {
    return model::ToEncoded(model::ViewImage(light_field, k, l), light_field.transfer, 16).values;
  };
  EXPECT_EQ(Rendered({folder, "--view", "2,4", "--bits", "16"}).values, stored(2, 4));
  EXPECT_EQ(Rendered({folder, "--view", "centre", "--bits", "16"}).values, stored(1, 2));
  EXPECT_EQ(Rendered({folder, "--view", "0,0", "--views", "1x3", "--bits", "16"}).values,
            stored(1, 1));
  EXPECT_EQ(Rendered({folder, "--view", "0,0", "--crop", "3,4,5,6"}).width_px, 5);
}

// Views of a flat scene of disparity 2: refocused there it is sharp, elsewhere it is not.
model::LightField FlatScene(int disparity_px) {
  model::LightField light_field = model::MakeLightField(kRenderedS, kRenderedT, 3, 3, 3);
  std::mt19937 generator(5);
  std::uniform_real_distribution<float> any(0, 1);
  std::vector<float> texture(100 * 100);
  for (float& value : texture) value = any(generator);
  for (int c = 0; c < 3; ++c) {
    for (int l = 0; l < 3; ++l) {
      for (int k = 0; k < 3; ++k) {
        for (int t = 0; t < kRenderedT; ++t) {
          for (int s = 0; s < kRenderedS; ++s) {
            const int x = s + (k - 1) * disparity_px + 20;
            const int y = t + (l - 1) * disparity_px + 20;
            light_field.values[light_field.ViewStart(c, k, l) +
                               static_cast<std::size_t>(t * kRenderedS + s)] =
                texture[static_cast<std::size_t>(y * 100 + x)];
          }
        }
      }
    }
  }
  return light_field;
}

double RmsInside(const model::EncodedImage& a, const model::EncodedImage& b) {
  double squares = 0;
  int count = 0;
  for (int y = 6; y < kRenderedT - 6; ++y) {
    for (int x = 6; x < kRenderedS - 6; ++x) {
      const auto i = static_cast<std::size_t>((y * kRenderedS + x) * 3);
      squares += std::pow(a.values[i] - b.values[i], 2);
      ++count;
    }
  }
  return std::sqrt(squares / count);
}

TEST_F(RenderTest, FocusAtADisparityMakesItSharp) {
  const std::string folder = Write("lf", FlatScene(2));
  const model::EncodedImage centre = Rendered({folder, "--view", "centre"});
  EXPECT_LT(RmsInside(Rendered({folder, "--focus-disparity", "2"}), centre), 1);
  EXPECT_GT(RmsInside(Rendered({folder, "--focus-disparity", "-2"}), centre), 20);
  EXPECT_GT(RmsInside(Rendered({folder, "--as-captured"}), centre), 20);
  // A pinhole is sharp wherever the focus is.
  EXPECT_LT(RmsInside(Rendered({folder, "--focus-disparity", "0", "--aperture", "0"}), centre), 1);
}

TEST_F(RenderTest, FocusInMillimetresIsFocusAtItsDisparity) {
  model::LightField light_field = FlatScene(1);
  light_field.camera = WideCamera();
  light_field.grid = model::DefaultGrid(*light_field.camera, 3, 3);
  // The depth at which this camera has a disparity of 1 px.
  const model::Camera& camera = *light_field.camera;
  double near_mm = 30, far_mm = camera.focus_depth_mm();
  for (int i = 0; i < 100; ++i) {
    const double middle_mm = (near_mm + far_mm) / 2;
    const bool is_nearer = model::DisparityPx(camera, light_field.grid->u_step_mm, middle_mm) > 1;
    (is_nearer ? near_mm : far_mm) = middle_mm;
  }
  const std::string folder = Write("lf", light_field);
  const model::EncodedImage centre = Rendered({folder, "--view", "centre"});
  EXPECT_LT(RmsInside(Rendered({folder, "--focus", std::to_string(near_mm)}), centre), 1);
  EXPECT_LT(RmsInside(Rendered({folder, "--focus-disparity", "1"}), centre), 1);
  EXPECT_GT(RmsInside(Rendered({folder, "--focus", std::to_string(far_mm * 2)}), centre), 10);
}

// If the steps in v differ from those in u, a disparity is that along u.
TEST_F(RenderTest, BothWaysToFocusAgreeWhereTheStepsDiffer) {
  model::LightField light_field = AtRandom(3, 5, 15);
  light_field.camera = WideCamera();
  light_field.grid = model::DefaultGrid(*light_field.camera, 3, 5);
  ASSERT_GT(std::abs(light_field.grid->u_step_mm / light_field.grid->v_step_mm - 1), 0.1);
  const std::string folder = Write("lf", light_field);
  const double disparity_px =
      model::DisparityPx(*light_field.camera, light_field.grid->u_step_mm, 60);
  ASSERT_GT(disparity_px, 0.2);
  std::ostringstream text;
  text.precision(17);
  text << disparity_px;
  EXPECT_LE(LargestDifference(Rendered({folder, "--focus", "60", "--bits", "16"}),
                              Rendered({folder, "--focus-disparity", text.str(), "--bits", "16"})),
            2);
}

TEST_F(RenderTest, FallOffIsOnWithACameraAndCanBeLeftOut) {
  model::LightField light_field = model::MakeLightField(kRenderedS, kRenderedT, 3, 3, 3);
  std::fill(light_field.values.begin(), light_field.values.end(), 0.5F);
  light_field.camera = WideCamera();
  light_field.grid = model::DefaultGrid(*light_field.camera, 3, 3);
  const std::string folder = Write("lf", light_field);
  const auto stored = [&](const Arguments& more) {
    Arguments arguments = {folder, "--as-captured", "--bits", "16"};
    arguments.insert(arguments.end(), more.begin(), more.end());
    return Rendered(arguments).values;
  };
  const auto with = stored({});
  const auto without = stored({"--without", "falloff"});
  ASSERT_EQ(with.size(), without.size());
  const std::size_t centre = (15 * kRenderedS + 20) * 3;
  EXPECT_EQ(*std::min_element(without.begin(), without.end()),
            *std::max_element(without.begin(), without.end()));
  EXPECT_NEAR(with[centre], without[centre], 0.02 * without[centre]);
  EXPECT_LT(with[0], 0.9 * with[centre]);
}

TEST_F(RenderTest, VignettingIsOnWithUvOffTheAperture) {
  model::LightField light_field = AtRandom(3, 3, 7);
  light_field.camera = WideCamera();
  light_field.grid =
      model::GridOnPlanes(*light_field.camera, {1, light_field.camera->focus_depth_mm() - 1}, 3, 3);
  light_field.weights = model::ApertureWeights(model::ApertureShape::kGaussian, 3, 3);
  const std::string folder = Write("lf", light_field);
  const auto usual = Rendered({folder, "--as-captured"}).values;
  EXPECT_NE(usual, Rendered({folder, "--as-captured", "--without", "vignetting"}).values);
  const auto description = [&] {
    return io::DescriptionOf(ContentOf(folder_ / "rendered.png"), "rendered.png");
  };
  EXPECT_EQ(description(),
            "photograph through the light field's own aperture; effects: thickness, defocus, "
            "aperture-shape, falloff");
  // The weights of the light field itself are those of a Gaussian.
  EXPECT_EQ(usual, Rendered({folder, "--as-captured", "--aperture-shape", "gaussian"}).values);

  light_field.weights(0, 0) *= 1.1;
  light_field.weights /= light_field.weights.sum();
  const std::string odd = Write("odd", light_field);
  const ProgramResult result = Run({odd, "--as-captured", "-o", folder_ / "p.png"});
  EXPECT_EQ(result.exit_code, 1);
  EXPECT_THAT(result.err, AllOf(HasSubstr("lies off the aperture"), HasSubstr("--aperture-shape")));
  EXPECT_EQ(
      Run({odd, "--as-captured", "-o", folder_ / "p.png", "--without", "vignetting"}).exit_code, 0);
  Rendered({odd, "--view", "1,1"});
  EXPECT_EQ(description(), "view (1, 1)");
}

TEST_F(RenderTest, TheMosaicAndTheEpipolarImagesHaveTheirSizes) {
  const std::string folder = Write("lf", AtRandom(3, 5, 6));
  const model::EncodedImage mosaic = Rendered({folder, "--mosaic"});
  EXPECT_GE(mosaic.width_px, 3 * kRenderedS);
  EXPECT_LT(mosaic.width_px, 4 * kRenderedS);
  EXPECT_GE(mosaic.height_px, 5 * kRenderedT);
  EXPECT_LT(mosaic.height_px, 6 * kRenderedT);
  EXPECT_EQ(Rendered({folder, "--epi"}).width_px, kRenderedS);
  EXPECT_EQ(Rendered({folder, "--epi", "column=39"}).height_px, kRenderedT);
  EXPECT_EQ(Rendered({folder, "--epi"}).values, Rendered({folder, "--epi", "row=15,v=2"}).values);
  EXPECT_NE(Rendered({folder, "--epi"}).values, Rendered({folder, "--epi", "row=15,v=4"}).values);
}

TEST_F(RenderTest, ConvertsToEveryLayoutAndBack) {
  const model::LightField light_field = AtRandom(3, 3, 7);
  const std::string ours = Write("lf", light_field);
  const auto convert = [&](const std::string& from, const std::string& layout) {
    const std::string to = folder_ / layout;
    const ProgramResult result = Run({from, "--convert", layout, "-o", to});
    EXPECT_EQ(result.exit_code, 0) << result.err;
    EXPECT_THAT(result.out, AllOf(HasSubstr("3 x 3 views of 40 x 30 px"), HasSubstr(layout)));
    return to;
  };
  EXPECT_EQ(io::ReadLightField(convert(ours, "thicklens-tiff"), {}).values, light_field.values);
  const model::LightField png = io::ReadLightField(convert(ours, "thicklens"), {});
  const model::LightField hci = io::ReadLightField(convert(folder_ / "thicklens", "hci"), {});
  for (std::size_t i = 0; i < light_field.values.size(); ++i) {
    const double stored = light_field.transfer.Encode(light_field.values[i]);
    ASSERT_NEAR(light_field.transfer.Encode(png.values[i]), stored, 0.501 / 65535);
    ASSERT_NEAR(light_field.transfer.Encode(hci.values[i]), stored, 0.502 / 255);
  }
  convert(folder_ / "hci", "thicklens");  // over the older one, which is its own
  EXPECT_EQ(io::ReadLightField(folder_ / "thicklens", {}).origin.method, "imported");
}

TEST_F(RenderTest, WrongUsageIsExitCode2) {
  const std::string folder = Write("lf", AtRandom(3, 3, 8));
  EXPECT_THAT(Failure({folder}, 2), AllOf(HasSubstr("exactly one of"), HasSubstr("found none")));
  EXPECT_THAT(Failure({folder, "--mosaic", "--view", "0,0"}, 2),
              HasSubstr("found --view, --mosaic"));
  EXPECT_THAT(Failure({folder, "--mosaic", "--aperture", "1"}, 2), HasSubstr("--aperture"));
  EXPECT_THAT(Failure({folder, "--mosaic", "--aperture-shape", "disc"}, 2),
              HasSubstr("--aperture-shape"));
  EXPECT_THAT(Failure({folder, "--focus-disparity", "0", "--without", "falloff"}, 2),
              HasSubstr("--without"));
  EXPECT_THAT(Failure({folder, "--as-captured", "--aperture", "1", "--aperture-shape", "disc"}, 2),
              HasSubstr("--aperture"));
  EXPECT_THAT(Failure({folder, "--convert", "hci", "--bits", "16"}, 2), HasSubstr("--bits"));
  EXPECT_THAT(Failure({folder, "--convert", "hci", "--noise", "1"}, 2), HasSubstr("--noise"));
  EXPECT_THAT(Failure({folder, "--convert", "hci", "--seed", "1"}, 2), HasSubstr("--seed"));
  EXPECT_THAT(Failure({folder, "--convert", "lytro"}, 2), HasSubstr("lytro"));
  EXPECT_THAT(Failure({folder, "--view", "middle"}, 2), HasSubstr("--view"));
  EXPECT_THAT(Failure({folder, "--view", "1,2,3"}, 2), HasSubstr("--view"));
  for (const char* epi : {"row", "t=3", "row=3,u=1", "column=3,v=1", "row=-1", "row=3,v=1,v=2",
                          "v=1", "row=x", "row="}) {
    EXPECT_THAT(Failure({folder, "--epi", epi}, 2), HasSubstr("--epi")) << epi;
  }
  EXPECT_THAT(Failure({folder, "--as-captured", "--bits", "12"}, 2), HasSubstr("--bits"));
  EXPECT_THAT(Failure({folder, "--as-captured", "--noise", "-1"}, 2), HasSubstr("--noise"));
  EXPECT_THAT(Failure({folder, "--as-captured", "--aperture", "nan"}, 2), HasSubstr("--aperture"));
  EXPECT_THAT(Failure({folder, "--as-captured", "--views", "3"}, 2), HasSubstr("--views"));
  EXPECT_THAT(Failure({folder, "--as-captured", "--crop", "1,2,3"}, 2), HasSubstr("--crop"));
  EXPECT_THAT(Failure({folder, "--focus", "0"}, 2), HasSubstr("--focus"));
  EXPECT_EQ(Run({folder, "--convert", "thicklens", "-o", folder}).exit_code, 2);
  EXPECT_EQ(Run({folder, "--as-captured", "--device", "gpu", "-o", "x.png"}).exit_code, 2);
  EXPECT_EQ(Run({folder, "--as-captured"}).exit_code, 2);
}

// The input stays unchanged, whatever the path of the output is.
TEST_F(RenderTest, NothingIsWrittenIntoTheLightFieldItself) {
  const std::string ours = Write("lf", AtRandom(3, 3, 13));
  const std::string hci = folder_ / "hci";
  ASSERT_EQ(Run({ours, "--convert", "hci", "-o", hci}).exit_code, 0);
  const auto refused = [&](const Arguments& arguments, const std::string& why) {
    const ProgramResult result = Run(arguments);
    EXPECT_EQ(result.exit_code, 2) << result.err;
    EXPECT_THAT(result.err, HasSubstr(why));
  };
  const std::string description = ContentOf(ours + "/lightfield.yaml");
  const std::string view = ContentOf(ours + "/views/view_00_00.tiff");
  const std::string hci_view = ContentOf(hci + "/input_Cam000.png");
  const std::string png = folder_ / "photo.png";
  refused({ours, "--as-captured", "-o", ours + "/views/view_00_00.tiff"},
          "lies in the light field");
  refused({ours + "/", "--as-captured", "-o", ours + "/views/../new.png"},
          "lies in the light field");
  refused({ours, "--as-captured", "-o", png, "--json", ours + "/lightfield.yaml"},
          "lies in the light field");
  refused({ours, "--convert", "hci", "-o", ours + "/views"}, "lies in the light field");
  refused({hci, "--as-captured", "-o", hci + "/input_Cam000.png"}, "lies in the light field");
  fs::create_directory_symlink(ours, folder_ / "link");
  refused({ours, "--as-captured", "-o", folder_ / "link/views/view_00_00.tiff"},
          "lies in the light field");
  refused({folder_ / "link", "--as-captured", "-o", ours + "/new.png"}, "lies in the light field");
  fs::rename(hci, ours + "/inner");
  refused({ours + "/inner", "--convert", "thicklens", "-o", ours}, "holds the input");
  EXPECT_EQ(ContentOf(ours + "/lightfield.yaml"), description);
  EXPECT_EQ(ContentOf(ours + "/views/view_00_00.tiff"), view);
  EXPECT_EQ(ContentOf(ours + "/inner/input_Cam000.png"), hci_view);
  EXPECT_FALSE(fs::exists(png));
  // An output beside the light field, with a name that begins alike.
  EXPECT_EQ(Run({ours, "--as-captured", "-o", ours + "-photo.png"}).exit_code, 0);
}

TEST_F(RenderTest, WhatSomebodyPutAmongTheViewsStays) {
  const std::string ours = Write("lf", AtRandom(3, 3, 14));
  const std::string out = folder_ / "copy";
  ASSERT_EQ(Run({ours, "--convert", "thicklens", "-o", out}).exit_code, 0);
  const std::string notes = folder_.Put("copy/views/notes.txt", "years");
  const ProgramResult result = Run({ours, "--convert", "thicklens-tiff", "-o", out});
  EXPECT_EQ(result.exit_code, 1);
  EXPECT_THAT(result.err, HasSubstr("'views/notes.txt'"));
  EXPECT_EQ(ContentOf(notes), "years");
  fs::remove(notes);
  EXPECT_EQ(Run({ours, "--convert", "thicklens-tiff", "-o", out}).exit_code, 0);
}

TEST_F(RenderTest, ImpossibleRenderingsAreReportedInOneLine) {
  const std::string folder = Write("lf", AtRandom(3, 4, 9));
  EXPECT_THAT(Failure({folder_ / "none", "--mosaic"}), HasSubstr("does not exist"));
  EXPECT_THAT(Failure({folder, "--view", "3,0"}),
              AllOf(HasSubstr("--view 3,0"), HasSubstr("3x4"), HasSubstr("from 0 to 2")));
  EXPECT_THAT(Failure({folder, "--view", "0,4"}), HasSubstr("from 0 to 3"));
  EXPECT_THAT(Failure({folder, "--view", "centre"}), HasSubstr("none in the middle"));
  EXPECT_THAT(Failure({folder, "--focus", "500"}),
              AllOf(HasSubstr("no camera"), HasSubstr("--focus-disparity")));
  EXPECT_THAT(Failure({folder, "--epi", "row=30"}), HasSubstr("from 0 to 29"));
  EXPECT_THAT(Failure({folder, "--epi", "row=1,v=4"}), HasSubstr("from 0 to 3"));
  EXPECT_THAT(Failure({folder, "--epi", "column=40"}), HasSubstr("from 0 to 39"));
  EXPECT_THAT(Failure({folder, "--epi", "column=1,u=3"}), HasSubstr("from 0 to 2"));
  EXPECT_THAT(Failure({folder, "--mosaic", "--views", "2x4"}),
              AllOf(HasSubstr(folder), HasSubstr("odd")));
  EXPECT_THAT(Failure({folder, "--mosaic", "--crop", "0,0,41,30"}), HasSubstr("40x30"));
}

TEST_F(RenderTest, ABrokenOrMissingViewLeavesTheOlderOutput) {
  const std::string folder = Write("lf", AtRandom(3, 3, 10));
  ASSERT_EQ(Run({folder, "--convert", "hci", "-o", folder_ / "hci"}).exit_code, 0);
  const std::string view = folder_ / "hci/input_Cam005.png";
  const std::string whole = ContentOf(view);
  folder_.Put("hci/input_Cam005.png", whole.substr(0, whole.size() / 2));
  EXPECT_THAT(Failure({folder_ / "hci", "--mosaic"}),
              AllOf(HasSubstr("view (2, 1)"), HasSubstr("input_Cam005.png")));
  EXPECT_THAT(Failure({folder_ / "hci", "--convert", "thicklens"}), HasSubstr("is a file"));
  EXPECT_EQ(Run({folder_ / "hci", "--convert", "thicklens", "-o", folder}).exit_code, 1);
  EXPECT_EQ(io::ReadLightField(folder, {}).u_count, 3) << "the older light field is still there";
  fs::remove(view);
  EXPECT_THAT(Failure({folder_ / "hci", "--mosaic"}),
              AllOf(HasSubstr("input_Cam005.png"), HasSubstr("the option --sparse")));
  EXPECT_THAT(Failure({folder_ / "hci", "--view", "2,1", "--sparse"}), HasSubstr("no such view"));
  EXPECT_EQ(Rendered({folder_ / "hci", "--mosaic", "--sparse"}).bits, 8);
}

// The program is held as soon as its output is claimed, so that it is surely interrupted in time.
TEST_F(RenderTest, AnInterruptedRunLeavesTheOlderOutput) {
  const std::string folder = Write("source", AtRandom(9, 9, 12));
  const std::string out = folder_ / "lf";
  ASSERT_EQ(Run({folder, "--convert", "thicklens", "-o", out}).exit_code, 0);
  const std::string older = ContentOf(out + "/lightfield.yaml");

  ChildProgram child({"render", folder, "--convert", "thicklens", "-o", out}, scratch_.path(), 0);
  while (child.Running() && thicklens::testing::PartOf(folder_.path(), "lf").empty())
    std::this_thread::sleep_for(std::chrono::microseconds(200));
  child.Send(SIGSTOP);
  ASSERT_TRUE(child.Running());
  child.Interrupt();
  child.Send(SIGCONT);
  const ProgramResult result = child.Wait();
  EXPECT_EQ(result.exit_code, 1);
  EXPECT_THAT(result.err, HasSubstr("interrupted"));
  EXPECT_EQ(ContentOf(out + "/lightfield.yaml"), older);
  EXPECT_THAT(folder_.Entries(), ElementsAre("lf", "source"));
}

TEST_F(RenderTest, AFullDiskLeavesTheOlderOutput) {
  const std::string folder = Write("lf", AtRandom(3, 3, 11));
  const std::string out = folder_.Put("out/picture.png", "older");
  const ProgramResult image = Run({folder, "--mosaic", "-o", out}, 2000);
  EXPECT_EQ(image.exit_code, 1);
  EXPECT_THAT(image.err, HasSubstr("cannot be written"));
  EXPECT_EQ(ContentOf(out), "older");
  const ProgramResult converted =
      Run({folder, "--convert", "thicklens", "-o", folder_ / "out/lf"}, 2000);
  EXPECT_EQ(converted.exit_code, 1);
  EXPECT_EQ(std::distance(fs::directory_iterator(folder_ / "out"), fs::directory_iterator()), 1);
}

}  // namespace
}  // namespace thicklens::tools
