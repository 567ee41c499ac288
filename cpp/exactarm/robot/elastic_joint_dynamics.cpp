#include "exactarm/robot/elastic_joint_dynamics.hpp"

#include "exactarm/robot/elasticity.hpp"
#include "exactarm/robot/friction.hpp"
#include "exactarm/robot/gear.hpp"

namespace exactarm {
namespace {

std::vector<double> rotor_inertias(const std::vector<Drive>& drives) {
  std::vector<double> values;
  for (const Drive& drive : drives) values.push_back(drive.rotor_inertia);
  return values;
}

}  // namespace

ElasticJointModel::ElasticJointModel(const Robot& robot, const ElasticJointOptions& chosen)
    : rigid(robot), options(chosen) {
  const long n = robot.axes();
  if (options.gear_direction.empty()) options.gear_direction.assign(n, 0);
  require_size("gear_direction", static_cast<long>(options.gear_direction.size()), n);
  for (long i = 0; i < n; ++i) {
    const Joint& joint = robot.joint(i);
    const std::string name = "joint " + std::to_string(i + 1);
    require_positive("spring of " + name + ", linear", joint.spring.linear);
    require_spring("spring of " + name, joint.spring);
    require_positive("rotor inertia of " + name, joint.drive.rotor_inertia);
    springs.push_back(joint.spring);
    drives.push_back(joint.drive);
    offsets.push_back(joint.q_offset);
    ratios.push_back(joint.gear.ratio);
    tables.push_back(gear_table(joint.gear, options.gear_direction[i]));
    require_gear("gear of " + name, ratios.back(), tables.back());
  }
}

ElasticJointMatrices::ElasticJointMatrices(long n)
    : D(Matrix::Zero(2 * n, 2 * n)), C(Matrix::Zero(2 * n, 2 * n)), g(Vector::Zero(2 * n)) {}

ElasticJointDynamics::ElasticJointDynamics(const ElasticJointModel& model)
    : model_(&model),
      n_(model.size()),
      rigid_(model.rigid),
      derivatives_(model.rigid),
      slopes_(model.size()),
      rotors_(model.rigid, rotor_inertias(model.drives)),
      rotor_slopes_(model.size()),
      zero_(Vector::Zero(n_)),
      link_(zero_),
      motor_(zero_),
      coupling_(Matrix::Zero(n_, n_)),
      C_1_(coupling_),
      C_2_(coupling_),
      mass_(Matrix::Zero(2 * n_, 2 * n_)),
      by_state_(Matrix::Zero(2 * n_, 4 * n_)),
      by_acceleration_(mass_),
      factor_(2 * n_) {}

double ElasticJointDynamics::output_angle(int i, double theta) const {
  return gear_output_angle(model_->ratios[i], model_->tables[i], theta);
}

ElasticJointDynamics::JointState ElasticJointDynamics::joint(int i, double q, double theta) const {
  const double phi = output_angle(i, theta), e = phi + model_->offsets[i] - q;
  const Spring& spring = model_->springs[i];
  return {spring_torque(spring, e), spring_stiffness(spring, e),
          gear_ratio(model_->ratios[i], model_->tables[i], phi, 0),
          gear_ratio(model_->ratios[i], model_->tables[i], phi, 1)};
}

// Springs, friction and rotor inertia, and the coupling of rotors and links: added to the torques.
void ElasticJointDynamics::add_drives(ConstVectorRef x, ConstVectorRef a, VectorRef torques) {
  const auto q = x.head(n_), q_dot = x.segment(n_, n_), theta = x.segment(2 * n_, n_), theta_dot = x.tail(n_);
  const double width = model_->options.friction_width;
  for (int i = 0; i < n_; ++i) {
    const Drive& drive = model_->drives[i];
    const JointState spring = joint(i, q[i], theta[i]);
    torques[i] += friction(drive.joint, q_dot[i], width).torque - spring.torque;
    const double ratio = model_->ratios[i];
    torques[n_ + i] = drive.rotor_inertia * a[n_ + i] +
                      friction(drive.motor, theta_dot[i] / ratio, width).torque / ratio +
                      spring.torque / spring.ratio;
  }
  if (!model_->options.rotor_coupling) return;
  rotors_.place(q.data());
  rotors_.torques(q_dot.data(), a.data(), theta_dot.data(), a.data() + n_, link_, motor_);
  torques.head(n_) += link_;
  torques.tail(n_) += motor_;
}

void ElasticJointDynamics::check(ConstVectorRef x, ConstVectorRef second) const {
  require_size("x", x.size(), 4 * n_);
  require_size("a or torques", second.size(), 2 * n_);
}

void ElasticJointDynamics::inverse(ConstVectorRef x, ConstVectorRef a, VectorRef torques) {
  check(x, a);
  inverse_dynamics(model_->rigid, rigid_, x.head(n_), x.segment(n_, n_), a.head(n_), torques.head(n_));
  add_drives(x, a, torques);
}

void ElasticJointDynamics::inverse(ConstVectorRef x, ConstVectorRef a, VectorRef torques, MatrixRef by_state,
                                   MatrixRef by_acceleration) {
  check(x, a);
  const long n = n_;
  const double width = model_->options.friction_width;
  inverse_dynamics_derivatives(model_->rigid, derivatives_, x.head(n), x.segment(n, n), a.head(n), slopes_);
  torques.head(n) = slopes_.tau;
  add_drives(x, a, torques);
  by_state.setZero();
  by_acceleration.setZero();
  by_state.topLeftCorner(n, n) = slopes_.dtau_dq;
  by_state.block(0, n, n, n) = slopes_.dtau_dq_dot;
  by_acceleration.topLeftCorner(n, n) = slopes_.mass_matrix;
  for (int i = 0; i < n; ++i) {
    const Drive& drive = model_->drives[i];
    const JointState spring = joint(i, x[i], x[2 * n + i]);
    const double ratio = model_->ratios[i], per_turn = spring.stiffness / spring.ratio;
    by_state(i, i) += spring.stiffness;
    by_state(i, n + i) += friction(drive.joint, x[n + i], width).slope;
    by_state(i, 2 * n + i) = -per_turn;
    by_state(n + i, i) = -per_turn;
    by_state(n + i, 2 * n + i) = per_turn / spring.ratio - spring.torque * spring.ratio_slope /
                                                               (spring.ratio * spring.ratio * spring.ratio);
    by_state(n + i, 3 * n + i) = friction(drive.motor, x[3 * n + i] / ratio, width).slope / (ratio * ratio);
    by_acceleration(n + i, n + i) = drive.rotor_inertia;
  }
  if (!model_->options.rotor_coupling) return;
  rotors_.slopes(rotor_slopes_);
  by_state.topLeftCorner(n, n) += rotor_slopes_.joint_by_q;
  by_state.block(0, n, n, n) += rotor_slopes_.joint_by_q_dot;
  by_state.block(0, 3 * n, n, n) += rotor_slopes_.joint_by_theta_dot;
  by_state.block(n, 0, n, n) += rotor_slopes_.motor_by_q;
  by_state.block(n, n, n, n) += rotor_slopes_.motor_by_q_dot;
  rotors_.inertia(coupling_);
  by_acceleration.topRightCorner(n, n) = coupling_;
  by_acceleration.bottomLeftCorner(n, n) = coupling_.transpose();
}

void ElasticJointDynamics::mass(ConstVectorRef q, MatrixRef D) {
  D.setZero();
  mass_matrix(model_->rigid, rigid_, q, D.topLeftCorner(n_, n_));
  for (int i = 0; i < n_; ++i) D(n_ + i, n_ + i) = model_->drives[i].rotor_inertia;
  if (!model_->options.rotor_coupling) return;
  rotors_.place(q.data());
  rotors_.inertia(coupling_);
  D.topRightCorner(n_, n_) = coupling_;
  D.bottomLeftCorner(n_, n_) = coupling_.transpose();
}

void ElasticJointDynamics::forward(ConstVectorRef x, ConstVectorRef torques, VectorRef a) {
  check(x, torques);
  at_rest_.setZero(2 * n_);
  inverse(x, at_rest_, a);
  a = torques - a;
  mass(x.head(n_), mass_);
  factor_.compute(mass_);
  if (factor_.info() != Eigen::Success)
    throw InvalidArgument(
        "mass matrix: expected positive definite, found indefinite (link inertias must be physical "
        "and, with rotor coupling, contain the rotors)");
  factor_.solveInPlace(a);
}

void ElasticJointDynamics::rate_jacobian(ConstVectorRef x, ConstVectorRef a, MatrixRef jacobian) {
  check(x, a);
  at_rest_.setZero(2 * n_);
  inverse(x, a, at_rest_, by_state_, by_acceleration_);
  factor_.compute(by_acceleration_);
  factor_.solveInPlace(by_state_);
  jacobian.setZero();
  jacobian.block(0, n_, n_, n_).setIdentity();
  jacobian.block(2 * n_, 3 * n_, n_, n_).setIdentity();
  jacobian.middleRows(n_, n_) = -by_state_.topRows(n_);
  jacobian.middleRows(3 * n_, n_) = -by_state_.bottomRows(n_);
}

ElasticJointEnergy ElasticJointDynamics::energy(ConstVectorRef x) {
  require_size("x", x.size(), 4 * n_);
  const auto q = x.head(n_), q_dot = x.segment(n_, n_), theta = x.segment(2 * n_, n_), theta_dot = x.tail(n_);
  const RigidEnergy rigid = rigid_energy(model_->rigid, rigid_, q, q_dot);
  ElasticJointEnergy energy{rigid.kinetic, rigid.potential, 0.0};
  for (int i = 0; i < n_; ++i) {
    energy.kinetic += 0.5 * model_->drives[i].rotor_inertia * theta_dot[i] * theta_dot[i];
    energy.spring += spring_energy(model_->springs[i], output_angle(i, theta[i]) + model_->offsets[i] - q[i]);
  }
  if (model_->options.rotor_coupling) {
    rotors_.place(q.data());
    rotors_.inertia(coupling_);
    for (int i = 0; i < n_; ++i) energy.kinetic += theta_dot[i] * coupling_.col(i).dot(q_dot);
  }
  return energy;
}

void ElasticJointDynamics::matrices(ConstVectorRef x, ElasticJointMatrices& out) {
  require_size("x", x.size(), 4 * n_);
  const auto q = x.head(n_), q_dot = x.segment(n_, n_), theta = x.segment(2 * n_, n_), theta_dot = x.tail(n_);
  mass(q, out.D);
  out.C.setZero();
  inverse_dynamics_derivatives(model_->rigid, derivatives_, q, q_dot, zero_, slopes_);
  out.C.topLeftCorner(n_, n_) = 0.5 * slopes_.dtau_dq_dot;
  gravity_torque(model_->rigid, rigid_, q, out.g.head(n_));
  for (int i = 0; i < n_; ++i) {
    const JointState spring = joint(i, q[i], theta[i]);
    out.g[i] -= spring.torque;
    out.g[n_ + i] = spring.torque / spring.ratio;
  }
  if (!model_->options.rotor_coupling) return;
  rotors_.christoffel(q_dot.data(), theta_dot.data(), coupling_, C_1_, C_2_);
  out.C.topLeftCorner(n_, n_) += coupling_;
  out.C.topRightCorner(n_, n_) = C_1_;
  out.C.bottomLeftCorner(n_, n_) = C_2_;
}

}  // namespace exactarm
