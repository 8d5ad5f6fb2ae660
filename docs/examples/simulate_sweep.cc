// Simulates a focus sweep of a flat target and writes it into a folder with its truth:
//   simulate_sweep configs/simulate/sweep.yaml SWEEP_FOLDER
#include <thicklens/thicklens.h>

#include <iostream>

int main(int argc, char** argv) try {
  if (argc != 3) {
    std::cerr << "usage: simulate_sweep CONFIG.yaml FOLDER\n";
    return 2;
  }
  auto simulation = thicklens::ReadSweepSimulation(argv[1]);
  simulation.seed = 7;  // determines every bit of the frames
  const auto sweep = thicklens::SimulateSweep(simulation, argv[2]);
  std::cout << sweep.description.frames.size() << " frames, true image distance "
            << sweep.truth->image_distance_mm << " mm\n";
} catch (const thicklens::Error& error) {
  std::cerr << error.what() << '\n';
  return 1;
}
