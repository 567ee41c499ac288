// The COMAU Racer-7-1.4 of the thesis (Tables A.1-A.12) with the surrogate drives of the data set, for tests.
#pragma once

#include "exactarm/robot/robot.hpp"

namespace exactarm::testing {

inline RobotDescription racer() {
  constexpr double degree = M_PI / 180.0;
  const double geometry[6][4] = {{0.43, 0.15, 90, 0}, {0, 0.59, 0, 0},     {0, 0.13, 90, 0},
                                 {0.684, 0, -90, 0},  {0, 0, 90, 0},       {0.1, 0, 0, 0}};
  const double offset[6] = {0, 90, 90, 0, 0, 0};
  const double limits[6][5] = {{-165, 165, 220, 400, 720},      {-65, 175, 250, 555.56, 1237},
                               {-80, 90, 300, 666.67, 670},     {-210, 210, 550, 1279.07, 48},
                               {-135, 135, 550, 1279.07, 44},   {-270, 270, 600, 1395.35, 34}};
  const double drive[6][4] = {{3.0e5, 0, 1.2e-3, 84.86},      {2.5e5, 1.2e10, 1.2e-3, 82.84},
                              {1.2e5, 6.0e9, 6.0e-4, 69.05},  {2.5e4, 0, 1.2e-4, 51.42},
                              {2.0e4, 0, 1.0e-4, 46.03},      {1.2e4, 0, 6.0e-5, 50}};
  const double inertial[6][10] = {
      {75.831, -0.118, -0.069, -0.049, 1.406, -0.162, -0.337, 1.825, 0.035, 1.803},
      {22.495, -0.317, -0.001, 0.134, 0.093, 0, -0.016, 0.870, 0.001, 0.862},
      {23.396, -0.067, -0.013, -0.020, 0.210, 0.015, 0.035, 0.224, -0.015, 0.290},
      {12.029, -0.001, 0.394, 0.003, 0.795, -0.002, 0, 0.028, 0.022, 0.784},
      {3.229, 0.005, -0.002, 0.003, 0.007, 0, 0, 0.006, 0, 0.004},
      {0.267, 0, 0.001, -0.008, 0.0002, 0, 0, 0.0002, 0, 0.0003}};
  RobotDescription robot;
  for (int i = 0; i < 6; ++i) {
    Joint joint;
    Frame& frame = joint.frame;
    frame.d = geometry[i][0];
    frame.a = geometry[i][1];
    frame.alpha = geometry[i][2] * degree;
    joint.q_offset = offset[i] * degree;
    joint.limits = {limits[i][0] * degree, limits[i][1] * degree, limits[i][2] * degree,
                            limits[i][3] * degree, limits[i][4]};
    joint.spring = {drive[i][0], drive[i][1]};
    joint.drive.rotor_inertia = drive[i][2];
    joint.gear.ratio = drive[i][3];
    LinkInertia link;
    const double* p = inertial[i];
    link.mass = p[0];
    link.centre_of_mass = Vector3(p[1], p[2], p[3]);
    link.inertia << p[4], p[5], p[6], p[5], p[7], p[8], p[6], p[8], p[9];
    joint.link = link;
    robot.joints.push_back(joint);
  }
  // A few of the harmonics of gears 1 to 3, clockwise (Tables A.6-A.8, E5), in both directions alike.
  const double order[3][3] = {{85, 101, 202}, {83, 167, 333}, {69, 140, 279}};
  const double a[3][3] = {{-8.0e-4, 1.15e-3, -8.4e-4}, {8.2e-4, 1.8e-3, 6.8e-4}, {-3.7e-3, 5.3e-3, -1.5e-3}};
  const double b[3][3] = {{3.3e-3, 1.8e-3, 8.7e-4}, {-5.1e-4, 1.8e-5, 4.4e-5}, {-2.5e-3, 1.2e-2, -1.0e-3}};
  for (int i = 0; i < 3; ++i) {
    const auto vector = [](const double (&values)[3]) { return Vector(Eigen::Map<const Vector3>(values)); };
    Gear& gear = robot.joints[i].gear;
    gear.cw = gear.ccw = GearTable(vector(order[i]), vector(a[i]), vector(b[i]));
  }
  return robot;
}

}  // namespace exactarm::testing
