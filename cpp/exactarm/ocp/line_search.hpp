// How far to go along a Newton step: it is halved until the filter accepts the point.
// The defects are linear in z, so that they shrink by the share of the step; the equation of motion is
// evaluated.
#pragma once

#include "exactarm/ocp/block_kkt.hpp"
#include "exactarm/ocp/filter.hpp"
#include "exactarm/ocp/objective.hpp"

namespace exactarm::ocp {

class LineSearch {
 public:
  static constexpr int kMostHalvings = 12;

  // At most `searches` calls of accepted_length; `scale` of the objective.
  LineSearch(const StageModel& model, const Objective& objective, double scale, long searches);

  // Share of `step` from `point`, where the equations leave `residual`; at most `longest`. The shortest is
  // taken in any case. The point enters the filter.
  double accepted_length(const KktVector& point, const KktVector& residual, const KktVector& step,
                         double longest, StageWorkspace& workspace);

 private:
  const StageModel& model_;
  const Objective& objective_;
  double scale_;
  Filter filter_;
  Vector trial_, trial_residual_;
};

}  // namespace exactarm::ocp
