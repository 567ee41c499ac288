// Forward kinematics, geometric Jacobian and identification Jacobian of a serial robot.
//
// Identification Jacobian (thesis (3.7), (3.8), completed by E8): rows are the position (m) and
// the left rotation increment (rad, R' = exp(delta) R) of the target in the measuring frame,
// columns per axis d, a, alpha, beta, q, gear ratio, then base (translation, rotation) and
// tool (translation, rotation). Base: p' = p + dp, R' = exp(dr) R; tool alike, in the flange frame.
// The column of the gear ratio is the q column times dq/dratio, which the caller provides.
#pragma once

#include "exactarm/robot/robot.hpp"

namespace exactarm {

enum FrameParameter { kD, kA, kAlpha, kBeta, kQ, kRatio, kFrameParameters };
inline constexpr long kPlacementParameters = 6;  // of base and tool: translation, then rotation

inline long identification_columns(long axes) {
  if (axes < 0 || axes > Robot::kMostAxes)
    throw InvalidArgument("axes: expected 0 to " + std::to_string(Robot::kMostAxes) + ", found " +
                          std::to_string(axes));
  return kFrameParameters * axes + 2 * kPlacementParameters;
}

// Pose of frame i in frame i-1 at joint coordinate q.
Pose frame_transform(const Frame& frame, double q);

// Poses of base (index 0) and all frames 1..n in the measuring device's frame.
void frame_poses(const Robot& robot, ConstVectorRef q, std::vector<Pose>& poses);

// Pose of the target (tool) in the measuring device's frame.
Pose forward_kinematics(const Robot& robot, ConstVectorRef q);

// 6 x n: linear rows, then angular rows, of the target in the measuring frame.
Eigen::Matrix<double, 6, Eigen::Dynamic> geometric_jacobian(const Robot& robot, ConstVectorRef q);

// One output row block a sample. Pointers may be null where a result is not wanted.
struct KinematicsBatch {
  double* position = nullptr;   // rows x 3
  double* rotation = nullptr;   // rows x 3 x 3, row major
  double* jacobian = nullptr;   // rows x 6 x n
  double* identification = nullptr;  // rows x 6 x identification_columns(n)
};

// q: rows x n. dq_dratio: rows x n or empty (then the ratio columns are 0).
void kinematics_batch(const Robot& robot, ConstRowMatrixRef q, ConstRowMatrixRef dq_dratio,
                      const KinematicsBatch& out, int threads);

}  // namespace exactarm
