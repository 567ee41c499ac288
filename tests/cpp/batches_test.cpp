// Batches on several threads: the same bits as on one, whatever the number of rows.
#include <gtest/gtest.h>

#include "exactarm/robot/dynamics.hpp"
#include "exactarm/robot/harmonics.hpp"
#include "exactarm/robot/kinematics.hpp"
#include "exactarm/robot/regressor.hpp"
#include "random_states.hpp"

namespace exactarm {
namespace {

constexpr long kAxes = 6;

RowMatrix states(testing::Random& random, long rows) {
  RowMatrix values(rows, kAxes);
  for (long row = 0; row < rows; ++row) values.row(row) = random.vector(kAxes, 1.0).transpose();
  return values;
}

TEST(Batches, ThreadsGiveTheSameBits) {
  testing::Random random;
  const Robot robot(testing::random_robot(random, kAxes));
  const DynamicsModel model(robot);
  const GearTable table(Vector::Constant(1, 30.0), Vector::Constant(1, 1e-3), Vector::Constant(1, 2e-3));
  for (const long rows : {1L, 7L, 64L, 1001L}) {
    const RowMatrix q = states(random, rows), q_dot = states(random, rows);
    const RowMatrix q_ddot = states(random, rows);
    const auto batch = [&](int threads) {
      const long columns = 6 * identification_columns(kAxes);
      const long parameters = kAxes * kAxes * kInertialParameters;
      std::vector<Vector> found;
      const long square = kAxes * kAxes;
      for (const long size : {3L, 9L, 6 * kAxes, columns, kAxes, square, square, parameters, 1L, 1L})
        found.push_back(Vector::Zero(rows * size));
      const KinematicsBatch out{found[0].data(), found[1].data(), found[2].data(), found[3].data()};
      kinematics_batch(robot, q, RowMatrix(), out, threads);
      inverse_dynamics_batch(model, q, q_dot, q_ddot, found[4].data(), threads);
      gravity_torque_jacobian_batch(model, q, found[5].data(), threads);
      mass_matrix_batch(model, q, found[6].data(), threads);
      dynamics_regressor_batch(robot, q, q_dot, q_ddot, found[7].data(), threads);
      const Vector angle = q.col(0);
      transmission(table, angle.data(), rows, threads, found[8].data(), found[9].data());
      return found;
    };
    const std::vector<Vector> one = batch(1);
    EXPECT_GT(one[7].cwiseAbs().maxCoeff(), 0.0);
    for (const int threads : {2, 3}) {
      const std::vector<Vector> more = batch(threads);
      for (std::size_t k = 0; k < one.size(); ++k)
        EXPECT_TRUE((one[k].array() == more[k].array()).all()) << "output " << k << ", " << rows << " rows";
    }
  }
}

}  // namespace
}  // namespace exactarm
