#include "tools/bench/cost_plans.h"

#include <algorithm>
#include <string>

#include "thicklens/estimator/block_solver.h"
#include "tools/bench/bench_parts.h"
#include "tools/bench/bench_solvers.h"

namespace thicklens::tools {
namespace {

using estimator::BlockSolver;

class PlanList {
 public:
  void Add(const estimator::EstimatePlan& plan) {
    const std::string name = estimator::PlanName(plan);
    const bool is_there = std::any_of(
        plans_.begin(), plans_.end(),
        [&](const estimator::EstimatePlan& other) { return estimator::PlanName(other) == name; });
    if (!is_there) plans_.push_back(plan);
  }
  void AddWithTolerance(estimator::EstimatePlan plan, double tolerance) {
    plan.tolerance = tolerance;
    Add(plan);
  }
  std::vector<estimator::EstimatePlan> Take() { return std::move(plans_); }

 private:
  std::vector<estimator::EstimatePlan> plans_;
};

// The tolerances range from one that hardly solves anything to one below the resolution of float.
const std::vector<double>& Tolerances() {
  static const std::vector<double> tolerances = {0.1, 0.01, 0.001, 1e-4, 1e-6};
  return tolerances;
}

bool IsScene(const estimator::EstimatePlan& plan) { return plan.solver == "scene"; }

std::vector<estimator::EstimatePlan> BlockPlans() {
  std::vector<estimator::EstimatePlan> plans;
  for (const BlockSolver solver : estimator::BuiltInBlockSolvers()) {
    plans.push_back(SourcePlan(solver));
  }
  return plans;
}

// Varies one choice at a time; all others have their defaults.
void AddVariations(bool opencl, PlanList* list) {
  for (estimator::EstimatePlan plan : WholeImagePlans()) {
    const bool is_usual = plan.prior == "tv" || plan.prior == "patches";
    if (IsScene(plan) && !is_usual) continue;
    for (const double tolerance : {0.1, 0.01, 1e-6}) list->AddWithTolerance(plan, tolerance);
    estimator::EstimatePlan changed = plan;
    changed.double_precision = true;
    list->Add(changed);
    if (!IsScene(plan) || !opencl) continue;
    plan.on_opencl = true;
    list->Add(plan);
  }
  for (const estimator::EstimatePlan& plan : BlockPlans()) list->Add(plan);
  const estimator::EstimatePlan usual = SourcePlan(estimator::DefaultBlockSolver());
  for (const int block_px : {kSourceBlockPx / 2, 2 * kSourceBlockPx}) {
    estimator::EstimatePlan plan = usual;
    plan.block_px = block_px;
    list->Add(plan);
  }
  list->AddWithTolerance(SourcePlan(BlockSolver::kCg), 0.01);
  if (opencl) {
    estimator::EstimatePlan plan = usual;
    plan.on_opencl = true;
    list->Add(plan);
  }
}

// Combines every choice with every other.
void AddProduct(bool opencl, PlanList* list) {
  for (const estimator::EstimatePlan& base : WholeImagePlans()) {
    for (const bool on_opencl : {false, true}) {
      if (on_opencl && (!IsScene(base) || !opencl)) continue;
      for (const bool double_precision : {false, true}) {
        estimator::EstimatePlan plan = base;
        plan.on_opencl = on_opencl;
        plan.double_precision = double_precision;
        list->Add(plan);
        for (const double tolerance : Tolerances()) list->AddWithTolerance(plan, tolerance);
      }
    }
  }
  for (estimator::EstimatePlan plan : BlockPlans()) {
    const bool is_iterative =
        estimator::IsIterative(estimator::BlockSolverFromName(plan.block_solver));
    for (const int block_px : {kSourceBlockPx / 2, kSourceBlockPx, 2 * kSourceBlockPx}) {
      plan.block_px = block_px;
      for (const bool on_opencl : {false, true}) {
        if (on_opencl && (!opencl || plan.block_solver == "viennacl")) continue;
        plan.on_opencl = on_opencl;
        list->Add(plan);
        if (!is_iterative) continue;
        for (const double tolerance : Tolerances()) list->AddWithTolerance(plan, tolerance);
      }
    }
  }
}

}  // namespace

std::vector<estimator::EstimatePlan> PlansOf(const PlanGrid& grid) {
  PlanList list;
  for (const estimator::EstimatePlan& plan : WholeImagePlans()) list.Add(plan);
  if (grid.base_only) return list.Take();
  if (grid.full) {
    AddProduct(grid.opencl, &list);
  } else {
    AddVariations(grid.opencl, &list);
  }
  return list.Take();
}

}  // namespace thicklens::tools
