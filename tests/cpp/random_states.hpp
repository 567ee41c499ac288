// Seeded random robots and states for the tests.
#pragma once

#include <random>

#include "exactarm/base/rotation.hpp"
#include "exactarm/robot/robot.hpp"

namespace exactarm::testing {

inline int& samples() {
  static int value = 20;
  return value;
}

inline unsigned long& seed() {
  static unsigned long value = 20201110;
  return value;
}

class Random {
 public:
  explicit Random(unsigned long offset = 0) : engine_(seed() + offset) {}
  double uniform(double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(engine_);
  }
  Vector vector(long size, double bound) {
    Vector v(size);
    for (long i = 0; i < size; ++i) v[i] = uniform(-bound, bound);
    return v;
  }
  RowMatrix matrix(long rows, long columns, double bound = 1.0) {
    return vector(rows * columns, bound).reshaped<Eigen::RowMajor>(rows, columns);
  }
  Pose pose() { return {rotation_exp(vector(3, 2.0)), vector(3, 1.0)}; }

 private:
  std::mt19937_64 engine_;
};

// A chain with arbitrary geometry, masses, gears, springs; axis 2 prismatic when asked for.
inline RobotDescription random_robot(Random& random, int axes, bool with_prismatic = false) {
  RobotDescription robot;
  for (int i = 0; i < axes; ++i) {
    Joint joint;
    Frame& frame = joint.frame;
    frame.type = with_prismatic && i == 1 ? JointType::prismatic : JointType::revolute;
    frame.sign = random.uniform(-1, 1) < 0 ? -1.0 : 1.0;
    frame.zero = random.uniform(-3, 3);
    frame.d = random.uniform(-0.7, 0.7);
    frame.a = random.uniform(-0.7, 0.7);
    frame.alpha = random.uniform(-2, 2);
    frame.beta = random.uniform(-0.3, 0.3);
    LinkInertia link;
    link.mass = random.uniform(0.5, 40);
    link.centre_of_mass = random.vector(3, 0.3);
    const Matrix3 root = Matrix3::Random();
    link.inertia = root * root.transpose() * 0.1 + 0.05 * Matrix3::Identity();
    joint.link = link;
    joint.gear.ratio = random.uniform(40, 120);
    joint.spring = {random.uniform(1e4, 3e5), random.uniform(0, 1e9)};
    Drive& drive = joint.drive;
    drive.rotor_inertia = random.uniform(5e-5, 2e-3);
    drive.joint.coulomb = random.uniform(1, 40);
    drive.joint.viscous = random.uniform(1, 20);
    joint.limits = {-3, 3, 4, 10, 500};
    joint.q_offset = random.uniform(-1, 1);
    robot.joints.push_back(joint);
  }
  robot.base = random.pose();
  robot.tool = random.pose();
  robot.gravity = Vector3(0.3, -0.2, -9.8);
  return robot;
}

}  // namespace exactarm::testing
