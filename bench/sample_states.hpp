// The robot and the states that all rows of a benchmark share: the Racer, seeded random states.
#pragma once

#include <random>

#include "racer.hpp"

namespace exactarm::bench {

inline Robot racer() { return testing::racer(); }

// n x count, uniform in [-bound, bound].
inline Matrix states(long n, long count, double bound, unsigned seed) {
  std::mt19937_64 engine(seed);
  std::uniform_real_distribution<double> uniform(-bound, bound);
  Matrix values(n, count);
  for (long k = 0; k < values.size(); ++k) values.data()[k] = uniform(engine);
  return values;
}

// Enough that no branch is learnt by heart, few enough for the first-level cache.
constexpr long kStates = 512;

struct States {
  explicit States(long n)
      : q(states(n, kStates, 2.5, 1)), q_dot(states(n, kStates, 2.0, 2)), q_ddot(states(n, kStates, 5.0, 3)),
        lambda(states(n, kStates, 1.0, 4)) {}
  Matrix q, q_dot, q_ddot, lambda;
};

}  // namespace exactarm::bench
