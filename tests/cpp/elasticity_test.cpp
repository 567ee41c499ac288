#include "exactarm/robot/elasticity.hpp"

#include <gtest/gtest.h>

#include "central_difference.hpp"
#include "random_states.hpp"

namespace exactarm {
namespace {

using testing::Random;

TEST(Elasticity, DeflectionIsTheInverseOfTheTorque) {
  Random random(60);
  for (int sample = 0; sample < 50 * testing::samples(); ++sample) {
    Spring spring{std::exp(random.uniform(5, 13)), std::exp(random.uniform(-20, 28))};
    if (sample % 5 == 0) spring.cubic = 0.0;
    const double e = sample == 0 ? 0.0 : random.uniform(-0.02, 0.02) * std::pow(10.0, random.uniform(-8, 0));
    EXPECT_NEAR(spring_deflection(spring, spring_torque(spring, e)), e, 4e-15 * std::abs(e));
  }
}

TEST(Elasticity, SofteningSpringHoldsUpToItsPeakAndSaysWhenNot) {
  const Spring spring{1000.0, -1e6};
  const double peak_e = std::sqrt(1000.0 / 3e6), peak = spring_torque(spring, peak_e);
  for (const double part : {-0.999, -0.4, 0.0, 1e-9, 0.7, 0.9999}) {
    const double e = spring_deflection(spring, part * peak);
    EXPECT_NEAR(spring_torque(spring, e), part * peak, 1e-12 * peak);
    EXPECT_LE(std::abs(e), peak_e);
  }
  EXPECT_THROW(spring_deflection(spring, 1.01 * peak), InvalidArgument);
}

TEST(Elasticity, StiffnessAndEnergyAreSlopesAndDeflectionDerivativesMatch) {
  Random random(61);
  for (int sample = 0; sample < testing::samples(); ++sample) {
    const Spring spring{random.uniform(1, 5), sample % 3 ? random.uniform(0, 20) : 0.0};
    const Vector e = Vector::Constant(1, sample == 0 ? 0.0 : random.uniform(-0.5, 0.5));
    const auto scalar = [](double value) { return Vector::Constant(1, value); };
    testing::expect_derivative([&](const Vector& x) { return scalar(spring_torque(spring, x[0])); }, e,
                               scalar(spring_stiffness(spring, e[0])));
    testing::expect_derivative([&](const Vector& x) { return scalar(spring_energy(spring, x[0])); }, e,
                               scalar(spring_torque(spring, e[0])));
    const Vector torque = scalar(spring_torque(spring, e[0]));
    const DeflectionDerivatives derivatives = spring_deflection_derivatives(spring, torque[0]);
    for (int order = 0; order < 3; ++order)
      testing::expect_derivative(
          [&](const Vector& x) { return scalar(spring_deflection_derivatives(spring, x[0]).value[order]); },
          torque, scalar(derivatives.value[order + 1]));
  }
}

TEST(Elasticity, RigidJointDoesNotDeflect) {
  EXPECT_EQ(spring_deflection(Spring{}, 300.0), 0.0);
  EXPECT_NO_THROW(require_spring("spring of joint 1", Spring{}));
  EXPECT_THROW(require_spring("spring of joint 1", Spring{-5.0, 0.0}), InvalidArgument);
  EXPECT_THROW(require_spring("spring of joint 1", Spring{0.0, 1e9}), InvalidArgument);
}

}  // namespace
}  // namespace exactarm
