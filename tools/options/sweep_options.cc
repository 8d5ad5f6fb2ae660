#include "tools/options/sweep_options.h"

#include <string>

#include "tools/options/option_values.h"

namespace thicklens::tools {

void AddReadingOptions(CLI::App* command, SweepArguments* sweep) {
  model::ReadingOptions* readings = &sweep->readings;
  command
      ->add_option("--readings", sweep->readings_csv,
                   "Table for a folder: text with columns of files and readings (found by their "
                   "names), JSON of Micro-Manager or pymmcore-plus, or an OME companion file")
      ->type_name("TABLE");
  command
      ->add_option(
          "--column", readings->column,
          "Column of the readings: its name, or its number from 1; the key of JSON or EXIF")
      ->type_name("NAME");
  command->add_option("--file-column", readings->file_column, "Column of the files, likewise")
      ->type_name("NAME");
  command
      ->add_option(
          "--unit", readings->unit,
          "Unit of the readings: mm, um, nm, cm, m, in, mil, ft, dpt, steps, counts or turns; "
          "replaces the one in the table")
      ->type_name("UNIT");
  command
      ->add_option("--reading-scale", readings->scale_mm,
                   "Length of one step, count or turn, in mm")
      ->type_name("MM");
  command
      ->add_option("--decimal", readings->decimal,
                   "Decimal mark of the readings: comma or point, if the table does not show it")
      ->check(CLI::IsMember({"comma", "point"}))
      ->type_name("MARK");
  command
      ->add_option("--reading-from", readings->source,
                   "Readings from the images instead of a table: exif (EXIF and XMP), sidecar (a "
                   "JSON file beside each) or ome (OME-XML)")
      ->check(CLI::IsMember({"exif", "sidecar", "ome"}))
      ->type_name("SOURCE");
  command
      ->add_option("--reading-from-name", readings->name_pattern,
                   "Readings from the names of the images: their text around the number, such as "
                   "'z{reading}um'")
      ->type_name("PATTERN");
}

void AddVideoOptions(CLI::App* command, SweepArguments* sweep) {
  model::ReadingOptions* readings = &sweep->readings;
  model::VideoSelection* video = &sweep->video;
  command
      ->add_option("--time-column", readings->time_column,
                   "Video: column of the times in the table, by its name or number")
      ->type_name("NAME");
  command
      ->add_option("--time-unit", readings->time_unit,
                   "Video: unit of the times; replaces the one in the table")
      ->check(CLI::IsMember({"s", "ms", "us", "ns", "min", "h"}))
      ->type_name("UNIT");
  command
      ->add_option("--time-offset", video->time_offset,
                   "Video: the time of the first frame on the clock of the table, in seconds, as "
                   "hh:mm:ss.f, or as a date and a time; default 0")
      ->type_name("TIME");
  command
      ->add_option("--reading-start", video->reading_start,
                   "Video at constant speed, without a table: the reading at --time-start, in "
                   "--unit (default mm)")
      ->type_name("READING");
  command
      ->add_option("--reading-end", video->reading_end,
                   "Video at constant speed: the reading at --time-end")
      ->type_name("READING");
  command
      ->add_option("--time-start", video->time_start_s,
                   "Video: frames before are not used; default: the first frame, which is at 0")
      ->check(NonNegative())
      ->type_name("S");
  command
      ->add_option("--time-end", video->time_end_s,
                   "Video: frames after are not used; default: the last frame")
      ->check(NonNegative())
      ->type_name("S");
  constexpr int kMaxFrames = 1'000'000;
  CLI::Option* every =
      command->add_option("--every", video->every, "Video: every N-th usable frame, from the first")
          ->check(CLI::Range(1, kMaxFrames))
          ->type_name("N");
  command
      ->add_option("--frames", video->frames,
                   "Video: at most N frames, evenly chosen; default: all, or every n-th so that at "
                   "most 300 remain")
      ->check(CLI::Range(2, kMaxFrames))
      ->excludes(every)
      ->type_name("N");
}

// The options for what is known of the plane of focus.
static void AddFocusStatements(CLI::App* command, SweepArguments* sweep,
                               const std::string& instead) {
  const std::string form = ": VALUE or VALUE:SIGMA" + instead;
  command
      ->add_option("--focus-depth-mm", sweep->focus_depth_mm,
                   "Depth of the plane of focus from the aperture" + form)
      ->type_name("MM");
  command
      ->add_option("--working-distance-mm", sweep->working_distance_mm,
                   "Distance from the front of the lens to the plane of focus (the camera file "
                   "states lens.aperture_behind_front_mm)" +
                       form)
      ->type_name("MM");
  command
      ->add_option("--image-distance-mm", sweep->image_distance_mm,
                   "Distance from the aperture to the sensor" + form)
      ->type_name("MM");
  command
      ->add_option("--tube-length-mm", sweep->tube_length_mm,
                   "Optical tube length, from the rear focal plane to the sensor" + form)
      ->type_name("MM");
  command
      ->add_option("--magnification", sweep->magnification,
                   "Size on the sensor over size in the plane of focus" + form)
      ->type_name("M");
}

// The options for what corrects the frames.
static void AddCorrectionFiles(CLI::App* command, SweepArguments* sweep,
                               const std::string& instead) {
  model::CorrectionFiles* files = &sweep->correction;
  command
      ->add_option("--dark", files->dark,
                   "Exposures without light, which are averaged and subtracted from each frame in "
                   "linear light; the sweep is given before it" +
                       instead)
      ->type_name("FILE...");
  command
      ->add_option(
          "--flat", files->flat,
          "Exposures of an even surface, which are averaged, less the dark, and divided by "
          "their mean; each frame is divided by them" +
              instead)
      ->type_name("FILE...");
  command
      ->add_option("--defects", files->defects,
                   "Defective pixels, which are interpolated: an image that is not 0 there, or a "
                   "list of x and y" +
                       instead)
      ->type_name("FILE...");
  command
      ->add_option("--distortion", sweep->distortion,
                   "Lens distortion that is taken out of the frames: a file of OpenCV, ROS, "
                   "Kalibr, COLMAP or mrcal, FILE:CAMERA in a file of several, or none for frames "
                   "that are undistorted already; overrides the camera file")
      ->type_name("FILE[:CAMERA]");
}

void AddSweepStatements(CLI::App* command, SweepArguments* sweep) {
  const std::string instead = "; overrides the sweep file";
  command
      ->add_option("--offset-mm", sweep->offset_mm,
                   "Depth of reading 0, or unknown; with --moves lens or sensor, the distance from "
                   "the aperture to the sensor at reading 0" +
                       instead)
      ->type_name("MM");
  command
      ->add_option("--offset-sigma-mm", sweep->offset_sigma_mm, "Standard deviation of --offset-mm")
      ->check(NonNegative())
      ->type_name("MM");
  AddFocusStatements(command, sweep, instead);
  command
      ->add_option("--direction", sweep->direction,
                   "away: larger readings are farther; toward: nearer" + instead)
      ->check(CLI::IsMember({"away", "toward"}))
      ->type_name("WAY");
  command
      ->add_option("--moves", sweep->moves,
                   "The part that moves from frame to frame: target, camera, lens (focus ring, "
                   "motor) or sensor (camera back)" +
                       instead)
      ->check(CLI::IsMember({"target", "camera", "lens", "sensor"}))
      ->type_name("PART");
  command
      ->add_option("--reading-sigma-mm", sweep->reading_sigma_mm,
                   "Standard deviation of a reading" + instead)
      ->check(NonNegative())
      ->type_name("MM");
  command
      ->add_option("--floor-px", sweep->floor_px,
                   "Blur of the lens in perfect focus: VALUE, VALUE:SIGMA or unknown" + instead)
      ->type_name("PX");
  command
      ->add_option(
          "--floor-from", sweep->floor_from,
          "Blur of the lens in perfect focus, from a camera that was calibrated on a knife edge" +
              instead)
      ->type_name("CAMERA.yaml");
  command->add_option("--target", sweep->target, "Target that is photographed" + instead)
      ->check(CLI::IsMember({"auto", "texture", "printed-edge", "knife-edge", "points"}))
      ->type_name("KIND");
  command
      ->add_option("--target-period-mm", sweep->target_period_mm,
                   "Period of a periodic target, measured on it" + instead)
      ->check(Between(0, 1e9, "millimetres on the target"))
      ->type_name("MM");
  command
      ->add_option(
          "--grid", sweep->target_grid,
          "Grid on the target, by which image distance, principal point and distortion are "
          "found: chequerboard:11x8:10 (squares along x and y, their side in mm), "
          "charuco:11x8:10[:MARKER_MM[:DICTIONARY]] or circles:9x7:12" +
              instead)
      ->type_name("GRID");
  command
      ->add_option("--grid-views", sweep->grid_views,
                   "Folder of further images of the same grid with the same focus, tilted by 20 to "
                   "40 degrees about several axes" +
                       instead)
      ->type_name("DIR");
  command
      ->add_option(
          "--stage-alignment-deg", sweep->stage_alignment_deg,
          "Standard deviation of the angle between the motion of the sweep and the optical "
          "axis, if the stage was aligned" +
              instead)
      ->check(Between(0, 45, "degrees"))
      ->type_name("DEG");
  command->add_option("--roi", sweep->roi, "Part of the frames that is measured" + instead)
      ->type_name("X,Y,WIDTH,HEIGHT");
  constexpr int kMaxValue = 65535;
  command
      ->add_option("--full-scale", sweep->full_scale,
                   "Value in the files that stands for white, such as 1023 for 10 bits in a "
                   "container of 16" +
                       instead)
      ->check(CLI::Range(1, kMaxValue))
      ->type_name("N");
  command
      ->add_option("--raw", sweep->raw,
                   "Raw files: demosaiced (default) measures the interpolated colours, green the "
                   "mean of the two green sites of each 2 x 2 px, which no interpolation changes" +
                       instead)
      ->check(CLI::IsMember({"demosaiced", "green"}))
      ->type_name("KIND");
  AddCorrectionFiles(command, sweep, instead);
}

}  // namespace thicklens::tools
