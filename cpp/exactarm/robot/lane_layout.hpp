// Two ways to fill the eight lanes for a recursion along a serial chain, so that one source serves both:
//   SamplesInLanes: a block is one axis, the lanes are eight samples (knots) - a batch.
//   AxesInLanes:    a block is up to eight axes, the lanes are the axes - one sample alone.
// What differs is only how the sums along the chain run:
//   inboard(own, before)   value_i = sum over axes 1..i,   `before` = result of the block before
//   outboard(own, after)   value_i = sum over axes i..n,   `after`  = result of the block after
// and how a value of one axis meets those of all others (`of_axis`).
#pragma once

#include "exactarm/base/lanes.hpp"
#include "exactarm/robot/spatial.hpp"

namespace exactarm {

// Applies f to every Lanes of a spatial quantity.
template <class F>
void each_lanes(Lanes& a, const F& f) { f(a); }
template <class F>
void each_lanes(spatial::Vec3<Lanes>& a, const F& f) { f(a.x); f(a.y); f(a.z); }
template <class F>
void each_lanes(spatial::Sym3<Lanes>& a, const F& f) { f(a.xx); f(a.xy); f(a.xz); f(a.yy); f(a.yz); f(a.zz); }
template <class F>
void each_lanes(spatial::Twist<Lanes>& a, const F& f) { each_lanes(a.angular, f); each_lanes(a.linear, f); }
template <class F>
void each_lanes(spatial::Wrench<Lanes>& a, const F& f) { each_lanes(a.moment, f); each_lanes(a.force, f); }
template <class F>
void each_lanes(spatial::InertiaRate<Lanes>& a, const F& f) { each_lanes(a.first, f); each_lanes(a.second, f); }
template <class F>
void each_lanes(spatial::SpatialInertia<Lanes>& a, const F& f) {
  f(a.mass);
  each_lanes(a.first, f);
  each_lanes(a.second, f);
}

struct SamplesInLanes {
  using Value = Lanes;
  static constexpr int kAxesABlock = 1;
  static int blocks(int axes) { return axes; }

  template <class Q>
  static Q inboard(const Q& own, const Q& before) { Q sum = before; sum += own; return sum; }
  template <class Q>
  static Q outboard(const Q& own, const Q& after) { Q sum = after; sum += own; return sum; }
  template <class Q>
  static const Q& of_axis(const Q& block, int /*lane*/) { return block; }
};

struct AxesInLanes {
  using Value = double;
  static constexpr int kAxesABlock = Lanes::kCount;
  static int blocks(int axes) { return (axes + Lanes::kCount - 1) / Lanes::kCount; }

  template <class Q>
  static Q inboard(const Q& own, const Q& before) {
    Q sum = own, carried = before;
    each_lanes(sum, [](Lanes& x) {
      const Lanes::Native none = {};
      x.v += __builtin_shufflevector(x.v, none, 8, 0, 1, 2, 3, 4, 5, 6);
      x.v += __builtin_shufflevector(x.v, none, 8, 8, 0, 1, 2, 3, 4, 5);
      x.v += __builtin_shufflevector(x.v, none, 8, 8, 8, 8, 0, 1, 2, 3);
    });
    each_lanes(carried, [](Lanes& x) { x.v = __builtin_shufflevector(x.v, x.v, 7, 7, 7, 7, 7, 7, 7, 7); });
    sum += carried;
    return sum;
  }

  template <class Q>
  static Q outboard(const Q& own, const Q& after) {
    Q sum = own, carried = after;
    each_lanes(sum, [](Lanes& x) {
      const Lanes::Native none = {};
      x.v += __builtin_shufflevector(x.v, none, 1, 2, 3, 4, 5, 6, 7, 8);
      x.v += __builtin_shufflevector(x.v, none, 2, 3, 4, 5, 6, 7, 8, 8);
      x.v += __builtin_shufflevector(x.v, none, 4, 5, 6, 7, 8, 8, 8, 8);
    });
    each_lanes(carried, [](Lanes& x) { x.v = __builtin_shufflevector(x.v, x.v, 0, 0, 0, 0, 0, 0, 0, 0); });
    sum += carried;
    return sum;
  }

  template <class Q>
  static Q of_axis(const Q& block, int lane) {
    Q one = block;
    each_lanes(one, [lane](Lanes& x) { x = Lanes(x[lane]); });
    return one;
  }
};

}  // namespace exactarm
