// Coverage-guided fuzzing (libFuzzer) of what the bindings call: any numbers in an arm, a gear, a pose or
// samples. The property: the call returns or throws InvalidArgument; no report of the sanitizers, no timeout.
#include "exactarm/base/block_recursion.hpp"
#include "exactarm/base/derivative.hpp"
#include "exactarm/base/prior_scales.hpp"
#include "exactarm/robot/dynamics.hpp"
#include "exactarm/robot/gear.hpp"
#include "exactarm/robot/gear_profile.hpp"
#include "exactarm/robot/harmonics.hpp"
#include "exactarm/robot/inverse_kinematics.hpp"
#include "exactarm/robot/kinematics.hpp"
#include "exactarm/robot/regressor.hpp"
#include "exactarm/robot/stop_operator.hpp"
#include "numbers.hpp"

namespace exactarm::fuzz {
namespace {

void gears(Numbers& from) {
  const GearTable table = from.table();
  const Gear gear = from.gear();
  const double ratio = from.number(), angle = from.number();
  double where = 0.0;
  GearDerivatives derivatives;
  gear_is_monotone(table, &where);
  gear_motor_angle(ratio, table, angle);
  gear_ratio(ratio, table, angle, from.whole(0, 3));
  gear_derivatives(ratio, table, angle, from.whole(0, 4), derivatives);
  gear_output_angle(ratio, table, angle);
  gear_output_angle(ratio, table, angle, from.number());
  gear_derivatives(gear_table(gear, from.whole(-1, 1)).size() ? gear : Gear{}, from.number(), angle, 4,
                   derivatives);
  gear_output_angle(gear, from.number(), angle);
  require_gear("gear", ratio, table);
}

void records(Numbers& from) {
  const GearTable table = from.table();
  const long count = from.whole(0, kMostRows);
  const Vector angle = from.vector(count), factor = from.vector(count);
  Vector x(count), slope(count);
  gear_outputs(from.number(), table, angle.data(), count, x.data(), slope.data());
  delivered_angles(table, angle.data(), from.flag() ? factor.data() : nullptr, count, from.number(), 1,
                   x.data(), slope.data());
  transmission(table, angle.data(), count, 1, x.data(), slope.data());
  stop_operator(angle.data(), count, from.number(), x.data(), slope.data());
  const std::vector<long> starts = {0, from.whole(-2, kMostRows)};
  derivative(angle.data(), factor.data(), count, 1, starts, x.data());
  profile_normal({angle, factor, from.vector(count), from.flag()}, table, from.number(), from.flag());
}

void blocks(Numbers& from) {
  const long rows = from.whole(0, kMostRows), n = from.whole(0, 8), columns = from.whole(0, 8);
  const RowMatrix a = from.matrix(rows, n * n), b = from.matrix(rows, n * n), d = from.matrix(rows, n * n),
                  y = from.matrix(rows, n);
  RowMatrix x = from.matrix(rows, n * columns), gains(2, rows), prices(2, rows);
  block_recursion(a.data(), b.data(), d.data(), rows, n, columns, x.data());
  const double squares[] = {from.number(), 1.0};
  gains_by_scale(d.data(), y.data(), rows, n, squares, 2, gains.data(), prices.data());
}

void robots(Numbers& from) {
  const Robot robot(from.description());
  const long n = robot.axes(), rows = from.whole(0, kMostRows);
  const RowMatrix q = from.matrix(rows, n), q_dot = from.matrix(rows, n), q_ddot = from.matrix(rows, n);
  RowMatrix position(rows, 3), rotation(rows, 9), jacobian(rows, 6 * n),
      columns(rows, 6 * identification_columns(n));
  kinematics_batch(robot, q, from.flag() ? q_dot : RowMatrix(),
                   {position.data(), rotation.data(), jacobian.data(), columns.data()}, 1);
  if (!robot.has_masses()) return;
  const DynamicsModel model(robot);
  RowMatrix tau(rows, n), squares(rows, n * n), regressor(rows, n * n * kInertialParameters);
  inverse_dynamics_batch(model, q, q_dot, q_ddot, tau.data(), 1);
  gravity_torque_jacobian_batch(model, q, squares.data(), 1);
  mass_matrix_batch(model, q, squares.data(), 1);
  dynamics_regressor_batch(robot, q, q_dot, q_ddot, regressor.data(), 1);
}

void inverse(Numbers& from) {
  const Robot robot(from.description());
  InverseKinematicsOptions options;
  if (from.flag()) options.tolerance = from.number();
  if (from.flag()) options.largest_jump = from.number();
  options.extrapolate = from.flag();
  options.iterations = from.whole(-1, 60);
  const long rows = from.whole(0, 4);
  RowMatrix q;
  const RowMatrix rotations =
      RowMatrix(Eigen::Map<const Eigen::RowVectorXd>(Matrix3::Identity().eval().data(), 9))
          .replicate(rows, 1);
  inverse_kinematics_path(robot, from.matrix(rows, 3), from.flag() ? rotations : from.matrix(rows, 9),
                          from.vector(from.flag() ? robot.axes() : from.whole(0, 9)), q, options);
  inverse_kinematics_branches(robot, from.pose(), options);
}

}  // namespace
}  // namespace exactarm::fuzz

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  using namespace exactarm::fuzz;
  return run(std::array<Entry, 5>{gears, records, robots, inverse, blocks}, data, size);
}
