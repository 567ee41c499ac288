// Our own primal-dual interior-point solver of the transcription, on BlockKkt.
//   min scale f(z)  s.t.  r(z) = 0, defects = 0,  z - low = s_low > 0,  high - z = s_high > 0
// Newton on the perturbed first-order conditions with exact second derivatives; slacks of their own, so that
// the start need not lie within the bounds. Where the start lies well within them the barrier is small from
// the first step on, and the iteration is Newton's.
//
// One iteration, a file each: the first-order conditions (first_order.hpp), whether to end (ending.hpp), the
// step with its barrier (direction.hpp, barrier.hpp, block_kkt.hpp), and, where the equation of motion is not
// near its linearisation, how far to go (line_search.hpp, filter.hpp).
#pragma once

#include "exactarm/nlp/ipopt.hpp"
#include "exactarm/ocp/stage_model.hpp"

namespace exactarm::ocp {

struct StagewiseOptions {
  double tolerance = 1e-7;          // stationarity of the scaled problem
  double feasibility = 1e-11;       // equations and bounds, rad
  double objective = 1e-10;         // what the multipliers say the equations' residual does to it, relative
  double last_barrier = 1e-11;      // complementarity of the scaled problem
  double objective_scale = 0.0;     // 0: the start's objective becomes 100
  int iterations = 100;
  double seconds = 1e6;
  int hard_steps = 1 << 30;         // damped or shortened steps from a start well within all bounds
  const nlp::Solution* start = nullptr;  // of the same layout; null: the flat motion
};

// Multipliers in the order and sign of Transcription; of the scaled objective.
nlp::Solution solve_stagewise(const StageModel& model, const StagewiseOptions& options);

}  // namespace exactarm::ocp
