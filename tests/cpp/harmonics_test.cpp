#include "exactarm/robot/harmonics.hpp"

#include <gtest/gtest.h>

#include "exactarm/robot/gear.hpp"
#include "random_states.hpp"

namespace exactarm {
namespace {

using testing::Random;

GearTable random_table(Random& random, int orders, double size) {
  const Vector a = random.vector(orders, size), b = random.vector(orders, size);
  Vector order(orders);
  for (int j = 0; j < orders; ++j) order[j] = random.uniform(1.0, 400.0);
  return {order, a, b};
}

// 1 to 20 angles, so that lanes are filled in part, too.
TEST(Harmonics, DeliveredAnglesAreThoseOfTheGear) {
  Random random;
  for (int sample = 0; sample < testing::samples(); ++sample) {
    const int orders = sample % 9;
    const GearTable table = random_table(random, orders, orders ? 0.4 / orders : 0.0);
    const Vector phi = random.vector(1 + sample, 4.0);
    Vector x(phi.size()), slope(phi.size());
    delivered_angles(table, phi.data(), nullptr, phi.size(), 1e-13, 1, x.data(), slope.data());
    for (long i = 0; i < phi.size(); ++i) {
      EXPECT_NEAR(x[i], gear_output_angle(1.0, table, phi[i]), 1e-12);
      EXPECT_NEAR(slope[i], gear_ratio(1.0, table, x[i], 0) - 1.0, 1e-9);
    }
  }
}

// Up to tables that stand almost still somewhere, where Newton alone oscillates.
TEST(Harmonics, OutputsAreThoseOfTheSafeguardedInverse) {
  Random random(4);
  for (int sample = 0; sample < testing::samples(); ++sample)
    for (double sum : {0.0, 0.01, 0.6, 0.98}) {
      const int orders = 1 + sample % 12;
      const GearTable table = random_table(random, orders, 0.7 * sum / orders);
      const double ratio = random.uniform(-120.0, 120.0);
      const Vector theta = 4.0 * ratio * random.vector(21, 1.0);
      Vector phi(21), u(21);
      gear_outputs(ratio, table, theta.data(), 21, phi.data(), u.data());
      for (long i = 0; i < 21; ++i) {
        EXPECT_NEAR(phi[i], gear_output_angle(ratio, table, theta[i]), 1e-13 / (1.0 - sum));
        EXPECT_NEAR(u[i] / ratio, gear_ratio(1.0, table, phi[i], 0), 1e-7);
      }
    }
}

TEST(Harmonics, FactorScalesTheErrorRowByRow) {
  Random random(1);
  const GearTable table = random_table(random, 5, 0.02);
  const Vector phi = random.vector(37, 3.0), factor = random.vector(37, 2.0);
  Vector x(37), slope(37), error(37);
  delivered_angles(table, phi.data(), factor.data(), 37, 1e-13, 2, x.data(), slope.data());
  transmission(table, x.data(), 37, 1, error.data(), nullptr);
  for (long i = 0; i < 37; ++i) EXPECT_NEAR(x[i] + factor[i] * error[i], phi[i], 1e-13);
}

TEST(Harmonics, TransmissionIsThatOfTheGear) {
  Random random(2);
  const GearTable table = random_table(random, 7, 0.05);
  const Vector x = random.vector(50001, 5.0);
  Vector error(x.size()), slope(x.size());
  transmission(table, x.data(), x.size(), 2, error.data(), slope.data());
  for (long i = 0; i < x.size(); i += 97) {
    EXPECT_NEAR(x[i] + error[i], gear_motor_angle(1.0, table, x[i]), 1e-13);
    EXPECT_NEAR(1.0 + slope[i], gear_ratio(1.0, table, x[i], 0), 1e-13);
  }
}

// Turned on from the wave before, with an exact one now and then.
TEST(Harmonics, MultiplesOfOneWaveAreThoseOfTheGear) {
  Random random(5);
  for (double first : {1.0, 0.7, 3.25}) {
    const Vector order = first * Vector::LinSpaced(120, 1.0, 120.0);
    const GearTable table(order, random.vector(120, 1e-3), random.vector(120, 1e-3));
    ASSERT_TRUE(table.multiples());
    const Vector x = random.vector(203, 5.0);
    Vector error(x.size()), slope(x.size());
    transmission(table, x.data(), x.size(), 1, error.data(), slope.data());
    for (long i = 0; i < x.size(); ++i) {
      EXPECT_NEAR(x[i] + error[i], gear_motor_angle(1.0, table, x[i]), 1e-14);
      EXPECT_NEAR(1.0 + slope[i], gear_ratio(1.0, table, x[i], 0), 1e-14);
    }
  }
}

TEST(Harmonics, WavesAreSineAndCosine) {
  Random random(3);
  for (int orders : {1, 3, 8, 21}) {
    const Vector order = Vector::Constant(orders, 200.0) + random.vector(orders, 199.0),
                 x = random.vector(131, 7.0);
    RowMatrix sine(131, orders), cosine(131, orders);
    waves(order, x.data(), 131, sine.data(), cosine.data());
    for (long i = 0; i < 131; ++i)
      for (long j = 0; j < orders; ++j) {
        EXPECT_NEAR(sine(i, j), std::sin(order[j] * x[i]), 1e-15);
        EXPECT_NEAR(cosine(i, j), std::cos(order[j] * x[i]), 1e-15);
      }
  }
}

TEST(Harmonics, TableThatFoldsBackEndsSomewhereFinite) {
  const GearTable table{Vector::Constant(1, 50.0), Vector::Constant(1, 1.8), Vector::Zero(1)};
  const Vector phi = Vector::LinSpaced(40, -1.0, 1.0);
  Vector x(40), slope(40);
  delivered_angles(table, phi.data(), nullptr, 40, 1e-13, 1, x.data(), slope.data());
  EXPECT_TRUE(x.allFinite());
}

}  // namespace
}  // namespace exactarm
