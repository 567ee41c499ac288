// Two ways to fill the eight lanes for a recursion along a serial chain, so that one source serves both:
//   SamplesInLanes: a block is one axis, the lanes are eight samples (knots) - a batch.
//   AxesInLanes:    a block is up to eight axes, the lanes are the axes - one sample alone.
// What differs is how sums along the chain run, and how a value of one axis meets those of all others:
//   inboard(own, sum)    sum_i = own_1 + ... + own_i;  `sum` enters as the result of the block before
//   outboard(own, sum)   sum_i = own_i + ... + own_n;  `sum` enters as the result of the block after
//   of_axis(block, lane) the value of one axis in every lane
// Quantities offer each_lanes(a, b, f): f(Lanes& of a, const Lanes& of b) for all their members.
#pragma once

#include "exactarm/base/lanes.hpp"
#include "exactarm/robot/spatial.hpp"

namespace exactarm {

template <class F>
EXACTARM_INLINE void each_lanes(Lanes& a, const Lanes& b, const F& f) {
  f(a, b);
}
template <class F>
EXACTARM_INLINE void each_lanes(spatial::Vec3<Lanes>& a, const spatial::Vec3<Lanes>& b, const F& f) {
  f(a.x, b.x);
  f(a.y, b.y);
  f(a.z, b.z);
}
template <class F>
EXACTARM_INLINE void each_lanes(spatial::Sym3<Lanes>& a, const spatial::Sym3<Lanes>& b, const F& f) {
  f(a.xx, b.xx);
  f(a.xy, b.xy);
  f(a.xz, b.xz);
  f(a.yy, b.yy);
  f(a.yz, b.yz);
  f(a.zz, b.zz);
}
template <class F>
EXACTARM_INLINE void each_lanes(spatial::Twist<Lanes>& a, const spatial::Twist<Lanes>& b, const F& f) {
  each_lanes(a.angular, b.angular, f);
  each_lanes(a.linear, b.linear, f);
}
template <class F>
EXACTARM_INLINE void each_lanes(spatial::Wrench<Lanes>& a, const spatial::Wrench<Lanes>& b, const F& f) {
  each_lanes(a.moment, b.moment, f);
  each_lanes(a.force, b.force, f);
}
template <class F>
EXACTARM_INLINE void each_lanes(spatial::InertiaRate<Lanes>& a, const spatial::InertiaRate<Lanes>& b,
                                const F& f) {
  each_lanes(a.first, b.first, f);
  each_lanes(a.second, b.second, f);
}
template <class F>
EXACTARM_INLINE void each_lanes(spatial::SpatialInertia<Lanes>& a, const spatial::SpatialInertia<Lanes>& b,
                                const F& f) {
  f(a.mass, b.mass);
  each_lanes(a.first, b.first, f);
  each_lanes(a.second, b.second, f);
}

struct SamplesInLanes {
  using Value = Lanes;
  static constexpr int kAxesABlock = 1;
  static int blocks(int axes) { return axes; }

  template <class Q>
  EXACTARM_INLINE static void inboard(const Q& own, Q& sum) { sum += own; }
  template <class Q>
  EXACTARM_INLINE static void outboard(const Q& own, Q& sum) { sum += own; }
  template <class Q>
  EXACTARM_INLINE static const Q& of_axis(const Q& block, int /*lane*/) { return block; }
};

struct AxesInLanes {
  using Value = double;
  static constexpr int kAxesABlock = Lanes::kCount;
  static int blocks(int axes) { return (axes + Lanes::kCount - 1) / Lanes::kCount; }

  template <class Q>
  EXACTARM_INLINE static void inboard(const Q& own, Q& sum) {
    each_lanes(sum, own, [](Lanes& s, const Lanes& o) __attribute__((always_inline)) {
      const Lanes::Native none = {};
      Lanes::Native x = o.v;
      x += __builtin_shufflevector(x, none, 8, 0, 1, 2, 3, 4, 5, 6);
      x += __builtin_shufflevector(x, none, 8, 8, 0, 1, 2, 3, 4, 5);
      x += __builtin_shufflevector(x, none, 8, 8, 8, 8, 0, 1, 2, 3);
      s.v = x + __builtin_shufflevector(s.v, s.v, 7, 7, 7, 7, 7, 7, 7, 7);
    });
  }

  template <class Q>
  EXACTARM_INLINE static void outboard(const Q& own, Q& sum) {
    each_lanes(sum, own, [](Lanes& s, const Lanes& o) __attribute__((always_inline)) {
      const Lanes::Native none = {};
      Lanes::Native x = o.v;
      x += __builtin_shufflevector(x, none, 1, 2, 3, 4, 5, 6, 7, 8);
      x += __builtin_shufflevector(x, none, 2, 3, 4, 5, 6, 7, 8, 8);
      x += __builtin_shufflevector(x, none, 4, 5, 6, 7, 8, 8, 8, 8);
      s.v = x + __builtin_shufflevector(s.v, s.v, 0, 0, 0, 0, 0, 0, 0, 0);
    });
  }

  template <class Q>
  EXACTARM_INLINE static Q of_axis(const Q& block, int lane) {
    Q one;
    each_lanes(one, block,
               [lane](Lanes& x, const Lanes& b) __attribute__((always_inline)) { x = Lanes(b[lane]); });
    return one;
  }
};

}  // namespace exactarm
