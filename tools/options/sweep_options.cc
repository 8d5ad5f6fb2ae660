#include "tools/options/sweep_options.h"

#include <string>

#include "tools/options/option_values.h"

namespace thicklens::tools {

void AddSweepStatements(CLI::App* command, SweepArguments* sweep) {
  const std::string instead = "; overrides the sweep file";
  command->add_option("--offset-mm", sweep->offset_mm, "Depth of reading 0, or unknown" + instead)
      ->type_name("MM");
  command
      ->add_option("--offset-sigma-mm", sweep->offset_sigma_mm, "Standard deviation of --offset-mm")
      ->check(NonNegative())
      ->type_name("MM");
  command
      ->add_option("--direction", sweep->direction,
                   "away: larger readings are farther; toward: nearer" + instead)
      ->check(CLI::IsMember({"away", "toward"}))
      ->type_name("WAY");
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
      ->check(CLI::IsMember({"auto", "texture", "printed-edge", "knife-edge"}))
      ->type_name("KIND");
  command->add_option("--roi", sweep->roi, "Part of the frames that is measured" + instead)
      ->type_name("X,Y,WIDTH,HEIGHT");
}

}  // namespace thicklens::tools
