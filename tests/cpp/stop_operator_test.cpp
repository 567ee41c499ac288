#include "exactarm/robot/stop_operator.hpp"

#include <gtest/gtest.h>

#include "central_difference.hpp"
#include "random_states.hpp"

namespace exactarm {
namespace {

TEST(StopOperator, FollowsUpToTheReachAndComesBackAtOnce) {
  Vector motion(7), memory(7), slope(7);
  motion << 0.0, 0.5, 1.5, 3.0, 2.5, 0.0, 0.5;
  stop_operator(motion.data(), 7, 1.0, memory.data(), slope.data());
  Vector expected(7);
  expected << 0.0, 0.5, 1.0, 1.0, 0.5, -1.0, -0.5;
  EXPECT_LE((memory - expected).cwiseAbs().maxCoeff(), 1e-15);
}

TEST(StopOperator, DerivativeByTheReachMatchesCentralDifference) {
  testing::Random random;
  Vector motion = random.vector(200, 0.3);
  for (long k = 1; k < motion.size(); ++k) motion[k] += motion[k - 1];
  const auto below = [&](const Vector& reach) {
    Vector memory(motion.size()), slope(motion.size());
    stop_operator(motion.data(), motion.size(), reach[0], memory.data(), slope.data());
    return memory;
  };
  Vector memory(motion.size()), slope(motion.size());
  stop_operator(motion.data(), motion.size(), 0.4, memory.data(), slope.data());
  testing::expect_derivative(below, Vector::Constant(1, 0.4), slope, 1e-7, 1e-7);
}

}  // namespace
}  // namespace exactarm
