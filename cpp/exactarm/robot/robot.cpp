#include "exactarm/robot/robot.hpp"

namespace exactarm {
namespace {

struct Number {
  const char* name;
  double value;
};

void require_all_finite(const std::string& owner, std::initializer_list<Number> numbers) {
  for (const Number& number : numbers) require_finite(owner + ", " + number.name, number.value);
}

void require_entries(const std::string& name, const Eigen::Ref<const Matrix>& values) {
  for (long j = 0; j < values.cols(); ++j)
    for (long i = 0; i < values.rows(); ++i) require_finite(name, values(i, j));
}

void require_pose(const std::string& name, const Pose& pose) {
  require_entries(name + ", rotation", pose.rotation);
  require_entries(name + ", position", pose.position);
}

void require_frame(const std::string& name, const Frame& f) {
  if (std::abs(f.sign) != 1.0)
    throw InvalidArgument(name + ", sign: expected 1 or -1, found " + std::to_string(f.sign));
  require_all_finite(name, {{"zero", f.zero}, {"d", f.d}, {"a", f.a}, {"alpha", f.alpha}, {"beta", f.beta}});
}

void require_finite_table(const std::string& name, const GearTable& table) {
  require_entries(name + ", order", table.order());
  require_entries(name + ", a", table.a());
  require_entries(name + ", b", table.b());
}

void require_friction(const std::string& name, const Friction& f) {
  require_all_finite(name, {{"coulomb", f.coulomb},
                            {"viscous", f.viscous},
                            {"stribeck", f.stribeck},
                            {"stribeck_velocity", f.stribeck_velocity}});
}

void require_limits(const std::string& name, const Limits& limits) {
  if (!(limits.q_min <= limits.q_max))
    throw InvalidArgument(name + ": expected q_min <= q_max, found " + std::to_string(limits.q_min) +
                          " and " + std::to_string(limits.q_max));
  const Number numbers[] = {{"q_dot_max", limits.q_dot_max},
                            {"q_ddot_max", limits.q_ddot_max},
                            {"torque_max", limits.torque_max}};
  for (const Number& number : numbers)
    if (!(number.value >= 0.0))
      throw InvalidArgument(name + ", " + number.name + ": expected at least 0, found " +
                            std::to_string(number.value));
}

void require_joint(const std::string& name, const Joint& joint) {
  require_frame(name, joint.frame);
  if (joint.gear.ratio == 0.0) throw InvalidArgument(name + ", ratio: expected any number but 0");
  require_all_finite(name, {{"q_offset", joint.q_offset},
                            {"ratio", joint.gear.ratio},
                            {"spring, linear", joint.spring.linear},
                            {"spring, cubic", joint.spring.cubic},
                            {"rotor_inertia", joint.drive.rotor_inertia}});
  require_finite_table(name + ", gear cw", joint.gear.cw);
  require_finite_table(name + ", gear ccw", joint.gear.ccw);
  require_friction(name + ", friction of the joint", joint.drive.joint);
  require_friction(name + ", friction of the motor", joint.drive.motor);
  require_limits("limits of " + name, joint.limits);
  if (!joint.link) return;
  require_finite("mass of link " + name, joint.link->mass);
  require_entries("centre of mass of link " + name, joint.link->centre_of_mass);
  require_entries("inertia of link " + name, joint.link->inertia);
}

}  // namespace

GearTable::GearTable(Vector order, Vector a, Vector b)
    : order_(std::move(order)), a_(std::move(a)), b_(std::move(b)) {
  require_size("coefficients a of a gear table", a_.size(), order_.size());
  require_size("coefficients b of a gear table", b_.size(), order_.size());
  for (long j = 1; j < size(); ++j) multiples_ &= order_[j] == static_cast<double>(j + 1) * order_[0];
}

Robot::Robot(RobotDescription description) : description_(std::move(description)) {
  const std::vector<Joint>& joints = description_.joints;
  if (joints.empty() || axes() > kMostAxes)
    throw InvalidArgument("joints of a robot: found " + std::to_string(joints.size()) + ", expected 1 to " +
                          std::to_string(kMostAxes));
  for (std::size_t i = 0; i < joints.size(); ++i) {
    const std::string name = "joint " + std::to_string(i + 1);
    require_joint(name, joints[i]);
    if (joints[i].link.has_value() != joints[0].link.has_value())
      throw InvalidArgument("masses: known of some links only (" + name +
                            " differs from joint 1), expected all or none");
  }
  require_pose("base", description_.base);
  require_pose("tool", description_.tool);
  require_entries("gravity", description_.gravity);
}

}  // namespace exactarm
