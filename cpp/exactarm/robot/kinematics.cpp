#include "exactarm/robot/kinematics.hpp"

#include "exactarm/base/parallel.hpp"
#include "exactarm/base/sincos.hpp"
#include "exactarm/robot/spatial.hpp"

namespace exactarm {
namespace {

constexpr long kLeastRowsAThread = 256;

using RowMajor3 = Eigen::Matrix<double, 3, 3, Eigen::RowMajor>;

using Vec = spatial::Vec3<double>;

// A frame in the measuring frame; plain numbers, which the compiler keeps in registers.
struct Axes {
  Vec x, y, z, origin;

  explicit Axes(const Pose& pose)
      : x(vec(pose.rotation.col(0))), y(vec(pose.rotation.col(1))), z(vec(pose.rotation.col(2))),
        origin(vec(pose.position)) {}
  Axes() = default;

  static Vec vec(const Vector3& v) { return {v.x(), v.y(), v.z()}; }
  EXACTARM_INLINE Vec turn(const Vec& v) const { return v.x * x + v.y * y + v.z * z; }
  EXACTARM_INLINE Vec turn(const double* v) const { return v[0] * x + v[1] * y + v[2] * z; }
};

// This frame times a pose in it.
EXACTARM_INLINE Axes operator*(const Axes& frame, const Pose& pose) {
  const double* rotation = pose.rotation.data();
  Axes out;
  out.x = frame.turn(rotation);
  out.y = frame.turn(rotation + 3);
  out.z = frame.turn(rotation + 6);
  out.origin = frame.origin + frame.turn(pose.position.data());
  return out;
}

void write(const Axes& axes, Pose& pose) {
  const Vec* const columns[] = {&axes.x, &axes.y, &axes.z};
  for (int k = 0; k < 3; ++k) {
    double* to = pose.rotation.data() + 3 * k;
    to[0] = columns[k]->x;
    to[1] = columns[k]->y;
    to[2] = columns[k]->z;
  }
  pose.position = Vector3(axes.origin.x, axes.origin.y, axes.origin.z);
}

// What one axis contributes, in the measuring frame.
struct AxisGeometry {
  Vec z, origin_before;   // joint axis and a point on it
  Vec x, y, origin;       // x after Rot_z, y after Rot_x, origin of frame i
  double sign;
  bool revolute;
};

// Sines and cosines of up to eight frames at once: of the joint's angle, alpha and beta.
struct FrameAngles {
  static constexpr long kFrames = 8;
  double sine[kFrames], cosine[kFrames], sine_alpha[kFrames], cosine_alpha[kFrames];
  double sine_beta[kFrames], cosine_beta[kFrames];

  void set_constants(const Joint* joints, long count) {
    double alpha[kFrames], beta[kFrames];
    bool twisted = false;
    for (long i = 0; i < count; ++i) {
      alpha[i] = joints[i].frame.alpha;
      beta[i] = joints[i].frame.beta;
      twisted |= beta[i] != 0.0;
    }
    sincos(alpha, static_cast<int>(count), sine_alpha, cosine_alpha);
    if (twisted) sincos(beta, static_cast<int>(count), sine_beta, cosine_beta);
  }
  void set_joints(const Joint* joints, const double* q, long count) {
    double angle[kFrames];
    for (long i = 0; i < count; ++i) {
      const Frame& frame = joints[i].frame;
      angle[i] = frame.zero + (frame.type == JointType::revolute ? frame.sign * q[i] : 0.0);
    }
    sincos(angle, static_cast<int>(count), sine, cosine);
  }
};

EXACTARM_INLINE Axes advance(const Frame& frame, double q, const FrameAngles& angles, long place,
                             const Axes& before, AxisGeometry& axis) {
  const bool revolute = frame.type == JointType::revolute;
  const double along = frame.d + (revolute ? 0.0 : frame.sign * q);
  const double c = angles.cosine[place], s = angles.sine[place];
  const double ca = angles.cosine_alpha[place], sa = angles.sine_alpha[place];
  axis.revolute = revolute;
  axis.sign = frame.sign;
  axis.z = before.z;
  axis.origin_before = before.origin;
  axis.x = c * before.x + s * before.y;
  const Vec y_before = c * before.y - s * before.x;
  axis.y = ca * y_before + sa * axis.z;
  Axes after;
  after.origin = axis.origin = before.origin + along * axis.z + frame.a * axis.x;
  after.x = axis.x;
  after.y = axis.y;
  after.z = ca * axis.z - sa * y_before;
  if (frame.beta != 0.0) {
    const double cb = angles.cosine_beta[place], sb = angles.sine_beta[place];
    const Vec z_alpha = after.z;
    after.x = cb * axis.x - sb * z_alpha;
    after.z = sb * axis.x + cb * z_alpha;
  }
  return after;
}

// visit(axis, angles, place in them) along the chain, from the base.
template <class Visit>
void each_axis(const Robot& robot, ConstVectorRef q, const Visit& visit) {
  FrameAngles angles;
  const long n = robot.axes();
  for (long first = 0; first < n; first += FrameAngles::kFrames) {
    const long count = std::min(FrameAngles::kFrames, n - first);
    angles.set_constants(&robot.joint(first), count);
    angles.set_joints(&robot.joint(first), q.data() + first, count);
    for (long i = 0; i < count; ++i) visit(first + i, angles, i);
  }
}

// Writes a motion's six numbers into one column of a row-major 6 x width block.
inline void write_column(double* block, long width, long column, const Vec& linear, const Vec& angular) {
  double* to = block + column;
  to[0] = linear.x;
  to[width] = linear.y;
  to[2 * width] = linear.z;
  to[3 * width] = angular.x;
  to[4 * width] = angular.y;
  to[5 * width] = angular.z;
}

inline void turn(double* block, long width, long column, const Vec& axis, const Vec& arm, double factor) {
  const Vec angular = factor * axis;
  write_column(block, width, column, cross(angular, arm), angular);
}

void write_joint_column(double* block, long width, long column, const AxisGeometry& axis, const Vec& target,
                        double factor) {
  if (axis.revolute)
    turn(block, width, column, axis.z, target - axis.origin_before, factor * axis.sign);
  else
    write_column(block, width, column, (factor * axis.sign) * axis.z, Vec::zero());
}

void write_identification(double* block, const Robot& robot, const std::vector<AxisGeometry>& axes,
                          const Axes& flange, const Vec& target, const double* dq_dratio) {
  const long n = robot.axes(), width = identification_columns(n);
  const Vec zero = Vec::zero(), from_base = target - Axes::vec(robot.base().position);
  for (long i = 0; i < n; ++i) {
    const AxisGeometry& axis = axes[i];
    const long first = kFrameParameters * i;
    const Vec arm = target - axis.origin;
    write_column(block, width, first + kD, axis.z, zero);
    write_column(block, width, first + kA, axis.x, zero);
    turn(block, width, first + kAlpha, axis.x, arm, 1.0);
    turn(block, width, first + kBeta, axis.y, arm, 1.0);
    write_joint_column(block, width, first + kQ, axis, target, 1.0);
    write_joint_column(block, width, first + kRatio, axis, target, dq_dratio ? dq_dratio[i] : 0.0);
  }
  const long base = kFrameParameters * n, tool = base + kPlacementParameters;
  const Vec units[] = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}}, tool_axes[] = {flange.x, flange.y, flange.z};
  for (int k = 0; k < 3; ++k) {
    const Vec &unit = units[k], &tool_axis = tool_axes[k];
    write_column(block, width, base + k, unit, zero);
    turn(block, width, base + 3 + k, unit, from_base, 1.0);
    write_column(block, width, tool + k, tool_axis, zero);
    write_column(block, width, tool + 3 + k, zero, tool_axis);
  }
}

}  // namespace

