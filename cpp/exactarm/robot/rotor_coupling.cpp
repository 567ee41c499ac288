#include "exactarm/robot/rotor_coupling.hpp"

namespace exactarm {

RotorCoupling::RotorCoupling(const DynamicsModel& model, std::vector<double> rotor_inertia)
    : model_(&model), rotor_inertia_(std::move(rotor_inertia)) {
  const std::size_t n = model.axes.size();
  require_size("rotor_inertia", static_cast<long>(rotor_inertia_.size()), static_cast<long>(n));
  for (auto* values : {&angle_, &sine_, &cosine_}) values->resize(n);
  pose_.resize(n);
  for (auto* vectors : {&axis_, &turn_, &turn_rate_, &spin_, &couple_}) vectors->assign(n, Vector3::Zero());
  for (auto* vectors : {&rate_, &acceleration_}) vectors->assign(n + 1, Vector3::Zero());
}

void RotorCoupling::place(const double* q) {
  axis_angles(*model_, q, angle_.data(), sine_.data(), cosine_.data());
  axis_poses(*model_, q, sine_.data(), cosine_.data(), pose_.data());
  for (int i = 0; i < model_->size(); ++i) {
    const DynamicsAxis& axis = model_->axes[i];
    axis_[i] = axis.sign * Vector3(pose_[i].z.x, pose_[i].z.y, pose_[i].z.z);
    turn_[i] = axis.revolute ? axis_[i] : Vector3::Zero();
  }
}

void RotorCoupling::inertia(MatrixRef U) const {
  U.setZero();
  for (int i = 0; i < model_->size(); ++i)
    for (int j = 0; j < i; ++j) U(j, i) = rotor_inertia_[i] * turn_[j].dot(axis_[i]);
}

void RotorCoupling::torques(const double* q_dot, const double* q_ddot, const double* theta_dot,
                            const double* theta_ddot, VectorRef on_joint, VectorRef on_motor) {
  const int n = model_->size();
  for (int i = 0; i < n; ++i) {
    turn_rate_[i] = rate_[i].cross(turn_[i]);
    rate_[i + 1] = rate_[i] + q_dot[i] * turn_[i];
    acceleration_[i + 1] = acceleration_[i] + q_ddot[i] * turn_[i] + q_dot[i] * turn_rate_[i];
    on_motor[i] = rotor_inertia_[i] * axis_[i].dot(acceleration_[i]);
  }
  Vector3 spin = Vector3::Zero(), couple = Vector3::Zero();
  for (int k = n - 1; k >= 0; --k) {
    spin_[k] = spin;
    couple_[k] = couple;
    on_joint[k] = turn_[k].dot(couple);
    spin += rotor_inertia_[k] * theta_dot[k] * axis_[k];
    couple += rotor_inertia_[k] * (theta_ddot[k] * axis_[k] + theta_dot[k] * rate_[k].cross(axis_[k]));
  }
}

RotorCoupling::Slopes::Slopes(long n)
    : joint_by_q(Matrix::Zero(n, n)), joint_by_q_dot(joint_by_q), joint_by_theta_dot(joint_by_q),
      motor_by_q(joint_by_q), motor_by_q_dot(joint_by_q) {}

// A small turn about axis l moves everything outboard alike; seen from there only w changes, by psi'_l (and
// the inner axes turn back).
void RotorCoupling::slopes(Slopes& out) const {
  const int n = model_->size();
  for (int j = 0; j < n; ++j)
    for (int l = 0; l < n; ++l) {
      const int outer = std::max(j, l);
      out.joint_by_q(j, l) = turn_[j].dot(turn_rate_[l].cross(spin_[outer]));
      if (l > j) out.joint_by_q(j, l) += turn_[j].cross(turn_[l]).dot(couple_[l]);
      out.joint_by_q_dot(j, l) = turn_[j].dot(turn_[l].cross(spin_[outer]));
      out.joint_by_theta_dot(j, l) = l > j ? rotor_inertia_[l] * turn_[j].dot(rate_[l].cross(axis_[l])) : 0.0;
      if (l < j) {
        const Vector3 twice = acceleration_[l + 1].cross(turn_[l]) + rate_[l + 1].cross(turn_rate_[l]);
        out.motor_by_q(j, l) = rotor_inertia_[j] * axis_[j].dot(twice - rate_[j].cross(turn_rate_[l]));
        out.motor_by_q_dot(j, l) =
            rotor_inertia_[j] * axis_[j].dot(2.0 * turn_rate_[l] - rate_[j].cross(turn_[l]));
      } else {
        out.motor_by_q(j, l) = out.motor_by_q_dot(j, l) = 0.0;
      }
    }
}

// dU(j, i)/dq_l = J_i e_j . (e_l x e_i) for j <= l < i, otherwise 0.
void RotorCoupling::christoffel(const double* q_dot, const double* theta_dot, MatrixRef link, MatrixRef C_1,
                                MatrixRef C_2) const {
  const int n = model_->size();
  link.setZero();
  C_1.setZero();
  C_2.setZero();
  for (int i = 0; i < n; ++i)
    for (int j = 0; j < i; ++j)
      for (int l = j + 1; l < i; ++l) {
        const double slope = 0.5 * rotor_inertia_[i] * turn_[j].dot(turn_[l].cross(axis_[i]));
        C_1(j, i) += slope * q_dot[l];  // dU_ji/dq_l as dU_kj/dq_i
        C_1(l, i) -= slope * q_dot[j];  // as -dU_ij/dq_k
        link(j, l) += slope * theta_dot[i];
        link(l, j) -= slope * theta_dot[i];
        C_2(i, j) += slope * q_dot[l];
        C_2(i, l) += slope * q_dot[j];
      }
}

}  // namespace exactarm
