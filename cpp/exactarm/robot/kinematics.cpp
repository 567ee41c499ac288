#include "exactarm/robot/kinematics.hpp"

#include "exactarm/base/parallel.hpp"
#include "exactarm/base/rotation.hpp"

namespace exactarm {
namespace {

constexpr long kLeastRowsAThread = 256;

// What one axis contributes, in the measuring frame.
struct AxisGeometry {
  Vector3 z, origin_before;   // joint axis and a point on it
  Vector3 x, y, origin;       // x after Rot_z, y after Rot_x, origin of frame i
  double sign;
  bool revolute;
};

Pose advance(const Frame& frame, double q, const Pose& before, AxisGeometry& axis) {
  const bool revolute = frame.type == JointType::revolute;
  const double angle = frame.zero + (revolute ? frame.sign * q : 0.0);
  const double along = frame.d + (revolute ? 0.0 : frame.sign * q);
  const double c = std::cos(angle), s = std::sin(angle);
  const double ca = std::cos(frame.alpha), sa = std::sin(frame.alpha);
  axis.revolute = revolute;
  axis.sign = frame.sign;
  axis.z = before.rotation.col(2);
  axis.origin_before = before.position;
  axis.x = c * before.rotation.col(0) + s * before.rotation.col(1);
  const Vector3 y_before = c * before.rotation.col(1) - s * before.rotation.col(0);
  axis.y = ca * y_before + sa * axis.z;
  Pose after;
  after.position = axis.origin = before.position + along * axis.z + frame.a * axis.x;
  const Vector3 z_alpha = ca * axis.z - sa * y_before;
  if (frame.beta == 0.0) {
    after.rotation.col(0) = axis.x;
    after.rotation.col(2) = z_alpha;
  } else {
    const double cb = std::cos(frame.beta), sb = std::sin(frame.beta);
    after.rotation.col(0) = cb * axis.x - sb * z_alpha;
    after.rotation.col(2) = sb * axis.x + cb * z_alpha;
  }
  after.rotation.col(1) = axis.y;
  return after;
}

using RowMajor3 = Eigen::Matrix<double, 3, 3, Eigen::RowMajor>;

// Writes a motion's six numbers into one column of a row-major 6 x width block.
inline void write_column(double* block, long width, long column, const Vector3& linear, const Vector3& angular) {
  for (int k = 0; k < 3; ++k) {
    block[k * width + column] = linear[k];
    block[(k + 3) * width + column] = angular[k];
  }
}

inline void turn(double* block, long width, long column, const Vector3& axis, const Vector3& arm, double factor) {
  write_column(block, width, column, factor * axis.cross(arm), factor * axis);
}

void write_joint_column(double* block, long width, long column, const AxisGeometry& axis, const Vector3& target,
                        double factor) {
  if (axis.revolute)
    turn(block, width, column, axis.z, target - axis.origin_before, factor * axis.sign);
  else
    write_column(block, width, column, factor * axis.sign * axis.z, Vector3::Zero());
}

void write_identification(double* block, const Robot& robot, const std::vector<AxisGeometry>& axes,
                          const Pose& flange, const Vector3& target, const double* dq_dratio) {
  const long n = robot.axes(), width = identification_columns(n);
  const Vector3 zero = Vector3::Zero();
  for (long i = 0; i < n; ++i) {
    const AxisGeometry& axis = axes[i];
    const long first = kFrameParameters * i;
    const Vector3 arm = target - axis.origin;
    write_column(block, width, first + kD, axis.z, zero);
    write_column(block, width, first + kA, axis.x, zero);
    turn(block, width, first + kAlpha, axis.x, arm, 1.0);
    turn(block, width, first + kBeta, axis.y, arm, 1.0);
    write_joint_column(block, width, first + kQ, axis, target, 1.0);
    write_joint_column(block, width, first + kRatio, axis, target, dq_dratio ? dq_dratio[i] : 0.0);
  }
  const long base = kFrameParameters * n;
  for (int k = 0; k < 3; ++k) {
    const Vector3 unit = Vector3::Unit(k), tool_axis = flange.rotation.col(k);
    write_column(block, width, base + k, unit, zero);
    turn(block, width, base + 3 + k, unit, target - robot.base.position, 1.0);
    write_column(block, width, base + 6 + k, tool_axis, zero);
    write_column(block, width, base + 9 + k, zero, tool_axis);
  }
}

}  // namespace

Pose frame_transform(const Frame& frame, double q) {
  AxisGeometry axis;
  return advance(frame, q, Pose{}, axis);
}

void frame_poses(const Robot& robot, ConstVectorRef q, std::vector<Pose>& poses) {
  require_size("q", q.size(), robot.axes());
  poses.resize(robot.axes() + 1);
  poses[0] = robot.base;
  AxisGeometry axis;
  for (long i = 0; i < robot.axes(); ++i) poses[i + 1] = advance(robot.frames[i], q[i], poses[i], axis);
}

Pose forward_kinematics(const Robot& robot, ConstVectorRef q) {
  require_size("q", q.size(), robot.axes());
  Pose pose = robot.base;
  AxisGeometry axis;
  for (long i = 0; i < robot.axes(); ++i) pose = advance(robot.frames[i], q[i], pose, axis);
  return pose * robot.tool;
}

Eigen::Matrix<double, 6, Eigen::Dynamic> geometric_jacobian(const Robot& robot, ConstVectorRef q) {
  Eigen::Matrix<double, 6, Eigen::Dynamic, Eigen::RowMajor> jacobian(6, robot.axes());
  const RowMatrix row = q.transpose();
  KinematicsBatch out;
  out.jacobian = jacobian.data();
  kinematics_batch(robot, row, RowMatrix(), out, 1);
  return jacobian;
}

void kinematics_batch(const Robot& robot, ConstRowMatrixRef q, ConstRowMatrixRef dq_dratio,
                      const KinematicsBatch& out, int threads) {
  const long n = robot.axes(), width = identification_columns(n);
  require_size("columns of q", q.cols(), n);
  const bool with_ratio = dq_dratio.size() > 0;
  if (with_ratio) {
    require_size("columns of dq_dratio", dq_dratio.cols(), n);
    require_size("rows of dq_dratio", dq_dratio.rows(), q.rows());
  }
  parallel_rows(q.rows(), threads, kLeastRowsAThread, [&](long begin, long end) {
    std::vector<AxisGeometry> axes(n);
    for (long row = begin; row < end; ++row) {
      Pose flange = robot.base;
      for (long i = 0; i < n; ++i) flange = advance(robot.frames[i], q(row, i), flange, axes[i]);
      const Vector3 target = flange.position + flange.rotation * robot.tool.position;
      if (out.position) Eigen::Map<Vector3>(out.position + 3 * row) = target;
      if (out.rotation) Eigen::Map<RowMajor3>(out.rotation + 9 * row) = flange.rotation * robot.tool.rotation;
      if (out.jacobian)
        for (long i = 0; i < n; ++i) write_joint_column(out.jacobian + 6 * n * row, n, i, axes[i], target, 1.0);
      if (out.identification)
        write_identification(out.identification + 6 * width * row, robot, axes, flange, target,
                             with_ratio ? dq_dratio.data() + row * dq_dratio.outerStride() : nullptr);
    }
  });
}

}  // namespace exactarm