Pose frame_transform(const Frame& frame, double q) {
  AxisGeometry axis;
  FrameAngles angles;
  Joint joint;
  joint.frame = frame;
  angles.set_constants(&joint, 1);
  angles.set_joints(&joint, &q, 1);
  Pose pose;
  write(advance(frame, q, angles, 0, Axes(pose), axis), pose);
  return pose;
}

void frame_poses(const Robot& robot, ConstVectorRef q, std::vector<Pose>& poses) {
  require_size("q", q.size(), robot.axes());
  poses.resize(robot.axes() + 1);
  poses[0] = robot.base();
  Axes frame(robot.base());
  AxisGeometry axis;
  each_axis(robot, q, [&](long i, const FrameAngles& angles, long place) {
    frame = advance(robot.joint(i).frame, q[i], angles, place, frame, axis);
    write(frame, poses[i + 1]);
  });
}

Pose forward_kinematics(const Robot& robot, ConstVectorRef q) {
  require_size("q", q.size(), robot.axes());
  Axes frame(robot.base());
  AxisGeometry axis;
  each_axis(robot, q, [&](long i, const FrameAngles& angles, long place) {
    frame = advance(robot.joint(i).frame, q[i], angles, place, frame, axis);
  });
  Pose pose;
  write(frame * robot.tool(), pose);
  return pose;
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
    constexpr long kFrames = FrameAngles::kFrames;
    std::vector<AxisGeometry> axes(n);
    std::vector<FrameAngles> angles((n + kFrames - 1) / kFrames);
    for (long first = 0; first < n; first += kFrames)
      angles[first / kFrames].set_constants(&robot.joint(first), std::min(kFrames, n - first));
    for (long row = begin; row < end; ++row) {
      const double* coordinates = q.data() + row * q.outerStride();
      for (long first = 0; first < n; first += kFrames)
        angles[first / kFrames].set_joints(&robot.joint(first), coordinates + first,
                                           std::min(kFrames, n - first));
      Axes flange(robot.base());
      for (long i = 0; i < n; ++i)
        flange =
            advance(robot.joint(i).frame, coordinates[i], angles[i / kFrames], i % kFrames, flange, axes[i]);
      const Axes measured = flange * robot.tool();
      const Vec target = measured.origin;
      if (out.position || out.rotation) {
        Pose pose;
        write(measured, pose);
        if (out.position) Eigen::Map<Vector3>(out.position + 3 * row) = pose.position;
        if (out.rotation) Eigen::Map<RowMajor3>(out.rotation + 9 * row) = pose.rotation;
      }
      if (out.jacobian)
        for (long i = 0; i < n; ++i)
          write_joint_column(out.jacobian + 6 * n * row, n, i, axes[i], target, 1.0);
      if (out.identification)
        write_identification(out.identification + 6 * width * row, robot, axes, flange, target,
                             with_ratio ? dq_dratio.data() + row * dq_dratio.outerStride() : nullptr);
    }
  });
}

}  // namespace exactarm
