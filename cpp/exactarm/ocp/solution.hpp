// From a Problem to a motion: solves it by either solver and checks the answer with our own KKT errors.
// Matrices N x n in SI units; theta is the true motor angle (ratio times the solver's theta).
#pragma once

#include "exactarm/ocp/stagewise.hpp"

namespace exactarm::ocp {

enum class Method { stagewise, ipopt };

struct SolveOptions {
  Method method = Method::stagewise;
  std::string linear_solver = "mumps";  // of Ipopt
  int iterations = 200;
  double seconds = 1e6;
  int threads = 1;
  int print_level = 0;                  // of Ipopt
};

struct Motion {
  nlp::Status status = nlp::Status::numerical_failure;
  std::string message, linear_solver;
  int iterations = 0;
  double seconds = 0.0;          // the solver with the model's set-up, without the KKT check
  double objective = 0.0, objective_scale = 1.0;
  nlp::KktError kkt;             // of the scaled problem
  RowMatrix q, q_dot, q_ddot;    // link side
  // Motor; the jerk is empty with acceleration as the input.
  RowMatrix theta, theta_dot, theta_ddot, theta_dddot;
  RowMatrix stage_multipliers;   // N x n, of the equation of motion
};

Motion solve(const Problem& problem, const StageDynamics& dynamics, const SolveOptions& options);

}  // namespace exactarm::ocp
