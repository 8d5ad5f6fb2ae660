// Hard cases of calibration: sweeps that are short, one-sided, damaged or wrongly described.
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <random>
#include <string>
#include <utility>
#include <vector>

#include "thicklens/model/objective.h"
#include "thicklens/model/target_grid.h"
#include "tools/stress/stress_suite.h"
#include "tools/stress/stress_sweeps.h"

namespace thicklens::tools {
namespace {

namespace fs = std::filesystem;
using Frames = std::vector<model::EncodedImage>;

// The limit of the error of d1: two thirds of what a depth of field of half a pixel leaves
// undetermined, 0.4 mm.
constexpr double kMaxUm = 10;
const char kTruth[] =
    "d1, zf and kappa within 4 standard errors of the truth (in addition to the systematic "
    "interval), d1 within 10 um";

using Outcome = std::function<Requirement(const model::SweepTruth&)>;
Outcome Truth(double most_um = kMaxUm) {
  return [most_um](const model::SweepTruth& truth) { return FindsTruth(truth, most_um); };
}
Outcome Refusal(std::vector<std::string> words) {
  return [words](const model::SweepTruth&) { return Refused(words); };
}

StressCase Sweep(std::string name, std::string why, std::string required, const StressSweep& sweep,
                 const Outcome& outcome) {
  StressCase hard;
  hard.name = "calibration/" + std::move(name);
  hard.why = std::move(why);
  hard.required = std::move(required);
  hard.prepare = [=](const fs::path& folder, const Capabilities&) {
    return std::vector<StressRun>{CalibrationOf(outcome(WriteSweep(folder, sweep)))};
  };
  return hard;
}

StressSweep Simulated(const std::function<void(model::SweepSimulationOptions*)>& change) {
  StressSweep sweep;
  change(&sweep.simulation);
  return sweep;
}
StressSweep Damaged(std::function<void(Frames*)> damage) {
  StressSweep sweep;
  sweep.damage = std::move(damage);
  return sweep;
}
StressSweep Described(std::function<void(model::SweepFile*)> describe) {
  StressSweep sweep;
  sweep.describe = std::move(describe);
  return sweep;
}

// Returns a sweep of `count` frames around the plane of focus, over the same depths as the usual
// sweep.
StressSweep OfFrames(int count) {
  return Simulated([count](model::SweepSimulationOptions* simulation) {
    // The outermost frames must still show some texture, because none of so few frames can be
    // spared.
    constexpr double kPart = 0.85;
    const double whole_mm = simulation->step_mm * (simulation->frame_count - 1);
    const double length_mm = kPart * whole_mm;
    simulation->first_depth_mm += (whole_mm - length_mm) / 2;
    simulation->frame_count = count;
    simulation->step_mm = length_mm / (count - 1);
  });
}

// The usual sweep, moved away from the plane of focus at 300 mm.
StressSweep BeginningAt(double first_depth_mm) {
  return Simulated([first_depth_mm](model::SweepSimulationOptions* simulation) {
    simulation->first_depth_mm = first_depth_mm;
  });
}

std::vector<StressCase> Frames2To5() {
  std::vector<StressCase> cases;
  for (const int count : {2, 3, 4}) {
    const std::string name = count == 2   ? "two-frames"
                             : count == 3 ? "three-frames"
                                          : "four-frames";
    cases.push_back(
        Sweep(name, "not more readings than unknowns: nothing would remain to check them",
              "refused: the number of frames, and the number that is needed", OfFrames(count),
              Refusal({"at least 5 frames", "has " + std::to_string(count)})));
  }
  cases.push_back(
      Sweep("five-frames", "one reading more than unknowns", kTruth, OfFrames(5), Truth()));
  return cases;
}

std::vector<StressCase> Focus() {
  std::vector<StressCase> cases;
  cases.push_back(Sweep("focus-at-first-frame", "only one side of the plane of focus is seen",
                        kTruth, BeginningAt(300), Truth()));
  cases.push_back(Sweep("focus-at-last-frame", "only one side of the plane of focus is seen",
                        kTruth, BeginningAt(270), Truth()));
  cases.push_back(Sweep("focus-a-little-before-the-sweep",
                        "the plane of focus is 5 mm nearer than any frame",
                        "d1, zf and kappa within 4 standard errors of the truth, d1 within 20 um",
                        BeginningAt(305), Truth(20)));
  cases.push_back(Sweep("focus-a-little-behind-the-sweep",
                        "the plane of focus is 5 mm beyond any frame",
                        "d1, zf and kappa within 4 standard errors of the truth, d1 within 20 um",
                        BeginningAt(265), Truth(20)));
  cases.push_back(Sweep("focus-far-before-the-sweep",
                        "the plane of focus is 10 mm nearer than any frame: too few frames are "
                        "sharp enough to locate it",
                        "refused: the focus is outside, and on which side", BeginningAt(310),
                        Refusal({"sharpness is monotone", "nearer"})));
  cases.push_back(Sweep(
      "focus-far-behind-the-sweep",
      "the plane of focus is 10 mm beyond any frame: too few frames are sharp enough to locate it",
      "refused: the focus is outside, and on which side", BeginningAt(260),
      Refusal({"sharpness is monotone", "farther"})));
  return cases;
}

void Swap(model::SweepFile* file, std::size_t a, std::size_t b) {
  std::swap(file->frames[a].reading_mm, file->frames[b].reading_mm);
}

std::vector<StressCase> Readings() {
  std::vector<StressCase> cases;
  cases.push_back(Sweep("readings-all-equal", "according to the file nothing moved",
                        "refused: the readings are equal", Described([](model::SweepFile* file) {
                          for (model::SweepFrame& frame : file->frames) frame.reading_mm = 300;
                        }),
                        Refusal({"at least 5 different readings", "300"})));
  cases.push_back(Sweep("readings-reversed", "the bench scale is read from the wrong end",
                        "refused: image scale and readings run in opposite directions",
                        Described([](model::SweepFile* file) {
                          for (std::size_t i = 0, j = file->frames.size() - 1; i < j; ++i, --j) {
                            Swap(file, i, j);
                          }
                        }),
                        Refusal({"direction", "toward"})));
  cases.push_back(Sweep("readings-in-centimetres", "all readings are a tenth of the correct ones",
                        "refused: the readings contradict the image scale or the camera",
                        Described([](model::SweepFile* file) {
                          for (model::SweepFrame& frame : file->frames) frame.reading_mm /= 10;
                        }),
                        Refusal({"image scale", "that the readings are in mm"})));
  cases.push_back(Sweep(
      "readings-in-micrometres", "all readings are a thousand times the correct ones",
      "refused: the readings contradict the image scale", Described([](model::SweepFile* file) {
        for (model::SweepFrame& frame : file->frames) frame.reading_mm *= 1000;
      }),
      Refusal({"blur ratio", "unit of the readings"})));
  cases.push_back(Sweep("two-readings-swapped", "the readings of frames 8 and 20 are swapped",
                        kTruth, Described([](model::SweepFile* file) { Swap(file, 8, 20); }),
                        Truth()));
  cases.push_back(Sweep("one-reading-off", "frame 20 is off by three steps", kTruth,
                        Described([](model::SweepFile* file) { file->frames[20].reading_mm += 3; }),
                        Truth()));
  return cases;
}

// A stage whose readings have systematic errors. The bench offset is not stated, so that it comes
// from the image scale.
std::vector<StressCase> Stages() {
  const std::string required =
      "d1, zf and kappa within 4 standard errors of the truth or of the interval, d1 within 200 um";
  const auto open = [](const std::function<void(model::StageOptions*)>& change) {
    StressSweep sweep = Simulated([change](model::SweepSimulationOptions* simulation) {
      change(&simulation->stage);
      if (!simulation->stage.there_and_back) return;
      simulation->step_mm *= 2;
      simulation->frame_count += simulation->frame_count % 2;
    });
    sweep.describe = [](model::SweepFile* file) { file->offset_mm.reset(); };
    return sweep;
  };
  std::vector<StressCase> cases;
  cases.push_back(Sweep("stage-backlash",
                        "there and back; the readings on the way back are 0.4 mm larger", required,
                        open([](model::StageOptions* stage) {
                          stage->there_and_back = true;
                          stage->backlash_mm = 0.4;
                        }),
                        Truth(200)));
  cases.push_back(Sweep("stage-screw", "a lead screw of 5 mm is off by up to 0.3 mm", required,
                        open([](model::StageOptions* stage) {
                          stage->screw_error_mm = 0.3;
                          stage->screw_period_mm = 5;
                        }),
                        Truth(200)));
  cases.push_back(Sweep("stage-lost-steps",
                        "there and back; from the 25th frame on the readings are 0.5 mm larger",
                        required, open([](model::StageOptions* stage) {
                          stage->there_and_back = true;
                          stage->slip_mm = 0.5;
                          stage->slip_from_frame = 24;
                        }),
                        Truth(200)));
  return cases;
}

void Fill(model::EncodedImage* frame, std::uint16_t value) {
  std::fill(frame->values.begin(), frame->values.end(), value);
}

// Averages over so many pixels along the rows.
void Smear(model::EncodedImage* frame, int length_px) {
  const std::vector<std::uint16_t> sharp = frame->values;
  for (int y = 0; y < frame->height_px; ++y) {
    for (int x = 0; x < frame->width_px; ++x) {
      int sum = 0;
      for (int i = 0; i < length_px; ++i) {
        const int at = std::clamp(x + i - length_px / 2, 0, frame->width_px - 1);
        sum += sharp[static_cast<std::size_t>(y * frame->width_px + at)];
      }
      frame->values[static_cast<std::size_t>(y * frame->width_px + x)] =
          static_cast<std::uint16_t>(sum / length_px);
    }
  }
}

void TurnAround(model::EncodedImage* frame) {
  std::reverse(frame->values.begin(), frame->values.end());
}

std::vector<StressCase> Damages() {
  std::vector<StressCase> cases;
  cases.push_back(Sweep("one-image-thirty-one-times", "the shutter fired, the bench did not move",
                        "refused: the frames are the same image, or do not change",
                        Damaged([](Frames* frames) {
                          for (std::size_t i = 1; i < frames->size(); ++i) {
                            (*frames)[i] = frames->front();
                          }
                        }),
                        Refusal({"one image was repeated"})));
  cases.push_back(Sweep("all-frames-blank", "a target without texture",
                        "refused: the frames show no texture", Damaged([](Frames* frames) {
                          for (model::EncodedImage& frame : *frames) Fill(&frame, 128);
                        }),
                        Refusal({"no texture above the noise"})));
  for (const bool black : {true, false}) {
    cases.push_back(Sweep(black ? "all-frames-black" : "all-frames-white",
                          black ? "the lens cap was on" : "the exposure was far too long",
                          "refused: no frame can be used", Damaged([black](Frames* frames) {
                            for (model::EncodedImage& frame : *frames)
                              Fill(&frame, black ? 0 : 255);
                          }),
                          Refusal({black ? "under-exposed" : "over-exposed"})));
  }
  cases.push_back(Sweep("black-white-blank-frames", "three frames show nothing", kTruth,
                        Damaged([](Frames* frames) {
                          Fill(&(*frames)[3], 0);
                          Fill(&(*frames)[9], 255);
                          Fill(&(*frames)[22], 128);
                        }),
                        Truth()));
  cases.push_back(Sweep("smeared-frame", "the bench was hit: 15 px of motion blur near focus",
                        kTruth, Damaged([](Frames* frames) { Smear(&(*frames)[18], 15); }),
                        Truth()));
  cases.push_back(Sweep("rotated-frame", "one frame is upside down", kTruth,
                        Damaged([](Frames* frames) { TurnAround(&(*frames)[12]); }), Truth()));
  cases.push_back(Sweep("tilted-target",
                        "the target leans by 10 degrees: every column has another depth", kTruth,
                        Simulated([](model::SweepSimulationOptions* simulation) {
                          simulation->target.tilt_deg = 10;
                        }),
                        Truth()));
  cases.push_back(Sweep("noise-at-the-signals-level", "shot and read noise as large as the texture",
                        kTruth, Simulated([](model::SweepSimulationOptions* simulation) {
                          simulation->full_well_electrons = 100;
                          simulation->read_noise_electrons = 12;
                        }),
                        Truth()));
  cases.push_back(Sweep("noise-alone", "no target at all", "refused: the frames show no texture",
                        Damaged([](Frames* frames) {
                          std::mt19937 engine(5);
                          for (model::EncodedImage& frame : *frames) {
                            for (std::uint16_t& value : frame.values) {
                              value = static_cast<std::uint16_t>(118 + engine() % 20);
                            }
                          }
                        }),
                        Refusal({"no texture above the noise"})));
  return cases;
}

std::vector<StressCase> Optics() {
  std::vector<StressCase> cases;
  StressSweep soft = Simulated([](model::SweepSimulationOptions* simulation) {
    simulation->camera.lens.aperture_radius_mm /= 16;
    simulation->camera.calibration->blur_floor_px = model::Estimate{3, 0};
  });
  cases.push_back(Sweep("floor-larger-than-blur",
                        "a blur floor of 3 px, and 1 px of defocus at most",
                        "d1, zf and kappa within 4 standard errors of the truth, d1 within 200 um",
                        soft, Truth(200)));
  for (const double wrong_mm : {35.0, 70.0}) {
    StressSweep wrong_lens;
    wrong_lens.change_camera = [wrong_mm](model::Camera* camera) {
      camera->lens.front_focal_length_mm = camera->lens.rear_focal_length_mm = wrong_mm;
    };
    cases.push_back(Sweep(
        wrong_mm < 50 ? "focal-length-too-short" : "focal-length-too-long",
        "the camera file states 35 or 70 mm, but the lens has 50 mm: no texture shows that, and "
        "kappa absorbs it",
        "a warning: the blur ratio is not one of an aperture, and a wrong focal length looks like "
        "this",
        wrong_lens, [](const model::SweepTruth&) {
          return Warned({"blur ratio", "focal length", "target_period_mm"});
        }));
  }
  StressSweep at_focus = Simulated([](model::SweepSimulationOptions* simulation) {
    simulation->step_mm = 0.01;
    simulation->first_depth_mm = 299.85;
  });
  cases.push_back(
      Sweep("no-defocus",
            "all frames lie within 0.15 mm of the plane of focus, readings are accurate to 0.07 mm",
            kTruth, at_focus, Truth()));
  return cases;
}

// A sweep of 31 frames about the plane of focus, whose bench offset is not stated.
StressSweep Macro(const model::ThickLens& lens, double pitch_mm, double focus_mm, double step_mm) {
  StressSweep sweep = Simulated([=](model::SweepSimulationOptions* simulation) {
    simulation->camera.lens = lens;
    simulation->camera.sensor.pixel_pitch_mm = pitch_mm;
    simulation->camera.calibration->image_distance_mm =
        model::Estimate{model::ImageDistanceMm(lens, focus_mm), 0};
    simulation->first_depth_mm = focus_mm - 14.7 * step_mm;
    simulation->step_mm = step_mm;
    simulation->frame_count = 31;
    simulation->bench_offset_mm = 0.3 * focus_mm;
    simulation->reading_sigma_mm = 0.03 * step_mm;
    simulation->bits = 16;
  });
  sweep.describe = [](model::SweepFile* file) { file->offset_mm.reset(); };
  return sweep;
}

std::vector<StressCase> Macros() {
  const auto within = [](double most_mm) {
    return std::string("d1, zf and kappa within 4 standard errors of the truth, d1 within ") +
           (most_mm < 1 ? "1" : std::to_string(std::lround(most_mm))) + " mm";
  };
  const model::ThickLens one_to_one = {100, 100, 0, 17.86};
  std::vector<StressCase> cases;
  cases.push_back(Sweep("macro-without-bench-offset",
                        "magnification 1: 3 mm of sweep at 200 mm, whose image scale determines "
                        "the bench offset to millimetres",
                        within(20), Macro(one_to_one, 0.0043, 200, 0.1), Truth(20000)));
  StressSweep known = Macro(one_to_one, 0.0043, 200, 0.1);
  known.describe = [](model::SweepFile* file) {
    file->offset_mm.reset();
    file->magnification = model::Estimate{1, 0.001};
  };
  cases.push_back(Sweep("macro-with-magnification",
                        "the same, with a magnification that is known to 0.1 %", within(1), known,
                        Truth(1000)));
  const model::Objective objective = {20, 0.4, 200};
  StressSweep microscope = Macro(model::LensOfObjective(objective), 0.0065, 10.5, 0.001);
  cases.push_back(Sweep(
      "microscope-without-distance",
      "magnification 20: 30 um of sweep, and nothing says how far the target is",
      "refused: nothing determines the distance; the reading at focus is given", microscope,
      Refusal({"nothing determines the distance of the target", "reading at focus is known"})));
  microscope.change_camera = [objective](model::Camera* camera) { camera->objective = objective; };
  cases.push_back(Sweep("microscope-with-objective",
                        "the same, with the data of the objective in the camera file: the "
                        "magnification is known to 5 %",
                        within(20), microscope, Truth(20000)));
  return cases;
}

// A sweep of 25 frames about focus in which the lens or the sensor moves before a target at 300 mm.
StressSweep Moving(model::SweepMotion moves) {
  constexpr double kFocusMm = 300, kStepMm = 0.05;
  const model::ThickLens lens = {50, 50, 4, 8.93};
  const double d1_mm = model::ImageDistanceMm(lens, kFocusMm);
  StressSweep sweep = Simulated([=](model::SweepSimulationOptions* simulation) {
    simulation->camera.lens = lens;
    simulation->camera.sensor.pixel_pitch_mm = 0.0045;
    simulation->camera.calibration->image_distance_mm = model::Estimate{d1_mm, 0};
    simulation->moves = moves;
    simulation->first_image_distance_mm = d1_mm - 11.7 * kStepMm;
    simulation->step_mm = kStepMm;
    simulation->frame_count = 25;
    simulation->bench_offset_mm = d1_mm - 3;
    simulation->reading_sigma_mm = 0.03 * kStepMm;
    simulation->bits = 16;
  });
  sweep.describe = [](model::SweepFile* file) { file->offset_mm.reset(); };
  return sweep;
}

std::vector<StressCase> MovingFocus() {
  std::vector<StressCase> cases;
  cases.push_back(Sweep("moving-sensor",
                        "the sensor moves by 1.2 mm and the target stands still: the image scale "
                        "gives d1",
                        "d1, zf and kappa within 4 standard errors of the truth, d1 within 3 mm",
                        Moving(model::SweepMotion::kSensor), Truth(3000)));
  StressSweep lens = Moving(model::SweepMotion::kLens);
  cases.push_back(
      Sweep("moving-lens-without-distance",
            "the lens moves, and nothing says how far the target is: the image scale "
            "is the same for all distances",
            "refused: nothing determines the distance; a statement is asked for", lens,
            Refusal({"nothing determines the distance from the lens", "focus_depth_mm"})));
  lens.describe = [](model::SweepFile* file) {
    file->offset_mm.reset();
    file->focus_depth_mm = model::Estimate{300, 0.5};
  };
  cases.push_back(Sweep("moving-lens", "the same, with the distance of the target known to 0.5 mm",
                        "d1, zf and kappa within 4 standard errors of the truth, d1 within 1 mm",
                        lens, Truth(1000)));
  lens.simulation.counts_per_mm = 400;
  lens.simulation.bench_offset_mm = 50;
  cases.push_back(Sweep(
      "counts-of-a-drive", "the same with the counts of a drive, 400 per mm, as readings",
      "d1, zf and kappa within 4 standard errors of the truth, d1 within 1 mm", lens, Truth(1000)));
  return cases;
}

// Structure that stays at the same pixels while the target changes its size. The bench offset is
// not stated, so that d1 comes from the image scale.
std::vector<StressCase> FixedToTheFrame() {
  const std::string required =
      "d1, zf and kappa within 4 standard errors of the truth, d1 within 200 um";
  const auto open = [](const std::function<void(model::SweepSimulationOptions*)>& change) {
    StressSweep sweep = Simulated(change);
    sweep.describe = [](model::SweepFile* file) { file->offset_mm.reset(); };
    return sweep;
  };
  std::vector<StressCase> cases;
  cases.push_back(
      Sweep("dark-corners",
            "the lens is wide open: the corners are two stops darker than the middle", required,
            open([](model::SweepSimulationOptions* simulation) { simulation->corner_stops = -2; }),
            Truth(200)));
  cases.push_back(Sweep("dust-on-the-sensor",
                        "6 specks of up to 5 px radius, which take 40 % of the light", required,
                        open([](model::SweepSimulationOptions* simulation) {
                          simulation->speck_count = 6;
                          simulation->speck_radius_px = 5;
                        }),
                        Truth(200)));
  return cases;
}

// Light that changes from frame to frame. Row bands move the scale and hide the blur.
std::vector<StressCase> LightOfFrames() {
  const std::string required =
      "d1, zf and kappa within 4 standard errors of the truth, d1 within 10 um";
  std::vector<StressCase> cases;
  cases.push_back(Sweep("rolling-bands",
                        "rows brighten by 15 % with a period of 24 px, at another place in each "
                        "frame: a lamp flickers under a rolling shutter",
                        required, Simulated([](model::SweepSimulationOptions* simulation) {
                          simulation->band_amplitude = 0.15;
                        }),
                        Truth(10)));
  cases.push_back(Sweep("exposure-drift", "the exposure grows by 1.5 stops over the sweep",
                        required, Simulated([](model::SweepSimulationOptions* simulation) {
                          simulation->light_level = 0.25;
                          simulation->exposure_drift_stops = 1.5;
                        }),
                        Truth(10)));
  return cases;
}

// Calibrates with the map of zf over the field, which the other cases leave out to save time.
StressCase WithField(StressCase hard) {
  hard.prepare = [prepare = hard.prepare](const fs::path& folder, const Capabilities& has) {
    std::vector<StressRun> runs = prepare(folder, has);
    for (StressRun& run : runs) {
      run.arguments.erase(std::remove(run.arguments.begin(), run.arguments.end(), "--no-field"),
                          run.arguments.end());
    }
    return runs;
  };
  return hard;
}

// Aberrations of which the calibration does not know.
std::vector<StressCase> Aberrations() {
  const auto lens = [](const char* name, const char* why,
                       const model::LensAberrations& aberrations) {
    return WithField(
        Sweep(name, why, "d1, zf and kappa within 4 standard errors of the truth, d1 within 50 um",
              Simulated([aberrations](model::SweepSimulationOptions* simulation) {
                simulation->aberrations = aberrations;
              }),
              Truth(50)));
  };
  std::vector<StressCase> cases;
  model::LensAberrations aberrations;
  aberrations.distortion = -0.03;
  cases.push_back(lens("distorting-lens", "barrel of 3 % at the corner: the blur is smaller there",
                       aberrations));
  // The grid shows the distortion, which is taken out.
  cases.push_back(
      Sweep("grid-of-a-distorting-lens",
            "barrel of 6 % at the corner, beyond what a texture leaves of a result; the "
            "target is a ChArUco board",
            "d1, zf and kappa within 4 standard errors of the truth, d1 within 50 um",
            Simulated([](model::SweepSimulationOptions* simulation) {
              constexpr int kSidePx = 512;
              model::Sensor& sensor = simulation->camera.sensor;
              sensor.width_px = sensor.height_px = kSidePx;
              sensor.principal_point_px.setConstant(0.5 * (kSidePx - 1));
              simulation->target = {};
              simulation->target.kind = model::TargetKind::kGrid;
              simulation->target.grid = model::ParseTargetGrid("charuco:11x9:1");
              simulation->aberrations.distortion = -0.06;
              simulation->bits = 16;
            }),
            Truth(50)));
  aberrations = {};
  aberrations.astigmatism_mm = -4;
  cases.push_back(lens("astigmatic-lens",
                       "the blur along x is smallest 4 mm nearer than the blur along y",
                       aberrations));
  aberrations = {};
  aberrations.axial_colour_mm.emplace(2, 0, -1);
  cases.push_back(lens("axial-colour",
                       "frames in colour: red is in focus 2 mm farther and blue 1 mm nearer than "
                       "green",
                       aberrations));
  cases.push_back(Sweep("hexagonal-aperture",
                        "six straight blades, calibrated as a disc of the same second moment",
                        "d1, zf and kappa within 4 standard errors of the truth, d1 within 50 um",
                        Simulated([](model::SweepSimulationOptions* simulation) {
                          simulation->camera.psf = model::Psf::kDisc;
                          simulation->pupil_law = model::PupilLaw::kUniform;
                          simulation->aperture.blades = 6;
                          simulation->aperture.rotation_deg = 10;
                        }),
                        Truth(50)));
  aberrations = {};
  aberrations.field_curvature_mm = -2;
  cases.push_back(
      lens("curved-field", "the corners are in focus 2 mm nearer than the axis", aberrations));
  const auto curved = [aberrations](bool knows_zero) {
    StressSweep sweep = Simulated([aberrations](model::SweepSimulationOptions* simulation) {
      simulation->aberrations = aberrations;
    });
    if (!knows_zero) sweep.describe = [](model::SweepFile* file) { file->offset_mm.reset(); };
    return sweep;
  };
  cases.push_back(Sweep("curved-field-without-map",
                        "the same with --no-field: a few zones must show it",
                        "d1, zf and kappa within 4 standard errors of the truth, d1 within 50 um",
                        curved(true), Truth(50)));
  cases.push_back(WithField(
      Sweep("curved-field-without-offset",
            "the same, with the bench offset from the image scale, which the change of the blur "
            "over the field stretches",
            "d1, zf and kappa within 4 standard errors of the truth, d1 within 400 um",
            curved(false), Truth(400))));
  return cases;
}

// A block that stands out of the target, in a field of 4.3 x 4.3 mm.
model::ReliefPartOptions Block(double x_mm, double y_mm, double side_mm, double height_mm) {
  model::ReliefPartOptions block;
  block.centre_mm = {x_mm, y_mm};
  block.size_mm = {side_mm, side_mm};
  block.height_mm = height_mm;
  return block;
}

// Kinds of targets, and targets that are not flat.
std::vector<StressCase> Targets() {
  const auto of_kind = [](model::TargetKind kind, double light_level) {
    return Simulated([kind, light_level](model::SweepSimulationOptions* simulation) {
      simulation->target.kind = kind;
      simulation->target.contrast = 0.95;
      simulation->target.feature_size_mm = 0.15;
      simulation->target.spacing_mm = 1;
      simulation->light_level = light_level;
      simulation->bits = 16;
    });
  };
  std::vector<StressCase> cases;
  const char near_truth[] =
      "d1, zf and kappa within 4 standard errors of the truth, d1 within 50 um";
  cases.push_back(Sweep("pinholes", "bright points on a ground that is almost black", near_truth,
                        of_kind(model::TargetKind::kPinholes, 0.05), Truth(50)));
  cases.push_back(Sweep("beads", "dark points on a bright ground, which fade out of focus",
                        near_truth, of_kind(model::TargetKind::kBeads, 0.5), Truth(50)));
  cases.push_back(Sweep("ground-glass", "speckle, of which few grains are bright", near_truth,
                        of_kind(model::TargetKind::kGroundGlass, 0.3), Truth(50)));
  StressSweep mesh = Simulated([](model::SweepSimulationOptions* simulation) {
    simulation->target.kind = model::TargetKind::kMesh;
    simulation->target.feature_size_mm = 0.9;
  });
  cases.push_back(Sweep("mesh", "wires that repeat every 40 px", near_truth, mesh, Truth(50)));
  StressSweep edge = of_kind(model::TargetKind::kPrintedEdge, 0.5);
  edge.describe = [](model::SweepFile* file) { file->target = model::SweepTarget::kTexture; };
  cases.push_back(Sweep("edge-as-texture", "a lone slanted edge that is stated to be a texture",
                        near_truth, edge, Truth(50)));
  cases.push_back(Sweep("block-on-a-plate", "a third of the field is 4 mm nearer than the rest",
                        near_truth, Simulated([](model::SweepSimulationOptions* simulation) {
                          simulation->target.relief = {Block(2.6, 0, 3, 4)};
                          simulation->target.relief[0].size_mm.y() = 8;
                        }),
                        Truth(50)));
  return cases;
}

}  // namespace

std::vector<StressCase> CalibrationStressCases() {
  std::vector<StressCase> all;
  for (std::vector<StressCase> part :
       {Frames2To5(), Focus(), Readings(), Stages(), Damages(), Optics(), Macros(), MovingFocus(),
        FixedToTheFrame(), LightOfFrames(), Aberrations(), Targets()}) {
    for (StressCase& hard : part) all.push_back(std::move(hard));
  }
  return all;
}

}  // namespace thicklens::tools
