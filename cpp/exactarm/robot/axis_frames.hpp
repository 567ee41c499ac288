// Poses of the axis frames A_i (dynamics_model.hpp) in the robot's base frame, over a scalar T:
// `double`, or `Lanes` for eight configurations at once.
//   A_i = A_{i-1} K_{i-1} Rot_z(sign q + zero) [Trans_z(sign q) when prismatic]
// q: rad or m, n values. `poses` holds n entries.
#pragma once

#include "exactarm/base/sincos.hpp"
#include "exactarm/robot/dynamics_model.hpp"
#include "exactarm/robot/spatial.hpp"

namespace exactarm {

template <class T>
struct AxisPose {
  spatial::Vec3<T> x, y, z, origin;

  spatial::Vec3<T> turn(const spatial::Vec3<T>& v) const { return v.x * x + v.y * y + v.z * z; }
  spatial::Vec3<T> turn_back(const spatial::Vec3<T>& v) const { return {dot(x, v), dot(y, v), dot(z, v)}; }
};

// Sine and cosine of every axis' DH angle; those of prismatic axes are constants.
template <class T>
void axis_angles(const DynamicsModel& model, const T* q, T* angle, T* sine, T* cosine) {
  const int n = model.size();
  for (int i = 0; i < n; ++i) angle[i] = model.axes[i].sign * q[i] + model.axes[i].zero;
  sincos(angle, n, sine, cosine);
  for (int i = 0; i < n; ++i)
    if (!model.axes[i].revolute) {
      sine[i] = model.axes[i].sin_zero;
      cosine[i] = model.axes[i].cos_zero;
    }
}

template <class T>
void axis_poses(const DynamicsModel& model, const T* q, const T* sine, const T* cosine, AxisPose<T>* poses) {
  using Vec = spatial::Vec3<T>;
  const T one(1.0), none(0.0);
  Vec x{one, none, none}, y{none, one, none}, z{none, none, one}, origin = Vec::zero();
  const int n = model.size();
  for (int i = 0; i < n; ++i) {
    const DynamicsAxis& axis = model.axes[i];
    AxisPose<T>& pose = poses[i];
    pose.x = cosine[i] * x + sine[i] * y;
    pose.y = cosine[i] * y - sine[i] * x;
    pose.z = z;
    if (!axis.revolute) origin += (axis.sign * q[i]) * z;
    pose.origin = origin;
    // K_i
    origin += T(axis.d) * z + T(axis.a) * pose.x;
    y = T(axis.cos_alpha) * pose.y + T(axis.sin_alpha) * z;
    z = T(axis.cos_alpha) * z - T(axis.sin_alpha) * pose.y;
    x = pose.x;
    if (axis.twisted) {
      x = T(axis.cos_beta) * pose.x - T(axis.sin_beta) * z;
      z = T(axis.sin_beta) * pose.x + T(axis.cos_beta) * z;
    }
  }
}

// S_i: the twist of everything outboard at unit joint rate, in the base frame at its origin.
template <class T>
EXACTARM_INLINE spatial::Twist<T> joint_twist(const DynamicsAxis& axis, const AxisPose<T>& pose) {
  const T sign(axis.sign);
  const spatial::Vec3<T> z = sign * pose.z;
  if (axis.revolute) return {z, cross(pose.origin, z)};
  return {spatial::Vec3<T>::zero(), z};
}

// Spatial inertia in the base frame at its origin of a link with mass, centre of mass c and inertia Jc about
// it in the axis frame: J = R Jc R^T + m (|p|^2 1 - p p^T), p = origin + R c.
template <class T>
EXACTARM_INLINE spatial::SpatialInertia<T> world_inertia(const T& mass, const spatial::Vec3<T>& centre,
                                         const spatial::Sym3<T>& central, const AxisPose<T>& pose) {
  using Vec = spatial::Vec3<T>;
  const Vec p = pose.origin + pose.turn(centre), h = mass * p;
  const Vec u = pose.turn({central.xx, central.xy, central.xz}),
            v = pose.turn({central.xy, central.yy, central.yz}),
            w = pose.turn({central.xz, central.yz, central.zz});
  const Vec &x = pose.x, &y = pose.y, &z = pose.z;
  const T xx = h.x * p.x, yy = h.y * p.y, zz = h.z * p.z;
  return {mass, h,
          {u.x * x.x + v.x * y.x + w.x * z.x + yy + zz, u.x * x.y + v.x * y.y + w.x * z.y - h.x * p.y,
           u.x * x.z + v.x * y.z + w.x * z.z - h.x * p.z, u.y * x.y + v.y * y.y + w.y * z.y + xx + zz,
           u.y * x.z + v.y * y.z + w.y * z.z - h.y * p.z, u.z * x.z + v.z * y.z + w.z * z.z + xx + yy}};
}

}  // namespace exactarm
