// How far an axis can turn from rest to rest within its limits, in the units of Layout (one sample):
//   |theta_N - theta_0| <= sum over the samples of min(v, a k, a (N - k))
// by the trapezoidal rule without an error, since rates and accelerations keep to v and a at every sample.
// The tracking itself is no constraint, so that an end out of reach is what makes a problem infeasible.
#pragma once

#include <string>

#include "exactarm/ocp/stage_model.hpp"

namespace exactarm::ocp {

// Which axis cannot get from one end of z to the other in the time,
// and what it could do; empty: none is proven.
std::string out_of_reach(const StageModel& model, const double* z);

}  // namespace exactarm::ocp
