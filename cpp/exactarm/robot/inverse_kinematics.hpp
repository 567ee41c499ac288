// Inverse kinematics of the accurate model, thesis (4.5):
//   min |q - q_0|^2   s.t.   p(q) = p_d,  R_d' R(q) = I
// Gauss-Newton with the least step, dq = J^+ e + (I - J^+ J)(q_0 - q), e = (p_d - p, log(R_d R')):
// for six axes the second part vanishes, for more it picks the nearest solution.
// Along a path every pose starts from the extrapolated solutions before it.
//
// The pose is that of the target (base * chain * tool) in m; q in rad. Joint limits are checked, not
// steered around; `conditioning` is the ratio of the last to the first pivot of a column-pivoted
// QR of J (m, rad), near 0 at a singular pose.
#pragma once

#include "exactarm/robot/robot.hpp"

namespace exactarm {

enum class InverseKinematicsStatus { solved, unreachable, singular, joint_limit, not_finite };

struct InverseKinematicsOptions {
  double tolerance = 1e-12;         // m and rad
  int iterations = 60;              // for one pose
  double singular = 1e-4;           // conditioning below which a pose counts as singular
  bool extrapolate = true;          // along a path; else every pose starts from the solution before it
  double largest_jump = 0.2;        // rad (m) away from that start, along a path
  bool check_limits = true;
};

struct InverseKinematicsReport {
  InverseKinematicsStatus status = InverseKinematicsStatus::solved;
  long index = -1;                  // pose that failed
  int joint = -1;                   // from 0, for a joint limit
  double value = 0.0, limit = 0.0;  // joint limit: angle and limit; otherwise the error left over (m, rad)
  double conditioning = 1.0;        // smallest on the way
  long conditioning_index = 0;
  long iterations = 0;
};

// One pose, started from q (in, out).
InverseKinematicsReport inverse_kinematics(const Robot& robot, const Pose& target, VectorRef q,
                                           const InverseKinematicsOptions& options);

// positions: rows x 3; rotations: rows x 9, each row major; q: rows x n, NaN from the pose that failed on.
InverseKinematicsReport inverse_kinematics_path(const Robot& robot, ConstRowMatrixRef positions,
                                                ConstRowMatrixRef rotations, ConstVectorRef start,
                                                RowMatrix& q, const InverseKinematicsOptions& options);

// All solutions of one pose within the joint limits (whole turns brought inside them), nearest to
// the middle of the limits first. With a spherical wrist on an arm of one vertical and two parallel axes
// the starts are analytic, on the geometry with twists rounded to right angles; otherwise they are
// seeded random starts, and the list may miss some.
std::vector<Vector> inverse_kinematics_branches(const Robot& robot, const Pose& target,
                                                const InverseKinematicsOptions& options);

// The analytic starts; empty when the arm is not of that kind. q out of reach is the nearest in reach.
std::vector<Vector> spherical_wrist_starts(const Robot& robot, const Pose& target);

}  // namespace exactarm
