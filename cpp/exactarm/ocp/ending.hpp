// When the stage-wise solver ends, and how: the point is good enough, or more steps would not help.
// Where bounds stay violated while their multipliers grow without limit or steps become too short, the
// problem is called infeasible only if an axis provably cannot get from one end to the other (reach.hpp).
#pragma once

#include "exactarm/ocp/first_order.hpp"
#include "exactarm/ocp/stagewise.hpp"

namespace exactarm::ocp {

class Ending {
 public:
  // `inside`: the start lies well within all bounds.
  Ending(const StageModel& model, const StagewiseOptions& options, bool inside);

  // After a step of `length` (share of the Newton step); hard: damped or shortened.
  void count_step(double length, bool hard);

  // Whether to end at the point; then status and message say how. `objective` scaled.
  bool reached(const KktVector& point, const FirstOrder& conditions, const Barrier& barrier, double objective,
               nlp::Solution& solution);

 private:
  std::string describe(long index, bool at_low, double violation) const;

  const StageModel& model_;
  const StagewiseOptions& options_;
  bool inside_;
  int stalled_ = 0, hard_steps_ = 0, rounded_ = 0;
};

}  // namespace exactarm::ocp
