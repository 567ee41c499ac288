#include "exactarm/base/sincos.hpp"

#include <gtest/gtest.h>

#include <limits>

#include "random_states.hpp"

namespace exactarm {
namespace {

TEST(Sincos, AgreesWithTheStandardLibraryToTwoUnitsInTheLastPlace) {
  testing::Random random(40);
  for (int sample = 0; sample < 500 * testing::samples(); ++sample) {
    double x[3] = {random.uniform(-4, 4), random.uniform(-9e4, 9e4),
                   0.5 * 3.14159265358979323846 * (sample % 1000)};
    double s[3], c[3];
    sincos(x, 3, s, c);
    for (int i = 0; i < 3; ++i) {
      EXPECT_NEAR(s[i], std::sin(x[i]), 4.5e-16 * std::abs(std::sin(x[i])) + 1e-24) << x[i];
      EXPECT_NEAR(c[i], std::cos(x[i]), 4.5e-16 * std::abs(std::cos(x[i])) + 1e-24) << x[i];
    }
  }
}

TEST(Sincos, FallsBackForLargeAngles) {
  const double x[] = {0.0, 1e-300, 2e5, -1e15, std::numeric_limits<double>::infinity(), 1.0, -1.0, 2.0, 3.0};
  double s[9], c[9];
  sincos(x, 9, s, c);
  for (int i : {0, 1, 2, 3, 5, 6, 7, 8}) {
    EXPECT_NEAR(s[i], std::sin(x[i]), 3e-16) << x[i];
    EXPECT_NEAR(c[i], std::cos(x[i]), 3e-16) << x[i];
  }
  EXPECT_TRUE(std::isnan(s[4]) && std::isnan(c[4]));
}

}  // namespace
}  // namespace exactarm
