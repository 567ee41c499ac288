// Rigid dynamics on the link side, without friction (thesis (2.6)):
//   tau = D(q) qdd + C(q, qd) qd + g(q)
// by recursive Newton-Euler in the axis frames (Luh, Walker and Paul 1980), D by composite
// inertias (Walker and Orin 1982), g and dg/dq from the composite first moments.
//
// q, qd, qdd in rad (m), rad/s, rad/s^2; tau in Nm (N). Batches hold one sample a row, N x n, and
// pass eight rows at a time through the SIMD lanes.
//
// With a model and a workspace nothing is allocated. The functions of a Robot are for occasional use.
#pragma once

#include <vector>

#include "exactarm/base/lanes.hpp"
#include "exactarm/robot/axis_frames.hpp"
#include "exactarm/robot/dynamics_model.hpp"

namespace exactarm {

template <class T>
class DynamicsWorkspaceOf {
 public:
  explicit DynamicsWorkspaceOf(const DynamicsModel& model);

  std::vector<T> q, q_dot, q_ddot, result;      // the sample: n, n, n, and up to n n results
  std::vector<T> angle, sine, cosine;           // n
  std::vector<spatial::Wrench<T>> wrench;       // n, on link i at A_i
  std::vector<AxisPose<T>> pose;                // n
  std::vector<spatial::Twist<T>> joint;         // n, S_i
};

using DynamicsWorkspace = DynamicsWorkspaceOf<double>;

void inverse_dynamics(const DynamicsModel& model, DynamicsWorkspace& workspace, ConstVectorRef q,
                      ConstVectorRef q_dot, ConstVectorRef q_ddot, VectorRef tau);
void gravity_torque(const DynamicsModel& model, DynamicsWorkspace& workspace, ConstVectorRef q,
                    VectorRef tau);
void mass_matrix(const DynamicsModel& model, DynamicsWorkspace& workspace, ConstVectorRef q, MatrixRef D);

// Energy of the rigid robot in J: 1/2 qd' D qd, and -sum m gravity . c (zero at the base frame's origin).
struct RigidEnergy {
  double kinetic, potential;
};
RigidEnergy rigid_energy(const DynamicsModel& model, DynamicsWorkspace& workspace, ConstVectorRef q,
                         ConstVectorRef q_dot);

Vector inverse_dynamics(const Robot& robot, ConstVectorRef q, ConstVectorRef q_dot, ConstVectorRef q_ddot);
Vector gravity_torque(const Robot& robot, ConstVectorRef q);
Matrix gravity_torque_jacobian(const Robot& robot, ConstVectorRef q);
Matrix mass_matrix(const Robot& robot, ConstVectorRef q);

// Rows: tau N x n.
void inverse_dynamics_batch(const DynamicsModel& model, ConstRowMatrixRef q, ConstRowMatrixRef q_dot,
                            ConstRowMatrixRef q_ddot, double* tau, int threads);
void gravity_torque_batch(const DynamicsModel& model, ConstRowMatrixRef q, double* tau, int threads);
// N x n x n, [row, i, j] = dg_i/dq_j (symmetric).
void gravity_torque_jacobian_batch(const DynamicsModel& model, ConstRowMatrixRef q, double* jacobian,
                                   int threads);
// N x n x n.
void mass_matrix_batch(const DynamicsModel& model, ConstRowMatrixRef q, double* D, int threads);

}  // namespace exactarm
