#include "exactarm/robot/gear.hpp"

#include <gtest/gtest.h>

#include "central_difference.hpp"
#include "random_states.hpp"

namespace exactarm {
namespace {

using testing::Random;

// Harmonics whose amplitudes add up to `sum` of the ratio.
GearTable random_table(Random& random, int orders, double sum) {
  Vector order(orders);
  for (int j = 0; j < orders; ++j) order[j] = random.uniform(1.0, 300.0);
  Vector a = random.vector(orders, 1.0), b = random.vector(orders, 1.0);
  double total = 0.0;
  for (int j = 0; j < orders; ++j) total += std::hypot(a[j], b[j]);
  return {order, sum / total * a, sum / total * b};
}

TEST(Gear, DerivativesMatchCentralDifference) {
  Random random;
  for (int sample = 0; sample < testing::samples(); ++sample) {
    const GearTable table = random_table(random, 1 + sample % 12, 0.02);
    const double ratio = random.uniform(40, 120);
    const double phi = sample == 0 ? 0.0 : sample == 1 ? 1e-8 : random.uniform(-4, 4);
    for (int order = 0; order <= 3; ++order) {
      const auto below = [&](const Vector& x) {
        return Vector::Constant(1, order == 0 ? gear_motor_angle(ratio, table, x[0])
                                              : gear_ratio(ratio, table, x[0], order - 1));
      };
      // Relative to the size that the order gives the derivative.
      const double scale = ratio * std::pow(300.0, order);
      const Matrix numeric = testing::central_difference(below, Vector::Constant(1, phi), 3e-6);
      EXPECT_NEAR(numeric(0, 0) / scale, gear_ratio(ratio, table, phi, order) / scale, 1e-7);
    }
  }
}

TEST(Gear, MotorAngleIsZeroAtZero) {
  Random random(1);
  for (int sample = 0; sample < testing::samples(); ++sample)
    EXPECT_EQ(gear_motor_angle(80.0, random_table(random, 9, 0.05), 0.0), 0.0);
}

TEST(Gear, InverseReturnsTheOutputAngleUpToAlmostStandingHarmonics) {
  Random random(2);
  for (int sample = 0; sample < testing::samples(); ++sample) {
    for (double sum : {0.0, 1e-4, 0.02, 0.6, 0.999}) {
      const GearTable table = random_table(random, 1 + sample % 12, sum);
      const double ratio = random.uniform(-120, 120), phi = random.uniform(-5, 5);
      const double theta = gear_motor_angle(ratio, table, phi);
      EXPECT_NEAR(gear_output_angle(ratio, table, theta), phi, 2e-15 * 10 / (1.0 - sum));
      EXPECT_NEAR(gear_output_angle(ratio, table, theta, random.uniform(-9, 9)), phi,
                  2e-15 * 10 / (1.0 - sum));
    }
  }
}

TEST(Gear, NonMonotoneTableIsRefusedByName) {
  const GearTable table{Vector::Constant(1, 3.0), Vector::Constant(1, 1.2), Vector::Zero(1)};
  double where = 0.0;
  EXPECT_FALSE(gear_is_monotone(table, &where));
  EXPECT_LT(gear_ratio(1.0, table, where, 0), 1e-5);
  try {
    require_gear("gear of joint 3, cw", 50.0, table);
    FAIL() << "accepted";
  } catch (const InvalidArgument& error) {
    EXPECT_NE(std::string(error.what()).find("gear of joint 3, cw"), std::string::npos);
  }
}

TEST(Gear, LargeHarmonicsThatCancelAreMonotone) {
  const GearTable table{Vector::Constant(2, 5.0), (Vector(2) << 1.5, -0.8).finished(), Vector::Zero(2)};
  EXPECT_TRUE(gear_is_monotone(table));
}

TEST(Gear, InverseOfANonMonotoneTableStillEndsAtARoot) {
  Random random(3);
  for (int sample = 0; sample < testing::samples(); ++sample) {
    const GearTable table = random_table(random, 5, 4.0);
    const double theta = random.uniform(-200, 200);
    EXPECT_NEAR(gear_motor_angle(60.0, table, gear_output_angle(60.0, table, theta)), theta, 1e-9);
  }
}

TEST(Gear, TableAtRestIsTheMeanOfBothDirections) {
  Random random(4);
  Gear gear{70.0, random_table(random, 4, 0.02), random_table(random, 7, 0.01)};
  const GearTable rest = gear_table(gear, 0);
  for (int sample = 0; sample < testing::samples(); ++sample) {
    const double phi = random.uniform(-4, 4);
    const double mean = 0.5 * (gear_motor_angle(70, gear.cw, phi) + gear_motor_angle(70, gear.ccw, phi));
    EXPECT_NEAR(gear_motor_angle(70, rest, phi), mean, 1e-12);
  }
  EXPECT_EQ(gear_table(gear, -1).size(), 4);
  EXPECT_EQ(gear_table(gear, 1).size(), 7);
}

TEST(Gear, RefusesAWrongDerivativeOrder) { EXPECT_THROW(gear_ratio(50, GearTable{}, 0, 4), InvalidArgument); }

}  // namespace
}  // namespace exactarm
