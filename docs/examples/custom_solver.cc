// A solver of one's own: iterative back-projection. The error of the photograph that the light
// field would give is warped to the views and added.
//   custom_solver PHOTO.png DISPARITY.pfm LIGHT_FIELD
#include <thicklens/thicklens.h>

#include <iostream>
#include <memory>

class BackProjection : public thicklens::Solver {
 public:
  std::string Name() const override { return "back-projection"; }
  thicklens::LightField Solve(const thicklens::Problem& problem, const thicklens::RunControl& run,
                              thicklens::SolverSummary* summary) const override {
    auto light_field = problem.WarpToViews(run);
    for (int i = 0; i < 10; ++i) {
      thicklens::ThrowIfCancelled();
      auto error = problem.Photograph(light_field, run);
      for (std::size_t p = 0; p < error.values.size(); ++p)
        error.values[p] = problem.photograph().values[p] - error.values[p];
      const auto step = problem.WarpToViews(error, run);
      for (std::size_t p = 0; p < step.values.size(); ++p) light_field.values[p] += step.values[p];
    }
    summary->message = "10 steps";
    summary->converged = true;
    return light_field;
  }
};

int main(int argc, char** argv) {
  if (argc != 4) return 2;
  const auto photo = thicklens::ReadImage(argv[1]);
  const auto depth = thicklens::ReadDepth(argv[2], {thicklens::DepthKind::kDisparity});
  thicklens::EstimateOptions options;
  options.solver = std::make_shared<const BackProjection>();
  const auto estimate = thicklens::EstimateLightField(photo, depth, std::nullopt, options);
  thicklens::WriteLightField(argv[3], estimate);
  std::cout << estimate.summary.BriefReport() << '\n';
}
