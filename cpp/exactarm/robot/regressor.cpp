#include "exactarm/robot/regressor.hpp"

#include "exactarm/base/parallel.hpp"
#include "exactarm/base/rotation.hpp"
#include "exactarm/robot/dynamics_model.hpp"
#include "exactarm/robot/kinematics.hpp"

namespace exactarm {
namespace {

constexpr long kLeastRowsAThread = 128;

// Columns of L(v) so that (symmetric matrix of pi_5..10) v = L(v) pi_5..10.
Eigen::Matrix<double, 3, 6> inertia_columns(const Vector3& v) {
  Eigen::Matrix<double, 3, 6> columns;
  columns << v.x(), v.y(), v.z(), 0, 0, 0,  //
      0, v.x(), 0, v.y(), v.z(), 0,         //
      0, 0, v.x(), 0, v.y(), v.z();
  return columns;
}

// Wrench (moment about the link frame's origin, force) a parameter, in the link frame.
Eigen::Matrix<double, 6, kInertialParameters> body_regressor(const Vector3& rate, const Vector3& angular,
                                                             const Vector3& linear) {
  Eigen::Matrix<double, 6, kInertialParameters> body;
  const Matrix3 turn = skew(rate);
  body.topLeftCorner<3, 1>().setZero();
  body.block<3, 3>(0, 1) = -skew(linear);
  body.topRightCorner<3, 6>() = inertia_columns(angular) + turn * inertia_columns(rate);
  body.bottomLeftCorner<3, 1>() = linear;
  body.block<3, 3>(3, 1) = skew(angular) + turn * turn;
  body.bottomRightCorner<3, 6>().setZero();
  return body;
}

struct MovingAxis {
  Vector3 z, origin;  // axis with its sign, and a point on it, in the base frame
  bool revolute;
};

// block: n x 10 n of one sample, row major, zero on entry.
void write_sample(const Robot& robot, ConstRowMatrixRef q, ConstRowMatrixRef q_dot, ConstRowMatrixRef q_ddot,
                  long row, std::vector<MovingAxis>& joints, double* block) {
  const long n = robot.axes(), width = kInertialParameters * n;
  Pose pose;
  Vector3 rate = Vector3::Zero(), angular = Vector3::Zero(), linear = -robot.gravity();
  for (long i = 0; i < n; ++i) {
    const Frame& frame = robot.joint(i).frame;
    const Pose next = pose * frame_transform(frame, q(row, i));
    const Vector3 z = frame.sign * pose.rotation.col(2), arm = next.position - pose.position;
    joints[i] = {z, pose.position, frame.type == JointType::revolute};
    const double speed = q_dot(row, i), acceleration = q_ddot(row, i);
    if (joints[i].revolute) {
      angular += acceleration * z + speed * rate.cross(z);
      rate += speed * z;
    } else {
      linear += acceleration * z + 2.0 * speed * rate.cross(z);
    }
    linear += angular.cross(arm) + rate.cross(rate.cross(arm));
    pose = next;
    const Matrix3 back = pose.rotation.transpose();
    const auto body = body_regressor(back * rate, back * angular, back * linear);
    for (long j = 0; j <= i; ++j) {
      Vector6 twist = Vector6::Zero();  // of link i at unit rate of joint j, in the link frame
      if (joints[j].revolute)
        twist << back * joints[j].z, back * joints[j].z.cross(pose.position - joints[j].origin);
      else
        twist.tail<3>() = back * joints[j].z;
      Eigen::Map<InertialParameters>(block + j * width + kInertialParameters * i) = body.transpose() * twist;
    }
  }
}

}  // namespace

void dynamics_regressor_batch(const Robot& robot, ConstRowMatrixRef q, ConstRowMatrixRef q_dot,
                              ConstRowMatrixRef q_ddot, double* Y, int threads) {
  const long n = robot.axes(), size = kInertialParameters * n * n;
  require_size("columns of q", q.cols(), n);
  require_size("columns of q_dot", q_dot.cols(), n);
  require_size("columns of q_ddot", q_ddot.cols(), n);
  require_size("rows of q_dot", q_dot.rows(), q.rows());
  require_size("rows of q_ddot", q_ddot.rows(), q.rows());
  parallel_rows(q.rows(), threads, kLeastRowsAThread, [&](long begin, long end) {
    std::vector<MovingAxis> joints(n);
    for (long row = begin; row < end; ++row) {
      double* block = Y + size * row;
      std::fill_n(block, size, 0.0);
      write_sample(robot, q, q_dot, q_ddot, row, joints, block);
    }
  });
}

Matrix dynamics_regressor(const Robot& robot, ConstVectorRef q, ConstVectorRef q_dot, ConstVectorRef q_ddot) {
  RowMatrix Y(robot.axes(), kInertialParameters * robot.axes());
  dynamics_regressor_batch(robot, q.transpose(), q_dot.transpose(), q_ddot.transpose(), Y.data(), 1);
  return Y;
}

}  // namespace exactarm
