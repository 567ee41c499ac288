#include "exactarm/ocp/line_search.hpp"

namespace exactarm::ocp {

LineSearch::LineSearch(const StageModel& model, const Objective& objective, double scale, long searches)
    : model_(model),
      objective_(objective),
      scale_(scale),
      filter_(searches),
      trial_(model.layout().unknowns()),
      trial_residual_(model.layout().knots * model.layout().axes) {}

double LineSearch::accepted_length(const KktVector& point, const KktVector& residual, const KktVector& step,
                                   double longest, StageWorkspace& workspace) {
  const double gaps = residual.defect.lpNorm<1>();
  filter_.add({scale_ * objective_.value(point.z.data()), residual.stage.lpNorm<1>() + gaps});
  double length = longest;
  for (int halving = 0; halving < kMostHalvings; ++halving, length *= 0.5) {
    trial_ = point.z + length * step.z;
    model_.residual(trial_.data(), workspace, trial_residual_.data());
    const double violation = trial_residual_.lpNorm<1>() + (1.0 - length) * gaps;
    if (filter_.accepts({scale_ * objective_.value(trial_.data()), violation})) break;
  }
  return length;
}

}  // namespace exactarm::ocp
