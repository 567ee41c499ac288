// A serial robot: the immutable description that every computation reads.
//
//   theta --gear--> phi --+ q_offset, spring--> q --geometry--> flange
//   theta = Xi(phi),  q = phi + q_offset - kappa^{-1}(torque)
//
// Frame i follows modified Denavit-Hartenberg parameters with Hayati's beta (thesis (2.2),
// (2.3), corrected by E1):
//   T_i = Rot_z(sign q + zero) Trans_z(d) Trans_x(a) Rot_x(alpha) Rot_y(beta)
// for a revolute axis; a prismatic axis moves along z: Rot_z(zero) Trans_z(sign q + d) ...
// At (nearly) parallel axes `beta` is a parameter and `d` is not (Hayati and Mirmirani 1985).
//
// Units: m, rad, kg, Nm, s.
#pragma once

#include <vector>

#include "exactarm/base/check.hpp"
#include "exactarm/base/types.hpp"

namespace exactarm {

enum class JointType { revolute, prismatic };

struct Frame {
  JointType type = JointType::revolute;
  double sign = 1.0;
  double zero = 0.0;  // rad, DH angle at q = 0
  double d = 0.0, a = 0.0, alpha = 0.0, beta = 0.0;
};

// Mass properties of link i in DH frame i, inertia about the centre of mass.
struct LinkInertia {
  double mass = 0.0;
  Vector3 centre_of_mass = Vector3::Zero();
  Matrix3 inertia = Matrix3::Zero();
};

// u(phi) = ratio (1 + sum_j a_j cos(w_j phi) - b_j sin(w_j phi)), E5; w in cycles per output revolution.
struct GearTable {
  Vector order, a, b;
};

struct Gear {
  double ratio = 1.0;
  GearTable cw, ccw;  // cw: the motor angle falls
};

// kappa(e) = linear e + cubic e^3, e = phi + q_offset - q; linear = 0 means a rigid joint.
struct Spring {
  double linear = 0.0, cubic = 0.0;
};

struct Friction {
  double coulomb = 0.0;           // Nm
  double viscous = 0.0;           // Nm s
  double stribeck = 0.0;          // Nm, breakaway above Coulomb
  double stribeck_velocity = 1.0; // rad/s
};

struct Drive {
  double rotor_inertia = 0.0;  // kg m^2, about the motor shaft
  Friction joint;              // link side, of q_dot
  Friction motor;              // output-side units, of theta_dot / ratio
};

struct Limits {
  double q_min, q_max, q_dot_max, q_ddot_max, torque_max;
};

struct Robot {
  std::vector<Frame> frames;
  std::vector<double> q_offset;
  std::vector<LinkInertia> links;   // empty: no masses declared
  std::vector<Gear> gears;
  std::vector<Spring> springs;
  std::vector<Drive> drives;
  std::vector<Limits> limits;
  Pose base;                        // robot base in the measuring device's frame
  Pose tool;                        // measured target in the flange frame
  Vector3 gravity = Vector3(0, 0, -9.81);  // in the robot base frame, m/s^2

  long axes() const { return static_cast<long>(frames.size()); }
};

}  // namespace exactarm
