// Small vectors of mechanics over a scalar T: `double`, or `Lanes` for eight samples at once.
//
//   Twist (angular w, linear v): velocity field v + w x r.  Wrench (moment n about the origin, force f).
//   dot(twist, wrench) = power.  cross(a, b) = a x b (twists),  cross_dual(a, f) = a x* f,
//   dot(b, cross_dual(a, f)) = -dot(cross(a, b), f).
//   SpatialInertia (m, h = m c, J about the origin): (w, v) -> (J w + h x v, m v - h x w).
// Featherstone, Rigid Body Dynamics Algorithms (2008), chapter 2, angular part first.
#pragma once

#include "exactarm/base/lanes.hpp"
#include "exactarm/base/types.hpp"

namespace exactarm::spatial {

template <class T>
struct Vec3 {
  T x, y, z;

  static Vec3 zero() { return {T(0.0), T(0.0), T(0.0)}; }
  Vec3& operator+=(const Vec3& b) { x += b.x; y += b.y; z += b.z; return *this; }
  Vec3& operator-=(const Vec3& b) { x -= b.x; y -= b.y; z -= b.z; return *this; }
};

template <class T>
EXACTARM_INLINE Vec3<T> operator+(const Vec3<T>& a, const Vec3<T>& b) {
  return {a.x + b.x, a.y + b.y, a.z + b.z};
}
template <class T>
EXACTARM_INLINE Vec3<T> operator-(const Vec3<T>& a, const Vec3<T>& b) {
  return {a.x - b.x, a.y - b.y, a.z - b.z};
}
template <class T>
EXACTARM_INLINE Vec3<T> operator*(const T& s, const Vec3<T>& a) { return {s * a.x, s * a.y, s * a.z}; }
template <class T>
EXACTARM_INLINE T dot(const Vec3<T>& a, const Vec3<T>& b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
template <class T>
EXACTARM_INLINE Vec3<T> cross(const Vec3<T>& a, const Vec3<T>& b) {
  return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}

template <class T>
EXACTARM_INLINE Vec3<T> constant(const Vector3& a) { return {T(a.x()), T(a.y()), T(a.z())}; }

// Symmetric 3 x 3 matrix.
template <class T>
struct Sym3 {
  T xx, xy, xz, yy, yz, zz;

  static Sym3 zero() { return {T(0.0), T(0.0), T(0.0), T(0.0), T(0.0), T(0.0)}; }
  Sym3& operator+=(const Sym3& b) {
    xx += b.xx; xy += b.xy; xz += b.xz; yy += b.yy; yz += b.yz; zz += b.zz;
    return *this;
  }
};

template <class T>
EXACTARM_INLINE Sym3<T> constant_symmetric(const Matrix3& m) {
  return {T(m(0, 0)), T(m(0, 1)), T(m(0, 2)), T(m(1, 1)), T(m(1, 2)), T(m(2, 2))};
}

template <class T>
EXACTARM_INLINE Vec3<T> operator*(const Sym3<T>& m, const Vec3<T>& a) {
  return {m.xx * a.x + m.xy * a.y + m.xz * a.z, m.xy * a.x + m.yy * a.y + m.yz * a.z,
          m.xz * a.x + m.yz * a.y + m.zz * a.z};
}

template <class T>
struct Twist {
  Vec3<T> angular, linear;

  static Twist zero() { return {Vec3<T>::zero(), Vec3<T>::zero()}; }
  Twist& operator+=(const Twist& b) { angular += b.angular; linear += b.linear; return *this; }
};

template <class T>
struct Wrench {
  Vec3<T> moment, force;

  static Wrench zero() { return {Vec3<T>::zero(), Vec3<T>::zero()}; }
  Wrench& operator+=(const Wrench& b) { moment += b.moment; force += b.force; return *this; }
};

template <class T>
EXACTARM_INLINE Twist<T> operator+(const Twist<T>& a, const Twist<T>& b) {
  return {a.angular + b.angular, a.linear + b.linear};
}
template <class T>
EXACTARM_INLINE Twist<T> operator*(const T& s, const Twist<T>& a) { return {s * a.angular, s * a.linear}; }
template <class T>
EXACTARM_INLINE Wrench<T> operator+(const Wrench<T>& a, const Wrench<T>& b) {
  return {a.moment + b.moment, a.force + b.force};
}
template <class T>
EXACTARM_INLINE Wrench<T> operator-(const Wrench<T>& a, const Wrench<T>& b) {
  return {a.moment - b.moment, a.force - b.force};
}
template <class T>
EXACTARM_INLINE Wrench<T> operator*(const T& s, const Wrench<T>& a) { return {s * a.moment, s * a.force}; }

template <class T>
EXACTARM_INLINE T dot(const Twist<T>& a, const Wrench<T>& f) {
  return dot(a.angular, f.moment) + dot(a.linear, f.force);
}
template <class T>
EXACTARM_INLINE Twist<T> cross(const Twist<T>& a, const Twist<T>& b) {
  return {cross(a.angular, b.angular), cross(a.angular, b.linear) + cross(a.linear, b.angular)};
}
template <class T>
EXACTARM_INLINE Wrench<T> cross_dual(const Twist<T>& a, const Wrench<T>& f) {
  return {cross(a.angular, f.moment) + cross(a.linear, f.force), cross(a.angular, f.force)};
}

template <class T>
struct SpatialInertia {
  T mass;
  Vec3<T> first;   // h = m c
  Sym3<T> second;  // J about the origin

  static SpatialInertia zero() { return {T(0.0), Vec3<T>::zero(), Sym3<T>::zero()}; }
  SpatialInertia& operator+=(const SpatialInertia& b) {
    mass += b.mass; first += b.first; second += b.second;
    return *this;
  }
};

template <class T>
EXACTARM_INLINE Wrench<T> operator*(const SpatialInertia<T>& inertia, const Twist<T>& v) {
  return {inertia.second * v.angular + cross(inertia.first, v.linear),
          inertia.mass * v.linear - cross(inertia.first, v.angular)};
}

// Rate of a spatial inertia that moves with twist v: v x* I - I v x; its mass does not change.
template <class T>
struct InertiaRate {
  Vec3<T> first;
  Sym3<T> second;

  static InertiaRate zero() { return {Vec3<T>::zero(), Sym3<T>::zero()}; }
  InertiaRate& operator+=(const InertiaRate& b) { first += b.first; second += b.second; return *this; }
};

template <class T>
EXACTARM_INLINE InertiaRate<T> inertia_rate(const Twist<T>& v, const SpatialInertia<T>& inertia) {
  const Vec3<T>&w = v.angular, &u = v.linear, &h = inertia.first;
  const Sym3<T>& J = inertia.second;
  const Vec3<T> cx = cross(w, Vec3<T>{J.xx, J.xy, J.xz}), cy = cross(w, Vec3<T>{J.xy, J.yy, J.yz}),
                cz = cross(w, Vec3<T>{J.xz, J.yz, J.zz});
  const T xx = h.x * u.x, yy = h.y * u.y, zz = h.z * u.z, two(2.0);
  return {inertia.mass * u + cross(w, h),
          {two * (cx.x + yy + zz), cy.x + cx.y - h.x * u.y - u.x * h.y, cz.x + cx.z - h.x * u.z - u.x * h.z,
           two * (cy.y + xx + zz), cz.y + cy.z - h.y * u.z - u.y * h.z, two * (cz.z + xx + yy)}};
}

template <class T>
EXACTARM_INLINE Wrench<T> operator*(const InertiaRate<T>& rate, const Twist<T>& v) {
  return {rate.second * v.angular + cross(rate.first, v.linear), cross(v.angular, rate.first)};
}

}  // namespace exactarm::spatial
