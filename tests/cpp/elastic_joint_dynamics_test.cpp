#include "exactarm/robot/elastic_joint_dynamics.hpp"

#include <gtest/gtest.h>

#include "allocation_count.hpp"
#include "central_difference.hpp"
#include "exactarm/robot/gear.hpp"
#include "random_states.hpp"

namespace exactarm {
namespace {

using testing::Random;

// Soft springs, heavy rotors, uneven gears: the couplings are large and the time scales close together. The
// link inertias of a random robot are large enough to contain the rotors.
RobotDescription elastic_robot(Random& random, int n, bool with_prismatic) {
  RobotDescription robot = testing::random_robot(random, n, with_prismatic);
  for (int i = 0; i < n; ++i) {
    Joint& joint = robot.joints[i];
    joint.gear.ratio = random.uniform(2, 5);
    const Vector order = (Vector(2) << 1.0, 3.0).finished(), a = random.vector(2, 0.05),
                 b = random.vector(2, 0.05);
    joint.gear.cw = GearTable(order, a, b);
    joint.gear.ccw = GearTable(order, random.vector(2, 0.05), b);
    joint.spring = {random.uniform(200, 500), random.uniform(0, 1000)};
    joint.drive.rotor_inertia = random.uniform(0.05, 0.2);
    joint.drive.joint = {random.uniform(1, 4), random.uniform(0.1, 2), 0.5, 0.3};
    joint.drive.motor = {random.uniform(1, 4), random.uniform(0.1, 2), 0.0, 1.0};
    joint.link->inertia += 0.5 * Matrix3::Identity();
  }
  return robot;
}

Vector random_state(Random& random, const ElasticJointModel& model) {
  const int n = model.size();
  Vector x(4 * n);
  x << random.vector(n, 2.0), random.vector(n, 1.0), Vector::Zero(n), random.vector(n, 4.0);
  for (int i = 0; i < n; ++i)
    x[2 * n + i] = gear_motor_angle(model.ratios[i], model.tables[i],
                                    x[i] - model.offsets[i] + random.uniform(-0.1, 0.1));
  return x;
}

RobotDescription without_friction(RobotDescription robot) {
  for (Joint& joint : robot.joints) joint.drive.joint = joint.drive.motor = Friction{};
  return robot;
}

struct Case {
  RobotDescription robot;
  ElasticJointOptions options;
};

Case random_case(Random& random, int sample) {
  Case c{elastic_robot(random, 1 + sample % 7, sample % 3 == 2), {}};
  c.options.rotor_coupling = sample % 2 == 1;
  c.options.friction_width = 0.1;
  for (std::size_t i = 0; i < c.robot.joints.size(); ++i)
    c.options.gear_direction.push_back(static_cast<int>(i % 3) - 1);
  return c;
}

TEST(ElasticJointDynamics, ForwardUndoesInverse) {
  Random random(80);
  for (int sample = 0; sample < testing::samples(); ++sample) {
    const Case c = random_case(random, sample);
    const ElasticJointModel model(c.robot, c.options);
    ElasticJointDynamics dynamics(model);
    const Vector x = random_state(random, model), a = random.vector(2 * model.size(), 3.0);
    Vector torques(a.size()), back(a.size());
    dynamics.inverse(x, a, torques);
    dynamics.forward(x, torques, back);
    EXPECT_LE((back - a).norm(), 1e-10 * a.norm());
  }
}

TEST(ElasticJointDynamics, SlopesMatchCentralDifference) {
  Random random(81);
  for (int sample = 0; sample < testing::samples(); ++sample) {
    const Case c = random_case(random, sample);
    const ElasticJointModel model(c.robot, c.options);
    ElasticJointDynamics dynamics(model);
    const int n = model.size();
    const Vector x = random_state(random, model), a = random.vector(2 * n, 3.0);
    Vector torques(2 * n);
    Matrix by_state(2 * n, 4 * n), by_acceleration(2 * n, 2 * n), jacobian(4 * n, 4 * n);
    dynamics.inverse(x, a, torques, by_state, by_acceleration);
    const auto inverse = [&](const Vector& state, const Vector& acceleration) {
      Vector out(2 * n);
      dynamics.inverse(state, acceleration, out);
      return out;
    };
    EXPECT_LE((torques - inverse(x, a)).norm(), 1e-12 * torques.norm());
    testing::expect_derivative([&](const Vector& s) { return inverse(s, a); }, x, by_state);
    testing::expect_derivative([&](const Vector& s) { return inverse(x, s); }, a, by_acceleration);
    dynamics.rate_jacobian(x, a, jacobian);
    const auto rate = [&](const Vector& s) {
      Vector out(4 * n), acceleration(2 * n);
      dynamics.forward(s, torques, acceleration);
      out << s.segment(n, n), acceleration.head(n), s.tail(n), acceleration.tail(n);
      return out;
    };
    testing::expect_derivative(rate, x, jacobian);
  }
}

TEST(ElasticJointDynamics, MatricesGiveTheSameTorquesAndDDotMinusTwoCIsSkew) {
  Random random(82);
  for (int sample = 0; sample < testing::samples(); ++sample) {
    Case c = random_case(random, sample);
    c.robot = without_friction(c.robot);
    const ElasticJointModel model(c.robot, c.options);
    ElasticJointDynamics dynamics(model);
    const int n = model.size();
    const Vector x = random_state(random, model), a = random.vector(2 * n, 3.0);
    Vector xi_dot(2 * n), torques(2 * n);
    xi_dot << x.segment(n, n), x.tail(n);
    ElasticJointMatrices m(n);
    dynamics.matrices(x, m);
    dynamics.inverse(x, a, torques);
    EXPECT_LE((m.D * a + m.C * xi_dot + m.g - torques).norm(), 1e-11 * torques.norm());
    EXPECT_EQ(Eigen::LLT<Matrix>(m.D).info(), Eigen::Success);
    const auto mass_along = [&](const Vector& time) {
      Vector moved = x;
      moved.head(n) += time[0] * x.segment(n, n);
      ElasticJointMatrices there(n);
      dynamics.matrices(moved, there);
      return Vector(there.D.reshaped());
    };
    const Matrix D_dot = testing::central_difference(mass_along, Vector::Zero(1)).reshaped(2 * n, 2 * n);
    const Matrix skew = D_dot - 2.0 * m.C;
    EXPECT_LE((skew + skew.transpose()).norm(), 1e-8 * (1.0 + m.C.norm()));
  }
}

TEST(ElasticJointDynamics, CoriolisMatrixIsMadeOfChristoffelSymbols) {
  Random random(83);
  for (int sample = 0; sample < testing::samples(); ++sample) {
    const int n = 1 + sample % 7;
    const Robot robot = testing::random_robot(random, n, sample % 2 == 1);
    const Vector q = random.vector(n, 3.0), q_dot = random.vector(n, 2.0);
    const Matrix slopes = testing::central_difference(
        [&](const Vector& x) { return Vector(mass_matrix(robot, x).reshaped()); }, q);
    const auto d = [&](int row, int column, int by) { return slopes(row + n * column, by); };
    Matrix expected = Matrix::Zero(n, n);
    for (int k = 0; k < n; ++k)
      for (int j = 0; j < n; ++j)
        for (int i = 0; i < n; ++i) expected(k, j) += 0.5 * (d(k, j, i) + d(k, i, j) - d(i, j, k)) * q_dot[i];
    EXPECT_LE((coriolis_matrix(robot, q, q_dot) - expected).norm(), 1e-7 * (1.0 + expected.norm()));
  }
}

// Classical Runge-Kutta; the error of one step falls with its fifth power.
Vector integrate(ElasticJointDynamics& dynamics, Vector x, const Vector& torques, double step, int steps) {
  const long n = x.size() / 4;
  const auto rate = [&](const Vector& s) {
    Vector out(4 * n), a(2 * n);
    dynamics.forward(s, torques, a);
    out << s.segment(n, n), a.head(n), s.tail(n), a.tail(n);
    return out;
  };
  for (int k = 0; k < steps; ++k) {
    const Vector k1 = rate(x), k2 = rate(x + 0.5 * step * k1), k3 = rate(x + 0.5 * step * k2),
                 k4 = rate(x + step * k3);
    x += step / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4);
  }
  return x;
}

TEST(ElasticJointDynamics, KeepsItsEnergyWithoutFrictionAndLosesItWith) {
  Random random(84);
  for (int sample = 0; sample < 4; ++sample) {
    Case c = random_case(random, sample + 3);
    const ElasticJointModel loss(c.robot, c.options), model(without_friction(c.robot), c.options);
    ElasticJointDynamics lossy(loss), dynamics(model);
    const Vector x = random_state(random, model), none = Vector::Zero(2 * model.size());
    const double before = dynamics.energy(x).total();
    const Vector after = integrate(dynamics, x, none, 2e-4, 1000);
    EXPECT_NEAR(dynamics.energy(after).total(), before, 1e-7 * std::abs(dynamics.energy(x).kinetic));
    EXPECT_GT((after - x).head(model.size()).norm(), 0.01);
    EXPECT_LT(lossy.energy(integrate(lossy, x, none, 2e-4, 1000)).total(), before - 1e-3);
  }
}

TEST(ElasticJointDynamics, RestsWhereTheSpringsCarryGravity) {
  Random random(85);
  const Robot robot = without_friction(elastic_robot(random, 6, false));
  const ElasticJointModel model(robot);
  ElasticJointDynamics dynamics(model);
  const Vector q = random.vector(6, 2.0), g = gravity_torque(robot, q);
  Vector x = Vector::Zero(24), torques = Vector::Zero(12), a(12);
  x.head(6) = q;
  for (int i = 0; i < 6; ++i) {
    const Spring& spring = robot.joint(i).spring;
    double low = -3.0, high = 3.0;  // kappa(e) = g, found without the inverse that is under test elsewhere
    for (int k = 0; k < 100; ++k) {
      const double e = 0.5 * (low + high);
      (spring.linear * e + spring.cubic * e * e * e < g[i] ? low : high) = e;
    }
    const double phi = q[i] - model.offsets[i] + low;
    x[12 + i] = gear_motor_angle(model.ratios[i], model.tables[i], phi);
    torques[6 + i] = g[i] / gear_ratio(model.ratios[i], model.tables[i], phi, 0);
  }
  dynamics.forward(x, torques, a);
  EXPECT_LE(a.cwiseAbs().maxCoeff(), 1e-8);
}

TEST(ElasticJointDynamics, AllocatesNothing) {
  Random random(86);
  const Case c = random_case(random, 5);
  const ElasticJointModel model(c.robot, c.options);
  ElasticJointDynamics dynamics(model);
  const int n = model.size();
  const Vector x = random_state(random, model), torques = random.vector(2 * n, 3.0);
  Vector a(2 * n);
  Matrix jacobian(4 * n, 4 * n);
  dynamics.forward(x, torques, a);
  const long before = testing::allocation_count();
  dynamics.forward(x, torques, a);
  dynamics.rate_jacobian(x, a, jacobian);
  const double energy = dynamics.energy(x).total();
  EXPECT_EQ(testing::allocation_count(), before);
  EXPECT_TRUE(std::isfinite(energy));
}

TEST(ElasticJointDynamics, RefusesAxesWithoutSpringOrRotor) {
  Random random(87);
  RobotDescription robot = elastic_robot(random, 3, false);
  robot.joints[1].spring = Spring{};
  EXPECT_THROW(ElasticJointModel{robot}, InvalidArgument);
  robot = elastic_robot(random, 3, false);
  robot.joints[2].drive.rotor_inertia = 0.0;
  EXPECT_THROW(ElasticJointModel{robot}, InvalidArgument);
}

}  // namespace
}  // namespace exactarm
