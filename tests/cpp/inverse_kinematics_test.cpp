#include "exactarm/robot/inverse_kinematics.hpp"

#include <gtest/gtest.h>

#include <Eigen/LU>
#include <Eigen/SVD>

#include "exactarm/robot/kinematics.hpp"
#include "racer.hpp"
#include "random_states.hpp"

namespace exactarm {
namespace {

using testing::Random;
using Status = InverseKinematicsStatus;

const InverseKinematicsOptions kOptions;

// The racer with every geometric parameter a little off, as identification leaves it.
Robot identified_racer(Random& random) {
  RobotDescription robot = testing::racer();
  for (Joint& joint : robot.joints) {
    Frame& frame = joint.frame;
    frame.d += random.uniform(-1e-3, 1e-3);
    frame.a += random.uniform(-1e-3, 1e-3);
    frame.alpha += random.uniform(-2e-3, 2e-3);
    frame.beta += random.uniform(-2e-3, 2e-3);
    frame.zero += random.uniform(-5e-3, 5e-3);
  }
  return robot;
}

Vector random_joints(const Robot& robot, Random& random) {
  Vector q(robot.axes());
  for (long i = 0; i < q.size(); ++i)
    q[i] = random.uniform(robot.joint(i).limits.q_min, robot.joint(i).limits.q_max);
  return q;
}

double pose_distance(const Pose& a, const Pose& b) {
  return (a.position - b.position).norm() + (a.rotation - b.rotation).norm();
}

// Straight path in y at the orientation of (4.6).
void line(const Vector3& start, const Vector3& end, long rows, RowMatrix& positions, RowMatrix& rotations) {
  positions.resize(rows, 3);
  rotations = RowMatrix::Zero(rows, 9);
  for (long k = 0; k < rows; ++k) {
    positions.row(k) = (start + (end - start) * k / (rows - 1.0)).transpose();
    rotations(k, 0) = rotations(k, 4) = -1.0;
    rotations(k, 8) = 1.0;
  }
}

const Vector kStart = (Vector(6) << 0, M_PI / 2, 0, 0, M_PI / 2, 0).finished();

TEST(InverseKinematics, BranchesOfAnIdentifiedArmHoldThePoseThatMadeThem) {
  Random random(30);
  int eight = 0;
  for (int sample = 0; sample < 10 * testing::samples(); ++sample) {
    const Robot robot = identified_racer(random);
    const Vector q = random_joints(robot, random);
    const Pose target = forward_kinematics(robot, q);
    InverseKinematicsOptions unlimited;
    unlimited.check_limits = false;
    const std::vector<Vector> branches = inverse_kinematics_branches(robot, target, unlimited);
    double nearest = 1e9;
    for (const Vector& branch : branches) {
      EXPECT_LT(pose_distance(forward_kinematics(robot, branch), target), 1e-9);
      double worst = 0.0;
      for (long i = 0; i < 6; ++i)
        worst = std::max(worst, std::abs(std::remainder(branch[i] - q[i], 2 * M_PI)));
      nearest = std::min(nearest, worst);
    }
    // Two branches meet at a singular pose; near one, Newton may leave by the other.
    if (geometric_jacobian(robot, q).jacobiSvd().singularValues()[5] > 0.03) {
      EXPECT_LT(nearest, 1e-6) << "sample " << sample;
    }
    eight += branches.size() == 8;
  }
  EXPECT_GT(eight, 0);
}

TEST(InverseKinematics, AnalyticStartsAreExactOnTheNominalArmWithAnySignAndZero) {
  Random random(31);
  for (int sample = 0; sample < testing::samples(); ++sample) {
    RobotDescription robot = testing::racer();
    for (Joint& joint : robot.joints) {
      Frame& frame = joint.frame;
      frame.sign = random.uniform(-1, 1) < 0 ? -1.0 : 1.0;
      frame.zero = random.uniform(-3, 3);
    }
    robot.joints[1].frame.d = 0.1;
    robot.joints[0].frame.alpha *= random.uniform(-1, 1) < 0 ? -1.0 : 1.0;
    robot.joints[3].frame.alpha *= random.uniform(-1, 1) < 0 ? -1.0 : 1.0;
    robot.joints[1].frame.alpha = random.uniform(-1, 1) < 0 ? M_PI : 0.0;
    robot.base = random.pose();
    robot.tool = random.pose();
    const Pose target = forward_kinematics(robot, random_joints(robot, random));
    double nearest = 1e9;
    for (const Vector& q : spherical_wrist_starts(robot, target))
      nearest = std::min(nearest, pose_distance(forward_kinematics(robot, q), target));
    EXPECT_LT(nearest, 1e-10) << "sample " << sample;
  }
}

TEST(InverseKinematics, FollowsTheLineOfTheThesisWithAboutOneIterationAPose) {
  Random random(32);
  const Robot robot = identified_racer(random);
  RowMatrix positions, rotations, q;
  line({0.834, 0, 1}, {0.834, 0.5, 1}, 2501, positions, rotations);
  const auto report = inverse_kinematics_path(robot, positions, rotations, kStart, q, kOptions);
  ASSERT_EQ(report.status, Status::solved);
  for (long k = 0; k < q.rows(); k += 100)
    EXPECT_LT(
        (forward_kinematics(robot, q.row(k).transpose()).position - positions.row(k).transpose()).norm(),
        1e-12);
  EXPECT_LE(report.iterations, 1.1 * q.rows());
}

TEST(InverseKinematics, SevenAxesGiveTheNearestSolution) {
  Random random(33);
  for (int sample = 0; sample < testing::samples(); ++sample) {
    const Robot robot = testing::random_robot(random, 7);
    const Vector q0 = random.vector(7, 1.0);
    const Pose target = forward_kinematics(robot, q0 + random.vector(7, 0.05));
    Vector q = q0;
    InverseKinematicsOptions options;
    options.check_limits = false;
    ASSERT_EQ(inverse_kinematics(robot, target, q, options).status, Status::solved);
    EXPECT_LT(pose_distance(forward_kinematics(robot, q), target), 1e-9);
    // At the optimum the way back to q0 has no part in the null space of the Jacobian.
    const Matrix jacobian = geometric_jacobian(robot, q);
    const Matrix null_space = jacobian.fullPivLu().kernel();
    EXPECT_LT((null_space.transpose() * (q - q0)).norm() / null_space.norm(), 1e-5);
  }
}

TEST(InverseKinematics, WithoutExtrapolationAPathIsItsPosesOneByOne) {
  const Robot robot = testing::racer();
  InverseKinematicsOptions options;
  options.extrapolate = false;
  RowMatrix positions, rotations, q, alone;
  line({0.834, 0, 1}, {0.834, 0.5, 1}, 11, positions, rotations);
  ASSERT_EQ(inverse_kinematics_path(robot, positions, rotations, kStart, q, options).status, Status::solved);
  Vector start = kStart;
  for (long k = 0; k < q.rows(); ++k) {
    inverse_kinematics_path(robot, positions.row(k), rotations.row(k), start, alone, options);
    EXPECT_EQ(q.row(k), alone.row(0)) << "pose " << k;
    start = alone.row(0);
  }
  // A step away from the solution before it counts as a jump, as one away from the extrapolation does.
  options.largest_jump = 0.5 * (q.row(4) - q.row(3)).cwiseAbs().maxCoeff();
  EXPECT_EQ(inverse_kinematics_path(robot, positions, rotations, kStart, q, options).index, 1);
}

TEST(InverseKinematics, UnreachablePoseIsReportedWithItsIndex) {
  RowMatrix positions, rotations, q;
  line({0.834, 0, 1}, {3.0, 0, 1}, 201, positions, rotations);
  const auto report = inverse_kinematics_path(testing::racer(), positions, rotations, kStart, q, kOptions);
  EXPECT_TRUE(report.status == Status::unreachable || report.status == Status::singular);
  EXPECT_GT(report.index, 10);
  EXPECT_LT(report.index, 60);
  EXPECT_GT(report.value, 1e-6);
}

TEST(InverseKinematics, JointLimitIsReportedWithJointAndAmount) {
  RobotDescription robot = testing::racer();
  robot.joints[0].limits.q_max = 0.2;
  RowMatrix positions, rotations, q;
  line({0.834, 0, 1}, {0.834, 0.5, 1}, 501, positions, rotations);
  const auto report = inverse_kinematics_path(robot, positions, rotations, kStart, q, kOptions);
  EXPECT_EQ(report.status, Status::joint_limit);
  EXPECT_EQ(report.joint, 0);
  EXPECT_EQ(report.limit, 0.2);
  EXPECT_GT(report.value, 0.2);
}

TEST(InverseKinematics, PathThroughAWristSingularityIsReported) {
  const Robot robot = testing::racer();
  const long rows = 401;
  RowMatrix positions(rows, 3), rotations(rows, 9), q;
  for (long k = 0; k < rows; ++k) {
    Vector joints = kStart;
    joints[4] = M_PI / 2 * (1.0 - 2.0 * k / (rows - 1.0));
    const Pose pose = forward_kinematics(robot, joints);
    positions.row(k) = pose.position.transpose();
    Eigen::Map<Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(rotations.row(k).data()) = pose.rotation;
  }
  const auto report = inverse_kinematics_path(robot, positions, rotations, kStart, q, kOptions);
  EXPECT_EQ(report.status, Status::singular);
  EXPECT_NEAR(report.index, 200, 2);
}

TEST(InverseKinematics, NotANumberIsReportedNotReturned) {
  RowMatrix positions, rotations, q;
  line({0.834, 0, 1}, {0.834, 0.5, 1}, 11, positions, rotations);
  positions(5, 1) = std::nan("");
  const auto report = inverse_kinematics_path(testing::racer(), positions, rotations, kStart, q, kOptions);
  EXPECT_EQ(report.status, Status::not_finite);
  EXPECT_EQ(report.index, 5);
}

}  // namespace
}  // namespace exactarm
