// Rotations: elementary matrices, the exponential map and its inverse.
//   exp(w) = I + sin(|w|)/|w| [w] + (1 - cos(|w|))/|w|^2 [w]^2   (Rodrigues)
// Rotation vectors in rad.
#pragma once

#include <cmath>

#include "exactarm/base/types.hpp"

namespace exactarm {

inline Matrix3 skew(const Vector3& v) {
  Matrix3 m;
  m << 0, -v.z(), v.y(), v.z(), 0, -v.x(), -v.y(), v.x(), 0;
  return m;
}

inline Matrix3 rotation_x(double angle) {
  const double c = std::cos(angle), s = std::sin(angle);
  Matrix3 m;
  m << 1, 0, 0, 0, c, -s, 0, s, c;
  return m;
}

inline Matrix3 rotation_y(double angle) {
  const double c = std::cos(angle), s = std::sin(angle);
  Matrix3 m;
  m << c, 0, s, 0, 1, 0, -s, 0, c;
  return m;
}

inline Matrix3 rotation_z(double angle) {
  const double c = std::cos(angle), s = std::sin(angle);
  Matrix3 m;
  m << c, -s, 0, s, c, 0, 0, 0, 1;
  return m;
}

inline Matrix3 rotation_exp(const Vector3& w) {
  const double angle = w.norm();
  const Matrix3 k = skew(w);
  // Below 1e-4 the series is exact to rounding, the quotient is not.
  const double square = angle * angle;
  const double a = angle < 1e-4 ? 1.0 - square / 6.0 : std::sin(angle) / angle;
  const double half = std::sin(0.5 * angle);
  const double b = angle < 1e-4 ? 0.5 - square / 24.0 : 2.0 * half * half / square;
  return Matrix3::Identity() + a * k + b * k * k;
}

inline Vector3 rotation_log(const Matrix3& rotation) {
  const Eigen::AngleAxisd angle_axis(rotation);
  return angle_axis.angle() * angle_axis.axis();
}

}  // namespace exactarm
