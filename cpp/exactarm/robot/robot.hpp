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

#include <limits>
#include <optional>
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
// As many coefficients as orders, checked where the table is made.
class GearTable {
 public:
  GearTable() = default;
  GearTable(Vector order, Vector a, Vector b);

  long size() const { return order_.size(); }
  const Vector& order() const { return order_; }
  const Vector& a() const { return a_; }
  const Vector& b() const { return b_; }
  // Whether the j-th order (from 1) is j times the first.
  bool multiples() const { return multiples_; }

 private:
  Vector order_, a_, b_;
  bool multiples_ = true;
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
  static constexpr double kNone = std::numeric_limits<double>::infinity();
  double q_min = -kNone, q_max = kNone, q_dot_max = kNone, q_ddot_max = kNone, torque_max = kNone;
};

// One axis and the link that it moves.
struct Joint {
  Frame frame;
  double q_offset = 0.0;
  Gear gear;
  Spring spring;
  Drive drive;
  Limits limits;
  std::optional<LinkInertia> link;  // none: its mass is not known
};

// What a robot is made of, still to be checked.
struct RobotDescription {
  std::vector<Joint> joints;
  Pose base;                        // robot base in the measuring device's frame
  Pose tool;                        // measured target in the flange frame
  Vector3 gravity = Vector3(0, 0, -9.81);  // in the robot base frame, m/s^2
};

// Checked once, when it is made, and never changed: one joint at least, every number finite (limits may be
// infinite), each sign +1 or -1, no gear ratio of 0, no empty range, masses of all links or of none.
class Robot {
 public:
  static constexpr long kMostAxes = 64;  // matrices of all pairs of axes stay below 1 MB a sample

  Robot(RobotDescription description);  // NOLINT: every description is a robot or is refused

  long axes() const { return static_cast<long>(description_.joints.size()); }
  const std::vector<Joint>& joints() const { return description_.joints; }
  const Joint& joint(long axis) const { return description_.joints[static_cast<std::size_t>(axis)]; }
  bool has_masses() const { return description_.joints.front().link.has_value(); }
  // Of a robot that has masses.
  const LinkInertia& link(long axis) const { return *joint(axis).link; }
  const Pose& base() const { return description_.base; }
  const Pose& tool() const { return description_.tool; }
  const Vector3& gravity() const { return description_.gravity; }

 private:
  RobotDescription description_;
};

}  // namespace exactarm
