// Inertia coupling of spinning rotors and moving links (thesis (2.21), (2.22)): rotor i sits on link i-1 and
// turns by theta_i about joint axis i, in the sense of q_i (e_i = sign z_i, in the base frame). With spin
// inertia J_i its angular momentum along e_i is J_i (thetad_i + e_i . w_{i-1}); the link masses are taken to
// hold the rotors at rest on their links, so what is added to the kinetic energy is
//   qd' U thetad + 1/2 thetad' D_M thetad,   U(j, i) = J_i e_i . dw_{i-1}/dqd_j  (j < i, revolute j)
// In Newton-Euler terms: rotor i loads link i-1 with the couple J_i (thetadd_i e_i + thetad_i w_{i-1} x e_i),
// and feels J_i e_i . dw_{i-1}/dt.
// kg m^2 (motor shaft), rad/s, Nm. De Luca and Book, Springer Handbook of Robotics (2016), chapter 11.
#pragma once

#include <vector>

#include "exactarm/robot/axis_frames.hpp"

namespace exactarm {

class RotorCoupling {
 public:
  RotorCoupling(const DynamicsModel& model, std::vector<double> rotor_inertia);

  // Places the axes; everything below refers to this configuration.
  void place(const double* q);

  // U(q), n x n, strictly upper triangular.
  void inertia(MatrixRef U) const;

  // Link torques `on_joint` and shaft torques `on_motor` of the coupling (D_M thetadd itself is not in it).
  void torques(const double* q_dot, const double* q_ddot, const double* theta_dot, const double* theta_ddot,
               VectorRef on_joint, VectorRef on_motor);

  // Slopes of these at the states of the last call of `torques`: n x n, columns q, q_dot, theta_dot.
  struct Slopes {
    explicit Slopes(long n);
    Matrix joint_by_q, joint_by_q_dot, joint_by_theta_dot, motor_by_q, motor_by_q_dot;
  };
  void slopes(Slopes& out) const;

  // Christoffel blocks (2.7), (2.8) of U: link rows by qd (from thetad),
  // by thetad (C_1); motor rows by qd (C_2).
  void christoffel(const double* q_dot, const double* theta_dot, MatrixRef link, MatrixRef C_1,
                   MatrixRef C_2) const;

 private:
  const DynamicsModel* model_;
  std::vector<double> rotor_inertia_;
  std::vector<double> angle_, sine_, cosine_;
  std::vector<AxisPose<double>> pose_;
  std::vector<Vector3> axis_;       // e_i
  std::vector<Vector3> turn_;       // e_i of a revolute axis, 0 of a prismatic one
  std::vector<Vector3> rate_, acceleration_;  // w_{i-1} and its derivative, with w_n at the end
  std::vector<Vector3> turn_rate_;  // psi' = d turn_i / dt
  std::vector<Vector3> spin_, couple_;  // sums over rotors i > k of J thetad e, and of the couples
};

}  // namespace exactarm
