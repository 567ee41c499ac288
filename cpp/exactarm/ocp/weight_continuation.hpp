// Solutions followed from a small weight of the input up to the one that is asked for.
//   nu_0 << nu,  nu_{j+1} = factor nu_j,  each solved from the one before
// As nu goes to 0 the flat motion is the solution, so that a small weight is within the reach of Newton's
// method from there. A large one moves the flange by millimetres and more, where the reduced Hessian is
// indefinite: on the way it is met at points where it is not,
// and the answer is the one that hangs together with exact tracking.
#pragma once

#include <functional>

#include "exactarm/nlp/ipopt.hpp"
#include "exactarm/ocp/problem.hpp"

namespace exactarm::ocp {

// Solves a problem from a start (null: the flat motion); `last`: to the end, and not only near to it.
using Attempt = std::function<nlp::Solution(const Problem&, const nlp::Solution* start, bool last)>;

// `failed`: how the direct attempt ended;
// given back where the path cannot be followed. Iterations are those of all attempts.
nlp::Solution continue_weight(const Problem& problem, const nlp::Solution& failed, const Attempt& attempt);

}  // namespace exactarm::ocp
