// Inverse dynamics tau(q, qd, qdd) of dynamics.hpp with its first derivatives, and the second
// derivatives contracted with a multiplier: the Hessian of the scalar
//   phi = lambda' tau = sum_i w_i . f_i,   w_i = twist of link i at joint rates lambda,
//                                          f_i = I_i a_i + v_i x* I_i v_i
// All in the robot's base frame, where a variation of joint j changes every link outboard alike:
// (dv, da + v x dv, dw) = (psi', psi'', chi) for q_j, (S, 2 psi', 0) for qd_j, (0, S, 0) for qdd_j, (0, 0, S)
// for lambda_j, with psi' = v x S, psi'' = a x S + v x psi', chi = w x S. So every entry (j, k) of a first or
// second derivative is a dot product of these twists of axis j <= k with one of seven wrenches of axis k,
// made of the composite inertia, its rates along v and along w, and the composite momenta and forces.
// Cost O(n) recursions and 17 dot products a pair; no tensor is formed. Nothing is allocated.
//
// First derivatives: Carpentier and Mansard (2018); second:
// Singh, Russell and Wensing (2022), here contracted.
//
// One sample: the axes go through the SIMD lanes together. A batch: eight knots do. One source for both.
// q, qd, qdd in rad (m), rad/s, rad/s^2; tau in Nm (N). Matrices n x n, column major;
// q_q_dot(i, j) = d2 phi / dq_i dqd_j. The blocks (qd, qdd) and (qdd, qdd) are zero.
#pragma once

#include <vector>

#include "exactarm/robot/dynamics_model.hpp"
#include "exactarm/robot/lane_layout.hpp"
#include "exactarm/robot/axis_frames.hpp"

namespace exactarm {

struct DynamicsDerivatives {
  explicit DynamicsDerivatives(int axes);

  Vector tau;
  Matrix dtau_dq, dtau_dq_dot, mass_matrix;  // mass_matrix = dtau / dqdd
  Matrix q_q, q_q_dot, q_dot_q_dot, q_q_ddot;
};

class DerivativesWorkspace;
class KnotWorkspace;

// Per axis what the recursion reads of the model, in lanes: turn = sign of a revolute axis or 0, slide alike.
struct LinkLanes {
  Lanes turn, slide, mass;
  spatial::Vec3<Lanes> centre;
  spatial::Sym3<Lanes> central;
};

// Kinematic quantities of a block of axes.
struct MotionLanes {
  AxisPose<Lanes> pose;
  spatial::Twist<Lanes> joint, psi_dot, psi_ddot, chi;  // S, psi', psi'', chi
  spatial::Twist<Lanes> rate, acceleration, weight;     // v, a, w
};

template <class Layout>
struct DerivativesMemory {
  explicit DerivativesMemory(const DynamicsModel& model);

  std::vector<LinkLanes> links;
  std::vector<MotionLanes> motion;
  std::vector<Lanes> q_dot, q_ddot, lambda;                      // one a block
  std::vector<typename Layout::Value> q, angle, sine, cosine;    // n
  std::vector<AxisPose<typename Layout::Value>> pose;            // n
  std::vector<Lanes> torque, results;                            // before they are put in the caller's order
};

class DerivativesWorkspace : public DerivativesMemory<AxesInLanes> {
 public:
  using DerivativesMemory::DerivativesMemory;
};

class KnotWorkspace : public DerivativesMemory<SamplesInLanes> {
 public:
  using DerivativesMemory::DerivativesMemory;
};

// tau and first derivatives only.
void inverse_dynamics_derivatives(const DynamicsModel& model, DerivativesWorkspace& workspace,
                                  ConstVectorRef q, ConstVectorRef q_dot, ConstVectorRef q_ddot,
                                  DynamicsDerivatives& out);

// All of it.
void inverse_dynamics_second_derivatives(const DynamicsModel& model, DerivativesWorkspace& workspace,
                                         ConstVectorRef q, ConstVectorRef q_dot, ConstVectorRef q_ddot,
                                         ConstVectorRef lambda, DynamicsDerivatives& out);

// Coriolis matrix by Christoffel symbols (2.7), (2.8): C(k, j) = sum_i c_ijk qd_i = 1/2 dtau_k / dqd_j;
// D_dot - 2 C is skew.
Matrix coriolis_matrix(const Robot& robot, ConstVectorRef q, ConstVectorRef q_dot);

// Many knots: inputs n numbers a knot, contiguous; tau n, matrices n x n (column major) a knot.
// lambda null: no second derivatives. An output that is null is not written.
struct KnotBatch {
  long knots = 0;
  const double *q = nullptr, *q_dot = nullptr, *q_ddot = nullptr, *lambda = nullptr;
  double *tau = nullptr, *dtau_dq = nullptr, *dtau_dq_dot = nullptr, *mass_matrix = nullptr;
  double *q_q = nullptr, *q_q_dot = nullptr, *q_dot_q_dot = nullptr, *q_q_ddot = nullptr;
};

// Knots [first, last) of the batch, with a workspace: nothing is allocated; for a caller's own threads.
void inverse_dynamics_knots(const DynamicsModel& model, KnotWorkspace& workspace, const KnotBatch& batch,
                            long first, long last);

void inverse_dynamics_knots(const DynamicsModel& model, const KnotBatch& batch, int threads);

}  // namespace exactarm
