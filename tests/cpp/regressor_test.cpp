#include "exactarm/robot/regressor.hpp"

#include <gtest/gtest.h>

#include "exactarm/robot/dynamics.hpp"
#include "random_states.hpp"

namespace exactarm {
namespace {

using testing::Random;

TEST(Regressor, TimesTheParametersIsTheInverseDynamics) {
  Random random(30);
  for (int sample = 0; sample < testing::samples(); ++sample) {
    const int n = 1 + sample % 8;
    const Robot robot = testing::random_robot(random, n, sample % 2 == 1);
    const Vector q = random.vector(n, 3.0), q_dot = random.vector(n, 2.0), q_ddot = random.vector(n, 5.0);
    const Vector tau = inverse_dynamics(robot, q, q_dot, q_ddot);
    const Matrix Y = dynamics_regressor(robot, q, q_dot, q_ddot);
    const Vector pi = inertial_parameters(robot);
    EXPECT_LE((Y * pi - tau).norm(), 1e-12 * (Y.cwiseAbs() * pi.cwiseAbs()).norm());
  }
}

TEST(Regressor, InertialParametersAndLinkInertiaAreInverse) {
  Random random(31);
  const Robot robot = testing::random_robot(random, 6);
  for (long i = 0; i < robot.axes(); ++i) {
    const LinkInertia& link = robot.link(i);
    const LinkInertia back = link_inertia(inertial_parameters(link));
    EXPECT_DOUBLE_EQ(back.mass, link.mass);
    EXPECT_TRUE(back.centre_of_mass.isApprox(link.centre_of_mass, 1e-13));
    EXPECT_TRUE(back.inertia.isApprox(link.inertia, 1e-11));
  }
}

TEST(Regressor, OuterLinksOnlyLoadTheirInnerAxes) {
  Random random(32);
  const Robot robot = testing::random_robot(random, 6, true);
  const Matrix Y =
      dynamics_regressor(robot, random.vector(6, 3.0), random.vector(6, 2.0), random.vector(6, 5.0));
  for (int axis = 1; axis < 6; ++axis)
    EXPECT_EQ(Y.row(axis).head(kInertialParameters * axis).cwiseAbs().maxCoeff(), 0.0);
}

}  // namespace
}  // namespace exactarm
