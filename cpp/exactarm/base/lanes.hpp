// Eight doubles that go through the SIMD units together: a scalar type for computations that
// treat eight samples (knots, rows) at once. Kernels are templates over the scalar; `double` is
// the other instance, so both come from one source.
//
// The vector extension of the compiler splits the eight into what the machine has
// (one AVX-512, two AVX2, four SSE2 registers).
#pragma once

// Kernels over lanes pay dearly for calls (every value then goes through memory),
// so their parts are forced inline.
#define EXACTARM_INLINE [[gnu::always_inline]] inline

namespace exactarm {

struct alignas(64) Lanes {
  static constexpr int kCount = 8;
  typedef double Native __attribute__((vector_size(64)));

  Native v;

  Lanes() = default;
  Lanes(double value) : v(Native{} + value) {}  // NOLINT: a constant is the same in every lane
  explicit Lanes(const Native& native) : v(native) {}

  double operator[](int lane) const { return v[lane]; }
  void set(int lane, double value) { v[lane] = value; }

  Lanes& operator+=(const Lanes& b) { v += b.v; return *this; }
  Lanes& operator-=(const Lanes& b) { v -= b.v; return *this; }
  Lanes& operator*=(const Lanes& b) { v *= b.v; return *this; }
};

EXACTARM_INLINE Lanes operator+(const Lanes& a, const Lanes& b) { return Lanes(a.v + b.v); }
EXACTARM_INLINE Lanes operator-(const Lanes& a, const Lanes& b) { return Lanes(a.v - b.v); }
EXACTARM_INLINE Lanes operator*(const Lanes& a, const Lanes& b) { return Lanes(a.v * b.v); }
EXACTARM_INLINE Lanes operator/(const Lanes& a, const Lanes& b) { return Lanes(a.v / b.v); }
EXACTARM_INLINE Lanes operator-(const Lanes& a) { return Lanes(-a.v); }

template <class T>
constexpr int lane_count() {
  return 1;
}
template <>
constexpr int lane_count<Lanes>() {
  return Lanes::kCount;
}

}  // namespace exactarm
