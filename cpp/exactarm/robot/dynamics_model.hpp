// What the dynamics of one robot need, computed once: the immutable description that the
// recursions read (they write only to a workspace).
//
// Axis frame A_i: its z is joint axis i, it moves with link i, and link frame i (DH) is fixed in it:
//   A_i = F_{i-1} Rot_z(sign q + zero)                   (revolute)
//   A_i = F_{i-1} Rot_z(zero) Trans_z(sign q)            (prismatic)
//   F_i = A_i K_i,  K_i = Trans_z(d) Trans_x(a) Rot_x(alpha) Rot_y(beta)
// Link masses are re-expressed in A_i, where the joint's motion is a unit vector.
//
// Limits: a serial chain of revolute and prismatic axes, rigid links; the placement robot.base
// does not matter here, robot.gravity is in the robot's own base frame. Friction, gears and
// rotors are not in it.
#pragma once

#include <vector>

#include "exactarm/robot/robot.hpp"

namespace exactarm {

struct DynamicsAxis {
  bool revolute = true, twisted = false;  // twisted: beta is not zero
  double sign = 1.0, zero = 0.0, cos_zero = 1.0, sin_zero = 0.0;
  double d = 0.0, a = 0.0;
  double cos_alpha = 1.0, sin_alpha = 0.0, cos_beta = 1.0, sin_beta = 0.0;
  // Of link i in A_i: mass, first moment, inertia about the origin of A_i; centre of mass, inertia about it.
  double mass = 0.0;
  Vector3 first_moment = Vector3::Zero(), centre_of_mass = Vector3::Zero();
  Matrix3 inertia = Matrix3::Zero(), central_inertia = Matrix3::Zero();
};

class DynamicsModel {
 public:
  explicit DynamicsModel(const Robot& robot);

  int size() const { return static_cast<int>(axes.size()); }

  std::vector<DynamicsAxis> axes;
  Vector3 gravity;
};

// pi_i = (m, m cx, m cy, m cz, Ixx, Ixy, Ixz, Iyy, Iyz, Izz), inertia about the origin of link frame i.
constexpr int kInertialParameters = 10;
using InertialParameters = Eigen::Matrix<double, kInertialParameters, 1>;

InertialParameters inertial_parameters(const LinkInertia& link);
LinkInertia link_inertia(const InertialParameters& parameters);

// pi of all links, 10 n.
Vector inertial_parameters(const Robot& robot);

}  // namespace exactarm
