// Harmonics of a gear over many angles at once, eight of them through the SIMD units together.
//   e(x) = sum_j (a_j sin(w_j x) + b_j (cos(w_j x) - 1)) / w_j   transmission error: theta / ratio = x + e(x)
//   s(x) = de/dx = sum_j a_j cos(w_j x) - b_j sin(w_j x)          u / ratio - 1, thesis (2.10), E5
// Angles in rad at the output; w in cycles per output revolution; a, b relative to the ratio.
#pragma once

#include <cmath>

#include "exactarm/base/sincos.hpp"
#include "exactarm/robot/robot.hpp"

namespace exactarm {

// Eight doubles side by side in memory, at any address.
EXACTARM_INLINE Lanes load(const double* from) {
  Lanes lanes(0.0);
  __builtin_memcpy(&lanes.v, from, sizeof(lanes.v));
  return lanes;
}
EXACTARM_INLINE void store(const Lanes& lanes, double* to) {
  __builtin_memcpy(to, &lanes.v, sizeof(lanes.v));
}

struct HarmonicSums {
  Lanes error, slope, bend;  // e, s, ds/dx
};

// Sums over all orders at eight angles;
// sin(w_j x) and cos(w_j x) are left in sine and cosine (one entry an order).
EXACTARM_INLINE HarmonicSums harmonic_sums(const GearTable& table, const Lanes& x, Lanes* sine,
                                           Lanes* cosine) {
  constexpr long kTurns = 16;  // of the first wave from one exact sine to the next: 16 roundings at most
  HarmonicSums sums{Lanes(0.0), Lanes(0.0), Lanes(0.0)};
  for (long j = 0; j < table.size(); ++j) {
    const double w = table.order()[j], a = table.a()[j], b = table.b()[j];
    if (table.multiples() && j % kTurns) {
      sine[j] = sine[j - 1] * cosine[0] + cosine[j - 1] * sine[0];
      cosine[j] = cosine[j - 1] * cosine[0] - sine[j - 1] * sine[0];
    } else {
      sincos(x * Lanes(w), sine[j], cosine[j]);
    }
    const Lanes rising = sine[j] * Lanes(a) + cosine[j] * Lanes(b);
    sums.error += (rising - Lanes(b)) * Lanes(1.0 / w);
    sums.slope += cosine[j] * Lanes(a) - sine[j] * Lanes(b);
    sums.bend -= rising * Lanes(w);
  }
  return sums;
}

// Newton for x + factor e(x) = phi from the guess in x. The sums are those of the last angle but one, whose
// distance is below `tolerance`; for a table that is not monotone it stops after some passes, wherever it is.
EXACTARM_INLINE HarmonicSums deliver(const GearTable& table, const Lanes& phi, const Lanes& factor,
                                     double tolerance, Lanes& x, Lanes* sine, Lanes* cosine) {
  constexpr int kPasses = 12;
  constexpr double kLeastSlope = 0.1;
  HarmonicSums sums;
  for (int pass = 0; pass < kPasses; ++pass) {
    sums = harmonic_sums(table, x, sine, cosine);
    Lanes slope = Lanes(1.0) + factor * sums.slope;
    slope.v = slope.v > kLeastSlope ? slope.v : Lanes(kLeastSlope).v;
    const Lanes step = (x + factor * sums.error - phi) / slope;
    x -= step;
    bool rests = true;
    for (int lane = 0; lane < Lanes::kCount; ++lane) rests &= !(std::abs(step[lane]) >= tolerance);
    if (rests) break;
  }
  return sums;
}

// x (count) with x + factor e(x) = phi, and the slope s there; factor: one for each row, or null for 1.
void delivered_angles(const GearTable& table, const double* phi, const double* factor, long count,
                      double tolerance, int threads, double* x, double* slope);

// Output angles Xi^{-1}(theta) and the ratio u there, as gear_output_angle (gear.hpp) finds them one by one:
// where Newton alone does not settle, that one is asked.
void gear_outputs(double ratio, const GearTable& table, const double* theta, long count, double* phi,
                  double* u);

// s(x) and e(x) at any angles; either may be null.
void transmission(const GearTable& table, const double* x, long count, int threads, double* error,
                  double* slope);

// sin(w_j x_i) and cos(w_j x_i), row by row.
void waves(const Vector& order, const double* x, long count, double* sine, double* cosine);

}  // namespace exactarm
