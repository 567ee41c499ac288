// The dynamics as a linear function of the inertial parameters:
//   tau = Y(q, qd, qdd) pi,   pi = (pi_1, ..., pi_n), ten numbers a link (dynamics_model.hpp)
// Y is N x n x 10 n, one sample a row of the inputs; block (j, i) is zero for i < j.
// Atkeson, An and Hollerbach (1986); the masses declared in the robot are not used.
#pragma once

#include "exactarm/robot/robot.hpp"

namespace exactarm {

void dynamics_regressor_batch(const Robot& robot, ConstRowMatrixRef q, ConstRowMatrixRef q_dot,
                              ConstRowMatrixRef q_ddot, double* Y, int threads);

Matrix dynamics_regressor(const Robot& robot, ConstVectorRef q, ConstVectorRef q_dot, ConstVectorRef q_ddot);

}  // namespace exactarm
