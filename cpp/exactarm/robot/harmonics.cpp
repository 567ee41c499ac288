#include "exactarm/robot/harmonics.hpp"

#include <algorithm>
#include <vector>

#include "exactarm/base/parallel.hpp"
#include "exactarm/robot/gear.hpp"

namespace exactarm {
namespace {

constexpr long kLeastRowsAThread = 20000;

// Eight values from `from` on; past the end the last one again.
Lanes loaded(const double* values, long from, long count) {
  if (from + Lanes::kCount <= count) return load(values + from);
  Lanes lanes(0.0);
  for (int lane = 0; lane < Lanes::kCount; ++lane) lanes.set(lane, values[std::min(from + lane, count - 1)]);
  return lanes;
}

void store(const Lanes& lanes, long from, long count, double* out) {
  if (!out) return;
  if (from + Lanes::kCount <= count) return store(lanes, out + from);
  for (int lane = 0; lane < Lanes::kCount && from + lane < count; ++lane) out[from + lane] = lanes[lane];
}

}  // namespace

void delivered_angles(const GearTable& table, const double* phi, const double* factor, long count,
                      double tolerance, int threads, double* x, double* slope) {
  parallel_rows(count, threads, kLeastRowsAThread, [&](long begin, long end) {
    std::vector<Lanes> sine(table.size()), cosine(table.size());
    for (long i = begin; i < end; i += Lanes::kCount) {
      const Lanes target = loaded(phi, i, end);
      Lanes angle = target;
      const HarmonicSums sums = deliver(table, target, factor ? loaded(factor, i, end) : Lanes(1.0),
                                        tolerance, angle, sine.data(), cosine.data());
      store(angle, i, end, x);
      store(sums.slope, i, end, slope);
    }
  });
}

void gear_outputs(double ratio, const GearTable& table, const double* theta, long count, double* phi,
                  double* u) {
  constexpr double kNear = 1e-7, kSettled = 1e-10;  // rad; the last step squares what is left
  std::vector<Lanes> sine(table.size()), cosine(table.size());
  for (long i = 0; i < count; i += Lanes::kCount) {
    const Lanes target = loaded(theta, i, count) / Lanes(ratio);
    Lanes x = target;
    deliver(table, target, Lanes(1.0), kNear, x, sine.data(), cosine.data());
    const HarmonicSums sums = harmonic_sums(table, x, sine.data(), cosine.data());
    const Lanes slope = Lanes(1.0) + sums.slope, step = (x + sums.error - target) / slope;
    store(x - step, i, count, phi);
    store(Lanes(ratio) * slope, i, count, u);
    for (int lane = 0; lane < Lanes::kCount && i + lane < count; ++lane) {
      if (std::abs(step[lane]) < kSettled && slope[lane] > 0.0) continue;
      phi[i + lane] = gear_output_angle(ratio, table, theta[i + lane]);
      u[i + lane] = gear_ratio(ratio, table, phi[i + lane], 0);
    }
  }
}

void transmission(const GearTable& table, const double* x, long count, int threads, double* error,
                  double* slope) {
  parallel_rows(count, threads, kLeastRowsAThread, [&](long begin, long end) {
    std::vector<Lanes> sine(table.size()), cosine(table.size());
    for (long i = begin; i < end; i += Lanes::kCount) {
      const HarmonicSums sums = harmonic_sums(table, loaded(x, i, end), sine.data(), cosine.data());
      store(sums.error, i, end, error);
      store(sums.slope, i, end, slope);
    }
  });
}

void waves(const Vector& order, const double* x, long count, double* sine, double* cosine) {
  constexpr long kRows = 64;  // so that a single order fills the lanes too
  const long orders = order.size();
  std::vector<double> angle(kRows * orders);
  for (long i = 0; i < count; i += kRows) {
    const long rows = std::min(kRows, count - i), size = rows * orders;
    for (long r = 0; r < rows; ++r)
      for (long j = 0; j < orders; ++j) angle[r * orders + j] = order[j] * x[i + r];
    Lanes s, c;
    for (long k = 0; k < size; k += Lanes::kCount) {
      sincos(loaded(angle.data(), k, size), s, c);
      store(s, k, size, sine + i * orders);
      store(c, k, size, cosine + i * orders);
    }
  }
}

}  // namespace exactarm
