// A point on the way of the stage-wise solver, with what its parts need.
#pragma once

#include "exactarm/ocp/direction.hpp"
#include "exactarm/ocp/first_order.hpp"
#include "exactarm/ocp/initial_guess.hpp"
#include "planning_cases.hpp"

namespace exactarm::testing {

inline ocp::Barrier no_bounds(const ocp::Layout& layout) {
  const Vector far = Vector::Constant(layout.unknowns(), 1e20);
  return ocp::Barrier(-far, far);
}

struct StagewisePoint {
  static constexpr double kScale = 7.0;  // of the objective

  // A random offset of `size` rad from the flat motion, and random multipliers.
  StagewisePoint(const ocp::Problem& problem, const ocp::StageDynamics& dynamics, Random& random, double size)
      : model(problem, dynamics, 1),
        objective(problem),
        point(model.layout()),
        workspace(model),
        derivatives(model.layout()),
        barrier(no_bounds(model.layout())),
        conditions(model, objective, kScale) {
    const ocp::Layout& layout = model.layout();
    ocp::initial_guess(model, point.z.data());
    const int width = layout.width();
    const long inner = layout.unknowns() - 2 * width;
    point.z.segment(width, inner) += random.vector(inner, size);
    point.stage = random.vector(point.stage.size(), 1.0);
    point.defect = random.vector(point.defect.size(), 1.0);
    barrier.start(point.z, 1e-11);
    evaluate();
  }

  void evaluate() {
    model.derivatives(point.z.data(), point.stage.data(), workspace, derivatives);
    conditions.evaluate(point, derivatives, barrier);
  }

  ocp::StageModel model;
  ocp::Objective objective;
  ocp::KktVector point;
  ocp::StageWorkspace workspace;
  ocp::StageDerivatives derivatives;
  ocp::Barrier barrier;
  ocp::FirstOrder conditions;
};

inline ocp::Problem two_masses(Random& random) {
  return mass_problem(random_reference(random, 30, Vector::Zero(2), Vector::Ones(2), 0.1), 0.01, 1e-10);
}

// Two masses off their optimum, and what finds the way there.
struct TwoMassesOnTheWay {
  explicit TwoMassesOnTheWay(unsigned seed)
      : random(seed),
        problem(two_masses(random)),
        dynamics((Vector(2) << 3.0, 12.0).finished()),
        at(problem, dynamics, random, 0.1),
        direction(at.model, at.objective, StagewisePoint::kScale, 1e-11) {}

  Random random;
  ocp::Problem problem;
  LinearMasses dynamics;
  StagewisePoint at;
  ocp::Direction direction;
};

}  // namespace exactarm::testing
