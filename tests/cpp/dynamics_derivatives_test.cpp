#include "exactarm/robot/dynamics_derivatives.hpp"

#include <gtest/gtest.h>

#include "allocation_count.hpp"
#include "central_difference.hpp"
#include "exactarm/robot/dynamics.hpp"
#include "random_states.hpp"

namespace exactarm {
namespace {

using testing::Random;

struct Sample {
  Robot robot;
  int n;
  Vector q, q_dot, q_ddot, lambda;
};

// n from 1 to 10 (more than eight axes take two blocks of lanes); samples 0 and 1 at zero and at 1e-8.
Sample random_sample(Random& random, int number) {
  const int n = 1 + number % 10;
  Sample s{testing::random_robot(random, n, number % 2 == 1), n, {}, {}, {}, {}};
  s.q = random.vector(s.n, 3.0);
  s.q_dot = random.vector(s.n, 2.0);
  s.q_ddot = random.vector(s.n, 5.0);
  s.lambda = random.vector(s.n, 1.0);
  if (number < 2)
    for (Vector* v : {&s.q, &s.q_dot, &s.q_ddot}) v->setConstant(number == 0 ? 0.0 : 1e-8);
  return s;
}

DynamicsDerivatives evaluate(const Sample& s) {
  const DynamicsModel model(s.robot);
  DerivativesWorkspace workspace(model);
  DynamicsDerivatives out(s.n);
  inverse_dynamics_second_derivatives(model, workspace, s.q, s.q_dot, s.q_ddot, s.lambda, out);
  return out;
}

TEST(DynamicsDerivatives, TorqueAndMassMatrixAreThoseOfTheOtherRecursions) {
  Random random(50);
  for (int sample = 0; sample < testing::samples(); ++sample) {
    const Sample s = random_sample(random, sample);
    const DynamicsDerivatives out = evaluate(s);
    const Vector tau = inverse_dynamics(s.robot, s.q, s.q_dot, s.q_ddot);
    EXPECT_LE((out.tau - tau).norm(), 1e-12 * tau.norm());
    const Matrix D = mass_matrix(s.robot, s.q);
    EXPECT_LE((out.mass_matrix - D).norm(), 1e-12 * D.norm());
  }
}

TEST(DynamicsDerivatives, FirstDerivativesMatchCentralDifference) {
  Random random(51);
  for (int sample = 0; sample < testing::samples(); ++sample) {
    const Sample s = random_sample(random, sample);
    const DynamicsDerivatives out = evaluate(s);
    testing::expect_derivative(
        [&](const Vector& x) { return inverse_dynamics(s.robot, x, s.q_dot, s.q_ddot); }, s.q, out.dtau_dq);
    testing::expect_derivative([&](const Vector& x) { return inverse_dynamics(s.robot, s.q, x, s.q_ddot); },
                               s.q_dot, out.dtau_dq_dot);
  }
}

TEST(DynamicsDerivatives, ContractedSecondDerivativesMatchCentralDifference) {
  Random random(52);
  for (int sample = 0; sample < testing::samples(); ++sample) {
    const Sample s = random_sample(random, sample);
    const DynamicsDerivatives out = evaluate(s);
    const auto slope = [&](const Vector& q, const Vector& q_dot, Matrix DynamicsDerivatives::*of) {
      Sample moved = s;
      moved.q = q;
      moved.q_dot = q_dot;
      return Vector((evaluate(moved).*of).transpose() * s.lambda);
    };
    using D = DynamicsDerivatives;
    testing::expect_derivative([&](const Vector& x) { return slope(x, s.q_dot, &D::dtau_dq); }, s.q, out.q_q);
    testing::expect_derivative([&](const Vector& x) { return slope(s.q, x, &D::dtau_dq); }, s.q_dot,
                               out.q_q_dot);
    testing::expect_derivative([&](const Vector& x) { return slope(s.q, x, &D::dtau_dq_dot); }, s.q_dot,
                               out.q_dot_q_dot);
    testing::expect_derivative([&](const Vector& x) { return slope(x, s.q_dot, &D::mass_matrix); }, s.q,
                               out.q_q_ddot.transpose());
  }
}

TEST(DynamicsDerivatives, FirstDerivativesAloneAreTheSame) {
  Random random(53);
  for (int sample = 0; sample < testing::samples(); ++sample) {
    const Sample s = random_sample(random, sample);
    const DynamicsDerivatives all = evaluate(s);
    const DynamicsModel model(s.robot);
    DerivativesWorkspace workspace(model);
    DynamicsDerivatives out(s.n);
    inverse_dynamics_derivatives(model, workspace, s.q, s.q_dot, s.q_ddot, out);
    EXPECT_LE((out.dtau_dq - all.dtau_dq).norm(), 1e-13 * all.dtau_dq.norm());
    EXPECT_LE((out.dtau_dq_dot - all.dtau_dq_dot).norm(), 1e-13 * all.dtau_dq_dot.norm());
  }
}

TEST(DynamicsDerivatives, KnotsAgreeWithSingleSamplesForAnyNumberOfThem) {
  Random random(54);
  for (const int n : {3, 6, 9}) {
    const Robot robot = testing::random_robot(random, n, true);
    const DynamicsModel model(robot);
    DerivativesWorkspace workspace(model);
    for (const long knots : {1L, 8L, 13L, 150L}) {
      Matrix q(n, knots), q_dot(n, knots), q_ddot(n, knots), lambda(n, knots);
      for (auto* m : {&q, &q_dot, &q_ddot, &lambda})
        for (long k = 0; k < m->size(); ++k) m->data()[k] = random.uniform(-2, 2);
      Matrix tau(n, knots), results[7];
      for (Matrix& result : results) result.resize(n * n, knots);
      double* out[7];
      for (int m = 0; m < 7; ++m) out[m] = results[m].data();
      KnotBatch batch{knots,  q.data(), q_dot.data(), q_ddot.data(), lambda.data(), tau.data(), out[0],
                      out[1], out[2],   out[3],       out[4],        out[5],        out[6]};
      inverse_dynamics_knots(model, batch, 2);
      DynamicsDerivatives one(n);
      for (long k = 0; k < knots; ++k) {
        inverse_dynamics_second_derivatives(model, workspace, q.col(k), q_dot.col(k), q_ddot.col(k),
                                            lambda.col(k), one);
        EXPECT_LE((tau.col(k) - one.tau).norm(), 1e-12 * one.tau.norm());
        const Matrix* expected[] = {&one.dtau_dq, &one.dtau_dq_dot, &one.mass_matrix, &one.q_q,
                                    &one.q_q_dot, &one.q_dot_q_dot, &one.q_q_ddot};
        for (int m = 0; m < 7; ++m)
          EXPECT_LE((results[m].col(k).reshaped(n, n) - *expected[m]).norm(), 1e-11 * expected[m]->norm())
              << m;
      }
    }
  }
}

TEST(DynamicsDerivatives, AllocateNothing) {
  Random random(55);
  const Robot robot = testing::random_robot(random, 7, true);
  const DynamicsModel model(robot);
  DerivativesWorkspace workspace(model);
  KnotWorkspace knot_workspace(model);
  DynamicsWorkspace plain(model);
  DynamicsDerivatives out(7);
  Matrix q(7, 20), tau(7, 20), hessian(49, 20), D(7, 7);
  for (long k = 0; k < q.size(); ++k) q.data()[k] = random.uniform(-2, 2);
  KnotBatch batch;
  batch.knots = 20;
  batch.q = batch.q_dot = batch.q_ddot = batch.lambda = q.data();
  batch.tau = tau.data();
  batch.q_q = hessian.data();
  const Vector x = q.col(0);
  Vector result(7);
  const long before = testing::allocation_count();
  inverse_dynamics_second_derivatives(model, workspace, x, x, x, x, out);
  inverse_dynamics_derivatives(model, workspace, x, x, x, out);
  inverse_dynamics_knots(model, knot_workspace, batch, 0, 20);
  inverse_dynamics(model, plain, x, x, x, result);
  gravity_torque(model, plain, x, result);
  mass_matrix(model, plain, x, D);
  EXPECT_EQ(testing::allocation_count(), before);
  ::operator delete(::operator new(100));  // a direct call is never optimised away: the counter itself works
  EXPECT_EQ(testing::allocation_count(), before + (testing::allocations_are_counted() ? 1 : 0));
}

}  // namespace
}  // namespace exactarm
