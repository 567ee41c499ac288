#include "exactarm/robot/friction.hpp"

#include <gtest/gtest.h>

#include "central_difference.hpp"
#include "random_states.hpp"

namespace exactarm {
namespace {

using testing::Random;

const Friction kFriction{12.0, 5.0, 4.0, 0.1};

TEST(Friction, SlopeMatchesCentralDifference) {
  Random random(70);
  const auto torque = [](double width) {
    return [width](const Vector& v) { return Vector::Constant(1, friction(kFriction, v[0], width).torque); };
  };
  for (int sample = 0; sample < testing::samples(); ++sample) {
    const double v = sample == 0 ? 0.0 : sample == 1 ? 1e-8 : random.uniform(-1, 1);
    testing::expect_derivative(torque(0.05), Vector::Constant(1, v),
                               Matrix::Constant(1, 1, friction(kFriction, v, 0.05).slope));
    if (std::abs(v) > 1e-3)
      testing::expect_derivative(torque(0.0), Vector::Constant(1, v),
                                 Matrix::Constant(1, 1, friction(kFriction, v, 0.0).slope));
  }
}

TEST(Friction, OpposesMotionAndSmoothTendsToExact) {
  Random random(71);
  EXPECT_EQ(friction(kFriction, 0.0, 0.0).torque, 0.0);
  for (int sample = 0; sample < testing::samples(); ++sample) {
    const double v = random.uniform(-2, 2);
    EXPECT_GT(v * friction(kFriction, v, 0.05).torque, 0.0);
    EXPECT_NEAR(friction(kFriction, v, 1e-9).torque, friction(kFriction, v, 0.0).torque, 1e-12);
    EXPECT_EQ(friction(kFriction, -v, 0.05).torque, -friction(kFriction, v, 0.05).torque);
  }
}

TEST(Friction, BreakawayFallsToCoulombWithSpeed) {
  const Friction dry{12.0, 0.0, 4.0, 0.1};
  EXPECT_NEAR(friction(dry, 1e-9, 0.0).torque, 16.0, 1e-9);
  EXPECT_NEAR(friction(dry, 1.0, 0.0).torque, 12.0, 1e-9);
}

}  // namespace
}  // namespace exactarm
