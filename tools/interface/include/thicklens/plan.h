#ifndef THICKLENS_PLAN_H_
#define THICKLENS_PLAN_H_

#include <string>

#include "thicklens/base/export.h"
#include "thicklens/calib/sweep_plan.h"
#include "thicklens/run.h"
#include "thicklens/simulate.h"

namespace thicklens {

using calib::ExpectedSweep;
using calib::PlanConditions;
using calib::PlanWishes;
using calib::SweepDesign;
using calib::SweepPlan;

// The errors that a calibration of a sweep is expected to have (thicklens/calib/sweep_plan.h).
// Throws OptionError for conditions that are not valid, Error for a design that is not, and
// Interrupted.
THICKLENS_EXPORT ExpectedSweep PredictSweep(const PlanConditions& conditions,
                                            const SweepDesign& design, const RunControl& run = {});

// Proposes a sweep. Wishes that cannot be reached are no error: SweepPlan::reached says so, and its
// reason what would be needed. Throws OptionError for conditions and wishes that are not valid,
// Error if no sweep would have a result, and Interrupted.
THICKLENS_EXPORT SweepPlan ProposeSweep(const PlanConditions& conditions, const PlanWishes& wishes,
                                        const RunControl& run = {});

// The simulation of a planned sweep: SimulateSweep makes its frames.
THICKLENS_EXPORT SweepSimulation PlannedSimulation(const PlanConditions& conditions,
                                                   const SweepDesign& design);
// Its file, schema thicklens/simulate-sweep/1. `camera_path` is the camera's file relative to where
// the text is written; the measured middle of its sensor may be smaller.
THICKLENS_EXPORT std::string PlannedSimulationYaml(const PlanConditions& conditions,
                                                   const SweepDesign& design,
                                                   const std::string& camera_path);

// A table of the readings of the planned frames (image,reading_mm) for calibrate --readings, with
// depths from Ap in place of readings, and the file names of a simulation: frame_000.png.
THICKLENS_EXPORT std::string PlannedReadingsCsv(const SweepDesign& design);

}  // namespace thicklens

#endif  // THICKLENS_PLAN_H_
