#include "exactarm/robot/gear_profile.hpp"

#include <gtest/gtest.h>

#include "central_difference.hpp"
#include "exactarm/base/check.hpp"
#include "exactarm/robot/gear.hpp"
#include "random_states.hpp"

namespace exactarm {
namespace {

using testing::Random;

struct Case {
  Vector angle, value, weight;
  GearTable table;
  double level;
};

Case random_case(Random& random, int orders, long cells) {
  const Vector angle = random.vector(cells, 2.0), value = random.vector(cells, 0.01),
               weight = Vector::Ones(cells) + random.vector(cells, 0.9);
  const Vector a = random.vector(orders, 0.02), b = random.vector(orders, 0.02);
  const double level = random.uniform(-0.01, 0.01);
  Vector order(orders);
  for (int j = 0; j < orders; ++j) order[j] = random.uniform(2.0, 90.0);
  return {angle, value, weight, {order, a, b}, level};
}

// Parameters in the order of the normal equations.
Vector parameters(const Case& c) {
  const long m = c.table.size();
  Vector x(3 * m + 1);
  x << c.table.a(), c.table.b(), c.level, c.table.order();
  return x;
}

Vector residual(const Case& c, bool rated, const Vector& x) {
  const long m = c.table.size();
  const GearTable table{x.tail(m), x.head(m), x.segment(m, m)};
  return profile_normal({c.angle, c.value, c.weight, rated}, table, x[2 * m], true).residual;
}

// 0 to 7 orders and up to 300 cells: partly filled lanes and more than one chunk.
TEST(GearProfile, NormalEquationsMatchCentralDifference) {
  Random random;
  for (int sample = 0; sample < testing::samples(); ++sample)
    for (bool rated : {true, false}) {
      const Case c = random_case(random, sample % 8, 1 + 15 * sample);
      const auto below = [&](const Vector& x) { return residual(c, rated, x); };
      const Vector x = parameters(c);
      const Matrix J = -testing::central_difference(below, x, 1e-5);
      const ProfileNormal found = profile_normal({c.angle, c.value, c.weight, rated}, c.table, c.level, true);
      const Matrix normal = J.transpose() * c.weight.asDiagonal() * J;
      const Vector gradient = J.transpose() * c.weight.cwiseProduct(found.residual);
      EXPECT_LE((found.normal - normal).cwiseAbs().maxCoeff(),
                1e-7 * std::max(1.0, normal.cwiseAbs().maxCoeff()));
      EXPECT_LE((found.gradient - gradient).cwiseAbs().maxCoeff(),
                1e-7 * std::max(1.0, gradient.cwiseAbs().maxCoeff()));
      const long few = 2 * c.table.size() + 1;
      const ProfileNormal without =
          profile_normal({c.angle, c.value, c.weight, rated}, c.table, c.level, false);
      EXPECT_TRUE(without.normal.isApprox(found.normal.topLeftCorner(few, few)));
      EXPECT_TRUE(without.gradient.isApprox(found.gradient.head(few)));
    }
}

TEST(GearProfile, ModelIsTheGear) {
  Random random(1);
  const Case c = random_case(random, 5, 50);
  const ProfileNormal rated = profile_normal({c.angle, c.value, c.weight, true}, c.table, 0.0, false);
  const ProfileNormal plain = profile_normal({c.angle, c.value, c.weight, false}, c.table, 0.0, false);
  for (long i = 0; i < 50; ++i) {
    const double x = gear_output_angle(1.0, c.table, c.angle[i]);
    EXPECT_NEAR(c.value[i] - rated.residual[i], 1.0 / gear_ratio(1.0, c.table, x, 0), 1e-12);
    EXPECT_NEAR(c.value[i] - plain.residual[i], c.angle[i] - x, 1e-12);
  }
}

TEST(GearProfile, SizesThatDifferAreRefused) {
  Random random(2);
  const Case c = random_case(random, 3, 10);
  const Vector few = c.value.head(9);
  EXPECT_THROW(profile_normal({c.angle, few, c.weight, true}, c.table, 0.0, false), InvalidArgument);
  EXPECT_THROW(GearTable(c.table.order(), few, c.table.b()), InvalidArgument);
}

}  // namespace
}  // namespace exactarm
