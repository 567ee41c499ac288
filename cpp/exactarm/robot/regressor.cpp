#include "exactarm/robot/regressor.hpp"

#include "exactarm/base/parallel.hpp"
#include "exactarm/robot/dynamics_model.hpp"
#include "exactarm/robot/kinematics.hpp"

namespace exactarm {
namespace {

constexpr long kLeastRowsAThread = 128;

// L(v)' u, where (symmetric matrix of pi_5..10) v = L(v) pi_5..10.
Vector6 products(const Vector3& v, const Vector3& u) {
  Vector6 row;
  row << v.x() * u.x(), v.y() * u.x() + v.x() * u.y(), v.z() * u.x() + v.x() * u.z(),  //
      v.y() * u.y(), v.z() * u.y() + v.y() * u.z(), v.z() * u.z();
  return row;
}

// Power of a link's wrench on the twist (turn, move) of its frame, by each of its inertial parameters. All
// vectors in the link frame; rate, angular and linear acceleration are those of the link.
InertialParameters powers(const Vector3& rate, const Vector3& angular, const Vector3& linear,
                          const Vector3& turn, const Vector3& move) {
  InertialParameters row;
  row[0] = linear.dot(move);
  row.segment<3>(1) = linear.cross(turn) - angular.cross(move) + rate.cross(rate.cross(move));
  row.tail<6>() = products(angular, turn) + products(rate, turn.cross(rate));
  return row;
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
    const Vector3 own_rate = back * rate, own_angular = back * angular, own_linear = back * linear;
    for (long j = 0; j <= i; ++j) {
      Vector3 turn = Vector3::Zero(), move = joints[j].z;  // twist of link i at unit rate of joint j
      if (joints[j].revolute) {
        turn = back * joints[j].z;
        move = joints[j].z.cross(pose.position - joints[j].origin);
      }
      Eigen::Map<InertialParameters>(block + j * width + kInertialParameters * i) =
          powers(own_rate, own_angular, own_linear, turn, back * move);
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
