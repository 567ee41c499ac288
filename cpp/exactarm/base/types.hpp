// Aliases of the Eigen types that the whole core uses, declared once.
// All quantities are in SI units and radians.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>

namespace exactarm {

using Vector = Eigen::VectorXd;
using Vector3 = Eigen::Vector3d;
using Vector6 = Eigen::Matrix<double, 6, 1>;
using Matrix = Eigen::MatrixXd;
using Matrix3 = Eigen::Matrix3d;
using Matrix6 = Eigen::Matrix<double, 6, 6>;
// Batches cross the border to Python: one row a sample, contiguous.
using RowMatrix = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

using ConstVectorRef = Eigen::Ref<const Vector>;
using VectorRef = Eigen::Ref<Vector>;
using ConstMatrixRef = Eigen::Ref<const Matrix>;
using MatrixRef = Eigen::Ref<Matrix>;
using ConstRowMatrixRef = Eigen::Ref<const RowMatrix>;

// Pose of one frame in another: p_a = rotation * p_b + position.
struct Pose {
  Matrix3 rotation = Matrix3::Identity();
  Vector3 position = Vector3::Zero();
};

inline Pose operator*(const Pose& left, const Pose& right) {
  return {left.rotation * right.rotation, left.rotation * right.position + left.position};
}

}  // namespace exactarm
