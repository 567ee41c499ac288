#include "exactarm/robot/dynamics.hpp"

#include <gtest/gtest.h>

#include "central_difference.hpp"
#include "exactarm/robot/kinematics.hpp"
#include "random_states.hpp"

namespace exactarm {
namespace {

using testing::Random;

// Kinetic energy from the frames alone: differentiates the poses along q_dot.
double kinetic_energy_of_poses(const Robot& robot, const Vector& q, const Vector& q_dot) {
  const double step = 1e-5;
  std::vector<Pose> before, after, here;
  frame_poses(robot, q - step * q_dot, before);
  frame_poses(robot, q + step * q_dot, after);
  frame_poses(robot, q, here);
  double energy = 0.0;
  for (long i = 0; i < robot.axes(); ++i) {
    const LinkInertia& link = robot.link(i);
    const Vector3 velocity = ((after[i + 1].rotation * link.centre_of_mass + after[i + 1].position) -
                              (before[i + 1].rotation * link.centre_of_mass + before[i + 1].position)) /
                             (2.0 * step);
    const Vector3 rate =
        rotation_log(after[i + 1].rotation * before[i + 1].rotation.transpose()) / (2.0 * step);
    const Vector3 body_rate = here[i + 1].rotation.transpose() * rate;
    energy += 0.5 * link.mass * velocity.squaredNorm() + 0.5 * body_rate.dot(link.inertia * body_rate);
  }
  return energy;
}

double potential_of_poses(const Robot& robot, const Vector& q) {
  std::vector<Pose> poses;
  frame_poses(robot, q, poses);
  double energy = 0.0;
  for (long i = 0; i < robot.axes(); ++i) {
    const Vector3 c = poses[i + 1].rotation * robot.link(i).centre_of_mass + poses[i + 1].position;
    // The poses are in the device's frame, gravity in the robot's base frame.
    energy -= robot.link(i).mass * (robot.base().rotation * robot.gravity()).dot(c);
  }
  return energy;
}

TEST(Dynamics, MassMatrixGivesTheKineticEnergyOfTheMovingFrames) {
  Random random(20);
  for (int sample = 0; sample < testing::samples(); ++sample) {
    const int n = 1 + sample % 8;
    const Robot robot = testing::random_robot(random, n, sample % 2 == 1);
    const Vector q = random.vector(n, 3.0), q_dot = random.vector(n, 2.0);
    const double expected = kinetic_energy_of_poses(robot, q, q_dot);
    EXPECT_NEAR(0.5 * q_dot.dot(mass_matrix(robot, q) * q_dot), expected, 1e-7 * expected);
  }
}

TEST(Dynamics, MassMatrixIsSymmetricPositiveDefinite) {
  Random random(21);
  for (int sample = 0; sample < testing::samples(); ++sample) {
    const int n = 1 + sample % 8;
    const Robot robot = testing::random_robot(random, n, sample % 2 == 1);
    const Matrix D = mass_matrix(robot, random.vector(n, 3.0));
    EXPECT_EQ((D - D.transpose()).cwiseAbs().maxCoeff(), 0.0);
    EXPECT_EQ(Eigen::LLT<Matrix>(D).info(), Eigen::Success);
  }
}

TEST(Dynamics, GravityTorqueIsTheSlopeOfThePotential) {
  Random random(22);
  for (int sample = 0; sample < testing::samples(); ++sample) {
    const int n = 1 + sample % 8;
    const Robot robot = testing::random_robot(random, n, sample % 2 == 1);
    const Vector q = random.vector(n, 3.0);
    const auto potential = [&](const Vector& x) { return Vector::Constant(1, potential_of_poses(robot, x)); };
    testing::expect_derivative(potential, q, gravity_torque(robot, q).transpose());
    testing::expect_derivative([&](const Vector& x) { return gravity_torque(robot, x); }, q,
                               gravity_torque_jacobian(robot, q));
  }
}

TEST(Dynamics, InverseDynamicsAtRestIsGravityAndItsSlopeInTheAccelerationIsTheMassMatrix) {
  Random random(23);
  for (int sample = 0; sample < testing::samples(); ++sample) {
    const int n = 1 + sample % 8;
    const Robot robot = testing::random_robot(random, n, sample % 2 == 1);
    const Vector q = random.vector(n, 3.0), q_dot = random.vector(n, 2.0), q_ddot = random.vector(n, 5.0);
    const Vector zero = Vector::Zero(n);
    EXPECT_TRUE(inverse_dynamics(robot, q, zero, zero).isApprox(gravity_torque(robot, q), 1e-12));
    const Vector difference =
        inverse_dynamics(robot, q, q_dot, q_ddot) - inverse_dynamics(robot, q, q_dot, zero);
    EXPECT_TRUE(difference.isApprox(mass_matrix(robot, q) * q_ddot, 1e-11));
  }
}

// Lagrange: tau = D qdd + (dD/dt) qd - 1/2 d(qd' D qd)/dq + g.
TEST(Dynamics, InverseDynamicsObeysLagrange) {
  Random random(24);
  for (int sample = 0; sample < testing::samples(); ++sample) {
    const int n = 1 + sample % 8;
    const Robot robot = testing::random_robot(random, n, sample % 2 == 1);
    const Vector q = random.vector(n, 3.0), q_dot = random.vector(n, 2.0), q_ddot = random.vector(n, 5.0);
    const auto momentum = [&](const Vector& x) { return Vector(mass_matrix(robot, x) * q_dot); };
    const auto energy = [&](const Vector& x) {
      return Vector::Constant(1, 0.5 * q_dot.dot(mass_matrix(robot, x) * q_dot));
    };
    const Vector expected = mass_matrix(robot, q) * q_ddot +
                            testing::central_difference(momentum, q) * q_dot -
                            testing::central_difference(energy, q).transpose() + gravity_torque(robot, q);
    EXPECT_LE((inverse_dynamics(robot, q, q_dot, q_ddot) - expected).norm(), 1e-7 * expected.norm());
  }
}

TEST(Dynamics, OneSampleAndBatchesOfAnyLengthAgree) {
  Random random(25);
  const Robot robot = testing::random_robot(random, 7, true);
  const DynamicsModel model(robot);
  DynamicsWorkspace workspace(model);
  for (const long rows : {1L, 7L, 8L, 21L, 1100L}) {
    RowMatrix q(rows, 7), q_dot(rows, 7), q_ddot(rows, 7), tau(rows, 7), g(rows, 7);
    for (auto* matrix : {&q, &q_dot, &q_ddot})
      for (long k = 0; k < matrix->size(); ++k) matrix->data()[k] = random.uniform(-2, 2);
    inverse_dynamics_batch(model, q, q_dot, q_ddot, tau.data(), 3);
    gravity_torque_batch(model, q, g.data(), 3);
    Vector one(7), g_one(7);
    for (long row = 0; row < rows; ++row) {
      inverse_dynamics(model, workspace, q.row(row).transpose(), q_dot.row(row).transpose(),
                       q_ddot.row(row).transpose(), one);
      gravity_torque(model, workspace, q.row(row).transpose(), g_one);
      EXPECT_LE((one - tau.row(row).transpose()).norm(), 1e-12 * one.norm());
      EXPECT_LE((g_one - g.row(row).transpose()).norm(), 1e-12 * g_one.norm());
    }
  }
}

TEST(Dynamics, RefusesARobotWithoutMassesAndAWrongNumberOfAxes) {
  Random random(26);
  RobotDescription robot = testing::random_robot(random, 6);
  EXPECT_THROW(inverse_dynamics(robot, Vector::Zero(6), Vector::Zero(5), Vector::Zero(6)), InvalidArgument);
  for (Joint& joint : robot.joints) joint.link.reset();
  EXPECT_THROW(gravity_torque(robot, Vector::Zero(6)), InvalidArgument);
}

}  // namespace
}  // namespace exactarm
