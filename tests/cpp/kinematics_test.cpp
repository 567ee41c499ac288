#include "exactarm/robot/kinematics.hpp"

#include <gtest/gtest.h>

#include "central_difference.hpp"
#include "random_states.hpp"

namespace exactarm {
namespace {

using testing::Random;

// All parameters of the identification Jacobian as one vector of increments, in its column order.
Robot moved(const Robot& robot, const Vector& step) {
  RobotDescription out{robot.joints(), robot.base(), robot.tool(), robot.gravity()};
  const long n = robot.axes();
  for (long i = 0; i < n; ++i) {
    const long first = kFrameParameters * i;
    out.joints[i].frame.d += step[first + kD];
    out.joints[i].frame.a += step[first + kA];
    out.joints[i].frame.alpha += step[first + kAlpha];
    out.joints[i].frame.beta += step[first + kBeta];
  }
  const long base = kFrameParameters * n;
  out.base.position += step.segment<3>(base);
  out.base.rotation = rotation_exp(step.segment<3>(base + 3)) * robot.base().rotation;
  out.tool.position += step.segment<3>(base + 6);
  out.tool.rotation = rotation_exp(step.segment<3>(base + 9)) * robot.tool().rotation;
  return out;
}

Vector pose_error(const Pose& pose, const Pose& reference) {
  Vector error(6);
  error << pose.position - reference.position, rotation_log(pose.rotation * reference.rotation.transpose());
  return error;
}

TEST(Kinematics, IdentificationJacobianMatchesCentralDifference) {
  Random random;
  for (int sample = 0; sample < testing::samples(); ++sample) {
    const int n = 1 + sample % 8;
    const Robot robot = testing::random_robot(random, n, sample % 2 == 1);
    Vector q = random.vector(n, 3.0);
    if (sample == 0) q.setZero();
    if (sample == 1) q.setConstant(1e-8);
    const RowMatrix dq_dratio = random.vector(n, 0.1).transpose();
    const Pose reference = forward_kinematics(robot, q);
    Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor> analytic(
        6, identification_columns(n));
    KinematicsBatch out;
    out.identification = analytic.data();
    kinematics_batch(robot, q.transpose(), dq_dratio, out, 1);
    const auto f = [&](const Vector& step) {
      Vector q_step = q;
      for (long i = 0; i < n; ++i)
        q_step[i] += step[kFrameParameters * i + kQ] + dq_dratio(0, i) * step[kFrameParameters * i + kRatio];
      return pose_error(forward_kinematics(moved(robot, step), q_step), reference);
    };
    testing::expect_derivative(f, Vector::Zero(analytic.cols()), analytic);
  }
}

TEST(Kinematics, GeometricJacobianIsTheJointColumnsOfTheIdentificationJacobian) {
  Random random(1);
  const Robot robot = testing::random_robot(random, 7, true);
  const Vector q = random.vector(7, 3.0);
  RowMatrix all(6, identification_columns(7));
  KinematicsBatch out;
  out.identification = all.data();
  kinematics_batch(robot, q.transpose(), RowMatrix(), out, 1);
  const Matrix jacobian = geometric_jacobian(robot, q);
  for (int i = 0; i < 7; ++i)
    EXPECT_TRUE(jacobian.col(i).isApprox(all.col(kFrameParameters * i + kQ), 1e-15));
}

TEST(Kinematics, ThreadsGiveTheSameNumbers) {
  Random random(2);
  const Robot robot = testing::random_robot(random, 6);
  RowMatrix q(2000, 6);
  for (long i = 0; i < q.size(); ++i) q.data()[i] = random.uniform(-3, 3);
  Matrix one(3, 2000), four(3, 2000);
  KinematicsBatch out;
  out.position = one.data();
  kinematics_batch(robot, q, RowMatrix(), out, 1);
  out.position = four.data();
  kinematics_batch(robot, q, RowMatrix(), out, 4);
  EXPECT_EQ((one - four).cwiseAbs().maxCoeff(), 0.0);
}

TEST(Kinematics, FramePosesEndAtTheFlange) {
  Random random(3);
  const Robot robot = testing::random_robot(random, 6);
  const Vector q = random.vector(6, 3.0);
  std::vector<Pose> poses;
  frame_poses(robot, q, poses);
  EXPECT_TRUE((poses.back() * robot.tool()).position.isApprox(forward_kinematics(robot, q).position, 1e-14));
}

TEST(Kinematics, RefusesAWrongNumberOfAxes) {
  Random random(4);
  const Robot robot = testing::random_robot(random, 6);
  EXPECT_THROW(forward_kinematics(robot, Vector::Zero(5)), InvalidArgument);
}

}  // namespace
}  // namespace exactarm
