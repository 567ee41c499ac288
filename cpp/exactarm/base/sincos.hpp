// Sine and cosine of eight angles at once, to 1 unit in the last place or two.
//   x = k pi/2 + r, |r| <= pi/4 (pi/2 as a sum of three doubles), Taylor series of sin r and cos r
// cut below 1e-17, then the quadrant k. Beyond 1e5 rad, and for what is not finite, libm.
#pragma once

#include <cmath>

#include "exactarm/base/lanes.hpp"

namespace exactarm {

inline void sincos(const Lanes& x, Lanes& sine, Lanes& cosine) {
  using Native = Lanes::Native;
  typedef long long Integers __attribute__((vector_size(64)));
  constexpr double kTwoOverPi = 0.63661977236758134308;
  // Adding and taking away 1.5 * 2^52 rounds to the nearest integer, which its low bits then hold.
  constexpr double kRound = 6755399441055744.0;
  // pi/2 in three parts; the products with k <= 2^17 of the first two are exact.
  constexpr double kHalfPi1 = 1.5707963267341256, kHalfPi2 = 6.0771005063039658e-11,
                   kHalfPi3 = 2.0222662487959506e-21;

  const Native shifted = x.v * kTwoOverPi + kRound;
  const Native k = shifted - kRound;
  const Integers quadrant = (Integers)shifted;
  const Native r = ((x.v - k * kHalfPi1) - k * kHalfPi2) - k * kHalfPi3;
  const Native s = r * r;

  Native p = s * (-1.0 / 1307674368000.0) + 1.0 / 6227020800.0;
  p = p * s - 1.0 / 39916800.0;
  p = p * s + 1.0 / 362880.0;
  p = p * s - 1.0 / 5040.0;
  p = p * s + 1.0 / 120.0;
  p = p * s - 1.0 / 6.0;
  p = p * s * r + r;

  Native c = s * (1.0 / 20922789888000.0) - 1.0 / 87178291200.0;
  c = c * s + 1.0 / 479001600.0;
  c = c * s - 1.0 / 3628800.0;
  c = c * s + 1.0 / 40320.0;
  c = c * s - 1.0 / 720.0;
  c = c * s + 1.0 / 24.0;
  c = c * s * s + (1.0 - 0.5 * s);

  const Integers odd = (quadrant & 1) != 0;
  const Integers sine_falls = (quadrant & 2) != 0, cosine_falls = ((quadrant + 1) & 2) != 0;
  const Native sine_abs = odd ? c : p, cosine_abs = odd ? p : c;
  sine.v = sine_falls ? -sine_abs : sine_abs;
  cosine.v = cosine_falls ? -cosine_abs : cosine_abs;

  const Integers inside = (x.v < 1e5) & (x.v > -1e5);
  bool all_inside = true;
  for (int lane = 0; lane < Lanes::kCount; ++lane) all_inside &= inside[lane] != 0;
  if (__builtin_expect(!all_inside, 0))
    for (int lane = 0; lane < Lanes::kCount; ++lane)
      if (inside[lane] == 0) {  // the others keep their bits, whoever their neighbours are
        sine.set(lane, std::sin(x[lane]));
        cosine.set(lane, std::cos(x[lane]));
      }
}

// `count` angles of plain doubles, eight at a time.
inline void sincos(const double* x, int count, double* sine, double* cosine) {
  Lanes angle(0.0), s, c;
  for (int first = 0; first < count; first += Lanes::kCount) {
    const int width = count - first < Lanes::kCount ? count - first : Lanes::kCount;
    for (int lane = 0; lane < width; ++lane) angle.set(lane, x[first + lane]);
    sincos(angle, s, c);
    for (int lane = 0; lane < width; ++lane) {
      sine[first + lane] = s[lane];
      cosine[first + lane] = c[lane];
    }
  }
}

inline void sincos(const Lanes* x, int count, Lanes* sine, Lanes* cosine) {
  for (int i = 0; i < count; ++i) sincos(x[i], sine[i], cosine[i]);
}

}  // namespace exactarm
