#include "exactarm/robot/dynamics_model.hpp"

#include "exactarm/base/rotation.hpp"

namespace exactarm {
namespace {

// Inertia of a point mass m at c about the origin.
Matrix3 steiner(double mass, const Vector3& c) {
  return mass * (c.squaredNorm() * Matrix3::Identity() - c * c.transpose());
}

void require_masses(const Robot& robot) {
  require_size("links (masses are needed for dynamics)", robot.has_masses() ? robot.axes() : 0, robot.axes());
}

DynamicsAxis describe(const Frame& frame, const LinkInertia& link) {
  DynamicsAxis axis;
  axis.revolute = frame.type == JointType::revolute;
  axis.twisted = frame.beta != 0.0;
  axis.sign = frame.sign;
  axis.zero = frame.zero;
  axis.cos_zero = std::cos(frame.zero);
  axis.sin_zero = std::sin(frame.zero);
  axis.d = frame.d;
  axis.a = frame.a;
  axis.cos_alpha = std::cos(frame.alpha);
  axis.sin_alpha = std::sin(frame.alpha);
  axis.cos_beta = std::cos(frame.beta);
  axis.sin_beta = std::sin(frame.beta);
  const Matrix3 rotation = rotation_x(frame.alpha) * rotation_y(frame.beta);
  axis.mass = link.mass;
  axis.centre_of_mass = rotation * link.centre_of_mass + Vector3(frame.a, 0.0, frame.d);
  axis.first_moment = link.mass * axis.centre_of_mass;
  axis.central_inertia = rotation * link.inertia * rotation.transpose();
  axis.inertia = axis.central_inertia + steiner(link.mass, axis.centre_of_mass);
  return axis;
}

}  // namespace

DynamicsModel::DynamicsModel(const Robot& robot) : gravity(robot.gravity()) {
  require_masses(robot);
  for (long i = 0; i < robot.axes(); ++i) axes.push_back(describe(robot.joint(i).frame, robot.link(i)));
}

InertialParameters inertial_parameters(const LinkInertia& link) {
  const Matrix3 about_origin = link.inertia + steiner(link.mass, link.centre_of_mass);
  InertialParameters parameters;
  parameters << link.mass, link.mass * link.centre_of_mass, about_origin(0, 0), about_origin(0, 1),
      about_origin(0, 2), about_origin(1, 1), about_origin(1, 2), about_origin(2, 2);
  return parameters;
}

LinkInertia link_inertia(const InertialParameters& parameters) {
  LinkInertia link;
  link.mass = parameters[0];
  // A massless link has no centre of mass; its first moment must then be zero too.
  if (link.mass != 0.0) link.centre_of_mass = parameters.segment<3>(1) / link.mass;
  Matrix3 about_origin;
  about_origin << parameters[4], parameters[5], parameters[6],  //
      parameters[5], parameters[7], parameters[8],              //
      parameters[6], parameters[8], parameters[9];
  link.inertia = about_origin - steiner(link.mass, link.centre_of_mass);
  return link;
}

Vector inertial_parameters(const Robot& robot) {
  require_masses(robot);
  Vector parameters(kInertialParameters * robot.axes());
  for (long i = 0; i < robot.axes(); ++i)
    parameters.segment<kInertialParameters>(kInertialParameters * i) = inertial_parameters(robot.link(i));
  return parameters;
}

}  // namespace exactarm
