// The rows of dynamics_bench.cpp by Pinocchio: the same robot,
// the same states, its usual calls with a reused Data.
#include <pinocchio/multibody.hpp>
// After the model, which the algorithms need.
#include <pinocchio/algorithm/crba.hpp>
#include <pinocchio/algorithm/kinematics.hpp>
#include <pinocchio/algorithm/rnea-derivatives.hpp>
#include <pinocchio/algorithm/rnea-second-order-derivatives.hpp>
#include <pinocchio/algorithm/rnea.hpp>

#include <benchmark/benchmark.h>

#include <memory>

#include "exactarm/base/rotation.hpp"
#include "exactarm/robot/dynamics_derivatives.hpp"
#include "sample_states.hpp"

namespace {

using exactarm::Frame;
using exactarm::Robot;

// Revolute axes about +z: the fastest joint type of the
// library that fits (all axes of the robot have sign +1).
pinocchio::Model pinocchio_model(const Robot& robot) {
  pinocchio::Model model;
  model.gravity.linear() = robot.gravity();
  pinocchio::JointIndex parent = 0;
  pinocchio::SE3 link_in_parent = pinocchio::SE3::Identity();
  for (long i = 0; i < robot.axes(); ++i) {
    const Frame& frame = robot.joint(i).frame;
    exactarm::require_size("sign of every axis", static_cast<long>(frame.sign), 1);
    const pinocchio::SE3 zero(exactarm::rotation_z(frame.zero), Eigen::Vector3d::Zero());
    parent = model.addJoint(parent, pinocchio::JointModelRZ(), link_in_parent * zero,
                            "joint_" + std::to_string(i + 1));
    const pinocchio::SE3 link(exactarm::rotation_x(frame.alpha) * exactarm::rotation_y(frame.beta),
                              Eigen::Vector3d(frame.a, 0.0, frame.d));
    const auto& mass = robot.link(i);
    model.appendBodyToJoint(parent, pinocchio::Inertia(mass.mass, mass.centre_of_mass, mass.inertia), link);
    link_in_parent = link;
  }
  return model;
}

}  // namespace

// Largest difference between the two libraries' torques, mass matrices, first and contracted second
// derivatives, relative to the largest entry: what is timed must be the same numbers.
double largest_difference(const Robot& robot, const exactarm::bench::States& s) {
  const pinocchio::Model model = pinocchio_model(robot);
  pinocchio::Data data(model);
  const exactarm::DynamicsModel ours(robot);
  exactarm::DerivativesWorkspace workspace(ours);
  const long n = robot.axes();
  exactarm::DynamicsDerivatives out(n);
  double worst = 0.0;
  const auto compare = [&](const Eigen::MatrixXd& found, const Eigen::MatrixXd& expected) {
    worst = std::max(worst, (found - expected).cwiseAbs().maxCoeff() / expected.cwiseAbs().maxCoeff());
  };
  for (long k = 0; k < exactarm::bench::kStates; ++k) {
    const Eigen::VectorXd q = s.q.col(k), v = s.q_dot.col(k), a = s.q_ddot.col(k), lambda = s.lambda.col(k);
    exactarm::inverse_dynamics_second_derivatives(ours, workspace, q, v, a, lambda, out);
    pinocchio::computeRNEADerivatives(model, data, q, v, a);
    pinocchio::ComputeRNEASecondOrderDerivatives(model, data, q, v, a);
    // (torque, first argument, second argument) of the tensor's name; that of (a, q) has q last.
    const auto contracted = [&](const auto& tensor) {
      Eigen::MatrixXd sum = Eigen::MatrixXd::Zero(n, n);
      for (long i = 0; i < n; ++i)
        for (long j = 0; j < n; ++j)
          for (long l = 0; l < n; ++l) sum(j, l) += lambda[i] * tensor(i, j, l);
      return sum;
    };
    compare(out.tau, data.tau);
    compare(out.mass_matrix, Eigen::MatrixXd(data.M.selfadjointView<Eigen::Upper>()));
    compare(out.dtau_dq, data.dtau_dq);
    compare(out.dtau_dq_dot, data.dtau_dv);
    compare(out.q_q, contracted(data.d2tau_dqdq));
    compare(out.q_dot_q_dot, contracted(data.d2tau_dvdv));
    compare(out.q_q_dot, contracted(data.d2tau_dqdv));
    compare(out.q_q_ddot, contracted(data.d2tau_dadq).transpose());
  }
  return worst;
}

void register_pinocchio(const Robot& robot, const exactarm::bench::States& s) {
  const auto model = std::make_shared<pinocchio::Model>(pinocchio_model(robot));
  const auto data = std::make_shared<pinocchio::Data>(*model);
  const auto row = [&](const char* name, auto call) {
    benchmark::RegisterBenchmark(name, [call](benchmark::State& state) {
      long k = 0;
      for (auto _ : state) {
        call(k);
        benchmark::ClobberMemory();
        k = (k + 1) % exactarm::bench::kStates;
      }
    });
  };
  row("pinocchio/forward_kinematics",
      [=, &s](long k) { pinocchio::forwardKinematics(*model, *data, s.q.col(k)); });
  row("pinocchio/inverse_dynamics",
      [=, &s](long k) { pinocchio::rnea(*model, *data, s.q.col(k), s.q_dot.col(k), s.q_ddot.col(k)); });
  row("pinocchio/gravity_torque",
      [=, &s](long k) { pinocchio::computeGeneralizedGravity(*model, *data, s.q.col(k)); });
  row("pinocchio/mass_matrix", [=, &s](long k) { pinocchio::crba(*model, *data, s.q.col(k)); });
  row("pinocchio/first_derivatives", [=, &s](long k) {
    pinocchio::computeRNEADerivatives(*model, *data, s.q.col(k), s.q_dot.col(k), s.q_ddot.col(k));
  });
  // Its second derivatives come as tensors; contracting them with a multiplier is not in its time.
  row("pinocchio/first_and_second_derivatives", [=, &s](long k) {
    pinocchio::computeRNEADerivatives(*model, *data, s.q.col(k), s.q_dot.col(k), s.q_ddot.col(k));
    pinocchio::ComputeRNEASecondOrderDerivatives(*model, *data, s.q.col(k), s.q_dot.col(k), s.q_ddot.col(k));
  });
}
