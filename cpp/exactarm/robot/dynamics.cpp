#include "exactarm/robot/dynamics.hpp"

#include "exactarm/base/parallel.hpp"
#include "exactarm/robot/lane_rows.hpp"

namespace exactarm {
namespace {

using spatial::Sym3;
using spatial::SpatialInertia;
using spatial::Twist;
using spatial::Vec3;
using spatial::Wrench;

constexpr long kLeastRowsAThread = 256;

// (c, s): v_before = Rot_z v_after and its inverse; likewise about x and y.
template <class T>
Vec3<T> about_z(const T& c, const T& s, const Vec3<T>& v) {
  return {c * v.x - s * v.y, s * v.x + c * v.y, v.z};
}
template <class T>
Vec3<T> about_x(const T& c, const T& s, const Vec3<T>& v) {
  return {v.x, c * v.y - s * v.z, s * v.y + c * v.z};
}
template <class T>
Vec3<T> about_y(const T& c, const T& s, const Vec3<T>& v) {
  return {c * v.x + s * v.z, v.y, c * v.z - s * v.x};
}

// Rotation from F_{i-1} back to A_{i-1}, and the other way.
template <class T>
Vec3<T> out_of_link(const DynamicsAxis& axis, Vec3<T> v) {
  if (axis.twisted) v = about_y(T(axis.cos_beta), T(axis.sin_beta), v);
  return about_x(T(axis.cos_alpha), T(axis.sin_alpha), v);
}
template <class T>
Vec3<T> into_link(const DynamicsAxis& axis, Vec3<T> v) {
  v = about_x(T(axis.cos_alpha), T(-axis.sin_alpha), v);
  if (axis.twisted) v = about_y(T(axis.cos_beta), T(-axis.sin_beta), v);
  return v;
}

// Inverse dynamics of the sample in the workspace.
template <class T>
void newton_euler(const DynamicsModel& model, DynamicsWorkspaceOf<T>& w) {
  const int n = model.size();
  axis_angles(model, w.q.data(), w.angle.data(), w.sine.data(), w.cosine.data());
  Vec3<T> rate = Vec3<T>::zero(), angular = Vec3<T>::zero();  // omega and its derivative
  Vec3<T> linear = spatial::constant<T>(-model.gravity);      // acceleration of the frame's origin
  for (int i = 0; i < n; ++i) {
    const DynamicsAxis& axis = model.axes[i];
    if (i > 0) {
      const DynamicsAxis& before = model.axes[i - 1];
      const Vec3<T> arm{T(before.a), T(0.0), T(before.d)};
      linear += cross(angular, arm) + cross(rate, cross(rate, arm));
      rate = into_link(before, rate);
      angular = into_link(before, angular);
      linear = into_link(before, linear);
    }
    const T c = w.cosine[i], s = -w.sine[i];
    rate = about_z(c, s, rate);
    angular = about_z(c, s, angular);
    linear = about_z(c, s, linear);
    const T speed = axis.sign * w.q_dot[i], acceleration = axis.sign * w.q_ddot[i];
    if (axis.revolute) {
      angular += Vec3<T>{rate.y * speed, -(rate.x * speed), acceleration};
      rate.z += speed;
    } else {
      const Vec3<T> arm{T(0.0), T(0.0), axis.sign * w.q[i]};
      linear += cross(angular, arm) + cross(rate, cross(rate, arm));
      linear += Vec3<T>{2.0 * rate.y * speed, -2.0 * rate.x * speed, acceleration};
    }
    const Vec3<T> h = spatial::constant<T>(axis.first_moment);
    const Sym3<T> J = spatial::constant_symmetric<T>(axis.inertia);
    w.wrench[i].force = T(axis.mass) * linear + cross(angular, h) + cross(rate, cross(rate, h));
    w.wrench[i].moment = J * angular + cross(rate, J * rate) + cross(h, linear);
  }
  Wrench<T> outboard = Wrench<T>::zero();  // on link i, at A_i
  for (int i = n - 1; i >= 0; --i) {
    const DynamicsAxis& axis = model.axes[i];
    outboard += w.wrench[i];
    w.result[i] = axis.sign * (axis.revolute ? outboard.moment.z : outboard.force.z);
    if (i == 0) break;
    if (!axis.revolute) {
      const T along = axis.sign * w.q[i];
      outboard.moment += Vec3<T>{-(along * outboard.force.y), along * outboard.force.x, T(0.0)};
    }
    const DynamicsAxis& before = model.axes[i - 1];
    outboard.moment = out_of_link(before, about_z(w.cosine[i], w.sine[i], outboard.moment));
    outboard.force = out_of_link(before, about_z(w.cosine[i], w.sine[i], outboard.force));
    outboard.moment += cross(Vec3<T>{T(before.a), T(0.0), T(before.d)}, outboard.force);
  }
}

template <class T>
void place(const DynamicsModel& model, DynamicsWorkspaceOf<T>& w) {
  axis_angles(model, w.q.data(), w.angle.data(), w.sine.data(), w.cosine.data());
  axis_poses(model, w.q.data(), w.sine.data(), w.cosine.data(), w.pose.data());
  for (int i = 0; i < model.size(); ++i) w.joint[i] = joint_twist(model.axes[i], w.pose[i]);
}

// Potential energy -gravity . sum m c: its slope is g_k = -gravity . u_k with u_k = m v_k + w_k x h, the
// rate of the outboard first moment by joint k; joint j <= k turns u_k as a free vector.
template <class T, bool kJacobian>
void gravity_of_sample(const DynamicsModel& model, DynamicsWorkspaceOf<T>& w) {
  const int n = model.size();
  place(model, w);
  const Vec3<T> up = spatial::constant<T>(-model.gravity);
  T mass(0.0);
  Vec3<T> first = Vec3<T>::zero();
  for (int k = n - 1; k >= 0; --k) {
    const DynamicsAxis& axis = model.axes[k];
    mass += T(axis.mass);
    first += T(axis.mass) * w.pose[k].origin + w.pose[k].turn(spatial::constant<T>(axis.first_moment));
    const Vec3<T> shift = mass * w.joint[k].linear + cross(w.joint[k].angular, first);
    if constexpr (kJacobian) {
      const Vec3<T> lever = cross(shift, up);
      for (int j = 0; j <= k; ++j) w.result[n * j + k] = w.result[n * k + j] = dot(w.joint[j].angular, lever);
    } else {
      w.result[k] = dot(shift, up);
    }
  }
}

template <class T>
void composite_inertia(const DynamicsModel& model, DynamicsWorkspaceOf<T>& w) {
  const int n = model.size();
  place(model, w);
  SpatialInertia<T> outboard = SpatialInertia<T>::zero();
  for (int k = n - 1; k >= 0; --k) {
    const DynamicsAxis& axis = model.axes[k];
    outboard += world_inertia(T(axis.mass), spatial::constant<T>(axis.centre_of_mass),
                              spatial::constant_symmetric<T>(axis.central_inertia), w.pose[k]);
    const Wrench<T> momentum = outboard * w.joint[k];
    for (int j = 0; j <= k; ++j) w.result[n * j + k] = w.result[n * k + j] = dot(w.joint[j], momentum);
  }
}

template <class T>
void load(std::vector<T>& into, ConstVectorRef from) {
  std::copy_n(from.data(), into.size(), into.begin());
}

// Runs `kernel` on workspaces filled from the rows of up to three inputs; writes `width` results a row.
template <class Kernel>
void each_row(const DynamicsModel& model, std::initializer_list<const ConstRowMatrixRef*> inputs, int width,
              double* out, int threads, const Kernel& kernel) {
  const int n = model.size();
  const char* const names[] = {"q", "q_dot", "q_ddot"};
  const long rows = (*inputs.begin())->rows();
  int input = 0;
  for (const ConstRowMatrixRef* matrix : inputs) {
    require_size(std::string("columns of ") + names[input], matrix->cols(), n);
    require_size(std::string("rows of ") + names[input++], matrix->rows(), rows);
  }
  parallel_rows(rows, threads, kLeastRowsAThread, [&](long begin, long end) {
    DynamicsWorkspaceOf<Lanes> w(model);
    std::vector<Lanes>* const samples[] = {&w.q, &w.q_dot, &w.q_ddot};
    for (long row = begin; row < end; row += Lanes::kCount) {
      int sample = 0;
      for (const ConstRowMatrixRef* matrix : inputs)
        load_rows(matrix->data(), matrix->outerStride(), row, end, n, samples[sample++]->data());
      kernel(w);
      store_rows(w.result.data(), width, row, end, width, out);
    }
  });
}

}  // namespace

template <class T>
DynamicsWorkspaceOf<T>::DynamicsWorkspaceOf(const DynamicsModel& model) {
  const std::size_t n = model.axes.size();
  for (auto* values : {&q, &q_dot, &q_ddot, &angle, &sine, &cosine}) values->resize(n);
  result.resize(padded(static_cast<int>(n * n)));
  wrench.resize(n);
  pose.resize(n);
  joint.resize(n);
}

template class DynamicsWorkspaceOf<double>;
template class DynamicsWorkspaceOf<Lanes>;

void inverse_dynamics(const DynamicsModel& model, DynamicsWorkspace& workspace, ConstVectorRef q,
                      ConstVectorRef q_dot, ConstVectorRef q_ddot, VectorRef tau) {
  load(workspace.q, q);
  load(workspace.q_dot, q_dot);
  load(workspace.q_ddot, q_ddot);
  newton_euler(model, workspace);
  tau = Eigen::Map<const Vector>(workspace.result.data(), model.size());
}

void gravity_torque(const DynamicsModel& model, DynamicsWorkspace& workspace, ConstVectorRef q,
                    VectorRef tau) {
  load(workspace.q, q);
  gravity_of_sample<double, false>(model, workspace);
  tau = Eigen::Map<const Vector>(workspace.result.data(), model.size());
}

void mass_matrix(const DynamicsModel& model, DynamicsWorkspace& workspace, ConstVectorRef q, MatrixRef D) {
  load(workspace.q, q);
  composite_inertia(model, workspace);
  D = Eigen::Map<const Matrix>(workspace.result.data(), model.size(), model.size());
}

RigidEnergy rigid_energy(const DynamicsModel& model, DynamicsWorkspace& workspace, ConstVectorRef q,
                         ConstVectorRef q_dot) {
  const int n = model.size();
  load(workspace.q, q);
  composite_inertia(model, workspace);
  const Eigen::Map<const Matrix> D(workspace.result.data(), n, n);
  RigidEnergy energy{0.0, 0.0};
  const Vec3<double> up = spatial::constant<double>(-model.gravity);
  for (int k = 0; k < n; ++k) {
    const Vec3<double> first = spatial::constant<double>(model.axes[k].first_moment);
    energy.kinetic += 0.5 * q_dot[k] * D.col(k).dot(q_dot);
    energy.potential +=
        dot(up, model.axes[k].mass * workspace.pose[k].origin + workspace.pose[k].turn(first));
  }
  return energy;
}

Vector inverse_dynamics(const Robot& robot, ConstVectorRef q, ConstVectorRef q_dot, ConstVectorRef q_ddot) {
  const long n = robot.axes();
  require_size("q", q.size(), n);
  require_size("q_dot", q_dot.size(), n);
  require_size("q_ddot", q_ddot.size(), n);
  const DynamicsModel model(robot);
  DynamicsWorkspace workspace(model);
  Vector tau(n);
  inverse_dynamics(model, workspace, q, q_dot, q_ddot, tau);
  return tau;
}

Vector gravity_torque(const Robot& robot, ConstVectorRef q) {
  require_size("q", q.size(), robot.axes());
  Vector tau(robot.axes());
  gravity_torque_batch(DynamicsModel(robot), q.transpose(), tau.data(), 1);
  return tau;
}

Matrix gravity_torque_jacobian(const Robot& robot, ConstVectorRef q) {
  Matrix jacobian(robot.axes(), robot.axes());
  gravity_torque_jacobian_batch(DynamicsModel(robot), q.transpose(), jacobian.data(), 1);
  return jacobian;
}

Matrix mass_matrix(const Robot& robot, ConstVectorRef q) {
  Matrix D(robot.axes(), robot.axes());
  mass_matrix_batch(DynamicsModel(robot), q.transpose(), D.data(), 1);
  return D;
}

void inverse_dynamics_batch(const DynamicsModel& model, ConstRowMatrixRef q, ConstRowMatrixRef q_dot,
                            ConstRowMatrixRef q_ddot, double* tau, int threads) {
  each_row(model, {&q, &q_dot, &q_ddot}, model.size(), tau, threads,
           [&](DynamicsWorkspaceOf<Lanes>& w) { newton_euler(model, w); });
}

void gravity_torque_batch(const DynamicsModel& model, ConstRowMatrixRef q, double* tau, int threads) {
  each_row(model, {&q}, model.size(), tau, threads,
           [&](DynamicsWorkspaceOf<Lanes>& w) { gravity_of_sample<Lanes, false>(model, w); });
}

void gravity_torque_jacobian_batch(const DynamicsModel& model, ConstRowMatrixRef q, double* jacobian,
                                   int threads) {
  each_row(model, {&q}, model.size() * model.size(), jacobian, threads,
           [&](DynamicsWorkspaceOf<Lanes>& w) { gravity_of_sample<Lanes, true>(model, w); });
}

void mass_matrix_batch(const DynamicsModel& model, ConstRowMatrixRef q, double* D, int threads) {
  each_row(model, {&q}, model.size() * model.size(), D, threads,
           [&](DynamicsWorkspaceOf<Lanes>& w) { composite_inertia(model, w); });
}

}  // namespace exactarm
