// Coverage-guided fuzzing (libFuzzer) of what the bindings call: any numbers in a robot, a gear, a pose, samples or a
// planning problem. The property: the call returns or throws InvalidArgument; no address, undefined-behaviour or time
// report. What it finds is written by libFuzzer itself; the corpus is kept by `make fuzz-core`.
#include <fuzzer/FuzzedDataProvider.h>

#include <array>
#include <cmath>
#include <limits>

#include "exactarm/base/check.hpp"
#include "exactarm/base/derivative.hpp"
#include "exactarm/ocp/robot_dynamics.hpp"
#include "exactarm/ocp/solution.hpp"
#include "exactarm/robot/dynamics.hpp"
#include "exactarm/robot/gear.hpp"
#include "exactarm/robot/gear_profile.hpp"
#include "exactarm/robot/harmonics.hpp"
#include "exactarm/robot/inverse_kinematics.hpp"
#include "exactarm/robot/kinematics.hpp"
#include "exactarm/robot/regressor.hpp"
#include "exactarm/robot/stop_operator.hpp"

namespace {

using namespace exactarm;

constexpr long kMostRows = 20;
constexpr int kMostOrders = 6;

class Numbers {
 public:
  Numbers(const uint8_t* data, size_t size) : data_(data, size) {}

  int whole(int low, int high) { return data_.ConsumeIntegralInRange<int>(low, high); }
  bool flag() { return data_.ConsumeBool(); }

  // Half of the numbers are of a usual size, the others anything that a double can be.
  double number() {
    constexpr std::array<double, 8> special = {0.0, -0.0, 1e300, -1e300, 5e-324, std::numeric_limits<double>::infinity(),
                                               std::numeric_limits<double>::quiet_NaN(), 1e9};
    switch (data_.ConsumeIntegralInRange<int>(0, 7)) {
      case 0: return special[data_.ConsumeIntegralInRange<size_t>(0, special.size() - 1)];
      case 1: return data_.ConsumeFloatingPoint<double>();
      case 2: return data_.ConsumeFloatingPointInRange<double>(-1e4, 1e4);
      default: return data_.ConsumeFloatingPointInRange<double>(-2.0, 2.0);
    }
  }

  Vector vector(long size) {
    Vector values(size);
    for (long i = 0; i < size; ++i) values[i] = number();
    return values;
  }

  RowMatrix matrix(long rows, long columns) {
    RowMatrix values(rows, columns);
    for (long i = 0; i < values.size(); ++i) values.data()[i] = number();
    return values;
  }

  GearTable table() {
    const long orders = whole(0, kMostOrders);
    return {vector(flag() ? orders : whole(0, kMostOrders)).cwiseAbs(), vector(orders) * 0.1, vector(orders) * 0.1};
  }

  Gear gear() { return {flag() ? 50.0 : number(), table(), table()}; }
  Spring spring() { return {flag() ? 1e4 : number(), flag() ? 0.0 : number()}; }
  Pose pose() {
    Pose found;
    if (flag()) found.rotation = Eigen::Map<const Matrix3>(vector(9).data());
    found.position = vector(3);
    return found;
  }

  RobotDescription description() {
    RobotDescription found;
    const bool masses = flag();
    for (int axes = whole(0, 8); axes > 0; --axes) {
      Joint joint;
      joint.frame = {flag() ? JointType::revolute : JointType::prismatic, flag() ? 1.0 : number(), number(), number(),
                     number(), number(), flag() ? 0.0 : number()};
      joint.q_offset = number();
      if (flag()) joint.gear = gear();
      joint.spring = spring();
      joint.drive.rotor_inertia = number();
      if (flag()) joint.limits = {number(), number(), number(), number(), number()};
      if (masses) joint.link = LinkInertia{number(), vector(3), Eigen::Map<const Matrix3>(vector(9).data())};
      found.joints.push_back(joint);
    }
    found.base = pose();
    found.tool = pose();
    found.gravity = vector(3);
    return found;
  }

 private:
  FuzzedDataProvider data_;
};

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
  gear_derivatives(gear_table(gear, from.whole(-1, 1)).size() ? gear : Gear{}, from.number(), angle, 4, derivatives);
  gear_output_angle(gear, from.number(), angle);
  require_gear("gear", ratio, table);
}

void records(Numbers& from) {
  const GearTable table = from.table();
  const long count = from.whole(0, kMostRows);
  const Vector angle = from.vector(count), factor = from.vector(count);
  Vector x(count), slope(count);
  gear_outputs(from.number(), table, angle.data(), count, x.data(), slope.data());
  delivered_angles(table, angle.data(), from.flag() ? factor.data() : nullptr, count, from.number(), 1, x.data(),
                   slope.data());
  transmission(table, angle.data(), count, 1, x.data(), slope.data());
  stop_operator(angle.data(), count, from.number(), x.data(), slope.data());
  const std::vector<long> starts = {0, from.whole(-2, kMostRows)};
  derivative(angle.data(), factor.data(), count, 1, starts, x.data());
  profile_normal({angle, factor, from.vector(count), from.flag()}, table, from.number(), from.flag());
}

void robots(Numbers& from) {
  const Robot robot(from.description());
  const long n = robot.axes(), rows = from.whole(0, kMostRows);
  const RowMatrix q = from.matrix(rows, n), q_dot = from.matrix(rows, n), q_ddot = from.matrix(rows, n);
  RowMatrix position(rows, 3), rotation(rows, 9), jacobian(rows, 6 * n), columns(rows, 6 * identification_columns(n));
  kinematics_batch(robot, q, from.flag() ? q_dot : RowMatrix(), {position.data(), rotation.data(), jacobian.data(),
                                                                  columns.data()}, 1);
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
  options.iterations = from.whole(-1, 60);
  const long rows = from.whole(0, 4);
  RowMatrix q;
  const RowMatrix rotations = RowMatrix(Eigen::Map<const Eigen::RowVectorXd>(Matrix3::Identity().eval().data(), 9))
                                  .replicate(rows, 1);
  inverse_kinematics_path(robot, from.matrix(rows, 3), from.flag() ? rotations : from.matrix(rows, 9),
                          from.vector(from.flag() ? robot.axes() : from.whole(0, 9)), q, options);
  inverse_kinematics_branches(robot, from.pose(), options);
}

void plans(Numbers& from) {
  const Robot robot(from.description());
  ocp::Problem problem = ocp::problem_of(robot);
  const long knots = from.whole(0, kMostRows);
  problem.q_desired = from.matrix(knots, from.flag() ? robot.axes() : from.whole(0, 9));
  if (from.flag()) problem.step = from.number();
  if (from.flag()) problem.weight = from.number();
  if (from.flag()) problem.input = ocp::Input::jerk;
  if (from.flag()) problem.direction = from.matrix(knots, robot.axes());
  if (from.flag()) problem.phi_shift = from.matrix(from.whole(0, kMostRows), robot.axes());
  if (from.flag()) problem.bounds.q_dot = from.vector(from.whole(0, 9));
  if (from.flag()) problem.gears.assign(static_cast<size_t>(from.whole(0, 9)), from.gear());
  ocp::SolveOptions options;
  options.iterations = from.whole(-1, 3);
  options.threads = from.whole(-1, 2);
  options.seconds = 1.0;
  ocp::solve(problem, ocp::RobotDynamics(robot), options);
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  if (size == 0) return 0;
  Numbers from(data + 1, size - 1);
  constexpr std::array<void (*)(Numbers&), 5> entries = {gears, records, robots, inverse, plans};
  try {
    entries[data[0] % entries.size()](from);
  } catch (const InvalidArgument&) {
  }
  return 0;
}
