// Solves a Problem with Ipopt (Waechter and Biegler 2006). The adapter only translates.
// Linear solver: MUMPS, linked with Ipopt, or MA27 where an HSL library (libhsl.so, libcoinhsl.so) is
// found at run time.
#pragma once

#include <functional>
#include <string>

#include "exactarm/nlp/kkt_error.hpp"

namespace exactarm::nlp {

enum class Status {
  solved,
  acceptable,        // stopped at a looser tolerance
  infeasible,
  iteration_limit,
  time_limit,
  stopped,           // by the caller
  numerical_failure  // the message says what
};

const char* status_name(Status status);

struct IpoptOptions {
  std::string linear_solver = "mumps";
  double tolerance = 1e-7;           // stationarity of the scaled problem
  double feasibility = 1e-10;        // equations and bounds
  double objective_scale = 1.0;
  double first_barrier = 1e-6;
  double last_barrier = 1e-10;       // complementarity, of the scaled problem
  int iterations = 200;
  double seconds = 1e6;
  int print_level = 0;
  // MUMPS' own permutation and scaling: without them it is faster, but where the entries of the Hessian lie
  // ten orders apart it solves to too few digits.
  bool permute = false;
};

struct Solution {
  Status status = Status::numerical_failure;
  std::string message;        // the solver's own words
  std::string linear_solver;  // the one that ran
  int iterations = 0;
  double seconds = 0.0, objective = 0.0;  // objective unscaled
  double objective_scale = 1.0;
  Point point;                // multipliers of the objective times objective_scale
};

// Throws InvalidArgument for an unknown linear solver or one that is not installed.
Solution solve_ipopt(Problem& problem, const IpoptOptions& options);

// Whether MA27 can run here; `reason` says why not.
bool ma27_available(std::string* reason = nullptr);

}  // namespace exactarm::nlp
