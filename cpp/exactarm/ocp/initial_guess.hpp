// The start of the solvers, by flatness: with q = q_d the equation of motion gives the motor angle,
//   theta = Xi(q_d + kappa^{-1}(D qdd_d + C qd_d + g))
// and its rates follow by differences of fourth order over the samples. Without active bounds and as nu
// goes to 0 this is the solution but for the error of the differences.
#pragma once

#include "exactarm/ocp/stage_model.hpp"

namespace exactarm::ocp {

// z_k at rest on the reference, (4.3e)-(4.3j); blocks n numbers.
void rest(const StageModel& model, long knot, double* z_k);

// z: N x (blocks n), both ends at rest.
void initial_guess(const StageModel& model, double* z);

// d(order) of samples in units of one sample, order 1 to 3; rows x n in strided memory.
void differences(const double* samples, long rows, int columns, long stride, int order, double* out,
                 long out_stride);

}  // namespace exactarm::ocp
