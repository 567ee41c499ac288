// A robot with elastic joints between motors and links (thesis (2.22), (2.23); signs and gear ratio by E4):
//   link:   D qdd + C qd + g + [U thetadd + C_1 thetad] + tau_fJ(qd)       = kappa(phi - q) + tau_ext
//   motor:  D_M thetadd     + [U' qdd + C_2 qd]         + tau_fM(thetad)   = tau_d - kappa(phi - q) / u(phi)
//   phi = Xi^{-1}(theta),  kappa(phi - q) short for kappa(phi + q_offset - q)
// The bracketed coupling of rotors and links is in the full model (2.22) and left out of the simplified
// (2.23). tau_d, D_M and theta are those of the motor shaft. Motor friction is declared on the output side,
// of thetad / ratio, and acts at the shaft divided by the ratio. One gear table an axis holds throughout:
// which, the caller says by direction; without friction and inputs the energy is then constant.
//
// State x = (q, qd, theta, thetad), 4 n; acceleration a = (qdd, thetadd), 2 n. rad, s, Nm, J.
// Limits: every axis has a spring and a rotor inertia.
#pragma once

#include <Eigen/Cholesky>
#include <vector>

#include "exactarm/robot/dynamics.hpp"
#include "exactarm/robot/dynamics_derivatives.hpp"
#include "exactarm/robot/rotor_coupling.hpp"

namespace exactarm {

struct ElasticJointOptions {
  bool rotor_coupling = false;        // true: (2.22), false: (2.23)
  std::vector<int> gear_direction;    // -1 cw, 1 ccw, 0 mean of both; empty: 0 for all axes
  double friction_width = 0.02;       // rad/s, of tanh; 0: exact sign
};

class ElasticJointModel {
 public:
  explicit ElasticJointModel(const Robot& robot, const ElasticJointOptions& options = {});

  int size() const { return rigid.size(); }

  DynamicsModel rigid;
  ElasticJointOptions options;
  std::vector<Spring> springs;
  std::vector<Drive> drives;
  std::vector<double> ratios, offsets;
  std::vector<GearTable> tables;
};

struct ElasticJointEnergy {
  double kinetic, gravity, spring;
  double total() const { return kinetic + gravity + spring; }
};

// (2.22) as matrices: D xidd + C xid + g = generalised forces, xi = (q, theta), without friction. C by
// Christoffel symbols (2.7), (2.8), so D_dot - 2 C is skew. (Where the source writes C_E(q, qd), half of the
// forces of C_1 thetad stand in C_E here, which then depends on thetad too.) g includes the springs.
struct ElasticJointMatrices {
  explicit ElasticJointMatrices(long n);
  Matrix D, C;
  Vector g;
};

class ElasticJointDynamics {
 public:
  explicit ElasticJointDynamics(const ElasticJointModel& model);
  long size() const { return n_; }

  // tau_ext (n) and tau_d (n, at the shaft) that state and acceleration need, stacked.
  void inverse(ConstVectorRef x, ConstVectorRef a, VectorRef torques);
  // The same with its slopes: by_state 2 n x 4 n, by_acceleration 2 n x 2 n (the mass matrix).
  void inverse(ConstVectorRef x, ConstVectorRef a, VectorRef torques, MatrixRef by_state,
               MatrixRef by_acceleration);

  // Accelerations under torques (tau_ext, tau_d), stacked.
  void forward(ConstVectorRef x, ConstVectorRef torques, VectorRef a);
  // d xdot / dx, 4 n x 4 n, for an integrator; `a` as forward() gave it.
  void rate_jacobian(ConstVectorRef x, ConstVectorRef a, MatrixRef jacobian);

  ElasticJointEnergy energy(ConstVectorRef x);
  void matrices(ConstVectorRef x, ElasticJointMatrices& out);

 private:
  struct JointState {  // gear and spring of one axis at one state
    double torque, stiffness, ratio, ratio_slope;
  };
  void check(ConstVectorRef x, ConstVectorRef second) const;
  JointState joint(int i, double q, double theta) const;
  double output_angle(int i, double theta) const;
  void add_drives(ConstVectorRef x, ConstVectorRef a, VectorRef torques);
  void mass(ConstVectorRef q, MatrixRef D);

  const ElasticJointModel* model_;
  long n_;
  DynamicsWorkspace rigid_;
  DerivativesWorkspace derivatives_;
  DynamicsDerivatives slopes_;
  RotorCoupling rotors_;
  RotorCoupling::Slopes rotor_slopes_;
  Vector zero_, link_, motor_, at_rest_;
  Matrix coupling_, C_1_, C_2_, mass_, by_state_, by_acceleration_;
  Eigen::LLT<Matrix> factor_;
};

}  // namespace exactarm
